// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export_list.h"

#include <algorithm>
#include <cstdint>
#include <set>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>
#include <unistd.h>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/checked_json.h"
#include "simulation/manifest.h"
#include "simulation/sealed_json.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kFormatVersion = 1;

Json layout_json(const VolumeLayout& layout) {
    return {{"factor", layout.factor},      {"axes", int(layout.axes)},
            {"border", int(layout.border)}, {"periodic", layout.periodic},
            {"multiple", layout.multiple},  {"power_of_two", layout.power_of_two}};
}

// Limits of what an export makes: they keep sizes that a damaged list states from taking all memory.
constexpr int kMostFactor = 1 << 20, kMostMultiple = 1 << 24, kMostLevels = 32;

VolumeLayout layout_of(const CheckedJson& json) {
    VolumeLayout layout;
    layout.factor = int(json.at("factor").integer(1, kMostFactor));
    layout.axes = AxisOrder(json.at("axes").integer(0, int(AxisOrder::unreal)));
    layout.border = Border(json.at("border").integer(0, int(Border::wrap)));
    const std::vector<CheckedJson> periodic = json.at("periodic").items();
    if (periodic.size() != layout.periodic.size()) json.at("periodic").fail("three of true or false");
    for (std::size_t a = 0; a < periodic.size(); ++a) layout.periodic[a] = periodic[a].truth();
    layout.multiple = int(json.at("multiple").integer(1, kMostMultiple));
    layout.power_of_two = json.at("power_of_two").truth();
    return layout;
}

// All that decides the bytes of files.
Json head_json(const ExportOptions& o, const std::vector<ExportSequence>& sequences) {
    Json list = Json::array();
    for (const ExportSequence& s : sequences) {
        list.push_back({{"name", s.name},
                        {"layer", s.layer},
                        {"levels", s.levels},
                        {"scale", s.scale},
                        {"layout", layout_json(s.layout)},
                        {"scene_hash", s.metadata.scene_hash}});
    }
    Json types = Json::object();
    for (const ExportFormat format : all_formats(o)) {
        for (const NamedFormat& named : export_formats())
            if (named.format == format) types[std::string(named.name)] = int(type_of(o, format));
    }
    return {{"format", "nephos export"},
            {"format_version", kFormatVersion},
            {"nephos_version", version()},
            {"target", o.target},
            {"options",
             {{"types", types},
              {"zip", o.zip},
              {"legacy_dds", o.legacy_dds},
              {"quantise", int(o.quantise)},
              {"half_voxel_shift", o.half_voxel_shift},
              {"velocity", o.velocity_name},
              {"brick_edge", o.brick_edge},
              {"grid", o.grid}}},
            {"sequences", list}};
}

constexpr std::int64_t kMostBytes = std::int64_t(1) << 60;

std::string format_name_of(const CheckedJson& json) {
    const std::string name = json.text();
    std::string names;
    for (const NamedFormat& named : export_formats()) {
        if (named.name == name) return name;
        names += (names.empty() ? "" : ", ") + std::string(named.name);
    }
    json.fail("one of " + names);
}

ExportedFile file_of(const CheckedJson& json) {
    ExportedFile file;
    file.path = json.at("path").text();
    file.digest = {std::uint64_t(json.at("bytes").integer(0, kMostBytes)), json.at("xxh3").text()};
    if (!is_inside_folder(file.path)) json.at("path").fail("a file of its folder");
    if (!json.has("source")) return file;
    file.source = json.at("source").text();
    file.format = format_name_of(json.at("format"));
    // Lists of earlier versions do not say what their sources were.
    if (json.has("source_xxh3"))
        file.source_digest = {std::uint64_t(json.at("source_bytes").integer(0, kMostBytes)),
                              json.at("source_xxh3").text()};
    return file;
}

Json parsed_list(const std::filesystem::path& path) {
    Json json = parsed_json(path);
    const CheckedJson list(json, path);
    if (list.at("format").text() != "nephos export") list.at("format").fail("\"nephos export\"");
    const CheckedJson version = list.at("format_version");
    if (version.integer(0, INT32_MAX) != kFormatVersion)
        version.fail(std::to_string(kFormatVersion) + ", the version of this nephos");
    return json;
}

