// SPDX-License-Identifier: Apache-2.0
// Sidecars of an export against its list.

#include <algorithm>
#include <cmath>
#include <map>
#include <new>
#include <span>
#include <string_view>

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

// Compares without regard to the order of keys.
bool is_same(const nlohmann::ordered_json& a, const nlohmann::ordered_json& b) {
    return nlohmann::json(a) == nlohmann::json(b);
}

// The sidecar that an export with this list writes when its first frame, of this number, is of the source; its wind and
// how many frames there are depend on more.
nlohmann::ordered_json expected_sidecar(const ListedExport& list, const ListedExport::Sequence& s,
                                        const LoadedDensity& source, int number) {
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
    sequence.layer = s.layer;
    sequence.frames.push_back({.number = number});
    take_first(source, sequence);
    take_moment(source, sequence.frames.front());
    sequence.layout = s.layout;
    sequence.levels = s.levels;
    sequence.scale = s.scale;
    const FrameFigures figures{source.density.sum(), double(source.density.max_value())};
    return nlohmann::ordered_json::parse(sidecar_text(options, sequence, {figures}));
}

using ListedFiles = std::map<std::string, const ExportedFile*>;

// The source of a file, where it is there and has not changed.
std::optional<LoadedDensity> source_of(const std::filesystem::path& folder, const ListedExport& list,
                                       const ExportedFile& file) {
    const std::filesystem::path path = folder / file.source;
    if (file.source.empty() || !is_there(path)) return {};
    if (file.source_digest && !(file_digest(path) == *file.source_digest)) return {};
    VdbReadOptions reading;
    reading.grid = list.grid;
    return load_density(path, reading);
}

// Compares the values of these keys, which both objects must have or lack.
void check_values(const CheckedJson& json, const nlohmann::ordered_json& parsed,
                  const nlohmann::ordered_json& expected, std::span<const std::string_view> keys) {
    for (const std::string_view key : keys) {
        if (!expected.contains(key)) {
            if (json.has(key)) json.at(key).fail("no such value");
            continue;
        }
        const CheckedJson value = json.at(key);
        if (!is_same(parsed.at(key), expected.at(key)))
            value.fail(expected.at(key).dump() + ", as its source has it");
    }
}

// Compares the values of objects below a key, which both must have or lack.
void check_object(const CheckedJson& json, const nlohmann::ordered_json& parsed,
                  const nlohmann::ordered_json& expected, std::string_view key,
                  std::span<const std::string_view> keys) {
    if (!expected.contains(key)) {
        if (json.has(key)) json.at(key).fail("no such value");
        return;
    }
    const CheckedJson value = json.at(key);
    if (value.members().empty()) value.fail("an object of " + std::string(key));
    check_values(value, parsed.at(key), expected.at(key), keys);
}

// Compares the matrix of a place but for rounding: its sines are not those of every version.
void check_matrix(const CheckedJson& matrix, const nlohmann::ordered_json& expected) {
    const std::vector<CheckedJson> found = matrix.items();
    if (found.size() != expected.size()) matrix.fail(fmt::format("{} numbers", expected.size()));
    for (std::size_t n = 0; n < found.size(); ++n) {
        const auto number = expected.at(n).get<double>();
        const double error = 1e-12 * std::max(1.0, std::abs(number));
        if (!(std::abs(found[n].real(-1e15, 1e15) - number) <= error))
            found[n].fail(expected.at(n).dump() + ", as its source has it");
    }
}

