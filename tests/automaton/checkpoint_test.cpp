// SPDX-License-Identifier: Apache-2.0

// Going on from any step gives the bits of the uninterrupted run; a damaged file is refused with its reason.

#include "automaton/checkpoint.h"

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "automaton/automaton.h"
#include "core/atomic_file.h"
#include "core/error.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

class TemporaryFolder {
  public:
    TemporaryFolder() : path_(fs::temp_directory_path() / ("nephos_test_" + std::to_string(::getpid()))) {
        fs::remove_all(path_);
        fs::create_directories(path_);
    }
    ~TemporaryFolder() { fs::remove_all(path_); }
    fs::path operator/(const char* name) const { return path_ / name; }
    const fs::path& path() const { return path_; }

  private:
    fs::path path_;
};

AutomatonOptions stormy_options() {
    AutomatonOptions o{.extent = {77, 60, 19}};
    o.wind.keyframes = {{0, {{0, {13, -7}}, {900, {31, 4}}}}, {300, {{0, {-9, 22}}}}};
    o.boundaries.x = Boundary::periodic;
    o.field.background.ext = 0.05;
    o.field.scatters = {{.count = 9,
                         .x_m = {0, 3800},
                         .y_m = {0, 3000},
                         .z_m = {100, 800},
                         .semi_axis_x_m = {200, 600},
                         .semi_axis_y_m = {200, 400},
                         .semi_axis_z_m = {100, 200},
                         .yaw_deg = {0, 90},
                         .birth_s = {0, 100},
                         .life_s = {100, 500},
                         .fade_in_s = 50,
                         .fade_out_s = 50,
                         .replace = true}};
    return o;
}

Checkpoint checkpoint_of(const Automaton& automaton) {
    return {.simulation_hash = std::string(32, 'a'),
            .steps = automaton.steps(),
            .state = automaton.hash(),
            .automaton = automaton.save(),
            .history = {std::byte{1}, std::byte{2}}};
}

TEST(Checkpoint, ResumesAtEveryStep) {
    const TemporaryFolder folder;
    const AutomatonOptions options = stormy_options();
    Automaton whole(options);
    std::vector<StateHash> expected{whole.hash()};
    for (int step = 0; step < 60; ++step) {
        whole.step();
        expected.push_back(whole.hash());
    }
    for (std::size_t stop : {0u, 1u, 13u, 29u, 30u, 59u}) {
        Automaton first(options);
        while (first.steps() < stop) first.step();
        write_checkpoint(folder / "state", checkpoint_of(first));
        const Checkpoint read = read_checkpoint(folder / "state");
        EXPECT_EQ(read.steps, stop);
        EXPECT_EQ(read.state, expected[stop]);
        EXPECT_EQ(read.history.size(), 2u);
        Automaton second(options);
        second.restore(read.automaton);
        EXPECT_EQ(second.hash(), expected[stop]);
        while (second.steps() < 60) second.step();
        EXPECT_EQ(second.hash(), expected[60]) << "resumed at step " << stop;
        EXPECT_EQ(second.save(), whole.save());
    }
}

std::string reason_of(const fs::path& path) {
    try {
        read_checkpoint(path);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find(path.string()), std::string::npos);
        return error.what();
    }
    ADD_FAILURE() << "a damaged checkpoint was accepted";
    return {};
}

TEST(Checkpoint, RefusesDamagedFiles) {
    const TemporaryFolder folder;
    write_checkpoint(folder / "good", checkpoint_of(Automaton(stormy_options())));
    EXPECT_TRUE(is_checkpoint(folder / "good"));
    std::ifstream in(folder / "good", std::ios::binary);
    const std::string good{std::istreambuf_iterator<char>(in), {}};

    const auto with = [&](const std::string& content) {
        write_atomically(folder / "bad", content);
        return reason_of(folder / "bad");
    };
    for (std::size_t size = 0; size < good.size(); size += size < 200 ? 1 : 997) with(good.substr(0, size));
    for (std::size_t at = 0; at < good.size(); at += at < 200 ? 1 : 997) {
        std::string changed = good;
        changed[at] = char(changed[at] ^ 0x10);
        with(changed);
    }
    EXPECT_NE(with("").find("not a nephos checkpoint"), std::string::npos);
    EXPECT_NE(with(good.substr(0, 20)).find("ends early"), std::string::npos);
    EXPECT_NE(with("not a checkpoint at all").find("not a nephos checkpoint"), std::string::npos);
    EXPECT_NE(with(good + "x").find("after its end"), std::string::npos);
    EXPECT_NE(reason_of(folder / "missing").find("No such file"), std::string::npos);
    EXPECT_NE(reason_of(folder.path()).find("is a folder"), std::string::npos);
    EXPECT_FALSE(is_checkpoint(folder / "missing"));
    EXPECT_FALSE(is_checkpoint(folder.path()));
}

