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

// T's table 2, and the heights of its annex.
TEST(Genera, BaseHeights) {
    EXPECT_EQ(group_height_m(HeightGroup::low, Region::polar), (Range{0, 2000}));
    EXPECT_EQ(group_height_m(HeightGroup::middle, Region::tropical), (Range{2000, 8000}));
    EXPECT_EQ(group_height_m(HeightGroup::middle, Region::temperate), (Range{2000, 7000}));
    EXPECT_EQ(group_height_m(HeightGroup::middle, Region::polar), (Range{2000, 4000}));
    EXPECT_EQ(group_height_m(HeightGroup::high, Region::tropical), (Range{6000, 18000}));
    EXPECT_EQ(group_height_m(HeightGroup::high, Region::temperate), (Range{5000, 13000}));
    EXPECT_EQ(group_height_m(HeightGroup::high, Region::polar), (Range{3000, 8000}));
    EXPECT_EQ(base_height_m(Genus::Ci, Region::temperate), (Range{5000, 13000}));
    EXPECT_EQ(base_height_m(Genus::Cs, Region::polar), (Range{5000, 8000}));
    EXPECT_EQ(base_height_m(Genus::As, Region::polar), (Range{2000, 4000}));
    EXPECT_EQ(base_height_m(Genus::Ns, Region::tropical), (Range{900, 3000}));
    EXPECT_EQ(base_height_m(Genus::Cb, Region::temperate), (Range{700, 1500}));
    EXPECT_EQ(facts_of(Genus::Cb).top_m, (Range{9000, 12000}));
    for (const GenusFacts& f : genera()) {
        for (Region region : {Region::tropical, Region::temperate, Region::polar}) {
            const Range own = base_height_m(f.genus, region), group = group_height_m(f.group, region);
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
    EXPECT_EQ(region_from_name("Polar"), Region::polar);
    test::expect_error(ErrorCode::usage, "temperate", [] { (void)region_from_name("moon"); });
}

}  // namespace
}  // namespace nephos
