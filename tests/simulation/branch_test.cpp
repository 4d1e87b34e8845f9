// SPDX-License-Identifier: Apache-2.0

// Runs that branch off another one at its checkpoint (simulation/branch.h).

#include "simulation/branch.h"

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "simulation/statistics_file.h"
#include "tests/simulation/file_content.h"
#include "tests/simulation/small_run.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class BranchTest : public test::SmallRun {
  protected:
    RunSettings settings(std::uint64_t steps, const std::string& folder, double ext = -1) const {
        Scene scene = small_scene(int(steps));
        scene.frames.time_scale = 15;
        if (ext >= 0) scene.automaton.field.background.ext = ext;
        RunSettings s = settings_of(scene, folder);
        s.render = false;
        return s;
    }
    std::vector<std::string> rows(const fs::path& folder, std::uint64_t steps) const {
        std::vector<std::string> all;
        read_statistics(folder / "statistics.csv", steps,
                        [&](std::uint64_t, std::string_view row, const StateHash&) { all.emplace_back(row); });
        return all;
    }
};

// Nothing changed but the number of steps: one long run, cut in two folders.
TEST_F(BranchTest, WithoutChangesIsTheLongRun) {
    RunSettings whole = settings(14, "whole"), first = settings(6, "first"), branch = settings(14, "branch");
    ASSERT_TRUE(run_scene(whole, {}).complete);
    ASSERT_TRUE(run_scene(first, {}).complete);
    branch_off(branch, first.folder);
    const RunReport report = run_scene(branch, {});
    EXPECT_TRUE(report.complete);
    EXPECT_EQ(rows(branch.folder, 15), rows(whole.folder, 15));
    const auto frames_of = [](const fs::path& folder) {
        return nlohmann::json::parse(content(folder / "manifest.json"))["frames"];
    };
    const auto of_whole = frames_of(whole.folder), of_branch = frames_of(branch.folder);
    ASSERT_FALSE(of_branch.empty());
    EXPECT_EQ(of_branch.front()["number"], frames_of(first.folder).back()["number"].get<int>() + 1);
    for (const auto& frame : of_branch) {
        const auto& same = of_whole[frame["number"].get<std::size_t>() - 1];
        EXPECT_EQ(frame["state_hash"], same["state_hash"]);
        EXPECT_EQ(frame["time_s"], same["time_s"]);
    }
}

TEST_F(BranchTest, RefusesACheckpointThatWasWrittenMeanwhile) {
    RunSettings first = settings(6, "first"), later = settings(7, "later"), branch = settings(14, "branch");
    ASSERT_TRUE(run_scene(first, {}).complete);
    ASSERT_TRUE(run_scene(later, {}).complete);
    branch_off(branch, first.folder);
    fs::copy_file(later.folder / "checkpoint.nephos", first.folder / "checkpoint.nephos",
                  fs::copy_options::overwrite_existing);
    try {
        run_scene(branch, {});
        FAIL() << "the manifest would name another checkpoint than the one that the run began with";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find("was changed while the branch began"), std::string::npos)
            << error.what();
    }
    EXPECT_FALSE(fs::exists(branch.folder / "manifest.json"));
}

TEST_F(BranchTest, GoesAnotherWayUnderAnotherScene) {
    RunSettings first = settings(6, "first"), drier = settings(12, "drier", 0.9);
    ASSERT_TRUE(run_scene(first, {}).complete);
    branch_off(drier, first.folder / "checkpoint.nephos");
    EXPECT_NE(drier.simulation_hash, settings(12, "x", 0.9).simulation_hash) << "it is not a run from the start";
    ASSERT_TRUE(run_scene(drier, {}).complete);
    RunSettings same = settings(12, "same");
    branch_off(same, first.folder);
    ASSERT_TRUE(run_scene(same, {}).complete);
    const auto a = rows(drier.folder, 13), b = rows(same.folder, 13), past = rows(first.folder, 7);
    for (std::size_t step = 0; step < 7; ++step) EXPECT_EQ(a[step], past[step]) << "the past is shared";
    EXPECT_NE(a[12], b[12]);
    EXPECT_EQ(nlohmann::json::parse(content(drier.folder / "manifest.json"))["complete"], true);
}

TEST_F(BranchTest, ThatIsStoppedGoesOnWhenResumed) {
    RunSettings first = settings(6, "first"), whole = settings(12, "whole", 0.5);
    ASSERT_TRUE(run_scene(first, {}).complete);
    branch_off(whole, first.folder);
    ASSERT_TRUE(run_scene(whole, {}).complete);
    RunSettings stopped = settings(12, "stopped", 0.5);
    branch_off(stopped, first.folder);
    RunObserver observer;
    observer.stop = [left = 5]() mutable { return left-- <= 0; };
    EXPECT_FALSE(run_scene(stopped, observer).complete);
    stopped.resume = true;
    EXPECT_TRUE(run_scene(stopped, {}).complete);
    EXPECT_EQ(rows(stopped.folder, 13), rows(whole.folder, 13));
}

TEST_F(BranchTest, TakesTheSceneBesideTheCheckpoint) {
    RunSettings first = settings(6, "first");
    ASSERT_TRUE(run_scene(first, {}).complete);
    EXPECT_EQ(read_scene_text(scene_text_beside(first.folder), "again.toml"), first.scene);
    EXPECT_EQ(read_scene_text(scene_text_beside(first.folder / "checkpoint.nephos"), "again.toml"), first.scene);
}

TEST_F(BranchTest, RefusesWhatDoesNotFit) {
    RunSettings first = settings(6, "first");
    ASSERT_TRUE(run_scene(first, {}).complete);
    const auto error_of = [&](RunSettings s, const fs::path& from) -> std::string {
        try {
            branch_off(s, from);
            run_scene(s, {});
            return "none";
        } catch (const Error& error) {
            return error.what();
        }
    };
    RunSettings larger = settings(12, "larger");
    larger.scene.automaton.extent.x += 8;
    EXPECT_NE(error_of(larger, first.folder).find("does not fit the changed scene"), std::string::npos)
        << error_of(larger, first.folder);
    EXPECT_NE(error_of(settings(2, "short"), first.folder).find("expected more `time.steps`"), std::string::npos);
    const auto refused = [&](const fs::path& from) { return error_of(settings(12, "none"), from); };
    const std::string expected = ": expected the folder of a run, or its checkpoint";
    const fs::path nowhere = first.folder / "nowhere", file = first.folder / "manifest.json";
    EXPECT_EQ(refused(nowhere), nowhere.string() + ": no such run" + expected);
    EXPECT_EQ(refused(file), file.string() + ": is no checkpoint of a run" + expected);
    EXPECT_EQ(refused(base_), base_.string() + ": holds no checkpoint of a run" + expected);
    EXPECT_THROW(scene_text_beside(nowhere), Error);
    RunSettings same_folder = settings(12, "first");
    same_folder.overwrite = true;
    EXPECT_NE(error_of(same_folder, first.folder).find("expected another one"), std::string::npos);
    EXPECT_EQ(rows(first.folder, 7).size(), 7u) << "nothing of it was lost";
}

}  // namespace
}  // namespace nephos
