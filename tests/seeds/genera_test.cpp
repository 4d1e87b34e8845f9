// SPDX-License-Identifier: Apache-2.0
#include "seeds/genera.h"

#include <set>
#include <string>

#include "tests/seeds/fixtures.h"

namespace nephos {
namespace {

TEST(Genera, TenAndTwoRaggedForms) {
    ASSERT_EQ(genera().size(), std::size_t(kGenusCount));
    std::set<std::string> names;
    int i = 0;
    for (const GenusFacts& facts : genera()) {
        EXPECT_EQ(int(facts.genus), i++);
        EXPECT_EQ(&facts_of(facts.genus), &facts);
        names.insert(std::string(facts.name));
        names.insert(std::string(facts.abbreviation));
        EXPECT_EQ(genus_from_name(facts.abbreviation), facts.genus);
        EXPECT_EQ(genus_from_name(facts.name), facts.genus);
    }
    EXPECT_EQ(names.size(), 24u);
    EXPECT_EQ(genus_from_name("cB"), Genus::Cb);
    EXPECT_EQ(genus_from_name("ST FRA"), Genus::StFra);
}

// Heights of the bases of T's three groups of genera, by region (table 2).
Range group_height_m(Genus genus, Region region) {
    constexpr Range kHigh[]{{6000, 18000}, {5000, 13000}, {3000, 8000}},
        kMiddle[]{{2000, 8000}, {2000, 7000}, {2000, 4000}};
    switch (genus) {
        case Genus::Ci:
        case Genus::Cs:
        case Genus::Cc:
            return kHigh[int(region)];
        case Genus::As:
        case Genus::Ac:
        case Genus::Ns:
            return kMiddle[int(region)];
        default:
            return {0, 2000};
    }
}

// The heights of T's annex, within those of table 2.
TEST(Genera, BaseHeights) {
    EXPECT_EQ(base_height_m(Genus::Ci, Region::temperate), (Range{5000, 13000}));
    EXPECT_EQ(base_height_m(Genus::Cs, Region::polar), (Range{5000, 8000}));
    EXPECT_EQ(base_height_m(Genus::As, Region::polar), (Range{2000, 4000}));
    EXPECT_EQ(base_height_m(Genus::Ns, Region::tropical), (Range{900, 3000}));
    EXPECT_EQ(base_height_m(Genus::Cb, Region::temperate), (Range{700, 1500}));
    EXPECT_EQ(facts_of(Genus::Cb).top_m, (Range{9000, 12000}));
    for (const GenusFacts& f : genera()) {
        for (Region region : {Region::tropical, Region::temperate, Region::polar}) {
            const Range own = base_height_m(f.genus, region), group = group_height_m(f.genus, region);
            EXPECT_LT(own.min, own.max) << f.name;
            if (f.genus == Genus::Ns) continue;  // T's own exception
            EXPECT_GE(own.min, group.min) << f.name;
            EXPECT_LE(own.max, group.max) << f.name;
        }
    }
}

TEST(Genera, UnknownNames) {
    test::expect_error(ErrorCode::usage, "did you mean \"cumulus\"",
                       [] { (void)genus_from_name("cumulos"); });
    test::expect_error(ErrorCode::usage, "Cb", [] { (void)genus_from_name("thunderstorm"); });
    test::expect_error(ErrorCode::usage, "unknown", [] { (void)genus_from_name(""); });
    test::expect_error(ErrorCode::usage, "unknown", [] { (void)genus_from_name(std::string(100000, 'c')); });
}

}  // namespace
}  // namespace nephos
