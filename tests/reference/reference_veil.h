// SPDX-License-Identifier: Apache-2.0
#pragma once

// The naive twin of density/veil.h: one voxel at a time, double precision, written down from the header's
// formulas. It takes the two thresholds of q as given, and finds them by a sum of its own when asked.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "density/veil.h"
#include "tests/reference/reference_noise.h"

namespace nephos::test {

class ReferenceVeil {
  public:
    ReferenceVeil(const VeilOptions& options, const Velocity& wind, double time_s)
        : o_(options), octaves_(veil_octaves(options)), time_s_(time_s) {
        const double angle = o_.direction_deg * std::numbers::pi / 180;
        cos_ = std::cos(angle);
        sin_ = std::sin(angle);
        east_ = wind.east_m_per_s * time_s;
        north_ = wind.north_m_per_s * time_s;
        for (std::size_t k = 0; k < octaves_.size(); ++k) {
            const std::uint32_t high = std::uint32_t(o_.seed >> 32) + std::uint32_t(k) * kStep;
            seeds_.push_back(reference_mix(std::uint32_t(o_.seed) + reference_mix(high)));
        }
    }

    // q at a point of the noise's frame.
    double sum(double along, double across, double up) const {
        const bool ridged = o_.form == VeilForm::cumulus || o_.form == VeilForm::cirrus;
        const bool displaced = o_.form == VeilForm::cirrus || o_.form == VeilForm::cirrostratus;
        double q = 0, before = 0;
        for (std::size_t k = 0; k < octaves_.size(); ++k) {
            const VeilOctave& octave = octaves_[k];
            if (displaced && k > 0) {
                along += before * octave.displacement_m.x;
                across += before * octave.displacement_m.y;
                up += before * octave.displacement_m.z;
            }
            const Vec3 &v = octave.velocity_m_per_s, &a = octave.wavelength_m;
            const std::uint32_t x = reference_mix(seeds_[k] + kStep), y = reference_mix(x + kStep);
            const std::uint32_t z = reference_mix(y + kStep);
            const auto place = [](std::uint32_t seed) { return reference_mix(seed + 1) / 65536.0; };
            const double own_x = place(x) - v.x * time_s_ / a.x, own_y = place(y) - v.y * time_s_ / a.y,
                         at_z = (up - v.z * time_s_) / a.z + place(z);
            const double n = o_.period_m.x > 0
                                 ? repeating_noise(along, across, own_x, own_y, at_z, a, seeds_[k])
                                 : reference_noise(along / a.x + own_x, across / a.y + own_y, at_z, seeds_[k]);
            const double value = n * octave.gain + octave.offset;
            before = ridged ? octave.ridge - std::abs(octave.crest - value) : value;
            q += octave.weight * before;
        }
        return q;
    }

    // q and the weight of profile and margin at a world point; `inside_m` to the nearest sides.
    double sum_at(const Vec3& world) const {
        const double east = world.x - east_, north = world.y - north_;
        const double fallen = std::max(0.0, (o_.top_m - world.z) / (o_.top_m - o_.base_m));
        return sum(east * cos_ + north * sin_ + o_.fallstreak_m * fallen * fallen, north * cos_ - east * sin_,
                   world.z - o_.base_m);
    }
    double weight_at(double z, double inside_x_m, double inside_y_m) const {
        return fade(z - o_.base_m, o_.soft_base_m) * fade(o_.top_m - z, o_.soft_top_m) *
               fade(inside_x_m, o_.margin_m) * fade(inside_y_m, o_.margin_m);
    }
    double density(double q, double low, double high, double weight) const {
        const double t = std::clamp((q - low) / (high - low), 0.0, 1.0);
        return (o_.sheet + (1 - o_.sheet) * (3 * t * t - 2 * t * t * t)) * weight;
    }

  private:
    static constexpr std::uint32_t kStep = 0x9e3779b1U;

    static double fade(double from_end, double width) {
        if (from_end <= 0) return 0;
        if (width <= 0) return 1;
        const double t = std::min(1.0, from_end / width);
        return 3 * t * t - 2 * t * t * t;
    }

    // N on a lattice of which both edges of the period are whole vectors. All lattice points that differ by sums of these
    // have the gradient of one of them: that of the least j >= 0, and among those of the least i >= 0, found by trial.
    double repeating_noise(double along, double across, double own_x, double own_y, double at_z, const Vec3& a,
                           std::uint32_t seed) const {
        const double px = o_.period_m.x, py = o_.period_m.y;
        const std::array e1{std::llround(px * cos_ / a.x), std::llround(-px * sin_ / a.y)},
            e2{std::llround(py * sin_ / a.x), std::llround(py * cos_ / a.y)};
        const double east = along * cos_ - across * sin_, north = along * sin_ + across * cos_;
        const double u = east / px * double(e1[0]) + north / py * double(e2[0]) + own_x,
                     v = east / px * double(e1[1]) + north / py * double(e2[1]) + own_y;
        constexpr std::int64_t kTrials = 60;
        return reference_noise_of(u, v, at_z, seed, [&](std::int64_t i, std::int64_t j, std::int64_t k) {
            std::array<std::int64_t, 3> best{1 << 30, 1 << 30, k};
            // Near the sums that take the point to the origin.
            const double det = double(e1[0] * e2[1] - e1[1] * e2[0]);
            const auto m0 = std::int64_t(-double(i * e2[1] - j * e2[0]) / det), n0 = std::int64_t(-double(j * e1[0] - i * e1[1]) / det);
            for (std::int64_t m = m0 - kTrials; m <= m0 + kTrials; ++m) {
                for (std::int64_t n = n0 - kTrials; n <= n0 + kTrials; ++n) {
                    const std::int64_t x = i + m * e1[0] + n * e2[0], y = j + m * e1[1] + n * e2[1];
                    if (x < 0 || y < 0 || y > best[1] || (y == best[1] && x >= best[0])) continue;
                    best = {x, y, k};
                }
            }
            return best;
        });
    }

    VeilOptions o_;
    std::vector<VeilOctave> octaves_;
    std::vector<std::uint32_t> seeds_;
    double time_s_ = 0, cos_ = 1, sin_ = 0, east_ = 0, north_ = 0;
};

}  // namespace nephos::test
