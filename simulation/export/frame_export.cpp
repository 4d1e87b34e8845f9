// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/frame_export.h"

#include <algorithm>
#include <limits>
#include <map>
#include <new>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/wind.h"
#include "core/wind_field.h"
#include "density/combine.h"
#include "density/export/bricks.h"
#include "density/export/cloud_picture.h"
#include "simulation/export/export_plan.h"
#include "simulation/memory.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

std::string_view name_of(ExportFormat format) {
    for (const NamedFormat& named : export_formats())
        if (named.format == format) return named.name;
    return {};
}

// The box of voxels, coarser if the options want that, without border and padding.
VolumeBox cells_of(const ExportSequence& s) {
    return box_of(s.extent, {}, VolumeLayout{.factor = s.layout.factor});
}

constexpr int kLeafEdge = 8;  // of OpenVDB

// Voxels of whole leaves.
std::uint64_t leaf_voxels(const std::array<int, 3>& size) {
    std::uint64_t voxels = 1;
    for (const int side : size) voxels *= std::uint64_t(side + kLeafEdge - 1) / kLeafEdge * kLeafEdge;
    return voxels;
}

NanoCodec codec_of(const ExportOptions& options) { return options.zip ? NanoCodec::zip : NanoCodec::none; }

// Returns what NanoVDB takes beside a grid of so many bytes.
std::uint64_t nanovdb_bytes(const ExportOptions& options, std::uint64_t grid_bytes) {
    return nanovdb_work_bytes(grid_bytes, codec_of(options), options.quantise);
}

// Returns the leaves of the grid of larger voxels; none where its voxels are those of the source.
std::uint64_t coarser_grid_bytes(const ExportSequence& s) {
    return s.layout.factor > 1 ? sizeof(float) * leaf_voxels(cells_of(s).size) : 0;
}

// Returns what coarser() takes on the way to it: the box, and beside that its sums, and then the grid.
std::uint64_t coarsening_bytes(const ExportSequence& s) {
    if (s.layout.factor == 1) return 0;
    const std::uint64_t voxels = cells_of(s).voxels();
    return std::max(layout_bytes(voxels, s.layout.factor), sizeof(float) * voxels + coarser_grid_bytes(s));
}

// The wind in voxels of velocity_voxel(): its leaves, all of them, or, of a wind that is one everywhere, those that reach out of the box,
// and the nodes above them.
std::uint64_t wind_bytes(const ExportSequence& s) {
    constexpr int kNodeEdge = 128;
    constexpr double kNodeBytes = 66'000;
    std::array<int, 3> size = cells_of(s).size;
    const int edge = velocity_voxel({size[0], size[1], size[2]});
    double inner = s.wind_fields.empty() && s.metadata.wind.size() <= 1 ? 1 : 0, nodes = 1;
    for (int& side : size) {
        side = (side + edge - 1) / edge;
        inner *= side / kLeafEdge * kLeafEdge;
        nodes *= (side + kNodeEdge - 1) / kNodeEdge;
    }
    return std::uint64_t(velocity_bytes(double(leaf_voxels(size)) - inner) + kNodeBytes * nodes);
}

std::uint64_t cloud_bytes(const ExportSequence& s, std::uint64_t positive) {
    return largest_cloud_bytes(cells_of(s).size, s.layout.periodic, s.layout.factor, positive);
}

