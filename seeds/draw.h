// SPDX-License-Identifier: Apache-2.0
#pragma once

// Randomness of clouds and skies: Philox counters of the domains `seeds` and `skies` (core/random.h). Each
// number is a pure function of its counter, so that cloud 7 of a base model is the same in any order of
// evaluation.
//
//                word 0                                   word 1    word 2         word 3
//     seeds      sub-index | kind << 16 | version << 24   number    box or root    base model | domain << 16
//     skies      sub-index | kind << 16 | version << 24   serial    0              layer      | domain << 16
//
// The kinds below separate the draws of one domain; no two draws share a counter.

#include <cstdint>

#include "automaton/field.h"
#include "core/random.h"

namespace nephos {

// Kinds of draws of a cloud. `box` and `child` are indexed by the boxes of the cloud, `root` by the roots of
// the base model.
enum class SeedDraw : std::uint32_t { box = 0, root = 1, child = 2, billboard = 3 };

// Kinds of draws of a layer of the sky. The serial number counts the clouds made so far, for `dissolve` those
// dissolved, for `change` it is that of the cloud.
enum class SkyDraw : std::uint32_t { cloud = 0, place = 1, dissolve = 2, change = 3 };

inline PhiloxWords draw_for_cloud(std::uint64_t scene_seed, std::uint32_t model_index, std::uint32_t number,
                                  SeedDraw kind, std::uint32_t index, std::uint32_t sub_index = 0) {
    return philox(scene_seed, {item_word_0(std::uint32_t(kind), sub_index), number, index,
                               model_index | std::uint32_t(Domain::seeds) << 16});
}

inline PhiloxWords draw_for_sky(std::uint64_t scene_seed, std::uint32_t layer, SkyDraw kind,
                                std::uint32_t serial) {
    return philox(scene_seed, {item_word_0(std::uint32_t(kind), 0), serial, 0,
                               layer | std::uint32_t(Domain::skies) << 16});
}

// Returns a uniform integer in 0..n-1 (bias below n / 2^32); n >= 1.
constexpr std::uint32_t draw_below(std::uint32_t word, std::uint32_t n) {
    return std::uint32_t((std::uint64_t{word} * n) >> 32);
}

// Returns a uniform integer in min..max, both included; max - min < 2^31.
constexpr int draw_count(std::uint32_t word, int min, int max) {
    return min + int(draw_below(word, std::uint32_t(max - min) + 1u));
}

// Returns a uniform number in [range.min, range.max).
constexpr double draw_in(std::uint32_t word, Range range) {
    return range.min + (range.max - range.min) * unit_interval(word);
}

}  // namespace nephos
