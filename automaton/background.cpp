// SPDX-License-Identifier: Apache-2.0
#include "automaton/background.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "core/error.h"

namespace nephos {
namespace {

int blocks(int cells) { return (cells + kBlockEdge - 1) / kBlockEdge; }

Probabilities mix(const Probabilities& a, const Probabilities& b, double fraction) {
    return {a.hum + (b.hum - a.hum) * fraction, a.act + (b.act - a.act) * fraction,
            a.ext + (b.ext - a.ext) * fraction};
}

// Linear between items whose `key` rises; constant beyond the first and the last.
template <typename Item, typename Key, typename Value>
Probabilities between(const std::vector<Item>& items, Key Item::*key, double at, const Value& value) {
    const auto after = std::ranges::find_if(items, [&](const Item& item) { return item.*key >= at; });
    if (after == items.begin()) return value(items.front());
    if (after == items.end()) return value(items.back());
    const Item& before = *(after - 1);
    return mix(value(before), value(*after), (at - before.*key) / (*after.*key - before.*key));
}

std::array<float, 3> as_floats(const Probabilities& p) { return {float(p.hum), float(p.act), float(p.ext)}; }

// The height of a layer's centres; a layer beyond the lattice, in its last block, is taken for the topmost.
double height_of(const AutomatonOptions& o, int layer) {
    return o.placement.origin_m.z + (std::min(layer, o.extent.z - 1) + 0.5) * o.placement.cell_size_m;
}

}  // namespace

Probabilities background_at(const std::vector<BackgroundKeyframe>& profile, double height_m, double time_s) {
    return between(profile, &BackgroundKeyframe::time_s, time_s, [&](const BackgroundKeyframe& key) {
        return between(key.levels, &BackgroundLevel::height_m, height_m,
                       [](const BackgroundLevel& level) { return level.background; });
    });
}

void Background::Table::set_bounds() {
    low.resize(values.size() / kCells);
    high.resize(low.size());
    for (std::size_t n = 0; n < low.size(); ++n) {
        const auto first = values.begin() + std::ptrdiff_t(n * kCells);
        const auto [least, most] = std::minmax_element(first, first + std::ptrdiff_t(kCells));
        low[n] = *least;
        high[n] = *most;
    }
}

void Background::Table::add_to(BlockBackground& block, std::size_t draw, std::size_t number) const {
    block.low[draw] = low[number];
    block.high[draw] = high[number];
    block.values[draw] = low[number] == high[number] ? nullptr : &values[number * kCells];
}

std::size_t Background::memory_bytes(const AutomatonOptions& o) {
    const std::size_t slabs = std::size_t(blocks(o.extent.z)),
                      all = slabs * std::size_t(blocks(o.extent.x)) * std::size_t(blocks(o.extent.y));
    return (o.field.profile.empty() ? 0 : 3 * slabs * kCells * sizeof(float)) +
           o.field.grids.size() * all * kCells * sizeof(float);
}

Background::Background(const AutomatonOptions& o)
    : varies_(!o.field.profile.empty() || !o.field.grids.empty()),
      by_height_(!o.field.profile.empty()),
      blocks_x_(blocks(o.extent.x)),
      blocks_y_(blocks(o.extent.y)),
      blocks_z_(blocks(o.extent.z)),
      uniform_(as_floats(o.field.background)),
      high_(uniform_) {
    for (const ProbabilityGrid& grid : o.field.grids) fill_grid(o, grid);
    set_time(o, 0);
}

void Background::fill_grid(const AutomatonOptions& o, const ProbabilityGrid& grid) {
    if (!grid.samples) throw Error(ErrorCode::usage, "field.grids: the file of a grid has not been read");
    Table& table = grids_[std::size_t(grid.of)];
    table.values.resize(std::size_t(blocks_x_) * std::size_t(blocks_y_) * std::size_t(blocks_z_) * kCells);
    tbb::parallel_for(0, blocks_z_ * blocks_y_, [&](int row) {
        float* to = &table.values[std::size_t(row) * std::size_t(blocks_x_) * kCells];
        for (int bx = 0; bx < blocks_x_; ++bx) {
            for (int cell = 0; cell < int(kCells); ++cell) {
                // Cells beyond the lattice, in its last blocks, are taken for the outermost.
                const Vec3 index(std::min(bx * kBlockEdge + cell % 8, o.extent.x - 1),
                                 std::min(row % blocks_y_ * kBlockEdge + cell / 8 % 8, o.extent.y - 1),
                                 std::min(row / blocks_y_ * kBlockEdge + cell / 64, o.extent.z - 1));
                const Vec3 centre = o.placement.origin_m + o.placement.cell_size_m * (index + 0.5);
                *to++ = float(sample_at(*grid.samples, centre, 0));
            }
        }
    });
    table.set_bounds();
    high_[std::size_t(grid.of)] = *std::ranges::max_element(table.high);
}

void Background::set_time(const AutomatonOptions& o, double time_s) {
    if (!by_height_) return;
    for (std::size_t draw = 0; draw < 3; ++draw) slabs_[draw].values.resize(std::size_t(blocks_z_) * kCells);
    for (int layer = 0; layer < blocks_z_ * kBlockEdge; ++layer) {
        const std::array<float, 3> p = as_floats(background_at(o.field.profile, height_of(o, layer), time_s));
        for (std::size_t draw = 0; draw < 3; ++draw)
            std::fill_n(slabs_[draw].values.begin() + std::ptrdiff_t(layer) * 64, 64, p[draw]);
    }
    for (std::size_t draw = 0; draw < 3; ++draw) {
        slabs_[draw].set_bounds();
        if (grids_[draw].values.empty()) high_[draw] = *std::ranges::max_element(slabs_[draw].high);
    }
}

BlockBackground Background::of_block(int bx, int by, int bz) const {
    BlockBackground block{uniform_, uniform_, {}};
    for (std::size_t draw = 0; draw < 3; ++draw) {
        if (!grids_[draw].values.empty()) {
            const std::size_t row = std::size_t(bz) * std::size_t(blocks_y_) + std::size_t(by);
            grids_[draw].add_to(block, draw, row * std::size_t(blocks_x_) + std::size_t(bx));
        } else if (by_height_) {
            slabs_[draw].add_to(block, draw, std::size_t(bz));
        }
    }
    return block;
}

}  // namespace nephos
