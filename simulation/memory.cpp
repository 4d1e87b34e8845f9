// SPDX-License-Identifier: Apache-2.0
#include "simulation/memory.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "automaton/automaton.h"
#include "core/error.h"
#include "core/text.h"
#include "density/vdb/vdb_file.h"
#include "simulation/frame_output.h"
#include "simulation/scene_files.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

constexpr std::size_t kUnlimited = std::numeric_limits<std::size_t>::max();

// Of the state and the history, while a checkpoint is made or read: of layers a growing buffer and the file's content;
// of one lattice the file's content and its parts.
constexpr double kCheckpointCopies = 3;
constexpr double kCheckpointCopiesOfLattice = 2;
// 43 MiB on two cores; threads have heaps of their own.
constexpr std::size_t kProgram = std::size_t(64) << 20;
constexpr double kGrids = 3;              // two steps and the frame between them
constexpr double kBytesPerVoxel = 4.5;    // a float, and the masks and nodes of the tree above it
constexpr double kBytesPerCoverage = 48;   // a CoverageField and the cells that it is made of, by cell
constexpr double kBytesPerMarchedLight = 100;  // the light of a cell, and what computing it takes
constexpr double kBytesPerBits = 1;       // hum, act and cld with their masks and nodes
constexpr double kPlannedCover = 0.5;     // fraction of voxels that are metaballs
// Itself twice, its colour, its keys while sorting, on the device too.
constexpr double kBytesPerMetaball = 84;
constexpr double kBytesPerPixel = 96;  // layers of the picture on both sides, and the files being written
constexpr double kBytesPerShadowTexel = 16;
// ffmpeg with the threads and options of render/image/video.cpp, measured from 640x360 to 1920x1080.
constexpr double kBytesPerPixelEncoded = 240;
constexpr std::size_t kEncoder = std::size_t(64) << 20;
constexpr double kBytesPerPictureWritten = 20;  // a pixel of Picture: colour, transmittance, depth

std::size_t saturated(double bytes) { return bytes < double(kUnlimited) ? std::size_t(bytes) : kUnlimited; }

std::size_t sum(std::size_t a, std::size_t b) { return a > kUnlimited - b ? kUnlimited : a + b; }

std::string advice(const MemoryEstimate& estimate) {
    const std::size_t largest = std::max({estimate.automaton, estimate.density, estimate.pictures});
    if (largest == estimate.automaton) return "fewer `lattice.cells`";
    if (largest == estimate.density) return "fewer `lattice.cells` or a smaller `density.refine`";
    return "fewer `lattice.cells`, a smaller `density.refine` or smaller pictures";
}

// Voxels in memory when every block of 8x8x8 holds something.
double voxels_in_blocks(const Extent& cells, int refine) {
    const auto along = [&](int n) { return std::ceil(double(n) * refine / 8) * 8; };
    return along(cells.x) * along(cells.y) * along(cells.z);
}

// Cells around which a CoverageField has samples, when there is cloud in every brick.
double cells_with_detail(const Extent& cells) {
    constexpr double kMargin = 16;  // on both sides together, of metaballs of two cells
    return (cells.x + kMargin) * (cells.y + kMargin) * (cells.z + kMargin);
}

// The grids of the frame that is made, of those that are under way to their files, and the copies that are
// written, of one frame at a time.
double grid_bytes(const Extent& cells, const DensityOptions& density, bool detail, double under_way) {
    const double written = voxels_in_blocks(cells, density.refine);
    double bytes = (kGrids + under_way) * kBytesPerVoxel * voxels_in_blocks(cells, 1);
    if (density.refine > 1) bytes += kBytesPerVoxel * written;
    double copies = 0;
    if (density.write_velocity) copies += velocity_bytes(written);
    if (density.write_state) copies += kBytesPerBits * written;
    // The field that a grid is refined from is gone before its copies are made.
    const bool detailed = density.refine > 1 && detail;
    return bytes + std::max(copies, detailed ? kBytesPerCoverage * cells_with_detail(cells) : 0.0);
}

}  // namespace

std::size_t MemoryEstimate::total() const { return sum(sum(program, automaton), sum(density, pictures)); }