// Writes the file; returns the largest of its values.
float write_vdb_file(const std::filesystem::path& path, const ExportOptions& options, const ExportSequence& s,
                     const LoadedDensity& loaded, double time_s) {
    const DensityGrid density = coarser(loaded.density, s.layout.factor);
    VdbContent content;
    VdbMetadata metadata = loaded.metadata.value_or(VdbMetadata{});
    if (!loaded.metadata) metadata.nephos_version = version();
    content.half_voxel_shift = options.half_voxel_shift;
    content.density = &density;
    content.cells = density.placement();
    content.cells.cell_size_m *= coarser_refine(loaded.refine, s.layout.factor);
    content.half = options.type == VoxelType::r16f;
    if (!options.velocity_name.empty() && (!metadata.wind.empty() || !s.wind_fields.empty())) {
        Wind wind;
        if (!metadata.wind.empty()) wind.keyframes.push_back({0, metadata.wind});
        const Placement& at = density.placement();
        if (!s.wind_fields.empty())
            content.wind_field = [&s, time_s](const Vec3& place_m) {
                return velocity_of(s.wind_fields, place_m, time_s);
            };
        for (int k = 0; k < density.extent().z; ++k)
            content.wind.push_back(wind_at(wind, at.origin_m.z + (k + 0.5) * at.cell_size_m, 0));
        content.wind_name = options.velocity_name;
    }
    write_vdb(path, content, metadata);
    return density.max_value();
}

// Returns whether the VDB file of a frame would have the grid and metadata of its source: then its bytes are copied.
bool is_copy(const ExportOptions& options, const ExportSequence& s, const SourceFrame& frame,
             const ExportSource& source) {
    return frame.is_plain && frame.listed == source.digest && s.layout.factor == 1 &&
           !options.half_voxel_shift && options.velocity_name.empty() && options.type != VoxelType::r16f;
}

std::vector<Volume> levels_of(const DensityGrid& density, const ExportSequence& s) {
    std::vector<Volume> levels;  // not from a list, whose elements would be copied
    levels.push_back(lay_out(density, s.layout));
    for (int n = 1; n < s.levels; ++n) levels.push_back(halved(levels.back()));
    return levels;
}

EncodedVolume encoded_levels(const std::vector<Volume>& levels, VoxelType type, float scale) {
    EncodedVolume encoded{type, {}};
    for (const Volume& v : levels) encoded.levels.push_back({v.nx, v.ny, v.nz, encode(v, type, scale)});
    return encoded;
}

// FlightGear's type of a cloud, 0 wispy to 1 billowy; of an unknown genus that of cumulus, which the automaton makes.
double billows_of(const std::string& genus) {
    constexpr std::pair<std::string_view, double> kTypes[] = {
        {"Ci", 0},   {"Cs", 0.1}, {"Cc", 0.2}, {"St", 0.3}, {"Ns", 0.3}, {"As", 0.3},
        {"VV", 0.3}, {"Sc", 0.5}, {"Ac", 0.5}, {"Cu", 0.8}, {"Cb", 1}};
    for (const auto& [name, type] : kTypes)
        if (genus == name) return type;
    return 0.8;
}

// The voxels of a frame's files, before borders and levels: their largest is looked for when it is asked for, once. Takes
// layout_bytes() then, which box_bytes() counts as long as nothing else was made of the frame.
class FrameVoxels {
  public:
    FrameVoxels(const DensityGrid& density, int factor) : density_(density), factor_(factor) {}
    // Returns the largest of the source: none of the means is larger.
    float largest_cell() const { return density_.max_value(); }
    float largest() {
        if (factor_ == 1) return largest_cell();
        if (!largest_) largest_ = std::ranges::max(lay_out(density_, VolumeLayout{.factor = factor_}).values);
        return *largest_;
    }

  private:
    const DensityGrid& density_;
    int factor_;
    std::optional<float> largest_;
};

// Throws Error(usage) where a value, or the mean of several, is beyond 16-bit floats, in which it would be infinite.
void require_halves(const ExportOptions& options, const ExportSequence& s, const SourceFrame& frame,
                    FrameVoxels& voxels) {
    constexpr float kLargestHalf = 65504;
    for (const ExportFormat format : all_formats(options)) {
        const bool is_vdb = format == ExportFormat::vdb;
        const bool halves = is_vdb ? options.type == VoxelType::r16f
                                   : is_dense(format) && type_of(options, format) == VoxelType::r16f;
        const float most = kLargestHalf * (is_vdb ? 1 : s.scale);
        if (!halves || !(voxels.largest_cell() > most) || !(voxels.largest() > most)) continue;
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: its largest value{} is {:g}, and 16-bit floats end at {:g}: expected --type "
                        "r32f{}",
                        frame.file.string(), s.layout.factor > 1 ? ", or mean," : "", voxels.largest(),
                        kLargestHalf, is_vdb ? "" : " or --range auto"));
    }
}

