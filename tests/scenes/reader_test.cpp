// SPDX-License-Identifier: Apache-2.0
// What a scene file says is what the Scene holds: every form of every value, defaults, options, file names.

#include "scenes/format/reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/warnings.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

Scene scene_of(const std::string& text, const std::vector<std::string>& options = {}) {
    return read_scene_text(text, "folder/test scene.toml", "folder", options);
}

// The messages for a scene that must be refused.
std::string messages_of(const std::string& text, const std::vector<std::string>& options = {}) {
    try {
        scene_of(text, options);
    } catch (const SceneErrors& errors) {
        return format(errors.problems());
    }
    ADD_FAILURE() << "no error for:\n" << text;
    return {};
}

bool contains(const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
}

// A key that is not given has the default of the option structs, the name comes from the file.
TEST(Reader, MissingKeysHaveTheDefaultsOfTheStructs) {
    Scene expected;
    expected.name = "plain";
    EXPECT_EQ(scene_of("name = \"plain\""), expected);
    EXPECT_EQ(scene_of("seed = 1").name, "test-scene");
}

// Only a periodic axis limits how far an ellipsoid reaches along it.
TEST(Reader, OpenAxesOfALatticeTakeAnyEllipsoid) {
    const std::string field = R"(
[[field.ellipsoids]]
centre_m = [0, 0, 32]
semi_axes_m = [20, 20, 20]
[[field.ellipsoids]]
centre_m = [0, 0, 32]
semi_axes_m = [9000, 10, 1e6]
[[field.scatters]]
count = 2
semi_axis_x_m = 20
semi_axis_y_m = 20
semi_axis_z_m = 5000
)";
    const std::string lattice = "[lattice]\ncell_size_m = 1\ncells = [1, 512, 64]\nboundaries = ";
    const Scene scene = scene_of(lattice + "['open', 'periodic', 'open']" + field);
    EXPECT_EQ(scene.automaton.field.ellipsoids.size(), 2u);
    EXPECT_NO_THROW(check(scene.automaton));
    EXPECT_NO_THROW(scene_of(lattice + "'open'" + field));
    const std::string messages = messages_of(lattice + "['periodic', 'open', 'open']" + field);
    EXPECT_TRUE(contains(messages, "3 errors")) << messages;
}

// A scatter reaches as far as its yaw lets it, here 2.03 m along y; the limit is 16 m.
TEST(Reader, ScattersReachAsFarAsTheirYawTurnsThem) {
    const auto scene_with_yaw = [](const std::string& yaw_deg) {
        return "[lattice]\ncell_size_m = 1\ncells = [512, 1, 64]\nboundaries = ['open', 'periodic', 'open']\n"
               "[[field.scatters]]\ncount = 2\nsemi_axis_x_m = 20\nsemi_axis_y_m = 2\nsemi_axis_z_m = 5\n"
               "yaw_deg = " +
               yaw_deg;
    };
    for (const char* narrow : {"[-1, 1]", "[170, 190]", "[-181, -180]", "30"})
        EXPECT_NO_THROW(scene_of(scene_with_yaw(narrow))) << narrow;
    for (const char* wide : {"[-1, 91]", "[89, 91]", "[-360, 360]", "[200, 300]", "90"})
        EXPECT_TRUE(contains(messages_of(scene_with_yaw(wide)), "1 error")) << wide;
}

TEST(Reader, TenLinesMakeAScene) {
    const Scene scene = scene_of(R"(
name = "ten-lines"
[lattice]
cells = [64, 64, 16]
origin_m = [-1600, 0, 900]
[[field.scatters]]
count = 9
[[wind]]
levels = [{ height_m = 0, from_deg = 270, speed_m_per_s = 6 }]
)");
    EXPECT_EQ(scene.automaton.extent, (Extent{64, 64, 16}));
    ASSERT_EQ(scene.automaton.field.scatters.size(), 1u);
    const EllipsoidScatter& scatter = scene.automaton.field.scatters[0];
    EXPECT_EQ(scatter.count, 9);
    // Centres anywhere in the box, which is 64 x 64 x 16 cells of 50 m from its corner.
    EXPECT_EQ(scatter.x_m, (Range{-1600, 1600}));
    EXPECT_EQ(scatter.y_m, (Range{0, 3200}));
    EXPECT_EQ(scatter.z_m, (Range{900, 1700}));
    EXPECT_GT(scatter.semi_axis_z_m.min, 0);
    EXPECT_NO_THROW(check(scene.automaton));
    EXPECT_GT(frame_count(scene), 0);
}

