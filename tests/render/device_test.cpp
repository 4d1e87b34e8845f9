// SPDX-License-Identifier: Apache-2.0
// Choosing a device, missing devices, and the validation layer itself.

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <string>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "tests/render/renderer_test_access.h"
#include "tests/scoped_variable.h"

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
    Renderer renderer({.validation = true, .splatting = Splatting::blended});
    EXPECT_TRUE(renderer.validation_messages().empty());
    RendererTestAccess::provoke_hazard(renderer);
    const std::vector<std::string> messages = renderer.validation_messages();
    ASSERT_FALSE(messages.empty());
    EXPECT_NE(messages.front().find("SYNC-HAZARD-WRITE-AFTER-WRITE"), std::string::npos) << messages.front();
}

// The validation layer's GPU-assisted checks are switched on by its own variable.
TEST(Device, GpuAssistedValidationSeesASeededOverrun) {
    const test::ScopedVariable enabled("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_GPU_ASSISTED_EXT");
    Renderer renderer({.validation = true, .splatting = Splatting::vulkan});
    const auto says_so = [&] {
        return std::ranges::any_of(renderer.validation_messages(), [](const std::string& message) {
            return message.find("out of bounds") != std::string::npos;
        });
    };
    EXPECT_FALSE(says_so());
    RendererTestAccess::provoke_overrun(renderer);
    EXPECT_TRUE(says_so());
}

TEST(Device, IsFoundByNameAndNumber) {
    const std::vector<std::string> names = device_names();
    ASSERT_FALSE(names.empty());
    for (const Splatting splatting : {Splatting::vulkan, Splatting::blended}) {
        EXPECT_EQ(Renderer({.device = names[0], .splatting = splatting}).device_name(), names[0]);
        EXPECT_EQ(Renderer({.device = "0", .splatting = splatting}).device_name(), names[0]);
    }
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

// Runs in a process whose loader finds no driver.
bool without_driver(const std::function<bool()>& works) {
    return in_child([&] {
        ::setenv("VK_ICD_FILENAMES", "/nonexistent/driver.json", 1);
        ::setenv("VK_DRIVER_FILES", "/nonexistent/driver.json", 1);
        return works();
    });
}

bool says_what_to_install(const DeviceOptions& options) {
    try {
        Renderer renderer(options);
    } catch (const Error& error) {
        return error.code() == ErrorCode::gpu &&
               std::string(error.what()).find("mesa-vulkan-drivers") != std::string::npos;
    }
    return false;
}

TEST(Device, NoDriverSaysWhatToInstallWhereOneIsAskedFor) {
    for (const DeviceOptions& options :
         {DeviceOptions{.splatting = Splatting::vulkan}, DeviceOptions{.splatting = Splatting::blended},
          DeviceOptions{.device = "llvmpipe"}, DeviceOptions{.device = "0"}}) {
        EXPECT_TRUE(without_driver([&] { return says_what_to_install(options); }))
            << int(options.splatting) << " " << options.device;
    }
    EXPECT_TRUE(without_driver([] {
        ::setenv("NEPHOS_DEVICE", "llvmpipe", 1);
        return says_what_to_install({});
    }));
}

TEST(Device, CpuTakesNoDriver) {
    for (const Splatting splatting : {Splatting::automatic, Splatting::cpu}) {
        EXPECT_TRUE(without_driver([&] {
            Renderer renderer({.splatting = splatting});
            const Picture picture = renderer.draw({}, {});
            return renderer.backend_name() == "cpu" && renderer.device_name().starts_with("cpu (") &&
                   !picture.beauty.empty();
        })) << int(splatting);
    }
}

// lavapipe is a device of type CPU: what draws there without being asked for is the processor itself.
TEST(Device, AutomaticTakesVulkanOnGraphicsCardsAlone) {
    Renderer automatic, vulkan({.splatting = Splatting::vulkan});
    const bool software = vulkan.device_name().starts_with("llvmpipe");
    EXPECT_EQ(automatic.backend_name(), software ? "cpu" : "vulkan");
    EXPECT_EQ(vulkan.backend_name(), "vulkan");
    EXPECT_EQ(Renderer({.splatting = Splatting::blended}).backend_name(), "blended");
    const Renderer named({.device = vulkan.device_name()});
    EXPECT_EQ(named.backend_name(), "vulkan") << "a device that is asked for is used";
}

TEST(Device, OneForTheProcessorIsAnError) {
    try {
        Renderer renderer({.device = "llvmpipe", .splatting = Splatting::cpu});
        FAIL() << "the device would go unused";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        EXPECT_NE(std::string(error.what()).find("\"llvmpipe\""), std::string::npos) << error.what();
    }
}

TEST(Device, BadTileSizeIsAnError) { EXPECT_THROW(Renderer({{}, false, 1}), Error); }

}  // namespace
}  // namespace nephos
