// SPDX-License-Identifier: Apache-2.0
#include "render/backend/lit_cloud.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>
#include <xxhash.h>

#include "render/cloud/dimmed_volumes.h"
#include "render/cloud/light_below.h"
#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"

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

// Puts what is drawn in the place of the given metaballs. True if that is what `cached` has already.
bool draw_merged(LitCloud& cached, std::optional<MergedCloud> merged) {
    const bool same = merged ? merged->metaballs == cached.merged : cached.merged.empty();
    if (!merged) {
        cached.merged.clear();
        cached.cloud = cached.given;
        return same;
    }
    cached.merged = std::move(merged->metaballs);
    cached.cloud.metaballs = cached.merged;
    cached.cloud.depth_scale = std::move(merged->depth_scale);
    cached.cloud.detailed = std::move(merged->detailed);
    cached.cloud.visible.resize(cached.merged.size());
    std::iota(cached.cloud.visible.begin(), cached.cloud.visible.end(), 0u);
    cached.cloud.base_m = cached.given.base_m;
    cached.cloud.top_m = cached.given.top_m;
    return same;
}

CacheKey key_of(const XXH128_hash_t& base, std::span<const double> rest) {
    const XXH128_hash_t hash =
        XXH3_128bits_withSeed(rest.data(), rest.size_bytes(), base.low64 ^ base.high64 << 1);
    return {base.low64 ^ hash.low64, base.high64 ^ hash.high64};
}

CacheKey metaballs_key(const MetaballCloud& cloud) {
    const double rest[] = {cloud.extinction_per_m, cloud.normalisation};
    return key_of(hash_of(std::as_bytes(cloud.metaballs)), rest);
}

CacheKey light_key(const CacheKey& metaballs, const CacheKey& screen, const RenderOptions& options) {
    const Vec3 to_sun = direction_to_sun(options.sun);
    const double rest[] = {to_sun.x,
                           to_sun.y,
                           to_sun.z,
                           double(options.shadow_map_size),
                           double(int(options.light.lighting)),
                           options.light.light_distance_m,
                           options.level_of_detail.pixels,
                           std::bit_cast<double>(screen[0]),
                           std::bit_cast<double>(screen[1])};
    return key_of({metaballs[0], metaballs[1]}, rest);
}

// Of the parts with detail, whose densities are those of their metaballs.
CacheKey volumes_key(const CacheKey& metaballs, const MetaballCloud& cloud, const RenderOptions& options) {
    const CloudLight& light = options.light;
    std::vector<double> rest{mean_cosine(light.phase), double(diffuses(light)), light.albedo};
    for (const DetailedVoxels& part : cloud.detailed) {
        const DetailSetting& s = part.setting;
        const DetailOptions& o = s.options;
        const Vec3 origin = part.density.placement().origin_m;
        for (const double number : {double(part.first), double(part.count), s.metaball_radius_cells, s.extinction_per_m, s.drift_m.x,
                                    s.drift_m.y, s.drift_m.z, s.along.x, s.along.y, o.strength, o.size_m,
                                    o.stretch, o.wisps, o.thermals, o.mean_free_path_m,
                                    double(repeats(s)), double(s.images), double(s.boundaries.x), double(s.boundaries.y),
                                    double(s.boundaries.z), double(o.apron_cells), s.opacity, double(part.density.extent().x),
                                    double(part.density.extent().y), double(part.density.extent().z), origin.x, origin.y, origin.z,
                                    part.density.placement().cell_size_m, part.moisture ? part.moisture->sum() : -1.0})
            rest.push_back(number);
        rest.push_back(s.bands.height_m);
        for (const Vec2& apart : s.bands.apart_m) rest.insert(rest.end(), {apart.x, apart.y});
    }
    return key_of({metaballs[0], metaballs[1]}, rest);
}

// What of a billboard its shade depends on.
void append_words(const CloudBillboard& of, std::vector<double>& words) {
    words.insert(words.end(), {of.centre_m.x, of.centre_m.y, of.centre_m.z, double(of.width_m), double(of.height_m),
                               double(of.opacity), double(int(of.texture)), double(of.variant), double(of.picture),
                               double(of.cloud)});
}

}  // namespace

float SunScreen::depth_at(const Vec3& place_m, std::uint32_t but_for_cloud) const {
    constexpr float kLeastLeft = 1e-30f;
    float depth = veils.any() ? veils.at(place_m) : 0;
    if (const float left = billboards.sunlight_at(place_m, but_for_cloud); left < 1)
        depth -= std::log(std::max(left, kLeastLeft));
    return depth;
}

CacheKey key_of_numbers(std::span<const float> numbers) { return key_of(hash_of(std::as_bytes(numbers)), {}); }

void cache_screen(LitCloud& cached, const Splats& splats, const AddedDepth& veils,
                  const RenderOptions& options) {
    const bool shines = daylight(options.sun.elevation_deg).sun > 0;
    if (!shines ||
        (splats.billboards.empty() && splats.unseen.empty() && !veils.any() && !splats.in_voxels.any())) {
        cached.screen = nullptr;
        cached.screen_key = {};
        return;
    }
    const Vec3 to_sun = direction_to_sun(options.sun);
    std::vector<double> words{to_sun.x, to_sun.y, to_sun.z, double(splats.billboards.size()),
                              splats.pictures ? double(reinterpret_cast<std::uintptr_t>(splats.pictures.get())) : 0.0,
                              std::bit_cast<double>(veils.key[0]), std::bit_cast<double>(veils.key[1])};
    if (splats.in_voxels.any())
        for (const std::uint64_t word : splats.in_voxels.key) words.push_back(std::bit_cast<double>(word));
    words.reserve(words.size() + 10 * (splats.billboards.size() + splats.unseen.size()));
    for (const CloudBillboard& each : splats.billboards) append_words(each, words);
    for (const CloudBillboard& each : splats.unseen) append_words(each, words);
    const CacheKey key = key_of(hash_of(std::as_bytes(std::span(words))), {});
    if (cached.screen && key == cached.screen_key) return;
    cached.screen = std::make_shared<const SunScreen>(SunScreen{
        BillboardShade(splats.billboards, splats.unseen, splats.pictures, to_sun), veils, splats.in_voxels});
    cached.screen_key = key;
}

