// SPDX-License-Identifier: Apache-2.0
#include "simulation/motion.h"

#include <algorithm>

#include "core/wind_field.h"
#include "density/smoothing.h"

namespace nephos {
namespace {

constexpr double kCell = 0x1p32;  // fixed-point units in a cell
constexpr std::int64_t kFraction = 0xffffffff;

// The way of the air above one layer after each of the steps first .. last, and the place of the bits then, both relative
// to the air after the last. Differences of them are the same whatever the last step is: take those before anything is
// rounded, or density would depend on how far the automaton is.
struct Track {
    std::vector<std::int64_t> air, bits;

    // `rest`: how far the air is beyond the bits after the last step; step(n): displacement in the step after n.
    template <typename Step>
    Track(std::uint64_t first, std::uint64_t last, std::int64_t rest, const Step& step)
        : air(std::size_t(last - first) + 1), bits(air.size()) {
        bits.back() = -rest;
        for (std::size_t n = air.size() - 1; n-- > 0;) {
            air[n] = air[n + 1] - step(first + n);
            rest = (rest - step(first + n)) & kFraction;
            bits[n] = air[n] - rest;
        }
    }
};

}  // namespace

std::vector<Vec2> displacement_of_density(const Automaton& automaton, const SmoothingOptions& smoothing,
                                          std::uint64_t of, const Moment& to) {
    const int layers = automaton.options().extent.z;
    std::vector<Vec2> displacements(std::size_t(layers), Vec2(0));
    const Wind& wind = automaton.options().wind;
    if (is_calm(wind) || !is_profile(wind.fields)) return displacements;
    const std::vector<std::uint32_t> weights = kernel_weights(smoothing.kernel, smoothing.t0);
    const auto reach = std::uint64_t(smoothing.t0);
    const std::uint64_t window = of > reach ? of - reach : 0, first = std::min(window, to.step),
                        last = automaton.steps();
    for (int k = 0; k < layers; ++k) {
        for (int axis = 0; axis < 2; ++axis) {
            const auto step = [&](std::uint64_t n) {
                const Displacement moved = automaton.displacement_of_layer(k, n);
                return axis == 0 ? moved.x : moved.y;
            };
            const Displacement& rest = automaton.beyond_whole_cells()[std::size_t(k)];
            const Track track(first, last, axis == 0 ? rest.x : rest.y, step);
            double place = 0, weight = 0;
            for (std::uint64_t at = window; at <= of + reach; ++at) {
                const double own = double(weights[std::size_t(at + reach - of)]);
                place += own * double(track.bits[std::size_t(at - first)] -
                                      track.air[std::size_t(to.step - first)]);
                weight += own;
            }
            displacements[std::size_t(k)][axis] =
                (to.fraction * double(step(to.step)) - place / weight) / kCell;
        }
    }
    return displacements;
}

}  // namespace nephos
