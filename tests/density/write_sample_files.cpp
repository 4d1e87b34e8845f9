// SPDX-License-Identifier: Apache-2.0

// Writes one VDB file of every kind and, beside it, what must be in it as plain arrays and JSON, for
// read_with_pyopenvdb.py:
//
//     write_sample_files FOLDER

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "density/metaballs.h"
#include "density/smoothing.h"
#include "density/vdb/vdb_file.h"
#include "density/veil.h"
#include "tests/density/naive_smoothing.h"
#include "tests/reference/reference_veil.h"

namespace {

using namespace nephos;

// Raw 32-bit floats, x fastest.
void write_array(const std::filesystem::path& path, const std::vector<float>& values) {
    std::ofstream stream(path, std::ios::binary);
    stream.exceptions(std::ios::badbit | std::ios::failbit);
    stream.write(reinterpret_cast<const char*>(values.data()),
                 std::streamsize(values.size() * sizeof(float)));
}

// The bits of a plane at `refine` voxels per cell, as floats.
std::vector<float> as_array(const BitPlane& plane, int refine) {
    const Extent cells = plane.extent(), voxels{cells.x * refine, cells.y * refine, cells.z * refine};
    std::vector<float> values(voxels.cells());
    for (int k = 0; k < voxels.z; ++k) {
        for (int j = 0; j < voxels.y; ++j) {
            for (int i = 0; i < voxels.x; ++i) {
                values[linear_index(voxels, i, j, k)] = plane.get(i / refine, j / refine, k / refine);
            }
        }
    }
    return values;
}

void write_json(const std::filesystem::path& path, Extent e, double voxel_m, bool half, int refine,
                const std::vector<float>& speeds) {
    std::ofstream stream(path);
    stream.exceptions(std::ios::badbit | std::ios::failbit);
    stream << "{\"extent\": [" << e.x << ", " << e.y << ", " << e.z << "], \"voxel_m\": " << voxel_m
           << ", \"origin_m\": [-300, 1200, 450], \"half\": " << (half ? "true" : "false")
           << ", \"refine\": " << refine << ", \"speed_by_level\": [";
    for (std::size_t n = 0; n < speeds.size(); ++n) stream << (n ? ", " : "") << speeds[n];
    stream << "]}\n";
}

// A veil as it is written, and its voxels as the naive twin has them.
void write_veil(const std::filesystem::path& folder, const VdbMetadata& metadata) {
    const Extent extent{45, 30, 18};
    const Placement placement{{-300, 1200, 450}, 32};
    VeilOptions options;
    options.octave_count = 3;
    options.wavelength_m = 700;
    options.stretch = 2;
    options.displacement = 0.3;
    options.direction_deg = 20;
    options.base_m = 450;
    options.top_m = 450 + 18 * 32;
    options.soft_base_m = 300;
    options.soft_top_m = 50;
    options.fallstreak_m = 400;
    const Velocity wind{7, -3};
    const DensityGrid density =
        veil_density(options, {{{0, {{0, wind}}}}}, extent, placement, metadata.time_s);
    VdbContent content{&density, false, {}, {}, {}, placement};
    write_vdb(folder / "veil.vdb", content, metadata);
    const test::ReferenceVeil twin(options, wind, metadata.time_s);
    const VeilThresholds at = veil_thresholds(options);
    std::vector<float> values;
    for (int k = 0; k < extent.z; ++k) {
        for (int j = 0; j < extent.y; ++j) {
            for (int i = 0; i < extent.x; ++i) {
                const Vec3 p{-300 + (i + 0.5) * 32, 1200 + (j + 0.5) * 32, 450 + (k + 0.5) * 32};
                values.push_back(float(twin.density(twin.sum_at(p), double(at.low), double(at.high),
                                                    twin.weight_at(p.z, 1e9, 1e9))));
            }
        }
    }
    write_array(folder / "veil.density", values);
    write_json(folder / "veil.json", extent, 32, false, 1, {});
}

void write_samples(const std::filesystem::path& folder) {
    const Extent extent{45, 30, 18};
    const Placement placement{{-300, 1200, 450}, 32};
    const BitPlane hum = test::random_plane(extent, 0.5, 1), act = test::random_plane(extent, 0.03, 2);
    BitPlane cld = test::random_plane(extent, 0.01, 3);
    for (int k = 0; k < 18; ++k) {
        for (int j = 0; j < 20; ++j) {
            for (int i = 0; i < 20; ++i) cld.set(i, j, k, true);
        }
    }
    const TimedPlane timed[] = {{cld.view(), 0}};
    const DensityGrid coarse = smooth(timed, {SmoothingKernel::gaussian, 1, 1, 1, 0}, placement, {});
    Wind wind;
    wind.keyframes = {{0, {{0, {3, -1}}, {2000, {23, -1}}}}};
    const VdbMetadata metadata{0.04, 33.5, 5, 24, 150, 12345678901234567890u, "scene", "state", "0.1.0", 1};
    write_veil(folder, metadata);
    for (const auto& [name, half, refine] :
         {std::tuple{"float", false, 1}, {"half", true, 1}, {"refined", false, 2}}) {
        const DensityGrid density = refine == 1 ? coarse : resample(coarse, refine, 1.5);
        VdbContent content{&density, half, hum.view(), act.view(), cld.view(), placement};
        for (int k = 0; k < density.extent().z; ++k) {
            const double height = 450 + (k + 0.5) * density.placement().cell_size_m;
            content.wind.push_back(wind_at(wind, height, metadata.time_s));
        }
        write_vdb(folder / (std::string(name) + ".vdb"), content, metadata);
        write_array(folder / (std::string(name) + ".density"), density.to_dense());
        write_array(folder / (std::string(name) + ".hum"), as_array(hum, refine));
        write_array(folder / (std::string(name) + ".act"), as_array(act, refine));
        write_array(folder / (std::string(name) + ".cld"), as_array(cld, refine));
        std::vector<float> speeds;
        const double size = density.placement().cell_size_m;
        for (int k = 0; k < density.extent().z; ++k) {
            speeds.push_back(float(wind_at(wind, 450 + (k + 0.5) * size, metadata.time_s).east_m_per_s));
        }
        write_json(folder / (std::string(name) + ".json"), density.extent(), size, half, refine, speeds);
    }
}

}  // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
        return 2;
    }
    try {
        std::filesystem::create_directories(argv[1]);
        write_samples(argv[1]);
    } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
