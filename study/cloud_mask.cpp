// SPDX-License-Identifier: Apache-2.0
#include "study/cloud_mask.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "statistics/clouds.h"
#include "study/cloud_mask_axes.h"
#include "study/netcdf_file.h"
#include "study/snapshot.h"
#include <fmt/format.h>

#include "core/error.h"
#include "core/png/png_input.h"
#include "density/vdb/mask_file.h"
#include "scenes/format/text.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kGreyThreshold = 127;
constexpr int kNullDraws = 20;
constexpr std::uint64_t kNullSeed = 1;

[[noreturn]] void fail(ErrorCode code, const std::filesystem::path& path, const std::string& message) {
    throw Error(code, path.string() + ": " + message);
}

double cell_size(const std::filesystem::path& path, const MaskOptions& options) {
    if (!options.cell_size_m)
        fail(ErrorCode::usage, path,
             "does not say how large its cells are: give --cell-size METRES (cell_size_m of a target)");
    return *options.cell_size_m;
}

void require_no_height(const std::filesystem::path& path, const MaskOptions& options) {
    if (options.level_height_m)
        fail(ErrorCode::usage, path,
             "is a view from above without levels: leave out --level-height (level_height_m of a target)");
}

// Makes each voxel cloud.
void fill(BitPlane& plane) {
    const Extent extent = plane.extent();
    for (int k = 0; k < extent.z; ++k)
        for (int j = 0; j < extent.y; ++j)
            for (int i = 0; i < extent.x; ++i) plane.set(i, j, k, true);
}

// Transforms of files lose digits to where they are.
bool is_near(double a, double b) { return std::abs(a - b) <= 1e-6 * std::max(std::abs(a), std::abs(b)); }

// Limits a mask seen from above: each of its columns is gone over for each random field that the organisation of its clouds is
// compared with.
constexpr std::uint64_t kMostColumns = std::uint64_t(1) << 28;

CloudMasks read_vdb_mask(const std::filesystem::path& path, const MaskOptions& options) {
    VdbReadOptions reading;
    reading.grid = options.variable;
    const double threshold = options.threshold.value_or(0);
    const LoadedDensity loaded = load_mask(path, threshold, reading);
    const DensityGrid& grid = loaded.density;
    const double size = grid.placement().cell_size_m;
    if (options.cell_size_m || options.level_height_m)
        fail(ErrorCode::usage, path,
             fmt::format("has voxels of {} m itself: leave out the size of cells and levels", size));
    const Extent extent = grid.extent();
    if (const int longest = std::max({extent.x, extent.y, extent.z}); longest > kMaxExtent)
        fail(ErrorCode::io, path,
             fmt::format("has {} voxels along an axis; at most {} can be read", longest, kMaxExtent));
    if (std::uint64_t(extent.x) * std::uint64_t(extent.y) > kMostColumns)
        fail(ErrorCode::io, path,
             fmt::format("has {} x {} columns of voxels; at most {} can be read", extent.x, extent.y,
                         kMostColumns));
    require_memory(BitPlane::bytes(extent), fmt::format("{}: the mask of {} x {} x {} voxels around its grid",
                                                        path.string(), extent.x, extent.y, extent.z));
    CloudMasks masks{
        {}, size, loaded.level_height_m, {grid.placement().origin_m.z}, options.boundaries, false, 0, {}};
    masks.notes = loaded.notes;
    BitPlane& plane = masks.snapshots.emplace_back(extent);
    if (threshold < 0 && loaded.negative > 0)
        fail(ErrorCode::usage, path,
             fmt::format("has {} values below 0, which are read as 0, and so does not tell what is above {}: "
                         "expected a "
                         "threshold of 0 or more",
                         loaded.negative, threshold));
    if (threshold < 0) {  // so that what is clear is cloud
        fill(plane);
        return masks;
    }
    grid.visit_blocks([&](const VoxelBlock& block) {
        std::size_t at = 0;
        for (int k = 0; k < block.size[2]; ++k)
            for (int j = 0; j < block.size[1]; ++j)
                for (int i = 0; i < block.size[0]; ++i)
                    if (block.values[at++] > 0)
                        plane.set(block.low[0] + i, block.low[1] + j, block.low[2] + k, true);
    });
    return masks;
}