TEST(Checkpoint, StateOfAnotherSceneIsRefused) {
    AutomatonOptions other = stormy_options();
    other.extent.x = 78;
    EXPECT_THROW(Automaton(other).restore(Automaton(stormy_options()).save()), Error);
    other = stormy_options();
    other.field.scatters[0].count = 3;
    EXPECT_THROW(Automaton(other).restore(Automaton(stormy_options()).save()), Error);
}

// A full disk, as a limit on the size of files: nothing new appears and what was there stays.
TEST(AtomicFile, KeepsTheOldFileWhenTheDiskIsFull) {
    const TemporaryFolder folder;
    write_atomically(folder / "file", "old content");
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{1000, before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    EXPECT_THROW(write_atomically(folder / "file", std::string(5000, 'x')), Error);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    std::signal(SIGXFSZ, old_handler);

    std::ifstream in(folder / "file");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "old content");
    EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1)
        << "a temporary file was left behind";
}

TEST(AtomicFile, MakesFoldersAndNamesWhatFails) {
    const TemporaryFolder folder;
    write_atomically(folder / "a/b/c.txt", "content");
    EXPECT_TRUE(fs::exists(folder / "a/b/c.txt"));
    EXPECT_THROW(write_atomically(folder / "a/b/c.txt/below-a-file", "content"), Error);
    EXPECT_THROW(write_atomically(folder / "a/b", "over a folder"), Error);
}

// A rename would put a file in the place of a pipe or of the link itself.
TEST(AtomicFile, FollowsLinksAndRefusesWhatIsNoFile) {
    const TemporaryFolder folder;
    write_atomically(folder / "target", "old");
    fs::create_symlink("target", folder / "link");
    write_atomically(folder / "link", "new");
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
    std::ifstream in(folder / "target");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "new");
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_THROW(write_atomically(folder / "pipe", "content"), Error);
    EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
}

// In a folder that others may write to, a link of theirs would have our file replace one of ours elsewhere.
TEST(AtomicFile, RefusesALinkOfAnotherUser) {
    const TemporaryFolder folder;
    write_atomically(folder / "victim", "precious");
    fs::create_symlink("victim", folder / "link");
    constexpr uid_t kSomebody = 12345;
    if (::lchown((folder / "link").c_str(), kSomebody, gid_t(-1)) != 0)
        GTEST_SKIP() << "only root can make a link of another user";
    EXPECT_THROW(write_atomically(folder / "link", "new"), Error);
    std::ifstream in(folder / "victim");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "precious");
    EXPECT_TRUE(fs::is_symlink(folder / "link"));
}

// A link of our own may lead to one of theirs.
TEST(AtomicFile, FollowsAChainOfLinksAsFarAsTheyAreItsOwn) {
    const TemporaryFolder folder;
    fs::create_directory(folder / "far");
    fs::create_symlink("far/next", folder / "link");
    fs::create_symlink("../file", folder / "far/next");
    write_atomically(folder / "link", "new");  // where there was no file
    EXPECT_TRUE(fs::is_symlink(folder / "link") && fs::is_symlink(folder / "far/next"));
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(folder / "file")));
    fs::create_symlink("circle", folder / "circle");
    EXPECT_THROW(write_atomically(folder / "circle", "new"), Error);
    constexpr uid_t kSomebody = 12345;
    if (::lchown((folder / "far/next").c_str(), kSomebody, gid_t(-1)) != 0)
        GTEST_SKIP() << "only root can make a link of another user";
    EXPECT_THROW(write_atomically(folder / "link", "newer"), Error);
    std::ifstream in(folder / "file");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "new");
}

TEST(AtomicFile, KeepsThePermissionsOfTheFileThatItReplaces) {
    const TemporaryFolder folder;
    const auto permissions = [&](const char* name) { return fs::status(folder / name).permissions(); };
    for (const fs::perms mode : {fs::perms(0600), fs::perms(0644), fs::perms(0444), fs::perms(0755)}) {
        write_atomically(folder / "file", "old");
        fs::permissions(folder / "file", mode);
        write_atomically(folder / "file", "new");
        EXPECT_EQ(permissions("file"), mode);
        fs::remove(folder / "file");
    }
    AtomicFile(folder / "private", Access::owner).publish();
    EXPECT_EQ(permissions("private"), fs::perms(0600));
    // Takes no permissions from a file that another user put into a folder open to all.
    fs::permissions(folder.path(), fs::perms(0777));
    write_atomically(folder / "theirs", "old");
    fs::permissions(folder / "theirs", fs::perms(0666));
    if (::chown((folder / "theirs").c_str(), 12345, gid_t(-1)) != 0)
        GTEST_SKIP() << "only root can make a file of another user";
    write_atomically(folder / "theirs", "new");
    struct stat status {};
    ASSERT_EQ(::stat((folder / "theirs").c_str(), &status), 0);
    EXPECT_EQ(status.st_uid, ::geteuid());
    EXPECT_EQ(status.st_mode & S_IWOTH, 0u);
}

