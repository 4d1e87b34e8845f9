// SPDX-License-Identifier: Apache-2.0

// Files as OpenVDB itself sees them: voxels, transform, class, bounds and metadata of every grid; and what
// happens when the disk is full.

#include <csignal>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "core/error.h"
#include "density/metaballs.h"
#include "density/openvdb_access.h"
#include "density/smoothing.h"
#include "density/vdb/vdb_file.h"
#include "tests/density/naive_smoothing.h"
#include "tests/density/vdb_test_files.h"

namespace nephos {
namespace {

using openvdb::Coord;
using openvdb::CoordBBox;
using test::read_with_openvdb;

// A small state with some blocks empty, some full, and a density grid made of it.
struct Scene {
    Extent extent{37, 26, 19};
    Placement placement{{1000, -2000, 300}, 40};
    Lattice state{test::random_plane(extent, 0.5, 1), test::random_plane(extent, 0.02, 2), BitPlane(extent)};
    DensityGrid density;
    Wind wind;
    VdbMetadata metadata{0.05,         120.5,        10,      25, 60, 18446744073709551615u,
                         "scene-hash", "state-hash", "0.1.0", 1};

    Scene() {
        for (int k = 2; k < 19; ++k) {
            for (int j = 0; j < 26; ++j) {
                for (int i = 0; i < 22; ++i) state.cld.set(i, j, k, i < 20 || (i + j + k) % 3 == 0);
            }
        }
        const TimedPlane timed[] = {{state.cld.view(), 0}};
        density = smooth(timed, {SmoothingKernel::tent, 1, 1, 1, 0}, placement, {});
        wind.keyframes = {{0, {{0, {2, 1}}, {1000, {12, -5}}}}, {200, {{0, {4, 3}}, {1000, {8, 0}}}}};
    }
    VdbContent content() const {
        VdbContent c;
        c.density = &density;
        c.hum = state.hum.view();
        c.act = state.act.view();
        c.cld = state.cld.view();
        c.cells = placement;
        for (int k = 0; k < density.extent().z; ++k)
            c.wind.push_back(wind_at(wind, 300 + (k + 0.5) * 40, metadata.time_s));
        return c;
    }
};

void expect_shared_properties(const openvdb::GridBase& grid, const Scene& scene, Extent voxels, double size) {
    SCOPED_TRACE(grid.getName());
    const Vec3 o = scene.placement.origin_m;
    // A voxel's index is its centre.
    for (const Coord c : {Coord(0, 0, 0), Coord(5, 7, 3), Coord(voxels.x - 1, 0, 2)}) {
        const openvdb::Vec3d world = grid.indexToWorld(c);
        EXPECT_NEAR(world.x(), o.x + (c.x() + 0.5) * size, 1e-9);
        EXPECT_NEAR(world.y(), o.y + (c.y() + 0.5) * size, 1e-9);
        EXPECT_NEAR(world.z(), o.z + (c.z() + 0.5) * size, 1e-9);
    }
    EXPECT_TRUE(grid.hasUniformVoxels());
    EXPECT_EQ(grid.metaValue<std::string>("nephos_units"), "m");
    EXPECT_EQ(grid.metaValue<std::string>("nephos_up_axis"), "z");
    EXPECT_EQ(grid.metaValue<double>("nephos_extinction_per_m"), 0.05);
    EXPECT_EQ(grid.metaValue<double>("nephos_time_s"), 120.5);
    EXPECT_EQ(grid.metaValue<double>("nephos_time_step_s"), 10.0);
    EXPECT_EQ(grid.metaValue<double>("nephos_frames_per_second"), 25.0);
    EXPECT_EQ(grid.metaValue<double>("nephos_time_scale"), 60.0);
    EXPECT_EQ(grid.metaValue<std::string>("nephos_seed"), "18446744073709551615");
    EXPECT_EQ(grid.metaValue<std::string>("nephos_scene_hash"), "scene-hash");
    EXPECT_EQ(grid.metaValue<std::string>("nephos_state_hash"), "state-hash");
    EXPECT_EQ(grid.metaValue<std::string>("nephos_version"), "0.1.0");
    EXPECT_EQ(grid.metaValue<int>("nephos_random_stream_version"), 1);
    EXPECT_EQ(grid.metaValue<openvdb::Vec3i>("nephos_bbox_min"), openvdb::Vec3i(0, 0, 0));
    EXPECT_EQ(grid.metaValue<openvdb::Vec3i>("nephos_bbox_max"),
              openvdb::Vec3i(voxels.x - 1, voxels.y - 1, voxels.z - 1));
}

void expect_voxels(const openvdb::FloatGrid& grid, const DensityGrid& density, double tolerance) {
    const auto dense = density.to_dense();
    const auto voxels = grid.getConstAccessor();
    const Extent e = density.extent();
    std::uint64_t active = 0;
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const float expected = dense[linear_index(e, i, j, k)];
                ASSERT_NEAR(voxels.getValue({i, j, k}), expected, tolerance * double(expected))
                    << i << " " << j << " " << k;
                const bool corner =
                    (i == 0 && j == 0 && k == 0) || (i == e.x - 1 && j == e.y - 1 && k == e.z - 1);
                ASSERT_EQ(voxels.isValueOn({i, j, k}), expected > 0 || corner) << i << " " << j << " " << k;
                active += expected > 0 || corner;
            }
        }
    }
    EXPECT_EQ(grid.activeVoxelCount(), active);  // and none elsewhere
    EXPECT_EQ(grid.background(), 0.0f);
    EXPECT_EQ(grid.getGridClass(), openvdb::GRID_FOG_VOLUME);
    EXPECT_EQ(grid.evalActiveVoxelBoundingBox(), CoordBBox(Coord(0), Coord(e.x - 1, e.y - 1, e.z - 1)));
}