void cache_ground_light(LitCloud& cached, const RenderOptions& options) {
    const Vec3 to_sun = direction_to_sun(options.sun);
    const double cosine = mean_cosine(options.light.phase);
    const double rest[] = {to_sun.x, to_sun.y, to_sun.z, cosine, options.ground.height_m};
    const CacheKey& cloud = cached.volumes.empty() ? cached.metaballs_key : cached.volumes_key;
    const CacheKey key = key_of({cloud[0], cloud[1]}, rest);
    if (key == cached.ground_light_key) return;
    RepeatedArea repeated;
    for (const CloudVolume& volume : cached.volumes) {
        const CoverageField& field = volume.field;
        if (field.period_m().x > 0 && field.period_m().x > repeated.edges_m.x)
            repeated = {Vec2(field.corner_m()) + field.home_m(), field.period_m()};
    }
    cached.ground_light_key = {};
    cached.ground_light = light_below(cached.given, repeated, to_sun, cosine, options.ground.height_m);
    cached.ground_light_key = key;
    cached.volumes_light = next_version();  // a device has it with the light of the volumes
}

void cache_volumes(LitCloud& cached, const MetaballCloud& cloud, const RenderOptions& options) {
    if (cloud.detailed.empty() && cached.volumes.empty()) return;
    const CacheKey& key = cached.given_volumes_key;
    const bool are_new = key != cached.volumes_key;
    if (are_new) {
        cached.volumes.clear();
        cached.volumes_key = {};
        for (const DetailedVoxels& part : cloud.detailed) cached.volumes.emplace_back(part);
        cached.volumes_light_key = {};
        cached.volumes_version = next_version();
    }
    if (cached.light_key == cached.volumes_light_key) return;
    DepthOfOthers others;
    const SunScreen* const screen = cached.screen.get();
    if (screen != nullptr && (screen->veils.any() || !screen->billboards.empty()))
        others = [screen](const Vec3& place_m) { return screen->depth_at(place_m); };
    light_volumes(cached.volumes, direction_to_sun(options.sun), options.light, are_new, others);
    if (screen != nullptr && screen->in_voxels.any()) dim_volumes(cached.volumes, screen->in_voxels.at);
    cached.volumes_key = key;  // only now: if light fails, all is new again
    cached.volumes_light_key = cached.light_key;
    cached.volumes_light = next_version();
}

void cache_cloud(LitCloud& cached, const MetaballCloud& cloud, const RenderOptions& options,
                 const DetailView& view) {
    const CacheKey metaballs = metaballs_key(cloud),
                   volumes = cloud.detailed.empty() ? metaballs : volumes_key(metaballs, cloud, options),
                   light = light_key(volumes, cached.screen_key, options);
    cached.given_volumes_key = volumes;
    const bool was_cached = cached.shadow_size != 0;
    const bool is_known = was_cached && light == cached.light_key;
    if (is_known) cached.given.metaballs = cloud.metaballs;  // the same values, perhaps elsewhere
    if (is_known && (view == cached.view || !cached.blocks)) {
        if (cached.merged.empty()) cached.cloud.metaballs = cloud.metaballs;
        cached.drawn_again = true;
        return;
    }
    const bool was_given = was_cached && cached.merged.empty() && metaballs == cached.metaballs_key;
    cached.shadow_size = 0;  // nothing is cached if prepare() throws
    if (!is_known) {
        cached.given = prepare(cloud);
        cached.blocks.reset();
        if (options.level_of_detail.pixels > 0) cached.blocks = detail_blocks(cached.given, cloud);
        // The frame is that of the given metaballs, as are base and top: level of detail does not move it.
        cached.frame = shadow_frame(cached.given, direction_to_sun(options.sun), options.shadow_map_size, cached.casters());
    }
    std::optional<MergedCloud> merged;
    if (cached.blocks)
        merged = merge_voxels(cached.given, cloud, *cached.blocks, view, options.level_of_detail);
    cached.view = view;
    cached.metaballs_key = metaballs;
    cached.light_key = light;
    const bool is_same = draw_merged(cached, std::move(merged));
    if (is_same && is_known) {
        cached.drawn_again = true;
        cached.shadow_size = options.shadow_map_size;
        return;
    }
    if (!was_given || !cached.merged.empty()) cached.metaballs = next_version();
    const TileGrid grid{options.shadow_map_size, options.shadow_map_size};
    cached.sun_depths.assign(cached.cloud.visible.size(), 0.0f);
    cached.drawn_depths.clear();
    cached.shadow.assign(std::size_t(grid.width) * std::size_t(grid.height), 1.0f);
    cached.known_light.assign(cached.sun_depths.size(), 0);
    cached.known_tiles.assign(grid.tiles(), 0);
    cached.all_known = !cached.casts_shadow();  // the map is white
    cached.drawn_again = false;
    cached.light = cached.host_light = next_version();
    cached.shadow_size = options.shadow_map_size;
}

}  // namespace nephos
