// SPDX-License-Identifier: Apache-2.0
// Clouds of textures from files: what a file is taken for, that alpha is opacity and the picture stands upright in all
// back-ends, and how a scene names such files.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <png.h>
#include <sys/stat.h>

#include "core/error.h"
#include "render/image/image_file.h"
#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "simulation/billboard_files.h"
#include "simulation/frame_painter.h"
#include "tests/render/picture_checks.h"
#include "tests/render/temporary_folder.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

const fs::path kTextures = fs::path(NEPHOS_SOURCE_DIR) / "scenes/torchelsen/textures";

std::shared_ptr<const BillboardPictures> pictures_of(const std::vector<AlphaImage>& images) {
    return billboard_pictures(images.size(), [&](std::size_t n) { return images[n]; });
}

std::string message_of(const fs::path& path) {
    try {
        read_alpha_image(path);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        return error.what();
    }
    return {};
}

TEST(AlphaImages, AreReadWithTheirOpacity) {
    const AlphaImage image = read_alpha_image(kTextures / "heap-1.png");
    ASSERT_EQ(image.width, 256);
    ASSERT_EQ(image.height, 256);
    ASSERT_EQ(image.opacity.size(), 256u * 256u);
    ASSERT_EQ(image.bright.size(), image.opacity.size());
    const auto at = [&](int x, int y) { return std::size_t(y) * 256 + std::size_t(x); };
    EXPECT_GT(image.opacity[at(128, 140)], 0.9f);
    EXPECT_EQ(image.opacity[at(2, 2)], 0);
    EXPECT_EQ(image.opacity[at(128, 250)], 0);  // below the heap's flat base: row 0 is at the top
    EXPECT_GT(image.opacity[at(128, 170)], 0.9f);
    for (std::size_t n = 0; n < image.opacity.size(); ++n) ASSERT_LE(image.bright[n], image.opacity[n]);
}

// Writes one opaque pixel of grey, of 255, with 8 or 16 bits and no word on how light is coded.
void write_opaque_pixel(const fs::path& path, int depth, int grey) {
    std::FILE* file = std::fopen(path.c_str(), "wb");
    ASSERT_NE(file, nullptr);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
    png_infop info = png_create_info_struct(png);
    png_init_io(png, file);
    png_set_IHDR(png, info, 1, 1, depth, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png, info);
    const png_byte byte = png_byte(grey);
    const png_byte deep[] = {byte, byte, 255, 255}, shallow[] = {byte, 255};
    png_write_row(png, depth == 16 ? deep : shallow);
    png_write_end(png, info);
    png_destroy_write_struct(&png, &info);
    std::fclose(file);
}

TEST(AlphaImages, LuminanceIsAsShownWhateverTheDepth) {
    const TemporaryFolder folder;
    for (const int grey : {10, 100, 200}) {
        write_opaque_pixel(folder.path() / "8.png", 8, grey);
        write_opaque_pixel(folder.path() / "16.png", 16, grey);
        const AlphaImage shallow = read_alpha_image(folder.path() / "8.png"),
                         deep = read_alpha_image(folder.path() / "16.png");
        EXPECT_LT(shallow.bright.at(0), float(grey) / 255) << grey;
        EXPECT_NEAR(deep.bright.at(0), shallow.bright.at(0), 0.5 / 255) << grey;  // 8 bits stay 8 as light
    }
}

TEST(AlphaImages, OthersAreRefusedByName) {
    const TemporaryFolder folder;
    const fs::path text = folder.path() / "text.png", opaque = folder.path() / "opaque.png";
    std::ofstream(text) << "no picture";
    write_png(opaque, Rgb8Image{2, 2, std::vector<std::uint8_t>(12, 200)}, {}, {});
    EXPECT_NE(message_of(text).find("text.png: cannot be read as PNG"), std::string::npos) << message_of(text);
    EXPECT_NE(message_of(opaque).find("opaque.png: has no alpha channel"), std::string::npos) << message_of(opaque);
    EXPECT_NE(message_of(folder.path() / "none.png").find("none.png"), std::string::npos);
    std::string cut;
    {
        std::ifstream whole(kTextures / "heap-1.png", std::ios::binary);
        cut.assign(std::istreambuf_iterator<char>(whole), {});
    }
    const fs::path half = folder.path() / "half.png";
    std::ofstream(half, std::ios::binary) << cut.substr(0, cut.size() / 2);
    EXPECT_NE(message_of(half).find("half.png: cannot be read as PNG"), std::string::npos) << message_of(half);
}