// Others who may write into the folder see the name of the temporary file once it is there: a link that they put in
// its place is neither published nor, by the next file, written through.
TEST(AtomicFile, RefusesALinkInThePlaceOfItsTemporaryFile) {
    const TemporaryFolder folder;
    write_atomically(folder / "victim", "precious");
    std::vector<fs::path> names;
    const auto plant = [&](const fs::path& temporary) {
        EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(temporary))) << "it is created before it is named";
        names.push_back(temporary);
        fs::remove(temporary);
        fs::create_symlink("victim", temporary);
    };
    EXPECT_THROW(write_atomically(folder / "file", plant), Error);
    EXPECT_THROW(write_atomically(folder / "file", plant), Error);
    ASSERT_EQ(names.size(), 2u);
    EXPECT_NE(names[0], names[1]) << "a name that was seen says nothing of the next";
    EXPECT_EQ(published_name(names[0].filename().string()), "file");
    EXPECT_FALSE(fs::exists(fs::symlink_status(folder / "file")));
    std::ifstream in(folder / "victim");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "precious");
}

// What another put in the place of the temporary file is not ours to remove; our own file is.
TEST(AtomicFile, LeavesAFileThatAnotherPutInThePlaceOfItsTemporaryOne) {
    const TemporaryFolder folder;
    fs::path temporary;
    const auto exchange = [&](const fs::path& name) {
        temporary = name;
        std::ofstream(folder / "another") << "another's";
        fs::rename(folder / "another", name);
    };
    EXPECT_THROW(write_atomically(folder / "file", exchange), Error);
    EXPECT_FALSE(fs::exists(folder / "file"));
    std::ifstream in(temporary);
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(in), {}), "another's");
    const auto fail = [&](const fs::path& name) {
        temporary = name;
        throw Error(ErrorCode::check, "on purpose");
    };
    EXPECT_THROW(write_atomically(folder / "file", fail), Error);
    EXPECT_FALSE(fs::exists(temporary));
}

// Planes are the last of a state. Their padding is read by kernels that list cells: a forged bit there is a cell beyond the row.
TEST(Checkpoint, CellsBeyondTheLatticeAreRefused) {
    AutomatonOptions o;
    o.extent = {40, 12, 8};
    o.field.background = {0.1, 0.01, 0.1};
    Automaton automaton(o);
    automaton.step();
    const std::vector<std::byte> before = automaton.save();
    const std::size_t words = before.size() - 3 * 12 * 8 * sizeof(std::uint64_t);
    for (const std::size_t word : {0, 11, 95, 96, 287}) {
        std::vector<std::byte> forged = before;
        forged[words + 8 * word + 5] |= std::byte{1};  // cell 40
        EXPECT_THROW(automaton.restore(forged), Error) << word;
        EXPECT_EQ(automaton.save(), before);
        forged = before;
        forged[words + 8 * word + 4] |= std::byte{0x80};  // cell 39
        EXPECT_NO_THROW(automaton.restore(forged)) << word;
        automaton.restore(before);
    }
}

// Numbers of an ellipsoid that no scene may have.
TEST(Checkpoint, ImpossibleEllipsoidsAreRefused) {
    AutomatonOptions o;
    o.extent = {16, 16, 8};
    o.field.ellipsoids.resize(1);
    Automaton automaton(o);
    const std::vector<std::byte> before = automaton.save();
    const std::size_t first = sizeof(std::uint32_t) + sizeof(Extent) + sizeof(std::uint64_t) +
                              8 * sizeof(Displacement) +
                              sizeof(std::uint64_t);  // behind the number of ellipsoids
    for (std::size_t number = 0; number < 10; ++number) {
        std::vector<std::byte> forged = before;
        const double value = std::numeric_limits<double>::quiet_NaN();
        std::memcpy(forged.data() + first + sizeof value * number, &value, sizeof value);
        try {
            automaton.restore(forged);
            ADD_FAILURE() << number;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::io);
        }
        EXPECT_EQ(automaton.save(), before);
    }
}

TEST(Checkpoint, AFailedRestoreChangesNothing) {
    Automaton automaton(stormy_options());
    automaton.step();
    const std::vector<std::byte> before = automaton.save();
    for (std::size_t size : {before.size() - 1, before.size() / 2, std::size_t{40}}) {
        EXPECT_THROW(automaton.restore(std::span(before).first(size)), Error);
        EXPECT_EQ(automaton.save(), before);
    }
}

}  // namespace
}  // namespace nephos
