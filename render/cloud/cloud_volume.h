// SPDX-License-Identifier: Apache-2.0
#pragma once

// A voxel cloud with detail (density/detail.h) as back-ends march it, and the light in it: optical depths towards the
// sun, diffuse sunlight, and the light of sky and ground, at the corners of the lattice's cells. Private to the module.

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "density/detail.h"
#include "render/cloud/diffusion.h"
#include "render/cloud/light_sweep.h"
#include "render/cloud/splats.h"
#include "render/image/picture.h"
#include "render/options/options.h"
#include "render/shared/march.h"

namespace nephos {

// Depths of more are all alike: nothing arrives.
inline constexpr float kMostMarchedDepth = shader::kMostMarchedDepth;

struct CloudVolume {
    explicit CloudVolume(const DetailedVoxels& voxels);

    CoverageField field;
    // Mean extinction of each cell of each brick that holds cloud, per metre.
    std::vector<float> extinction;
    // kLightNodesOfBrick numbers for each such brick and one more: 65535 sqrt(depth / kMostMarchedDepth), and the
    // fractions of light from the sky (lower byte) and from the ground (upper byte), 0..255 (diffuse_surroundings()).
    std::vector<std::uint16_t> sun_depths, surroundings;
    // Sunlight that this volume alone attenuates: on the way out, at the corners of all bricks (x fastest, bricks + 1 on
    // each axis), and like sun_depths, where anything else shades it.
    Vec3 to_sun{0, 0, 1};
    LightFront front;
    // Of a field that repeats: its depths as endless.glsl reads them, a word for each: with those of the next
    // column, the next row, and both.
    std::vector<std::uint32_t> shade;
    float mean_sunlight = 1;  // that these leave
    DiffuseLight diffuse;  // where diffuses(light)
    double mean_cosine = 0;
    std::vector<float> corner_depths;
    std::vector<std::uint16_t> own_depths;

    std::size_t memory_bytes() const;
};

// Returns how many times the footprints are larger at which metaballs take over from rays, than with cells of 40 m: by
// the largest cells; at least 1, and 0 without volumes.
double footprint_scale(std::span<const CloudVolume> volumes);

// Returns whether multiply scattered sunlight diffuses from cell to cell: with MultipleScattering::diffusion, but for the
// absorption of T.
bool diffuses(const CloudLight& light);

// Optical depth towards the sun at a place of the world of what is no cloud of voxels; empty: 0. Thread-safe.
using DepthOfOthers = std::function<float(const Vec3& place_m)>;

// Computes the sunlight in all volumes; they shade each other, and `others` shade them. With Lighting::cfa its absorption is
// that of T. Where they are new, also the surroundings, which do not depend on the sun.
void light_volumes(std::span<CloudVolume> volumes, const Vec3& to_sun, const CloudLight& light, bool are_new,
                   const DepthOfOthers& others = {});

// Returns the optical depth of a volume alone towards the sun, at any place of the world. After light_volumes().
float sun_depth_at(const CloudVolume& volume, const Vec3& place_m);

// Returns the depth at which a metaball at the place has as much light that was scattered often as the volume there:
// 1 / (1 + 1.5 (1 - g) depth) (scattering_table.h). Where diffuses(light).
float equivalent_depth_at(const CloudVolume& volume, const Vec3& place_m, float sun_depth);

// Multiplies the texels of a shadow map by the light that the volumes leave.
void cast_shadows(std::span<const CloudVolume> volumes, const ShadowFrame& frame, int size, std::span<float> shadow);

}  // namespace nephos