// Removes the temporary files that a killed export left. Throws Error(usage) when anything is there and no export.
void claim(const std::filesystem::path& folder) {
    std::error_code error;
    std::vector<std::filesystem::path> leftovers;
    for (const std::string& name : names_in_folder(folder)) {
        if (!published_name(name).empty()) {
            leftovers.push_back(folder / name);
        } else if (!is_export_folder(folder)) {
            throw Error(ErrorCode::usage,
                        folder.string() + ": is not empty and holds no export: choose another folder");
        }
    }
    for (const std::filesystem::path& leftover : leftovers)
        if (!error) std::filesystem::remove(leftover, error);
    if (error) throw Error(ErrorCode::io, folder.string() + ": cannot be examined: " + error.message());
}

// Marks a list, also a complete one: there may be files of an export that was killed, and in no list.
constexpr const char* kUnlisted = "unlisted";
// Marks a list that is not complete: files without a source may be there unlisted.
constexpr const char* kTextsBegun = "texts_begun";

[[noreturn]] void throw_other(const std::filesystem::path& path) {
    throw Error(ErrorCode::usage, path.string() +
                                      ": is there already, and no export of this has listed it: move it "
                                      "away, or choose another folder");
}

}  // namespace

bool is_export_folder(const std::filesystem::path& folder) {
    return type_behind(folder / "export.json") == std::filesystem::file_type::regular;
}

ExportList::ExportList(const ExportOptions& options, const std::vector<ExportSequence>& sequences)
    : folder_(options.folder) {
    head_ = head_json(options, sequences).dump(2, ' ', false, Json::error_handler_t::replace);
    claim(folder_);
    if (!is_export_folder(folder_)) return;
    const std::filesystem::path path = folder_ / "export.json";
    Json json = parsed_list(path);
    std::vector<ExportedFile> files;
    for (const CheckedJson& file : CheckedJson(json, path).at("files").items())
        files.push_back(file_of(file));
    may_be_unlisted_ = !CheckedJson(json, path).at("complete").truth() || json.contains(kUnlisted);
    had_begun_texts_ = json.contains(kTextsBegun);
    for (const char* key : {kUnlisted, kTextsBegun, "begun"})
        json.erase(key);  // the last of an earlier version
    json.erase("files");
    json.erase("complete");
    json.erase(kSealKey);
    if (json.dump(2, ' ', false, Json::error_handler_t::replace) != head_)
        throw Error(ErrorCode::usage,
                    folder_.string() +
                        ": holds an export with other options or of another scene: choose another folder");
    for (ExportedFile& file : files) {
        std::string name = file.path.generic_string();
        earlier_.emplace(std::move(name), std::move(file));
    }
}

bool ExportList::is_other(const std::string& name) const {
    return !earlier_.contains(name) && stands_there(folder_ / name);
}

void ExportList::require_free(const std::vector<std::string>& names) const {
    if (may_be_unlisted_) return;
    for (const std::string& name : names)
        if (is_other(name)) throw_other(folder_ / name);
}

std::optional<ExportedFile> ExportList::kept_file(const std::string& name, const ExportSource& source) const {
    const auto found = earlier_.find(name);
    std::error_code error;
    if (found == earlier_.end() || !std::filesystem::is_regular_file(folder_ / name, error)) return {};
    if (!(found->second.source_digest == source.digest)) return {};
    if (!(file_digest(folder_ / name) == found->second.digest)) return {};
    ExportedFile file = found->second;
    file.source = below_folder(source.path);
    return file;
}

std::string ExportList::note_on_change(const std::string& name) const {
    const auto found = earlier_.find(name);
    std::error_code error;
    const std::filesystem::path path = folder_ / name;
    if (found == earlier_.end() || !std::filesystem::is_regular_file(path, error)) return {};
    if (file_digest(path) == found->second.digest) return {};
    return path.string() + ": is not as an earlier export had listed it, and is made again";
}

void ExportList::write_file(const std::string& name,
                            const std::function<void(const std::filesystem::path& path)>& write) const {
    const std::filesystem::path path = folder_ / name;
    if (!is_other(name)) return write(path);
    // A name that claim() takes for a leftover, should this be killed.
    const std::string part = ".part" + std::to_string(::getpid()) + "-0";
    const std::filesystem::path made =
        folder_ / ("." + path.stem().string() + part + path.extension().string());
    std::error_code error;
    bool is_same = false;
    try {
        if (type_at(path) != std::filesystem::file_type::regular) throw_other(path);  // it wrote no link
        write(made);
        is_same = file_digest(made) == file_digest(path);
    } catch (...) {
        std::filesystem::remove(made, error);
        throw;
    }
    std::filesystem::remove(made, error);
    if (!is_same) throw_other(path);
}

ExportedFile ExportList::written_file(const std::string& name, const ExportSource& source,
                                      std::string_view format) const {
    return {name, file_digest(folder_ / name), below_folder(source.path), std::string(format), source.digest};
}

