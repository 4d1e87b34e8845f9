// SPDX-License-Identifier: Apache-2.0

// A run on disk without pictures: what is written, and that a run which was stopped anywhere and resumed
// leaves the same folder as one that was not.

#include "simulation/run_folder.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "core/error.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/writer.h"
#include "simulation/earlier_run.h"
#include "simulation/folder_lock.h"
#include "simulation/statistics_file.h"
#include "simulation/verify.h"
#include "tests/simulation/file_content.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class RunFolderTest : public test::SmallRun {
  protected:
    RunSettings settings(const std::string& folder) const {
        Scene scene = small_scene(6);
        scene.frames.time_scale = 15;
        scene.density.write_state = true;
        RunSettings s = settings_of(scene, folder);
        s.render = false;
        return s;
    }
};

// Everything but wall time; of a VDB file its voxels and metadata.
void expect_same_folders(const fs::path& a, const fs::path& b) {
    EXPECT_EQ(content(a / "statistics.csv"), content(b / "statistics.csv"));
    auto ja = nlohmann::json::parse(content(a / "manifest.json"));
    auto jb = nlohmann::json::parse(content(b / "manifest.json"));
    for (const char* own : {"timing", "xxh3"}) ja.erase(own);
    for (const char* own : {"timing", "xxh3"}) jb.erase(own);
    EXPECT_EQ(ja, jb);
    EXPECT_EQ(content(a / "checkpoint.nephos"), content(b / "checkpoint.nephos"));
    ASSERT_FALSE(ja["frames"].empty());
    for (const auto& frame : ja["frames"]) {
        const std::string file = frame["density"].get<std::string>();
        const LoadedDensity da = load_density(a / file), db = load_density(b / file);
        EXPECT_EQ(da.density.to_dense(), db.density.to_dense()) << file;
        EXPECT_GT(da.density.max_value() + float(frame["number"] == 1), 0) << file;
        ASSERT_TRUE(da.metadata && db.metadata) << file;
        EXPECT_EQ(*da.metadata, *db.metadata) << file;
    }
}

RunObserver stop_after(int pieces) {
    RunObserver observer;
    observer.stop = [left = pieces]() mutable { return left-- <= 0; };
    return observer;
}

TEST_F(RunFolderTest, WritesEveryFileAndNamesItInTheManifest) {
    const RunSettings s = settings("out");
    const RunReport report = run_scene(s, {});
    EXPECT_TRUE(report.complete);
    EXPECT_EQ(report.steps_reported, 7u);
    EXPECT_EQ(report.frames, 5);  // 0, 15, 30, 45, 60 s
    const auto manifest = nlohmann::json::parse(content(s.folder / "manifest.json"));
    EXPECT_EQ(manifest["complete"], true);
    EXPECT_EQ(manifest["scene_text"], s.scene_text);
    EXPECT_EQ(manifest["scene"]["hash"], s.scene_hash);
    ASSERT_EQ(manifest["frames"].size(), 5u);
    EXPECT_EQ(manifest["frames"][1]["density"], "density/small_0002.vdb");
    EXPECT_EQ(manifest["frames"][1]["time_s"], 15.0);
    EXPECT_EQ(manifest["bounds"]["voxels"], nlohmann::json({32, 24, 12}));
    std::size_t files = 0;
    for (const auto& entry : fs::recursive_directory_iterator(s.folder)) files += entry.is_regular_file();
    EXPECT_EQ(files, 5u + 3u) << "no other and no temporary file";

    // The bounds and the state's hash are in each file.
    for (int frame = 1; frame <= 5; ++frame) {
        const LoadedDensity loaded =
            load_density(s.folder / manifest["frames"][frame - 1]["density"].get<std::string>());
        EXPECT_EQ(loaded.density.extent(), s.scene.automaton.extent);
        EXPECT_EQ(loaded.metadata->state_hash,
                  manifest["frames"][frame - 1]["state_hash"].get<std::string>());
        EXPECT_EQ(loaded.metadata->time_s, 15.0 * (frame - 1));
    }
    // The last row: step 6 with the hash that the report names.
    std::string last, last_hash;
    const std::uint64_t bytes = read_statistics(
        s.folder / "statistics.csv", 7, [&](std::uint64_t, std::string_view row, const StateHash& hash) {
            last = row;
            last_hash = hash.hex();
        });
    EXPECT_EQ(bytes, fs::file_size(s.folder / "statistics.csv")) << "nothing after the last step";
    EXPECT_EQ(last_hash, report.state_hash);
    EXPECT_TRUE(last.starts_with("6,60,")) << last;
}

