// SPDX-License-Identifier: Apache-2.0

// nephos info: what a file says about itself, whatever its name is.

#include <algorithm>
#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "automaton/checkpoint.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/text.h"
#include "density/vdb/vdb_file.h"
#include "render/image/image_file.h"
#include "simulation/checked_json.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

struct InfoArguments {
    std::vector<std::string> files;
    WorkArguments work;
};

enum class FileKind { vdb, checkpoint, exr };

// By the first bytes: OpenVDB's magic number is " BDV" and four zeros, OpenEXR's 20000630.
FileKind kind_of(const std::string& path) {
    const std::string bytes = read_beginning(path, 8);
    if (bytes.starts_with(std::string_view(" BDV\0\0\0\0", 8))) return FileKind::vdb;
    if (bytes.starts_with("\x76\x2f\x31\x01")) return FileKind::exr;
    if (is_checkpoint(path)) return FileKind::checkpoint;
    throw Error(ErrorCode::io,
                path + (bytes.empty() ? ": is empty"
                                      : ": is neither an OpenVDB file, nor an OpenEXR file, nor a "
                                        "checkpoint of nephos"));
}

Json pairs_json(const std::vector<std::pair<std::string, std::string>>& pairs) {
    Json::object_t members;  // appended to: Json compares each name with all before
    for (const auto& [name, value] : pairs) members.emplace_back(name, value);
    merge_doubles(members);
    return members;
}

// Numbers as numbers, and texts as texts.
Json entries_json(const std::vector<VdbMetadataEntry>& entries) {
    Json::object_t members;
    for (const VdbMetadataEntry& entry : entries) {
        Json value = entry.is_json ? Json::parse(entry.value, nullptr, false) : Json(entry.value);
        members.emplace_back(entry.name, value.is_discarded() ? Json(entry.value) : std::move(value));
    }
    merge_doubles(members);
    return members;
}

// The number of bytes of a text up to `limit` that does not cut a character of UTF-8.
std::size_t cut_at(std::string_view text, std::size_t limit) {
    if (text.size() <= limit) return text.size();
    std::size_t end = limit;
    while (end > limit - 4 && (text[end] & 0xC0) == 0x80) --end;
    return end;
}

// "  name   value" lines; long values are cut, --json has them whole.
std::string pairs_text(const std::vector<std::pair<std::string, std::string>>& pairs, int indent) {
    std::size_t width = 0;
    for (const auto& [name, value] : pairs) width = std::max(width, escaped(name).size());
    std::string out;
    for (const auto& [name, value] : pairs) {
        std::string shown = value.substr(0, cut_at(value, 200));
        std::replace_if(
            shown.begin(), shown.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
        out += fmt::format("{:{}}{:{}}  {}{}\n", "", indent, escaped(name), width, escaped(shown),
                           shown.size() < value.size() ? " ..." : "");
    }
    return out;
}

Json vdb_json(const VdbInfo& info) {
    Json grids = Json::array();
    for (const VdbGridInfo& grid : info.grids) {
        const Matrix4& m = grid.world_from_index;
        grids.push_back({{"name", grid.name},
                         {"type", grid.type},
                         {"class", grid.grid_class},
                         {"voxel_size", {grid.voxel_size.x, grid.voxel_size.y, grid.voxel_size.z}},
                         {"active_voxels", grid.active_voxels},
                         {"active_min", grid.active_box.min},
                         {"active_max", grid.active_box.max},
                         {"origin", {m[3], m[7], m[11]}},
                         {"world_from_index", m},
                         {"metadata", entries_json(grid.metadata)}});
    }
    return {{"kind", "vdb"},
            {"file_version", info.file_version},
            {"grids", grids},
            {"metadata", entries_json(info.metadata)}};
}

std::string entries_text(const std::vector<VdbMetadataEntry>& entries, int indent) {
    std::vector<std::pair<std::string, std::string>> pairs;
    for (const VdbMetadataEntry& entry : entries) pairs.emplace_back(entry.name, entry.value);
    return pairs_text(pairs, indent);
}

// The place of the first voxel's centre, and the matrix that turns an index into a place, by rows.
std::vector<std::pair<std::string, std::string>> place_rows(const VdbGridInfo& grid) {
    const Matrix4& m = grid.world_from_index;
    std::vector<std::pair<std::string, std::string>> rows;
    rows.emplace_back("voxel (0, 0, 0)", fmt::format("centre at ({:g}, {:g}, {:g})", m[3], m[7], m[11]));
    rows.emplace_back("index to world",
                      fmt::format("[{:g} {:g} {:g} {:g}; {:g} {:g} {:g} {:g}; {:g} {:g} {:g} {:g}]", m[0],
                                  m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8], m[9], m[10], m[11]));
    return rows;
}