namespace {

// Voxels of a lattice whose blocks all hold something, in voxels of `voxel_m`.
double voxels_of_size(const AutomatonOptions& lattice, double voxel_m) {
    const double per_cell = lattice.placement.cell_size_m / voxel_m;
    return voxels_in_blocks(lattice.extent, 1) * per_cell * per_cell * per_cell;
}

// Planes of bits alone: nothing of earlier states is remembered.
MemoryEstimate statistics_estimate(const Scene& scene, const AutomatonOptions& lattice) {
    const double copies = scene.layers.empty() ? kCheckpointCopiesOfLattice : kCheckpointCopies;
    MemoryEstimate estimate;
    estimate.automaton = sum(Automaton::memory_bytes(lattice),
                             saturated(copies * 3 * double(BitPlane::bytes(lattice.extent))));
    return estimate;
}

MemoryEstimate lattice_estimate(const Scene& scene, const AutomatonOptions& lattice, double under_way) {
    const double window =
        2.0 * scene.density.smoothing.t0 + 2;  // the steps around both neighbours of a frame
    // With the state written, hum and act are remembered beside cld. A checkpoint holds the planes and that
    // history as bytes: gathered in a growing buffer, and copied once into the file's content.
    const double plane = double(BitPlane::bytes(lattice.extent));
    const double history = window * (remembers_whole_state(scene) ? 3 : 1) * plane;
    const double planes_under_way = scene.density.write_state ? under_way * 3 * plane : 0;
    const double checkpoint = kCheckpointCopies * (3 * plane + history);
    // Moisture of both neighbours of a frame and between them, and of frames under way; and what smoothing leaves.
    const bool detail = count_detailed(scene) > 0;
    const double moisture = detail
                                ? (5 + under_way) * kBytesPerVoxel * voxels_in_blocks(lattice.extent, 1)
                                : 0;
    MemoryEstimate estimate;
    estimate.automaton = Automaton::memory_bytes(lattice);
    estimate.density = saturated(history + planes_under_way + checkpoint + moisture +
                                 grid_bytes(lattice.extent, scene.density, detail, under_way));
    return estimate;
}

// A veil has grids alone: nothing of it is remembered.
MemoryEstimate veil_estimate(const Scene& scene, const AutomatonOptions& lattice, bool detail,
                             double under_way) {
    DensityOptions density = scene.density;
    density.write_state = false;
    MemoryEstimate estimate;
    estimate.density = saturated(grid_bytes(lattice.extent, density, detail, under_way));
    return estimate;
}

// Voxels in blocks of the box around all layers, in voxels of `voxel_m`.
double voxels_of_box(const Scene& scene, double voxel_m) {
    double voxels = 1;
    for (int a = 0; a < 3; ++a) {
        double low = std::numeric_limits<double>::infinity(), high = -low;
        for (const LayerOptions& layer : scene.layers) {
            if (!has_density(layer)) continue;
            const int count = a == 0 ? layer.extent.x : a == 1 ? layer.extent.y : layer.extent.z;
            low = std::min(low, layer.placement.origin_m[a]);
            high = std::max(high, layer.placement.origin_m[a] + count * layer.placement.cell_size_m);
        }
        voxels *= std::max(8.0, (high - low) / voxel_m + 8);
    }
    return voxels;
}

// Grids of all layers together, which have the smallest voxels of all: of the frame that is made and of those
// under way. A refined one is of one frame alone.
double combined_bytes(const Scene& scene, double under_way) {
    if (scene.layers.size() < 2) return 0;
    double finest_m = std::numeric_limits<double>::infinity(), voxels = 0;
    for (const LayerOptions& layer : scene.layers) {
        if (has_density(layer))
            finest_m = std::min(finest_m, layer.placement.cell_size_m / scene.density.refine);
    }
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (has_density(scene.layers[n])) voxels += voxels_of_size(automaton_options(scene, n), finest_m);
    }
    const double coarse = voxels / std::pow(double(scene.density.refine), 3);
    const double wind = scene.density.write_velocity && scene.density_files.combined
                            ? velocity_bytes(voxels_of_box(scene, finest_m))
                            : 0;
    return (voxels + under_way * coarse) * kBytesPerVoxel + wind;
}

}  // namespace

namespace {

// Maps of the ground: those that the history remembers, and of frames under way; the history's again in
// checkpoints.
double ground_bytes(const Scene& scene, double under_way) {
    if (!scene.ground_cover.enabled) return 0;
    const double map = 3.0 * sizeof(float) * scene.ground_cover.texels * scene.ground_cover.texels;
    const double history = 2.0 * scene.density.smoothing.t0 + 2;
    return map * (history * (1 + kCheckpointCopies) + under_way);
}

// Heights with their quadtree, slopes and what they see, and what reading or making them takes; and where the rays of a
// picture meet them.
double terrain_bytes(const Scene& scene, double pixels) {
    const TerrainOptions& terrain = scene.render.terrain;
    if (!terrain.any()) return 0;
    constexpr double kMostOfFile = 4096;
    const double side = terrain.relief != Relief::none ? terrain.cells
                        : terrain.raw_columns > 0      ? std::max(terrain.raw_columns, terrain.raw_rows)
                                                       : kMostOfFile;
    const double shape = std::min(terrain.width_m, terrain.length_m) / std::max(terrain.width_m, terrain.length_m);
    constexpr double kBytesPerHeight = 64, kBytesPerPixelOfTerrain = 16;
    return side * side * (terrain.relief != Relief::none ? shape : 1.0) * kBytesPerHeight + pixels * kBytesPerPixelOfTerrain;
}

// The mirrored view and its levels.
double mirror_bytes(const Scene& scene, double pixels) {
    const bool mirrors = scene.ground_cover.enabled || scene.render.ground.pattern == GroundPattern::water;
    if (!mirrors || scene.render.wet_ground.reflection == 0) return 0;
    const double scale = 1.15 * scene.render.wet_ground.reflection_scale;
    return pixels * scale * scale * (kBytesPerPixel + 4 * sizeof(float) * 4 / 3);
}

}  // namespace

