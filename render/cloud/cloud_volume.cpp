// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/cloud_volume.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include "render/cloud/table_rows.h"
#include "render/shared/march.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells;

// Takes the densities of cells, which nothing else needs.
std::vector<float> mean_extinction(CoverageField& field) {
    std::vector<float> result = field.take_cell_density();
    for (float& number : result) number *= float(field.extinction_per_m());
    return result;
}

std::uint16_t packed_depth(float depth) {
    const float share = std::clamp(depth / kMostMarchedDepth, 0.0f, 1.0f);
    return std::uint16_t(65535 * std::sqrt(share) + 0.5f);
}

// T's absorption as an optical depth: what is left falls off in proportion to the way through density 1.
float absorbed_depth(float depth, double extinction_per_m, double light_distance_m) {
    const double left = 1 - double(depth) / std::max(extinction_per_m * light_distance_m, 1e-30);
    return left > 0 ? float(-std::log(left)) : kMostMarchedDepth;
}

}  // namespace

CloudVolume::CloudVolume(const DetailedVoxels& voxels)
    : field(voxels.density, voxels.setting, voxels.moisture ? &*voxels.moisture : nullptr),
      extinction(mean_extinction(field)) {}

std::size_t CloudVolume::memory_bytes() const {
    return field.memory_bytes() + 4 * (extinction.size() + corner_depths.size() + front.depths().size() + shade.size()) +
           2 * (sun_depths.size() + own_depths.size() + surroundings.size() + diffuse.upwards.size() +
                diffuse.sideways.size());
}

double footprint_scale(std::span<const CloudVolume> volumes) {
    double scale = 0;
    for (const CloudVolume& volume : volumes)
        scale = std::max({scale, 1.0, 2 * volume.field.node_m() / double(shader::kFootprintCell_m)});
    return scale;
}

bool diffuses(const CloudLight& light) {
    return light.multiple == MultipleScattering::diffusion && light.lighting == Lighting::light_pass &&
           light.multiple_scattering > 0;
}

namespace {

// Returns whether the line from a point towards the light passes the box of a field's bricks.
bool looks_through(const CoverageField& field, const Vec3& place_m, const Vec3& to_light) {
    if (field.period_m().x > 0)
        return place_m.z < field.corner_m().z + 2 * kCells * field.node_m() * field.bricks()[2];
    double begin = 0, end = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        const double low = field.corner_m()[axis] - place_m[axis],
                     high = low + 2 * kCells * field.node_m() * field.bricks()[std::size_t(axis)];
        if (to_light[axis] == 0) {
            if (low > 0 || high < 0) return false;
            continue;
        }
        const double a = low / to_light[axis], b = high / to_light[axis];
        begin = std::max(begin, std::min(a, b));
        end = std::min(end, std::max(a, b));
    }
    return begin < end;
}

// Interpolates between the corners of a cube of a table with rows of `width` and planes of `plane` numbers.
template <class Number>
float trilinear(const Number* corner, std::size_t width, std::size_t plane, const float (&rest)[3]) {
    float sum = 0;
    for (std::size_t n = 0; n < 8; ++n) {
        const std::size_t o[3] = {n & 1, n >> 1 & 1, n >> 2};
        float weight = 1;
        for (std::size_t axis = 0; axis < 3; ++axis) weight *= o[axis] != 0 ? rest[axis] : 1 - rest[axis];
        sum += weight * float(corner[o[2] * plane + o[1] * width + o[0]]);
    }
    return sum;
}

std::vector<std::uint32_t> shade_words(const LightFront& front) {
    const auto columns = std::size_t(front.columns()), rows = std::size_t(front.rows());
    std::vector<std::uint8_t> bytes(columns * rows);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
        const float share = std::min(front.depths()[i] / shader::kMostShadeDepth, 1.0f);
        bytes[i] = std::uint8_t(255 * std::sqrt(share) + 0.5f);
    }
    std::vector<std::uint32_t> words(bytes.size());
    for (std::size_t y = 0; y < rows; ++y) {
        for (std::size_t x = 0; x < columns; ++x) {
            const std::size_t x1 = (x + 1) % columns, y1 = (y + 1) % rows;
            words[y * columns + x] = bytes[y * columns + x] | std::uint32_t(bytes[y * columns + x1]) << 8 |
                                     std::uint32_t(bytes[y1 * columns + x]) << 16 |
                                     std::uint32_t(bytes[y1 * columns + x1]) << 24;
        }
    }
    return words;
}

}  // namespace

