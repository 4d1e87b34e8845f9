// SPDX-License-Identifier: Apache-2.0
#pragma once

// All randomness of nephos: Philox4x32-10 (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3")
// as a pure function of a key and a counter. Nothing here has state, so the numbers do not depend on threads,
// vector width or the order of work. A counter is never used for two purposes; its layout is (docs/adr/0002):
//
//     word 0   bits  0-15 sub-index   16-23 draw   24-31 version of the domain's stream
//     word 1   step (lattice), generation (field), anything the domain defines
//     word 2   block x | block y << 16 (lattice), index of the item (other domains)
//     word 3   bits  0-15 block z (lattice) or group   16-31 domain
//     key      the 64-bit seed, low word first

#include <array>
#include <cstdint>

#include <Random123/philox.h>

namespace nephos {

// The version of what the lattice draws, from its first state on, in its counters and in checkpoints, records and files
// (docs/adr/0002). Raised with every deliberate change of what is drawn, and with that of kItemStreamVersion.
inline constexpr std::uint32_t kRandomStreamVersion = 2;
// The version of what all other domains draw: ellipsoids, clouds, skies, seeds of layers and of studies, rain. Apart, so that
// scenes keep their clouds when the stream of the lattice changes. No file names it: when it is raised, the one above is, too.
inline constexpr std::uint32_t kItemStreamVersion = 1;

// The purpose of a draw. Domains never share counters.
enum class Domain : std::uint32_t {
    lattice = 0,        // extinction and birth
    initial_state = 1,  // the first hum and act
    field = 2,          // ellipsoids drawn at random
    seeds = 3,          // clouds from base models
    skies = 4,          // which clouds enter, and where
    layers = 5,         // seeds of the layers of a scene
    particles = 6,      // rain and snow
    sweep = 7,          // seeds and points of studies of many runs
    null_model = 8,     // random shadows that statistics are compared with
};

// The draws of a block of 8x8x8 cells: numbers of sparse births and extinctions, dense draws of hum, act, ext, sparse births,
// sparse extinctions.
enum class Draw : std::uint32_t { counts = 0, hum = 1, act = 2, ext = 3, births = 4, extinctions = 5 };

using PhiloxWords = std::array<std::uint32_t, 4>;

// Returns one Philox4x32-10 output: 128 random bits. Thread-safe, pure.
inline PhiloxWords philox(std::uint64_t seed, const PhiloxWords& counter) {
    const r123::Philox4x32::ctr_type in = {{counter[0], counter[1], counter[2], counter[3]}};
    const r123::Philox4x32::key_type key = {{std::uint32_t(seed), std::uint32_t(seed >> 32)}};
    const auto out = r123::Philox4x32{}(in, key);
    return {out.v[0], out.v[1], out.v[2], out.v[3]};
}

constexpr std::uint32_t block_word_0(Draw draw, std::uint32_t sub_index) {
    return sub_index | std::uint32_t(draw) << 16 | kRandomStreamVersion << 24;
}

constexpr std::uint32_t item_word_0(std::uint32_t draw, std::uint32_t sub_index) {
    return sub_index | draw << 16 | kItemStreamVersion << 24;
}

// Returns the counter of block (bx, by, bz) of the lattice; block coordinates are in units of 8 cells.
constexpr PhiloxWords block_counter(Domain domain, Draw draw, std::uint32_t step, int bx, int by, int bz,
                                    std::uint32_t sub_index) {
    return {block_word_0(draw, sub_index), step, std::uint32_t(bx) | std::uint32_t(by) << 16,
            std::uint32_t(bz) | std::uint32_t(domain) << 16};
}

// Returns the counter of item `index` of `group` (0..65535) of another domain; `generation` counts its
// redraws.
constexpr PhiloxWords item_counter(Domain domain, std::uint32_t group, std::uint32_t index,
                                   std::uint32_t generation, std::uint32_t sub_index) {
    return {item_word_0(0, sub_index), generation, index, group | std::uint32_t(domain) << 16};
}

// Returns a 32-bit word as a number in [0, 1).
constexpr double unit_interval(std::uint32_t word) { return word * 0x1p-32; }

}  // namespace nephos
