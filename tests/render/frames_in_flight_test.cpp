// SPDX-License-Identifier: Apache-2.0
// Pictures that are begun before others are finished.

#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/renderer.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/picture_checks.h"
#include "tests/render/random_billboards.h"
#include "tests/render/reference_render.h"

namespace nephos {
namespace {

// Pictures that are begun before others are finished, of moving cameras, of one cloud and of others, with and
// without air and billboards, in parts and as a whole: the same bits as one after the other.
TEST(FramesInFlight, HaveTheBitsOfThoseDrawnOneByOne) {
    struct Case {
        std::vector<Metaball> balls;
        Splats splats;
        RenderOptions options;
    };
    const std::vector<CloudBillboard> billboards = test::random_billboards(17, 300, 2);
    std::vector<Case> cases(14);
    for (std::size_t n = 0; n < cases.size(); ++n) {
        Case& each = cases[n];
        const bool other = n == 5 || n > 11;
        each.balls = reference::random_metaballs(other ? 19 : 18, other ? 900 : 500);
        if (n == 4 || n == 9 || n == 10) each.splats = test::scene_of(test::kBillboardClouds, billboards);
        each.splats.metaballs = {each.balls, 0.02, 0.7};
        each.splats.depth = n % 3 != 0;
        each.splats.light = n % 4 == 0;
        if (n == 8) each.splats.flash = Flash{{300, 200, 1200}, {0.75, 0.8, 1.0}, 0.5};
        each.options =
            test::view({100.0 * double(n), -4000, n == 7 ? 900.0 : 800.0}, {0, 0, 1000}, 50, 70, 48);
        if (n >= 3) each.options.light_shafts.strength = 1;
        if (n >= 6) each.options.atmosphere.model = AirModel::physical;
        if (n == 10) each.options.sun.elevation_deg = 20;
        if (n == 11) each.options.light.phase.g = 0.2;
    }
    for (const int part_size : {2048, 32}) {
        Renderer one_by_one(test::validated(Splatting::vulkan, part_size)),
            renderer(test::validated(Splatting::vulkan, part_size));
        std::vector<Picture> expected;
        for (const Case& each : cases) expected.push_back(one_by_one.draw_splats(each.splats, each.options));
        std::vector<PendingPicture> pending;
        for (std::size_t n = 0; n < cases.size(); ++n) {
            pending.push_back(renderer.begin(cases[n].splats, cases[n].options));
            EXPECT_TRUE(pending.back().is_pending());
            if (n == 0) continue;
            test::expect_same_bits(renderer.finish(std::move(pending[n - 1])), expected[n - 1]);
        }
        test::expect_same_bits(renderer.finish(std::move(pending.back())), expected.back());

        pending.clear();  // many at once, finished from the last to the first
        for (std::size_t n = 0; n < 5; ++n)
            pending.push_back(renderer.begin(cases[n].splats, cases[n].options));
        for (std::size_t n = 5; n-- > 0;)
            test::expect_same_bits(renderer.finish(std::move(pending[n])), expected[n]);
        for (const Renderer* each : {&one_by_one, &renderer}) test::expect_no_messages(*each);
    }
}

// Lists that grow, and pictures that do not fit, while others are in flight.
TEST(FramesInFlight, MayNotFit) {
    Renderer reference(test::validated(Splatting::cpu));
    const std::vector<Metaball> balls = reference::random_metaballs(20, 500);
    Splats splats;
    splats.metaballs = {balls, 0.002, 0.7};
    const RenderOptions far = test::view({0, -40000, 800}, {0, 0, 1000}, 50, 160, 120),
                        near = test::view({100, 200, 1000}, {700, 300, 1100}, 60, 160, 120);
    const Picture expected_far = reference.draw_splats(splats, far),
                  expected_near = reference.draw_splats(splats, near);
    for (const std::size_t entries : {std::size_t{1} << 24, std::size_t{2048}}) {
        Renderer renderer(test::validated(Splatting::vulkan));  // whose lists have not grown yet
        RendererTestAccess::limit_lists(renderer, entries);
        PendingPicture a = renderer.begin(splats, far), b = renderer.begin(splats, near),
                       c = renderer.begin(splats, near), d = renderer.begin(splats, far);
        const auto close = [](const Picture& picture, const Picture& expected) {
            EXPECT_LE(test::largest_difference(picture.beauty, expected.beauty), 1.0f / 255);
            EXPECT_LE(test::largest_difference(picture.transmittance, expected.transmittance), 1.0f / 255);
        };
        close(renderer.finish(std::move(b)), expected_near);
        close(renderer.finish(std::move(a)), expected_far);
        close(renderer.finish(std::move(c)), expected_near);
        close(renderer.finish(std::move(d)), expected_far);
        const std::size_t overflows = RendererTestAccess::overflows(renderer);
        EXPECT_TRUE(overflows >= 1 && overflows <= 8) << overflows;
        test::expect_no_messages(renderer);
    }
}

// Pictures that nobody finishes.
TEST(FramesInFlight, MayBeDropped) {
    const std::vector<Metaball> balls = reference::random_metaballs(21, 500);
    Splats splats;
    splats.metaballs = {balls, 0.02, 0.7};
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    Renderer renderer(test::validated(Splatting::vulkan));
    const Picture expected = renderer.draw_splats(splats, options);
    for (int n = 0; n < 3; ++n) {
        PendingPicture dropped = renderer.begin(splats, options);
        PendingPicture replaced = renderer.begin(splats, options);
        replaced = renderer.begin(splats, options);
        test::expect_same_bits(renderer.finish(std::move(replaced)), expected);
    }
    test::expect_same_bits(renderer.draw_splats(splats, options), expected);
    test::expect_no_messages(renderer);
}

// What is wrong with one picture is said by its own begin(), and the one before it is drawn all the same.
TEST(FramesInFlight, BadOnesDoNotSpoilOthers) {
    std::vector<Metaball> balls = reference::random_metaballs(22, 500), bad = balls;
    bad[7].radius = -1;
    Splats splats, spoilt;
    splats.metaballs = {balls, 0.02, 0.7};
    spoilt.metaballs = {bad, 0.02, 0.7};
    const RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000});
    Renderer renderer(test::validated(Splatting::vulkan));
    const Picture expected = renderer.draw_splats(splats, options);
    PendingPicture pending = renderer.begin(splats, options);
    try {
        renderer.begin(spoilt, options);
        ADD_FAILURE() << "a metaball without radius was drawn";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find("metaball 7"), std::string::npos) << error.what();
    }
    test::expect_same_bits(renderer.finish(std::move(pending)), expected);
    test::expect_same_bits(renderer.draw_splats(splats, options), expected);
    test::expect_no_messages(renderer);
}

}  // namespace
}  // namespace nephos
