// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/sequence.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "core/text.h"
#include "density/export/bricks.h"
#include "scenes/format/text.h"
#include "simulation/export/weather.h"
#include "simulation/frame_writer.h"
#include "simulation/run_listing.h"
#include "simulation/scene_place.h"

namespace nephos {
namespace {

// "cloud" and 12 of "cloud_0012.vdb"; without the number of a frame, as in "wind_20261201.vdb", the whole stem.
std::pair<std::string, std::optional<int>> split_name(const std::filesystem::path& file) {
    const std::string stem = file.stem().string();
    const std::size_t at = stem.find_last_not_of("0123456789");
    const std::string digits = at == stem.npos ? stem : stem.substr(at + 1);
    int number = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
    if (digits.empty() || error != std::errc() || number < 0 || number > kMaxFrames) return {stem, {}};
    std::string name = stem.substr(0, stem.size() - digits.size());
    while (!name.empty() && (name.back() == '_' || name.back() == '.' || name.back() == '-')) name.pop_back();
    return {name.empty() ? "volume" : name, number};
}

// Names stand in texts of formats that hold UTF-8 alone.
void require_name(const std::filesystem::path& file, const std::string& name) {
    const bool is_text = find_invalid_utf8(name) == name.size() && printable(name) == name;
    constexpr std::string_view kNone[] = {"\t", "\xEF\xBF\xBE",
                                          "\xEF\xBF\xBF"};  // U+FFFE and U+FFFF are no characters
    if (is_text &&
        std::ranges::none_of(kNone, [&](std::string_view none) { return name.find(none) != name.npos; }))
        return;
    throw Error(ErrorCode::usage,
                file.string() +
                    ": its name has bytes that the texts of an export cannot hold: expected UTF-8 "
                    "without control characters");
}

std::vector<WindTable> wind_of(const Scene& scene, std::optional<std::size_t> layer,
                               const ExportSequence& s) {
    std::set<double> times;  // between two of them each wind is linear
    const auto add = [&](const Wind& wind) {
        for (const WindKeyframe& keyframe : wind.keyframes) times.insert(keyframe.time_s);
    };
    if (!layer) add(scene.automaton.wind);
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        if (!layer || n == *layer) add(layer_wind(scene, n));
    if (times.empty()) times.insert(0);
    std::vector<WindTable> tables;
    for (const double time_s : times) {
        WindTable table{time_s, wind_levels(scene, layer, s.placement, s.extent, time_s)};
        if (!table.levels.empty()) tables.push_back(std::move(table));
    }
    return tables;
}

std::optional<FileDigest> listed_digest(const RunListing& run, const ListedFrame& frame,
                                        const std::filesystem::path& file) {
    for (const FileRecord& record : frame.files)
        if (run.folder / record.path == file) return record.digest;
    return {};
}

// Returns the stamp of a file; that of none for one that is gone. Looks again where a look fails. Throws ReadFailure where the
// system still cannot say.
FileStamp stamp_of(const std::filesystem::path& file) {
    for (int look = 0; look < 2; ++look)
        if (const FileStamp stamp = file_stamp(file); stamp != FileStamp{} || !is_there(file)) return stamp;
    throw ReadFailure(file, "two looks at it failed", "examine");
}

void read_first(const ExportOptions& options, ExportSequence& s) {
    VdbReadOptions reading;
    reading.grid = options.grid;
    take_first(load_density(s.frames.front().file, reading), s);
}

ExportSequence sequence_of_run(const ExportOptions& options, const RunListing& run,
                               const std::optional<std::string>& layer) {
    if (run.frames.empty())
        throw Error(
            ErrorCode::usage,
            run.folder.string() +
                (run.complete ? ": has no frames to export: it was run with --statistics-only"
                              : ": has no frames to export yet: it has not got so far, or was run with "
                                "--statistics-only"));
    ExportSequence s;
    s.name = run.scene.name + (layer ? "_" + *layer : "");
    s.layer = layer.value_or("");
    const DensityOptions& density = run.scene.density;
    const bool is_plain = !density.half && !density.write_state && !density.write_velocity;
    for (const ListedFrame& frame : run.frames) {
        if (!is_wanted(options, frame.number, 1)) continue;
        s.frames.push_back(frame_of_run(run, frame, layer));
        s.frames.back().is_plain = is_plain;
    }
    if (s.frames.empty()) throw Error(ErrorCode::usage, run.folder.string() + ": has no frame of this range");
    read_first(options, s);
    const std::optional<std::size_t> index =
        layer ? std::optional(layer_index(run.scene, *layer)) : std::nullopt;
    s.wind = wind_of(run.scene, index, s);
    if (moves_with_fields(run.scene, index)) s.wind_fields = run.scene.automaton.wind.fields;
    if (index || run.scene.layers.size() == 1) s.genus = genus_of(run.scene, index.value_or(0));
    return s;
}

ExportSequence sequence_of_files(const ExportOptions& options) {
    ExportSequence s;
    const std::vector<std::filesystem::path> files =
        options.files.empty() ? std::vector{options.source} : options.files;
    s.name = split_name(files.front()).first;
    require_name(files.front(), s.name);
    const int least = split_name(files.front()).second.value_or(1);
    std::int64_t next = 1;
    for (const std::filesystem::path& file : files) {
        const std::int64_t number = split_name(file).second.value_or(files.size() == 1 ? 1 : next);
        if (number < next && !s.frames.empty())
            throw Error(ErrorCode::usage,
                        file.string() + ": its number does not follow that of the file before");
        next = number + 1;
        if (is_wanted(options, int(number), least))
            s.frames.push_back({file, int(number), 0, {}, stamp_of(file), {}});
    }
    if (s.frames.empty()) throw Error(ErrorCode::usage, "no file has a number of this range");
    read_first(options, s);
    for (SourceFrame& frame : s.frames) frame.time_s = s.metadata.time_s;
    return s;
}

std::array<int, 3> sides_of(const ExportSequence& s) { return {s.extent.x, s.extent.y, s.extent.z}; }

// Voxels of so many of the grid's end where the box repeats.
bool keeps_period(const ExportSequence& s, int factor) {
    const std::array<int, 3> sides = sides_of(s);
    for (std::size_t a = 0; a < 3; ++a)
        if (s.layout.periodic[a] && sides[a] % factor != 0) return false;
    return true;
}

// The nearest factor that keeps the period, from `factor` on upwards (`step` 1) or downwards (-1); 0: none.
int factor_near(const ExportSequence& s, int factor, int step) {
    const std::array<int, 3> sides = sides_of(s);
    for (int f = factor; f >= 1 && f <= std::ranges::max(sides); f += step)
        if (keeps_period(s, f)) return f;
    return 0;
}

[[noreturn]] void refuse_period(const ExportSequence& s, const std::string& option, int factor) {
    std::string period;
    const std::array<int, 3> sides = sides_of(s);
    for (std::size_t a = 0; a < 3; ++a)
        if (s.layout.periodic[a])
            period += fmt::format("{}{} voxels along {}", period.empty() ? "" : " and ", sides[a], "xyz"[a]);
    const double edge = s.placement.cell_size_m;
    const int below = factor_near(s, std::min(factor, std::ranges::max(sides)), -1),
              above = factor_near(s, factor, 1);
    std::string cure;
    for (const int f : {below, above})
        if (f > 1) cure += (cure.empty() ? "--voxel " : " or --voxel ") + number_text(f * edge, 9);
    throw Error(
        ErrorCode::usage,
        fmt::format(
            "{}: {} repeats after {}, and {} of them to a voxel do not divide that, so that its tiles "
            "would not fit: expected {}",
            option, s.name, period, factor,
            cure.empty() ? "a lattice whose periodic sides have a common divisor" : cure));
}

// Voxels of so many of the grid's as the options want, where the box repeats of a number that divides it.
int factor_of(const ExportOptions& options, const ExportSequence& s) {
    const double edge = s.placement.cell_size_m;
    if (options.voxel_m) {
        const double ratio = *options.voxel_m / edge;
        if (ratio < 0.999 || std::abs(ratio - std::round(ratio)) > 1e-6 * ratio || ratio > 1 << 20) {
            const double most = std::ranges::max(sides_of(s));
            const double near = factor_near(s, int(std::clamp(std::round(ratio), 1.0, most)), -1) * edge;
            throw Error(ErrorCode::usage, fmt::format("--voxel {:g}: the grid's voxels are {:g} m, and only "
                                                      "means of whole numbers of them keep the mass: "
                                                      "expected a multiple such as {:.9g}",
                                                      *options.voxel_m, edge, near));
        }
        const int factor = int(std::lround(ratio));
        if (!keeps_period(s, factor)) refuse_period(s, fmt::format("--voxel {:g}", *options.voxel_m), factor);
        return factor;
    }
    if (!options.largest_side) return 1;
    const int longest = std::ranges::max(sides_of(s));
    const int least = std::max(1, (longest + *options.largest_side - 1) / *options.largest_side);
    const int factor = factor_near(s, least, 1);
    return factor > 0
               ? factor
               : factor_near(s, longest, -1);  // the coarsest: too long a side, as choose_layout() finds
}

// Sizes, levels and padding of one sequence.
void choose_layout(const ExportOptions& options, ExportSequence& s, std::vector<std::string>& notes) {
    s.layout = options.layout;
    for (int axis = 0; axis < 3; ++axis) s.layout.periodic[std::size_t(axis)] = s.metadata.period_m[axis] > 0;
    const double edge = s.placement.cell_size_m;
    const int longest = std::max({s.extent.x, s.extent.y, s.extent.z});
    s.layout.factor = factor_of(options, s);
    const std::vector<ExportFormat> formats = all_formats(options);
    if (!options.weather.empty() && options.files.empty() && !is_run_folder(options.source))
        throw Error(
            ErrorCode::usage,
            options.source.string() + ": layers, metar, xplane, wpr and cigi summarise a run, not a file");
    const bool dense = std::ranges::any_of(formats, is_dense);
    const bool blocks = std::ranges::any_of(
        formats, [&](ExportFormat f) { return is_dense(f) && type_of(options, f) == VoxelType::bc4; });
    const auto fit = [&] {
        s.layout.multiple = options.layout.multiple;
        if (blocks) s.layout.multiple = std::lcm(s.layout.multiple, 4);
        s.levels = options.mips ? level_count(box_of(s.extent, s.placement, s.layout).size) : 1;
        s.layout.multiple = std::lcm(s.layout.multiple, 1 << (s.levels - 1));
        if (options.mips) {
            const VolumeBox box = box_of(s.extent, s.placement, s.layout);
            s.levels = std::min(s.levels, level_count(box.size));
        }
    };
    fit();
    // Takes larger and larger voxels until they do; returns whether any does.
    const auto coarsen_until = [&](const auto& fits) {
        while (!fits()) {
            const int next = factor_near(s, s.layout.factor + 1, 1);
            if (next == 0) return false;
            s.layout.factor = next;
            fit();
        }
        return true;
    };
    const auto longest_side = [&] {
        const VolumeLayout of_grid{.factor = s.layout.factor};
        return std::ranges::max(box_of(s.extent, s.placement, dense ? s.layout : of_grid).size);
    };
    int least = std::numeric_limits<int>::max();
    const auto has_size = [&] {
        least = std::min(least, longest_side());
        return least <= *options.largest_side;
    };
    if (options.largest_side && !coarsen_until(has_size)) {
        std::string why;
        const auto add = [&](bool is_so, std::string_view reason) {
            if (is_so) why += (why.empty() ? ": " : ", ") + std::string(reason);
        };
        add(blocks, "those of BC4 come in fours");
        add(!keeps_period(s, longest), "whole tiles have to fit");
        add(dense, "those of a border and of --pad count");
        throw Error(ErrorCode::usage,
                    fmt::format("--size {}: the longest side of {} has at least {} voxels{}",
                                *options.largest_side, s.name, least, why));
    }
    const auto frame_bytes = [&] {
        std::uint64_t bytes = 0;
        for (const ExportFormat format : formats)
            bytes += is_dense(format) ? dense_bytes(options, s, format) : 0;
        return bytes;
    };
    if (options.budget_bytes) {
        if (!dense)
            throw Error(ErrorCode::usage,
                        "--budget counts dense formats: raw, bricks, vti, dds, ktx2 or slices");
        if (!coarsen_until([&] { return frame_bytes() <= *options.budget_bytes; }))
            throw Error(ErrorCode::usage, "--budget " + bytes_text(std::size_t(*options.budget_bytes)) +
                                              " is less than the smallest frame takes" +
                                              (keeps_period(s, longest) ? "" : " whose tiles fit"));
        if (s.layout.factor > 1)
            notes.push_back(
                fmt::format("{}: voxels of {:g} m instead of {:g} m, so that a frame fits into {}", s.name,
                            edge * s.layout.factor, edge, bytes_text(std::size_t(*options.budget_bytes))));
    }
    const int side = longest_side();
    if (options.limit_side > 0 && dense && side > options.limit_side) {
        const bool is_cured = coarsen_until([&] { return longest_side() <= options.limit_side; });
        throw Error(ErrorCode::usage,
                    fmt::format("{}: {} voxels on a side, but {} takes at most {}: give {}", s.name, side,
                                options.target, options.limit_side,
                                is_cured ? fmt::format("--voxel {:.9g} or a --size", s.layout.factor * edge)
                                         : "a smaller lattice"));
    }
    const VolumeBox box = box_of(s.extent, s.placement, s.layout);
    if (dense && box.padding != std::array<int, 3>{}) {
        bool repeats = false;
        for (std::size_t a = 0; a < 3; ++a)
            repeats = repeats || (box.padding[a] > 0 && s.layout.periodic[std::size_t(box.axis[a])]);
        notes.push_back(
            fmt::format("{}: padded with 0 by {} x {} x {} voxels to {} x {} x {}{}", s.name, box.padding[0],
                        box.padding[1], box.padding[2], box.size[0], box.size[1], box.size[2],
                        repeats ? "; it repeats after `period_m`, not after its size: do not let a "
                                  "sampler wrap around"
                                : ""));
    }
}

}  // namespace

void take_first(const LoadedDensity& first, ExportSequence& s) {
    s.extent = first.density.extent();
    s.grid_bytes = first.density.memory_bytes();
    s.placement = first.density.placement();
    s.refine = first.refine;
    s.of_nephos = first.metadata.has_value();
    if (first.metadata) s.metadata = *first.metadata;
    if (s.of_nephos && s.metadata.frames_per_second > 0) s.frames_per_second = s.metadata.frames_per_second;
}

void take_moment(const LoadedDensity& loaded, SourceFrame& frame) {
    if (!loaded.metadata) return;
    frame.time_s = loaded.metadata->time_s;
    frame.utc = utc_at(loaded.metadata->georeference, frame.time_s);
}

bool is_wanted(const ExportOptions& o, int number, int least) {
    const int first = o.first_frame > 0 ? o.first_frame : least;
    return number >= first && number <= o.last_frame && (number - first) % o.frame_step == 0;
}

bool is_dense(ExportFormat format) {
    return format != ExportFormat::nvdb && format != ExportFormat::usd && format != ExportFormat::vdb &&
           format != ExportFormat::flightgear;
}

bool has_velocity(const ExportOptions& options, const ExportSequence& s) {
    return !options.velocity_name.empty() && (!s.metadata.wind.empty() || !s.wind_fields.empty());
}

bool is_packed(const ExportOptions& options, ExportFormat format) {
    return format == ExportFormat::slices || (format == ExportFormat::vti && options.zip);
}

std::vector<std::array<int, 3>> level_sizes(const ExportSequence& s, ExportFormat format) {
    const bool one = format == ExportFormat::vti || format == ExportFormat::slices;
    return level_sizes(box_of(s.extent, s.placement, s.layout).size, one ? 1 : s.levels);
}

std::uint64_t dense_bytes(const ExportOptions& options, const ExportSequence& s, ExportFormat format) {
    const VoxelType type = type_of(options, format);
    const std::vector<std::array<int, 3>> sizes = level_sizes(s, format);
    if (format == ExportFormat::bricks) return most_brick_bytes(sizes, options.brick_edge, type);
    return encoded_bytes(sizes, type);
}

VoxelType format_type(ExportFormat format) {
    switch (format) {
        case ExportFormat::dds:
        case ExportFormat::ktx2:
            return VoxelType::bc4;
        case ExportFormat::slices:
        case ExportFormat::bricks:
            return VoxelType::r8;
        default:
            return VoxelType::r32f;
    }
}

VoxelType type_of(const ExportOptions& options, ExportFormat format) {
    if (!is_dense(format))
        return options.type == VoxelType::r16f && format == ExportFormat::vdb ? VoxelType::r16f
                                                                              : VoxelType::r32f;
    return options.type.value_or(format_type(format));
}

std::vector<ExportFormat> all_formats(const ExportOptions& options) {
    std::vector<ExportFormat> formats = options.formats;
    if (std::ranges::count(formats, ExportFormat::usd) > 0) formats.push_back(ExportFormat::vdb);
    std::sort(formats.begin(), formats.end());
    formats.erase(std::unique(formats.begin(), formats.end()), formats.end());
    return formats;
}

std::vector<WeatherFormat> all_weather(const ExportOptions& options) {
    std::vector<WeatherFormat> formats = options.weather;
    std::sort(formats.begin(), formats.end());
    formats.erase(std::unique(formats.begin(), formats.end()), formats.end());
    return formats;
}

SourceFrame frame_of_run(const RunListing& run, const ListedFrame& frame,
                         const std::optional<std::string>& layer) {
    SourceFrame source;
    source.file = density_file(run, frame, layer);
    source.number = frame.number;
    source.time_s = frame.time_s;
    source.utc = utc_at(run.scene.georeference, frame.time_s);
    source.stamp = stamp_of(source.file);
    source.listed = listed_digest(run, frame, source.file);
    return source;
}

std::string damage_note(const SourceFrame& frame, const FileDigest& read) {
    if (!frame.listed || *frame.listed == read) return {};
    return frame.file.string() +
           ": is damaged or was changed: it is not the file that the manifest of its run lists (nephos "
           "verify compares all of them)";
}

void require_unchanged(const SourceFrame& frame) {
    if (stamp_of(frame.file) == frame.stamp) return;
    throw Error(ErrorCode::io, frame.file.string() + ": was changed while it was exported: export it again");
}

std::string frame_pattern(const std::string& name, const NamedFormat& format) {
    std::string pattern;
    for (const char c : name) pattern += c == '%' ? std::string("%%") : std::string(1, c);
    return pattern + "_%04d" + std::string(format.extension);
}

std::string frame_name(const ExportSequence& sequence, int number, ExportFormat format) {
    for (const NamedFormat& named : export_formats())
        if (named.format == format) return fmt::format("{}_{:04}{}", sequence.name, number, named.extension);
    return {};
}

namespace {

bool is_of_files(const WindField& field) { return field.kind == WindFieldKind::grid; }

// Notes what a reader of summaries of weather has to know. Throws Error(usage) unless the layers have files of their own.
void look_at_weather(const RunListing& run, std::vector<std::string>& notes) {
    for (const LayerOptions& layer : run.scene.layers)
        if (has_density(layer) && !run.frames.empty()) density_file(run, run.frames.front(), layer.name);
    if (const std::string note = datum_note(run.scene); !note.empty()) notes.push_back(note);
    if (!run.scene.automaton.wind.fields.empty())
        notes.push_back(
            "summaries of weather have the wind by height alone: what `[[wind_field]]` adds is not in them");
}

}  // namespace

std::optional<RunListing> run_of(const ExportOptions& options) {
    if (!options.files.empty() || type_behind(options.source) != std::filesystem::file_type::directory)
        return std::nullopt;
    if (!is_run_folder(options.source))
        throw Error(ErrorCode::io,
                    options.source.string() + ": is no folder of a run (it has no manifest.json)");
    return read_run(options.source);
}

std::vector<ExportSequence> list_sequences(const ExportOptions& options, const std::optional<RunListing>& run,
                                           std::vector<std::string>& notes) {
    std::vector<ExportSequence> sequences;
    if (run) {
        if (!run->complete)
            notes.push_back(run->folder.string() +
                            ": the run is not complete; its frames so far are exported");
        if (!options.weather.empty()) look_at_weather(*run, notes);
        // Weather alone is made of the layers, and needs no file of all together.
        const bool has_volumes = !all_formats(options).empty() || run->scene.layers.empty();
        std::vector<std::optional<std::string>> layers{options.layer};
        if (options.layer == "each" || !has_volumes) {
            layers.clear();
            for (const LayerOptions& layer : run->scene.layers)
                if (has_density(layer)) layers.emplace_back(layer.name);
            if (layers.empty()) throw Error(ErrorCode::usage, "the scene has no layers with a density");
        } else if (options.layer == "all") {
            layers = {std::nullopt};
        }
        for (const auto& layer : layers) sequences.push_back(sequence_of_run(options, *run, layer));
    } else {
        sequences.push_back(sequence_of_files(options));
        if (options.layer && options.layer != "all")
            throw Error(ErrorCode::usage, "--layer: layers are those of a run, not of a file");
    }
    for (ExportSequence& s : sequences) {
        choose_layout(options, s, notes);
        if (options.velocity_name.empty()) continue;
        // These have no velocities without the files: a grid of them would say that the air is calm.
        const bool has_files = std::erase_if(s.wind_fields, is_of_files) > 0;
        if (has_files)
            notes.push_back(s.name + ": the wind that the scene has from files is not in the grid `" +
                            options.velocity_name +
                            "` (density.write_velocity writes it into those of the run)");
        if (s.metadata.wind.empty() && s.wind_fields.empty())
            notes.push_back(s.name + (has_files ? ": no other wind blows" : ": the air is calm") +
                            ": its VDB files have no grid `" + options.velocity_name + "`");
    }
    return sequences;
}

}  // namespace nephos
