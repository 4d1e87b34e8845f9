// SPDX-License-Identifier: Apache-2.0
#include "automaton/advection.h"

#include <algorithm>
#include <span>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

// A periodic row whose end is within a word, twice: a shift becomes a copy of bits from `start` on.
class RepeatedRow {
  public:
    RepeatedRow(std::int64_t nx, std::size_t words) : nx_(nx), bits_(2 * words + 1, 0) {}

    void load(std::span<const std::uint64_t> row) {
        const std::size_t end = std::size_t(nx_ / 64);
        const int rest = int(nx_ % 64);
        std::ranges::copy(row, bits_.begin());
        for (std::size_t w = 0; w < row.size(); ++w) {
            bits_[end + w] |= row[w] << rest;
            bits_[end + w + 1] = row[w] >> (64 - rest);
        }
    }
    std::uint64_t operator()(std::size_t word) const { return bits_[word]; }

  private:
    std::int64_t nx_;
    std::vector<std::uint64_t> bits_;
};

// Writes the bits from `start` on of the words that `word_at` returns.
template <class WordAt>
void store_shifted_words(std::span<std::uint64_t> out, std::size_t start, const WordAt& word_at) {
    const int shift = int(start % 64);
    std::uint64_t word = word_at(start / 64);
    for (std::size_t w = 0; w < out.size(); ++w) {
        const std::uint64_t next = word_at(start / 64 + w + 1);
        out[w] = word >> shift | next << 1 << (63 - shift);
        word = next;
    }
}

std::int64_t wrap(std::int64_t value, std::int64_t size) { return (value % size + size) % size; }

}  // namespace

Displacement displacement_of_layer(const AutomatonOptions& options, int k, double time_s) {
    Vec3 place = options.placement.origin_m;  // anywhere in the layer
    place.z += (k + 0.5) * options.placement.cell_size_m;
    const Vec3 wind = wind_at(options.wind, place, time_s);
    // Winds of files are known only now: key frames were checked with the options.
    const double cells =
        std::max(std::abs(wind.x), std::abs(wind.y)) * options.time_step_s / options.placement.cell_size_m;
    if (!(cells <= kMaxCellsOfStep))
        throw Error(ErrorCode::usage, "wind moves the air by " + number_text(cells, 6) +
                                          " cells in one step; at most 2^24 cells are possible");
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
    const bool whole_words = nx % 64 == 0;
    RepeatedRow repeated(nx, wraps_x && !whole_words ? words : 0);
    // Of a row repeated, or of one with as many words of zeros on either side.
    const std::int64_t all = std::int64_t(words) * 64;
    const std::size_t start = std::size_t(wraps_x ? (nx - dx) % nx : all - std::clamp(dx, -all, all));
    std::int64_t from = wraps_y && dy > 0 ? ny - dy : -dy;
    for (std::int64_t j = 0; j < ny; ++j, ++from) {
        const std::span out = layer.subspan(std::size_t(j) * words, words);
        if (wraps_y && from == ny) from = 0;
        const bool inside = from >= 0 && from < ny;
        const std::span<const std::uint64_t> in(scratch.data() + (inside ? std::size_t(from) * words : 0), words);
        std::uint64_t any = 0;
        for (const std::uint64_t word : in) any |= word;
        if (!inside || any == 0) {
            for (std::uint64_t& word : out) word = 0;
            continue;
        }
        if (!wraps_x) {
            store_shifted_words(out, start, [&](std::size_t w) { return w - words < words ? in[w - words] : 0; });
        } else if (whole_words) {
            store_shifted_words(out, start, [&](std::size_t w) { return in[w < words ? w : w - words]; });
        } else {
            repeated.load(in);
            store_shifted_words(out, start, repeated);
        }
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
