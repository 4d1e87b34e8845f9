// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export_list.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <system_error>
#include <vector>

#include <fcntl.h>
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

}  // namespace

ExportedFile exported_file(const CheckedJson& json) {
    ExportedFile file;
    file.path = json.at("path").text();
    file.digest = {std::uint64_t(json.at("bytes").integer(0, kMostBytes)), json.at("xxh3").text()};
    if (!is_inside_folder(file.path)) json.at("path").fail("a file of its folder");
    if (json.has("lost")) file.is_lost = json.at("lost").truth();
    if (!json.has("source")) return file;
    file.source = json.at("source").text();
    file.format = format_name_of(json.at("format"));
    // Lists of earlier versions do not say what their sources were.
    if (json.has("source_xxh3"))
        file.source_digest = {std::uint64_t(json.at("source_bytes").integer(0, kMostBytes)),
                              json.at("source_xxh3").text()};
    return file;
}

namespace {

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
void claim(const FolderLock& lock) {
    const std::filesystem::path& folder = lock.path();
    std::vector<std::string> leftovers;
    for (const std::string& name : names_in_folder(folder)) {
        if (name == kExportWork) continue;  // ExportWork::begin() removes it
        if (!published_name(name).empty()) {
            leftovers.push_back(name);
        } else if (!is_export_folder(folder)) {
            throw Error(ErrorCode::usage,
                        folder.string() + ": is not empty and holds no export: choose another folder");
        }
    }
    lock.require_in_place();  // what was listed is in the folder that is locked
    for (const std::string& name : leftovers)
        if (::unlinkat(lock.descriptor(), name.c_str(), 0) != 0 && errno != ENOENT)
            throw Error(ErrorCode::io, (folder / name).string() + ": cannot remove: " + std::strerror(errno));
}

}  // namespace

bool is_export_folder(const std::filesystem::path& folder) {
    return type_behind(folder / "export.json") == std::filesystem::file_type::regular;
}

namespace {

// Returns whether an export lists the file.
bool is_listed(const std::filesystem::path& folder, const std::filesystem::path& file) {
    try {
        return std::ranges::any_of(read_export(folder).files, [&](const ExportedFile& listed) {
            return is_same_place(folder / listed.path, file);
        });
    } catch (const ReadFailure&) {
        throw;
    } catch (const Error&) {  // damaged, or of another version: then it lists nothing
        return false;
    }
}

// The notes of another user are theirs alone to look at: what they say is not known.
bool has_notes(const std::filesystem::path& folder) {
    std::error_code error;
    const auto type = std::filesystem::symlink_status(notes_of(folder), error).type();
    if (type == std::filesystem::file_type::none && error == std::errc::permission_denied) return false;
    return stands_there(notes_of(folder));
}

// Returns whether an export at work, or one that was killed, has made the file and not listed it yet.
bool is_noted(const std::filesystem::path& folder, const std::filesystem::path& file) {
    if (!has_notes(folder)) return false;
    return std::ranges::any_of(noted_files(folder), [&](const ExportedFile& noted) {
        return is_same_place(folder / noted.path, file) && file_digest(file) == noted.digest;
    });
}

}  // namespace

std::optional<std::filesystem::path> export_with_file(const std::filesystem::path& file) {
    if (type_behind(file) != std::filesystem::file_type::regular) return {};
    for (const std::filesystem::path& path : paths_to(file)) {
        const std::filesystem::path folder = holder_of(path);
        if (path.filename() == notes_of(folder).filename() && has_notes(holder_of(folder)) &&
            is_same_place(notes_of(holder_of(folder)), path))
            return holder_of(folder);
        if (!is_export_folder(folder)) continue;
        if (is_same_place(folder / "export.json", path)) return folder;
        if (is_listed(folder, path) || is_noted(folder, path)) return folder;
    }
    return {};
}

ExportList::ExportList(const FolderLock& lock, const ExportOptions& options,
                       const std::vector<ExportSequence>& sequences)
    : lock_(lock), folder_(options.folder), work_(lock) {
    head_ = head_json(options, sequences).dump(2, ' ', false, Json::error_handler_t::replace);
    claim(lock);
    has_list_ = is_export_folder(folder_);
    if (!has_list_) return;
    const std::filesystem::path path = folder_ / "export.json";
    Json json = parsed_list(path);
    std::vector<ExportedFile> files;
    for (const CheckedJson& file : CheckedJson(json, path).at("files").items())
        files.push_back(exported_file(file));
    was_interrupted_ = !CheckedJson(json, path).at("complete").truth();
    json.erase("files");
    json.erase("complete");
    json.erase(kSealKey);
    // One that has made nothing, as for a refusal, leaves its folder to any other.
    const bool is_empty = was_interrupted_ && files.empty() && noted_files(folder_).empty();
    if (!is_empty && json.dump(2, ' ', false, Json::error_handler_t::replace) != head_)
        throw Error(ErrorCode::usage,
                    folder_.string() +
                        ": holds an export with other options, of another scene or other layers, or, under "
                        "--range auto, with another largest value: choose another folder");
    for (ExportedFile& file : files) {
        std::string name = file.path.generic_string();
        if (stands_there(folder_ / name)) earlier_.emplace(std::move(name), std::move(file));
    }
    for (ExportedFile& file : noted_files(folder_)) {
        std::string name = file.path.generic_string();
        has_notes_ = true;
        if (type_behind(folder_ / name) == std::filesystem::file_type::regular &&
            file_digest(folder_ / name) == file.digest)
            earlier_[std::move(name)] = std::move(file);
    }
}

