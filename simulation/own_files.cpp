// SPDX-License-Identifier: Apache-2.0
#include "simulation/own_files.h"

#include <algorithm>
#include <charconv>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/paths.h"
#include "simulation/run_listing.h"
#include "simulation/run_parts.h"
#include "simulation/statistics_file.h"

namespace nephos {
namespace {

// Returns whether a file is there whose first bytes have this digest; `whole`: and no byte more.
bool has_content(const std::filesystem::path& file, const FileDigest& digest, bool whole) {
    if (type_behind(file) != std::filesystem::file_type::regular) return false;
    std::error_code error;
    const std::uintmax_t bytes = std::filesystem::file_size(file, error);
    if (!error && (whole ? bytes != digest.bytes : bytes < digest.bytes)) return false;
    return file_digest(file, whole ? ~std::uint64_t{0} : digest.bytes) == digest;
}

}  // namespace

bool is_frame_of(const std::string& file, const std::string& name) {
    if (!file.starts_with(name + "_")) return false;
    const std::size_t dot = file.rfind('.');
    const std::string extension = dot == file.npos ? "" : file.substr(dot);
    if (extension != ".vdb" && extension != ".png" && extension != ".exr") return false;
    const std::string number = file.substr(name.size() + 1, dot - name.size() - 1);
    return number.size() >= 4 &&
           std::all_of(number.begin(), number.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_frame_place(const RunFolder& folder, const Scene& scene, const SimulationRange& range, bool pictures,
                    const std::filesystem::path& file) {
    const std::string name = file.filename().string();
    const std::size_t begin = folder.name.size() + 1;
    int number = 0;
    if (!is_frame_of(name, folder.name)) return false;
    const auto parsed = std::from_chars(name.data() + begin, name.data() + name.size(), number);
    if (parsed.ec != std::errc() || number < range.first_frame || number > range.last_frame) return false;
    return std::ranges::count(density_files(folder, scene, number), file) > 0 ||
           (pictures && std::ranges::count(picture_files(folder, scene, number), file) > 0);
}

bool names_hash(const std::filesystem::path& file, const std::string& hash) {
    // A video has the places of all its pictures beside its metadata.
    constexpr std::size_t kMostOfMetadata = 4096, kMostOfVideo = std::size_t(64) << 20;
    return type_behind(file) == std::filesystem::file_type::regular &&
           read_beginning(file, file.extension() == ".mp4" ? kMostOfVideo : kMostOfMetadata).find(hash) !=
               std::string::npos;
}

OwnFiles::OwnFiles(const std::filesystem::path& folder, EarlierRun run, const Scene& scene)
    : folder_{folder, run.name}, run_(std::move(run)), scene_(scene) {
    std::vector<std::filesystem::path> parts = parts_of_run(folder_, scene, run_.range, run_.render);
    parts.push_back(folder);
    for (const std::filesystem::path& part : parts)
        if (const std::optional<FileIdentity> identity = identity_behind(part))
            folders_.emplace(*identity, part);
    if (!run_.complete) return;
    const RunListing listing = read_run(folder);
    const auto add = [&](const std::vector<FileRecord>& records) {
        for (const FileRecord& record : records) listed_.emplace(record.path, record.digest);
    };
    for (const ListedFrame& frame : listing.frames) add(frame.files);
    lists_frames_ = !listed_.empty() || listing.frames.empty();
    add(listing.run_files);
    lists_tables_and_video_ = !listing.run_files.empty();
}

bool OwnFiles::is_place(const std::filesystem::path& file) const {
    const bool has_video = run_.render && wants_video(scene_);
    return file == folder_.statistics() || file == folder_.checkpoint() ||
           (has_video && file == folder_.video()) ||
           std::ranges::any_of(
               scene_.layers,
               [&](const LayerOptions& layer) { return file == folder_.statistics(layer.name); }) ||
           is_frame_place(folder_, scene_, run_.range, run_.render, file);
}

bool OwnFiles::is_own_path(const std::filesystem::path& file) const {
    const bool is_listed_kind =
        is_frame_of(file.filename().string(), folder_.name) ? lists_frames_ : lists_tables_and_video_;
    if (is_listed_kind) return listed_.contains(file.lexically_relative(folder_.folder).generic_string());
    return is_place(file);
}

std::optional<std::filesystem::path> OwnFiles::own_path(const std::filesystem::path& file) const {
    if (is_own_path(file)) return file;
    const std::optional<FileIdentity> place = identity_behind(holder_of(file));
    if (!place) return std::nullopt;
    const auto [begin, end] = folders_.equal_range(*place);
    for (auto folder = begin; folder != end; ++folder)
        if (is_own_path(folder->second / file.filename())) return folder->second / file.filename();
    return std::nullopt;
}

std::optional<std::string> OwnFiles::why_foreign(const std::filesystem::path& file) const {
    const std::optional<std::filesystem::path> own = own_path(file);
    const std::string path = own.value_or(file).lexically_relative(folder_.folder).generic_string();
    if (!own) return fmt::format("there is {}, which the run in it has not written", path);
    const bool is_layers = own->parent_path() != folder_.folder;
    if (path.ends_with(".csv") &&
        is_begun_statistics(*own, is_layers ? kLayerStatisticsHeader : kStatisticsHeader))
        return std::nullopt;  // nothing is in it
    const auto listed = listed_.find(path);
    const auto table = std::ranges::find(run_.tables, path, &FileRecord::path);
    // A video of a complete run that is not listed is of an earlier version, which left no hash in it.
    const bool names_scene =
        is_frame_of(own->filename().string(), folder_.name) || (*own == folder_.video() && !run_.complete);
    const bool is_right = listed != listed_.end()      ? has_content(*own, listed->second, true)
                          : table != run_.tables.end() ? has_content(*own, table->digest, false)
                          : names_scene                ? names_hash(*own, run_.frames_hash)
                                                       : true;
    if (is_right) return std::nullopt;
    return fmt::format("{} is not what the run in it has written", path);
}

}  // namespace nephos
