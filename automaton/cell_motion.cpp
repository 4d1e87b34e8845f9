// SPDX-License-Identifier: Apache-2.0
#include "automaton/cell_motion.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr int kFractionBits = 11;
constexpr std::int32_t kCell = 1 << kFractionBits, kHalf = kCell / 2;
constexpr int kReach = 14;  // cells; with a cell more, an offset still fits 16 bits
constexpr std::uint32_t kFree = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kNoCell = std::numeric_limits<std::size_t>::max();

int size_of(const Extent& e, int axis) { return axis == 0 ? e.x : axis == 1 ? e.y : e.z; }

Boundary side_of(const Boundaries& b, int axis) { return axis == 0 ? b.x : axis == 1 ? b.y : b.z; }

// Steps from a cell to those around it, by rising distance.
struct Around {
    std::array<int, 3> step;
    int square;
};

const std::vector<Around>& steps_around() {
    static const std::vector<Around> steps = [] {
        std::vector<Around> all;
        for (int z = -kReach; z <= kReach; ++z)
            for (int y = -kReach; y <= kReach; ++y)
                for (int x = -kReach; x <= kReach; ++x)
                    if (const int square = x * x + y * y + z * z; square > 0 && square <= kReach * kReach)
                        all.push_back({{x, y, z}, square});
        std::ranges::stable_sort(all, {}, &Around::square);
        return all;
    }();
    return steps;
}

// Takes a coordinate into a periodic axis; false when it lies outside of an open one.
bool fold(std::int64_t& at, std::int64_t size, Boundary boundary) {
    if (at >= 0 && at < size) return true;
    at = (at % size + size) % size;
    return boundary == Boundary::periodic;
}

// Squared distance from a position to the centre of a cell, without wrapping.
std::int64_t square_to(const std::array<std::int32_t, 3>& at, const std::array<std::int64_t, 3>& cell) {
    std::int64_t sum = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t d = at[axis] - (cell[axis] * kCell + kHalf);
        sum += d * d;
    }
    return sum;
}

std::array<std::int64_t, 3> cell_of(const std::array<std::int32_t, 3>& at) {
    return {at[0] >> kFractionBits, at[1] >> kFractionBits, at[2] >> kFractionBits};
}

}  // namespace

CellMotion::CellMotion(const Extent& extent) : extent_(extent), offsets_(extent.cells(), Offset{}) {}

std::size_t CellMotion::memory_bytes(const Extent& extent) {
    return extent.cells() * (sizeof(Offset) + sizeof(std::uint32_t) + 2 * sizeof(Moving));
}

std::vector<CellMotion::Moving> CellMotion::moved(const Lattice& lattice, const AutomatonOptions& options,
                                                  double time_s, int layer) const {
    const double cell_m = options.placement.cell_size_m;
    const BitPlaneView hum = lattice.hum.view(), act = lattice.act.view(), cld = lattice.cld.view();
    std::vector<Moving> result;
    for (int j = 0; j < extent_.y; ++j) {
        const std::uint64_t *h = hum.row(j, layer), *a = act.row(j, layer), *c = cld.row(j, layer);
        for (std::size_t w = 0; w < hum.words_per_row; ++w) {
            for (std::uint64_t any = h[w] | a[w] | c[w]; any != 0; any &= any - 1) {
                const int bit = std::countr_zero(any), i = int(w) * 64 + bit;
                const Offset& offset = offsets_[linear_index(extent_, i, j, layer)];
                const std::array<int, 3> cell{i, j, layer};
                std::array<std::int64_t, 3> at{};
                Vec3 place{};
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    at[axis] = std::int64_t{cell[axis]} * kCell + kHalf + offset[axis];
                    // Held in a cell beyond a seam, it feels the wind of where it is.
                    fold(at[axis], std::int64_t{size_of(extent_, int(axis))} * kCell,
                         side_of(options.boundaries, int(axis)));
                    place[int(axis)] = options.placement.origin_m[int(axis)] + double(at[axis]) / kCell * cell_m;
                }
                const Vec3 cells = mean_wind(options.wind, place, time_s, options.time_step_s) *
                                   (options.time_step_s / cell_m);
                bool inside = true;
                for (int axis = 0; axis < 3; ++axis) {
                    if (!(std::abs(cells[axis]) <= kMaxExtent)) {
                        throw Error(ErrorCode::usage,
                                    "the wind of `wind_field` moves cells by " + number_text(cells[axis], 6) +
                                        " cells in one step: expected at most " + std::to_string(kMaxExtent) +
                                        ", by less wind, a shorter `time.step_s` or larger cells");
                    }
                    std::int64_t& to = at[std::size_t(axis)];
                    to += std::llround(cells[axis] * kCell);
                    inside = fold(to, std::int64_t{size_of(extent_, axis)} * kCell,
                                  side_of(options.boundaries, axis)) &&
                             inside;
                }
                if (!inside) continue;
                const std::uint8_t bits = std::uint8_t((h[w] >> bit & 1) | (a[w] >> bit & 1) << 1 | (c[w] >> bit & 1) << 2);
                result.push_back({{std::int32_t(at[0]), std::int32_t(at[1]), std::int32_t(at[2])}, bits});
            }
        }
    }
    return result;
}

