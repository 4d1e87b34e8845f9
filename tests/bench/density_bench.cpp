// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/density_bench.h"

#include <cmath>
#include <random>
#include <stdexcept>

#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>
#include <openvdb/tools/Filter.h>
#include <tbb/global_control.h>

#include "density/smoothing.h"

namespace nephos::bench {
namespace {

constexpr int kEdge = 256;
constexpr SmoothingOptions kBox5{SmoothingKernel::box, 2, 2, 2, 0};

// A field of cumulus: 60 ellipsoids with ragged edges in the lower two thirds of the box, about a tenth of
// all cells.
BitPlane cloudy_plane() {
    BitPlane plane({kEdge, kEdge, kEdge});
    std::mt19937 random(20);
    const auto uniform = [&](double low, double high) {
        return low + (high - low) * double(random()) / double(std::mt19937::max());
    };
    for (int n = 0; n < 60; ++n) {
        const double x = uniform(0, kEdge), y = uniform(0, kEdge), z = uniform(30, 130);
        const double a = uniform(12, 34), b = uniform(12, 34), c = uniform(8, 26);
        for (int k = int(z - c); k <= int(z + c); ++k) {
            for (int j = int(y - b); j <= int(y + b); ++j) {
                for (int i = int(x - a); i <= int(x + a); ++i) {
                    if (i < 0 || j < 0 || k < 0 || i >= kEdge || j >= kEdge || k >= kEdge) continue;
                    const double u =
                        std::pow((i - x) / a, 2) + std::pow((j - y) / b, 2) + std::pow((k - z) / c, 2);
                    if (u < uniform(0.6, 1.0)) plane.set(i, j, k, true);
                }
            }
        }
    }
    return plane;
}

// The bits as floats, active wherever the smoothed density is above 0: what OpenVDB's filter needs to yield
// the same.
openvdb::FloatGrid::Ptr unsmoothed_grid(const BitPlane& plane, const std::vector<float>& smoothed) {
    auto grid = openvdb::FloatGrid::create(0.0f);
    auto voxels = grid->getAccessor();
    for (int k = 0; k < kEdge; ++k) {
        for (int j = 0; j < kEdge; ++j) {
            for (int i = 0; i < kEdge; ++i) {
                if (smoothed[linear_index(plane.extent(), i, j, k)] > 0)
                    voxels.setValue({i, j, k}, plane.get(i, j, k));
            }
        }
    }
    return grid;
}

void require_equal(const openvdb::FloatGrid& grid, const std::vector<float>& expected, const char* what) {
    const auto voxels = grid.getConstAccessor();
    for (int k = 0; k < kEdge; ++k) {
        for (int j = 0; j < kEdge; ++j) {
            for (int i = 0; i < kEdge; ++i) {
                const float e = expected[linear_index({kEdge, kEdge, kEdge}, i, j, k)];
                if (std::abs(voxels.getValue({i, j, k}) - e) > 1e-5f)
                    throw std::runtime_error(std::string(what) + " differs");
            }
        }
    }
}

BenchRow copy_row(std::span<const TimedPlane> planes, const std::vector<float>& smoothed) {
    const openvdb::CoordBBox box(openvdb::Coord(0), openvdb::Coord(kEdge - 1));
    // OpenVDB's dense arrays run z fastest by default; this one runs x fastest, as ours.
    const openvdb::tools::Dense<const float, openvdb::tools::LayoutXYZ> dense(box, smoothed.data());
    openvdb::FloatGrid::Ptr copied;
    DensityGrid built;
    const auto [ours, other] = interleave(
        9,
        [&] {
            built = DensityGrid();
            built = smooth(planes, kBox5, {}, {});
        },
        [&] {
            copied.reset();
            copied = openvdb::FloatGrid::create(0.0f);
            openvdb::tools::copyFromDense(dense, *copied, 0.0f, true);
        });
    require_equal(*copied, built.to_dense(), "copyFromDense");
    return {"bits -> 5^3 box -> FloatGrid, 256^3, against copyFromDense alone", ours, other, "<= 0.25x",
            "one core; freeing the grid before included"};
}

BenchRow filter_row(std::span<const TimedPlane> planes, const BitPlane& plane,
                    const std::vector<float>& smoothed) {
    const openvdb::FloatGrid::Ptr start = unsmoothed_grid(plane, smoothed);
    openvdb::FloatGrid::Ptr filtered;
    std::vector<double> ours, other;
    DensityGrid built;
    for (int round = 0; round < 4; ++round) {
        built = DensityGrid();
        const double first = time_ms([&] { built = smooth(planes, kBox5, {}, {}); });
        filtered = start->deepCopy();
        openvdb::tools::Filter<openvdb::FloatGrid> filter(*filtered);
        filter.setGrainSize(0);  // one thread
        const double second = time_ms([&] { filter.mean(2); });
        if (round == 0) continue;
        ours.push_back(first);
        other.push_back(second);
    }
    require_equal(*filtered, smoothed, "Filter::mean");
    return {"bits -> 5^3 box -> FloatGrid, 256^3, against Filter::mean(2) on the same voxels", median(ours),
            median(other), ">= 60x faster", "one core"};
}

}  // namespace

std::vector<BenchRow> density_bench_rows() {
    openvdb::initialize();
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const BitPlane plane = cloudy_plane();
    const TimedPlane planes[] = {{plane.view(), 0}};
    const std::vector<float> smoothed = smooth(planes, kBox5, {}, {}).to_dense();
    std::vector<BenchRow> rows;
    rows.push_back(copy_row(planes, smoothed));
    rows.push_back(filter_row(planes, plane, smoothed));
    return rows;
}

}  // namespace nephos::bench
