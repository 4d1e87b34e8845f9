// SPDX-License-Identifier: Apache-2.0
#include "automaton/advection.h"

#include <algorithm>
#include <span>

namespace nephos {
namespace {

// out |= in << shift over whole rows of words; bits shifted beyond the row are lost.
void or_shifted_up(std::span<std::uint64_t> out, const std::uint64_t* in, std::int64_t shift) {
    const std::size_t by_words = std::size_t(shift / 64);
    const int bits = int(shift % 64);
    for (std::size_t w = by_words; w < out.size(); ++w) {
        out[w] |= in[w - by_words] << bits;
        if (bits != 0 && w > by_words) out[w] |= in[w - by_words - 1] >> (64 - bits);
    }
}

// out |= in >> shift.
void or_shifted_down(std::span<std::uint64_t> out, const std::uint64_t* in, std::int64_t shift) {
    const std::size_t by_words = std::size_t(shift / 64);
    const int bits = int(shift % 64);
    for (std::size_t w = 0; w + by_words < out.size(); ++w) {
        out[w] |= in[w + by_words] >> bits;
        if (bits != 0 && w + by_words + 1 < out.size()) out[w] |= in[w + by_words + 1] << (64 - bits);
    }
}

std::int64_t wrap(std::int64_t value, std::int64_t size) { return (value % size + size) % size; }

}  // namespace

void shift_layer(BitPlane& plane, int k, std::int64_t dx, std::int64_t dy, const Boundaries& boundaries,
                 std::vector<std::uint64_t>& scratch) {
    const std::int64_t nx = plane.extent().x, ny = plane.extent().y;
    const bool wraps_x = boundaries.x == Boundary::periodic, wraps_y = boundaries.y == Boundary::periodic;
    if (wraps_x) dx = wrap(dx, nx);
    if (wraps_y) dy = wrap(dy, ny);
    if (dx == 0 && dy == 0) return;

    const std::size_t words = plane.words_per_row();
    std::uint64_t* layer = plane.row(0, k);
    scratch.assign(layer, layer + words * std::size_t(ny));
    const std::uint64_t last_word = nx % 64 == 0 ? ~std::uint64_t{0} : (std::uint64_t{1} << (nx % 64)) - 1;
    for (std::int64_t j = 0; j < ny; ++j) {
        const std::span<std::uint64_t> out(layer + std::size_t(j) * words, words);
        std::ranges::fill(out, std::uint64_t{0});
        const std::int64_t from = wraps_y ? wrap(j - dy, ny) : j - dy;
        if (from < 0 || from >= ny) continue;
        const std::uint64_t* in = scratch.data() + std::size_t(from) * words;
        if (dx >= 0 && dx < nx) or_shifted_up(out, in, dx);
        if (dx < 0 && -dx < nx) or_shifted_down(out, in, -dx);
        if (wraps_x && dx > 0) or_shifted_down(out, in, nx - dx);
        out.back() &= last_word;
    }
}

}  // namespace nephos