TEST(Reader, EveryFormOfAValue) {
    const Scene scene = scene_of(R"(
seed = "0xFFFFFFFFFFFFFFFE"
[lattice]
cells = [1, 65536, 3]
boundaries = "periodic"
[[field.scatters]]
count = 1
x_m = 5
y_m = [-1, 2.5]
semi_axis_x_m = 700
semi_axis_y_m = 700
life_s = inf
[[field.scatters]]
count = 2
semi_axis_x_m = 700
semi_axis_y_m = 700
life_s = [300, 300.5]
[[field.ellipsoids]]
centre_m = [1, -2.5, 1e3]
centre = { hum = 1, ext = 0 }
carried = false
[density]
smoothing.kernel = "gaussian"
half = true
[sun]
colour = [0, 0.5, 1000]
)");
    EXPECT_EQ(scene.automaton.seed, 0xFFFFFFFFFFFFFFFEu);
    EXPECT_EQ(scene.automaton.extent, (Extent{1, 65536, 3}));
    EXPECT_EQ(scene.automaton.boundaries,
              (Boundaries{Boundary::periodic, Boundary::periodic, Boundary::periodic}));
    const FieldOptions& field = scene.automaton.field;
    EXPECT_EQ(field.scatters[0].x_m, (Range{5, 5}));
    EXPECT_EQ(field.scatters[0].y_m, (Range{-1, 2.5}));
    EXPECT_EQ(field.scatters[0].life_s, (Range{kForever, kForever}));
    EXPECT_EQ(field.scatters[1].life_s, (Range{300, 300.5}));
    EXPECT_EQ(field.ellipsoids[0].centre_m, (Vec3{1, -2.5, 1000}));
    EXPECT_EQ(field.ellipsoids[0].centre, (Probabilities{1, 0.001, 0})) << "act keeps its default";
    EXPECT_FALSE(field.ellipsoids[0].carried);
    EXPECT_EQ(scene.density.smoothing.kernel, SmoothingKernel::gaussian);
    EXPECT_TRUE(scene.density.half);
    EXPECT_EQ(scene.render.sun.colour, (Rgb{0, 0.5, 1000}));
}

// 270 degrees is a west wind: it blows towards east. Multiples of 90 degrees are exact.
TEST(Reader, WindByDirectionIsWhatPilotsMean) {
    const auto wind = [](const std::string& from_deg) {
        return scene_of("[[wind]]\nlevels = [{ height_m = 0, speed_m_per_s = 8, from_deg = " + from_deg +
                        " }]")
            .automaton.wind.keyframes.at(0)
            .levels.at(0)
            .velocity;
    };
    EXPECT_EQ(wind("270"), (Velocity{8, 0}));
    EXPECT_EQ(wind("0"), (Velocity{0, -8}));
    EXPECT_EQ(wind("90"), (Velocity{-8, 0}));
    EXPECT_EQ(wind("180"), (Velocity{0, 8}));
    EXPECT_EQ(wind("-90"), wind("270"));
    const double diagonal = 8 * std::sqrt(0.5);
    EXPECT_NEAR(wind("225").east_m_per_s, diagonal, 1e-14);
    EXPECT_NEAR(wind("225").north_m_per_s, diagonal, 1e-14);
    EXPECT_NEAR(wind("200").east_m_per_s, -8 * std::sin(200 * 3.14159265358979 / 180), 1e-12);
}

// File names: of the scene from the scene's folder, of an option from the current folder, absolute ones as
// they are.
TEST(Reader, FileNamesStartFromWhereTheyAreWritten) {
    const std::string text = "[lattice]\ninitial_state = \"states/../start.vdb\"";
    EXPECT_EQ(scene_of(text).initial_state_file, "folder/start.vdb");
    EXPECT_EQ(scene_of("seed = 1", {"lattice.initial_state=start.vdb"}).initial_state_file, "start.vdb");
    EXPECT_EQ(scene_of("[lattice]\ninitial_state = \"/data/start.vdb\"").initial_state_file,
              "/data/start.vdb");
}

TEST(Reader, ByteOrderMarkAndCarriageReturnsDoNotMatter) {
    const std::string plain = "name = \"crlf\"\n[time]\nsteps = 7\n";
    std::string windows = "\xEF\xBB\xBF";
    for (const char c : plain) windows += c == '\n' ? std::string("\r\n") : std::string(1, c);
    EXPECT_EQ(scene_of(windows), scene_of(plain));
}

