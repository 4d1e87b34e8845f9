// SPDX-License-Identifier: Apache-2.0
#pragma once

// The output of the renderer: a picture with its auxiliary layers, and the metadata of its file. Plain data
// in main memory; row 0 is the top row, x runs fastest, no padding between rows.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/vec.h"
#include "render/image/ground_light.h"

namespace nephos {

// The projection of the shadow map, parallel along the sun's rays: texel (column u, row v) is the line
// through origin_m + (u + 0.5) / size * u_axis_m + (v + 0.5) / size * v_axis_m along direction.
struct ShadowFrame {
    Vec3 origin_m{};   // world; corner of texel (0, 0)
    Vec3 u_axis_m{};   // from the first to the last column's far edge
    Vec3 v_axis_m{};   // from the first to the last row's far edge; perpendicular to u_axis_m
    Vec3 direction{};  // unit; of the light's travel
};

// Light in the air of a picture, for overlays such as rain; linear colours.
struct PictureAir {
    static constexpr std::size_t kHorizons = 16;
    std::array<double, 3> sun{};               // radiance of a white surface that faces the unshaded sun
    std::array<double, 3> sky{};               // mean radiance of the sky
    // Radiance of the air itself, far away: from towards the sun to opposite to it, at azimuths from it whose cosine is
    // 1 - 2 (n / (kHorizons - 1))^2.
    std::array<std::array<double, 3>, kHorizons> horizon{};
    std::array<double, 3> extinction_per_m{};  // near the ground
};

struct Picture {
    int width = 0, height = 0;
    std::vector<float> beauty;  // 3 * width * height, linear RGB, exposure not applied
    std::vector<float>
        transmittance;  // width * height, of the clouds along the pixel's ray: 1 = no cloud, 0 = opaque
    // width * height, metres from the eye along the pixel's ray: the mean over the cloud, weighted by the
    // visible opacity. Infinity where the cloud's opacity is less than 1/1024 (sky and ground).
    std::vector<float> depth_m;

    std::optional<PictureAir> air;  // of the physical sky; none: by RenderOptions::air

    // Of ground that is not level (HeightMap), else empty: its distance in each pixel, 1e30 where there is none, and its
    // radiance at the eye, 3 a pixel, with the air before it and without clouds.
    std::vector<float> terrain_m, terrain_light;

    int shadow_size = 0;        // texels on a side
    std::vector<float> shadow;  // shadow_size^2, transmittance of the whole cloud along the sun's rays
    ShadowFrame shadow_frame;

    // Fraction of sunlight that veils leave at a place of the world, which the shadow map has not; empty: all of it.
    std::function<float(const Vec3& place_m)> sunlight_of_veils;

    GroundLight ground_light;  // where it rains (RenderOptions::precipitation); else all is open

    // For each metaball of the cloud, in its order: transmittance of the cloud between its centre and the
    // sun.
    std::vector<float> light;

    std::size_t pixels() const { return std::size_t(width) * std::size_t(height); }
};

// The origin of a picture, for the header of every image file. Empty texts are omitted.
struct PictureMetadata {
    std::string scene;  // name or file of the scene, or of the volume that is drawn
    std::uint64_t seed = 0;
    std::string scene_hash;        // hexadecimal
    std::string state_hash;        // hexadecimal; of the state that is drawn
    std::string version;           // of nephos
    std::string backend;           // that drew: "cpu", "vulkan" or "blended"
    std::string device;            // of Vulkan, that drew
    double time_s = 0;             // simulated time
    double frames_per_second = 0;  // of film; 0 = a single picture
    double time_scale = 1;         // simulated seconds per second of film
    double extinction_per_m = 0;   // at density 1
};

}  // namespace nephos
