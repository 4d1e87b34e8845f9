// SPDX-License-Identifier: Apache-2.0
#pragma once

// The samples of a veil along the rays of a row of pixels, and their light.
//
// Steps of a ray are no shorter than its part in the slab divided by VeilView::samples, so at a slant they may be longer
// than the free path in the cloud: the first sample within it would decide where its surface seems to lie, and surfaces
// would have contours, as the phase of the samples changes from pixel to pixel. Steps with cloud, and those beside them,
// are therefore divided into parts whose optical depth is small, front to back, until the ray is opaque; beyond that it
// has no samples at all. Rays of a row take their steps together, so that many points are evaluated at once. Private to
// the module.

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "render/options/options.h"
#include "render/veil/drawn_veil.h"
#include "render/shared/shared.h"
#include "render/veil/sheet_light.h"
#include "render/veil/slab_path.h"

namespace nephos {

inline constexpr double kFarthestVeil_m = 400'000;  // at 12 km it sets below the horizon before, seen from below
inline constexpr double kMostSunPath_m = 20'000;    // in the sheet

// A veil as the rays of a picture meet it.
struct Sheet {
    const DrawnVeil* veil = nullptr;
    const shader::FrameUniforms* frame = nullptr;  // of the picture; not null
    double base_m = 0, top_m = 0;  // above the eye
    Vec3 to_sun{};
    double sun_cosine = 1;  // >= kLeastSunCosine
    double bend = 0;        // earth_bend()
    double per_pixel = 0;   // footprint of a pixel at distance 1
    double ground_albedo = 0;
    double mean_factor = 1;  // of height_factor()
    double farthest_m = kFarthestVeil_m;
    Rgb sun{}, sky{}, ground{};  // light of a white surface in the sun, below the sky, of the ground
    double thickness_m() const { return top_m - base_m; }
    // From a height out of the top, towards the sun.
    double sun_path_m(double height_m) const {
        return std::min((top_m - height_m) / sun_cosine, kMostSunPath_m);
    }
    // S's g: of the density at a height.
    double height_factor(double height_m) const {
        const double at = (height_m - 0.5 * (base_m + top_m)) / thickness_m();
        return std::max(0.0, veil->view.height_slope * at + veil->view.height_offset);
    }
    double most_factor() const {
        return std::max({height_factor(base_m), height_factor(top_m), 1e-6});
    }
    // The optical depth of a column of a density, reduced by the asymmetry.
    double reduced_depth(double density) const {
        const double edges = 0.8;  // what the soft ends leave of a column, about
        return (1 - veil->view.g) * veil->extinction_per_m * density * mean_factor * edges * thickness_m();
    }
};

// Points for VeilSlab::densities().
struct SlabPoints {
    std::vector<float> x, y, z, footprint, density;
    void clear() {
        for (auto* of : {&x, &y, &z, &footprint}) of->clear();
    }
    std::size_t size() const { return x.size(); }
    void add(double px, double py, double pz, double footprint_m) {
        x.push_back(float(px));
        y.push_back(float(py));
        z.push_back(float(pz));
        footprint.push_back(float(footprint_m));
    }
    void evaluate(const VeilSlab& slab, const Vec3& eye_m) {
        if (x.empty()) return;
        const std::size_t lanes = VeilSlab::kPointLanes, padded = (x.size() + lanes - 1) / lanes * lanes;
        for (auto* of : {&x, &y, &z, &footprint}) of->resize(padded, of->back());
        density.resize(padded);
        slab.densities({eye_m, x.data(), y.data(), z.data(), footprint.data(), padded}, density.data());
    }
};

// What a pixel sees of a veil.
struct SeenVeil {
    Rgb light{};  // radiance, weighted by what it covers
    double transmittance = 1, weighted_m = 0;
    double distance_m() const { return transmittance < 1 ? weighted_m / (1 - transmittance) : 0; }
};

struct Ray {
    double x = 0, y = 0, z = 0;
    double height(double t, double bend) const { return t * (z + bend * (1 - z * z) * t); }
};

// Evaluates the samples of several pixels together.
class SampleGroup {
  public:
    SampleGroup(const Sheet& sheet, const Vec3& eye_m, std::vector<SeenVeil>& seen);

    // Takes a part of a pixel's ray; the nearer part of a pixel first. seen[pixel] is complete after flush().
    void add(std::size_t pixel, const Ray& ray, const RayPart& part);
    void flush();

  private:
    // A part of a ray: `count` steps, the last of which may be shorter.
    struct Run {
        std::size_t pixel = 0;
        Ray ray;
        double begin_m = 0, step_m = 0, last_m = 0;
        double part_m = 0;  // what the footprint of a part of a step is taken from
        int count = 0, parts = 1;
        std::size_t first = 0;    // of densities_
        int known = 0, looked = 0, done = 0;  // steps that are asked for, whose density is known, that are composited
        double opaque = 0;        // transmittance behind which nothing is seen
        bool follows = false;     // the run before is of the same pixel
        // Of its light.
        SheetLight often{0, 1, 0};
        double depth = 0, cosine = 1, glow = 0, once = 0, twice = 0, in_halo = 0;
        std::array<double, 3> ring{};
        double length_m(int step) const { return step + 1 < count ? step_m : last_m; }
        bool ended() const { return done == count; }
    };
    // A part of a step.
    struct Part {
        std::size_t run = 0;
        double distance_m = 0, length_m = 0;
        double x = 0, y = 0, z = 0, footprint_m = 0;
        double density = 0;  // below 0: not known yet
    };
    // A part that is seen; its point towards the sun has the same index.
    struct Lit {
        std::size_t run = 0;
        double z = 0, density = 0, covers = 0;
    };

    void prepare_light(Run& run, double column) const;
    bool look_ahead();
    void add_parts();
    Part& add_part(std::size_t run, double distance_m, double length_m, double resolved_m, float density);
    void cover();
    void add_towards_sun(const Part& part);
    void light();
    // Light of a place with a density, and that of its second sample.
    Rgb physical_light(const Run& run, double here, double towards, double z) const;
    Rgb two_sample_light(const Run& run, double here, double towards, double z) const;

    const Sheet& sheet_;
    Vec3 eye_m_;
    std::vector<SeenVeil>& seen_;
    Vec3 towards_sun_;  // for each metre; level enough that it leaves the sheet
    std::vector<Run> runs_;
    std::vector<float> densities_;  // of the steps of all runs
    std::vector<Part> parts_;
    std::vector<Lit> lit_;
    SlabPoints points_, columns_, sun_;
};

}  // namespace nephos