TEST_F(RunFolderTest, StoppedAnywhereAndResumedIsTheSame) {
    RunSettings whole = settings("whole");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    for (int pieces = 0; pieces < 40; ++pieces) {
        RunSettings s = settings("stopped");
        s.overwrite = true;
        const RunReport first = run_scene(s, stop_after(pieces));
        s.overwrite = false;
        s.resume = true;
        const RunReport second = run_scene(s, {});
        ASSERT_TRUE(second.complete);
        expect_same_folders(whole.folder, s.folder);
        if (first.complete) {
            EXPECT_GT(pieces, 15);
            return;
        }
    }
    FAIL() << "the run never came to its end";
}

TEST_F(RunFolderTest, StoppedAgainAndAgainIsTheSame) {
    RunSettings whole = settings("whole");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    RunSettings s = settings("bits");
    int rounds = 0;
    while (!run_scene(s, stop_after(2)).complete) {
        s.resume = true;
        ASSERT_LT(++rounds, 40);
    }
    EXPECT_GT(rounds, 5);
    expect_same_folders(whole.folder, s.folder);
}

// What a power cut leaves: results that are newer than the checkpoint.
TEST_F(RunFolderTest, ResultsThatAreNewerThanTheCheckpointAreReplaced) {
    RunSettings whole = settings("whole");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    RunSettings s = settings("cut");
    ASSERT_FALSE(run_scene(s, stop_after(8)).complete);
    fs::copy_file(whole.folder / "statistics.csv", s.folder / "statistics.csv",
                  fs::copy_options::overwrite_existing);
    fs::copy_file(whole.folder / "density/small_0005.vdb", s.folder / "density/small_0005.vdb");
    s.resume = true;
    ASSERT_TRUE(run_scene(s, {}).complete);
    expect_same_folders(whole.folder, s.folder);
}

std::string error_of(const RunSettings& s, ErrorCode code) {
    try {
        run_scene(s, {});
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), code) << error.what();
        return error.what();
    }
    ADD_FAILURE() << "no error";
    return "";
}

TEST_F(RunFolderTest, RefusesToResumeWhatDoesNotFit) {
    RunSettings s = settings("out");
    ASSERT_FALSE(run_scene(s, stop_after(9)).complete);
    EXPECT_NE(error_of(s, ErrorCode::usage).find("--resume"), std::string::npos)
        << "it would throw work away";

    s.resume = true;
    RunSettings other = s;
    other.scene.automaton.seed = 99;
    other.scene_hash = scene_hash(other.scene);
    other.simulation_hash = simulation_hash(other.scene);
    EXPECT_NE(error_of(other, ErrorCode::usage).find("another scene"), std::string::npos);
    RunSettings range = s;
    range.range = range_of_frames(range.scene, 1, 2);
    EXPECT_NE(error_of(range, ErrorCode::usage).find("--frames"), std::string::npos);

    RunSettings damaged = s;
    fs::resize_file(s.folder / "checkpoint.nephos", fs::file_size(s.folder / "checkpoint.nephos") / 2);
    EXPECT_NE(error_of(damaged, ErrorCode::io).find("checkpoint.nephos"), std::string::npos);
}