void expect_plane(const openvdb::BoolGrid& grid, const BitPlane& plane, int refine) {
    SCOPED_TRACE(grid.getName());
    const auto voxels = grid.getConstAccessor();
    const Extent e = plane.extent();
    for (int k = 0; k < e.z * refine; ++k) {
        for (int j = 0; j < e.y * refine; ++j) {
            for (int i = 0; i < e.x * refine; ++i) {
                const bool expected = plane.get(i / refine, j / refine, k / refine);
                ASSERT_EQ(voxels.getValue({i, j, k}), expected) << i << " " << j << " " << k;
                ASSERT_EQ(voxels.isValueOn({i, j, k}), expected) << i << " " << j << " " << k;
            }
        }
    }
    EXPECT_EQ(grid.activeVoxelCount(), plane.count() * std::uint64_t(refine * refine * refine));
    EXPECT_FALSE(grid.background());
}

TEST(VdbWrite, OpenvdbReadsEveryGridBack) {
    const Scene scene;
    const test::TemporaryFolder folder;
    write_vdb(folder / "all.vdb", scene.content(), scene.metadata);
    const auto file = read_with_openvdb(folder / "all.vdb");
    ASSERT_EQ(file.grids.size(), 5u);
    for (const auto& grid : file.grids) {
        expect_shared_properties(*grid, scene, scene.extent, 40);
        EXPECT_EQ(grid->transform(), file.grids.front()->transform()) << grid->getName();
    }
    EXPECT_EQ(file.metadata.metaValue<std::string>("nephos_scene_hash"), "scene-hash");
    EXPECT_EQ(file.metadata.metaValue<double>("nephos_extinction_per_m"), 0.05);
    const auto density = file.get<openvdb::FloatGrid>("density");
    expect_voxels(*density, scene.density, 0);
    EXPECT_FALSE(density->saveFloatAsHalf());
    // Pruned: the full blocks in the middle of the cloud are tiles.
    EXPECT_GT(density->tree().activeTileCount(), 0u);
    expect_plane(*file.get<openvdb::BoolGrid>("hum"), scene.state.hum, 1);
    expect_plane(*file.get<openvdb::BoolGrid>("act"), scene.state.act, 1);
    expect_plane(*file.get<openvdb::BoolGrid>("cld"), scene.state.cld, 1);
}

// OpenVDB's own writer makes a random UUID for each file.
TEST(VdbWrite, SameContentIsTheSameBytes) {
    const Scene scene;
    const test::TemporaryFolder folder;
    const auto bytes = [](const std::filesystem::path& path) {
        std::ifstream stream(path, std::ios::binary);
        return std::string(std::istreambuf_iterator<char>(stream), {});
    };
    std::filesystem::create_directory(folder / "again");
    write_vdb(folder / "grid_0001.vdb", scene.content(), scene.metadata);
    write_vdb(folder / "again/grid_0001.vdb", scene.content(), scene.metadata);
    write_vdb(folder / "grid_0002.vdb", scene.content(), scene.metadata);
    const std::string first = bytes(folder / "grid_0001.vdb");
    EXPECT_TRUE(first == bytes(folder / "again/grid_0001.vdb"));
    const auto uuid = [&](const char* name) {
        openvdb::io::File file((folder / name).string());
        file.open();
        return file.getUniqueTag();
    };
    EXPECT_EQ(uuid("grid_0001.vdb"), first.substr(21, 36));
    EXPECT_NE(uuid("grid_0001.vdb"), uuid("grid_0002.vdb"));
}

