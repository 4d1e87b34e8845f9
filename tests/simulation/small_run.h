// SPDX-License-Identifier: Apache-2.0
#pragma once

// A small run in a folder of its own that goes with the test, for tests of what a run writes.

#include <filesystem>
#include <string>

#include <gtest/gtest.h>
#include <unistd.h>

#include "scenes/format/writer.h"
#include "simulation/run_folder.h"

namespace nephos::test {

class SmallRun : public testing::Test {
  protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        base_ =
            std::filesystem::temp_directory_path() / ("nephos " + std::string(info->test_suite_name()) + " " +
                                                      info->name() + " " + std::to_string(::getpid()));
        std::filesystem::create_directories(base_);
    }
    void TearDown() override { std::filesystem::remove_all(base_); }

    // `steps` steps, a frame each.
    static Scene small_scene(int steps) {
        Scene scene;
        scene.name = "small";
        scene.automaton.extent = {32, 24, 12};
        scene.automaton.field.background = {0.15, 0.01, 0.05};
        scene.steps = steps;
        scene.frames.per_second = 1;
        scene.frames.time_scale = scene.automaton.time_step_s;
        return scene;
    }

    RunSettings settings_of(const Scene& scene, const std::string& folder) const {
        RunSettings s;
        s.scene = scene;
        s.scene_file = "small.toml";
        s.scene_text = to_toml(scene);
        s.scene_hash = scene_hash(scene);
        s.simulation_hash = simulation_hash(scene);
        s.range = full_range(scene);
        s.folder = base_ / folder;
        return s;
    }

    std::filesystem::path base_;
};

}  // namespace nephos::test
