// SPDX-License-Identifier: Apache-2.0
#include "simulation/verify_motion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include <fmt/format.h>

namespace nephos {
namespace {

// Sums and maxima in so many lanes that the compiler makes vectors of them, as their order is fixed.
constexpr std::size_t kLanes = 16;

// The sum of the differences between neighbours along x.
double sum_of_gradients(const std::vector<float>& values, std::size_t nx) {
    double total = 0;
    for (std::size_t row = 0; row < values.size(); row += nx) {
        const float* v = values.data() + row;
        float lanes[kLanes] = {};
        std::size_t n = 0;
        for (; n + kLanes < nx; n += kLanes)
            for (std::size_t lane = 0; lane < kLanes; ++lane)
                lanes[lane] += std::abs(v[n + lane + 1] - v[n + lane]);
        for (; n + 1 < nx; ++n) lanes[0] += std::abs(v[n + 1] - v[n]);
        for (const float lane : lanes) total += double(lane);
    }
    return total;
}

float largest_change(const std::vector<float>& before, const std::vector<float>& now) {
    float lanes[kLanes] = {};
    std::size_t n = 0;
    for (; n + kLanes <= now.size(); n += kLanes) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const float change = std::abs(now[n + lane] - before[n + lane]);
            lanes[lane] = lanes[lane] < change ? change : lanes[lane];
        }
    }
    for (; n < now.size(); ++n) lanes[0] = std::max(lanes[0], std::abs(now[n] - before[n]));
    return *std::ranges::max_element(lanes);
}

}  // namespace

void SequenceMotion::add(const DensityGrid& grid) {
    std::vector<float> now = grid.to_dense();
    const double gradients = sum_of_gradients(now, std::size_t(grid.extent().x));
    if (before_.size() == now.size()) {
        change_ = std::max(change_, double(largest_change(before_, now)));
        if (sharpness_ > 0)
            sharpness_change_ = std::max(sharpness_change_, std::abs(gradients / sharpness_ - 1));
    }
    sharpness_ = gradients;
    before_ = std::move(now);
}

Check SequenceMotion::check(const std::optional<double>& most) const {
    const bool good = !most || change_ <= *most;
    std::string text =
        fmt::format("largest change of a voxel {:.3g}, of the sum of gradients {:.2g} %, from frame to frame",
                    change_, 100 * sharpness_change_);
    if (!good) text += fmt::format("; at most {:g} is allowed", *most);
    return {"motion", good, text, {{"largest_change", change_}, {"sharpness_change", sharpness_change_}}};
}

}  // namespace nephos
