// SPDX-License-Identifier: Apache-2.0
// Image files: what is written is read back, damage and full disks are errors that leave nothing behind.

#include "render/image/image_file.h"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <string>

#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfInputPart.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfVecAttribute.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/error.h"
#include "render/image/tone_map.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

Picture sample_picture() {
    Picture picture;
    picture.width = 37;
    picture.height = 23;
    for (std::size_t i = 0; i < 3 * picture.pixels(); ++i)
        picture.beauty.push_back(float((i * 7919) % 1000) / 700.0f);
    for (std::size_t i = 0; i < picture.pixels(); ++i) {
        picture.transmittance.push_back(float((i * 31) % 100) / 99.0f);
        picture.depth_m.push_back(i % 5 == 0 ? std::numeric_limits<float>::infinity() : 1000.0f + float(i));
    }
    picture.shadow_size = 50;
    for (int i = 0; i < 50 * 50; ++i) picture.shadow.push_back(float((i * 17) % 64) / 63.0f);
    picture.shadow_frame = {{1, 2, 3}, {400, 0, 0}, {0, 500, 0}, {0, 0, -1}};
    return picture;
}

PictureMetadata sample_metadata() {
    PictureMetadata metadata;
    metadata.scene = "scenes/cumulus.toml";
    metadata.seed = 18446744073709551615u;
    metadata.scene_hash = "00112233445566778899aabbccddeeff";
    metadata.state_hash = "ffeeddccbbaa99887766554433221100";
    metadata.version = "0.1.0";
    metadata.time_s = 1234.5;
    metadata.frames_per_second = 25;
    metadata.time_scale = 120;
    metadata.extinction_per_m = 0.02;
    return metadata;
}

std::string value_of(const std::vector<std::pair<std::string, std::string>>& pairs, const std::string& name) {
    for (const auto& [key, value] : pairs)
        if (key == name) return value;
    return "absent";
}

// The library's own reader: the values of one 32-bit channel of a part, row after row from the top.
std::vector<float> channel_of(const std::filesystem::path& path, int part, const std::string& name) {
    Imf::MultiPartInputFile file(path.c_str());
    const Imath::V2i last = file.header(part).dataWindow().max;
    std::vector<float> values(std::size_t(last.x + 1) * std::size_t(last.y + 1));
    Imf::FrameBuffer buffer;
    buffer.insert(name, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(values.data()), sizeof(float),
                                   sizeof(float) * std::size_t(last.x + 1)));
    Imf::InputPart input(file, part);
    input.setFrameBuffer(buffer);
    input.readPixels(0, last.y);
    return values;
}

Vec3 shadow_attribute(const std::filesystem::path& path, const char* name) {
    const Imf::MultiPartInputFile file(path.c_str());
    const Imath::V3f v = file.header(1).typedAttribute<Imf::V3fAttribute>(name).value();
    return {v.x, v.y, v.z};
}

TEST(Exr, ReadsBackBitForBit) {
    const TemporaryFolder folder;
    const Picture picture = sample_picture();
    write_exr(folder.path() / "a.exr", picture, {}, sample_metadata());
    const std::filesystem::path file = folder.path() / "a.exr";
    const char* const names[] = {"beauty.R", "beauty.G", "beauty.B"};
    for (std::size_t c = 0; c < 3; ++c) {
        const std::vector<float> values = channel_of(file, 0, names[c]);
        ASSERT_EQ(values.size(), picture.pixels());
        for (std::size_t i = 0; i < values.size(); ++i) ASSERT_EQ(values[i], picture.beauty[3 * i + c]);
    }
    EXPECT_EQ(channel_of(file, 0, "transmittance.Y"), picture.transmittance);
    EXPECT_EQ(channel_of(file, 0, "depth.Z"), picture.depth_m);
    EXPECT_EQ(channel_of(file, 1, "shadow.Y"), picture.shadow);
    EXPECT_EQ(shadow_attribute(file, "shadowOrigin"), picture.shadow_frame.origin_m);
    EXPECT_EQ(shadow_attribute(file, "shadowU"), picture.shadow_frame.u_axis_m);
    EXPECT_EQ(shadow_attribute(file, "shadowV"), picture.shadow_frame.v_axis_m);
    EXPECT_EQ(shadow_attribute(file, "shadowDirection"), picture.shadow_frame.direction);
}

