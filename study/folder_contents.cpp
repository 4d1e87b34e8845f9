// SPDX-License-Identifier: Apache-2.0
#include "study/folder_contents.h"

#include <initializer_list>
#include <optional>
#include <string>
#include <system_error>

#include "study/sweep_file.h"
#include "study/sweep_plan.h"
#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostBytes = std::size_t(64) << 20;  // of a plan that is compared

bool is_there(const fs::path& path) {
    std::error_code error;
    return fs::symlink_status(path, error).type() != fs::file_type::not_found;
}

// Tables and fits have a file in JSON that begins with what it is.
bool is_of(const fs::path& file, const std::string& format) {
    constexpr std::size_t kBeginning = 64;
    try {
        return read_beginning(file, kBeginning).starts_with("{\n  \"format\": \"" + format + "\"");
    } catch (const Error&) {
        return false;
    }
}

// Returns the plan of a sweep.toml that a sweep wrote: it is as SweepPlan::to_toml() writes it.
std::optional<SweepPlan> written_plan(const fs::path& folder) {
    const fs::path file = folder / "sweep.toml";
    try {
        SweepPlan plan(read_sweep_file(file));
        if (plan.to_toml() == read_beginning(file, kMostBytes)) return plan;
    } catch (const Error&) {
        // Not one that can be run.
    }
    return {};
}

[[noreturn]] void refuse(const fs::path& folder, const std::string& name, const std::string& of) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: is there, but {} did not write it, and would replace it: give another folder",
                            (folder / name).string(), of));
}

}  // namespace

void require_sweep_folder(const fs::path& folder) {
    std::error_code error;
    if (fs::is_directory(folder / "shards", error)) return;
    if (!is_of(folder / "manifest.json", "nephos sweep"))
        for (const char* name : {"manifest.json", "runs.csv", "points.csv", "failures.csv", "tracks.csv", "series.nc"})
            if (is_there(folder / name)) refuse(folder, name, "a sweep");
    const bool has_plan = is_there(folder / "sweep.toml"), has_scene = is_there(folder / "scene.toml");
    if (!has_plan && !has_scene) return;
    if (!has_plan) refuse(folder, "scene.toml", "a sweep");
    const std::optional<SweepPlan> plan = written_plan(folder);
    if (!plan) refuse(folder, "sweep.toml", "a sweep");
    if (has_scene && plan->scene_text_in(folder) != read_beginning(folder / "scene.toml", kMostBytes))
        refuse(folder, "scene.toml", "a sweep");
}

void require_fit_folder(const fs::path& folder) {
    std::error_code error;
    if (fs::is_directory(folder / "wave-1", error) || is_of(folder / "fit.json", "nephos fit")) return;
    for (const char* name : {"fit.json", "fitted.toml", "posterior.csv"})
        if (is_there(folder / name)) refuse(folder, name, "a fit");
}

}  // namespace nephos
