// SPDX-License-Identifier: Apache-2.0
#pragma once

// The ten genera of clouds and the two ragged (fractus) forms: names, WMO abbreviations, and the heights of
// their bases above ground (T, chapter 2, tables 1 and 2, and annex). Where T gives both the group's heights
// and the genus's own, the range is what both allow; Ns and Cb have their own heights everywhere ("often
// 0.9-3 km", "0.7-1.5 km"), although T's table lists Ns with the middle group.

#include <optional>
#include <span>
#include <string_view>

#include "automaton/field.h"

namespace nephos {

enum class Genus { Ci, Cs, Cc, As, Ac, Ns, St, Sc, Cu, Cb, StFra, CuFra };
inline constexpr int kGenusCount = 12;

// The climatic belts of T's table 2.
enum class Region { tropical, temperate, polar };

struct GenusFacts {
    Genus genus;
    std::string_view abbreviation;  // WMO: "Cu", "Cb", ...; the fractus forms are "St fra" and "Cu fra"
    std::string_view name;          // "cumulus"
    Range base_tropical_m, base_temperate_m, base_polar_m;  // of the base, above ground
    std::optional<Range> top_m;                             // usual top above ground, where T gives one
};

// Returns all genera in the order of the enum. Thread-safe, as all functions here.
std::span<const GenusFacts> genera();

const GenusFacts& facts_of(Genus genus);
Range base_height_m(Genus genus, Region region);

// Parses an abbreviation ("Cb", "St fra") or name ("cumulonimbus"), ignoring case. Throws Error(usage) that
// lists the abbreviations and suggests the nearest one.
Genus genus_from_name(std::string_view text);

}  // namespace nephos