TEST(AlphaImages, PipesAndFoldersAreNotWaitedFor) {
    const TemporaryFolder folder;
    const fs::path pipe = folder.path() / "pipe.png";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    for (const auto& [path, reason] : {std::pair(pipe, "is not a regular file"), std::pair(folder.path(), "is a folder")}) {
        EXPECT_NE(message_of(path).find(reason), std::string::npos) << message_of(path);
        for (const auto& read : {+[](const fs::path& each) { read_png(each); },
                                 +[](const fs::path& each) { read_png_exposure(each); }}) {
            try {
                read(path);
                ADD_FAILURE() << path;
            } catch (const Error& error) {
                EXPECT_NE(std::string(error.what()).find(reason), std::string::npos) << error.what();
            }
        }
    }
}

// A head alone that claims 8192 x 8192 pixels would take 256 MiB before libpng finds the file's end.
TEST(AlphaImages, AHeadThatClaimsMoreThanTheFileHoldsIsRefusedAtOnce) {
    const TemporaryFolder folder;
    const fs::path small = folder.path() / "small.png", lies = folder.path() / "lies.png";
    write_png(small, Rgb8Image{2, 2, std::vector<std::uint8_t>(12, 200)}, {}, {});
    std::ifstream stream(small, std::ios::binary);
    std::string bytes(std::istreambuf_iterator<char>(stream), {});
    const std::string size{0, 0, 0x20, 0, 0, 0, 0x20, 0};  // from byte 16 on; the checksum of the head follows at 29
    bytes.replace(16, size.size(), size);
    std::uint32_t sum = ~0u;  // of PNG, annex D
    for (std::size_t n = 12; n < 29; ++n) {
        sum ^= std::uint8_t(bytes[n]);
        for (int bit = 0; bit < 8; ++bit) sum = sum & 1 ? 0xEDB88320u ^ sum >> 1 : sum >> 1;
    }
    for (int n = 0; n < 4; ++n) bytes[std::size_t(29 + n)] = char(~sum >> (24 - 8 * n));
    std::ofstream(lies, std::ios::binary) << bytes;
    EXPECT_NE(message_of(lies).find("its head claims 8192 x 8192 pixels, more than"), std::string::npos) << message_of(lies);
    EXPECT_THROW(read_png(lies), Error);
}

// Quarters of an image by their opacity, all of one brightness.
AlphaImage quarters(float upper_left, float upper_right, float lower_left, float lower_right, float brightness) {
    AlphaImage image{2, 2, {upper_left, upper_right, lower_left, lower_right}, {}};
    for (const float opacity : image.opacity) image.bright.push_back(brightness * opacity);
    return image;
}

class PicturesOfBillboards : public test::AllBackends {
  protected:
    Picture drawn(const AlphaImage& image, std::uint32_t variant) {
        const std::vector<AlphaImage> images{quarters(1, 1, 1, 1, 1), image};
        CloudBillboard billboard;
        billboard.centre_m = {0, 0, 1000};
        billboard.width_m = billboard.height_m = 400;
        billboard.variant = variant;
        billboard.picture = 1;
        const std::vector<BillboardCloud> clouds{{{0, 0, 1000}, 800, 1200}};
        const std::vector<CloudBillboard> billboards{billboard};
        Splats splats;
        splats.clouds = clouds;
        splats.billboards = billboards;
        splats.pictures = pictures_of(images);
        return renderer_.draw_splats(splats, test::view({0, -1000, 1000}, {0, 0, 1000}, 23, 64, 64));
    }
};

