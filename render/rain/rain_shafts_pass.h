// SPDX-License-Identifier: Apache-2.0
#pragma once

// The parameters of a frame's rain shafts for the SIMD kernel, in floats and relative to the eye. Private to
// the module.

#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec3.hpp>

#include "render/rain/rain_shafts.h"
#include "render/rain/rainbow.h"
#include "render/shared/shared.h"

namespace nephos {

// A curtain for intersection with rays: in units of its semi-axes, without its lean.
struct SeenCurtain {
    float eye_x = 0, eye_y = 0, eye_z = 0;            // in units; metres above the ground
    float ax = 1, ay = 0, bx = 0, by = 1;             // from metres to units
    float lean_x = 0, lean_y = 0;                     // metres per metre of height
    float height_m = 1, per_height = 1;               // of the cloud above the ground
    float reach_m = 0, centre_x = 0, centre_y = 0;    // circle around it, from the eye
    float per_m = 0;                                  // extinction where the rain is whole
    float sun_x = 0, sun_y = 0, sun_per_m = 0;        // a metre towards the sun, in units; extinction of its light
    float grain_x = 0, grain_y = 0, per_grain = 0;    // the eye in cells of the texture, from metres to cells
    float own = 0;                                    // its part of the noise
    float fall = 0, per_fall = 1 / kShaftFallCell_m;  // of the texture, likewise
    // The cloud above (RainCurtain::cloud); null: level. The eye, carried along the lean to base_m, in its texels; texels
    // per metre.
    const CloudBases* cloud = nullptr;
    float cloud_x = 0, cloud_y = 0, per_texel = 0;
    float ground_m = 0;
};

// The parameters shared by all rays of a frame.
struct ShaftPass {
    glm::vec3 forward{}, right{}, up{};  // of the camera; right and up to the sides of the picture
    std::size_t width = 0;
    float column = 0, row = 0;  // of a pixel, in halves of the picture
    std::vector<SeenCurtain> curtains;
    std::vector<std::uint32_t> noise;  // shaft_noise_cells()
    float softness = 0, fray = 0, contrast = 0, evaporation = 0;
    float sun_profile = 0;
    float clear_m = 0;  // around the eye, where particles are drawn instead
    glm::vec3 by_sky{}, by_sunlit_ground{}, by_scattered_sun{}, sun{}, to_sun{}, flash{}, flash_m{}, air_per_m{};
    float horizon[3][PictureAir::kHorizons] = {};  // PictureAir::horizon
    float forward_g = 0;
    const Rainbow* bow = nullptr;  // null: flakes
    bool has_sun = false, has_flash = false;
    const GroundLight* ground = nullptr;  // null: no cloud
    shader::vec4 ground_place{};          // of a point relative to the eye (PictureFrame::ground_light_place)
    const float* shadow = nullptr;
    std::vector<float> veiled_shadow;  // shadow_with_veils(), where it is read instead of the picture's
    int shadow_size = 0;
    float shadow_u = 0, shadow_v = 0;  // the eye in the map, 0..1
    glm::vec3 to_u{}, to_v{};
};

// Returns the parameters of a picture's rain, without its noise: of the curtains in which rain falls, in their order. It
// refers to the picture and the curtains' clouds.
ShaftPass shaft_pass(const Picture& picture, const RenderOptions& options, const CameraFrame& camera,
                     std::span<const RainCurtain> curtains, const PrecipitationLight& light, double time_s);

// Returns the noise of a seed: of each cell of its lattice the four corners, a byte each.
std::vector<std::uint32_t> shaft_noise_cells(std::uint64_t seed);

}  // namespace nephos
