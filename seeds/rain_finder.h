// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain areas found in the automaton itself: where columns hold much water, joined to patches, each fitted by
// an ellipse, and followed from frame to frame so that neither the areas nor their names flicker.
//
// One update:
//   1. Water of a column = its cloudy cells * cell size (metres of cloud), averaged over a square of columns.
//   2. Columns above `keep_water_m` are joined to patches (eight neighbours, through periodic sides too). A
//   patch
//      counts if it reaches `start_water_m` somewhere, or continues an area of the last update.
//   3. The ellipse has the patch's centre and second moments: semi-axes 2 sqrt(variance) along the principal
//   axes,
//      exact for a filled ellipse. Intensity = mean water of the patch * mm_per_h_per_m.
//   4. Areas of the last update, carried by the wind since, take the nearest patch, the closest pairs first.
//   Place,
//      moments and intensity follow it with the time constant `respond_s`; an area without patch fades with
//      `fade_s`; a patch without area begins a new one at intensity 0.
// Two thresholds at each decision (water of columns, intensity of what is reported) are the hysteresis.
// Deterministic: patches are made in the order of the columns (x fastest), sums have a fixed order.

#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "seeds/rain_area.h"

namespace nephos {

struct RainFinderOptions {
    double start_water_m = 400;          // metres of cloud in a column from which it rains, > 0
    double keep_water_m = 250;           // and above which an area goes on; 0 < keep <= start
    int smooth_columns = 2;              // radius of the averaging square, 0..64
    double min_area_m2 = 250000;         // smaller patches are ignored, >= 0
    int max_areas = 256;                 // only so many of the largest patches, 1..4096
    double mm_per_h_per_m = 0.02;        // rain per metre of mean water, > 0
    double max_mm_per_h = 100;           // cap, > 0
    double respond_s = 120;              // >= 0; 0: at once
    double fade_s = 300;                 // >= 0
    double report_from_mm_per_h = 0.5;   // an area is listed once it reaches this
    double report_until_mm_per_h = 0.2;  // and until it falls below this; 0 < until <= from
    bool operator==(const RainFinderOptions&) const = default;
};

// Throws Error(usage) on values outside the ranges above.
void check(const RainFinderOptions& options);

// A patch of wet columns.
struct RainPatch {
    double x_m = 0, y_m = 0;                 // centre, world
    double xx_m2 = 0, xy_m2 = 0, yy_m2 = 0;  // second moments about it
    double area_m2 = 0;
    double water_m = 0;   // mean over its columns
    bool starts = false;  // reaches start_water_m
};

// Cloudy cells in each column, extent.x * extent.y of them, x fastest.
std::vector<std::uint32_t> column_counts(const BitPlaneView& cld);

// Steps 1 and 2 and the moments; largest first, at most max_areas.
std::vector<RainPatch> find_patches(const BitPlaneView& cld, const Placement& placement,
                                    const Boundaries& boundaries, const RainFinderOptions& options);

class RainFinder {
  public:
    // `layer` makes ids unique among several finders. Throws Error(usage) on bad options.
    RainFinder(const RainFinderOptions& options, Extent extent, const Placement& placement,
               const Boundaries& boundaries, std::uint32_t layer = 0);

    // The automaton `elapsed_s` (>= 0) after the last update, in which the wind moved the air by `moved_*_m`.
    // Throws Error(usage) when `cld` has another extent or a number is not finite.
    void update(const BitPlaneView& cld, double elapsed_s, double moved_x_m, double moved_y_m);

    // Those listed now, oldest first.
    std::vector<RainArea> areas() const;

    // The complete state; `restore` throws Error(io) on bytes that it did not write.
    std::vector<std::byte> save() const;
    void restore(std::span<const std::byte> bytes);

  private:
    struct Track {
        std::uint32_t number = 0;
        RainPatch shape;  // smoothed; area, water and starts unused
        double intensity_mm_per_h = 0;
        bool listed = false;
    };

    void follow(const std::vector<RainPatch>& patches, const std::vector<int>& track_of, double elapsed_s);
    std::vector<int> match(const std::vector<RainPatch>& patches) const;
    double wrapped(double difference_m, bool along_x) const;
    double target_mm_per_h(const RainPatch& patch) const;

    RainFinderOptions options_;
    Extent extent_;
    Placement placement_;
    Boundaries boundaries_;
    std::uint32_t layer_ = 0;
    std::vector<Track> tracks_;
    std::uint32_t next_number_ = 0;
};

}  // namespace nephos
