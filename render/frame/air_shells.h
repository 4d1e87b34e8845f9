// SPDX-License-Identifier: Apache-2.0
#pragma once

// D's shells, for light shafts and fog: concentric layers of air around the eye, "interleaved back to front
// (shell, clouds up to the next shell, next shell ...)". See docs/air.md; D: docs/sources.md.
//
// Shell k is the air between the distances ends[k - 1] and ends[k] of every ray, cut off by the ground. It is
// composited in front of all splats whose centres are at ends[k] or beyond, and behind all others. The air
// between the beginning of a splat's own shell and its centre is added to the light of the splat
// (render/shading/shells.glsl, shells-inl.h), so that nothing pops when a splat crosses from one shell into
// another.
//
// The light that clouds remove from a shell is computed by the shade map, a coarser shadow map with depth:
// each texel has the mean of the shadow map over a few texels, and the heights at which shade begins and is
// complete (with a low sun: the distances along the light), so that air above the clouds is sunlit. Light that veils per
// pixel take away (render/veil/veil_shade.h) is missing in the texels likewise, and beyond the map as at its rim; so air above
// the clouds and below a veil counts as sunlit. Private to the module.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/cloud/splats.h"
#include "render/frame/fog.h"
#include "render/frame/versioned.h"
#include "render/frame/view_sorting.h"
#include "render/image/picture.h"
#include "render/options/camera.h"
#include "render/shared/shared.h"

namespace nephos {

// The shade map and what shaders read behind it: cached until the light of the cloud changes.
struct ShadeCache {
    Version light = 0;         // of which it was made
    std::uint64_t serial = 0;  // changes when the words do
    std::vector<std::uint32_t> words;
    std::size_t shade_words = 0;            // of them; the others are noise of fog
    std::optional<std::uint64_t> fog_seed;  // of that; none: no noise
    int columns = 0;
    double texels_per_map = 0;  // texels across the whole shadow map
    Vec3 along{};               // AirShells::data.shade_along in the world: dot(along, point) + along_offset
    double along_offset = 0;
    float first_shade = 0;
};

struct AirShells {
    shader::Shells data;
    // Three planes of words in rows of settings.z words; each word has four bytes: of a texel, of its right
    // neighbour, and of the two in the next row. The planes: transmittance; the position along `shade_along`
    // at which the shade begins; that at which it is complete. Then, with fog, the words of FogNoise. Owned
    // by ShadeCache.
    std::span<const std::uint32_t> shade;
    std::uint64_t serial = 0;  // changes with the words; 0: none

    // Transmittance of clear air up to the end of each shell, if it depends on the distance alone (gradient
    // sky).
    std::vector<std::array<float, 3>> clear;

    std::size_t count() const { return std::size_t(data.settings.x); }
    bool any() const { return count() > 0; }
    bool has_fog() const { return data.fog.x > 0; }
};

// Returns the distance from the eye at which shell k ends, metres.
inline float shell_end(const shader::Shells& data, std::size_t k) {
    const shader::vec4& four = data.ends[k / 4];
    return k % 4 == 0 ? four.x : k % 4 == 1 ? four.y : k % 4 == 2 ? four.z : four.w;
}

// Returns the number of shells that end at a distance or before it.
std::size_t shells_before(const shader::Shells& data, float distance);

// Returns true when the options have shells: fog, or light shafts with clouds that cast a shadow. Shells
// sample the whole shadow map.
bool has_shells(const RenderOptions& options, bool casts_shadow);

// Holds the sunlight that the shells are made of.
struct AirLight {
    const ShadowFrame& frame;
    std::span<const float> shadow;  // the shadow map, or empty: its plane of AirShells::shade is left 0
    int shadow_size = 0;
    Version light = 0;                  // of cloud, frame, shadow and veils
    const AddedDepth* veils = nullptr;  // null: none
};

// Returns the shells of a frame; none when the options have none or they would have no effect. `time_s`: simulated time of the
// picture. What is returned lives as long as `cache` is not given to another call.
AirShells air_shells(const RenderOptions& options, const PreparedCloud& cloud,
                     std::span<const ShadowCaster> others, const AirLight& light, double time_s,
                     FogNoise& noise, ShadeCache& cache);

// Returns for each shell the number of splats in front of it; rising.
std::vector<std::uint32_t> splats_before_shells(const AirShells& shells, const ViewSortedSplats& order);

// Returns the runs of an order interleaved with runs of SplatKind::shell, one shell each, farthest first.
std::vector<Run> runs_between_shells(const AirShells& shells, const ViewSortedSplats& order);

}  // namespace nephos
