// SPDX-License-Identifier: Apache-2.0
#include "apps/mpi/statistics_table.h"

#include <cmath>
#include <cstring>
#include <span>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "study/folder_contents.h"
#include <fcntl.h>
#include <fmt/format.h>

#include "core/error.h"
#include "core/paths.h"
#include "core/text.h"
#include "scenes/format/named_files.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

// The text of a number, nothing where there is none.
std::string field(double value) { return std::isfinite(value) ? number_text(value) : std::string(); }

// Returns what an earlier call has left: the table, and levels of a state.
std::vector<fs::path> earlier_files(const fs::path& folder) {
    std::vector<fs::path> files;
    for (const std::string& name : names_in_folder(folder)) {
        constexpr std::string_view kBegin = "levels_", kEnd = ".vdb";
        bool is_levels = name.starts_with(kBegin) && name.ends_with(kEnd) &&
                         name.size() >= kBegin.size() + 5 + kEnd.size();
        for (std::size_t n = kBegin.size(); is_levels && n < name.size() - kEnd.size(); ++n)
            is_levels = name[n] >= '0' && name[n] <= '9';
        if (is_levels || name == "statistics.csv") files.push_back(folder / name);
    }
    return files;
}

// Throws Error(usage) for a file of a run, a sweep, a fit, an export or the scene, and for a folder.
void require_nobodys(const fs::path& file, Scene& scene) {
    const auto refuse = [&](const std::string& whose) {
        throw Error(ErrorCode::usage, fmt::format("{}: is {}: give another folder", file.string(), whose));
    };
    if (type_at(file) == fs::file_type::directory) refuse("a folder");
    if (type_behind(file) != fs::file_type::regular) return;
    if (const auto owner = owner_of_file(file)) refuse(*owner);
    if (is_same_place(scene.file_places.scene_file, file)) refuse("the scene");
    for_each_file(scene, [&](const std::string& key, FileKind, const fs::path& named) {
        if (is_same_place(named, file)) refuse(fmt::format("what `{}` of the scene names", key));
        return named;
    });
}

// Returns the place of the table, where nothing stands any more.
fs::path cleared(const fs::path& folder, bool overwrite, Scene& scene) {
    std::error_code error;
    for (const char* name :
         {"manifest.json", "checkpoint.nephos", "sweep.toml", "shards", "export.json", "fit.json"})
        if (stands_there(folder / name))
            throw Error(ErrorCode::usage, fmt::format("{}: holds {} of another command: give another folder",
                                                      folder.string(), name));
    const std::vector<fs::path> files = earlier_files(folder);
    if (!files.empty() && !overwrite)
        throw Error(ErrorCode::usage,
                    files.front().string() + ": is there already: give --overwrite, or another folder");
    for (const fs::path& file : files) require_nobodys(file, scene);
    for (const fs::path& file : files)
        if (!fs::remove(file, error) && error)
            throw Error(ErrorCode::io, file.string() + ": cannot remove: " + error.message());
    return folder / "statistics.csv";
}

}  // namespace

StatisticsTable::StatisticsTable(const fs::path& folder, bool overwrite, Scene scene) : lock_(folder, "run") {
    path_ = cleared(folder, overwrite, scene);
    file_ = open_regular_file(path_, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW);
    write("step,time_s,hum,act,cld,cloud_cover,base_m,top_m,base_mean_m,top_mean_m,perimeter_m,hash\n");
}

void StatisticsTable::add(std::uint64_t step, double time_s, const CloudStatistics& s,
                          const std::string& hash) {
    lock_.require_in_place();
    write(fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", step, number_text(time_s), s.hum, s.act, s.cld,
                      field(s.cover), field(s.base_m), field(s.top_m), field(s.base_mean_m),
                      field(s.top_mean_m), field(s.perimeter_m), hash));
}

void StatisticsTable::write(const std::string& text) {
    if (const int error = write_all(file_.get(), std::as_bytes(std::span(text))))
        throw Error(ErrorCode::io, path_.string() + ": cannot write: " + std::strerror(error));
}

}  // namespace nephos
