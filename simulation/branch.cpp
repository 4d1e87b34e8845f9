// SPDX-License-Identifier: Apache-2.0
#include "simulation/branch.h"

#include <algorithm>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/digest.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/earlier_run.h"
#include "simulation/manifest.h"
#include "simulation/statistics_file.h"

namespace nephos {
namespace {

// Returns true when the manifest beside a checkpoint, by the path that it was named by, is that of its run. Throws ReadFailure.
bool is_of_run_beside(const std::filesystem::path& checkpoint) {
    try {
        return read_manifest(RunFolder{checkpoint.parent_path(), {}}.manifest()).simulation_hash ==
               read_checkpoint(checkpoint).simulation_hash;
    } catch (const ReadFailure&) {  // it may be that one
        throw;
    } catch (const Error&) {
        return false;
    }
}

// The checkpoint of a run, which is named by its folder or by the file itself.
std::filesystem::path checkpoint_of(const std::filesystem::path& from) {
    const auto refuse = [&](const char* what) {
        throw Error(ErrorCode::io, from.string() + ": " + what + ": expected the folder of a run, or its checkpoint");
    };
    if (!is_there(from)) refuse("no such run");
    if (type_behind(from) != std::filesystem::file_type::directory) {
        if (!is_checkpoint(from)) refuse("is no checkpoint of a run");
        // What belongs to it lies beside it, or beside what a link leads to.
        const bool is_link = type_at(from) == std::filesystem::file_type::symlink;
        return is_link && !is_of_run_beside(from) ? std::filesystem::canonical(from) : from;
    }
    const std::filesystem::path checkpoint = from / "checkpoint.nephos";
    if (!is_there(checkpoint)) refuse("holds no checkpoint of a run");
    return checkpoint;
}

RunFolder folder_of(const std::filesystem::path& checkpoint, const Scene& scene) {
    return {checkpoint.parent_path(), scene.name};
}

BranchPoint point_of(const Checkpoint& checkpoint, const std::filesystem::path& file) {
    BranchPoint point;
    point.checkpoint = file;
    point.simulation_hash = checkpoint.simulation_hash;
    point.state_hash = checkpoint.state.hex();
    point.steps = checkpoint.steps;
    point.next_frame = saved_point(checkpoint).next_frame;
    return point;
}

bool is_same(const BranchPoint& a, const BranchPoint& b) {
    return a.simulation_hash == b.simulation_hash && a.state_hash == b.state_hash && a.steps == b.steps &&
           a.next_frame == b.next_frame;
}

// Returns whether `from`, which need not be there any more, names this checkpoint or its folder.
bool is_place(const std::filesystem::path& from, const std::filesystem::path& checkpoint) {
    std::error_code error;
    const std::filesystem::path whole = std::filesystem::absolute(from, error);
    const std::filesystem::path place = std::filesystem::weakly_canonical(checkpoint, error);
    return std::filesystem::weakly_canonical(whole, error) == place ||
           std::filesystem::weakly_canonical(whole / place.filename(), error) == place;
}

// Returns the simulation hash of a branch, whose scene alone has that of `scene`.
std::string branch_hash(const std::string& scene, const BranchPoint& point) {
    Digest digest;
    digest.add(scene);
    digest.add(point.simulation_hash);
    digest.add(point.state_hash);
    digest.add(std::to_string(point.steps));
    return digest.hex();
}

// Frames are counted on from those of the other run. Throws Error(usage) where the scene's numbers and times put a frame that
// is still to come among those that have been, or the first one to come before the states that the checkpoint holds.
void require_frames_after(const RunSettings& settings, std::uint64_t next_step, const BranchPoint& point) {
    if (settings.statistics_only) return;  // there are none
    const Scene& scene = settings.scene;
    const int next = point.next_frame, last = settings.range.last_frame, before = std::min(next - 1, last);
    const auto time_s = [&](int number) { return frame_time_s(scene.frames, number - 1); };
    const double branch_s = double(next_step == 0 ? 0 : next_step - 1) * scene.automaton.time_step_s;
    const auto fail = [&](int number, const char* what) {
        throw Error(
            ErrorCode::usage,
            fmt::format(
                "{}: its frames go on with number {}, and frame {} of the scene, at {:g} s, is {} the run "
                "branches off at, {:g} s: expected `frames.start_s` such that frame {} is the first one from "
                "there on",
                point.checkpoint.string(), next, number, time_s(number), what, branch_s, next));
    };
    if (before > 0 && steps_up_to(moment_of_frame(scene, before - 1)) >= next_step)
        fail(before, "after the moment that");
    if (next <= last && steps_up_to(moment_of_frame(scene, next - 1)) + 1 < next_step)
        fail(next, "before the moment that");
}

}  // namespace

void branch_off(RunSettings& settings, const std::filesystem::path& from) {
    const std::filesystem::path file = checkpoint_of(from);
    const Checkpoint checkpoint = read_checkpoint(file);
    const SavedPoint saved = saved_point(checkpoint);
    if (saved.next_step > settings.scene.steps + 1) {
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: was saved at step {}, but the scene ends at step {}: expected more `time.steps`",
                        file.string(), saved.next_step, settings.scene.steps));
    }
    BranchPoint point = point_of(checkpoint, file);
    require_frames_after(settings, saved.next_step, point);
    branch_off(settings, std::move(point));
}

void branch_off(RunSettings& settings, BranchPoint point) {
    settings.range.first_frame = point.next_frame;
    settings.simulation_hash = branch_hash(settings.simulation_hash, point);
    settings.branch = std::move(point);
}