TEST(Options, ReplaceWhatTheFileSays) {
    const std::string text = R"(
[time]
steps = 5
[[wind]]
levels = [{ height_m = 0, east_m_per_s = 1 }, { height_m = 900, east_m_per_s = 2 }]
)";
    const Scene scene =
        scene_of(text, {"time.steps=50", "wind[0].levels[1].height_m=800", "density.half=true",
                        "lattice.initial=empty", "name=by-hand", "lattice.boundaries=periodic",
                        "sun.colour=[1, 2, 3]", "field.scatters=[{count=3}]", "time.steps = 60"});
    EXPECT_EQ(scene.steps, 60u) << "the last one counts";
    EXPECT_EQ(scene.automaton.wind.keyframes[0].levels[1].height_m, 800);
    EXPECT_EQ(scene.automaton.wind.keyframes[0].levels[1].velocity.east_m_per_s, 2);
    EXPECT_TRUE(scene.density.half);
    EXPECT_EQ(scene.automaton.initial, InitialState::empty);
    EXPECT_EQ(scene.name, "by-hand");
    EXPECT_EQ(scene.automaton.boundaries.y, Boundary::periodic);
    EXPECT_EQ(scene.render.sun.colour, (Rgb{1, 2, 3}));
    EXPECT_EQ(scene.automaton.field.scatters.size(), 1u);
}

// A wrong value in the file that an option replaces is no problem any more.
TEST(Options, ReplaceWrongValuesToo) {
    EXPECT_EQ(scene_of("[time]\nsteps = \"many\"", {"time.steps=4"}).steps, 4u);
}

TEST(Options, MessagesNameTheOption) {
    EXPECT_EQ(
        messages_of("seed = 1", {"density.half=maybe"}),
        "--set density.half=maybe: error: not valid TOML: parsing value: could not determine value type\n"
        "  | density.half=maybe\n"
        "  |              ^\n"
        "  = expected true or false\n\n1 error\n");
    EXPECT_EQ(messages_of("seed = 1", {"density.half=1"}),
              "--set density.half=1: error: `density.half` is 1\n"
              "  | density.half=1\n"
              "  |              ^\n"
              "  = expected true or false\n\n1 error\n");
    EXPECT_TRUE(contains(messages_of("seed = 1", {"densty.half=true"}), "did you mean `density`?"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"density.hlf=true"}), "did you mean `half`?"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"lattice.initial=emtpy"}), "did you mean \"empty\"?"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"time.steps="}), "--set time.steps=: error:"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"time.steps=1\nseed=2"}), "more than one value"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"time.steps=99999999999999999999"}), "64 bits"));
}

// Both seeds take all 64 bits and nothing below 0, and what is written can be read again.
TEST(Options, SeedsAre64BitsWithoutASign) {
    for (const std::string key : {"seed", "fog.seed"}) {
        for (const char* bad : {"-1", "-9223372036854775808", "1.5"})
            EXPECT_TRUE(contains(messages_of("", {key + "=" + bad}), "expected an integer from 0 to 92233"));
        for (const char* good : {"0", "9223372036854775807", "\"0xffffffffffffffff\""}) {
            const Scene scene = scene_of("", {key + "=" + good});
            EXPECT_EQ(read_scene_text(to_toml(scene), "again.toml"), scene) << key << " = " << good;
        }
    }
    EXPECT_EQ(scene_of("", {"fog.seed=\"0xffffffffffffffff\""}).render.fog.seed, ~std::uint64_t{0});
}