TEST(VdbWrite, VelocityIsTheWindAtEachVoxel) {
    const Scene scene;
    const test::TemporaryFolder folder;
    write_vdb(folder / "vel.vdb", scene.content(), scene.metadata);
    const auto file = read_with_openvdb(folder / "vel.vdb");
    const auto vel = file.get<openvdb::Vec3SGrid>("vel");
    const auto density = file.get<openvdb::FloatGrid>("density");
    ASSERT_TRUE(vel && density);
    EXPECT_EQ(vel->getVectorType(), openvdb::VEC_CONTRAVARIANT_RELATIVE);
    int checked = 0;
    for (auto voxel = density->cbeginValueOn(); voxel; ++voxel) {
        for (auto c = voxel.getBoundingBox().begin(); c; ++c) {
            const Velocity wind = wind_at(scene.wind, 300 + ((*c).z() + 0.5) * 40, scene.metadata.time_s);
            const openvdb::Vec3s v = vel->getConstAccessor().getValue(*c);
            ASSERT_TRUE(vel->getConstAccessor().isValueOn(*c));
            ASSERT_FLOAT_EQ(v.x(), float(wind.east_m_per_s));
            ASSERT_FLOAT_EQ(v.y(), float(wind.north_m_per_s));
            ASSERT_EQ(v.z(), 0.0f);
            ++checked;
        }
    }
    EXPECT_GT(checked, 1000);
    EXPECT_EQ(vel->evalActiveVoxelBoundingBox(), density->evalActiveVoxelBoundingBox());
}

// A box far larger than its clouds, as that of layers from the ground to the cirrus: the wind's voxels are larger.
TEST(VdbWrite, TheWindOfALargeBoxHasLargerVoxels) {
    EXPECT_EQ(velocity_voxel({256, 256, 64}), 1);
    EXPECT_EQ(velocity_voxel({256, 256, 256}), 1);
    EXPECT_EQ(velocity_voxel({256, 256, 257}), 2);
    EXPECT_EQ(velocity_voxel({32768, 32768, 1}), 32);
    const test::TemporaryFolder folder;
    const Extent extent{4000, 3000, 38};
    TreeBuilder builder;
    const DensityGrid density = builder.finish(extent, {{100, 200, 300}, 50});
    VdbContent content;
    content.density = &density;
    for (int k = 0; k < extent.z; ++k) content.wind.push_back({0.5 * k, k < 32 ? -7.0 : 0.0});
    const auto voxel_of = [&](const char* name) {
        write_vdb(folder / name, content, {});
        const test::FileContent file = read_with_openvdb(folder / name);
        const auto vel = file.get<openvdb::Vec3SGrid>("vel");
        EXPECT_EQ(vel->voxelSize(), openvdb::Vec3d(200));
        EXPECT_EQ(vel->evalActiveVoxelBoundingBox(), openvdb::CoordBBox({0, 0, 0}, {999, 749, 9}));
        EXPECT_EQ(vel->metaValue<openvdb::Vec3i>("nephos_bbox_max"), openvdb::Vec3i(999, 749, 9));
        EXPECT_EQ(file.get<openvdb::FloatGrid>("density")->metaValue<openvdb::Vec3i>("nephos_bbox_max"),
                  openvdb::Vec3i(3999, 2999, 37));
        EXPECT_EQ(vel->indexToWorld(openvdb::Coord(0, 0, 0)),
                  content.half_voxel_shift ? openvdb::Vec3d(100, 200, 300) : openvdb::Vec3d(200, 300, 400))
            << "half of its own voxel";
        EXPECT_LT(vel->memUsage(), std::uint64_t(210) << 20);
        return [vel](const openvdb::Coord& at) { return vel->getConstAccessor().getValue(at); };
    };
    const auto profile = voxel_of("profile.vdb");
    EXPECT_EQ(profile({7, 9, 2}), openvdb::Vec3s(0.5f * 9.5f, -7, 0));
    EXPECT_EQ(profile({999, 749, 9}), openvdb::Vec3s(0.5f * 36.5f, 0, 0)) << "of two levels in the box";
    content.half_voxel_shift = true;
    content.wind_field = [](const Vec3& at) { return Vec3(at.x, at.y, at.z); };
    const auto field = voxel_of("field.vdb");
    EXPECT_EQ(field({7, 9, 2}),
              openvdb::Vec3s(0.5f * 9.5f + 100 + 7.5f * 200, -7 + 200 + 9.5f * 200, 300 + 2.5f * 200));
}

