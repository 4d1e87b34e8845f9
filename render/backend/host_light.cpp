// SPDX-License-Identifier: Apache-2.0
#include "render/backend/host_light.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/backend/processor_light.h"
#include "render/cloud/voxel_absorption.h"
#include "render/frame/scattering_table.h"

namespace nephos {
namespace {

Vec3 centre_of(const PreparedCloud& cloud, std::size_t i) {
    const Metaball& ball = cloud.metaballs[cloud.visible[i]];
    return {ball.x, ball.y, ball.z};
}

// Returns whether metaballs that stand for no volume take light away.
bool has_plain_metaballs(const PreparedCloud& cloud) {
    return cloud.detailed.empty() ? !cloud.visible.empty() : std::ranges::count(cloud.detailed, 0) > 0;
}

// Returns the cloud with nothing but plain metaballs taking light away.
PreparedCloud plain_metaballs(const PreparedCloud& cloud) {
    PreparedCloud plain = cloud;
    for (std::size_t i = 0; i < plain.visible.size(); ++i)
        if (plain.is_detailed(i)) plain.depth_scale[i] = 0;
    return plain;
}

// Adds the optical depths of plain metaballs, as they were given, at places: metaballs that take no light away stand there.
void add_depths_of_metaballs(const LitCloud& cloud, std::span<const CloudBillboard> at,
                             std::vector<float>& depths, StageTimes& times) {
    PreparedCloud with_places = plain_metaballs(cloud.given);
    const std::size_t balls = with_places.visible.size();
    std::vector<Metaball> all;
    all.reserve(balls + at.size());
    for (const std::uint32_t i : with_places.visible) all.push_back(with_places.metaballs[i]);
    for (const CloudBillboard& place : at) {
        Metaball& ball = all.emplace_back();
        ball.x = float(place.centre_m.x);
        ball.y = float(place.centre_m.y);
        ball.z = float(place.centre_m.z);
        ball.radius = 1;
    }
    with_places.metaballs = all;
    with_places.visible.resize(all.size());
    for (std::size_t i = 0; i < all.size(); ++i) with_places.visible[i] = std::uint32_t(i);
    with_places.depth_scale.resize(all.size(), 0.0f);
    const LightSortedSplats order = sort_for_light(with_places, cloud.frame, cloud.shadow_size);
    std::vector<std::uint8_t> requested(order.source.size());
    for (std::size_t i = 0; i < requested.size(); ++i) requested[i] = order.source[i] >= balls ? 1 : 0;
    const std::vector<std::uint8_t> no_tiles(cloud.known_tiles.size(), 0);
    std::vector<float> found, no_map;
    light_by_processor(order, cloud.shadow_size, {requested, no_tiles}, found, no_map, {}, &times);
    for (std::size_t i = 0; i < requested.size(); ++i)
        if (requested[i] != 0) depths[order.source[i] - balls] += found[i];
}

}  // namespace

void complete_light_on_host(LitCloud& cloud, std::span<const std::uint8_t> balls,
                            std::span<const std::uint8_t> tiles, StageTimes& times) {
    const StageTimer timer(&times, DrawStage::light);
    cloud.drawn_depths.resize(cloud.sun_depths.size());
    if (has_plain_metaballs(cloud.cloud)) {
        const LightSortedSplats order =
            sort_for_light(plain_metaballs(cloud.cloud), cloud.frame, cloud.shadow_size);
        light_some_by_processor(order, cloud.shadow_size, balls, tiles, cloud.sun_depths, cloud.shadow, &times);
    }
    tbb::parallel_for(std::size_t{0}, cloud.sun_depths.size(), [&](std::size_t i) {
        if (balls[i] == 0) return;
        const Vec3 centre = centre_of(cloud.cloud, i);
        for (const CloudVolume& volume : cloud.volumes) cloud.sun_depths[i] += sun_depth_at(volume, centre);
        if (cloud.screen) cloud.sun_depths[i] += cloud.screen->depth_in_voxels_at(centre);
        cloud.drawn_depths[i] = cloud.sun_depths[i];
        if (!cloud.cloud.is_detailed(i)) return;
        for (const CloudVolume& volume : cloud.volumes) {
            if (volume.diffuse.upwards.empty()) continue;
            const float depth = equivalent_depth_at(volume, centre, cloud.sun_depths[i]);
            if (depth != cloud.sun_depths[i])
                cloud.drawn_depths[i] = two_depths({cloud.sun_depths[i], depth});
        }
    });
    if (std::ranges::count(tiles, 1) == 0) return;
    cast_shadows(cloud.volumes, cloud.frame, cloud.shadow_size, cloud.shadow);
    if (cloud.screen) cloud.screen->billboards.cast(cloud.frame, cloud.shadow_size, cloud.shadow);
}

void complete_light_on_host(LitCloud& cloud, StageTimes& times) {
    const std::vector<std::uint8_t> balls(cloud.sun_depths.size(), 1), tiles(cloud.known_tiles.size(), 1);
    complete_light_on_host(cloud, balls, tiles, times);
    cloud.all_known = true;
    cloud.note_light_pass();
}

void add_screen(LitCloud& cloud) {
    if (!cloud.screen) return;
    for (std::size_t i = 0; i < cloud.sun_depths.size(); ++i)
        cloud.sun_depths[i] += cloud.screen->depth_in_voxels_at(centre_of(cloud.cloud, i));
    cloud.screen->billboards.cast(cloud.frame, cloud.shadow_size, cloud.shadow);
}

void cache_billboard_light(LitCloud& cloud, const Splats& splats, const RenderOptions& options,
                           StageTimes& times) {
    if (!cloud.screen || splats.billboards.empty()) {
        cloud.billboard_sunlight.clear();
        cloud.billboard_key = {};
        return;
    }
    if (cloud.billboard_key == cloud.light_key && cloud.billboard_sunlight.size() == splats.billboards.size())
        return;
    const StageTimer timer(&times, DrawStage::light);
    std::vector<float> depths(splats.billboards.size(), 0.0f);
    const bool absorbs = options.light.lighting == Lighting::cfa && !cloud.given.visible.empty();
    if (absorbs) {
        const DensityBlocks blocks(cloud.given, splats.metaballs.extinction_per_m);
        const Vec3 to_sun = direction_to_sun(options.sun);
        tbb::parallel_for(std::size_t{0}, depths.size(), [&](std::size_t i) {
            const double absorbed = blocks.absorbed_towards(splats.billboards[i].centre_m, to_sun,
                                                            options.light.light_distance_m);
            depths[i] = float(-std::log(std::max(1 - absorbed, 1e-30)));
        });
    } else if (has_plain_metaballs(cloud.given)) {
        add_depths_of_metaballs(cloud, splats.billboards, depths, times);
    }
    tbb::parallel_for(std::size_t{0}, depths.size(), [&](std::size_t i) {
        const CloudBillboard& billboard = splats.billboards[i];
        depths[i] += cloud.screen->depth_at(billboard.centre_m, billboard.cloud);
        if (absorbs) return;
        for (const CloudVolume& volume : cloud.volumes) depths[i] += sun_depth_at(volume, billboard.centre_m);
    });
    cloud.billboard_sunlight.resize(depths.size());
    std::ranges::transform(depths, cloud.billboard_sunlight.begin(),
                           [](float depth) { return std::exp(-depth); });
    cloud.billboard_key = cloud.light_key;
}

}  // namespace nephos