// One command for a driver: it starts, goes on, lengthens and skips, and never throws another run away.
TEST_F(RunFolderTest, ResumingStatisticsStartsGoesOnAndSkips) {
    const auto statistics = [&](const std::string& name, std::uint64_t steps) {
        Scene scene = settings(name).scene;
        scene.steps = steps;
        RunSettings s = run_settings(scene, "small.toml");
        s.folder = settings(name).folder;
        s.statistics_only = s.resume = true;
        s.render = s.checkpoint = false;
        s.range = {steps, 1, 0};
        return s;
    };
    const RunSettings s = statistics("out", 7);
    ASSERT_FALSE(run_scene(s, stop_after(3)).complete);
    EXPECT_TRUE(fs::exists(s.folder / "checkpoint.nephos")) << "an interrupted run leaves one";
    RunReport report = run_scene(s, {});
    EXPECT_TRUE(report.complete && !report.skipped && !report.restarted);
    EXPECT_GT(report.first_step, 0u);
    EXPECT_FALSE(fs::exists(s.folder / "checkpoint.nephos")) << "a complete one does not";
    const std::string seven = content(s.folder / "statistics.csv"), hash = report.state_hash;
    report = run_scene(s, {});
    EXPECT_TRUE(report.complete && report.skipped);
    EXPECT_EQ(report.state_hash, hash);
    EXPECT_EQ(content(s.folder / "statistics.csv"), seven);

    RunSettings longer = statistics("out", 9);
    longer.checkpoint = true;
    report = run_scene(longer, {});
    EXPECT_TRUE(report.complete && report.restarted);
    EXPECT_TRUE(content(s.folder / "statistics.csv").starts_with(seven));
    longer = statistics("out", 11);
    report = run_scene(longer, {});
    EXPECT_TRUE(report.complete && !report.restarted);
    EXPECT_EQ(report.first_step, 9u) << "the checkpoint that was asked for";

    Scene scene = longer.scene;
    scene.automaton.seed = 99;
    RunSettings other = run_settings(scene, "small.toml");
    other.folder = s.folder;
    other.statistics_only = other.resume = true;
    other.range = longer.range;
    EXPECT_NE(error_of(other, ErrorCode::usage).find("`seed` was"), std::string::npos)
        << "the key that differs";
}

// Bits, pictures and checksums are of one content of each file, or there is no run.
TEST_F(RunFolderTest, RefusesFilesThatChangeWhileItBegins) {
    const fs::path map = settings("maps").folder.parent_path() / "heights.raw";
    std::ofstream(map) << std::string(64, 'a');
    Scene scene = settings("out").scene;
    scene.render.terrain.height_map = map;
    RunSettings s = run_settings(scene, "small.toml");
    s.folder = settings("out").folder;
    s.render = false;
    std::ofstream(map) << std::string(65, 'b');
    EXPECT_NE(error_of(s, ErrorCode::io).find("heights.raw: was changed while the run began"),
              std::string::npos);
    EXPECT_FALSE(fs::exists(s.folder / "statistics.csv"));
}

// A complete run is left as it is.
TEST_F(RunFolderTest, ResumingACompleteRunWritesNothing) {
    RunSettings s = settings("out");
    ASSERT_TRUE(run_scene(s, {}).complete);
    const auto version = [&](const char* name) { return file_stamp(s.folder / name); };
    const FileStamp manifest = version("manifest.json"), checkpoint = version("checkpoint.nephos");
    s.resume = true;
    const RunReport report = run_scene(s, {});
    EXPECT_TRUE(report.complete && report.skipped);
    EXPECT_EQ(version("manifest.json"), manifest);  // another file of the same name would have another number
    EXPECT_EQ(version("checkpoint.nephos"), checkpoint);
}

TEST_F(RunFolderTest, RefusesToResumeWhenResultsAreGone) {
    RunSettings s = settings("out");
    ASSERT_FALSE(run_scene(s, stop_after(12)).complete);
    s.resume = true;
    ASSERT_TRUE(fs::remove(s.folder / "density/small_0001.vdb"));
    EXPECT_NE(error_of(s, ErrorCode::io).find("small_0001.vdb"), std::string::npos);
    std::ofstream(s.folder / "statistics.csv") << kStatisticsHeader << "0,0,1,1,1\n";
    EXPECT_NE(error_of(s, ErrorCode::io).find("statistics.csv"), std::string::npos);
}

// A shorter run after a longer one: nothing of the longer one stays, and nothing of others is touched.
TEST_F(RunFolderTest, AnEarlierRunOfTheSameNameIsReplaced) {
    RunSettings s = settings("out");
    ASSERT_TRUE(run_scene(s, {}).complete);
    std::ofstream(s.folder / "density/notes.txt") << "mine";
    std::ofstream(s.folder / "density/other_0001.vdb") << "mine";
    RunSettings shorter = s;
    shorter.range = range_of_frames(s.scene, 1, 2);
    EXPECT_THROW(run_scene(shorter, {}), Error) << "three frames would be lost";
    EXPECT_TRUE(fs::exists(s.folder / "density/small_0003.vdb"));
    shorter.overwrite = true;
    ASSERT_TRUE(run_scene(shorter, {}).complete);
    EXPECT_TRUE(fs::exists(s.folder / "density/small_0002.vdb"));
    EXPECT_FALSE(fs::exists(s.folder / "density/small_0003.vdb"));
    EXPECT_TRUE(fs::exists(s.folder / "density/notes.txt"));
    EXPECT_TRUE(fs::exists(s.folder / "density/other_0001.vdb"));
}