// Throws Error(usage) where values, or their means, are so large or small that the library, which divides codes by the range of a leaf, finds
// infinity.
void require_codes(const ExportOptions& options, const ExportSequence& s, const SourceFrame& frame,
                   FrameVoxels& voxels) {
    if (options.quantise == NanoQuantise::none || voxels.largest_cell() <= 0) return;
    const auto codes = float(largest_code(options.quantise));
    // A leaf of a smaller range than codes / max float is lost in half of a code of the largest value.
    const float least = 2 * codes * codes / std::numeric_limits<float>::max();
    // The library rounds thrice on the way from the largest code, to infinity at the end of floats.
    const float most = std::numeric_limits<float>::max() * (1 - 4 * 0x1p-24F);
    if (voxels.largest_cell() > most && voxels.largest() > most)
        throw Error(ErrorCode::usage,
                    fmt::format("{}: its largest value, or mean, is {:.9g}, and --quantise takes grids up "
                                "to {:.9g}: expected --quantise none",
                                frame.file.string(), voxels.largest(), most));
    const double factor = s.layout.factor;
    if (double(voxels.largest_cell()) / (factor * factor * factor) >= double(least)) return;
    if (voxels.largest() >= least) return;
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: its largest value, or mean, is {:g}, and --quantise takes grids from {:g} on: "
                    "expected --quantise none",
                    frame.file.string(), voxels.largest(), least));
}

bool cuts_values(const ExportOptions& options) {
    return std::ranges::any_of(all_formats(options), [&](ExportFormat format) {
        const VoxelType type = type_of(options, format);
        const bool codes = type == VoxelType::r8 || type == VoxelType::r16 || type == VoxelType::bc4;
        return format == ExportFormat::flightgear || (is_dense(format) && codes);
    });
}

// Returns "" unless values, or their means, are above the scale in a type that ends there.
std::string cut_note(const ExportOptions& options, const ExportSequence& s, const SourceFrame& frame,
                     FrameVoxels& voxels) {
    if (!(voxels.largest_cell() > s.scale) || !cuts_values(options) || !(voxels.largest() > s.scale))
        return {};
    return fmt::format(
        "{}: values up to {:.9g} are above {:g}, and are cut in r8, r16, bc4 and flightgear "
        "(--range auto keeps them)",
        frame.file.string(), voxels.largest(), s.scale);
}

// Returns whether values above 0, of which none is above `largest`, are all 0 in a type.
bool is_lost(VoxelType type, float largest, float scale) {
    const std::vector<std::byte> code = encode({1, 1, 1, {largest}}, type, scale);
    return std::ranges::all_of(code, [](std::byte byte) { return byte == std::byte{0}; });
}

}  // namespace

ExportedFrame FrameExporter::write(const ExportSequence& s, const SourceFrame& frame,
                                   const LoadedDensity& loaded) const {
    try {
        return write_files(s, frame, loaded);
    } catch (const std::bad_alloc&) {
        throw Error(ErrorCode::io, frame.file.string() +
                                       ": out of memory while it was exported: expected a larger --voxel, or "
                                       "fewer frames at a time (-j 1)");
    }
}

