// SPDX-License-Identifier: Apache-2.0
// Paths lead where the system goes, new folders are there as a whole, and a file that was exchanged has another stamp.

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "core/error.h"
#include "core/file_stamp.h"
#include "core/paths.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class Files : public testing::Test {
  protected:
    Files() {
        std::string name = (fs::temp_directory_path() / "nephos files XXXXXX").string();
        if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot create a temporary folder");
        folder = fs::canonical(name);
    }
    ~Files() override {
        std::error_code ignored;
        fs::remove_all(folder, ignored);
    }
    fs::path write(const fs::path& name, const std::string& text) const {
        fs::create_directories((folder / name).parent_path());
        std::ofstream(folder / name) << text;
        return folder / name;
    }

    fs::path folder;
};

TEST_F(Files, PathsWithoutLinksAreNormalByTheirText) {
    write("a/x", "x");
    EXPECT_EQ(normal_path(folder / "a/./x"), folder / "a/x");
    EXPECT_EQ(normal_path(folder / "a/../a//x"), folder / "a/x");
    EXPECT_EQ(normal_path("nothere/../x"), "x");
    EXPECT_EQ(normal_path(folder / "nothere/deep/../../x"), folder / "x");
    EXPECT_EQ(normal_path("x"), "x");
    EXPECT_EQ(normal_path(""), "");
}

TEST_F(Files, PathsGoBackThroughLinksAsTheSystemDoes) {
    const fs::path right = write("real/x", "right");
    write("x", "wrong");
    fs::create_directories(folder / "real/deep");
    fs::create_directory_symlink("real/deep", folder / "link");
    EXPECT_EQ(normal_path(folder / "link/../x"), right);
    EXPECT_EQ(normal_path(folder / "link/.."), folder / "real");
    EXPECT_EQ(normal_path(folder / "link/../new"), folder / "real/new") << "also where there is no such file yet";
    // A file that is a link keeps its own name.
    fs::create_symlink("x", folder / "real/named");
    EXPECT_EQ(normal_path(folder / "link/../named"), folder / "real/named");
    // A link that leads nowhere else is none to think of.
    fs::create_directory_symlink("real", folder / "same");
    EXPECT_EQ(normal_path(folder / "same/../x"), folder / "x");
}

TEST_F(Files, AFileIsReachedThroughEachOfItsLinks) {
    const fs::path file = write("disk/x", "x");
    EXPECT_EQ(paths_to(file), std::vector{file});
    fs::create_directories(folder / "run");
    fs::create_directories(folder / "desk");
    fs::create_directory_symlink("../disk", folder / "run/density");
    fs::create_symlink("../run/density/x", folder / "desk/short");
    fs::create_symlink(folder / "desk/short", folder / "desk/whole");
    const std::vector<fs::path> paths = paths_to(folder / "desk/whole");
    EXPECT_EQ(paths, (std::vector{folder / "desk/whole", folder / "desk/short",
                                  folder / "desk/../run/density/x", folder / "desk/../run/../disk/x"}));
    for (const fs::path& path : paths) EXPECT_TRUE(is_same_place(path, file)) << path;
    // Each folder above is one that the system knows by that path.
    EXPECT_EQ(holder_of(paths[2]), folder / "desk/../run/density");
    EXPECT_EQ(holder_of(holder_of(paths[2])), folder / "desk/../run");
    EXPECT_EQ(holder_of("x"), ".");
    EXPECT_EQ(holder_of("."), "./..");
    EXPECT_EQ(holder_of("a/.."), "a/../..");
    EXPECT_EQ(holder_of("a/b/"), "a");
    EXPECT_TRUE(is_same_place(holder_of("/"), "/"));
    fs::create_symlink("circle", folder / "circle");
    EXPECT_LE(paths_to(folder / "circle").size(), 41U);
    EXPECT_EQ(paths_to(folder / "nothere/x").size(), 1U);
}

TEST_F(Files, FoldersAreCreatedWithThoseAboveThem) {
    create_folders(folder / "a/b/c/");
    EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
    create_folders(folder / "a/b/c");
    const fs::path file = write("file", "x");
    try {
        create_folders(file / "below");
        FAIL() << "a file holds no folders";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find("file/below: cannot create the folder"), std::string::npos)
            << error.what();
    }
}

void set_time(const fs::path& file, long nanoseconds) {
    const timespec times[2] = {{1'600'000'000, nanoseconds}, {1'600'000'000, nanoseconds}};
    ASSERT_EQ(::utimensat(AT_FDCWD, file.c_str(), times, 0), 0);
}

// Archives give all files one time in whole seconds, and copies keep it.
TEST_F(Files, AnExchangedFileHasAnotherStamp) {
    const fs::path file = write("data", "one");
    set_time(file, 0);
    const FileStamps stamps{{file, file_stamp(file)}};
    EXPECT_FALSE(first_changed(stamps));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // the clock of a file system is as coarse as 10 ms
    write("data", "two");
    set_time(file, 0);
    EXPECT_EQ(first_changed(stamps), file);
    fs::remove(file);
    EXPECT_EQ(first_changed(stamps), file);
    EXPECT_EQ(file_stamp(file), FileStamp{});
}

TEST_F(Files, ALinkMoreIsNoOtherFile) {
    const fs::path file = write("data", "one");
    set_time(file, 123);
    const FileStamps stamps{{file, file_stamp(file)}};
    fs::create_hard_link(file, folder / "backup");
    fs::permissions(file, fs::perms::owner_read);
    EXPECT_FALSE(first_changed(stamps));
    set_time(file, 124);
    EXPECT_EQ(first_changed(stamps), file);
}

}  // namespace
}  // namespace nephos
