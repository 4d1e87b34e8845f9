// SPDX-License-Identifier: Apache-2.0
#pragma once

// A cloud and the sun's light on it, kept from picture to picture: a moving camera needs neither anew.
// Private to the module.

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/cloud/level_of_detail.h"
#include "render/cloud/stage_times.h"
#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// What the sun's light on a cloud depends on, as a hash of 128 bits: metaballs, extinction, direction to the
// sun, size of the shadow map, how the light finds its way, and level of detail. A few 10 microseconds per
// 10,000 metaballs.
using LightKey = std::array<std::uint64_t, 2>;
LightKey light_key(const MetaballCloud& cloud, const RenderOptions& options);

struct LitCloud {
    LightKey key{};
    PreparedCloud given;
    std::optional<DetailBlocks> blocks;  // of `given`; none where nothing is merged
    std::vector<Metaball> merged;        // what is drawn instead of the given metaballs; empty: those
    DetailView view;                     // from which they were merged
    PreparedCloud cloud;                 // what is drawn: `merged` or the given metaballs
    ShadowFrame frame;
    int shadow_size = 0;
    std::vector<float> sun_depths;          // optical depth to the sun, one for each of cloud.visible
    std::vector<float> shadow;              // texels of the shadow map
    std::vector<std::uint8_t> known_light;  // of `sun_depths`; 1 = computed
    std::vector<std::uint8_t> known_tiles;  // of `shadow`, one a tile
    bool all_known = false;
    bool drawn_again = false;  // this is not the first picture of the cloud
};

// Makes `kept` that of a cloud as it is drawn from a view, without its light, unless it is already. `cloud`
// must live as long as `kept` is read. Another view keeps the light if it merges the same metaballs, as it
// does without level of detail. Returns whether the light was kept.
bool cache_cloud(LitCloud& kept, const MetaballCloud& cloud, const RenderOptions& options,
                 const DetailView& view);

// Computes on the processor what is missing of the light of the balls numbered `source` whose `seen_balls` is
// not 0, and of the map's tiles whose `seen_tiles` is not 0; of all of it if `seen_balls` is null or if
// something is missing in a second picture. What one ball gets has the same bits whatever else is asked for.
// False if nothing was.
bool light_seen(LitCloud& kept, const std::vector<std::uint32_t>& source,
                const std::vector<std::uint8_t>* seen_balls, const std::vector<std::uint8_t>* seen_tiles,
                StageTimes* times);

}  // namespace nephos