TEST(Options, BadPathsAreRefused) {
    for (const char* option :
         {"", "=", "steps", "time.steps", "time..steps=1", ".steps=1", "time.=1", "wind[=1", "wind[x]=1",
          "wind[]=1", "wind[99999999999]=1", "wind]=1", "a b=1", "\xC3\xA4=1"}) {
        SCOPED_TRACE(option);
        const std::string messages = messages_of("seed = 1", {option});
        EXPECT_TRUE(contains(messages, std::string("--set ") + option + ": error: ")) << messages;
        EXPECT_TRUE(contains(messages, "expected --set key.path=value")) << messages;
    }
    EXPECT_TRUE(contains(messages_of("seed = 1", {"seed.x=1"}), "`seed` is an integer, it has no keys"));
    // And no more than that: no empty `wind`, which would be an error itself.
    EXPECT_EQ(messages_of("seed = 1", {"wind[0].time_s=1"}).find("error: `wind` is not in the scene"),
              messages_of("seed = 1", {"wind[0].time_s=1"}).rfind("error: "));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"camera.position_m[0]=1"}),
                         "`camera.position_m` is not in the scene"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"field.ellipsoids[0].ext=1"}),
                         "`field.ellipsoids` is not in the scene"));
    for (const auto& [option, says] : {std::pair("nosuch[0]=1", "unknown key `nosuch`"),
                                       std::pair("time.nosuch[0]=1", "unknown key `nosuch`"),
                                       std::pair("time.steps[0]=3", "`time.steps` has no items"),
                                       std::pair("time[0]=3", "`time` has no items")}) {
        const std::string messages = messages_of("seed = 1", {option});
        EXPECT_TRUE(contains(messages, says)) << messages;
        EXPECT_EQ(messages.find("error: "), messages.rfind("error: ")) << messages;
    }
    EXPECT_TRUE(contains(messages_of("seed = 1\nwind = []", {"wind[0].time_s=1"}), "`wind` has no item 0"));
    EXPECT_TRUE(contains(messages_of("seed = 1", {"field.elipsoids[0].ext=1"}), "did you mean `ellipsoids`"));
    EXPECT_TRUE(contains(messages_of("[[wind]]\nlevels=[{height_m=0, east_m_per_s=0}]", {"wind[1].time_s=1"}),
                         "it has 1 item, counted from 0"));
}

// Problems of the file and of every option come together, the file's first.
TEST(Options, ProblemsComeTogether) {
    try {
        scene_of("[time]\nstep_s = -1", {"density.refine=99", "camera.width=0"});
        FAIL();
    } catch (const SceneErrors& errors) {
        ASSERT_EQ(errors.problems().size(), 3u);
        EXPECT_EQ(errors.problems()[0].where.line, 2);
        EXPECT_EQ(errors.problems()[1].where.file, "--set camera.width=0");
        EXPECT_EQ(errors.problems()[2].where.file, "--set density.refine=99");
        EXPECT_EQ(errors.where().file, "folder/test scene.toml");
    }
}

// A frame lies where its number says, whatever the time step; the last one may lie exactly at the end.
TEST(Frames, LieWhereTheirNumberSays) {
    Scene scene;
    scene.steps = 30;
    scene.automaton.time_step_s = 10;
    scene.frames = {.per_second = 24, .time_scale = 60, .start_s = 100};
    EXPECT_EQ(frame_time_s(scene.frames, 0), 100);
    EXPECT_EQ(frame_time_s(scene.frames, 24), 160);
    EXPECT_EQ(simulated_time_s(scene), 300);
    EXPECT_EQ(frame_count(scene), 81);
    EXPECT_EQ(frame_time_s(scene.frames, 80), 300);
    scene.frames.start_s = 300;
    EXPECT_EQ(frame_count(scene), 1);
    scene.frames.start_s = 300.0001;
    EXPECT_EQ(frame_count(scene), 0);
    // Awkward numbers: the count never admits a frame beyond the end, and never leaves one out.
    for (int n = 1; n < 2000; ++n) {
        scene.frames = {.per_second = 30.0 / n, .time_scale = 7.0 / 3, .start_s = n * 0.1};
        const int count = frame_count(scene);
        if (count > 0) {
            EXPECT_LE(steps_up_to(moment_of_frame(scene, count - 1)), scene.steps);
        }
        EXPECT_GT(steps_up_to(moment_of_frame(scene, count)), scene.steps);
    }
}

// 147 / 30 s and 7 * 0.7 s are both 4.9 s, although the quotient and the product of the doubles differ.
TEST(Frames, TheLastIsNotLostToRounding) {
    const Scene scene =
        scene_of("[time]\nstep_s = 0.7\nsteps = 7\n[frames]\nper_second = 30\ntime_scale = 1\n");
    EXPECT_EQ(frame_count(scene), 148);
    Scene counted =
        scene_of("[time]\nstep_s = 0.7\nsteps = 7\n[frames]\nper_second = 30\ntime_scale = 1\ncount = 148\n");
    EXPECT_EQ(frame_count(counted), 148);
    const std::string errors = messages_of(
        "[time]\nstep_s = 0.7\nsteps = 7\n[frames]\nper_second = 30\ntime_scale = 1\ncount = 149\n");
    EXPECT_TRUE(contains(errors, "expected `frames.count` up to 148")) << errors;
}

