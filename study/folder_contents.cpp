// SPDX-License-Identifier: Apache-2.0
#include "study/folder_contents.h"

#include <initializer_list>
#include <string_view>
#include <system_error>

#include "study/records.h"
#include "study/sweep_plan.h"
#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

bool is_there(const fs::path& path) {
    std::error_code error;
    return fs::symlink_status(path, error).type() != fs::file_type::not_found;
}

bool begins_with(const fs::path& file, std::string_view text) {
    try {
        return read_beginning(file, text.size()) == text;
    } catch (const Error&) {
        return false;  // whatever it is, no sweep wrote it
    }
}

constexpr std::string_view kSweepManifest = "{\n  \"format\": \"nephos sweep\"",
                           kFit = "{\n  \"format\": \"nephos fit\"";

void require_absent(const fs::path& file, std::string_view by) {
    if (!is_there(file)) return;
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: is there, but {} did not write it, and would replace it: give another folder",
                    file.string(), by));
}

}  // namespace

void require_own(const fs::path& file, std::string_view beginning, std::string_view by) {
    if (!begins_with(file, beginning)) require_absent(file, by);
}

void require_sweep_folder(const fs::path& folder) {
    constexpr std::string_view kSweep = "a sweep";
    require_own(folder / "manifest.json", kSweepManifest, kSweep);
    if (has_shards(folder)) return;  // also of a version that marked nothing
    require_own(folder / "scene.toml", kWrittenBySweep, kSweep);
    require_own(folder / "sweep.toml", kWrittenBySweep, kSweep);
    // Leaves links and pipes to open_regular_file(), which refuses them with the reason.
    std::error_code error;
    if (fs::is_regular_file(fs::symlink_status(folder / "timing.csv", error)))
        require_own(folder / "timing.csv", "shard,shards,", kSweep);
    if (is_there(folder / "manifest.json")) return;  // the last of the tables
    require_own(folder / "runs.csv", "run,point,replicate,", kSweep);
    if (is_there(folder / "runs.csv")) return;  // the first of them
    for (const char* name : {"points.csv", "failures.csv", "tracks.csv", "series.nc"})
        require_absent(folder / name, kSweep);
}

void require_fit_folder(const fs::path& folder) {
    for (const char* part : {"wave-1", "wave-2", "wave-3", "proof"}) require_sweep_folder(folder / part);
    if (has_shards(folder / "wave-1") || begins_with(folder / "fit.json", kFit)) return;
    for (const char* name : {"fit.json", "fitted.toml", "posterior.csv"})
        require_absent(folder / name, "a fit");
}

}  // namespace nephos