// Every kind of file that a run would replace, when no run wrote it.
TEST_F(RunFolderTest, WhatNoRunWroteIsNotReplacedUnasked) {
    for (const char* name : {"statistics.csv", "checkpoint.nephos", "manifest.json", "density/small_0003.vdb",
                             "frames/small_0001.png", "frames/small.mp4"}) {
        SCOPED_TRACE(name);
        RunSettings s = settings("out");
        fs::remove_all(s.folder);
        fs::create_directories((s.folder / name).parent_path());
        std::ofstream(s.folder / name) << "mine";
        const std::string message = error_of(s, ErrorCode::usage);
        EXPECT_NE(message.find(name), std::string::npos) << message;
        EXPECT_NE(message.find("--overwrite"), std::string::npos) << message;
        EXPECT_EQ(content(s.folder / name), "mine");
        s.overwrite = true;
        EXPECT_TRUE(run_scene(s, {}).complete);
    }
}

// A complete run may be replaced, but not what somebody else has put in the place of its files.
TEST_F(RunFolderTest, AFileThatReplacedARunsOwnIsNotReplacedUnasked) {
    for (const char* name : {"statistics.csv", "checkpoint.nephos"}) {
        SCOPED_TRACE(name);
        RunSettings s = settings(std::string("out of ") + name);
        ASSERT_TRUE(run_scene(s, {}).complete);
        ASSERT_TRUE(run_scene(s, {}).complete);
        std::ofstream(s.folder / name) << "mine";
        EXPECT_NE(error_of(s, ErrorCode::usage).find(name), std::string::npos);
        EXPECT_EQ(content(s.folder / name), "mine");
    }
}

TEST_F(RunFolderTest, TwoRunsCannotWriteIntoOneFolder) {
    RunSettings s = settings("out");
    {
        const FolderLock other(s.folder, "run");
        ASSERT_TRUE(other.held());
        EXPECT_NE(error_of(s, ErrorCode::io).find("another run"), std::string::npos);
        EXPECT_TRUE(fs::is_empty(s.folder)) << "nothing was written";
    }
    EXPECT_TRUE(run_scene(s, {}).complete);
    const FolderLock other(s.folder, "run");
    s.resume = true;
    EXPECT_NE(error_of(s, ErrorCode::io).find("another run"), std::string::npos);
}

// What SIGKILL leaves: only what this run's files would be called goes, and only without another run at work.
TEST_F(RunFolderTest, TemporaryFilesOfAKilledRunAreRemoved) {
    RunSettings s = settings("out");
    fs::create_directories(s.folder / "density");
    fs::create_directories(s.folder / "frames");
    const char* ours[] = {".manifest.part12-34.json",         ".checkpoint.part12-34.nephos",
                          ".statistics.part12-34.csv",        "density/.small_0002.part12-34.vdb",
                          "frames/.small_0002.part12-34.png", "frames/.small.part12-34.mp4"};
    const char* others[] = {".notes.part12-34.txt", "manifest.part12-34.json", ".manifest.part12.json",
                            "density/.other_0002.part12-34.vdb", "density/.small_0002.partial.vdb"};
    for (const char* name : ours) std::ofstream(s.folder / name) << "part";
    for (const char* name : others) std::ofstream(s.folder / name) << "mine";
    {
        const FolderLock other(s.folder, "run");
        error_of(s, ErrorCode::io);
        for (const char* name : ours) EXPECT_TRUE(fs::exists(s.folder / name)) << name;
    }
    EXPECT_TRUE(run_scene(s, {}).complete);
    for (const char* name : ours) EXPECT_FALSE(fs::exists(s.folder / name)) << name;
    for (const char* name : others) EXPECT_TRUE(fs::exists(s.folder / name)) << name;
}