// Without frames the other keys have no effect: a start beyond the end is no error.
TEST(Frames, CanBeNone) {
    const std::string text = "[time]\nsteps = 3\n[frames]\nenabled = false\nstart_s = 1e9\ncount = 7\n";
    const Scene scene = scene_of(text);
    EXPECT_EQ(frame_count(scene), 0);
    EXPECT_TRUE(contains(to_toml(scene), "enabled = false"));
    EXPECT_EQ(scene_of(to_toml(scene)), scene);
    EXPECT_FALSE(contains(to_toml(scene_of("[frames]\ncount = 0\n")), "enabled = false"));
    EXPECT_GT(frame_count(scene_of("[frames]\ncount = 0\n")), 0);
}

// A start so late that its quotient by the step is no 64-bit integer is refused like any other.
TEST(Frames, AStartBeyondAnyStepIsRefused) {
    const std::string errors =
        messages_of("[time]\nstep_s = 1e-9\nsteps = 7\n[frames]\nstart_s = 1e15\ncount = 1\n");
    EXPECT_TRUE(contains(errors, "`frames.start_s` is 1e+15 s, after the")) << errors;
}

// Number, steps and fractions of the frames of random scenes, against quotients of integers: everything in
// thousandths, frame n lies at (start * per_second + n * time_scale) / (per_second * step) steps.
TEST(Frames, AreThoseOfExactRationalArithmetic) {
    std::mt19937_64 random(20240717);
    const auto thousandths = [&](std::int64_t most) {  // with 0 to 3 decimals
        const std::int64_t unit = std::array<std::int64_t, 4>{1000, 100, 10, 1}[random() % 4];
        return unit * std::int64_t(1 + random() % std::uint64_t(most * 1000 / unit));
    };
    int at_the_end = 0;
    for (int n = 0; n < 20'000; ++n) {
        const std::int64_t rate = thousandths(120), scale = thousandths(n % 2 == 0 ? 2 : 60),
                           step = thousandths(n % 3 == 0 ? 1 : 20), start = n % 4 == 0 ? thousandths(50) : 0;
        Scene scene;
        scene.steps = 1 + random() % 40;
        scene.automaton.time_step_s = double(step) / 1000;
        scene.frames = {.per_second = double(rate) / 1000,
                        .time_scale = double(scale) / 1000,
                        .start_s = double(start) / 1000};
        const std::string shown = "rate " + std::to_string(rate) + " scale " + std::to_string(scale) +
                                  " step " + std::to_string(step) + " start " + std::to_string(start) +
                                  " steps " + std::to_string(scene.steps);
        const std::int64_t divisor = rate * step;
        const auto dividend = [&](std::int64_t index) { return start * rate + 1000 * index * scale; };
        const std::int64_t room = std::int64_t(scene.steps) * divisor - start * rate;
        const std::int64_t count =
            room < 0 ? 0 : std::min<std::int64_t>(room / (1000 * scale) + 1, kMaxFrames);
        ASSERT_EQ(frame_count(scene), count) << shown;
        at_the_end += count > 1 && room % (1000 * scale) == 0;
        for (std::int64_t index : {std::int64_t(0), count / 3, count / 2, count - 2, count - 1, count}) {
            if (index < 0) continue;
            const Moment moment = moment_of_frame(scene, int(index));
            ASSERT_EQ(std::int64_t(moment.step), dividend(index) / divisor) << shown << " frame " << index;
            const double fraction = double(dividend(index) % divisor) / double(divisor);
            ASSERT_NEAR(moment.fraction, fraction, 1e-12) << shown << " frame " << index;
            ASSERT_EQ(moment.fraction == 0, fraction == 0) << shown << " frame " << index;
        }
    }
    EXPECT_GT(at_the_end, 500) << "too few scenes whose last frame lies on the last step";
}

TEST(ClosestWord, FindsSlipsOnly) {
    const std::vector<std::string_view> words{"seed", "lattice", "density", "elevation_deg", "i0", "j0"};
    EXPECT_EQ(closest_word("sed", words), "seed");
    EXPECT_EQ(closest_word("lattcie", words), "lattice");
    EXPECT_EQ(closest_word("Density", words), "density");
    EXPECT_EQ(closest_word("elevation", words), "elevation_deg");
    EXPECT_EQ(closest_word("qwerty", words), "");
    EXPECT_EQ(closest_word("", words), "");
    EXPECT_EQ(closest_word(std::string(1000, 'x'), words), "");
}

