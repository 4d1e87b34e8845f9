// SPDX-License-Identifier: Apache-2.0
// Videos through the ffmpeg command: a real file, and every way it can go wrong.

#include "render/image/video.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "core/error.h"
#include "render/image/tone_map.h"
#include "tests/render/temporary_folder.h"
#include "tests/scoped_variable.h"

namespace nephos {
namespace {

bool has_ffmpeg() {
    return std::system("command -v ffmpeg > /dev/null && command -v ffprobe > /dev/null") == 0;
}

std::string output_of(const std::string& command) {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    std::string text;
    char line[256];
    while (pipe != nullptr && std::fgets(line, sizeof line, pipe.get()) != nullptr) text += line;
    return text;
}

void put_command(const std::filesystem::path& folder, const char* script) {
    const std::filesystem::path file = folder / "ffmpeg";
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> stream(std::fopen(file.c_str(), "w"), std::fclose);
    std::fputs(script, stream.get());
    stream.reset();
    std::filesystem::permissions(file, std::filesystem::perms::owner_all);
}

std::string message_of(const std::filesystem::path& path, int frames, int width = 64, int height = 48) {
    try {
        VideoWriter video(path, {width, height, 10, 18});
        std::vector<std::uint8_t> rgb(std::size_t(3 * width * height));
        for (int left = frames; left > 0; --left) {
            std::memset(rgb.data(), left, rgb.size());
            video.add(rgb);
        }
        video.finish();
    } catch (const Error& error) {
        return error.what();
    }
    return {};
}

// However many processors it runs on, ffmpeg makes the same file; one is all that a command in its place sees.
TEST(Video, RunsOnTheProcessorsThatItIsGiven) {
    if (!has_ffmpeg()) GTEST_SKIP() << "ffmpeg is not here";
    const TemporaryFolder folder;
    const auto encoded = [&](const std::string& name, int processors) {
        VideoWriter video(folder.path() / name, {.width = 64, .height = 48, .processors = processors});
        for (int frame = 0; frame < 30; ++frame) {
            std::vector<std::uint8_t> rgb(3 * 64 * 48);
            for (std::size_t i = 0; i < rgb.size(); ++i)
                rgb[i] = std::uint8_t(i * 7 + std::size_t(frame) * i / 5);
            video.add(rgb);
        }
        video.finish();
        std::ifstream file(folder.path() / name, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(file), {});
    };
    const std::string all = encoded("all.mp4", 0);
    EXPECT_GT(all.size(), 1000u);
    EXPECT_EQ(encoded("one.mp4", 1), all);
    put_command(folder.path(),
                "#!/bin/sh\nsleep 0.2\nnproc > \"${0%/*}/seen\"\ncat > /dev/null\necho frame=1\n");
    const test::ScopedVariable path("PATH", folder.path().string() + ":/usr/bin:/bin");
    {
        VideoWriter video(folder.path() / "b.mp4", {.width = 64, .height = 48, .processors = 1});
        video.add(std::vector<std::uint8_t>(3 * 64 * 48));
        video.finish();
    }
    std::ifstream seen(folder.path() / "seen");
    int processors = 0;
    seen >> processors;
    EXPECT_EQ(processors, 1);
}

TEST(Video, EncodesFramesInOrder) {
    if (!has_ffmpeg()) GTEST_SKIP() << "ffmpeg is not here";
    const TemporaryFolder folder;
    const std::filesystem::path file = folder.path() / "a b;c.mp4";
    VideoWriter video(file, {65, 47, 12.5});  // odd: padded to 66 x 48
    for (int i = 0; i < 5; ++i) {
        Picture picture;
        picture.width = 65;
        picture.height = 47;
        picture.beauty.assign(3 * picture.pixels(), 0.05f * float(i + 1));
        video.add(to_srgb8(picture, 0));
    }
    video.finish();
    const std::string facts = output_of(
        "ffprobe -v error -count_frames -select_streams v -show_entries "
        "stream=codec_name,width,height,pix_fmt,nb_read_frames,r_frame_rate -of csv=p=0 '" +
        file.string() + "'");
    EXPECT_EQ(facts, "h264,66,48,yuv420p,25/2,5\n");
    const std::string gray = output_of("ffmpeg -v error -i '" + file.string() +
                                       "' -vf scale=1:1 -f rawvideo -pix_fmt gray - | od -An -tu1");
    int levels[5] = {};
    ASSERT_EQ(std::sscanf(gray.c_str(), "%d %d %d %d %d", &levels[0], &levels[1], &levels[2], &levels[3],
                          &levels[4]),
              5)
        << gray;
    for (int i = 1; i < 5; ++i) EXPECT_GT(levels[i], levels[i - 1]) << gray;
}

TEST(Video, SameFramesGiveTheSameFile) {
    if (!has_ffmpeg()) GTEST_SKIP() << "ffmpeg is not here";
    const TemporaryFolder folder;
    EXPECT_EQ(message_of(folder.path() / "a.mp4", 3), "");
    EXPECT_EQ(message_of(folder.path() / "b.mp4", 3), "");
    EXPECT_EQ(std::system(("cmp '" + (folder.path() / "a.mp4").string() + "' '" +
                           (folder.path() / "b.mp4").string() + "'")
                              .c_str()),
              0);
}

TEST(Video, MissingCommandSaysWhatToInstall) {
    const TemporaryFolder folder;
    const test::ScopedVariable path("PATH", folder.path().string());
    const std::string message = message_of(folder.path() / "a.mp4", 2);
    EXPECT_NE(message.find("install the package ffmpeg"), std::string::npos) << message;
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Video, FailingCommandIsAnErrorWithItsMessage) {
    const TemporaryFolder folder, commands;
    put_command(commands.path(), "#!/bin/sh\necho 'no such encoder' >&2\ncat > /dev/null\nexit 3\n");
    const test::ScopedVariable path("PATH", commands.path().string() + ":/usr/bin:/bin");
    const std::string message = message_of(folder.path() / "a.mp4", 2);
    EXPECT_NE(message.find("status 3"), std::string::npos) << message;
    EXPECT_NE(message.find("no such encoder"), std::string::npos) << message;
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// Success is what the command says that it encoded, not its exit status: one that cannot read its input may take that
// for the end.
TEST(Video, CommandThatEncodesFewerFramesIsAnError) {
    const TemporaryFolder folder, commands;
    const test::ScopedVariable path("PATH", commands.path().string() + ":/usr/bin:/bin");
    put_command(commands.path(), "#!/bin/sh\ncat > /dev/null\necho frame=1\necho frame=3\n");
    EXPECT_EQ(message_of(folder.path() / "a.mp4", 3), "");
    for (const char* script : {"#!/bin/sh\ncat > /dev/null\necho frame=3\necho frame=2\n",
                               "#!/bin/sh\ncat > /dev/null\necho 'Input/output error' >&2\n"}) {
        put_command(commands.path(), script);
        const std::string message = message_of(folder.path() / "b.mp4", 3);
        EXPECT_NE(message.find("of 3 frames"), std::string::npos) << message;
        EXPECT_FALSE(std::filesystem::exists(folder.path() / "b.mp4"));
    }
}

// Others who may write into the folder put a link in the place of the file that is being written.
TEST(Video, ALinkInThePlaceOfTheFileIsNotFollowed) {
    if (!has_ffmpeg()) GTEST_SKIP() << "ffmpeg is not here";
    const TemporaryFolder folder, commands;
    std::ofstream(folder.path() / "victim") << "precious";
    put_command(commands.path(), ("#!/bin/sh\nfor f in '" + folder.path().string() +
                                  "'/.a.part*; do ln -sf victim \"$f\"; done\nexec /usr/bin/ffmpeg \"$@\"\n")
                                     .c_str());
    const test::ScopedVariable path("PATH", commands.path().string() + ":/usr/bin:/bin");
    const std::string message = message_of(folder.path() / "a.mp4", 3);
    EXPECT_NE(message.find("another file was put in the place"), std::string::npos) << message;
    std::ifstream victim(folder.path() / "victim");
    EXPECT_EQ(std::string(std::istreambuf_iterator<char>(victim), {}), "precious");
    EXPECT_FALSE(std::filesystem::exists(folder.path() / "a.mp4"));
}

// A command that goes away while frames are sent would raise SIGPIPE; the process must live and get an error.
TEST(Video, DyingCommandRaisesNoSignal) {
    const TemporaryFolder folder, commands;
    put_command(commands.path(), "#!/bin/sh\nexec 0<&-\nexit 1\n");
    const test::ScopedVariable path("PATH", commands.path().string() + ":/usr/bin:/bin");
    EXPECT_NE(message_of(folder.path() / "a.mp4", 50, 640, 480), "");
    put_command(commands.path(), "#!/bin/sh\nexec 0<&-\nexit 0\n");  // even when it claims success
    EXPECT_NE(message_of(folder.path() / "a.mp4", 50, 640, 480), "");
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Video, NoFrameAndBadOptionsAreErrors) {
    const TemporaryFolder folder;
    EXPECT_NE(message_of(folder.path() / "a.mp4", 1, 0, 48).find("width"), std::string::npos);
    if (!has_ffmpeg()) GTEST_SKIP() << "ffmpeg is not here";
    EXPECT_NE(message_of(folder.path() / "a.mp4", 0).find("at least one frame"), std::string::npos);
    VideoWriter video(folder.path() / "a.mp4", {64, 48, 25});
    EXPECT_THROW(video.add(std::vector<std::uint8_t>(64 * 48)), Error);
}

}  // namespace
}  // namespace nephos
