// SPDX-License-Identifier: Apache-2.0
#include "automaton/advection.h"

#include <algorithm>
#include <span>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace nephos {
namespace {

// A row with what flows in from either side, so that a shift becomes a copy of bits from `start` on: zeros,
// the row and zeros again, or, if periodic, the row twice.
class RowWithSurroundings {
  public:
    RowWithSurroundings(std::int64_t nx, std::size_t words, bool periodic, std::int64_t dx)
        : nx_(nx), words_(words), periodic_(periodic), bits_(3 * words + 1, 0) {
        const std::int64_t all = std::int64_t(words) * 64;
        start_ = std::size_t(periodic ? nx - dx : all - std::clamp(dx, -all, all));
    }

    void load(const std::uint64_t* row) {
        if (!periodic_) {
            std::copy_n(row, words_, bits_.data() + words_);
            return;
        }
        const std::size_t end = std::size_t(nx_ / 64);
        const int rest = int(nx_ % 64);
        std::copy_n(row, words_, bits_.data());
        if (rest == 0) {
            std::copy_n(row, words_, bits_.data() + end);
            return;
        }
        for (std::size_t w = 0; w < words_; ++w) {
            bits_[end + w] |= row[w] << rest;
            bits_[end + w + 1] = row[w] >> (64 - rest);
        }
    }

    void store_shifted(std::span<std::uint64_t> out) const {
        const std::uint64_t* in = bits_.data() + start_ / 64;
        const int shift = int(start_ % 64);
        for (std::size_t w = 0; w < out.size(); ++w) out[w] = in[w] >> shift | in[w + 1] << 1 << (63 - shift);
    }

  private:
    std::int64_t nx_;
    std::size_t words_;
    bool periodic_;
    std::size_t start_;
    std::vector<std::uint64_t> bits_;
};

std::int64_t wrap(std::int64_t value, std::int64_t size) { return (value % size + size) % size; }

}  // namespace

Displacement displacement_of_layer(const AutomatonOptions& options, int k, double time_s) {
    Vec3 place = options.placement.origin_m;  // anywhere in the layer
    place.z += (k + 0.5) * options.placement.cell_size_m;
    const Vec3 wind = wind_at(options.wind, place, time_s);
    return displacement_of_step({wind.x, wind.y}, options.time_step_s, options.placement.cell_size_m);
}

void shift_layer(BitPlane& plane, int k, std::int64_t dx, std::int64_t dy, const Boundaries& boundaries,
                 std::vector<std::uint64_t>& scratch) {
    const std::int64_t nx = plane.extent().x, ny = plane.extent().y;
    const bool wraps_x = boundaries.x == Boundary::periodic, wraps_y = boundaries.y == Boundary::periodic;
    if (wraps_x) dx = wrap(dx, nx);
    if (wraps_y) dy = wrap(dy, ny);
    if (dx == 0 && dy == 0) return;

    const std::size_t words = plane.words_per_row();
    const std::span layer(plane.row(0, k), words * std::size_t(ny));
    if (std::ranges::all_of(layer, [](std::uint64_t word) { return word == 0; })) return;
    scratch.assign(layer.begin(), layer.end());
    const std::uint64_t last_word = nx % 64 == 0 ? ~std::uint64_t{0} : (std::uint64_t{1} << (nx % 64)) - 1;
    RowWithSurroundings row(nx, words, wraps_x, dx);
    for (std::int64_t j = 0; j < ny; ++j) {
        const std::span out = layer.subspan(std::size_t(j) * words, words);
        const std::int64_t from = wraps_y ? wrap(j - dy, ny) : j - dy;
        if (from < 0 || from >= ny) {
            std::ranges::fill(out, std::uint64_t{0});
            continue;
        }
        row.load(scratch.data() + std::size_t(from) * words);
        row.store_shifted(out);
        out.back() &= last_word;
    }
}

void advect(const AutomatonOptions& options, int first, double time_s, std::span<Displacement> rest,
            const std::array<BitPlane*, 3>& planes) {
    constexpr std::int64_t kFractionMask = 0xFFFFFFFF;
    if (is_calm(options.wind)) return;
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rest.size()), [&](const tbb::blocked_range<std::size_t>& layers) {
        std::vector<std::uint64_t> scratch;
        for (std::size_t n = layers.begin(); n != layers.end(); ++n) {
            Displacement moved = displacement_of_layer(options, first + int(n), time_s);
            moved.x += rest[n].x;
            moved.y += rest[n].y;
            rest[n] = {moved.x & kFractionMask, moved.y & kFractionMask};
            if (moved.whole_x() == 0 && moved.whole_y() == 0) continue;
            for (BitPlane* const plane : planes)
                shift_layer(*plane, int(n), moved.whole_x(), moved.whole_y(), options.boundaries, scratch);
        }
    });
}

}  // namespace nephos
