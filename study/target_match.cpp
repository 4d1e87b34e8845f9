// SPDX-License-Identifier: Apache-2.0
#include "study/target_match.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nephos {
namespace {

constexpr int kCells = 16;  // at whose ends the least value is looked for first: there may be two hollows
constexpr int kMostSteps = 60;
constexpr double kShortest = 1e-3;  // share of a step that is still tried
constexpr double kExact = 1e-13;    // of the distance
constexpr double kStep = 0.5;
constexpr int kNodes = 14;  // on each side: to seven deviations

}  // namespace

TargetMatch match(Transform transform, const Emulator::Prediction& foretold, const TargetValue& target) {
    const double error = std::sqrt(std::max(0.0, foretold.variance));
    const auto of_emulator = [&](double z) { return error > 0 ? (z - foretold.mean) / error : 0; };
    const auto of_target = [&](double z) { return (backward(transform, z) - target.value) / target.sd; };
    const auto distance = [&](double z) { return std::hypot(of_emulator(z), of_target(z)); };
    // The statistic's unit in one of the scale.
    const auto units = [&](double z) { return 1 / slope(transform, backward(transform, z)); };
    double place = foretold.mean, least = distance(place);
    if (error > 0) {
        // It lies between the two, for both terms grow beyond them.
        const double end = forward(transform, target.value);
        for (int n = 1; n <= kCells; ++n) {
            const double z = foretold.mean + (end - foretold.mean) * n / kCells, there = distance(z);
            if (there < least) {
                place = z;
                least = there;
            }
        }
        // Gauss and Newton's steps, shorter ones where they do not help. Where the scale is linear the first is the last.
        double share = 1;
        for (int n = 0; n < kMostSteps && share > kShortest; ++n) {
            const double steep = error * units(place) / target.sd, scale = std::max(1.0, steep);
            const double step = -error * (of_emulator(place) / scale + of_target(place) * (steep / scale)) /
                                (1 / scale + steep * (steep / scale));
            const double z = place + share * step, there = distance(z);
            if (!(there < least)) {
                share /= 2;
                continue;
            }
            const bool is_exact = least - there <= kExact * least;
            place = z;
            least = there;
            share = 1;
            if (is_exact) break;
        }
    }
    const double unit = units(place), sd = std::hypot(target.sd, error * unit);
    // The trapezoidal rule, exact for a normal density, in deviations of that which is closest to the product.
    double sum = 1;
    if (error > 0 && transform != Transform::identity) {
        const double deviation = error * (target.sd / sd);
        sum = 0;
        for (int n = -kNodes; n <= kNodes; ++n) {
            const double there = distance(place + n * kStep * deviation);
            sum += kStep * std::exp((least - there) * (least + there) / 2);
        }
        sum /= std::sqrt(2 * std::numbers::pi);
    }
    return {least, -least * least / 2 - std::log(sd) + std::log(sum), sd / unit};
}

}  // namespace nephos