void ExportList::require_free(const std::vector<std::string>& names) const {
    for (const std::string& name : names)
        if (!earlier_.contains(name) && stands_there(folder_ / name))
            throw_place_taken(folder_ / name, was_interrupted_ && !has_notes_);
}

void ExportList::begin() {
    write(false);
    has_list_ = true;
    work_.begin();
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

ExportedFile ExportList::write_file(const std::string& name, const ExportSource& source,
                                    std::string_view format,
                                    const std::function<bool(const std::filesystem::path& path)>& write) {
    work_.require_in_place();
    bool is_lost = false;
    work_.write(name, [&](const std::filesystem::path& path) { is_lost = write(path); });
    ExportedFile file{
        name, work_.digest_of(name), below_folder(source.path), std::string(format), source.digest, is_lost};
    work_.note(file);
    std::map<std::string, ExportedFile> made{{name, file}};  // before: what has its place must be listed
    if (earlier_.contains(name) && stands_there(folder_ / name))
        work_.replace(name);
    else
        work_.place(name);
    const std::scoped_lock lock(mutex_);
    made_.merge(made);
    return file;
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
    if (source.empty()) return {};
    std::error_code error;
    std::filesystem::path path = std::filesystem::proximate(source, folder_, error);
    if (error) path = std::filesystem::absolute(source, error);
    if (error)
        throw Error(ErrorCode::io, source.string() + ": its whole path is not known: " + error.message());
    return path.generic_string();
}

void ExportList::write(bool complete) const {
    Json json = Json::parse(head_);
    json["complete"] = complete;
    Json files = Json::array();
    std::set<std::string> listed;
    const auto add = [&](const std::string& name, const ExportedFile& file) {
        if (listed.insert(name).second) files.push_back(export_entry(file));
    };
    for (const ExportedFile& file : files_) add(file.path.generic_string(), file);
    if (!complete) {
        for (const auto& [name, file] : made_) add(name, file);
        // Keeps what an earlier export wrote, which is not to be written again after a second interruption.
        for (const auto& [name, file] : earlier_) add(name, file);
    }
    json["files"] = std::move(files);
    const std::string text = sealed_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
    const std::function<void()> check = [this] { lock_.require_in_place(); };
    const PublishCheck keeps_in_place(check);
    const std::filesystem::path path = folder_ / "export.json";
    if (has_list_)
        write_atomically(path, std::string_view(text));
    else if (!write_where_free(path, text))
        throw_place_taken(path);
}

// Throws Error(io) where one was removed or replaced by another meanwhile.
void ExportList::require_files() const {
    for (const ExportedFile& file : files_) {
        std::error_code error;
        const std::filesystem::path path = folder_ / file.path;
        if (type_behind(path) != std::filesystem::file_type::regular ||
            std::filesystem::file_size(path, error) != file.digest.bytes)
            throw Error(ErrorCode::io,
                        path.string() +
                            ": was removed or changed while the export was writing: give the same "
                            "command again");
    }
}

void ExportList::end(bool complete) {
    if (!has_list_) return;  // it has not begun
    work_.flush();
    write(false);
    work_.end();
    if (!complete) return;
    require_files();
    write(true);  // the last of all: nothing is in the folder that it does not list
}

// Removes a file of the folder that is locked, if it is the one that is open.
void ExportList::remove(const std::string& name, const Descriptor& file) const {
    lock_.require_in_place();
    const std::filesystem::path path = folder_ / name;
    if (!is_same_file(file.get(), path))
        throw Error(ErrorCode::io, path.string() + ": was replaced while the export was writing");
    if (::unlinkat(lock_.descriptor(), name.c_str(), 0) != 0)
        throw Error(ErrorCode::io, path.string() + ": cannot remove: " + std::strerror(errno));
}

std::vector<std::string> ExportList::remove_left_over() {
    std::set<std::string> listed;
    for (const ExportedFile& file : files_) listed.insert(file.path.generic_string());
    std::size_t removed = 0;
    std::vector<std::string> notes;
    for (auto at = earlier_.begin(); at != earlier_.end();) {
        const auto present = at++;
        const auto& [name, file] = *present;
        std::error_code error;
        const std::filesystem::path path = folder_ / name;
        if (listed.contains(name) || !std::filesystem::is_regular_file(path, error)) continue;
        if (!is_same_place(path.parent_path(), folder_)) {  // no export has written there
            notes.push_back(path.string() + ": is not in the folder itself: it stays");
            continue;
        }
        const Descriptor opened = open_regular_file(path, O_RDONLY);
        std::ifstream content("/proc/self/fd/" + std::to_string(opened.get()), std::ios::binary);
        if (!(file_digest(content, path) == file.digest)) {
            notes.push_back(path.string() + ": is of an earlier export and was changed since: it stays");
            continue;
        }
        remove(name, opened);
        earlier_.erase(present);
        ++removed;
    }
    if (removed > 0)
        notes.push_back(folder_.string() + ": " + std::to_string(removed) +
                        " files of an earlier export, which this one does not make, were removed");
    return notes;
}

// After a failure, whose message is the one to show.
void ExportList::end_quietly() noexcept {
    try {
        end(false);
    } catch (const std::exception&) {
    }
}

ListedExport read_export(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "export.json";
    const Json json = parsed_list(path);
    const CheckedJson root(json, path);
    ListedExport list;
    list.complete = root.at("complete").truth();
    for (const CheckedJson& file : root.at("files").items()) list.files.push_back(exported_file(file));
    for (const CheckedJson& s : root.at("sequences").items())
        list.sequences.push_back({s.at("name").text(), s.at("layer").text(), layout_of(s.at("layout")),
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
