// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the kernels of march-inl.h read, and where the rays of a tile are. Private to the module.

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "density/detail_kernels.h"
#include "render/cloud/cloud_volume.h"
#include "render/frame/view_sorting.h"
#include "render/options/camera.h"
#include "render/shared/march.h"
#include "render/shared/shared.h"

namespace nephos {

struct MarchedVolume {
    DetailKernel kernel;
    float corner[3] = {};  // of its field, relative to the eye, metres
    float reach = 80;      // metres to cloud per missing coverage, at most
    float cloud_odds = 0, most_patches = 1;  // ErosionConstants::cloud_odds(); patches_at() at most
    // As in shader::MarchVolume.
    float home = 0, period[2] = {}, per_period[2] = {}, bend = 0;
    bool repeats = false;
    float to_patches[4] = {}, patch_ramp = 0;
    shader::vec4 shade_u{}, shade_v{};
    float shade_mid[2] = {}, shade_top = 0, per_shade_height = 1, mean_sunlight = 1;
    int shade_columns = 1, shade_rows = 1;
    const std::uint32_t* shade = nullptr;
    const std::uint16_t *sun_depths = nullptr, *surroundings = nullptr, *upwards = nullptr, *sideways = nullptr;

    // `bend`: of the round Earth, 1 / m (shader::FrameUniforms::earth); 0 over a plane.
    MarchedVolume(const CloudVolume& volume, const Vec3& eye_m, float bend);

  private:
    void set_repeats(const CloudVolume& volume, const Vec3& eye_m);
};

struct MarchedScene {
    std::vector<MarchedVolume> volumes;
    float per_unit = 1;                    // footprint of a pixel at distance 1
    float fade_begins = 1, fade_ends = 1;  // metres from the eye
    float least_step = 1;                  // in cloud, metres
    float most_step = shader::kFarAway_m;  // likewise
    bool repeats = false;                  // one of them does
    float diffuse = 0, mean_cosine = 0;    // as in shader::March

    MarchedScene() = default;
    // Throws Error(usage) when there are more than shader::kMostVolumes that hold cloud.
    MarchedScene(std::span<const CloudVolume> of, const CameraFrame& camera, double pixels_per_unit,
                 const CloudLight& light, float bend);
};

// The rays of a tile's pixels, row by row, between two parts of the march.
struct MarchState {
    static constexpr std::size_t kPixels = shader::kTileWidth * shader::kTileHeight;
    alignas(64) float distance[kPixels];         // of the next sample
    alignas(64) float extinction[kPixels] = {};  // of the last
    alignas(64) float step[kPixels] = {};        // from the last to the next
    alignas(64) float margin[kPixels];           // of the last; below 0: no sample, empty space was skipped
    alignas(64) float end[kPixels];              // distance at which the ray ends
    float next = 0;                              // the least distance of a next sample
    bool begun = false, done = false;

    // Sets `next` and `done`, given the kPixels fractions of the light behind them that rays leave, and those at which
    // nothing is seen.
    void find_next(const float* transmittance, const float* opaque);
};

}  // namespace nephos