// A block of one velocity is a tile; what reads the grid finds it all the same.
TEST(VdbWrite, UniformWindTakesNoRoom) {
    const test::TemporaryFolder folder;
    const Extent extent{100, 64, 24};
    TreeBuilder builder;
    const DensityGrid density = builder.finish(extent, {{0, 0, 0}, 50});
    VdbContent content;
    content.density = &density;
    for (int k = 0; k < extent.z; ++k) content.wind.push_back({3, k < 12 ? 1.0 : 2.0});
    write_vdb(folder / "w.vdb", content, {});
    const test::FileContent file = read_with_openvdb(folder / "w.vdb");
    const auto vel = file.get<openvdb::Vec3SGrid>("vel");
    EXPECT_EQ(vel->activeVoxelCount(), extent.cells());
    EXPECT_EQ(vel->tree().leafCount(), 13u * 8 + 2 * 8) << "the level that changes, and the edge of the box";
    const SampleGrid samples = read_samples(folder / "w.vdb", "vel", 3);
    ASSERT_EQ(samples.points, (std::array<int, 3>{100, 64, 24}));
    EXPECT_EQ(sample_at(samples, {60, 70, 100}, 1), 1);
    EXPECT_EQ(sample_at(samples, {4900, 3000, 1100}, 1), 2);
    EXPECT_EQ(sample_at(samples, {4900, 3000, 1100}, 0), 3);
}

TEST(VdbWrite, HalfFloatsKeepElevenBits) {
    const Scene scene;
    const test::TemporaryFolder folder;
    const TimedPlane timed[] = {{scene.state.cld.view(), 0}};
    // 27ths, which no binary float holds exactly.
    const DensityGrid density = smooth(timed, {SmoothingKernel::box, 1, 1, 1, 0}, scene.placement, {});
    VdbContent content = scene.content();
    content.density = &density;
    content.half = true;
    write_vdb(folder / "half.vdb", content, scene.metadata);
    const auto file = read_with_openvdb(folder / "half.vdb");
    EXPECT_TRUE(file.get<openvdb::FloatGrid>("density")->saveFloatAsHalf());
    expect_voxels(*file.get<openvdb::FloatGrid>("density"), density, 0x1p-11);
    // And not more than that.
    const DensityGrid half = read_density(folder / "half.vdb");
    EXPECT_EQ(half.active_voxels(), density.active_voxels());
    EXPECT_NE(half.to_dense(), density.to_dense());
}

// A refined density and its state in one file: the same transform, each cell 2x2x2 voxels.
TEST(VdbWrite, RefinedGridsShareOneTransform) {
    const Scene scene;
    const test::TemporaryFolder folder;
    const DensityGrid fine = resample(scene.density, 2, 2.0);
    VdbContent content = scene.content();
    content.density = &fine;
    content.wind.assign(std::size_t(fine.extent().z), {2, 1});
    write_vdb(folder / "fine.vdb", content, scene.metadata);
    const auto file = read_with_openvdb(folder / "fine.vdb");
    for (const auto& grid : file.grids) {
        expect_shared_properties(*grid, scene, {74, 52, 38}, 20);
        EXPECT_EQ(grid->metaValue<int>("nephos_refine"), 2);
    }
    expect_voxels(*file.get<openvdb::FloatGrid>("density"), fine, 0);
    expect_plane(*file.get<openvdb::BoolGrid>("cld"), scene.state.cld, 2);
    const Lattice back = read_state(folder / "fine.vdb", scene.extent, scene.placement);
    EXPECT_TRUE(back.hum == scene.state.hum && back.act == scene.state.act && back.cld == scene.state.cld);
}

// Bounds over a sequence: the same in a frame without any cloud, in OpenVDB's own metadata as in ours.
TEST(VdbWrite, BoundsAreConstantOverASequence) {
    const Scene scene;
    const test::TemporaryFolder folder;
    const DensityGrid nothing =
        DensityGrid::from_dense(std::vector<float>(scene.extent.cells()), scene.extent, scene.placement);
    int frame = 0;
    for (const DensityGrid* density : {&scene.density, &nothing}) {
        VdbContent content;
        content.density = density;
        content.cells = scene.placement;
        const auto path = frame_path(folder.path(), "cloud", ++frame);
        write_vdb(path, content, scene.metadata);
        const auto file = read_with_openvdb(path);
        const auto& grid = *file.grids.front();
        EXPECT_EQ(grid.metaValue<openvdb::Vec3i>("file_bbox_min"), openvdb::Vec3i(0, 0, 0));
        EXPECT_EQ(grid.metaValue<openvdb::Vec3i>("file_bbox_max"), openvdb::Vec3i(36, 25, 18));
        EXPECT_EQ(read_density(path).extent(), scene.extent);
        EXPECT_EQ(read_density(path).active_voxels(), density->active_voxels());
    }
    EXPECT_TRUE(std::filesystem::exists(folder / "cloud_0001.vdb"));
    EXPECT_TRUE(std::filesystem::exists(folder / "cloud_0002.vdb"));
    EXPECT_EQ(frame_path("d", "n", 12345), std::filesystem::path("d/n_12345.vdb"));
}