// Compares what the list and the source of the first frame decide: all that places the voxels of a file.
void check_box(const CheckedJson& json, const nlohmann::ordered_json& parsed,
               const nlohmann::ordered_json& expected) {
    constexpr std::string_view kKeys[] = {
        "layer",    "quantity", "offset",          "extinction_per_m", "size",  "order",  "axes",
        "unit",     "max_m",    "handedness",      "voxel_size_m",     "min_m", "sample", "border",
        "period_m", "padding",  "half_voxel_shift"};
    constexpr std::string_view kRates[] = {"frames_per_second", "time_scale"},
                               kPlace[] = {"latitude_deg",   "longitude_deg", "height_m",   "height_datum",
                                           "geoid_height_m", "heading_deg",   "projection", "start_utc"},
                               kSource[] = {"scene_hash", "seed", "nephos_version"};
    check_values(json, parsed, expected, kKeys);
    check_object(json, parsed, expected, "time", kRates);
    check_object(json, parsed, expected, "source", kSource);
    check_object(json, parsed, expected, "georeference", kPlace);
    if (expected.contains("georeference"))
        check_matrix(json.at("georeference").at("ecef_from_world"),
                     expected.at("georeference").at("ecef_from_world"));
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

// Compares the names and types of its formats. Returns them.
std::vector<NamedFormat> check_formats(const CheckedJson& json, const ListedExport& list,
                                       const ListedExport::Sequence& s) {
    std::vector<NamedFormat> formats;
    for (const CheckedJson& one : json.at("formats").items()) {
        const NamedFormat& format = format_of(one.at("format"));
        const auto type = list.types.find(std::string(format.name));
        if (type == list.types.end()) one.at("format").fail("a format of export.json");
        if (is_dense(format.format)) require_text(one.at("type"), std::string(type_name(type->second)));
        require_text(one.at("files"), frame_pattern(s.name, format));
        formats.push_back(format);
    }
    if (formats.empty()) json.at("formats").fail("those of export.json");
    return formats;
}

// Throws Error(io) unless the frames have files in the list, and are all that it has of the sequence.
void check_numbers(const CheckedJson& json, const ListedExport& list, const ListedExport::Sequence& s,
                   const ListedFiles& listed, const std::vector<NamedFormat>& formats) {
    const std::vector<CheckedJson> frames = json.at("frames").items();
    if (json.at("count").integer(0, INT32_MAX) != std::int64_t(frames.size()))
        json.at("count").fail(fmt::format("{}, the number of `frames`", frames.size()));
    std::int64_t least = json.at("first").integer(0, INT32_MAX);
    for (const CheckedJson& frame : frames) {
        const std::int64_t number = frame.at("number").integer(0, INT32_MAX);
        for (const NamedFormat& format : formats) {
            const std::string file = fmt::format("{}_{:04}{}", s.name, number, format.extension);
            if (!listed.contains(file))
                frame.at("number").fail("the number of a listed file: there is no " + file);
        }
        if (&frame == &frames.front() && number != least)
            json.at("first").fail(fmt::format("{}, the first of `frames`", number));
        if (number < least) frame.at("number").fail("one above that of the frame before");
        least = number + 1;
    }
    const auto files = std::ranges::count_if(list.files, [&](const ExportedFile& file) {
        return !file.source.empty() && file.format == formats.front().name &&
               sequence_of(list, file.path.generic_string()) == &s;
    });
    if (list.complete && files != std::ptrdiff_t(frames.size()))
        json.at("frames").fail(fmt::format("{} frames, as in export.json", files));
}

// Says how far a sidecar could be compared.
struct Compared {
    bool sources = true;                 // all are there and unchanged
    std::size_t frames = 0, untold = 0;  // untold: whose files say nothing of their time
};

// Throws Error(io) that names the first value which is not what the list or a source says.
Compared check_sidecar(const std::filesystem::path& folder, const std::filesystem::path& path,
                       const ListedExport& list, const ListedExport::Sequence& s, const ListedFiles& listed) {
    const nlohmann::ordered_json parsed = parsed_json(path);
    const CheckedJson json(parsed, path);
    require_text(json.at("format"), "nephos volume");
    json.at("format_version").integer(1, 1);
    require_text(json.at("name"), s.name);
    if (float(json.at("scale").real(kLeastScale, kLargestScale)) != s.scale)
        json.at("scale").fail(fmt::format("{}, as in export.json", s.scale));
    const std::vector<NamedFormat> formats = check_formats(json, list, s);
    check_numbers(json, list, s, listed, formats);
    Compared compared;
    const std::vector<CheckedJson> frames = json.at("frames").items();
    for (std::size_t n = 0; n < frames.size(); ++n) {
        const int number = int(frames[n].at("number").integer(0, INT32_MAX));
        const std::string name = fmt::format("{}_{:04}{}", s.name, number, formats.front().extension);
        const std::optional<LoadedDensity> source = source_of(folder, list, *listed.at(name));
        compared.sources = compared.sources && source;
        ++compared.frames;
        if (!source) continue;
        const nlohmann::ordered_json expected = expected_sidecar(list, s, *source, number);
        if (n == 0) check_box(json, parsed, expected);
        const nlohmann::ordered_json &frame = parsed.at("frames").at(n),
                                     &of_source = expected.at("frames").front();
        constexpr std::string_view kFigures[] = {"sum", "max"}, kTime[] = {"time_s", "utc"},
                                   kFirst[] = {"first_s"};
        check_values(frames[n], frame, of_source, kFigures);
        // A file of another program has the time of the first, or that of its run's manifest.
        if (!source->metadata) {
            ++compared.untold;
            continue;
        }
        check_values(frames[n], frame, of_source, kTime);
        if (n == 0) check_values(json.at("time"), parsed.at("time"), expected.at("time"), kFirst);
    }
    return compared;
}

}  // namespace

std::vector<Check> check_sidecars(const std::filesystem::path& folder, const ListedExport& list) {
    ListedFiles listed;
    for (const ExportedFile& file : list.files) listed.emplace(file.path.generic_string(), &file);
    std::size_t count = 0, compared = 0, frames = 0, untold = 0;
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
            const Compared one = check_sidecar(folder, folder / name, list, s, listed);
            compared += one.sources;
            frames += one.frames;
            untold += one.untold;
        } catch (const ReadFailure& failure) {
            if (!is_of_file(folder, failure)) throw;
            unread.add(failure.what());
        } catch (const std::bad_alloc&) {
            unread.add((folder / name).string() + ": cannot compare with its sources: out of memory");
        } catch (const Error& error) {
            const bool is_bad = is_of_file(folder / name, error) || is_of_file(folder / "export.json", error);
            if (!is_bad && !is_of_file(folder, error)) throw;
            (is_bad ? bad : unread).add(error.what());  // of a source
        }
    }
    if (count == 0) return {};
    if (bad.none() && !unread.none()) return {unread.not_done("sidecars")};
    std::string found =
        compared < count
            ? "names, types, scale and numbers of frames are those of the list; not all of box, axes, "
              "levels, place, times and figures was compared: sources are not there, or have changed"
        : untold > 0
            ? fmt::format(
                  "box, axes, levels, names, types, scale, place and figures of frames are those of "
                  "list and sources, and so are times, but for {} of {} frames, whose sources "
                  "say of none",
                  untold, frames)
            : "box, axes, levels, names, types, scale, place, times and figures of frames are those of "
              "list and sources";
    std::vector<Check> checks{bad.check("sidecars", found)};
    if (!unread.none()) checks.push_back(unread.not_done("sources of sidecars"));
    return checks;
}

}  // namespace nephos