namespace {

// Calls work(number, place) for the corners of a brick's cells.
template <class Work>
void each_corner(const CoverageField& field, std::size_t brick, const Work& work) {
    const auto& bricks = field.bricks();
    const std::int32_t at = field.places()[brick];
    const Vec3 corner(at % bricks[0], at / bricks[0] % bricks[1], at / bricks[0] / bricks[1]);
    for (std::size_t i = 0; i < kLightNodesOfBrick; ++i) {
        const Vec3 node(i % kLightNodes, i / kLightNodes % kLightNodes, i / kLightNodes / kLightNodes);
        work(i, field.corner_m() + 2 * field.node_m() * (double(kCells) * corner + node));
    }
}

// Adds the depths of the other volumes at the corners of a brick's cells.
void add_other_volumes(std::span<const CloudVolume> volumes, std::size_t n, std::size_t brick, std::span<float> depths) {
    each_corner(volumes[n].field, brick, [&](std::size_t i, const Vec3& place) {
        for (std::size_t m = 0; m < volumes.size(); ++m)
            if (m != n) depths[i] += sun_depth_at(volumes[m], place);
    });
}

void light_by_sun(std::span<CloudVolume> volumes, std::span<const DiffusionCells> cells, const Vec3& to_sun,
                  const CloudLight& light, const DepthOfOthers& others) {
    const bool alone = volumes.size() == 1 && !others;
    // First each by itself, then what the others add.
    std::vector<std::vector<float>> depths(volumes.size());
    tbb::parallel_for(std::size_t{0}, volumes.size(), [&](std::size_t n) {
        CloudVolume& volume = volumes[n];
        const auto& bricks = volume.field.bricks();
        depths[n].resize(volume.field.places().size() * kLightNodesOfBrick);
        volume.own_depths.resize(alone ? 0 : depths[n].size());
        volume.corner_depths.resize(std::size_t(bricks[0] + 1) * std::size_t(bricks[1] + 1) * std::size_t(bricks[2] + 1));
        volume.to_sun = to_sun;
        volume.front = sweep(volume.field, volume.extinction, to_sun, depths[n], volume.corner_depths);
        volume.shade.clear();
        if (volume.front.is_periodic()) {
            volume.shade = shade_words(volume.front);
            double sum = 0;
            for (const float depth : volume.front.depths()) sum += double(std::exp(-depth));
            volume.mean_sunlight = float(sum / double(volume.front.depths().size()));
        }
        for (std::size_t i = 0; i < volume.own_depths.size(); ++i) volume.own_depths[i] = packed_depth(depths[n][i]);
    });
    for (std::size_t n = 0; n < volumes.size(); ++n) {
        CloudVolume& volume = volumes[n];
        volume.mean_cosine = mean_cosine(light.phase);
        volume.sun_depths.resize(depths[n].size() + 1);
        volume.sun_depths.back() = 0;
        const auto pack = [&](std::size_t brick) {
            const std::span of_brick = std::span(depths[n]).subspan(brick * kLightNodesOfBrick, kLightNodesOfBrick);
            if (volumes.size() > 1) add_other_volumes(volumes, n, brick, of_brick);
            if (light.lighting == Lighting::cfa)
                for (float& depth : of_brick)
                    depth = absorbed_depth(depth, volume.field.extinction_per_m(), light.light_distance_m);
            if (others)
                each_corner(volume.field, brick, [&](std::size_t i, const Vec3& place) { of_brick[i] += others(place); });
            std::ranges::transform(of_brick, &volume.sun_depths[brick * kLightNodesOfBrick], packed_depth);
        };
        tbb::parallel_for(std::size_t{0}, volume.field.places().size(), pack);
        volume.diffuse = {};
        if (!diffuses(light)) continue;
        if (is_thick(cells[n], volume.field.extinction_per_m()))
            volume.diffuse = diffuse_sunlight(halved(cells[n], volume.extinction), &cells[n], depths[n], to_sun, light.albedo);
        else
            volume.diffuse = diffuse_sunlight(cells[n], nullptr, depths[n], to_sun, light.albedo);
    }
}

}  // namespace

void light_volumes(std::span<CloudVolume> volumes, const Vec3& to_sun, const CloudLight& light, bool are_new,
                   const DepthOfOthers& others) {
    std::vector<DiffusionCells> cells;
    for (std::size_t n = 0; n < volumes.size() && (are_new || diffuses(light)); ++n)
        cells.push_back(wide_cells(volumes[n].field, volumes[n].extinction, mean_cosine(light.phase)));
    const auto see_surroundings = [&] {
        for (std::size_t n = 0; n < volumes.size() && are_new; ++n)
            volumes[n].surroundings = diffuse_surroundings(cells[n]);
    };
    tbb::parallel_invoke(see_surroundings, [&] { light_by_sun(volumes, cells, to_sun, light, others); });
}