ExportedFrame FrameExporter::write_files(const ExportSequence& s, const SourceFrame& frame,
                                         const LoadedDensity& loaded) const {
    if (!(loaded.density.extent() == s.extent) || !(loaded.density.placement() == s.placement))
        throw Error(ErrorCode::io,
                    frame.file.string() + ": has another box than the first file of its sequence");
    FrameVoxels voxels(loaded.density, s.layout.factor);
    require_halves(options_, s, frame, voxels);
    require_codes(options_, s, frame, voxels);
    std::string note_on_cut = cut_note(options_, s, frame, voxels);
    const ExportSource source{frame.file, file_digest(frame.file)};
    require_unchanged(frame);
    Encodings made;
    ExportedFrame result{{loaded.density.sum(), double(loaded.density.max_value())}, {}, {}};
    if (std::string note = damage_note(frame, *source.digest); !note.empty())
        result.notes.push_back(std::move(note));
    std::string lost;  // formats in which nothing of it is left
    const auto add = [&](ExportedFile file, bool kept) {
        if (file.is_lost) lost += (lost.empty() ? "" : ", ") + file.format;
        result.files.push_back({std::move(file), kept});
    };
    for (const ExportFormat format : all_formats(options_)) {
        if (format == ExportFormat::usd) continue;
        const std::string name = frame_name(s, frame.number, format);
        if (std::optional<ExportedFile> kept = list_.kept_file(name, source)) {
            add(std::move(*kept), true);
            continue;
        }
        if (std::string note = list_.note_on_change(name); !note.empty())
            result.notes.push_back(std::move(note));
        const auto write = [&](const std::filesystem::path& path) {
            const bool is_lost = write_format(path, format, s, frame, loaded, source, made);
            return is_lost && result.figures.max > 0;
        };
        add(list_.write_file(name, source, name_of(format), write), false);
    }
    if (!note_on_cut.empty()) result.notes.push_back(std::move(note_on_cut));
    if (!lost.empty())
        result.notes.push_back(
            fmt::format("{}: nothing of it is left in {}: its values, of which none is above {:g}, or their "
                        "means are below the first step there",
                        frame.file.string(), lost, result.figures.max));
    return result;
}

bool FrameExporter::write_format(const std::filesystem::path& path, ExportFormat format,
                                 const ExportSequence& s, const SourceFrame& frame,
                                 const LoadedDensity& loaded, const ExportSource& source,
                                 Encodings& made) const {
    const VoxelType type = type_of(options_, format);
    if (format == ExportFormat::vdb && is_copy(options_, s, frame, source)) {
        copy_atomically(frame.file, path);
        if (file_digest(path) == source.digest) return false;
        throw Error(ErrorCode::io,
                    frame.file.string() + ": was changed while it was exported: export it again");
    }
    if (format == ExportFormat::vdb)
        return is_lost(type, write_vdb_file(path, options_, s, loaded, frame.time_s), 1);
    if (format == ExportFormat::flightgear) {
        VolumeLayout layout;
        layout.factor = s.layout.factor;
        const std::scoped_lock lock(cloud_mutex_);  // so that what was asked for is there
        require_memory(std::size_t(cloud_bytes(s, loaded.density.active_voxels())),
                       frame.file.string() + ": to find its largest cloud");
        const CloudVoxels cloud = largest_cloud(lay_out(loaded.density, layout), s.layout.periodic, s.scale);
        write_cloud_picture(path, cloud, billows_of(s.genus));
        return std::ranges::all_of(cloud.codes, [](std::uint8_t code) { return code == 0; });
    }
    if (format == ExportFormat::nvdb) {
        const DensityGrid density = coarser(loaded.density, s.layout.factor);
        require_memory(std::size_t(nanovdb_bytes(options_, density.memory_bytes())),
                       frame.file.string() + ": as NanoVDB");
        write_nanovdb(path, density, codec_of(options_), options_.quantise);
        return density.max_value() <= 0;  // means of the least of floats
    }
    if (made.levels.empty()) made.levels = levels_of(loaded.density, s);
    const bool lost = is_lost(type, std::ranges::max(made.levels.front().values), s.scale);
    if (format == ExportFormat::bricks) {
        const VolumeBox box = box_of(s.extent, s.placement, s.layout);
        write_bricks(path, made.levels, {options_.brick_edge, type, s.scale, repeating_axes(box, s.layout)});
        return lost;
    }
    auto found = made.encoded.find(type);
    if (found == made.encoded.end())
        found = made.encoded.emplace(type, encoded_levels(made.levels, type, s.scale)).first;
    write_dense(path, format, s, frame, found->second);
    return lost;
}