TEST(VdbWrite, RejectsContentThatContradictsItself) {
    const Scene scene;
    const test::TemporaryFolder folder;
    const auto code = [&](const VdbContent& content) {
        try {
            write_vdb(folder / "no.vdb", content, scene.metadata);
        } catch (const Error& error) {
            return error.code();
        }
        return ErrorCode::check;
    };
    VdbContent content;
    EXPECT_EQ(code(content), ErrorCode::usage);
    content = scene.content();
    const BitPlane other(Extent{37, 26, 18});
    content.cld = other.view();
    EXPECT_EQ(code(content), ErrorCode::usage);
    content = scene.content();
    content.cells.cell_size_m = 41;
    EXPECT_EQ(code(content), ErrorCode::usage);
    content = scene.content();
    content.density = nullptr;
    EXPECT_EQ(code(content), ErrorCode::usage);  // vel without density
    const DensityGrid none;
    content = VdbContent();
    content.density = &none;
    EXPECT_EQ(code(content), ErrorCode::usage);
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

// Limits the size of files that this process may write, as a full disk would: writes beyond it fail with
// EFBIG.
class FileSizeLimit {
  public:
    explicit FileSizeLimit(rlim_t bytes) {
        ::getrlimit(RLIMIT_FSIZE, &before_);
        handler_ = std::signal(SIGXFSZ, SIG_IGN);
        rlimit limit = before_;
        limit.rlim_cur = bytes;
        ::setrlimit(RLIMIT_FSIZE, &limit);
    }
    FileSizeLimit(const FileSizeLimit&) = delete;
    FileSizeLimit& operator=(const FileSizeLimit&) = delete;
    ~FileSizeLimit() {
        ::setrlimit(RLIMIT_FSIZE, &before_);
        std::signal(SIGXFSZ, handler_);
    }

  private:
    rlimit before_{};
    void (*handler_)(int) = SIG_DFL;
};

// At every point where the disk may fill up: an error that names the file, the old file as it was, nothing
// left behind.
TEST(VdbWrite, FullDiskLeavesTheOldFile) {
    const Scene scene;
    const test::TemporaryFolder folder;
    VdbContent content = scene.content();
    write_vdb(folder / "cloud.vdb", content, scene.metadata);
    const auto before = test::bytes_of(folder / "cloud.vdb");
    ASSERT_GT(before.size(), 4000u);
    for (std::size_t room : {std::size_t{0}, std::size_t{100}, before.size() / 2, before.size() - 1}) {
        std::string message;
        try {
            const FileSizeLimit limit(room);
            write_vdb(folder / "cloud.vdb", content, scene.metadata);
        } catch (const Error& error) {
            EXPECT_EQ(error.code(), ErrorCode::io);
            message = error.what();
        }
        EXPECT_NE(message.find("cloud.vdb"), std::string::npos) << "room " << room << ": " << message;
        EXPECT_NE(message.find("File too large"), std::string::npos) << "room " << room << ": " << message;
        EXPECT_EQ(test::bytes_of(folder / "cloud.vdb"), before) << "room " << room;
        EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1)
            << "room " << room;
    }
}

TEST(VdbWrite, UnwritablePlacesAreErrors) {
    const Scene scene;
    const test::TemporaryFolder folder;
    test::write_bytes(folder / "file", {'x'});
    EXPECT_THROW(write_vdb(folder / "file/sub.vdb", scene.content(), scene.metadata), Error);
    std::filesystem::create_directory(folder / "folder.vdb");
    EXPECT_THROW(write_vdb(folder / "folder.vdb", scene.content(), scene.metadata), Error);
    write_vdb(folder / "new/deep/file.vdb", scene.content(), scene.metadata);
    EXPECT_TRUE(std::filesystem::exists(folder / "new/deep/file.vdb"));
}

}  // namespace
}  // namespace nephos