MemoryEstimate memory_estimate(const Scene& scene, RunParts parts) {
    MemoryEstimate estimate;
    estimate.program = kProgram;
    const bool frames = parts != RunParts::statistics;
    const bool pictures = parts == RunParts::pictures && wants_pictures(scene);
    const double under_way =
        (frames ? double(kFramesWritten) : 0) + (pictures ? double(kFramesDrawn + kFramesPrepared) : 0);
    double cells = 0, detailed = 0;
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        if (!scene.layers.empty() && !has_density(scene.layers[n])) continue;
        const AutomatonOptions options = automaton_options(scene, n);
        const bool veil = !scene.layers.empty() && scene.layers[n].is_veil;
        const bool detail = veil ? layer_detail(scene, n).enabled : count_detailed(scene) > 0;
        const MemoryEstimate lattice = veil     ? veil_estimate(scene, options, detail, under_way)
                                       : frames ? lattice_estimate(scene, options, under_way)
                                                : statistics_estimate(scene, options);
        estimate.automaton = sum(estimate.automaton, lattice.automaton);
        estimate.density = sum(estimate.density, lattice.density);
        cells += double(options.extent.x) * options.extent.y * options.extent.z;
        if (detail) detailed += cells_with_detail(options.extent);
    }
    const double combined = frames ? combined_bytes(scene, under_way) : 0;
    estimate.density = sum(estimate.density, saturated(combined + ground_bytes(scene, under_way)));
    if (!pictures) return estimate;
    const double pixels = double(scene.render.camera.width) * scene.render.camera.height;
    const double texels = double(scene.render.shadow_map_size) * scene.render.shadow_map_size;
    const double metaballs = cells * kPlannedCover;
    estimate.pictures =
        saturated(metaballs * kBytesPerMetaball + pixels * kBytesPerPixel + texels * kBytesPerShadowTexel +
                  mirror_bytes(scene, pixels) + terrain_bytes(scene, pixels) +
                  kPlannedCover * detailed * (kBytesPerCoverage + kBytesPerMarchedLight) +
                  double(kFramesWritten) * (pixels * kBytesPerPictureWritten + texels * sizeof(float)));
    if (wants_video(scene))
        estimate.pictures = sum(estimate.pictures, kEncoder + saturated(pixels * kBytesPerPixelEncoded));
    return estimate;
}

std::size_t memory_estimate_bytes(const Scene& scene, RunParts parts) {
    return memory_estimate(scene, parts).total();
}

void check_memory(const Scene& scene, const AvailableMemory& available, RunParts parts) {
    MemoryEstimate estimate = memory_estimate(scene, parts);
    if (estimate.total() <= available.bytes) return;
    // Winds that are a profile take less, which only their files tell.
    if (!scene.automaton.wind.fields.empty()) estimate = memory_estimate(with_files(scene), parts);
    if (estimate.total() <= available.bytes) return;
    const Extent& extent = scene.automaton.extent;
    const std::string cells = scene.layers.empty()
                                  ? fmt::format("{} x {} x {} cells", extent.x, extent.y, extent.z)
                                  : fmt::format("the lattices of {} layers", scene.layers.size());
    throw Error(ErrorCode::usage, "the scene needs about " + bytes_text(estimate.total()) +
                                      " of memory (automaton " + bytes_text(estimate.automaton) +
                                      ", density " + bytes_text(estimate.density) + ", pictures " +
                                      bytes_text(estimate.pictures) + ") for " + cells + ", but the " +
                                      available.limit + " leaves " + bytes_text(available.bytes) +
                                      ": expected " + advice(estimate));
}

void check_memory(const Scene& scene, RunParts parts) { check_memory(scene, available_memory(), parts); }

void require_memory(std::size_t bytes, const std::string& what) {
    const AvailableMemory available = available_memory();
    if (bytes <= available.bytes) return;
    throw Error(ErrorCode::usage,
                fmt::format("{} takes about {}, but {} ({}) are all there is", what, bytes_text(bytes),
                            bytes_text(available.bytes), available.limit));
}

}  // namespace nephos