// Whatever its random word says, each quarter lets through what its alpha leaves.
TEST_P(PicturesOfBillboards, AlphaIsOpacityAndThePictureIsUpright) {
    for (const std::uint32_t variant : {0u, 5u, 12u, 31u}) {
        const Picture picture = drawn(quarters(1, 0.25f, 0.5f, 0, 1), variant);
        const auto at = [&](int x, int y) { return picture.transmittance[std::size_t(y) * 64 + std::size_t(x)]; };
        EXPECT_NEAR(at(16, 16), 0, 0.01) << variant;
        EXPECT_NEAR(at(47, 16), 0.75, 0.01) << variant;
        EXPECT_NEAR(at(16, 47), 0.5, 0.01) << variant;
        EXPECT_NEAR(at(47, 47), 1, 0.01) << variant;
    }
}

TEST_P(PicturesOfBillboards, LuminanceScalesTheLight) {
    const Picture black = drawn(quarters(1, 1, 1, 1, 0), 0), grey = drawn(quarters(1, 1, 1, 1, 0.5f), 0),
                  white = drawn(quarters(1, 1, 1, 1, 1), 0);
    const std::size_t middle = 3 * (32 * 64 + 20);
    for (std::size_t c = 0; c < 3; ++c) {
        const float all = white.beauty[middle + c] - black.beauty[middle + c];
        EXPECT_GT(all, 0.01f);
        EXPECT_NEAR(grey.beauty[middle + c] - black.beauty[middle + c], 0.5f * all, 0.01f * all);
    }
}

TEST_P(PicturesOfBillboards, IndicesAreChecked) {
    const std::vector<BillboardCloud> clouds{{{0, 0, 1000}, 800, 1200}};
    CloudBillboard billboard;
    billboard.centre_m = {0, 0, 1000};
    billboard.width_m = billboard.height_m = 400;
    for (const int index : {0, 2, -2}) {
        billboard.picture = index;
        const std::vector<CloudBillboard> billboards{billboard};
        Splats splats;
        splats.clouds = clouds;
        splats.billboards = billboards;
        if (index == 2) splats.pictures = pictures_of({quarters(1, 1, 1, 1, 1)});
        EXPECT_THROW(renderer_.draw_splats(splats, test::view({0, -1000, 1000}, {0, 0, 1000})), Error) << index;
    }
}

INSTANTIATE_TEST_SUITE_P(Ways, PicturesOfBillboards,
                         ::testing::Values(Splatting::cpu, Splatting::vulkan, Splatting::blended), test::way_name);

TEST(BillboardPictures, ValuesMustHaveTheSizeThatIsStated) {
    AlphaImage image = quarters(1, 1, 1, 1, 1);
    image.bright.pop_back();
    EXPECT_THROW(pictures_of({image}), Error);
    EXPECT_THROW(pictures_of({AlphaImage{}}), Error);
    EXPECT_THROW(pictures_of(std::vector<AlphaImage>(kMostBillboardPictures + 1, quarters(1, 1, 1, 1, 1))), Error);
}

Scene painted() { return read_scene(fs::path(NEPHOS_SOURCE_DIR) / "scenes/torchelsen/painted.toml"); }

// Each billboard of a model with textures has one of them, the others none.
TEST(ModelTextures, EachBillboardHasOneOfItsModels) {
    const Scene scene = painted();
    const std::shared_ptr<const ModelTextures> textures = read_textures(scene);
    ASSERT_TRUE(textures);
    EXPECT_EQ(textures->index.size(), 4u);
    std::vector<int> count(4, 0);
    for (std::uint32_t word = 0; word < 1000; ++word) ++count.at(std::size_t(textures->picture_of(scene.models[0], word)));
    EXPECT_GT(*std::ranges::min_element(count), 200);
    EXPECT_EQ(textures->picture_of(BaseModel{}, 7), -1);
    Scene plain;
    plain.models.emplace_back();
    EXPECT_FALSE(read_textures(plain));
}

