// SPDX-License-Identifier: Apache-2.0
#include "study/design.h"

#include <array>
#include <numeric>

#include <boost/random/sobol.hpp>

#include "core/error.h"
#include "core/random.h"

namespace nephos {
namespace {

// Groups of counters within Domain::sweep; group 0 belongs to the seeds of runs.
constexpr std::uint32_t kRandomPoints = 1, kStrata = 2, kOrder = 3, kShift = 4;

// The upper 53 bits as a number, 0 <= x < 1.
double unit_number(std::uint64_t bits) { return double(bits >> 11) * 0x1p-53; }

std::uint64_t random_bits(std::uint64_t seed, std::uint32_t group, std::uint32_t point,
                          std::uint32_t dimension) {
    const PhiloxWords words = philox(seed, item_counter(Domain::sweep, group, point, dimension, 0));
    return std::uint64_t(words[0]) << 32 | words[1];
}

double uniform(std::uint64_t seed, std::uint32_t group, std::uint32_t point, std::uint32_t dimension) {
    return unit_number(random_bits(seed, group, point, dimension));
}

// The order of strata along an axis: Fisher and Yates.
std::vector<std::uint32_t> shuffled(std::uint64_t seed, std::uint32_t count, std::uint32_t dimension) {
    std::vector<std::uint32_t> order(count);
    std::iota(order.begin(), order.end(), 0u);
    for (std::uint32_t n = count; n > 1; --n)
        std::swap(order[n - 1], order[std::uint32_t(uniform(seed, kOrder, n, dimension) * n)]);
    return order;
}

}  // namespace

std::string_view design_name(Design design) {
    constexpr std::array<std::string_view, 5> kNames{"grid", "list", "random", "latin_hypercube", "sobol"};
    return kNames.at(std::size_t(design));
}

std::vector<double> sobol_points(std::uint64_t first, std::uint64_t count, std::size_t dimensions,
                                 std::uint64_t seed) {
    constexpr std::size_t kMostDimensions = 3667;
    if (dimensions > kMostDimensions) throw Error(ErrorCode::usage, "a Sobol design has at most 3,667 axes");
    std::vector<double> points(count * dimensions);
    if (points.empty()) return points;
    // The same bits of all points of a dimension are turned over: that moves the points, and keeps how even they are.
    std::vector<std::uint64_t> shift;
    for (std::size_t d = 0; d < dimensions; ++d)
        shift.push_back(random_bits(seed, kShift, 0, std::uint32_t(d)));
    boost::random::sobol engine(dimensions);
    engine.discard(first * dimensions);
    for (std::size_t n = 0; n < points.size(); ++n) points[n] = unit_number(engine() ^ shift[n % dimensions]);
    return points;
}

std::vector<double> unit_points(Design design, std::uint64_t count, std::size_t dimensions,
                                std::uint64_t seed) {
    if (design == Design::sobol) return sobol_points(0, count, dimensions, seed);
    std::vector<double> points(count * dimensions);
    for (std::size_t d = 0; d < dimensions; ++d) {
        std::vector<std::uint32_t> order;
        if (design == Design::latin_hypercube) order = shuffled(seed, std::uint32_t(count), std::uint32_t(d));
        for (std::uint64_t n = 0; n < count; ++n) {
            double& value = points[n * dimensions + d];
            if (design == Design::latin_hypercube) {
                value =
                    (order[n] + uniform(seed, kStrata, std::uint32_t(n), std::uint32_t(d))) / double(count);
            } else {
                value = uniform(seed, kRandomPoints, std::uint32_t(n), std::uint32_t(d));
            }
        }
    }
    return points;
}

}  // namespace nephos