// Keys of [terrain] that are of relief beside a file, and of one format beside another.
TEST(KeysWithoutEffect, NameThoseOfAnotherKindOfGround) {
    const auto notes = [](const std::string& ground, const std::string& terrain) {
        std::string all;
        for (const std::string& note :
             keys_without_effect(scene_of("[ground]\n" + ground + "\n[terrain]\n" + terrain)))
            all += note + "\n";
        return all;
    };
    const auto names = [](const std::string& text, const char* key) {
        return text.find(key) != std::string::npos;
    };
    EXPECT_TRUE(names(notes("height_map = \"a.png\"", "raw_rows = 5"), "`raw_rows`"));
    EXPECT_TRUE(names(notes("relief = \"hills\"", "raw_columns = 5"), "`raw_columns`"));
    EXPECT_TRUE(names(notes("height_map = \"a.EXR\"", "height_scale_m = 50"), "`height_scale_m`"));
    for (const char* const key : {"cells = 64", "feature_m = 400", "seed = 3"})
        EXPECT_TRUE(names(notes("height_map = \"a.png\"", key), "`ground.relief`")) << key;
    EXPECT_TRUE(names(notes("height_m = 5", "snow_line_m = 3"), "[terrain] has no effect"));
    EXPECT_EQ(notes("height_map = \"a.png\"", "height_scale_m = 50\nsnow_line_m = 3"), "");
    EXPECT_EQ(notes("height_map = \"a.r16\"", "raw_columns = 5\nraw_rows = 6\nheight_scale_m = 50"), "");
    EXPECT_EQ(notes("height_map = \"a.exr\"", "offset_m = 50"), "");
    EXPECT_EQ(notes("relief = \"ridges\"", "cells = 64\nfeature_m = 400\nseed = 3\nheight_scale_m = 9"), "");
}

// The hashes change with what they stand for, and with nothing else.
TEST(Hashes, CoverWhatTheySay) {
    const Scene scene = scene_of("name = \"hash\"\n[[field.scatters]]\ncount = 3");
    const auto with = [&](auto change) {
        Scene other = scene;
        change(other);
        return other;
    };
    EXPECT_EQ(scene_hash(scene).size(), 32u);
    EXPECT_EQ(scene_hash(scene), scene_hash(scene_of(to_toml(scene))));
    const Scene longer = with([](Scene& s) { s.steps += 100; });
    EXPECT_NE(scene_hash(scene), scene_hash(longer));
    EXPECT_EQ(simulation_hash(scene), simulation_hash(longer));
    EXPECT_EQ(frames_hash(scene), frames_hash(longer));
    EXPECT_NE(frames_hash(scene), frames_hash(with([](Scene& s) { s.render.sun.elevation_deg = 3; })));
    EXPECT_EQ(simulation_hash(scene), simulation_hash(with([](Scene& s) { s.name = "x"; })));
    EXPECT_EQ(simulation_hash(scene),
              simulation_hash(with([](Scene& s) { s.render.sun.elevation_deg = 3; })));
    EXPECT_EQ(simulation_hash(scene), simulation_hash(with([](Scene& s) { s.frames.count = 3; })));
    EXPECT_EQ(simulation_hash(scene), simulation_hash(with([](Scene& s) { s.frames.enabled = false; })));
    EXPECT_NE(scene_hash(scene), scene_hash(with([](Scene& s) { s.frames.enabled = false; })));
    EXPECT_NE(simulation_hash(scene), simulation_hash(with([](Scene& s) { s.automaton.seed = 9; })));
    EXPECT_NE(simulation_hash(scene), simulation_hash(with([](Scene& s) { s.density.smoothing.t0 = 0; })));
    EXPECT_NE(simulation_hash(scene),
              simulation_hash(with([](Scene& s) { s.automaton.field.scatters[0].count = 4; })));
    EXPECT_NE(simulation_hash(scene),
              simulation_hash(with([](Scene& s) { s.initial_state_file = "a.vdb"; })));
    EXPECT_NE(simulation_hash(scene, "0123"), simulation_hash(scene, "4567"));
}

}  // namespace
}  // namespace nephos