// Rows are appended at checkpoints and never written again; a part of a row is cut off.
TEST_F(RunFolderTest, StatisticsAreAppended) {
    RunSettings s = settings("out");
    s.checkpoint_every_s = 0;
    std::string before;
    ino_t file = 0;
    RunObserver observer;
    observer.progress = [&](const RunProgress&) {
        struct stat status {};
        ASSERT_EQ(::stat((s.folder / "statistics.csv").c_str(), &status), 0);
        EXPECT_TRUE(file == 0 || status.st_ino == file) << "the file was replaced";
        file = status.st_ino;
        const std::string now = content(s.folder / "statistics.csv");
        EXPECT_TRUE(now.starts_with(before));
        EXPECT_TRUE(now.ends_with('\n'));
        before = now;
    };
    ASSERT_TRUE(run_scene(s, observer).complete);
    EXPECT_EQ(std::count(before.begin(), before.end(), '\n'), 1 + 7);

    RunSettings cut = settings("cut");
    ASSERT_FALSE(run_scene(cut, stop_after(8)).complete);
    std::ofstream(cut.folder / "statistics.csv", std::ios::app) << "3,30,12";
    cut.resume = true;
    ASSERT_TRUE(run_scene(cut, {}).complete);
    expect_same_folders(s.folder, cut.folder);
}

TEST_F(RunFolderTest, AResumeThatDiffersInTheVideoSaysSo) {
    RunSettings s = settings("out");
    ASSERT_FALSE(run_scene(s, stop_after(9)).complete);
    s.resume = true;
    s.scene.frames.video = true;
    s.scene_hash = scene_hash(s.scene);
    const std::string message = error_of(s, ErrorCode::usage);
    EXPECT_NE(message.find("the first call was without --video"), std::string::npos) << message;
}

// Complete or interrupted anywhere, a run goes on with more steps: all that it has written is what a run which had them
// from the start writes, and is what it claims to be.
TEST_F(RunFolderTest, GoesOnWithMoreStepsAsIfItHadHadThem) {
    RunSettings whole = settings("whole");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    for (int pieces = 3; pieces < 40; pieces += 4) {
        SCOPED_TRACE(pieces);
        RunSettings s = settings("longer");
        s.overwrite = true;
        s.scene.steps = 4;
        s.scene_text = to_toml(s.scene);
        s.scene_hash = scene_hash(s.scene);
        s.range = full_range(s.scene);
        ASSERT_LT(s.range.last_frame, whole.range.last_frame);
        const RunReport first = run_scene(s, stop_after(pieces));
        RunSettings longer = settings("longer");
        longer.resume = true;
        ASSERT_TRUE(run_scene(longer, {}).complete);
        expect_same_folders(whole.folder, s.folder);
        for (const Check& check : verify_run(s.folder, {}).checks) EXPECT_TRUE(check.passed) << check.detail;
        if (!first.complete) continue;
        s.overwrite = false;
        s.resume = true;
        EXPECT_NE(error_of(s, ErrorCode::usage).find("another scene"), std::string::npos) << "shorter again";
        return;
    }
    FAIL() << "the shorter run never came to its end";
}

// Statistics come from the bits: all columns but the density's mean and optical cover.
TEST_F(RunFolderTest, StatisticsAloneAreThoseOfTheBits) {
    RunSettings whole = settings("whole");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    RunSettings s = settings("statistics");
    s.statistics_only = true;
    s.scene.frames.count = 1000;  // more than fit: none is written
    s.scene_hash = scene_hash(s.scene);
    ASSERT_FALSE(run_scene(s, stop_after(5)).complete);
    s.resume = true;
    ASSERT_TRUE(run_scene(s, {}).complete);
    std::istringstream all(content(whole.folder / "statistics.csv")),
        alone(content(s.folder / "statistics.csv"));
    int rows = 0;
    for (std::string expected, row; std::getline(all, expected); ++rows) {
        ASSERT_TRUE(std::getline(alone, row));
        if (rows > 0) {
            const std::size_t hash = expected.rfind(','), cover = expected.rfind(',', hash - 1);
            const std::size_t mean = expected.rfind(',', cover - 1);
            expected.replace(mean + 1, hash - mean - 1, ",");
        }
        EXPECT_EQ(row, expected);
    }
    EXPECT_EQ(rows, 1 + 7);
}

TEST_F(RunFolderTest, AFolderThatCannotBeMadeIsFoundBeforeAnything) {
    RunSettings s = settings("file");
    std::ofstream(s.folder) << "a file";
    EXPECT_NE(error_of(s, ErrorCode::io).find(s.folder.string()), std::string::npos);
}

}  // namespace
}  // namespace nephos