namespace {

// A place in a field: the brick, and cells from its corner.
struct PlaceInField {
    std::size_t brick[3];
    double local[3];
    bool inside = true;
    std::int32_t number = -1;  // of a brick that holds cloud

    PlaceInField(const CoverageField& field, const Vec3& place_m) {
        const auto& bricks = field.bricks();
        const Vec3 cells = field.at_home(place_m - field.corner_m()) / (2 * field.node_m());
        for (int axis = 0; axis < 3; ++axis) {
            const double at = std::floor(cells[axis] / kCells);
            inside = inside && at >= 0 && at < bricks[std::size_t(axis)];
            brick[axis] = std::size_t(std::max(at, 0.0));
            local[axis] = cells[axis] - at * kCells;
        }
        if (inside)
            number = field.table()[(brick[2] * std::size_t(bricks[1]) + brick[1]) * std::size_t(bricks[0]) + brick[0]];
    }
};

}  // namespace

float sun_depth_at(const CloudVolume& volume, const Vec3& place_m) {
    if (!looks_through(volume.field, place_m, volume.to_sun)) return 0;
    const PlaceInField at(volume.field, place_m);
    if (!at.inside) return volume.front.depth_at(place_m);
    const auto x = std::size_t(volume.field.bricks()[0]) + 1, y = std::size_t(volume.field.bricks()[1]) + 1;
    float rest[3];
    if (at.number < 0) {
        for (int axis = 0; axis < 3; ++axis) rest[axis] = float(at.local[axis] / kCells);
        return trilinear(&volume.corner_depths[(at.brick[2] * y + at.brick[1]) * x + at.brick[0]], x, x * y, rest);
    }
    std::size_t whole[3];
    for (int axis = 0; axis < 3; ++axis) {
        whole[axis] = std::size_t(std::min(int(at.local[axis]), kCells - 1));
        rest[axis] = float(at.local[axis] - double(whole[axis]));
    }
    const std::vector<std::uint16_t>& depths = volume.own_depths.empty() ? volume.sun_depths : volume.own_depths;
    const std::size_t first = std::size_t(at.number) * kLightNodesOfBrick +
                              (whole[2] * kLightNodes + whole[1]) * kLightNodes + whole[0];
    const float root =
        trilinear(&depths[first], kLightNodes, std::size_t(kLightNodes) * kLightNodes, rest) / 65535;
    return root * root * kMostMarchedDepth;
}

// Metaballs are seen from far away, so nearly along the ground, and those whose light goes away from the eye hide behind
// others: of the level part of the flux the mean over directions towards the eye counts.
float equivalent_depth_at(const CloudVolume& volume, const Vec3& place_m, float sun_depth) {
    constexpr double kTowardsEye = 2 / std::numbers::pi;
    const PlaceInField at(volume.field, place_m);
    if (at.number < 0) return sun_depth;
    std::size_t node = std::size_t(at.number) * kLightNodesOfBrick, stride = 1;
    for (int axis = 0; axis < 3; ++axis, stride *= kLightNodes)
        node += stride * std::size_t(std::lround(at.local[axis]));
    const double root = double(volume.diffuse.upwards[node] & 255u) / 255, g = volume.mean_cosine;
    const unsigned sideways = volume.diffuse.sideways[node];
    const double outwards =
        kTowardsEye * std::hypot(double(sideways & 255u) - 128, double(sideways >> 8) - 128) / 127;
    const double diffuse = 0.25 * double(shader::kMostFluence) * root * root *
                           (double(shader::kDiffuseBase) + double(shader::diffuse_flux(float(g))) * outwards);
    const double near = 0.25 * double(shader::forward_light(float(g))) *
                        std::max(std::exp((g - 1) * double(sun_depth)) - std::exp(-double(sun_depth)), 0.0);
    return float(std::max(1 / std::max(diffuse + near, 1e-3) - 1, 0.0) / (1.5 * std::max(1 - g, 0.01)));
}

void cast_shadows(std::span<const CloudVolume> volumes, const ShadowFrame& frame, int size,
                  std::span<float> shadow) {
    // Where lines leave the world of clouds: as far down the light as no cloud reaches.
    const auto columns = std::size_t(size);
    tbb::parallel_for(0, size, [&](int row) {
        std::vector<float> depths(columns, 0.0f);
        const Vec3 first =
            frame.origin_m + 0.5 / size * frame.u_axis_m + (row + 0.5) / size * frame.v_axis_m;
        for (const CloudVolume& volume : volumes)
            volume.front.add_depths(first, frame.u_axis_m / double(size), depths);
        attenuate(depths, shadow.subspan(std::size_t(row) * columns, columns));
    });
}

}  // namespace nephos
