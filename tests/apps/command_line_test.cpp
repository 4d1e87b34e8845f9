// SPDX-License-Identifier: Apache-2.0

// The parts of the command that need no process of their own: values, progress, framing, completion.

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "simulation/framing.h"

namespace nephos {
namespace {

TEST(Values, NumbersAreReadWholeAndInRange) {
    EXPECT_EQ(parse_integer("-5", -10, 10), -5);
    EXPECT_EQ(parse_integer("+5", -10, 10), 5);
    EXPECT_EQ(parse_unsigned("18446744073709551615", 0, ~0ull), ~0ull);
    EXPECT_DOUBLE_EQ(parse_real("1e-3", 0, 1), 0.001);
    for (const char* bad : {"", "11", "5x", " 5", "0x5", "5.0", "nan", "99999999999999999999"}) {
        EXPECT_THROW(parse_integer(bad, -10, 10), Error) << bad;
    }
    for (const char* bad : {"", "nan", "inf", "1e999", "2", "1,5", "one"})
        EXPECT_THROW(parse_real(bad, 0, 1), Error) << bad;
    EXPECT_THROW(parse_unsigned("-1", 0, ~0ull), Error);
}

TEST(Values, FramesSizesAndPoints) {
    EXPECT_EQ(parse_frames("3..7"), (FrameRange{3, 7}));
    EXPECT_EQ(parse_frames("3"), (FrameRange{3, 3}));
    EXPECT_EQ(parse_frames("..7"), (FrameRange{1, 7}));
    EXPECT_EQ(parse_frames("3..").first, 3);
    for (const char* bad : {"", "..", "0..3", "7..3", "a..b", "3-7", "3...7", "-1", "1..99999999999"}) {
        EXPECT_THROW(parse_frames(bad), Error) << bad;
    }
    EXPECT_EQ(parse_size("640x480"), std::pair(640, 480));
    for (const char* bad : {"640", "640x", "0x480", "640x480x3", "16385x1", "640X480"}) {
        EXPECT_THROW(parse_size(bad), Error) << bad;
    }
    EXPECT_EQ(parse_point("1,-2,3.5", -10, 10), (Vec3{1, -2, 3.5}));
    for (const char* bad : {"", "1,2", "1,2,3,4", "1,2,x", "1,2,11"})
        EXPECT_THROW(parse_point(bad, -10, 10), Error) << bad;
}

TEST(Text, NumbersForPeople) {
    EXPECT_EQ(human_duration(7.4), "0:07");
    EXPECT_EQ(human_duration(3723), "1:02:03");
    EXPECT_EQ(human_duration(INFINITY), "> 1 year");
    EXPECT_EQ(human_count(1234567), "1,234,567");
    EXPECT_EQ(human_count(999), "999");
}

TEST(Progress, ShowsRateAndTimeLeft) {
    const std::string text = ProgressBar::text("step", 0, 50, 200, 10.0, "frame 2/8", 120, false);
    EXPECT_EQ(
        text,
        "step 50/200  ##########------------------------------   25%  5.0 steps/s  0:30 left  frame 2/8");
    // After a restart at step 100 the rate counts what this process did.
    EXPECT_NE(ProgressBar::text("step", 100, 150, 200, 10.0, "", 120, false).find("5.0 steps/s  0:10 left"),
              std::string::npos);
    EXPECT_NE(ProgressBar::text("step", 0, 2, 200, 10.0, "", 120, false).find("5.0 s/step"),
              std::string::npos);
    for (int width = 0; width < 120; ++width) {
        EXPECT_LE(int(ProgressBar::text("step", 0, 50, 200, 10.0, "frame 2/8", width, false).size()), width);
    }
    EXPECT_NO_THROW(ProgressBar::text("step", 0, 0, 0, 0, "", 80, true));
}

// Where a point lies in the picture, as tangents relative to its edges: within when both are in -1..1.
std::pair<double, double> projected(const Camera& camera, const Vec3& p) {
    const auto sub = [](const Vec3& a, const Vec3& b) { return Vec3{a.x - b.x, a.y - b.y, a.z - b.z}; };
    const auto dot = [](const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
    const auto cross = [](const Vec3& a, const Vec3& b) {
        return Vec3{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    };
    const auto unit = [&](const Vec3& a) {
        const double length = std::sqrt(dot(a, a));
        return Vec3{a.x / length, a.y / length, a.z / length};
    };
    const Vec3 forward = unit(sub(camera.target_m, camera.position_m));
    const Vec3 up_hint = std::abs(forward.z) > 0.999 ? Vec3{0, 1, 0} : Vec3{0, 0, 1};
    const Vec3 right = unit(cross(forward, up_hint)), up = cross(right, forward);
    const Vec3 d = sub(p, camera.position_m);
    EXPECT_GT(dot(d, forward), 0);
    const double tangent = std::tan(camera.vertical_fov_deg * std::numbers::pi / 360);
    return {dot(d, right) / dot(d, forward) / (tangent * camera.width / camera.height),
            dot(d, up) / dot(d, forward) / tangent};
}

TEST(Framing, TheWholeBoxIsInThePicture) {
    const WorldBox boxes[] = {
        {{-5000, 0, 1000}, {5000, 5000, 1800}}, {{0, 0, 0}, {1, 1, 1}}, {{-3, 10, 5}, {3, 12, 500}}};
    for (const WorldBox& box : boxes) {
        for (const View view : {View::side, View::above}) {
            for (const auto& [width, height] : {std::pair(1280, 720), std::pair(300, 900)}) {
                Camera camera;
                camera.width = width;
                camera.height = height;
                frame(camera, box, view, ground_below(box) - 10);
                double widest = 0;
                for (int corner = 0; corner < 8; ++corner) {
                    const Vec3 p{corner & 1 ? box.max_m.x : box.min_m.x,
                                 corner & 2 ? box.max_m.y : box.min_m.y,
                                 corner & 4 ? box.max_m.z : box.min_m.z};
                    const auto [x, y] = projected(camera, p);
                    EXPECT_LE(std::abs(x), 1);
                    EXPECT_LE(std::abs(y), 1);
                    widest = std::max({widest, std::abs(x), std::abs(y)});
                }
                EXPECT_GT(widest, 0.8) << "the cloud could be larger";
            }
        }
        Camera camera;
        frame(camera, box, View::below, ground_below(box));
        EXPECT_GT(camera.position_m.z, ground_below(box));
        EXPECT_NE(camera.position_m, camera.target_m);
    }
}

TEST(Framing, ExtinctionMakesAnyUnitVisible) {
    for (const double edge_m : {0.01, 50.0}) {
        Placement placement;
        placement.cell_size_m = edge_m;
        const Extent extent{16, 16, 16};
        const DensityGrid grid =
            DensityGrid::from_dense(std::vector<float>(extent.cells(), 0.5f), extent, placement);
        // A way through: 16 voxels at density 0.5.
        EXPECT_NEAR(visible_extinction_per_m(grid) * 0.5 * 16 * edge_m, 12, 1e-3);
    }
    EXPECT_GT(visible_extinction_per_m(DensityGrid()), 0);
}

// Every option of every command is in every script: what is generated cannot be forgotten.
TEST(Completion, NamesEveryCommandAndOption) {
    CLI::App app;
    Action action;
    add_commands(app, action);
    int options = 0;
    for (const char* shell : {"bash", "zsh", "fish"}) {
        const std::string script = completion_script(app, shell);
        for (const CLI::App* command : app.get_subcommands({})) {
            EXPECT_NE(script.find(command->get_name()), std::string::npos) << shell;
            for (const CLI::Option* option : command->get_options()) {
                for (const std::string& name : option->get_lnames()) {
                    const std::string word = (std::string(shell) == "fish" ? "-l " : "--") + name;
                    EXPECT_NE(script.find(word), std::string::npos) << shell << " " << word;
                    ++options;
                }
            }
        }
    }
    EXPECT_GT(options, 90);
    EXPECT_THROW(completion_script(app, "tcsh"), Error);
}

// A description for each command and option, and no line wider than the page.
TEST(Help, EveryPageIsCompleteAndFits) {
    CLI::App app;
    Action action;
    add_commands(app, action);
    for (const CLI::App* command : app.get_subcommands({})) {
        EXPECT_FALSE(command->get_description().empty());
        EXPECT_NE(command->get_footer().find("Example"), std::string::npos) << command->get_name();
        for (const CLI::Option* option : command->get_options()) {
            EXPECT_FALSE(option->get_description().empty())
                << command->get_name() << " " << option->get_name();
        }
        const std::string page = HelpPage().make_help(command, "", CLI::AppFormatMode::Normal);
        for (std::size_t begin = 0; begin < page.size();) {
            const std::size_t end = page.find('\n', begin);
            EXPECT_LE(end - begin, 110u) << page.substr(begin, end - begin);
            begin = end + 1;
        }
    }
}

}  // namespace
}  // namespace nephos