TEST(ModelTextures, AreRelativeToTheFileThatNamesThem) {
    const std::string model =
        "[[model]]\nname = \"a\"\ntextures = [\"t/a.png\", \"../b.png\"]\nseeds = [{}]\n";
    const Scene own = read_scene_text(model, "scene.toml", "/here/scenes");
    EXPECT_EQ(own.models.at(0).textures, (std::vector<std::string>{"/here/scenes/t/a.png", "/here/b.png"}));
    const TemporaryFolder folder;
    fs::create_directory(folder.path() / "models");
    std::ofstream(folder.path() / "models/a.toml") << model;
    const Scene other = read_scene_text("models = \"models/a.toml\"\n", "scene.toml", folder.path());
    EXPECT_EQ(other.models.at(0).textures.at(0), (folder.path() / "models/t/a.png").string());
}

// The simulation is the same with and without; the scene is not, wherever its files are.
TEST(ModelTextures, ArePartOfTheSceneAndNotOfItsSimulation) {
    const Scene scene = painted();
    Scene plain = scene, moved = scene;
    plain.models[0].textures.clear();
    for (std::string& file : moved.models[0].textures) file = "/elsewhere/" + fs::path(file).filename().string();
    EXPECT_EQ(simulation_hash(scene, ""), simulation_hash(plain, ""));
    EXPECT_NE(scene_hash(scene), scene_hash(plain));
    EXPECT_EQ(scene_hash(scene), scene_hash(moved));
    EXPECT_EQ(to_toml(plain).find("textures ="), std::string::npos);
}

TEST(ModelTextures, BadOnesAreSaidWithTheirPlace) {
    const auto problem = [](const std::string& textures) {
        try {
            read_scene_text("[[model]]\nname = \"a\"\ntextures = " + textures + "\nseeds = [{}]\n", "scene.toml");
        } catch (const Error& error) {
            return std::string(error.what());
        }
        return std::string();
    };
    EXPECT_NE(
        problem("[\"\"]").find("scene.toml:3:12: error: `model[0].textures` has a text that names no file"),
        std::string::npos)
        << problem("[\"\"]");
    EXPECT_NE(problem("3").find("scene.toml:3:12"), std::string::npos) << problem("3");
    Scene scene = painted();
    scene.models[0].textures[2] = "/nowhere/c.png";
    try {
        FramePainter(scene, {.splatting = Splatting::cpu});
        FAIL() << "no error";
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        EXPECT_NE(std::string(error.what()).find("/nowhere/c.png"), std::string::npos) << error.what();
    }
}

// The shipped scene in each back-end: the pictures agree, and differ from those of the textures from noise.
TEST(ModelTextures, TheShippedSceneIsDrawnAlikeByAllBackEnds) {
    Scene scene = painted();
    scene.render.camera.width = 192;
    scene.render.camera.height = 108;
    Simulation simulation(scene);
    struct First : SimulationSink {
        void step(const StepResult&) override {}
        void frame(const FrameResult& result) override {
            if (!kept) kept = result;
        }
        std::optional<FrameResult> kept;
    } first;
    while (!first.kept) simulation.advance(first);
    FramePainter painter(scene, test::validated(Splatting::cpu));
    const Picture cpu = painter.draw(*first.kept);
    for (const Splatting way : {Splatting::vulkan, Splatting::blended}) {
        FramePainter other(scene, test::validated(way));
        const Picture picture = other.draw(*first.kept);
        EXPECT_LE(test::largest_difference(picture.transmittance, cpu.transmittance), 2.0f / 255.0f);
        test::expect_no_messages(other.renderer());
    }
    EXPECT_LT(*std::ranges::min_element(cpu.transmittance), 0.1f);
    Scene plain = scene;
    plain.models[0].textures.clear();
    painter.set_scene(plain, true);
    const Picture noise = painter.draw(*first.kept);
    EXPECT_GT(test::largest_difference(noise.transmittance, cpu.transmittance), 0.3f);
    painter.set_scene(scene, true);
    EXPECT_TRUE(painter.draw(*first.kept).beauty == cpu.beauty);
}

}  // namespace
}  // namespace nephos