void ExportList::add_kept(ExportedFile file) {
    files_.push_back(std::move(file));
    ++kept_;
}

void ExportList::add_written(ExportedFile file) {
    files_.push_back(std::move(file));
    ++written_;
}

std::string ExportList::below_folder(const std::filesystem::path& source) const {
    std::error_code error;
    return source.empty() ? std::string()
                          : std::filesystem::proximate(source, folder_, error).generic_string();
}

void ExportList::write(bool complete) const {
    Json json = Json::parse(head_);
    json["complete"] = complete;
    Json files = Json::array();
    const auto add = [&files](const ExportedFile& file) {
        Json entry = {
            {"path", file.path.generic_string()}, {"bytes", file.digest.bytes}, {"xxh3", file.digest.xxh3}};
        if (!file.source.empty()) entry.update(Json{{"format", file.format}, {"source", file.source}});
        if (file.source_digest)
            entry.update(
                Json{{"source_bytes", file.source_digest->bytes}, {"source_xxh3", file.source_digest->xxh3}});
        files.push_back(std::move(entry));
    };
    std::set<std::string> listed;
    for (const ExportedFile& file : files_) {
        add(file);
        listed.insert(file.path.generic_string());
    }
    // What an earlier export wrote is not to be written again after a second interruption.
    for (const auto& [path, file] : earlier_)
        if (!complete && !listed.contains(path)) add(file);
    json["files"] = std::move(files);
    if (complete && may_be_unlisted_ && has_other_files()) json[kUnlisted] = true;
    if (!complete && (are_texts_begun_ || had_begun_texts_)) json[kTextsBegun] = true;
    write_atomically(folder_ / "export.json",
                     std::string_view(sealed_text(json.dump(2, ' ', false, Json::error_handler_t::replace))));
}

bool ExportList::has_other_files() const {
    std::set<std::string> listed{"export.json"};
    for (const ExportedFile& file : files_) listed.insert(file.path.generic_string());
    return std::ranges::any_of(names_in_folder(folder_), [&](const std::string& name) {
        return !listed.contains(name) && published_name(name).empty();
    });
}

std::vector<std::string> ExportList::remove_left_over() const {
    std::set<std::string> listed;
    for (const ExportedFile& file : files_) listed.insert(file.path.generic_string());
    std::size_t removed = 0;
    std::vector<std::string> notes;
    for (const auto& [name, file] : earlier_) {
        std::error_code error;
        const std::filesystem::path path = folder_ / name;
        if (listed.contains(name) || !std::filesystem::is_regular_file(path, error)) continue;
        if (!is_same_place(path.parent_path(), folder_)) {  // no export has written there
            notes.push_back(path.string() + ": is not in the folder itself: it stays");
            continue;
        }
        if (!(file_digest(path) == file.digest)) {
            notes.push_back(path.string() + ": is of an earlier export and was changed since: it stays");
            continue;
        }
        std::filesystem::remove(path, error);
        if (error) throw Error(ErrorCode::io, path.string() + ": cannot remove: " + error.message());
        ++removed;
    }
    if (removed > 0)
        notes.push_back(folder_.string() + ": " + std::to_string(removed) +
                        " files of an earlier export, which this one does not make, were removed");
    return notes;
}

// After a failure, whose message is the one to show.
void ExportList::write_quietly() const noexcept {
    try {
        write(false);
    } catch (const std::exception&) {
    }
}

ListedExport read_export(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "export.json";
    const Json json = parsed_list(path);
    const CheckedJson root(json, path);
    ListedExport list;
    list.complete = root.at("complete").truth();
    for (const CheckedJson& file : root.at("files").items()) list.files.push_back(file_of(file));
    for (const CheckedJson& s : root.at("sequences").items())
        list.sequences.push_back({s.at("name").text(), layout_of(s.at("layout")),
                                  int(s.at("levels").integer(1, kMostLevels)),
                                  float(s.at("scale").real(kLeastScale, kLargestScale))});
    const CheckedJson options = root.at("options");
    for (const auto& [name, type] : options.at("types").members())
        list.types[name] = VoxelType(type.integer(0, int(VoxelType::bc4)));
    list.half_voxel_shift = options.at("half_voxel_shift").truth();
    list.quantise = NanoQuantise(options.at("quantise").integer(0, int(NanoQuantise::fp16)));
    list.grid = options.at("grid").text();
    list.brick_edge = int(options.at("brick_edge").integer(1, kMostMultiple));
    return list;
}

}  // namespace nephos
