// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export_list.h"

#include <fstream>
#include <set>
#include <system_error>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
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

VolumeLayout layout_of(const Json& json) {
    VolumeLayout layout;
    layout.factor = json.at("factor").get<int>();
    layout.axes = AxisOrder(json.at("axes").get<int>());
    layout.border = Border(json.at("border").get<int>());
    layout.periodic = json.at("periodic").get<std::array<bool, 3>>();
    layout.multiple = json.at("multiple").get<int>();
    layout.power_of_two = json.at("power_of_two").get<bool>();
    if (layout.factor < 1 || layout.multiple < 1) throw Error(ErrorCode::io, "its layout is impossible");
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

ExportedFile file_of(const Json& json) {
    ExportedFile file;
    file.path = json.at("path").get<std::string>();
    file.digest = {json.at("bytes").get<std::uint64_t>(), json.at("xxh3").get<std::string>()};
    file.source = json.value("source", std::string());
    file.format = json.value("format", std::string());
    const bool inside =
        file.path.is_relative() && file.path.lexically_normal() == file.path && *file.path.begin() != "..";
    if (!inside) throw Error(ErrorCode::io, "it lists a file outside of its folder");
    return file;
}

Json parsed_list(const std::filesystem::path& path) {
    require_regular_file(path);
    std::ifstream stream(path, std::ios::binary);
    Json json = Json::parse(stream, nullptr, false);
    if (json.is_discarded() || !json.is_object() || json.value("format", "") != "nephos export" ||
        json.value("format_version", 0) != kFormatVersion)
        throw Error(ErrorCode::io, path.string() + ": is no list of an export of this version of nephos");
    return json;
}

// Removes the temporary files that a killed export left. Throws Error(usage) when anything is there and no export.
void claim(const std::filesystem::path& folder) {
    std::error_code error;
    std::vector<std::filesystem::path> leftovers;
    for (std::filesystem::directory_iterator at(folder, error), end; !error && at != end;
         at.increment(error)) {
        if (!published_name(at->path().filename().string()).empty()) {
            leftovers.push_back(at->path());
        } else if (!is_export_folder(folder)) {
            throw Error(ErrorCode::usage,
                        folder.string() + ": is not empty and holds no export: choose another folder");
        }
    }
    for (const std::filesystem::path& leftover : leftovers)
        if (!error) std::filesystem::remove(leftover, error);
    if (error) throw Error(ErrorCode::io, folder.string() + ": cannot be examined: " + error.message());
}

}  // namespace

bool is_export_folder(const std::filesystem::path& folder) {
    std::error_code error;
    return std::filesystem::is_regular_file(folder / "export.json", error);
}

ExportList::ExportList(const ExportOptions& options, const std::vector<ExportSequence>& sequences)
    : folder_(options.folder) {
    head_ = head_json(options, sequences).dump(2, ' ', false, Json::error_handler_t::replace);
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) throw Error(ErrorCode::io, folder_.string() + ": cannot make the folder: " + error.message());
    claim(folder_);
    if (!is_export_folder(folder_)) return;
    Json json = parsed_list(folder_ / "export.json");
    const Json files = json.value("files", Json::array());
    json.erase("files");
    json.erase("complete");
    if (json.dump(2, ' ', false, Json::error_handler_t::replace) != head_)
        throw Error(ErrorCode::usage,
                    folder_.string() +
                        ": holds an export with other options or of another scene: choose another folder");
    try {
        for (const Json& one : files) {
            ExportedFile file = file_of(one);
            earlier_.emplace(file.path.generic_string(), std::move(file));
        }
    } catch (const nlohmann::json::exception&) {
        throw Error(ErrorCode::io, (folder_ / "export.json").string() + ": is damaged");
    }
}

bool ExportList::keep(const std::string& name) {
    const auto found = earlier_.find(name);
    std::error_code error;
    if (found == earlier_.end() || !std::filesystem::is_regular_file(folder_ / name, error)) return false;
    if (!(file_digest(folder_ / name) == found->second.digest)) return false;
    files_.push_back(found->second);
    ++kept_;
    return true;
}

void ExportList::add(const std::string& name, const std::filesystem::path& source, std::string_view format) {
    std::error_code error;
    std::string from;
    if (!source.empty()) from = std::filesystem::proximate(source, folder_, error).generic_string();
    files_.push_back({name, file_digest(folder_ / name), from, std::string(format)});
    ++written_;
}

void ExportList::write(bool complete) const {
    Json json = Json::parse(head_);
    json["complete"] = complete;
    Json files = Json::array();
    const auto add = [&files](const ExportedFile& file) {
        Json entry = {
            {"path", file.path.generic_string()}, {"bytes", file.digest.bytes}, {"xxh3", file.digest.xxh3}};
        if (!file.source.empty()) entry.update(Json{{"format", file.format}, {"source", file.source}});
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
    write_atomically(folder_ / "export.json",
                     std::string_view(json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n"));
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
    try {
        ListedExport list;
        list.complete = json.at("complete").get<bool>();
        for (const Json& file : json.at("files")) list.files.push_back(file_of(file));
        for (const Json& s : json.at("sequences"))
            list.sequences.push_back({s.at("name").get<std::string>(), layout_of(s.at("layout")),
                                      s.at("levels").get<int>(), s.at("scale").get<float>()});
        const Json& options = json.at("options");
        for (const auto& [name, type] : options.at("types").items())
            list.types[name] = VoxelType(type.get<int>());
        list.half_voxel_shift = options.at("half_voxel_shift").get<bool>();
        list.quantise = NanoQuantise(options.at("quantise").get<int>());
        list.grid = options.at("grid").get<std::string>();
        return list;
    } catch (const nlohmann::json::exception&) {
        throw Error(ErrorCode::io, path.string() + ": is no list of an export, or is damaged");
    } catch (const Error& error) {
        throw Error(ErrorCode::io, path.string() + ": " + error.what());
    }
}

}  // namespace nephos
