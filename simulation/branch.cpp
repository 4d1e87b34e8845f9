// SPDX-License-Identifier: Apache-2.0
#include "simulation/branch.h"

#include <string_view>
#include <system_error>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/atomic_file.h"
#include "core/digest.h"
#include "core/error.h"
#include "simulation/earlier_run.h"
#include "simulation/manifest.h"
#include "simulation/statistics_file.h"

namespace nephos {
namespace {

// The checkpoint of a run, which is named by its folder or by the file itself.
std::filesystem::path checkpoint_of(const std::filesystem::path& from) {
    const auto refuse = [&](const char* what) {
        throw Error(ErrorCode::io, from.string() + ": " + what + ": expected the folder of a run, or its checkpoint");
    };
    std::error_code error;
    if (!std::filesystem::exists(from, error)) refuse("no such run");
    if (!std::filesystem::is_directory(from, error)) {
        if (!is_checkpoint(from)) refuse("is no checkpoint of a run");
        return from;
    }
    const std::filesystem::path checkpoint = from / "checkpoint.nephos";
    if (!std::filesystem::exists(checkpoint, error)) refuse("holds no checkpoint of a run");
    return checkpoint;
}

RunFolder folder_of(const std::filesystem::path& checkpoint, const Scene& scene) {
    return {checkpoint.parent_path(), scene.name};
}

// Copies the header and the rows of all steps before `steps`.
void copy_statistics(const std::filesystem::path& from, const std::filesystem::path& to, std::uint64_t steps,
                     std::string_view header) {
    std::string rows(header);
    read_statistics(
        from, steps, [&](std::uint64_t, std::string_view row, const StateHash&) { (rows += row) += '\n'; }, header);
    std::error_code error;
    std::filesystem::create_directories(to.parent_path(), error);
    if (error) throw Error(ErrorCode::io, to.parent_path().string() + ": cannot make the folder: " + error.message());
    write_atomically(to, rows);
}

}  // namespace

void branch_off(RunSettings& settings, const std::filesystem::path& from) {
    settings.branch = checkpoint_of(from);
    const Checkpoint checkpoint = read_checkpoint(*settings.branch);
    const SavedPoint point = saved_point(checkpoint);
    if (point.next_step > settings.scene.steps + 1) {
        throw Error(ErrorCode::usage,
                    fmt::format("{}: was saved at step {}, but the scene ends at step {}: expected more `time.steps`",
                                settings.branch->string(), point.next_step, settings.scene.steps));
    }
    settings.range.first_frame = point.next_frame;
    Digest digest;
    digest.add(settings.simulation_hash);
    digest.add(checkpoint.simulation_hash);
    digest.add(checkpoint.state.hex());
    digest.add(std::to_string(checkpoint.steps));
    settings.simulation_hash = digest.hex();
}

std::string scene_text_beside(const std::filesystem::path& from) {
    return read_scene_text_of(checkpoint_of(from).parent_path() / "manifest.json");
}

Simulation branched_simulation(const RunSettings& settings, const RunFolder& folder) {
    const Checkpoint checkpoint = read_checkpoint(*settings.branch);
    const std::uint64_t steps = saved_point(checkpoint).next_step;
    const RunFolder parent = folder_of(*settings.branch, settings.scene);
    std::error_code failed;
    if (std::filesystem::equivalent(parent.folder.empty() ? "." : parent.folder, folder.folder, failed)) {
        throw Error(ErrorCode::usage, folder.folder.string() +
                                          ": is the folder of the run that is branched off: expected another one");
    }
    try {
        Simulation simulation(settings.scene, settings.range, settings.simulation_hash, checkpoint, settings.results(),
                              Restart::branch);
        remove_earlier_run(folder);
        copy_statistics(parent.statistics(), folder.statistics(), steps, kStatisticsHeader);
        for (const LayerOptions& layer : settings.scene.layers)
            copy_statistics(parent.statistics(layer.name), folder.statistics(layer.name), steps, kLayerStatisticsHeader);
        return simulation;
    } catch (const Error& error) {
        if (error.code() != ErrorCode::usage) throw;
        throw Error(ErrorCode::usage, settings.branch->string() + ": " + error.what());
    }
}

}  // namespace nephos