void FrameExporter::write_dense(const std::filesystem::path& path, ExportFormat format,
                                const ExportSequence& s, const SourceFrame& frame,
                                const EncodedVolume& encoded) const {
    const VolumeBox box = box_of(s.extent, s.placement, s.layout);
    switch (format) {
        case ExportFormat::raw:
            return write_raw(path, encoded);
        case ExportFormat::dds:
            return write_dds(path, encoded, options_.legacy_dds);
        case ExportFormat::ktx2:
            return write_ktx2(path, encoded, sidecar_text(options_, s, {}, SidecarUse::in_frame));
        case ExportFormat::slices:
            return write_slices(path, encoded, slice_columns(box.size[0], box.size[1], box.size[2]));
        default: {
            VtiPlace place;
            place.time_s = frame.time_s;
            place.voxel_m = box.voxel_m;
            for (std::size_t a = 0; a < 3; ++a) place.first_m[a] = box.min_m[a] + box.voxel_m[a] / 2;
            return write_vti(path, encoded, place, options_.zip);
        }
    }
}

std::uint64_t box_bytes(const ExportOptions& options, const ExportSequence& s) {
    std::uint64_t passing = 0;  // of one file, while it is made
    std::set<VoxelType> types;
    bool has_boxes = false;
    // Levels are made once, for all formats, and so are their codes in a type.
    const std::vector<std::array<int, 3>> sizes = level_sizes(s, ExportFormat::raw);
    for (const ExportFormat format : all_formats(options)) {
        const VoxelType type = type_of(options, format);
        const bool is_grid = format == ExportFormat::vdb || format == ExportFormat::nvdb;
        std::uint64_t of_file = 0;
        if (format == ExportFormat::flightgear) of_file = cloud_bytes(s, 0);
        if (is_grid) of_file = coarser_grid_bytes(s);
        if (format == ExportFormat::nvdb)
            of_file += nanovdb_bytes(options, of_file > 0 ? of_file : s.grid_bytes);
        if (format == ExportFormat::bricks) of_file = brick_work_bytes(sizes, options.brick_edge, type);
        if (format == ExportFormat::vdb && has_velocity(options, s)) of_file += wind_bytes(s);
        if (is_grid) of_file = std::max(of_file, coarsening_bytes(s));
        if (is_packed(options, format)) of_file = dense_bytes(options, s, format);
        passing = std::max(passing, of_file);
        has_boxes = has_boxes || is_dense(format);
        if (is_dense(format) && format != ExportFormat::bricks) types.insert(type);
    }
    if (!has_boxes) return passing;
    std::uint64_t levels = encoded_bytes(sizes, VoxelType::r32f);  // as floats
    for (const VoxelType type : types) levels += encoded_bytes(sizes, type);
    const std::uint64_t top = box_of(s.extent, s.placement, s.layout).voxels();
    return std::max(levels + passing, layout_bytes(top, s.layout.factor));
}

// Each frame takes its grid, its voxels as floats, and its boxes.
std::size_t frames_at_once(const ExportOptions& options, const ExportSequence& s) {
    const std::uint64_t memory =
        std::min<std::uint64_t>(std::uint64_t(256) << 20, available_memory().bytes / 2);
    const std::size_t threads =
        tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
    // The heap of each thread reserves addresses, which a limit counts.
    constexpr std::size_t kFewAddresses = std::size_t(256) << 20;
    if (threads <= 1 || available_memory().bytes < kFewAddresses) return 1;
    const std::uint64_t voxels = leaf_voxels({s.extent.x, s.extent.y, s.extent.z});
    return std::size_t(
        std::clamp<std::uint64_t>(memory / (8 * voxels + box_bytes(options, s)), 1, threads + 1));
}

}  // namespace nephos
