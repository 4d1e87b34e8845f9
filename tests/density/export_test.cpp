// SPDX-License-Identifier: Apache-2.0

// Dense boxes of voxels: layout, levels, encoding against a naive twin, and containers read back.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include <gtest/gtest.h>

#include "core/error.h"
#include "density/export/bricks.h"
#include "density/export/containers.h"
#include "density/export/nanovdb_file.h"
#include "density/export/volume.h"
#include "tests/density/vdb_test_files.h"

namespace nephos {
namespace {

using test::TemporaryFolder;

DensityGrid random_grid(Extent extent, unsigned seed) {
    std::mt19937 random(seed);
    std::vector<float> values(extent.cells());
    for (float& value : values) {
        const auto draw = random();
        value = draw % 3 == 0 ? 0.0f : float(draw % 1000) / 1250.0f;
    }
    return DensityGrid::from_dense(values, extent, {{100, -200, 300}, 25});
}

double sum_of(const Volume& v) {
    double sum = 0;
    for (const float value : v.values) sum += double(value);
    return sum;
}

TEST(Volume, CoarserVoxelsAreMeans) {
    constexpr int kSide = 60;
    const std::size_t cells = std::size_t(kSide) * kSide * kSide;
    for (const float value : {1.0f, 0.7f, 3e38f}) {  // whatever the factor, to the last bit
        const DensityGrid grid =
            DensityGrid::from_dense(std::vector<float>(cells, value), {kSide, kSide, kSide}, {});
        for (const int factor : {2, 3, 5, 6, 10, 12, 30, 60}) {
            const Volume v = lay_out(grid, VolumeLayout{.factor = factor});
            EXPECT_EQ(v.values, std::vector<float>(v.voxels(), value)) << factor;
        }
    }
    const DensityGrid grid = random_grid({kSide, kSide, kSide}, 5);
    const std::vector<float> dense = grid.to_dense();
    for (const int factor : {2, 3, 7, 30}) {
        const Volume v = lay_out(grid, VolumeLayout{.factor = factor});
        for (int k = 0; k < v.nz; ++k)
            for (int j = 0; j < v.ny; ++j)
                for (int i = 0; i < v.nx; ++i) {
                    double sum = 0;
                    for (int z = k * factor; z < std::min(kSide, (k + 1) * factor); ++z)
                        for (int y = j * factor; y < std::min(kSide, (j + 1) * factor); ++y)
                            for (int x = i * factor; x < std::min(kSide, (i + 1) * factor); ++x)
                                sum += double(dense[linear_index({kSide, kSide, kSide}, x, y, z)]);
                    ASSERT_FLOAT_EQ(v.values[linear_index({v.nx, v.ny, v.nz}, i, j, k)],
                                    float(sum / (double(factor) * factor * factor)));
                }
    }
}

TEST(Volume, LayoutPermutesPadsAndWraps) {
    const Extent extent{11, 9, 6};
    const DensityGrid grid = random_grid(extent, 1);
    const std::vector<float> dense = grid.to_dense();
    for (const AxisOrder axes : {AxisOrder::enu, AxisOrder::unity, AxisOrder::unreal}) {
        for (const Border border : {Border::none, Border::zero, Border::wrap}) {
            const VolumeLayout layout{1, axes, border, {true, false, false}, 4, false};
            const VolumeBox box = box_of(extent, grid.placement(), layout);
            const Volume v = lay_out(grid, layout);
            ASSERT_EQ(v.voxels(), v.values.size());
            const int cells[3] = {extent.x, extent.y, extent.z};
            for (int z = 0; z < v.nz; ++z)
                for (int y = 0; y < v.ny; ++y)
                    for (int x = 0; x < v.nx; ++x) {
                        const int at[3] = {x, y, z};
                        int world[3] = {};
                        bool inside = true;
                        for (std::size_t a = 0; a < 3; ++a) {
                            const int axis = box.axis[a], n = cells[axis];
                            int i = at[a] - box.border;
                            if (border == Border::wrap && axis == 0 && (i == -1 || i == n)) i = (i + n) % n;
                            inside = inside && i >= 0 && i < n;
                            world[axis] = i;
                        }
                        const float expected =
                            inside ? dense[linear_index(extent, world[0], world[1], world[2])] : 0.0f;
                        ASSERT_EQ(v.values[std::size_t((z * v.ny + y) * v.nx + x)], expected)
                            << x << " " << y << " " << z;
                    }
            EXPECT_EQ(box.size[0] % 4, 0);
            EXPECT_DOUBLE_EQ(box.min_m[2], (axes == AxisOrder::unity ? -200 : 300) - box.border * 25);
        }
    }
    EXPECT_EQ(box_of(extent, grid.placement(), {.power_of_two = true}).size, (std::array{16, 16, 8}));
}

// Means of whole numbers of voxels, also where sizes do not divide, and levels of padded boxes keep the sum.
TEST(Volume, CoarserVoxelsAndLevelsKeepTheMass) {
    const DensityGrid grid = random_grid({43, 30, 17}, 2);
    for (const int factor : {1, 2, 3, 5}) {
        const Volume v = lay_out(grid, {.factor = factor, .multiple = 8});
        EXPECT_NEAR(sum_of(v) * std::pow(factor, 3) / grid.sum(), 1, 1e-6);
        Volume level = v;
        for (int n = 1; n <= 3; ++n) {
            level = halved(level);
            EXPECT_EQ(level.nx, v.nx >> n);
            EXPECT_NEAR(sum_of(level) * std::pow(8, n) / sum_of(v), 1, 1e-6);
        }
    }
    EXPECT_EQ(level_count({256, 128, 32}), 4);
    EXPECT_EQ(level_count({32, 8, 8}), 1);
    EXPECT_EQ(level_count({33, 8, 8}), 2);
}

TEST(Volume, TypesAreWithinTheirError) {
    const DensityGrid grid = random_grid({37, 22, 9}, 3);
    const Volume v = lay_out(grid, {});
    for (const float scale : {1.0f, 0.8f}) {
        for (const VoxelType type :
             {VoxelType::r8, VoxelType::r16, VoxelType::r16f, VoxelType::r32f, VoxelType::bc4}) {
            const auto bytes = encode(v, type, scale);
            ASSERT_EQ(bytes.size(), encoded_bytes(v.nx, v.ny, v.nz, type));
            const Volume back = decode(bytes.data(), bytes.size(), v.nx, v.ny, v.nz, type, scale);
            for (std::size_t n = 0; n < v.values.size(); ++n)
                ASSERT_NEAR(back.values[n], v.values[n], largest_error(type) * scale * 1.001 + 1e-7)
                    << type_name(type);
            EXPECT_THROW(decode(bytes.data(), bytes.size() - 1, v.nx, v.ny, v.nz, type, scale), Error);
        }
    }
}

// Against rounding in double precision, denormals and ties included: each half back to itself, and the midpoints
// between neighbours to the even one.
TEST(Volume, HalvesAreRoundedToNearestEven) {
    const auto bits_of = [](float value) {
        const Volume one{1, 1, 1, {value}};
        const auto bytes = encode(one, VoxelType::r16f, 1);
        return std::uint16_t(std::to_integer<unsigned>(bytes[0]) | std::to_integer<unsigned>(bytes[1]) << 8);
    };
    const auto value_of = [](std::uint32_t half) {
        return half < 0x400 ? std::ldexp(float(half), -24)
                            : std::ldexp(float(0x400 + (half & 0x3FF)), int(half >> 10) - 25);
    };
    for (std::uint32_t half = 0; half < 0x7C00; ++half) ASSERT_EQ(bits_of(value_of(half)), half);
    for (std::uint32_t half = 0; half < 0x7BFF; half += 7) {
        const float middle = (value_of(half) + value_of(half + 1)) / 2;
        ASSERT_EQ(bits_of(middle), half + (half & 1)) << half;
        ASSERT_EQ(bits_of(std::nextafter(middle, 0.0f)), half);
    }
    EXPECT_EQ(bits_of(1e9f), 0x7BFF);
    const auto decoded = [](std::uint16_t half) {
        std::byte bytes[2];
        std::memcpy(bytes, &half, 2);
        return decode(bytes, 2, 1, 1, 1, VoxelType::r16f, 1).values[0];
    };
    EXPECT_EQ(decoded(0xBC00), -1.0f);
    EXPECT_EQ(decoded(0x7C00), INFINITY);
    EXPECT_TRUE(std::isnan(decoded(0x7E00)));
}

// A block of the twin: extremes, and the nearest of the sevenths between them, as BC4's indices count them.
std::uint64_t bc4_twin(const Volume& v, int i, int j, int k, float scale) {
    constexpr std::uint64_t kIndex[] = {0, 2, 3, 4, 5, 6, 7, 1};
    float low = 1e30f, high = 0;
    const auto value = [&](int n) {
        const int x = std::min(4 * i + n % 4, v.nx - 1), y = std::min(4 * j + n / 4, v.ny - 1);
        return v.values[(std::size_t(k) * std::size_t(v.ny) + std::size_t(y)) * std::size_t(v.nx) + std::size_t(x)];
    };
    for (int n = 0; n < 16; ++n) {
        low = std::min(low, value(n));
        high = std::max(high, value(n));
    }
    const float factor = 255 * (1 / scale);
    const auto first = std::uint64_t(std::min(high * factor, 255.0f) + 0.5f),
               second = std::uint64_t(std::min(low * factor, 255.0f) + 0.5f);
    std::uint64_t block = first | second << 8;
    for (int n = 0; n < 16 && first != second; ++n) {
        const float below = (float(first) - value(n) * factor) * (7.0f / float(first - second));
        block |= kIndex[int(std::clamp(below, 0.0f, 7.0f) + 0.5f)] << (16 + 3 * n);
    }
    return block;
}

TEST(Volume, Bc4EqualsTheTwin) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> drawn(0, 0.8f);
    for (const int nx : {13, 16}) {
        Volume v{nx, 9, 3, {}};
        // Blocks of nothing, of one value and of many; some above the scale.
        for (std::size_t n = 0; n < v.voxels(); ++n)
            v.values.push_back(n < 60 ? 0.0f : n < 120 ? 0.25f : random() % 3 == 0 ? 0.0f : drawn(random));
        const std::vector<std::byte> bytes = encode(v, VoxelType::bc4, 0.7f);
        const int bx = (nx + 3) / 4;
        ASSERT_EQ(bytes.size(), std::size_t(bx) * 3 * 3 * 8);
        for (int block = 0; block < bx * 3 * 3; ++block) {
            std::uint64_t bits = 0;
            std::memcpy(&bits, bytes.data() + 8 * block, 8);
            EXPECT_EQ(bits, bc4_twin(v, block % bx, block / bx % 3, block / bx / 3, 0.7f)) << nx << " " << block;
        }
    }
}

TEST(Volume, Bc4IsOfLittleError) {
    // Smooth as clouds are: within 1/255 in the mean.
    Volume v{64, 64, 16, {}};
    for (int z = 0; z < v.nz; ++z)
        for (int y = 0; y < v.ny; ++y)
            for (int x = 0; x < v.nx; ++x)
                v.values.push_back(float(0.5 + 0.5 * std::sin(x * 0.06) * std::cos(y * 0.05 + z * 0.2)));
    const auto bytes = encode(v, VoxelType::bc4, 1);
    const Volume back = decode(bytes.data(), bytes.size(), v.nx, v.ny, v.nz, VoxelType::bc4, 1);
    double squares = 0;
    for (std::size_t n = 0; n < v.values.size(); ++n)
        squares += std::pow(double(back.values[n] - v.values[n]), 2);
    EXPECT_LT(std::sqrt(squares / double(v.values.size())), 1.0 / 255);
}

TEST(Containers, AreReadBackAndRefuseWhatIsCut) {
    const TemporaryFolder folder;
    const DensityGrid grid = random_grid({32, 24, 16}, 4);
    for (const VoxelType type :
         {VoxelType::r8, VoxelType::r16, VoxelType::r16f, VoxelType::r32f, VoxelType::bc4}) {
        EncodedVolume volume{type, {}};
        Volume level = lay_out(grid, {});
        for (int n = 0; n < 3; ++n) {
            volume.levels.push_back({level.nx, level.ny, level.nz, encode(level, type, 1)});
            level = halved(level);
        }
        const auto expect_same = [&](const EncodedVolume& back, std::size_t levels) {
            EXPECT_EQ(back.type, type);
            ASSERT_EQ(back.levels.size(), levels);
            for (std::size_t n = 0; n < levels; ++n) {
                EXPECT_EQ(back.levels[n].nx, volume.levels[n].nx);
                EXPECT_TRUE(back.levels[n].bytes == volume.levels[n].bytes);
            }
        };
        const auto expect_cut_is_refused = [&](const std::filesystem::path& path, const auto& read) {
            std::filesystem::resize_file(path, std::filesystem::file_size(path) - 30);
            EXPECT_THROW(read(), Error) << path;
            // Within what stands before the voxels, too: fields of it must not be read behind the end.
            for (const std::uintmax_t bytes : {200, 160, 147, 143, 140, 130, 128, 127, 80, 79, 12, 1, 0}) {
                std::filesystem::resize_file(path, bytes);
                EXPECT_THROW(read(), Error) << path << ", " << bytes << " bytes";
            }
        };
        write_raw(folder / "v.raw", volume);
        const auto raw = [&] { return read_raw(folder / "v.raw", type, 32, 24, 16, 3); };
        expect_same(raw(), 3);
        expect_cut_is_refused(folder / "v.raw", raw);
        write_dds(folder / "v.dds", volume);
        const auto dds = [&] { return read_dds(folder / "v.dds"); };
        expect_same(dds(), 3);
        expect_cut_is_refused(folder / "v.dds", dds);
        write_ktx2(folder / "v.ktx2", volume, "{}");
        const auto ktx = [&] { return read_ktx2(folder / "v.ktx2"); };
        expect_same(ktx(), 3);
        expect_cut_is_refused(folder / "v.ktx2", ktx);
        if (type == VoxelType::r8 || type == VoxelType::bc4) {
            write_dds(folder / "old.dds", volume, true);
            expect_same(read_dds(folder / "old.dds"), 3);
        } else {
            EXPECT_THROW(write_dds(folder / "old.dds", volume, true), Error);
        }
        if (type == VoxelType::bc4 || type == VoxelType::r16f) {
            EXPECT_THROW(write_vti(folder / "v.vti", volume, {}, false), Error);
            continue;
        }
        for (const bool zip : {false, true}) {
            write_vti(folder / "v.vti", volume, {{1, 2, 3}, {25, 25, 25}, 7}, zip);
            const auto vti = [&] { return read_vti(folder / "v.vti"); };
            expect_same(vti(), 1);
            VtiPlace place;
            read_vti(folder / "v.vti", &place);
            EXPECT_EQ(place.first_m, (std::array<double, 3>{1, 2, 3}));
            EXPECT_EQ(place.voxel_m, (std::array<double, 3>{25, 25, 25}));
            EXPECT_EQ(place.time_s, 7);
            std::filesystem::resize_file(folder / "v.vti", std::filesystem::file_size(folder / "v.vti") / 2);
            EXPECT_THROW(vti(), Error);
        }
        if (type != VoxelType::r8 && type != VoxelType::r16) continue;
        write_slices(folder / "v.png", volume, 3);
        const auto slices = [&] { return read_slices(folder / "v.png", 32, 24, 16, 3); };
        expect_same(slices(), 1);
        EXPECT_THROW(read_slices(folder / "v.png", 32, 24, 15, 5), Error);
        expect_cut_is_refused(folder / "v.png", slices);
    }
}

TEST(Containers, NanoVdbHoldsTheSameVoxels) {
    const TemporaryFolder folder;
    const DensityGrid grid = random_grid({37, 22, 19}, 5);
    for (const NanoCodec codec : {NanoCodec::none, NanoCodec::zip}) {
        write_nanovdb(folder / "v.nvdb", grid, codec, NanoQuantise::none);
        EXPECT_TRUE(read_nanovdb(folder / "v.nvdb", grid.extent()).to_dense() == grid.to_dense());
    }
    const Placement at = read_nanovdb(folder / "v.nvdb", grid.extent()).placement();
    EXPECT_EQ(at.cell_size_m, grid.placement().cell_size_m);
    for (int a = 0; a < 3; ++a) EXPECT_NEAR(at.origin_m[a], grid.placement().origin_m[a], 1e-9);
    EXPECT_THROW(read_nanovdb(folder / "v.nvdb", {8, 8, 8}), Error);
    const std::vector<float> exact = grid.to_dense();
    for (const NanoQuantise quantise : {NanoQuantise::fp16, NanoQuantise::fp8}) {
        write_nanovdb(folder / "q.nvdb", grid, NanoCodec::none, quantise);
        const std::vector<float> read = read_nanovdb(folder / "q.nvdb", grid.extent()).to_dense();
        ASSERT_EQ(read.size(), exact.size());
        float worst = 0;
        for (std::size_t n = 0; n < exact.size(); ++n) worst = std::max(worst, std::abs(read[n] - exact[n]));
        // Half a step of a leaf's range, which is at most 1.
        EXPECT_LE(worst, quantise == NanoQuantise::fp8 ? 0.51f / 255 : 0.51f / 65535);
        EXPECT_GT(worst, 0);
    }
    write_nanovdb(folder / "v.nvdb", grid, NanoCodec::none, NanoQuantise::none);
    EXPECT_LT(std::filesystem::file_size(folder / "q.nvdb"),
              0.9 * double(std::filesystem::file_size(folder / "v.nvdb")));
}

// Uniform blocks are tiles of two sizes; beside the box there may be none.
TEST(Containers, NanoVdbHoldsUniformBlocks) {
    const TemporaryFolder folder;
    const Extent extent{136, 128, 136};
    std::vector<float> values(extent.cells(), 0.5f);
    for (std::size_t n = 0; n < values.size(); ++n)
        if (n % 136 >= 128) values[n] = n / (136 * 128) < 8 ? 0.25f : float(n % 7) / 8;
    const DensityGrid grid = DensityGrid::from_dense(values, extent, {{0, 0, 0}, 10});
    for (const NanoQuantise quantise : {NanoQuantise::none, NanoQuantise::fp16}) {
        write_nanovdb(folder / "t.nvdb", grid, NanoCodec::zip, quantise);
        const std::vector<float> read = read_nanovdb(folder / "t.nvdb", extent).to_dense();
        ASSERT_EQ(read.size(), values.size());
        float worst = 0;
        for (std::size_t n = 0; n < values.size(); ++n)
            worst = std::max(worst, std::abs(read[n] - values[n]));
        EXPECT_LE(worst, quantise == NanoQuantise::none ? 0.0f : 1e-5f);
    }
    for (const Extent& less : {Extent{135, 128, 136}, Extent{136, 127, 136}, Extent{136, 128, 64}})
        EXPECT_THROW(read_nanovdb(folder / "t.nvdb", less), Error);
}

// Every voxel of every level is in a brick, its neighbours are in the border, and empty bricks have no data.
TEST(Bricks, AreReadBackAndHaveTheirNeighbours) {
    const TemporaryFolder folder;
    std::vector<float> values = random_grid({40, 24, 17}, 9).to_dense();
    for (std::size_t n = 0; n < values.size(); ++n)
        if (n % 40 >= 15) values[n] = 0;  // so that the third and fourth bricks along x are empty
    Volume volume{40, 24, 17, values};
    volume.nz = 16;
    volume.values.resize(40 * 24 * 16);
    const std::vector<Volume> levels{volume, halved(volume)};
    for (const VoxelType type : {VoxelType::r8, VoxelType::r16, VoxelType::r16f, VoxelType::r32f}) {
        const BrickOptions options{8, type, 0.8f, {true, true, false}};
        const auto path = folder / "v.bricks";
        write_bricks(path, levels, options);
        EXPECT_LE(std::filesystem::file_size(path), most_brick_bytes({{40, 24, 16}, {20, 12, 8}}, 8, type));
        const EncodedVolume back = read_bricks(path);
        ASSERT_EQ(back.type, type);
        ASSERT_EQ(back.levels.size(), 2u);
        for (std::size_t n = 0; n < 2; ++n) {
            EXPECT_EQ(back.levels[n].nx, levels[n].nx);
            EXPECT_TRUE(back.levels[n].bytes == encode(levels[n], type, 0.8f)) << type_name(type);
        }
    }
    EXPECT_THROW(write_bricks(folder / "b.bricks", levels, {8, VoxelType::bc4, 1, {}}), Error);
    // The table by hand, as another program reads it.
    write_bricks(folder / "f.bricks", levels, {8, VoxelType::r32f, 1, {true, true, false}});
    std::ifstream stream(folder / "f.bricks", std::ios::binary);
    const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
    const auto at = [&]<class T>(std::size_t offset, T) {
        T value;
        std::memcpy(&value, bytes.data() + offset, sizeof value);
        return value;
    };
    ASSERT_EQ(bytes.substr(0, 8), "NPHBRIC1");
    const std::uint64_t count = at(24, std::uint64_t{});
    ASSERT_EQ(count, 5u * 3 * 2 + 3 * 2 * 1);
    std::size_t empty = 0, checked = 0;
    for (std::uint64_t n = 0; n < count; ++n) {
        const std::size_t entry = 32 + 2 * 12 + 40 * n;
        const auto level = at(entry, std::uint32_t{}), i = at(entry + 4, std::uint32_t{}),
                   j = at(entry + 8, std::uint32_t{}), k = at(entry + 12, std::uint32_t{});
        const auto offset = at(entry + 16, std::uint64_t{}), size = at(entry + 24, std::uint64_t{});
        const auto least = at(entry + 32, 0.0f), most = at(entry + 36, 0.0f);
        if (size == 0) {
            EXPECT_EQ(most, 0.0f);
            ++empty;
            continue;
        }
        ASSERT_EQ(size, 1000u * 4);
        const Volume& v = levels[level];
        float low = 1e9f, high = 0;
        for (int z = -1; z <= 8; ++z)
            for (int y = -1; y <= 8; ++y)
                for (int x = -1; x <= 8; ++x) {
                    const int sx = (int(8 * i) + x + v.nx) % v.nx, sy = (int(8 * j) + y + v.ny) % v.ny,
                              sz = int(8 * k) + z;
                    const bool there =
                        int(8 * i) + x <= v.nx && int(8 * j) + y <= v.ny && sz >= 0 && sz < v.nz;
                    const float expected = there ? v.values[std::size_t((sz * v.ny + sy) * v.nx + sx)] : 0.0f;
                    const float found =
                        at(offset + 4 * std::size_t(((z + 1) * 10 + y + 1) * 10 + x + 1), 0.0f);
                    ASSERT_EQ(found, expected) << n << ": " << x << " " << y << " " << z;
                    low = std::min(low, found);
                    high = std::max(high, found);
                    ++checked;
                }
        EXPECT_EQ(least, low);
        EXPECT_EQ(most, high);
    }
    EXPECT_GT(empty, 0u);
    EXPECT_GT(checked, 10000u);
}

// Compares what readers skip by, and what linear filters see, beside the levels.
TEST(Bricks, ChecksSeeBordersAndRanges) {
    const TemporaryFolder folder;
    const std::vector<Volume> levels{lay_out(random_grid({40, 24, 16}, 9), {})};
    const BrickOptions options{8, VoxelType::r8, 1, {true, false, false}};
    write_bricks(folder / "v.bricks", levels, options);
    const auto check = [&](const std::string& name) {
        check_bricks(folder / name, levels, options, 1, [](float) { return 0.5 / 255 + 1e-6; });
    };
    EXPECT_NO_THROW(check("v.bricks"));
    const std::vector<char> whole = test::bytes_of(folder / "v.bricks");
    constexpr std::size_t kTable = 32 + 12, kEntry = 40, kSide = 10, kBricks = 5 * 3 * 2,
                          kFirst = kTable + kEntry * kBricks;
    const auto says = [&](std::size_t at, std::vector<char> bytes, const std::string& text) {
        std::vector<char> changed = whole;
        std::ranges::copy(bytes, changed.begin() + std::ptrdiff_t(at));
        test::write_bytes(folder / "changed.bricks", changed);
        EXPECT_NO_THROW(read_bricks(folder / "changed.bricks"));
        try {
            check("changed.bricks");
            ADD_FAILURE() << "byte " << at;
        } catch (const Error& error) {
            EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
        }
    };
    const std::size_t border = kFirst + (4 * kSide + 4) * kSide;  // of the opposite side
    says(border, {char(whole[border] ^ 0x40)}, "brick 0 or its border has ");
    says(kTable + kEntry + 36, {0, 0, 0, 0}, "brick 1 states values from ");
}

TEST(Bricks, DamagedFilesAreRefused) {
    const TemporaryFolder folder;
    const Volume volume = lay_out(random_grid({20, 20, 20}, 4), {});
    write_bricks(folder / "v.bricks", {volume}, {16, VoxelType::r8, 1, {}});
    std::ifstream stream(folder / "v.bricks", std::ios::binary);
    const std::string whole((std::istreambuf_iterator<char>(stream)), {});
    const auto refused = [&](std::string bytes) {
        std::ofstream(folder / "bad.bricks", std::ios::binary) << bytes;
        EXPECT_THROW(read_bricks(folder / "bad.bricks"), Error);
    };
    for (const std::size_t length : {0ul, 7ul, 40ul, 100ul, whole.size() - 1})
        refused(whole.substr(0, length));
    std::mt19937 random(1);
    for (const std::size_t at : {0ul, 8ul, 12ul, 16ul, 20ul, 24ul, 32ul, 44ul, 68ul}) {
        std::string bytes = whole;
        bytes[at + 1] = char(0x7f);
        refused(bytes);
    }
}

TEST(Bricks, EmptyLevelsOfManyVoxelsAreReadWhereTheyAreKnown) {
    const TemporaryFolder folder;
    write_bricks(folder / "v.bricks", {Volume{8, 8, 8, std::vector<float>(512)}},
                 {256, VoxelType::r8, 1, {}});
    std::ifstream stream(folder / "v.bricks", std::ios::binary);
    std::string bytes((std::istreambuf_iterator<char>(stream)), {});
    constexpr std::uint32_t kSide = 660;  // 27 bricks, 274 MiB
    constexpr std::size_t kSizes = 32, kTable = 44, kEntry = 40;
    const auto put = [&](std::size_t at, std::uint32_t number) {
        std::memcpy(bytes.data() + at, &number, sizeof number);
    };
    for (std::size_t a = 0; a < 3; ++a) put(kSizes + 4 * a, kSide);
    put(24, 27);
    for (std::uint32_t n = 1; n < 27; ++n) {
        bytes += bytes.substr(kTable, kEntry);
        put(kTable + n * kEntry + 4, n % 3);
        put(kTable + n * kEntry + 8, n / 3 % 3);
        put(kTable + n * kEntry + 12, n / 9);
    }
    std::ofstream(folder / "many.bricks", std::ios::binary) << bytes;
    EXPECT_THROW(read_bricks(folder / "many.bricks"), Error);
    const EncodedVolume volume = read_bricks(folder / "many.bricks", std::uint64_t(kSide) * kSide * kSide);
    ASSERT_EQ(volume.levels.size(), 1u);
    EXPECT_EQ(volume.levels[0].bytes.size(), std::size_t(kSide) * kSide * kSide);
}

}  // namespace
}  // namespace nephos