CloudMasks read_netcdf_mask(const std::filesystem::path& path, const MaskOptions& options) {
    const NetcdfSource source(path, options.variable);
    const MaskAxes axes = mask_axes(path, source);
    std::vector<std::uint64_t> sizes;
    for (const NetcdfAxis& axis : source.axes()) sizes.push_back(axis.size);
    const std::uint64_t times = axes.has_time ? sizes.front() : 1;
    if (axes.has_time) sizes.erase(sizes.begin());
    if (!axes.has_levels) sizes.insert(sizes.begin(), 1);
    for (const std::uint64_t size : sizes)
        if (size > std::uint64_t(kMaxExtent))
            fail(ErrorCode::usage, path,
                 fmt::format("has {} cells along an axis; at most {} can be read", size, kMaxExtent));
    const Extent extent{int(sizes[2]), int(sizes[1]), int(sizes[0])};
    const double size = cell_size(path, options);
    if (!axes.has_levels) require_no_height(path, options);
    const bool is_flat = !axes.has_levels || (extent.z == 1 && !options.level_height_m);
    CloudMasks masks{{}, size, options.level_height_m.value_or(size), {}, options.boundaries, is_flat, 0, {}};
    masks.bases_m.assign(times, 0);
    if (!axes.note.empty()) masks.notes.push_back(axes.note);
    if (axes.downwards)
        masks.notes.push_back(fmt::format("the levels of the variable {} go downwards, and are turned over",
                                          shortened(source.name())));
    // Row by row: as bits the masks are a small part of their values.
    const double threshold = options.threshold.value_or(0);
    std::vector<double> row(sizes[2]);
    std::uint64_t at = 0;
    for (std::uint64_t time = 0; time < times; ++time) {
        BitPlane& plane = masks.snapshots.emplace_back(extent);
        for (int level = 0; level < extent.z; ++level)
            for (int j = 0; j < extent.y; ++j) {
                const int k = axes.downwards ? extent.z - 1 - level : level;
                source.read(at, row);
                at += row.size();
                for (int i = 0; i < extent.x; ++i) {
                    const double value = row[std::size_t(i)];
                    masks.missing += std::isnan(value);
                    if (value > threshold) plane.set(i, j, k, true);
                }
            }
    }
    if (masks.missing > 0)
        masks.notes.push_back(fmt::format("{} of {} values are missing, and count as clear", masks.missing,
                                          times * extent.cells()));
    return masks;
}

CloudMasks read_png_mask(const std::filesystem::path& path, const MaskOptions& options) {
    if (!options.variable.empty()) fail(ErrorCode::usage, path, "a picture has no variables");
    const double size = cell_size(path, options);
    require_no_height(path, options);
    PngInput png(path, {.side = kMaxExtent, .pixels = kMostColumns});
    const Extent extent{png.width(), png.height(), 1};
    const double threshold = options.threshold.value_or(kGreyThreshold);
    CloudMasks masks{{}, size, size, {0}, options.boundaries, true, 0, {}};
    BitPlane& plane = masks.snapshots.emplace_back(extent);
    png.each_grey([&](std::size_t n, double grey) {
        const int row = int(n / std::size_t(extent.x));
        if (grey > threshold) plane.set(int(n % std::size_t(extent.x)), extent.y - 1 - row, 0, true);
    });
    return masks;
}

CloudMasks read_mask(const std::filesystem::path& path, const MaskOptions& options) {
    const std::string extension = path.extension().string();
    if (extension == ".vdb") return read_vdb_mask(path, options);
    if (extension == ".nc" || extension == ".nc3" || extension == ".cdf")
        return read_netcdf_mask(path, options);
    if (extension == ".png") return read_png_mask(path, options);
    fail(ErrorCode::usage, path, "is no cloud mask by its name; expected .vdb, .nc or .png");
}

