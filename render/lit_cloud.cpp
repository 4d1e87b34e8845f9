// SPDX-License-Identifier: Apache-2.0
#include "render/lit_cloud.h"

#include <algorithm>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>
#include <xxhash.h>

#include "render/cpu/processor_light.h"

namespace nephos {
namespace {

XXH128_hash_t hash_of(std::span<const std::byte> bytes) {
    constexpr std::size_t kPart = std::size_t{1} << 19;
    std::vector<XXH128_hash_t> parts((bytes.size() + kPart - 1) / kPart);
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t p) {
        const std::span part = bytes.subspan(p * kPart, std::min(kPart, bytes.size() - p * kPart));
        parts[p] = XXH3_128bits(part.data(), part.size());
    });
    return XXH3_128bits_withSeed(parts.data(), parts.size() * sizeof(XXH128_hash_t), bytes.size());
}

// Whether any that is wanted is not known yet.
bool any_missing(const std::vector<std::uint8_t>& wanted, const std::vector<std::uint8_t>& known) {
    for (std::size_t i = 0; i < wanted.size(); ++i)
        if (wanted[i] != 0 && known[i] == 0) return true;
    return false;
}

// Leaves those out of `wanted` that are known, and notes the others as known.
void take_missing(std::vector<std::uint8_t>& wanted, std::vector<std::uint8_t>& known) {
    for (std::size_t i = 0; i < wanted.size(); ++i) {
        wanted[i] = wanted[i] != 0 && known[i] == 0 ? 1 : 0;
        known[i] |= wanted[i];
    }
}

// Puts what is drawn in the place of the given metaballs. True if that is what `kept` has already.
bool draw_merged(LitCloud& kept, std::optional<MergedCloud> merged) {
    const bool same = merged ? merged->metaballs == kept.merged : kept.merged.empty();
    if (!merged) {
        kept.merged.clear();
        kept.cloud = kept.given;
        return same;
    }
    kept.merged = std::move(merged->metaballs);
    kept.cloud.metaballs = kept.merged;
    kept.cloud.depth_scale = std::move(merged->depth_scale);
    kept.cloud.visible.resize(kept.merged.size());
    std::iota(kept.cloud.visible.begin(), kept.cloud.visible.end(), 0u);
    kept.cloud.base_m = kept.given.base_m;
    kept.cloud.top_m = kept.given.top_m;
    return same;
}

}  // namespace

LightKey light_key(const MetaballCloud& cloud, const RenderOptions& options) {
    const XXH128_hash_t balls = hash_of(std::as_bytes(cloud.metaballs));
    const Vec3 to_sun = direction_to_sun(options.sun);
    const double rest[] = {cloud.extinction_per_m,
                           cloud.normalisation,
                           to_sun.x,
                           to_sun.y,
                           to_sun.z,
                           double(options.shadow_map_size),
                           double(int(options.light.lighting)),
                           options.light.light_distance_m,
                           options.level_of_detail.pixels};
    const XXH128_hash_t hash = XXH3_128bits_withSeed(rest, sizeof rest, balls.low64 ^ balls.high64 << 1);
    return {balls.low64 ^ hash.low64, balls.high64 ^ hash.high64};
}

bool cache_cloud(LitCloud& kept, const MetaballCloud& cloud, const RenderOptions& options,
                 const DetailView& view) {
    const LightKey key = light_key(cloud, options);
    const bool is_known = kept.shadow_size != 0 && key == kept.key;
    if (is_known) kept.given.metaballs = cloud.metaballs;  // the same values, perhaps elsewhere
    if (is_known && (view == kept.view || !kept.blocks)) {
        if (kept.merged.empty()) kept.cloud.metaballs = cloud.metaballs;
        kept.drawn_again = true;
        return true;
    }
    kept.shadow_size = 0;  // nothing is kept if prepare() throws
    if (!is_known) {
        kept.given = prepare(cloud);
        kept.blocks.reset();
        if (options.level_of_detail.pixels > 0) kept.blocks = detail_blocks(kept.given, cloud);
        // The frame is that of the given metaballs, as are base and top: level of detail does not move it.
        kept.frame = shadow_frame(kept.given, direction_to_sun(options.sun), options.shadow_map_size);
    }
    std::optional<MergedCloud> merged;
    if (kept.blocks) merged = merge_voxels(kept.given, cloud, *kept.blocks, view, options.level_of_detail);
    kept.view = view;
    kept.key = key;
    if (draw_merged(kept, std::move(merged)) && is_known) {
        kept.drawn_again = true;
        kept.shadow_size = options.shadow_map_size;
        return true;
    }
    const TileGrid grid{options.shadow_map_size, options.shadow_map_size};
    kept.sun_depths.assign(kept.cloud.visible.size(), 0.0f);
    kept.shadow.assign(std::size_t(grid.width) * std::size_t(grid.height), 1.0f);
    kept.known_light.assign(kept.sun_depths.size(), 0);
    kept.known_tiles.assign(grid.tiles(), 0);
    kept.all_known = kept.cloud.visible.empty();  // the map is white
    kept.drawn_again = false;
    kept.shadow_size = options.shadow_map_size;
    return false;
}

bool light_seen(LitCloud& kept, const std::vector<std::uint32_t>& source,
                const std::vector<std::uint8_t>* seen_balls, const std::vector<std::uint8_t>* seen_tiles,
                StageTimes* times) {
    if (kept.all_known) return false;
    std::vector<std::uint8_t> balls(kept.sun_depths.size(), seen_balls == nullptr ? 1 : 0);
    std::vector<std::uint8_t> tiles(kept.known_tiles.size(), 1);
    if (seen_balls != nullptr) {
        for (std::size_t i = 0; i < source.size(); ++i) balls[source[i]] = (*seen_balls)[i];
        tiles = *seen_tiles;
        if (!any_missing(balls, kept.known_light) && !any_missing(tiles, kept.known_tiles)) return false;
        if (kept.drawn_again) {  // a camera on its way: it will see the rest, too
            std::ranges::fill(balls, std::uint8_t{1});
            std::ranges::fill(tiles, std::uint8_t{1});
        }
    }
    take_missing(balls, kept.known_light);
    take_missing(tiles, kept.known_tiles);
    kept.all_known =
        std::ranges::count(kept.known_light, 0) == 0 && std::ranges::count(kept.known_tiles, 0) == 0;

    LightSortedSplats order;
    {
        const StageTimer timer(times, DrawStage::sun_order);
        order = sort_for_light(kept.cloud, kept.frame, kept.shadow_size);
    }
    if (times != nullptr)  // as for the order from the eye
        (*times)[DrawStage::sun_order].bytes = order.splats.size() * (2 * sizeof(Metaball) + 7 * 8 + 28);
    std::vector<std::uint8_t> centres(order.source.size());
    for (std::size_t i = 0; i < centres.size(); ++i) centres[i] = balls[order.source[i]];
    std::vector<float> depths;
    light_by_processor(order, kept.shadow_size, {centres, tiles}, depths, kept.shadow, {}, times);
    for (std::size_t i = 0; i < centres.size(); ++i)
        if (centres[i] != 0) kept.sun_depths[order.source[i]] = depths[i];
    return true;
}

}  // namespace nephos
