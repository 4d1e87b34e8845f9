// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/export_bench.h"

#include <cmath>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "core/digest.h"
#include "density/export/volume.h"
#include "scenes/metar/metar.h"
#include "simulation/metar_fit.h"

namespace nephos::bench {
namespace {

// As much cloud as cumulus has: a sixth of the voxels.
Volume sample_volume() {
    Volume v{256, 128, 128, {}};
    for (int z = 0; z < v.nz; ++z)
        for (int y = 0; y < v.ny; ++y)
            for (int x = 0; x < v.nx; ++x)
                v.values.push_back(std::max(
                    0.0f, float(std::sin(x * 0.09) * std::cos(y * 0.07) * std::sin(z * 0.11)) - 0.35f));
    return v;
}

BenchRow encode_row(const Volume& v, VoxelType type, const std::string& target) {
    std::vector<float> to(v.values.size());
    std::size_t bytes = 0;
    const auto [ours, other] = interleave(
        9, [&] { bytes += encode(v, type, 1).size(); },
        [&] { std::memcpy(to.data(), v.values.data(), to.size() * sizeof(float)); });
    if (bytes == 0 || to[0] != v.values[0]) throw std::runtime_error("nothing was encoded");
    return {fmt::format("floats -> {}, {} x {} x {}, against memcpy of the floats", type_name(type), v.nx,
                        v.ny, v.nz),
            ours, other, target,
            fmt::format("one core, {:.0f} MB/s of floats, {:.0f} Mvoxel/s",
                        double(v.values.size()) * 4 / ours / 1e3, double(v.values.size()) / ours / 1e3)};
}

BenchRow level_row(const Volume& v) {
    std::vector<float> to(v.values.size());
    std::size_t voxels = 0;
    const auto [ours, other] = interleave(
        9,
        [&] {
            Volume level = halved(v);
            while (level.nx > 32) level = halved(level);
            voxels += level.voxels();
        },
        [&] { std::memcpy(to.data(), v.values.data(), to.size() * sizeof(float)); });
    if (voxels == 0) throw std::runtime_error("there is no level");
    return {"levels of detail, against memcpy of level 0", ours, other, "<= 1.3x", "one core"};
}

BenchRow digest_row(const Volume& v) {
    std::vector<float> to(v.values.size());
    std::size_t length = 0;
    const auto [ours, other] = interleave(
        9, [&] { length += digest_of(std::as_bytes(std::span(v.values))).size(); },
        [&] { std::memcpy(to.data(), v.values.data(), to.size() * sizeof(float)); });
    if (length == 0) throw std::runtime_error("there is no checksum");
    return {"XXH3-128, against memcpy of the same bytes", ours, other, ">= 1 GB/s",
            fmt::format("one core, {:.1f} GB/s", double(v.values.size()) * 4 / ours / 1e6)};
}

BenchRow metar_row() {
    constexpr int kReports = 1000;
    const std::string report =
        "EGLL 211350Z 24012G25KT 9000 -SHRA FEW020 SCT033TCU BKN045 14/08 Q1017 NOSIG RMK SLP117";
    std::size_t clouds = 0;
    const auto [ours, other] = interleave(
        5,
        [&] {
            for (int n = 0; n < kReports; ++n) clouds += parse_metar(report).clouds.size();
        },
        [&] { clouds += fit_metar(parse_metar(report), {}).layers.size(); });
    if (clouds == 0) throw std::runtime_error("there are no clouds");
    return {"METAR: 1,000 reports parsed, against one scene fitted to three layers", ours, other,
            "<= 50 ms; <= 5 s", "microseconds a report = milliseconds here"};
}

}  // namespace

std::vector<BenchRow> export_bench_rows() {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const Volume v = sample_volume();
    return {encode_row(v, VoxelType::r8, "<= 2x"),
            encode_row(v, VoxelType::r16f, "<= 2x"),
            encode_row(v, VoxelType::r16, ""),
            encode_row(v, VoxelType::bc4, ">= 500 MB/s"),
            level_row(v),
            digest_row(v),
            metar_row()};
}

}  // namespace nephos::bench
