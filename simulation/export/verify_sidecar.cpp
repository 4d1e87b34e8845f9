// SPDX-License-Identifier: Apache-2.0
// Sidecars of an export against its list.

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "simulation/checked_json.h"
#include "simulation/export/export_list.h"
#include "simulation/export/sequence.h"
#include "simulation/verify_problems.h"

namespace nephos {
namespace {

void require_text(const CheckedJson& json, const std::string& expected) {
    if (json.text() != expected) json.fail("\"" + expected + "\"");
}

const NamedFormat& format_of(const CheckedJson& json) {
    const std::string name = json.text();
    const auto& formats = export_formats();
    const auto found = std::ranges::find(formats, name, &NamedFormat::name);
    if (found == formats.end()) json.fail("a format of `nephos export`");
    return *found;
}

// The sidecar that an export with this list writes of such a source; frames, time, wind and place are those of the run, and
// not in it.
nlohmann::ordered_json expected_sidecar(const ListedExport& list, const ListedExport::Sequence& s,
                                        const LoadedDensity& source) {
    ExportOptions options;
    options.layout = s.layout;
    options.half_voxel_shift = list.half_voxel_shift;
    options.quantise = list.quantise;
    options.brick_edge = list.brick_edge;
    for (const NamedFormat& named : export_formats()) {
        const auto type = list.types.find(std::string(named.name));
        if (type == list.types.end()) continue;
        options.formats.push_back(named.format);
        if (type->second != format_type(named.format)) options.type = type->second;
    }
    ExportSequence sequence;
    sequence.name = s.name;
    sequence.frames.emplace_back();
    sequence.extent = source.density.extent();
    sequence.placement = source.density.placement();
    sequence.of_nephos = source.metadata.has_value();
    if (source.metadata) sequence.metadata = *source.metadata;
    sequence.layout = s.layout;
    sequence.levels = s.levels;
    sequence.scale = s.scale;
    return nlohmann::ordered_json::parse(sidecar_text(options, sequence, {}));
}

// The source of the first file of a sequence, where it is there and has not changed.
std::optional<LoadedDensity> source_of(const std::filesystem::path& folder, const ListedExport& list,
                                       const ListedExport::Sequence& s) {
    for (const ExportedFile& file : list.files) {
        if (file.source.empty() || sequence_of(list, file.path.generic_string()) != &s) continue;
        const std::filesystem::path path = folder / file.source;
        if (!is_there(path)) return {};
        if (file.source_digest && !(file_digest(path) == *file.source_digest)) return {};
        VdbReadOptions reading;
        reading.grid = list.grid;
        return load_density(path, reading);
    }
    return {};
}

// What the box of the source and the list decide: everything that places the voxels of a file.
void check_box(const CheckedJson& json, const nlohmann::ordered_json& parsed,
               const nlohmann::ordered_json& expected) {
    for (const char* key :
         {"quantity", "offset", "extinction_per_m", "size", "order", "axes", "handedness", "unit",
          "voxel_size_m", "min_m", "max_m", "sample", "period_m", "border", "padding", "half_voxel_shift"}) {
        if (!expected.contains(key)) {
            if (json.has(key)) json.at(key).fail("no such value");
            continue;
        }
        const CheckedJson value = json.at(key);
        if (parsed.at(key) != expected.at(key))
            value.fail(expected.at(key).dump() + ", as its source has it");
    }
    const std::vector<CheckedJson> formats = json.at("formats").items();
    if (formats.size() != expected.at("formats").size())
        json.at("formats").fail(fmt::format("{} formats, as in export.json", expected.at("formats").size()));
    for (std::size_t n = 0; n < formats.size(); ++n) {
        for (const auto& [key, value] : expected.at("formats").at(n).items()) {
            const CheckedJson found = formats[n].at(key);
            if (parsed.at("formats").at(n).at(key) != value)
                found.fail(value.dump() + ", as its source has it");
        }
    }
}

// Throws Error(io) that names the first value which is not what the list says.
void check_sidecar(const std::filesystem::path& path, const ListedExport& list,
                   const ListedExport::Sequence& s, const std::set<std::string>& listed,
                   const std::optional<LoadedDensity>& source) {
    const nlohmann::ordered_json parsed = parsed_json(path);
    const CheckedJson json(parsed, path);
    require_text(json.at("format"), "nephos volume");
    json.at("format_version").integer(1, 1);
    require_text(json.at("name"), s.name);
    if (float(json.at("scale").real(kLeastScale, kLargestScale)) != s.scale)
        json.at("scale").fail(fmt::format("{}, as in export.json", s.scale));
    std::vector<std::string> extensions;
    for (const CheckedJson& one : json.at("formats").items()) {
        const NamedFormat& format = format_of(one.at("format"));
        const auto type = list.types.find(std::string(format.name));
        if (type == list.types.end()) one.at("format").fail("a format of export.json");
        if (is_dense(format.format)) require_text(one.at("type"), std::string(type_name(type->second)));
        require_text(one.at("files"), frame_pattern(s.name, format));
        extensions.emplace_back(format.extension);
    }
    const std::vector<CheckedJson> frames = json.at("frames").items();
    if (json.at("count").integer(0, INT32_MAX) != std::int64_t(frames.size()))
        json.at("count").fail(fmt::format("{}, the number of `frames`", frames.size()));
    for (const CheckedJson& frame : frames) {
        const std::int64_t number = frame.at("number").integer(0, INT32_MAX);
        for (const std::string& extension : extensions) {
            const std::string file = fmt::format("{}_{:04}{}", s.name, number, extension);
            if (!listed.contains(file))
                frame.at("number").fail("the number of a listed file: there is no " + file);
        }
        frame.at("time_s").real(-1e15, 1e15);
    }
    if (source) check_box(json, parsed, expected_sidecar(list, s, *source));
}

}  // namespace

std::vector<Check> check_sidecars(const std::filesystem::path& folder, const ListedExport& list) {
    std::set<std::string> listed;
    for (const ExportedFile& file : list.files) listed.insert(file.path.generic_string());
    std::size_t count = 0, compared = 0;
    Problems bad, unread;
    for (const ListedExport::Sequence& s : list.sequences) {
        const std::string name = s.name + ".volume.json";
        try {
            if (!listed.contains(name)) {
                if (!list.complete || list.types.empty()) continue;  // interrupted, or of layers alone
                ++count;
                throw Error(ErrorCode::io,
                            (folder / "export.json").string() + ": lists volumes, but no " + name);
            }
            ++count;
            const std::optional<LoadedDensity> source = source_of(folder, list, s);
            compared += source.has_value();
            check_sidecar(folder / name, list, s, listed, source);
        } catch (const ReadFailure& failure) {
            unread.add(failure.what());
        } catch (const Error& error) {
            const bool is_bad = is_of_file(folder / name, error) || is_of_file(folder / "export.json", error);
            if (!is_bad && !is_of_file(folder, error)) throw;
            (is_bad ? bad : unread).add(error.what());  // of a source
        }
    }
    if (count == 0) return {};
    if (bad.none() && !unread.none()) return {unread.not_done("sidecars")};
    const char* found =
        compared == count
            ? "box, axes, levels, names, types, scale and frames are those of list and sources"
            : "names, types, scale and frames are those of the list; box, axes and levels were not "
              "compared: sources are not there, or have changed";
    std::vector<Check> checks{bad.check("sidecars", found)};
    if (!unread.none()) checks.push_back(unread.not_done("sources of sidecars"));
    return checks;
}

}  // namespace nephos