std::optional<BranchPoint> branch_in(const std::filesystem::path& folder, const std::filesystem::path& from) {
    const RunFolder run{folder, {}};
    if (!std::filesystem::exists(run.checkpoint()) || !std::filesystem::exists(run.manifest())) return {};
    std::optional<BranchPoint> point = read_manifest(run.manifest()).branch;
    if (!point || point->simulation_hash.empty()) return {};
    if (from.empty() || is_place(from, point->place)) return point;
    const std::filesystem::path file = checkpoint_of(from);
    if (is_same(point_of(read_checkpoint(file), file), *point)) return point;
    throw Error(ErrorCode::usage,
                fmt::format("{}: branched off {}, not {}: give the --from of the first call, or none",
                            folder.string(), point->checkpoint.string(), from.string()));
}

bool is_branch_point(const Checkpoint& checkpoint, const BranchPoint& point, const Scene& scene,
                     const std::string& simulation_hash) {
    const BranchPoint found = point_of(checkpoint, point.checkpoint);
    if (found.next_frame != point.next_frame) return false;
    if (!point.simulation_hash.empty()) return is_same(found, point);
    return branch_hash(run_settings(scene, {}, RunStart::checkpoint).simulation_hash, found) ==
           simulation_hash;
}

std::string scene_text_beside(const std::filesystem::path& from) {
    const std::filesystem::path manifest =
        from / "manifest.json";  // of a folder, which needs no checkpoint for this
    std::error_code error;
    return read_scene_text_of(std::filesystem::exists(manifest, error)
                                  ? manifest
                                  : checkpoint_of(from).parent_path() / "manifest.json");
}

Simulation branched_simulation(const RunSettings& settings, const RunFolder& folder) {
    const Checkpoint checkpoint = read_checkpoint(settings.branch->checkpoint);
    if (!is_same(point_of(checkpoint, settings.branch->checkpoint), *settings.branch))
        throw Error(ErrorCode::io, settings.branch->checkpoint.string() +
                                       ": was changed while the branch began: give the same command again");
    const RunFolder parent = folder_of(settings.branch->checkpoint, settings.scene);
    if (is_same_place(parent.folder.empty() ? "." : parent.folder, folder.folder)) {
        throw Error(ErrorCode::usage, folder.folder.string() +
                                          ": is the folder of the run that is branched off: expected another one");
    }
    try {
        return {settings.scene, settings.range,     settings.simulation_hash,
                checkpoint,     settings.results(), Restart::branch};
    } catch (const Error& error) {
        if (error.code() != ErrorCode::usage) throw;
        throw Error(ErrorCode::usage, settings.branch->checkpoint.string() + ": " + error.what());
    }
}

void refuse_to_remove_other_run(const RunSettings& settings,
                                const std::vector<std::filesystem::path>& files) {
    const RunFolder parent = folder_of(settings.branch->checkpoint, settings.scene);
    if (is_same_place(settings.folder, parent.folder)) return;  // which branched_simulation() refuses
    std::vector<std::filesystem::path> needed{settings.branch->checkpoint, parent.statistics()};
    for (const LayerOptions& layer : settings.scene.layers) needed.push_back(parent.statistics(layer.name));
    for (const std::filesystem::path& each : needed) {
        const auto found = std::ranges::find_if(
            files, [&](const std::filesystem::path& file) { return is_same_place(file, each); });
        if (found == files.end()) continue;
        throw Error(ErrorCode::usage,
                    fmt::format("{}: is {} of the run to branch off, and would be replaced: choose "
                                "another --out",
                                found->string(), each.string()));
    }
}

std::vector<OtherTable> tables_of_other_run(const RunSettings& settings, const RunFolder& folder,
                                            std::uint64_t steps) {
    const RunFolder parent = folder_of(settings.branch->checkpoint, settings.scene);
    if (!is_there(parent.manifest()))
        throw Error(
            ErrorCode::io,
            fmt::format("{}: has no manifest.json beside it, which says whose the statistics are that the "
                        "branch begins with: give the folder of the run, or copy that as a whole",
                        settings.branch->checkpoint.string()));
    const EarlierRun run = read_manifest(parent.manifest());
    if (run.simulation_hash != settings.branch->simulation_hash)
        throw Error(ErrorCode::io,
                    fmt::format("{}: is not of the run in the folder that it lies in, whose statistics the "
                                "branch begins with",
                                settings.branch->checkpoint.string()));
    std::vector<OtherTable> tables;
    const auto open = [&](const std::filesystem::path& path, const std::filesystem::path& copy,
                          std::string_view header) {
        OtherTable& table = tables.emplace_back(OtherTable{path, copy, header, open_stream(path)});
        for (const FileRecord& saved : run.tables)
            if (parent.folder / saved.path == path) require_table_of_run(table.file, path, saved.digest);
        read_statistics(table.file, path, steps, {}, header);
    };
    open(parent.statistics(), folder.statistics(), kStatisticsHeader);
    for (const LayerOptions& layer : settings.scene.layers)
        open(parent.statistics(layer.name), folder.statistics(layer.name), kLayerStatisticsHeader);
    return tables;
}

void copy_rows(std::vector<OtherTable>& tables, std::uint64_t steps) {
    for (OtherTable& table : tables) {
        write_pieces_atomically(table.copy, [&](const AppendPiece& append) {
            constexpr std::size_t kPiece = 1u << 20;  // a table may be larger than memory
            std::string rows(table.header);
            read_statistics(
                table.file, table.path, steps,
                [&](std::uint64_t, std::string_view row, const StateHash&) {
                    (rows += row) += '\n';
                    if (rows.size() < kPiece) return;
                    append(rows);
                    rows.clear();
                },
                table.header);
            append(rows);
        });
    }
}

}  // namespace nephos
