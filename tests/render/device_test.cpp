// SPDX-License-Identifier: Apache-2.0
// Choosing a device, missing devices, and the validation layer itself.

#include <cstdlib>
#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "render/renderer_test_access.h"

namespace nephos {
namespace {

// Runs in a process of its own, because the loader reads the environment once. True when `works` returns true
// there.
bool in_child(const std::function<bool()>& works) {
    const pid_t child = ::fork();
    if (child == 0) {
        bool good = false;
        try {
            good = works();
        } catch (...) {
        }
        ::_exit(good ? 0 : 1);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

TEST(Device, ValidationSeesASeededHazard) {
    Renderer renderer({{}, true, 2048});
    EXPECT_TRUE(renderer.validation_messages().empty());
    RendererTestAccess::provoke_hazard(renderer);
    const std::vector<std::string> messages = renderer.validation_messages();
    ASSERT_FALSE(messages.empty());
    EXPECT_NE(messages.front().find("SYNC-HAZARD-WRITE-AFTER-WRITE"), std::string::npos) << messages.front();
}

TEST(Device, IsFoundByNameAndNumber) {
    const std::vector<std::string> names = device_names();
    ASSERT_FALSE(names.empty());
    EXPECT_EQ(Renderer({names[0], false, 2048}).device_name(), names[0]);
    EXPECT_EQ(Renderer({"0", false, 2048}).device_name(), names[0]);
}

TEST(Device, UnknownNameListsWhatThereIs) {
    try {
        Renderer renderer({"no such device", false, 2048});
        FAIL() << "a device of this name exists?";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find(device_names().at(0)), std::string::npos) << error.what();
    }
}

TEST(Device, EnvironmentChooses) {
    EXPECT_TRUE(in_child([] {
        ::setenv("NEPHOS_DEVICE", "no such device", 1);
        try {
            Renderer renderer;
        } catch (const Error& error) {
            return error.code() == ErrorCode::usage;
        }
        return false;
    }));
}

TEST(Device, NoDriverSaysWhatToInstall) {
    EXPECT_TRUE(in_child([] {
        ::setenv("VK_ICD_FILENAMES", "/nonexistent/driver.json", 1);
        ::setenv("VK_DRIVER_FILES", "/nonexistent/driver.json", 1);
        try {
            Renderer renderer;
        } catch (const Error& error) {
            return error.code() == ErrorCode::gpu &&
                   std::string(error.what()).find("mesa-vulkan-drivers") != std::string::npos;
        }
        return false;
    }));
}

TEST(Device, BadTileSizeIsAnError) { EXPECT_THROW(Renderer({{}, false, 1}), Error); }

}  // namespace
}  // namespace nephos
