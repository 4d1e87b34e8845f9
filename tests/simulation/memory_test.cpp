// SPDX-License-Identifier: Apache-2.0
// A scene that does not fit is refused with both figures, whatever it is that limits the memory.

#include "simulation/memory.h"

#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "automaton/automaton.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMebi = 1 << 20;
constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();

// A file system of the kernel's files, made by hand.
class FakeSystem {
  public:
    FakeSystem()
        : root_(fs::path(testing::TempDir()) / ("nephos_memory_test_" + std::to_string(::getpid()))) {
        fs::remove_all(root_);
    }
    ~FakeSystem() { fs::remove_all(root_); }
    FakeSystem& file(const std::string& path, const std::string& text) {
        fs::create_directories((root_ / path).parent_path());
        std::ofstream(root_ / path) << text;
        return *this;
    }
    AvailableMemory available() const { return available_memory(root_); }

  private:
    fs::path root_;
};

TEST(AvailableMemory, IsTheFreeMemoryOfTheMachine) {
    FakeSystem system;
    EXPECT_EQ(system.available().bytes, kMost) << "nothing to read, nothing limits";
    system.file("proc/meminfo", "MemTotal: 9000 kB\nMemFree: 10 kB\nMemAvailable:    2048 kB\n");
    EXPECT_EQ(system.available().bytes, 2 * kMebi);
    EXPECT_EQ(system.available().limit, "free memory of the machine");
}

TEST(AvailableMemory, IsWhatControlGroupsOfVersion2Leave) {
    FakeSystem system;
    system.file("proc/meminfo", "MemAvailable: 9000000 kB\n").file("proc/self/cgroup", "0::/outer/inner\n");
    system.file("sys/fs/cgroup/outer/inner/memory.max", "max\n")
        .file("sys/fs/cgroup/outer/inner/memory.current", "5\n");
    EXPECT_EQ(system.available().bytes, std::size_t(9000000) * 1024);
    // The limit of an outer group holds, too; files in the cache count as free.
    system.file("sys/fs/cgroup/outer/memory.max", std::to_string(100 * kMebi))
        .file("sys/fs/cgroup/outer/memory.current", std::to_string(70 * kMebi))
        .file("sys/fs/cgroup/outer/memory.stat",
              "anon 5\ninactive_file " + std::to_string(20 * kMebi) + "\n");
    EXPECT_EQ(system.available().bytes, 50 * kMebi);
    EXPECT_EQ(system.available().limit, "memory limit of the control group");
    system.file("sys/fs/cgroup/memory.max", std::to_string(30 * kMebi))
        .file("sys/fs/cgroup/memory.current", std::to_string(40 * kMebi));
    EXPECT_EQ(system.available().bytes, 0u) << "more is taken than allowed";
}

TEST(AvailableMemory, IsWhatControlGroupsOfVersion1Leave) {
    FakeSystem system;
    system.file("proc/self/cgroup", "5:cpu,cpuacct:/a\n4:memory:/job\n")
        .file("sys/fs/cgroup/memory/job/memory.limit_in_bytes", std::to_string(64 * kMebi))
        .file("sys/fs/cgroup/memory/job/memory.usage_in_bytes", std::to_string(60 * kMebi))
        .file("sys/fs/cgroup/memory/job/memory.stat",
              "total_inactive_file " + std::to_string(8 * kMebi) + "\n");
    EXPECT_EQ(system.available().bytes, 12 * kMebi);
}

TEST(AvailableMemory, SurvivesAnyContent) {
    FakeSystem system;
    system.file("proc/meminfo", "MemAvailable: lots\n")
        .file("proc/self/cgroup", "::\nnonsense\n0::/../..\n:memory:\n");
    EXPECT_EQ(system.available().bytes, kMost);
}

// The shadow memory of sanitizers is larger than the limit that is set here.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(AvailableMemory, IsWhatTheAddressSpaceLeaves) {
    rlimit before{};
    ASSERT_EQ(getrlimit(RLIMIT_AS, &before), 0);
    constexpr std::size_t kLimit = std::size_t(64) << 30;
    if (before.rlim_cur < kLimit) GTEST_SKIP() << "a lower limit is set already";
    rlimit lower = before;
    lower.rlim_cur = kLimit;
    ASSERT_EQ(setrlimit(RLIMIT_AS, &lower), 0);
    const AvailableMemory limited = FakeSystem().available();
    ASSERT_EQ(setrlimit(RLIMIT_AS, &before), 0);
    EXPECT_EQ(limited.bytes, kLimit) << "without proc/self/statm nothing is taken yet";
    EXPECT_EQ(limited.limit, "address space limit of the process (ulimit -v)");
}
#endif

