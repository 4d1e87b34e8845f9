// SPDX-License-Identifier: Apache-2.0
#pragma once

// A cloud and the sun's light on it, cached from picture to picture: a moving camera needs neither anew.
// Private to the module.

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/cloud/cloud_volume.h"
#include "render/cloud/level_of_detail.h"
#include "render/frame/billboard_shade.h"
#include "render/frame/versioned.h"
#include "render/image/ground_light.h"
#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// Hash of 128 bits of what a cached value was computed from. A few 10 microseconds per 10,000 metaballs.
using CacheKey = std::array<std::uint64_t, 2>;

// What shades a cloud of voxels beside itself.
struct SunScreen {
    BillboardShade billboards;
    AddedDepth veils;
    AddedDepth in_voxels;  // Splats::in_voxels

    // Returns the optical depth towards the sun of everything, but for the billboards of one cloud.
    float depth_at(const Vec3& place_m, std::uint32_t but_for_cloud = BillboardShade::kNoCloud) const;
    // The same for voxels at the place.
    float depth_in_voxels_at(const Vec3& place_m) const {
        return depth_at(place_m) + (in_voxels.any() ? in_voxels.at(place_m) : 0);
    }
};

struct LitCloud {
    CacheKey metaballs_key{};  // of the given metaballs, extinction and normalisation
    // Key of the sun's light: the above, direction to the sun, size of the shadow map, Lighting, and level of
    // detail.
    CacheKey light_key{};
    PreparedCloud given;
    std::optional<DetailBlocks> blocks;  // of `given`; none where nothing is merged
    std::vector<Metaball> merged;        // drawn instead of the given metaballs; empty: those are drawn
    DetailView view;                     // from which they were merged
    PreparedCloud cloud;                 // the drawn metaballs: `merged` or the given ones
    ShadowFrame frame;
    int shadow_size = 0;
    std::vector<float> sun_depths;          // optical depth to the sun, one for each of cloud.visible
    std::vector<float> drawn_depths;        // with volumes: those that metaballs are drawn with, by diffuse light
    std::vector<float> shadow;              // shadow_size^2 texels of the shadow map
    std::vector<std::uint8_t> known_light;  // 1 for each of `sun_depths` that is computed
    std::vector<std::uint8_t> known_tiles;  // 1 for each tile of `shadow` that is computed
    bool all_known = false;
    bool drawn_again = false;  // this is not the first picture of the cloud

    Version metaballs = 0;  // of `cloud` without its light
    Version light = 0;      // of the light of `cloud` and its shadow map
    // Version of `sun_depths` and `shadow`. If it differs from `light`, they are on a device
    // (Backend::fetch_light()).
    Version host_light = 0;
    std::size_t light_passes = 0;  // so far

    std::shared_ptr<const SunScreen> screen;  // null: nothing else takes sunlight away
    CacheKey screen_key{};
    // Fraction of the sunlight at each of Splats::billboards that everything but its own cloud leaves; empty: all of it.
    std::vector<float> billboard_sunlight;
    CacheKey billboard_key{};  // of which it was computed

    // Returns what casts shadows beside the metaballs.
    std::span<const ShadowCaster> casters() const {
        return screen ? screen->billboards.casters() : std::span<const ShadowCaster>{};
    }
    // Returns whether there may be shade in the shadow map.
    bool casts_shadow() const { return !cloud.visible.empty() || !casters().empty(); }
    // Returns whether the processor computes all light, for every back-end (host_light.h).
    bool lit_on_host() const { return !volumes.empty() || screen != nullptr; }

    // The parts with detail, in their order, with their light. See DetailedVoxels.
    std::vector<CloudVolume> volumes;
    GroundLight ground_light;  // below `given`; made by cache_ground_light()
    CacheKey ground_light_key{};
    CacheKey volumes_key{}, volumes_light_key{};
    CacheKey given_volumes_key{};  // of the cloud that cache_cloud() was given last
    Version volumes_version = 0, volumes_light = 0;

    // Returns the depths that metaballs are drawn with.
    const std::vector<float>& depths_to_draw() const { return drawn_depths.empty() ? sun_depths : drawn_depths; }

    // Notes that a pass has changed sun_depths or shadow.
    void note_light_pass() {
        light = host_light = next_version();
        ++light_passes;
    }
};

// Returns the key of some numbers.
CacheKey key_of_numbers(std::span<const float> numbers);

// Makes cached.screen that of billboards, veils and what voxels lose; none while the sun is below the horizon. Before
// cache_cloud().
void cache_screen(LitCloud& cached, const Splats& splats, const AddedDepth& veils,
                  const RenderOptions& options);

// Makes `cached` that of a cloud as it is drawn from a view, without its light, unless it is already. `cloud`
// must live as long as `cached` is read. Another view keeps the light if it merges the same metaballs, as it
// does without level of detail.
void cache_cloud(LitCloud& cached, const MetaballCloud& cloud, const RenderOptions& options,
                 const DetailView& view);

// Makes cached.volumes those of the same cloud, with their light. After cache_cloud().
void cache_volumes(LitCloud& cached, const MetaballCloud& cloud, const RenderOptions& options);

// Makes cached.ground_light that below the same cloud. After cache_volumes().
void cache_ground_light(LitCloud& cached, const RenderOptions& options);

}  // namespace nephos