TEST(Exr, InfoListsLayersAndMetadata) {
    const TemporaryFolder folder;
    RenderOptions options;
    options.camera.exposure_ev = 0.5;
    write_exr(folder.path() / "a.exr", sample_picture(), options, sample_metadata());
    const ExrInfo info = read_exr_info(folder.path() / "a.exr");
    ASSERT_EQ(info.parts.size(), 2u);
    const ExrPart& part = info.parts[0];
    EXPECT_EQ(part.name, "picture");
    EXPECT_EQ(part.width, 37);
    EXPECT_EQ(part.height, 23);
    EXPECT_TRUE(part.complete);
    EXPECT_EQ(part.compression, "zip");
    ASSERT_EQ(part.channels.size(), 8u);
    EXPECT_EQ(part.channels[0].name, "B");
    EXPECT_EQ(part.channels[0].type, "half");
    EXPECT_EQ(part.channels[3].name, "beauty.B");
    EXPECT_EQ(part.channels[3].type, "float");
    EXPECT_EQ(info.parts[1].name, "shadow");
    EXPECT_EQ(info.parts[1].width, 50);
    EXPECT_TRUE(info.parts[1].complete);
    for (const ExrPart& each : info.parts) {
        EXPECT_EQ(value_of(each.attributes, "scene"), "scenes/cumulus.toml");
        EXPECT_EQ(value_of(each.attributes, "seed"), "18446744073709551615");
        EXPECT_EQ(value_of(each.attributes, "sceneHash"), "00112233445566778899aabbccddeeff");
        EXPECT_EQ(value_of(each.attributes, "stateHash"), "ffeeddccbbaa99887766554433221100");
        EXPECT_EQ(value_of(each.attributes, "nephosVersion"), "0.1.0");
        EXPECT_EQ(value_of(each.attributes, "time"), "1234.5");
    }
    EXPECT_EQ(value_of(part.attributes, "exposure"), "0.5");
    EXPECT_EQ(value_of(part.attributes, "framesPerSecond"), "25000/1000");
    EXPECT_EQ(value_of(part.attributes, "timeScale"), "120");
    EXPECT_EQ(value_of(part.attributes, "verticalFieldOfView"), "50");
    EXPECT_NE(value_of(part.attributes, "worldToCamera"), "absent");
}

// The library's own tool, as a user would look at the file.
TEST(Exr, ExrheaderShowsTheMetadata) {
    if (std::system("command -v exrheader > /dev/null") != 0)
        GTEST_SKIP() << "exrheader (package openexr) is not here";
    const TemporaryFolder folder;
    write_exr(folder.path() / "a.exr", sample_picture(), {}, sample_metadata());
    const std::string command = "exrheader '" + (folder.path() / "a.exr").string() + "'";
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
    ASSERT_NE(pipe, nullptr);
    std::string text;
    char line[512];
    while (std::fgets(line, sizeof line, pipe.get()) != nullptr) text += line;
    for (const char* expected : {"beauty.R", "transmittance.Y", "depth.Z", "shadow.Y", "scenes/cumulus.toml",
                                 "ffeeddccbbaa99887766554433221100", "worldToCamera", "chromaticities"})
        EXPECT_NE(text.find(expected), std::string::npos) << expected << " is not in:\n" << text;
}

TEST(Exr, ValuesBeyondHalfAreClampedInTheDefaultLayerOnly) {
    const TemporaryFolder folder;
    Picture picture = sample_picture();
    picture.beauty[0] = 1e6f;
    write_exr(folder.path() / "a.exr", picture, {}, {});
    EXPECT_EQ(channel_of(folder.path() / "a.exr", 0, "beauty.R")[0], 1e6f);
    EXPECT_EQ(channel_of(folder.path() / "a.exr", 0, "R")[0], 65504.0f);
}

TEST(Exr, DamagedFilesAreErrors) {
    const TemporaryFolder folder;
    const std::filesystem::path file = folder.path() / "a.exr";
    write_exr(file, sample_picture(), {}, sample_metadata());
    std::ifstream stream(file, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(stream)), {});
    for (const std::size_t length : {std::size_t(0), std::size_t(3), std::size_t(100), std::size_t(900)}) {
        std::ofstream(file, std::ios::binary) << whole.substr(0, length);
        // The header may be whole; then the parts are not.
        try {
            EXPECT_FALSE(std::ranges::all_of(read_exr_info(file).parts, &ExrPart::complete)) << length;
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::io) << length;
        }
    }
    std::ofstream(file, std::ios::binary) << "no picture at all, just a text";
    EXPECT_THROW(read_exr_info(file), Error);
    EXPECT_THROW(read_exr_info(folder.path() / "absent.exr"), Error);
    // Flipped bits: an error or two parts, never a crash.
    for (std::size_t i = 0; i < whole.size() && i < 2000; i += 7) {
        std::string damaged = whole;
        damaged[i] = char(damaged[i] ^ 0x40);
        std::ofstream(file, std::ios::binary) << damaged;
        try {
            EXPECT_LE(read_exr_info(file).parts.size(), 2u);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::io);
        }
    }
}

