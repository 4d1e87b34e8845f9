// SPDX-License-Identifier: Apache-2.0
#include "seeds/genera.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string>
#include <vector>

#include "core/error.h"

namespace nephos {
namespace {

constexpr Range kLow{0, 2000};
constexpr Range kNs{900, 3000};
constexpr Range kCb{700, 1500};

constexpr std::array<GenusFacts, kGenusCount> kGenera{{
    {Genus::Ci, "Ci", "cirrus", {6000, 18000}, {5000, 13000}, {3000, 8000}, {}},
    {Genus::Cs, "Cs", "cirrostratus", {6000, 11000}, {5000, 11000}, {5000, 8000}, {}},
    {Genus::Cc, "Cc", "cirrocumulus", {6000, 11000}, {5000, 11000}, {5000, 8000}, {}},
    {Genus::As, "As", "altostratus", {2000, 6000}, {2000, 6000}, {2000, 4000}, {}},
    {Genus::Ac, "Ac", "altocumulus", {2000, 6000}, {2000, 6000}, {2000, 4000}, {}},
    {Genus::Ns, "Ns", "nimbostratus", kNs, kNs, kNs, {}},
    {Genus::St, "St", "stratus", kLow, kLow, kLow, {}},
    {Genus::Sc, "Sc", "stratocumulus", kLow, kLow, kLow, {}},
    {Genus::Cu, "Cu", "cumulus", kLow, kLow, kLow, {}},
    {Genus::Cb, "Cb", "cumulonimbus", kCb, kCb, kCb, Range{9000, 12000}},
    {Genus::StFra, "St fra", "fractostratus", kLow, kLow, kLow, {}},
    {Genus::CuFra, "Cu fra", "fractocumulus", kLow, kLow, kLow, {}},
}};

std::string lower(std::string_view text) {
    std::string result(text);
    for (char& c : result) {
        if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
    }
    return result;
}

// Levenshtein distance; one row of the table at a time.
std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i + 1;
        for (std::size_t j = 0; j < b.size(); ++j) {
            const std::size_t replaced = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
        }
    }
    return row.back();
}

}  // namespace

std::span<const GenusFacts> genera() { return kGenera; }

const GenusFacts& facts_of(Genus genus) { return kGenera[std::size_t(genus)]; }

Range base_height_m(Genus genus, Region region) {
    const GenusFacts& facts = facts_of(genus);
    switch (region) {
        case Region::tropical:
            return facts.base_tropical_m;
        case Region::temperate:
            return facts.base_temperate_m;
        case Region::polar:
            break;
    }
    return facts.base_polar_m;
}

Genus genus_from_name(std::string_view text) {
    const std::string requested = lower(text).substr(0, 64);
    const GenusFacts* nearest = nullptr;
    std::string_view nearest_name;
    std::size_t best = 4;  // farther than three letters is no typing error
    std::string all;
    for (const GenusFacts& facts : kGenera) {
        for (std::string_view name : {facts.abbreviation, facts.name}) {
            const std::string known = lower(name);
            if (requested == known && requested.size() == text.size()) return facts.genus;
            const std::size_t distance = edit_distance(requested, known);
            if (distance < std::min(best, known.size())) {
                best = distance;
                nearest = &facts;
                nearest_name = name;
            }
        }
        all += (all.empty() ? "" : ", ") + std::string(facts.abbreviation);
    }
    throw Error(ErrorCode::usage,
                "unknown cloud genus \"" + std::string(text.substr(0, 64)) + "\"" +
                    (nearest ? ", did you mean \"" + std::string(nearest_name) + "\"?" : "") +
                    " (known: " + all + ")");
}

}  // namespace nephos
