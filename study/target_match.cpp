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

// Says how far a number is from what is foretold and from the target, in their standard deviations.
struct Distance {
    Transform transform;
    Emulator::Prediction foretold;
    TargetValue target;
    double error = std::sqrt(std::max(0.0, foretold.variance));

    double of_emulator(double z) const { return error > 0 ? (z - foretold.mean) / error : 0; }
    double of_target(double z) const { return (backward(transform, z) - target.value) / target.sd; }
    double operator()(double z) const { return std::hypot(of_emulator(z), of_target(z)); }
    // Returns the statistic's unit in one of the scale.
    double units(double z) const { return 1 / slope(transform, backward(transform, z)); }
};

}  // namespace

TargetMatch match(Transform transform, const Emulator::Prediction& foretold, const TargetValue& target) {
    const Distance distance{transform, foretold, target};
    const double error = distance.error;
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
            const double steep = error * distance.units(place) / target.sd, scale = std::max(1.0, steep);
            const double step =
                -error * (distance.of_emulator(place) / scale + distance.of_target(place) * (steep / scale)) /
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
    const double unit = distance.units(place);
    return {place, least, std::hypot(target.sd, error * unit), unit};
}

double log_likelihood(Transform transform, const Emulator::Prediction& foretold, const TargetValue& target) {
    const Distance distance{transform, foretold, target};
    const TargetMatch found = match(transform, foretold, target);
    // The trapezoidal rule, exact for a normal density, in deviations of that which is closest to the product.
    double sum = 1;
    if (distance.error > 0 && transform != Transform::identity) {
        const double deviation = distance.error * (target.sd / found.sd);
        sum = 0;
        for (int n = -kNodes; n <= kNodes; ++n) {
            const double there = distance(found.place + n * kStep * deviation);
            sum += kStep * std::exp((found.distance - there) * (found.distance + there) / 2);
        }
        sum /= std::sqrt(2 * std::numbers::pi);
    }
    return -found.distance * found.distance / 2 - std::log(found.sd) + std::log(sum);
}

}  // namespace nephos