TEST(AvailableMemory, OfThisMachineIsPlausible) {
    const AvailableMemory available = available_memory();
    EXPECT_GT(available.bytes, kMebi);
    EXPECT_LT(available.bytes, std::size_t(1) << 50);
}

TEST(MemoryEstimate, GrowsWithItsPartsAndNeverOverflows) {
    Scene scene;
    const MemoryEstimate plain = memory_estimate(scene);
    EXPECT_EQ(plain.automaton, Automaton::memory_bytes(scene.automaton));
    EXPECT_GT(plain.density, scene.automaton.extent.cells()) << "floats for a good part of the cells";
    EXPECT_GT(plain.pictures, 640u * 480u * 4u);
    EXPECT_EQ(memory_estimate(scene, RunParts::density).pictures, 0u);
    EXPECT_EQ(memory_estimate_bytes(scene), plain.program + plain.automaton + plain.density + plain.pictures);
    scene.density.write_velocity = true;
    EXPECT_GT(memory_estimate(scene).density, plain.density + 12 * scene.automaton.extent.cells());
    scene.density.refine = 4;
    EXPECT_GT(memory_estimate(scene).density, plain.density + 64 * 4 * scene.automaton.extent.cells());
    scene.automaton.extent = {kMaxExtent, kMaxExtent, kMaxExtent};
    scene.density.refine = 8;
    EXPECT_GT(memory_estimate_bytes(scene), std::size_t(1) << 58);
}

// Statistics come from the bits: the lattice and a checkpoint of it, no grid.
TEST(MemoryEstimate, OfStatisticsHoldsNoGrids) {
    Scene scene;
    scene.automaton.extent = {8192, 8192, 64};
    const MemoryEstimate estimate = memory_estimate(scene, RunParts::statistics);
    EXPECT_EQ(estimate.density, 0u);
    EXPECT_EQ(estimate.pictures, 0u);
    EXPECT_LT(estimate.total(), 3 * Automaton::memory_bytes(scene.automaton));
    EXPECT_GT(memory_estimate_bytes(scene, RunParts::density), 5 * estimate.total());
}

TEST(CheckMemory, NamesBothFiguresAndWhatToChange) {
    Scene scene;
    scene.automaton.extent = {4096, 4096, 1024};
    EXPECT_NO_THROW(check_memory(scene, {kMost, "no limit"}));
    try {
        check_memory(scene, {3 * 1024 * kMebi, "free memory of the machine"});
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::usage);
        const std::string message = error.what();
        for (const std::string& part : {bytes_text(memory_estimate_bytes(scene)), std::string("3.0 GiB"),
                                        std::string("free memory of the machine"),
                                        std::string("lattice.cells"), std::string("4096 x 4096 x 1024")}) {
            EXPECT_NE(message.find(part), std::string::npos) << part << " in: " << message;
        }
    }
    const std::size_t needed = memory_estimate_bytes(scene, RunParts::density);
    EXPECT_NO_THROW(check_memory(scene, {needed, "limit"}, RunParts::density));
    EXPECT_THROW(check_memory(scene, {needed - 1, "limit"}, RunParts::density), Error);
}

TEST(BytesText, PicksTheUnit) {
    EXPECT_EQ(bytes_text(0), "0 bytes");
    EXPECT_EQ(bytes_text(1023), "1023 bytes");
    EXPECT_EQ(bytes_text(1536), "1.5 KiB");
    EXPECT_EQ(bytes_text(std::size_t(99) << 20), "99.0 MiB");
    EXPECT_EQ(bytes_text(std::size_t(300) << 20), "300 MiB");
    EXPECT_EQ(bytes_text(std::size_t(5) << 40), "5.0 TiB");
    EXPECT_EQ(bytes_text(kMost), "16.0 EiB");
}

}  // namespace
}  // namespace nephos