// The mean over snapshots that follow each other, as of a steady run of a sweep: they are not independent. Fewer than eight do
// not tell how much they have in common, and count as independent.
SeriesMean mean_of(const std::vector<double>& values) {
    constexpr std::size_t kEnough = 8;
    if (std::ranges::any_of(values, [](double value) { return !std::isfinite(value); }))
        return {kNaN, kNaN, kNaN, kNaN, kNaN};
    const double n = double(values.size());
    // Alike, they would differ from their mean by its rounding.
    if (n > 1 && std::ranges::count(values, values.front()) == std::ptrdiff_t(n))
        return {values.front(), 0, 0, 1, n};
    if (values.size() >= kEnough) return mean_over(values, {Regime::steady, 0, values.size(), 0, 0}, 1);
    double sum = 0, squares = 0;
    for (const double value : values) sum += value;
    const double mean = sum / n;
    if (values.size() < 2) return {mean, kNaN, kNaN, kNaN, n};
    for (const double value : values) squares += (value - mean) * (value - mean);
    const double deviation = std::sqrt(squares / (n - 1));
    return {mean, deviation / std::sqrt(n), deviation, 1, n};
}

// Throws Error(usage) where the clouds of a shadow of so many runs take more memory than there is.
void require_memory_of_clouds(const CloudMasks& masks, const Extent& extent, std::uint64_t runs) {
    require_memory(clouds_2d_bytes(extent, runs), fmt::format("{}: labelling the clouds of {} x {} columns",
                                                              masks.files, extent.x, extent.y));
}

// Runs of a random shadow: one begins where a covered column follows a clear one, or begins a row. Few have more.
std::uint64_t runs_of_random_shadow(const Extent& extent, double cover) {
    const double columns = double(extent.x) * extent.y;
    return std::uint64_t(columns * cover * (1 - cover) + extent.y * cover * cover + 5 * std::sqrt(columns));
}

// The mean over the snapshots that have two clouds or more.
struct OrganisationSums {
    double iorg = 0, scai = 0, cop = 0, n = 0;
    void add(const Organisation& one) {
        if (std::isnan(one.iorg)) return;
        ++n;
        iorg += one.iorg;
        scai += one.scai;
        cop += one.cop;
    }
    Organisation mean() const { return {iorg / n, scai / n, cop / n}; }  // NaN of none
};

// Notes that several files share, each once: "a.nc and 3 more: ...".
class Notes {
  public:
    void add(const std::filesystem::path& path, const std::vector<std::string>& texts) {
        for (const std::string& text : texts) {
            const auto known = std::ranges::find(notes_, text, &Note::text);
            if (known == notes_.end())
                notes_.push_back({text, path.string(), 0});
            else
                ++known->more;
        }
    }
    std::vector<std::string> texts() const {
        std::vector<std::string> all;
        for (const Note& note : notes_)
            all.push_back(fmt::format("{}{}: {}", note.file,
                                      note.more > 0 ? fmt::format(" and {} more", note.more) : "",
                                      note.text));
        return all;
    }

  private:
    struct Note {
        std::string text, file;
        std::size_t more;
    };
    std::vector<Note> notes_;
};

}  // namespace

bool needs_levels(std::string_view statistic) {
    return statistic == "cloud_fraction" || statistic == "base_mean_m" || statistic == "top_mean_m" ||
           statistic == "overlap";
}