std::string vdb_text(const VdbInfo& info, bool colours) {
    std::string out = fmt::format("OpenVDB {}, {} grid{}\n", escaped(info.file_version), info.grids.size(),
                                  info.grids.size() == 1 ? "" : "s");
    out += entries_text(info.metadata, 2);
    for (const VdbGridInfo& grid : info.grids) {
        const VoxelBox& box = grid.active_box;
        out += fmt::format("\n  {}  {}, {}\n",
                           styled(grid.name.empty() ? "(no name)" : grid.name, Style::bold, colours),
                           escaped(grid.type), escaped(grid.grid_class));
        std::vector<std::pair<std::string, std::string>> rows;
        const Vec3& size = grid.voxel_size;
        rows.emplace_back("voxel size", size.x == size.y && size.y == size.z
                                            ? fmt::format("{:g}", size.x)
                                            : fmt::format("{:g} x {:g} x {:g}", size.x, size.y, size.z));
        rows.emplace_back("active voxels", human_count(grid.active_voxels));
        if (!box.empty()) {
            rows.emplace_back("active box",
                              fmt::format("({}, {}, {}) to ({}, {}, {})", box.min[0], box.min[1], box.min[2],
                                          box.max[0], box.max[1], box.max[2]));
        }
        for (auto& row : place_rows(grid)) rows.push_back(std::move(row));
        out += pairs_text(rows, 4);
        if (grid.metadata != info.metadata) out += entries_text(grid.metadata, 4);
    }
    return out;
}

Json checkpoint_json(const Checkpoint& checkpoint) {
    return {{"kind", "checkpoint"},
            {"steps", checkpoint.steps},
            {"state_hash", checkpoint.state.hex()},
            {"simulation_hash", checkpoint.simulation_hash},
            {"state_bytes", checkpoint.automaton.size()},
            {"history_bytes", checkpoint.history.size()}};
}

std::string checkpoint_text(const Checkpoint& checkpoint) {
    return "checkpoint of nephos\n" + pairs_text({{"steps", human_count(checkpoint.steps)},
                                                  {"state hash", checkpoint.state.hex()},
                                                  {"simulation hash", checkpoint.simulation_hash},
                                                  {"state", bytes_text(checkpoint.automaton.size())},
                                                  {"history", bytes_text(checkpoint.history.size())}},
                                                 2);
}

Json exr_json(const ExrInfo& info) {
    Json parts = Json::array();
    for (const ExrPart& part : info.parts) {
        Json channels = Json::array();
        for (const ExrChannel& channel : part.channels)
            channels.push_back({{"name", channel.name}, {"type", channel.type}});
        parts.push_back({{"name", part.name},
                         {"width", part.width},
                         {"height", part.height},
                         {"complete", part.complete},
                         {"compression", part.compression},
                         {"channels", channels},
                         {"attributes", pairs_json(part.attributes)}});
    }
    return {{"kind", "exr"}, {"parts", parts}};
}

std::string exr_text(const ExrInfo& info, bool colours) {
    std::string out =
        fmt::format("OpenEXR, {} part{}\n", info.parts.size(), info.parts.size() == 1 ? "" : "s");
    for (const ExrPart& part : info.parts) {
        out +=
            fmt::format("\n  {}  {} x {}, {}{}\n",
                        styled(part.name.empty() ? "(no name)" : part.name, Style::bold, colours), part.width,
                        part.height, escaped(part.compression), part.complete ? "" : ", INCOMPLETE");
        std::vector<std::pair<std::string, std::string>> rows;
        for (const ExrChannel& channel : part.channels) rows.emplace_back(channel.name, channel.type);
        out += pairs_text(rows, 4);
        out += pairs_text(part.attributes, 4);
    }
    return out;
}

struct Description {
    Json json;
    std::string text;
};

Description describe(const std::string& file, bool colours) {
    switch (kind_of(file)) {
        case FileKind::vdb: {
            const VdbInfo content = read_vdb_info(file);
            return {vdb_json(content), vdb_text(content, colours)};
        }
        case FileKind::checkpoint: {
            const Checkpoint content = read_checkpoint(file);
            return {checkpoint_json(content), checkpoint_text(content)};
        }
        case FileKind::exr: {
            const ExrInfo content = read_exr_info(file);
            return {exr_json(content), exr_text(content, colours)};
        }
    }
    throw Error(ErrorCode::io, file + ": is of no known kind");
}

// A file that cannot be read does not keep the others from being shown.
int info(const InfoArguments& a) {
    Output output;
    const bool colours = colours_on(stdout);
    Json results = Json::array();
    int status = 0;
    std::string_view separator;
    for (const std::string& file : a.files) {
        Json json = {{"file", file}};
        try {
            const Description description = describe(file, colours);
            json.update(description.json);
            if (!a.work.json) {
                output.write_styled(fmt::format("{}{}: {}", separator, escaped(file), description.text));
            }
            separator = "\n";
        } catch (const Error& error) {
            output.flush();  // what was shown before stands before the message
            print_error(error);
            json["error"] = error.what();
            status = int(error.code());
        }
        results.push_back(std::move(json));
    }
    if (a.work.json) {
        const Json& all = a.files.size() == 1 ? results.front() : results;
        output.line(json_text(all));
    }
    return status;
}

}  // namespace

void add_info_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("info", "Show what is in OpenVDB, OpenEXR and checkpoint files");
    const auto a = std::make_shared<InfoArguments>();
    command->add_option("FILE", a->files, "Files; their kind is known by their content")
        ->required()
        ->type_name("FILE");
    add_json(*command, a->work);
    command->footer(
        "Exit status 0: all files are described; 3: at least one cannot be read (with --json its entry has "
        "\"error\").\n"
        "\n"
        "Examples:\n"
        "  nephos info out/cumulus/density/cumulus_0001.vdb\n"
        "  nephos info out/cumulus/checkpoint.nephos --json");
    command->callback([a, &action] { action = [a] { return info(*a); }; });
}

}  // namespace nephos