// Returns the nearest free cell around the one that a content would have; kNoCell when there is none in reach.
std::size_t CellMotion::free_cell(const Moving& content, const std::vector<std::uint32_t>& holders,
                                  const Boundaries& boundaries) const {
    const std::array<std::int64_t, 3> home = cell_of(content.at);
    std::size_t best = kNoCell;
    std::int64_t best_square = std::numeric_limits<std::int64_t>::max();
    int ring = 0;
    for (const Around& around : steps_around()) {
        // No cell of this ring, seen from anywhere within the home cell, is nearer than the best one.
        if (best != kNoCell && around.square > ring) {
            const double nearest = std::sqrt(double(around.square)) - 0.8660254037844387;
            if (nearest > 0 && nearest * nearest * kCell * kCell > double(best_square)) break;
        }
        ring = around.square;
        std::array<std::int64_t, 3> cell{}, folded{};
        bool inside = true;
        for (std::size_t axis = 0; axis < 3 && inside; ++axis) {
            cell[axis] = folded[axis] = home[axis] + around.step[axis];
            inside = fold(folded[axis], size_of(extent_, int(axis)), side_of(boundaries, int(axis)));
        }
        if (!inside) continue;
        const std::size_t index = linear_index(extent_, int(folded[0]), int(folded[1]), int(folded[2]));
        if (holders[index] != kFree) continue;
        const std::int64_t square = square_to(content.at, cell);
        if (square >= best_square) continue;
        best = index;
        best_square = square;
    }
    return best;
}

void CellMotion::step(Lattice& lattice, const AutomatonOptions& options, double time_s) {
    std::vector<std::vector<Moving>> layers(std::size_t(extent_.z));
    tbb::parallel_for(0, extent_.z, [&](int k) { layers[std::size_t(k)] = moved(lattice, options, time_s, k); });
    std::vector<Moving> contents;
    std::size_t count = 0;
    for (const auto& layer : layers) count += layer.size();
    contents.reserve(count);
    for (auto& layer : layers) {
        contents.insert(contents.end(), layer.begin(), layer.end());
        layer = {};
    }

    std::vector<std::uint32_t> holders(extent_.cells(), kFree), others;
    for (std::uint32_t n = 0; n < contents.size(); ++n) {
        const std::array<std::int64_t, 3> cell = cell_of(contents[n].at);
        std::uint32_t& holder = holders[linear_index(extent_, int(cell[0]), int(cell[1]), int(cell[2]))];
        if (holder == kFree) {
            holder = n;
        } else if (square_to(contents[n].at, cell) < square_to(contents[holder].at, cell)) {
            others.push_back(holder);
            holder = n;
        } else {
            others.push_back(n);
        }
    }
    std::ranges::sort(others);
    for (const std::uint32_t n : others) {
        const std::size_t cell = free_cell(contents[n], holders, options.boundaries);
        if (cell == kNoCell) {
            ++crowded_out_;
        } else {
            holders[cell] = n;
        }
    }

    for (BitPlane* plane : {&lattice.hum, &lattice.act, &lattice.cld}) plane->clear();
    tbb::parallel_for(0, extent_.z, [&](int k) {
        for (int j = 0; j < extent_.y; ++j) {
            std::uint64_t* const rows[3] = {lattice.hum.row(j, k), lattice.act.row(j, k), lattice.cld.row(j, k)};
            for (int i = 0; i < extent_.x; ++i) {
                const std::size_t index = linear_index(extent_, i, j, k);
                offsets_[index] = {};
                if (holders[index] == kFree) continue;
                const Moving& content = contents[holders[index]];
                const std::array<int, 3> cell{i, j, k};
                for (std::size_t axis = 0; axis < 3; ++axis) {
                    const std::int64_t size = std::int64_t{size_of(extent_, int(axis))} * kCell;
                    std::int64_t offset = content.at[axis] - (std::int64_t{cell[axis]} * kCell + kHalf);
                    if (side_of(options.boundaries, int(axis)) == Boundary::periodic) {  // it may have gone around
                        if (offset > size / 2) offset -= size;
                        if (offset < -size / 2) offset += size;
                    }
                    offsets_[index][axis] = std::int16_t(offset);
                }
                for (int plane = 0; plane < 3; ++plane)
                    rows[plane][i / 64] |= std::uint64_t{content.bits >> plane & 1u} << (i % 64);
            }
        }
    });
}

void CellMotion::save(ByteWriter& out) const {
    out.put(crowded_out_);
    out.put_bytes(std::as_bytes(std::span(offsets_)));
}

void CellMotion::restore(ByteReader& in) {
    const auto crowded_out = in.get<std::uint64_t>();
    std::vector<Offset> offsets(offsets_.size());
    in.get_bytes(std::as_writable_bytes(std::span(offsets)));
    crowded_out_ = crowded_out;
    offsets_ = std::move(offsets);
}

}  // namespace nephos
