// SPDX-License-Identifier: Apache-2.0
#pragma once

// A veil (veil.h) as a function of place, for pictures that cut each pixel's ray with it instead of drawing its
// lattice: the same sum of octaves, with finer ones after them, down to what a pixel resolves.
//
// An octave that is finer than the footprint of a sample fades into its mean. The sum then varies less, and a threshold
// of it would cover another fraction of the sky; so the step between the thresholds is widened by what was left out:
// smoothstep() is close to the integral of a bell of variance (high - low)^2 / 20, to which the variance of the omitted
// octaves is added. The mean density is thus that of finer samples.

#include <cstddef>
#include <memory>
#include <optional>

#include "core/vec.h"
#include "core/wind.h"
#include "density/veil.h"

namespace nephos {

struct VeilPlan;

// The rectangle outside of which there is no veil.
struct VeilSides {
    Vec2 low_m{0, 0}, high_m{0, 0};  // world; low below high
    double margin_m = 0;             // over which the density fades towards the sides
};

class VeilSlab {
  public:
    static constexpr int kMostFinerOctaves = 12;

    // `finer_octaves`: how many octaves follow those of the options, each finer than the one before by `lacunarity`, with
    // `persistence` of its weight, or as the last two octaves of a list go on, in each direction: so those of fibres of one
    // length are threads. 0..kMostFinerOctaves. In a tile those are left out whose lattices would have more than
    // kMostVeilCells cells in it (veil_lattice.h). Without `sides` the veil has no end. Throws Error(usage) when
    // finer_octaves is out of range, time_s is not finite or above 1e9.
    VeilSlab(const VeilOptions& options, const Wind& wind, double time_s, int finer_octaves,
             const std::optional<VeilSides>& sides);
    ~VeilSlab();

    double base_m() const { return options_.base_m; }  // world z
    double top_m() const { return options_.top_m; }
    // Returns the shortest wavelength of all octaves, metres.
    double finest_m() const { return finest_m_; }

    // Points of the world as offsets from one of them, metres. Heights are those above the plane in which the slab is
    // level: over a round Earth the caller adds the curvature.
    struct Points {
        Vec3 base_m{};
        const float *x = nullptr, *y = nullptr, *z = nullptr;
        const float* footprint_m = nullptr;  // size of what a sample stands for, >= 0
        std::size_t count = 0;               // a multiple of kPointLanes
    };
    static constexpr std::size_t kPointLanes = 64;

    // Computes the densities of points, 0..1. Thread-safe; the same bits on every machine.
    void densities(const Points& points, float* out) const;

  private:
    VeilOptions options_;
    std::optional<VeilSides> sides_;
    std::unique_ptr<const VeilPlan> plan_;
    Vec3 carried_m_{};  // by the wind at the veil's top
    double finest_m_ = 0;
};

}  // namespace nephos
