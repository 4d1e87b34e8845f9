// SPDX-License-Identifier: Apache-2.0
// Frames in flight to a device that is lost (lost_device_layer.cpp): each says so.

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/renderer.h"
#include "tests/render/rain_scene.h"
#include "tests/scoped_variable.h"

namespace nephos {
namespace {

class LostPictures : public testing::Test {
  protected:
    void SetUp() override { splats_.metaballs = {balls_, 0.002, 0.7}; }

    // A lattice that fills the picture from within, and the same from far away.
    static std::vector<Metaball> lattice() {
        std::vector<Metaball> balls;
        for (int n = 0; n < 500; ++n)
            balls.push_back({float(n % 10) * 200 - 900, float(n / 10 % 10) * 200 - 900,
                             float(n / 100) * 200 + 600, 190, 1});
        return balls;
    }
    static RenderOptions seen_from(double y) {
        RenderOptions options;
        options.camera.position_m = {0, y, 1000};
        options.camera.target_m = {0, y + 100, 1000};
        options.camera.width = 320;
        options.camera.height = 240;
        options.shadow_map_size = 64;
        options.level_of_detail.pixels = 0;  // other metaballs would wait for both
        return options;
    }
    static void expect_lost(const std::function<void()>& finish, const char* what) {
        try {
            finish();
            ADD_FAILURE() << what;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::gpu);
            EXPECT_NE(std::string(error.what()).find("ErrorDeviceLost"), std::string::npos) << error.what();
        }
    }

    static constexpr const char *kWaits = "NEPHOS_LOSE_WAIT_AFTER", *kMemory = "NEPHOS_REFUSE_MEMORY_AFTER";
    const test::ScopedVariable path_{"VK_LAYER_PATH", NEPHOS_LAYERS}, layers_{"VK_INSTANCE_LAYERS", "VK_LAYER_NEPHOS_lost_device"};
    const std::vector<Metaball> balls_ = lattice();
    Splats splats_;
    Renderer renderer() const { return Renderer({.splatting = Splatting::vulkan}); }
};

// The wait for the second fails while the lists of the first grow, which waits for both.
TEST_F(LostPictures, AreNotTakenForOthersWhileListsGrow) {
    for (const int waits : {0, 1}) {
        SCOPED_TRACE(waits);
        Renderer drawing = renderer();
        drawing.draw_splats(splats_, seen_from(-40000));  // its pixels are there to be taken
        PendingPicture first = drawing.begin(splats_, seen_from(0)),
                       second = drawing.begin(splats_, seen_from(-40000));
        ASSERT_TRUE(first.is_pending() && second.is_pending());
        const test::ScopedVariable lost(kWaits, std::to_string(waits));
        expect_lost([&] { drawing.finish(std::move(first)); }, "the first");
        expect_lost([&] { drawing.finish(std::move(second)); }, "the second");
        expect_lost([&] { drawing.draw_splats(splats_, seen_from(-40000)); }, "another");
    }
}

// Nor are those of whom nobody wants to know any more the end of others that come after them.
TEST_F(LostPictures, AreWaitedForBeforeOthersTakeTheirPlace) {
    Renderer drawing = renderer();
    const Picture expected = drawing.draw_splats(splats_, seen_from(-40000));
    {
        std::optional<PendingPicture> dropped = drawing.begin(splats_, seen_from(-40000));
        const test::ScopedVariable lost(kWaits, "0");
        dropped.reset();
    }
    for (int n = 0; n < 3; ++n)
        EXPECT_EQ(drawing.draw_splats(splats_, seen_from(-40000)).beauty, expected.beauty);
}

// Rain over a picture of three strips, with one allocation after the other refused: each picture is larger than all before,
// so that it wants all of its memory anew. What comes after it is as if it had never been.
TEST_F(LostPictures, OfRainThatMemoryRunsOutForLeaveNoTrace) {
    const auto seen = [](int width, int height) {
        return test::rain_view({100, 380, 3}, {100, 480, 13}, width, height, 300);
    };
    Weather weather;
    weather.curtains = {test::rain_area()};
    const auto draw = [&](Renderer& drawing, const RenderOptions& options) {
        return drawing.draw_splats({}, options, {}, Rainfall{options, weather, 3});
    };
    Renderer drawing = renderer();
    const RenderOptions small = seen(40, 30);
    const Picture expected = draw(drawing, small);
    int refused = 0;
    for (bool again = true; again && refused < 200;) {
        try {
            const test::ScopedVariable full(kMemory, std::to_string(refused));
            draw(drawing, seen(8 + refused, 8200));
            again = false;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::gpu) << error.what();
            ++refused;
        }
        EXPECT_EQ(draw(drawing, small).beauty, expected.beauty) << refused;
    }
    EXPECT_GT(refused, 8);
    EXPECT_LT(refused, 200);
    const RenderOptions tall = seen(8, 8200);
    Renderer other = renderer();
    EXPECT_EQ(draw(drawing, tall).beauty, draw(other, tall).beauty);
}

// A wait for rain, here over a picture of three strips, that fails ends its picture: the next takes its place, and nothing is
// written into the one that is gone (seen by AddressSanitizer).
TEST_F(LostPictures, OfRainAreNotWrittenToLater) {
    const RenderOptions options = test::rain_view({100, 380, 3}, {100, 480, 13}, 8, 8200, 300);
    Weather weather;
    weather.curtains = {test::rain_area()};
    const auto draw = [&](Renderer& drawing) {
        return drawing.draw_splats({}, options, {}, Rainfall{options, weather, 3});
    };
    Renderer drawing = renderer();
    const Picture expected = draw(drawing);
    for (int waits = 0;; ++waits) {
        ASSERT_LT(waits, 20);
        bool is_lost = false;
        try {
            const test::ScopedVariable lost(kWaits, std::to_string(waits));
            draw(drawing);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::gpu) << error.what();
            is_lost = true;
        }
        EXPECT_EQ(draw(drawing).beauty, expected.beauty) << waits;
        if (!is_lost) {
            EXPECT_GT(waits, 0) << "no wait was lost: the test proves nothing";
            break;
        }
    }
}

}  // namespace
}  // namespace nephos