CloudMasks read_masks(const std::vector<std::filesystem::path>& paths, const MaskOptions& options) {
    for (const auto& [value, name] : {std::pair(options.cell_size_m, "cell size"),
                                      std::pair(options.level_height_m, "height of a level")})
        if (value && !(*value > 0 && std::isfinite(*value)))
            throw Error(ErrorCode::usage, fmt::format("a {} of {} m: must be above 0", name, *value));
    CloudMasks all;
    Notes notes;
    for (const std::filesystem::path& path : paths) {
        CloudMasks one = read_mask(path, options);
        notes.add(path, one.notes);
        if (all.snapshots.empty()) {
            all = std::move(one);
            continue;
        }
        const auto require_alike = [&](bool is_alike, const char* what) {
            if (!is_alike)
                fail(ErrorCode::usage, path, fmt::format("has another {} than the masks before it", what));
        };
        require_alike(one.snapshots.front().extent() == all.snapshots.front().extent(), "number of cells");
        require_alike(is_near(one.cell_size_m, all.cell_size_m), "cell size");
        require_alike(
            one.seen_from_above || all.seen_from_above || is_near(one.level_height_m, all.level_height_m),
            "height of levels");
        all.missing += one.missing;
        all.seen_from_above = all.seen_from_above || one.seen_from_above;
        std::ranges::move(one.snapshots, std::back_inserter(all.snapshots));
        all.bases_m.insert(all.bases_m.end(), one.bases_m.begin(), one.bases_m.end());
    }
    if (all.snapshots.empty()) throw Error(ErrorCode::usage, "no cloud mask is named");
    all.notes = notes.texts();
    all.files =
        paths.front().string() + (paths.size() > 1 ? fmt::format(" and {} more", paths.size() - 1) : "");
    return all;
}

MaskStatistics mask_statistics(const CloudMasks& masks) {
    const Extent extent = masks.snapshots.front().extent();
    const SizeRange range = default_size_range(extent);
    std::array<std::vector<double>, kStatistics.size()> series;
    CloudSizes sizes(range);
    OrganisationSums sums;
    const auto put = [&](std::string_view name, double value) {
        series[statistic_index(name)].push_back(value);
    };
    for (std::size_t n = 0; n < masks.snapshots.size(); ++n) {
        const BitPlane& plane = masks.snapshots[n];
        const Placement levels{{0, 0, masks.bases_m[n]}, masks.level_height_m};
        require_memory_of_clouds(masks, extent, count_shadow_runs(plane.view()));
        const CloudCounts counts = count_cloud(plane.view(), masks.boundaries);
        const CloudStatistics s = cloud_statistics(counts, levels);
        put("cover", s.cover);
        put("cloud_fraction", s.mean_density);
        put("base_mean_m", s.base_mean_m);
        put("top_mean_m", s.top_mean_m);
        put("edge_per_km", edge_per_km(double(counts.edges) * masks.cell_size_m, extent, masks.cell_size_m));
        const Snapshot snapshot = take_snapshot(plane.view(), masks.boundaries, masks.cell_size_m, range);
        put("clouds_per_km2", snapshot.values[0]);
        put("cloud_area_m2", snapshot.values[1]);
        put("correlation_length_m", snapshot.values[2]);
        put("overlap", snapshot.values[3]);
        sizes.add(snapshot.sizes);
        sums.add(organisation(clouds_2d(plane.view(), masks.boundaries), extent, masks.boundaries));
    }
    MaskStatistics result;
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const bool is_known =
            !series[n].empty() && !(masks.seen_from_above && needs_levels(kStatistics[n].name));
        result.statistics[n] = is_known ? mean_of(series[n]) : SeriesMean{kNaN, kNaN, kNaN, kNaN, kNaN};
    }
    for (const std::string_view name : {"size_exponent", "size_exponent_line", "fractal_dimension"})
        result.statistics[statistic_index(name)] = size_statistic(name, sizes);
    result.organisation = sums.mean();
    const double cover = result.statistics[statistic_index("cover")].mean;
    require_memory_of_clouds(masks, extent, runs_of_random_shadow(extent, cover));
    result.random = null_organisation(extent, masks.boundaries, cover, kNullDraws, kNullSeed);
    return result;
}

}  // namespace nephos
