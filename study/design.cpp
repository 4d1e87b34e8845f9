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
constexpr std::uint32_t kRandomPoints = 1, kStrata = 2, kOrder = 3;

double uniform(std::uint64_t seed, std::uint32_t group, std::uint32_t point, std::uint32_t dimension) {
    const PhiloxWords words = philox(seed, item_counter(Domain::sweep, group, point, dimension, 0));
    const std::uint64_t bits = std::uint64_t(words[0]) << 32 | words[1];
    return double(bits >> 11) * 0x1p-53;
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

std::vector<double> unit_points(Design design, std::uint64_t count, std::size_t dimensions,
                                std::uint64_t seed) {
    std::vector<double> points(count * dimensions);
    if (dimensions == 0) return points;
    if (design == Design::sobol) {
        constexpr std::size_t kMostDimensions = 3667;
        if (dimensions > kMostDimensions)
            throw Error(ErrorCode::usage, "a Sobol design has at most 3,667 axes");
        boost::random::sobol engine(dimensions);
        // Boost leaves the corner 0 out: the first point is 0.5 everywhere.
        for (double& value : points) value = double(engine()) / (double(boost::random::sobol::max()) + 1);
        return points;
    }
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