// While it lives no file of this process can grow beyond `bytes`, like on a disk that is full.
class FullDisk {
  public:
    explicit FullDisk(std::size_t bytes) {
        ::getrlimit(RLIMIT_FSIZE, &before_);
        handler_ = std::signal(SIGXFSZ, SIG_IGN);
        rlimit limit = before_;
        limit.rlim_cur = bytes;
        ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    FullDisk(const FullDisk&) = delete;
    FullDisk& operator=(const FullDisk&) = delete;
    ~FullDisk() {
        ::setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }

  private:
    rlimit before_{};
    void (*handler_)(int) = nullptr;
};

void expect_full_disk_leaves_nothing(const char* name, void (*write)(const std::filesystem::path&)) {
    const TemporaryFolder folder;
    const std::filesystem::path file = folder.path() / name;
    write(file);
    const std::size_t size = std::filesystem::file_size(file);
    std::filesystem::remove(file);
    for (const std::size_t limit : {std::size_t(0), std::size_t(100), size / 2, size - 1}) {
        ErrorCode code = ErrorCode::check;
        {
            const FullDisk full(limit);
            try {
                write(file);
            } catch (const Error& error) {
                code = error.code();
            }
        }
        EXPECT_EQ(code, ErrorCode::io) << name << " with room for " << limit << " of " << size << " bytes";
        EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << name << " with room for " << limit;
    }
    const FullDisk enough(size);
    EXPECT_NO_THROW(write(file));
}

TEST(Exr, FullDiskLeavesNothingBehind) {
    expect_full_disk_leaves_nothing("a.exr", [](const std::filesystem::path& path) {
        write_exr(path, sample_picture(), {}, sample_metadata());
    });
}

TEST(Png, FullDiskLeavesNothingBehind) {
    expect_full_disk_leaves_nothing("a.png", [](const std::filesystem::path& path) {
        write_png(path, sample_picture(), {}, sample_metadata());
    });
}

TEST(Exr, ShapeIsChecked) {
    const TemporaryFolder folder;
    Picture picture = sample_picture();
    picture.depth_m.pop_back();
    EXPECT_THROW(write_exr(folder.path() / "a.exr", picture, {}, {}), Error);
    EXPECT_THROW(write_png(folder.path() / "a.png", Picture{}, {}, {}), Error);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Png, ReadsBackWithItsMetadata) {
    const TemporaryFolder folder;
    const Picture picture = sample_picture();
    RenderOptions options;
    options.camera.exposure_ev = -0.5;
    write_png(folder.path() / "a.png", picture, options, sample_metadata());
    const Rgb8Image back = read_png(folder.path() / "a.png");
    EXPECT_EQ(back.width, 37);
    EXPECT_EQ(back.height, 23);
    EXPECT_EQ(back.rgb, to_srgb8(picture, -0.5));
    // Chunks of uncompressed text: keyword, 0, two flags, two empty texts that end with 0, text.
    std::ifstream stream(folder.path() / "a.png", std::ios::binary);
    const std::string file((std::istreambuf_iterator<char>(stream)), {});
    for (const auto& [key, value] : {std::pair<std::string, std::string>{"scene", "scenes/cumulus.toml"},
                                     {"seed", "18446744073709551615"},
                                     {"stateHash", "ffeeddccbbaa99887766554433221100"},
                                     {"Software", "nephos 0.1.0"}}) {
        EXPECT_NE(file.find("iTXt" + key + std::string(5, '\0') + value), std::string::npos) << key;
    }
}

TEST(Png, DamagedFilesAreErrors) {
    const TemporaryFolder folder;
    const std::filesystem::path file = folder.path() / "a.png";
    write_png(file, sample_picture(), {}, sample_metadata());
    std::ifstream stream(file, std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(stream)), {});
    for (std::size_t length = 0; length < whole.size(); length += 97) {
        std::ofstream(file, std::ios::binary) << whole.substr(0, length);
        EXPECT_THROW(read_png(file), Error) << length;
    }
    EXPECT_THROW(read_png(folder.path() / "absent.png"), Error);
}

}  // namespace
}  // namespace nephos
