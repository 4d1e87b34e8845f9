// SPDX-License-Identifier: Apache-2.0
#pragma once

// Detects rain areas in the automaton's state: columns with much water are joined to patches, each patch is
// fitted by an ellipse and tracked from frame to frame, so that neither areas nor ids flicker.
//
// One update:
//   1. Water of a column = its cloudy cells * cell size (metres of cloud), averaged over a square of columns.
//   2. Columns above `keep_water_m` are joined to patches (eight neighbours, periodic sides included). A
//      patch counts if it reaches `start_water_m` somewhere, or continues an area of the last update.
//   3. The ellipse has the patch's centre and second moments: semi-axes 2 sqrt(variance) along the principal
//      axes, exact for a filled ellipse. Intensity = mean water of the patch * mm_per_h_per_m.
//   4. Areas of the last update, advected by the wind since, are matched to the nearest patches, the closest
//      pairs first. Position, moments and intensity follow the patch with the time constant `respond_s`; an
//      area without patch fades with `fade_s`; a patch without area starts a new one at intensity 0.
// Both decisions, which columns are wet and which areas are listed, have two thresholds (hysteresis).
// Deterministic: patches are found in the order of the columns (x fastest), sums have a fixed order.

#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "seeds/rain_area.h"

namespace nephos {

struct RainFinderOptions {
    double start_water_m = 400;          // water at which a patch starts to rain, metres of cloud, > 0
    double keep_water_m = 250;           // water above which it continues to rain; 0 < keep <= start
    int smooth_columns = 2;              // radius of the averaging square, 0..64
    double min_area_m2 = 250000;         // smaller patches are ignored, >= 0
    int max_areas = 256;                 // number of patches, the largest first, 1..4096
    double mm_per_h_per_m = 0.02;        // rain per metre of mean water, > 0
    double max_mm_per_h = 100;           // upper limit of the intensity, > 0
    double respond_s = 120;              // time constant of tracking, >= 0; 0: immediate
    double fade_s = 300;                 // time constant of fading, >= 0
    double report_from_mm_per_h = 0.5;   // an area is listed from this intensity on
    double report_until_mm_per_h = 0.2;  // and until it falls below this one; 0 < until <= from
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

// Returns the number of cloudy cells in each of the extent.x * extent.y columns, x fastest.
std::vector<std::uint32_t> column_counts(const BitPlaneView& cld);

// Performs steps 1 and 2 and computes the moments. Returns the largest patches first, at most max_areas.
std::vector<RainPatch> find_patches(const BitPlaneView& cld, const Placement& placement,
                                    const Boundaries& boundaries, const RainFinderOptions& options);

// Tracks the rain areas of one layer. Not thread-safe.
class RainFinder {
  public:
    // Creates a finder without areas; `layer` makes ids unique among several finders. Throws Error(usage) on
    // bad options.
    RainFinder(const RainFinderOptions& options, Extent extent, const Placement& placement,
               const Boundaries& boundaries, std::uint32_t layer = 0);

    // Updates the areas from the cloud plane `elapsed_s` (>= 0) after the last update; the wind displaced the
    // air by `moved_*_m` in between. Throws Error(usage) when `cld` has another extent or a number is not
    // finite.
    void update(const BitPlaneView& cld, double elapsed_s, double moved_x_m, double moved_y_m);

    // Returns the areas listed now, oldest first.
    std::vector<RainArea> areas() const;

    // Serialise and restore the complete state; restore() throws Error(io) on bytes that save() did not
    // write.
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
