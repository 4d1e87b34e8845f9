// SPDX-License-Identifier: Apache-2.0
#include "study/folder_contents.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include "study/report.h"
#include "study/shard_files.h"
#include "study/sweep_plan.h"
#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/export/export.h"
#include "simulation/run_listing.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

// Returns nothing for what is no file: whatever it is, no sweep wrote it. Throws ReadFailure.
std::string beginning_of(const fs::path& file, std::size_t most) {
    try {
        return read_beginning(file, most);
    } catch (const ReadFailure&) {
        throw;  // which says nothing of its content
    } catch (const Error&) {
        return {};
    }
}

bool begins_with(const fs::path& file, std::string_view text) {
    return beginning_of(file, text.size()) == text;
}

constexpr std::string_view kSweepManifest = "{\n  \"format\": \"nephos sweep\"",
                           kFit = "{\n  \"format\": \"nephos fit\"", kSweep = "a sweep";

// The tables of a sweep that are text, and how their first lines begin.
constexpr std::pair<std::string_view, std::string_view> kTables[] = {
    {"manifest.json", kSweepManifest},
    {"scene.toml", kWrittenBySweep},
    {"sweep.toml", kWrittenBySweep},
    {"runs.csv", "run,point,replicate,"},
    {"points.csv", "point,"},
    {"failures.csv", "run,point,replicate,"},
    {"tracks.csv", "run,point,replicate,"},
};

// Returns whether the plan and the scene in a folder of records are those of a version that marked nothing.
bool is_unmarked(const fs::path& folder, std::string_view name) {
    constexpr std::string_view kPlan = "scene = \"scene.toml\"\ndesign = \"";
    return (name == "scene.toml" || name == "sweep.toml") && has_shards(folder) &&
           begins_with(folder / "sweep.toml", kPlan);
}

// NetCDF of a sweep: its title stands behind its few dimensions.
bool is_series_of_sweep(const fs::path& file) {
    constexpr std::size_t kHead = 4096;
    const std::string head = beginning_of(file, kHead);
    return head.starts_with("CDF") && head.find(kSweepTitle) != head.npos;
}

// Returns whether something stands there that is not ours. Another process may put a file of ours there, as a whole, or take one
// away, between two looks.
bool is_foreign(const fs::path& file, const std::function<bool()>& is_ours) {
    for (int look = 0; look < 2; ++look)
        if (!stands_there(file) || is_ours()) return false;
    return true;
}

// Returns whether a folder holds records or tables of a sweep, or its plan and scene.
bool is_sweep_folder(const fs::path& folder) {
    return has_shards(folder) || begins_with(folder / "manifest.json", kSweepManifest) ||
           (begins_with(folder / "scene.toml", kWrittenBySweep) &&
            begins_with(folder / "sweep.toml", kWrittenBySweep));
}

// Returns whether a file is called and begins like one of those in a sweep's folder.
bool is_named_by_sweep(const fs::path& file) {
    const std::string name = file.filename().string();
    const auto is_named = [&](const auto& named) {
        return named.first == name && (begins_with(file, named.second) || is_unmarked(holder_of(file), name));
    };
    if (name == "timing.csv") return true;
    if (name == "series.nc") return is_series_of_sweep(file);
    if (name == "report.html") return begins_with(file, kReportBeginning);
    return std::ranges::any_of(kTables, is_named) || std::ranges::any_of(kSweepScripts, is_named);
}

}  // namespace

void require_absent(const fs::path& file, std::string_view by) {
    if (!stands_there(file)) return;
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: is there, but {} did not write it, and would replace it: write to another place",
                    file.string(), by));
}

void require_own(const fs::path& file, std::string_view beginning, std::string_view by) {
    if (is_foreign(file, [&] { return begins_with(file, beginning); })) require_absent(file, by);
}

void require_sweep_folder(const fs::path& folder) {
    for (const auto& [name, beginning] : kTables)
        if (!is_unmarked(folder, name)) require_own(folder / name, beginning, kSweep);
    const fs::path series = folder / "series.nc";
    if (is_foreign(series, [&] { return is_series_of_sweep(series); })) require_absent(series, kSweep);
    // Leaves links and pipes to open_regular_file(), which refuses them with the reason; a killed sweep leaves it empty.
    const fs::path timing = folder / "timing.csv";
    if (type_at(timing) == fs::file_type::regular && !read_beginning(timing, 1).empty())
        require_own(timing, "shard,shards,", kSweep);
}

void require_fit_folder(const fs::path& folder) {
    for (const char* part : {"wave-1", "wave-2", "wave-3", "proof"}) require_sweep_folder(folder / part);
    require_own(folder / "fit.json", kFit, "a fit");
    if (begins_with(folder / "fit.json", kFit)) return;
    require_own(folder / "fitted.toml", kWrittenByFit, "a fit");
    // Its columns are keys of a scene; it is written after the fitted scene.
    if (!begins_with(folder / "fitted.toml", kWrittenByFit))
        require_absent(folder / "posterior.csv", "a fit");
}

std::optional<fs::path> sweep_with_file(const fs::path& file) {
    if (type_behind(file) != fs::file_type::regular) return {};
    for (const fs::path& path : paths_to(file)) {
        const std::string name = path.filename().string();
        const fs::path folder = holder_of(path);
        if (name == "lock" || is_name_of_shard(fs::path(name).replace_extension(".jsonl"))) {
            const fs::path sweep = holder_of(folder);
            if (is_same_place(sweep / "shards", folder) && has_shards(sweep)) return sweep;
        }
        if (is_named_by_sweep(path) && is_sweep_folder(folder)) return folder;
    }
    return {};
}

std::optional<fs::path> fit_with_file(const fs::path& file) {
    if (type_behind(file) != fs::file_type::regular) return {};
    for (const fs::path& path : paths_to(file)) {
        const std::string name = path.filename().string();
        const fs::path folder = holder_of(path);
        // Others beside them say nothing of a fit, and may be nobody's to read.
        if (name != "fit.json" && name != "fitted.toml" && name != "posterior.csv") continue;
        if (name == "fitted.toml" && !begins_with(path, kWrittenByFit)) continue;
        if (begins_with(folder / "fit.json", kFit)) return folder;
        // One that was killed has no fit.json yet, and knows its samples by the scene that it writes before them.
        if (name != "fit.json" && is_sweep_folder(folder / "wave-1") &&
            begins_with(folder / "fitted.toml", kWrittenByFit))
            return folder;
    }
    return {};
}

std::optional<std::string> owner_of_file(const fs::path& file) {
    const auto of = [](const char* kind, const fs::path& folder) {
        std::error_code error;
        fs::path whole = fs::absolute(folder, error);
        whole = normal_path(error ? folder : whole);
        if (!whole.has_filename()) whole = whole.parent_path();  // "a/"
        return fmt::format("a file of the {} in {}", kind, whole.string());
    };
    if (const auto sweep = sweep_with_file(file)) return of("sweep", *sweep);
    if (const auto fit = fit_with_file(file)) return of("fit", *fit);
    if (const auto run = run_with_file(file)) return of("run", *run);
    if (const auto exported = export_with_file(file)) return of("export", *exported);
    return {};
}

}  // namespace nephos
