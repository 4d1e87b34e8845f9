// SPDX-License-Identifier: Apache-2.0
#pragma once

// Vectors of the cells of an octet, and of their neighbours, for diffusion_cells.cpp and diffusion_solver.cpp. Private to
// the module.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <span>
#include <type_traits>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/cloud/diffusion_cells.h"

namespace nephos {

// Half an octet, the lower or the upper four cells. Every processor has vectors of four: longer ones would gain little,
// as loops over all octets wait for memory, and all instruction sets compute alike.
using Quad = float __attribute__((vector_size(16)));
struct Cells {
    Quad low, high;
};

inline Quad number(float value) { return Quad{value, value, value, value}; }
inline Cells same(float value) { return {number(value), number(value)}; }
inline Cells load(const Octet& from) {
    Cells cells;
    std::memcpy(&cells, from.of.data(), sizeof cells);
    return cells;
}
inline void store(const Cells& cells, Octet& to) { std::memcpy(to.of.data(), &cells, sizeof cells); }
template <class What, class... More>
Cells each(const What& what, const Cells& first, const More&... more) {
    return {what(first.low, more.low...), what(first.high, more.high...)};
}
inline Cells plus(const Cells& a, const Cells& b) { return {a.low + b.low, a.high + b.high}; }
inline Cells minus(const Cells& a, const Cells& b) { return {a.low - b.low, a.high - b.high}; }
inline Cells times(const Cells& a, const Cells& b) { return {a.low * b.low, a.high * b.high}; }
inline Cells times(float a, const Cells& b) { return times(same(a), b); }
// Lanes of `yes` where `test` is above 0, else of `no`.
inline Quad pick(Quad test, Quad yes, Quad no) { return test > 0 ? yes : no; }
inline Cells where_positive(const Cells& test, const Cells& values) {
    const auto lanes = [](Quad t, Quad v) { return pick(t, v, number(0)); };
    return each(lanes, test, values);
}
inline Cells where_not_positive(const Cells& test, const Cells& values) {
    const auto lanes = [](Quad t, Quad v) { return pick(t, number(0), v); };
    return each(lanes, test, values);
}
inline bool any_positive(const Cells& cells) {
    const Quad most = cells.low > cells.high ? cells.low : cells.high;
    return most[0] > 0 || most[1] > 0 || most[2] > 0 || most[3] > 0;
}

// Cells of the upper half along an axis from `upper`, the others from `lower`.
template <int kAxis>
Cells halves(const Cells& upper, const Cells& lower) {
    if constexpr (kAxis == 0)
        return {__builtin_shufflevector(lower.low, upper.low, 0, 5, 2, 7),
                __builtin_shufflevector(lower.high, upper.high, 0, 5, 2, 7)};
    else if constexpr (kAxis == 1)
        return {__builtin_shufflevector(lower.low, upper.low, 0, 1, 6, 7),
                __builtin_shufflevector(lower.high, upper.high, 0, 1, 6, 7)};
    else
        return {lower.low, upper.high};
}
// The inner neighbours.
template <int kAxis>
Cells exchanged(const Cells& cells) {
    if constexpr (kAxis == 0)
        return {__builtin_shufflevector(cells.low, cells.low, 1, 0, 3, 2),
                __builtin_shufflevector(cells.high, cells.high, 1, 0, 3, 2)};
    else if constexpr (kAxis == 1)
        return {__builtin_shufflevector(cells.low, cells.low, 2, 3, 0, 1),
                __builtin_shufflevector(cells.high, cells.high, 2, 3, 0, 1)};
    else
        return {cells.high, cells.low};
}

// The outer neighbours: of the upper cells in the octet above, of the lower ones in that below.
template <int kAxis, class Load>
Cells outer(const std::array<std::int32_t, 6>& beside, const Load& of_octet) {
    return exchanged<kAxis>(halves<kAxis>(of_octet(std::size_t(beside[2 * kAxis])),
                                          of_octet(std::size_t(beside[2 * kAxis + 1]))));
}

// Calls what(axis) for the three axes.
template <class What>
void for_axes(const What& what) {
    what(std::integral_constant<int, 0>());
    what(std::integral_constant<int, 1>());
    what(std::integral_constant<int, 2>());
}

// Calls what(axis, cells that are inner neighbours, those that are outer ones) for the three axes.
template <class Load, class What>
void for_neighbours(const DiffusionCells& cells, std::size_t octet, const Load& of_octet, const What& what) {
    const auto& beside = cells.beside[octet];
    const Cells own = of_octet(octet);
    for_axes([&](auto axis) {
        constexpr int kAxis = decltype(axis)::value;
        what(axis, exchanged<kAxis>(own), outer<kAxis>(beside, of_octet));
    });
}

// Flux through a face beyond which there is no cloud, per fluence in the middle of its cell: Marshak's condition.
inline Quad loss(Quad thickness) {
    return 1 / (2 + 1.5f * thickness);
}

// Numbers of some octets.
using Octets = std::span<const std::int32_t>;

inline std::vector<std::int32_t> first_octets(std::size_t count) {
    std::vector<std::int32_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 0);
    return numbers;
}

inline constexpr std::size_t kOctetsOfPart = 256;  // that one thread works on, whose products are added up first

// Calls what(number of the part, its octets) for all parts, in parallel.
template <class What>
void for_parts(Octets octets, const What& what) {
    tbb::parallel_for(std::size_t{0}, (octets.size() + kOctetsOfPart - 1) / kOctetsOfPart, [&](std::size_t part) {
        what(part, octets.subspan(part * kOctetsOfPart, std::min(kOctetsOfPart, octets.size() - part * kOctetsOfPart)));
    });
}

}  // namespace nephos
