// SPDX-License-Identifier: Apache-2.0
#include "render/backend/volume_light.h"

#include <algorithm>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/backend/processor_light.h"
#include "render/frame/scattering_table.h"

namespace nephos {

void complete_light_of_volumes(LitCloud& cloud, std::span<const std::uint8_t> balls,
                               std::span<const std::uint8_t> tiles, StageTimes& times) {
    const StageTimer timer(&times, DrawStage::light);
    cloud.drawn_depths.resize(cloud.sun_depths.size());
    if (cloud.cloud.detailed.empty() || std::ranges::count(cloud.cloud.detailed, 0) > 0) {
        PreparedCloud others = cloud.cloud;
        for (std::size_t i = 0; i < others.visible.size(); ++i)
            if (others.is_detailed(i)) others.depth_scale[i] = 0;
        const LightSortedSplats order = sort_for_light(others, cloud.frame, cloud.shadow_size);
        std::vector<std::uint8_t> centres(order.source.size());
        for (std::size_t i = 0; i < centres.size(); ++i) centres[i] = balls[order.source[i]];
        std::vector<float> depths;
        light_by_processor(order, cloud.shadow_size, {centres, tiles}, depths, cloud.shadow, {}, &times);
        for (std::size_t i = 0; i < centres.size(); ++i)
            if (centres[i] != 0) cloud.sun_depths[order.source[i]] = depths[i];
    }
    tbb::parallel_for(std::size_t{0}, cloud.sun_depths.size(), [&](std::size_t i) {
        if (balls[i] == 0) return;
        const Metaball& ball = cloud.cloud.metaballs[cloud.cloud.visible[i]];
        const Vec3 centre(ball.x, ball.y, ball.z);
        for (const CloudVolume& volume : cloud.volumes) cloud.sun_depths[i] += sun_depth_at(volume, centre);
        cloud.drawn_depths[i] = cloud.sun_depths[i];
        if (!cloud.cloud.is_detailed(i)) return;
        for (const CloudVolume& volume : cloud.volumes) {
            if (volume.diffuse.upwards.empty()) continue;
            const float depth = equivalent_depth_at(volume, centre, cloud.sun_depths[i]);
            if (depth != cloud.sun_depths[i]) cloud.drawn_depths[i] = two_depths({cloud.sun_depths[i], depth});
        }
    });
    if (std::ranges::count(tiles, 1) > 0) cast_shadows(cloud.volumes, cloud.frame, cloud.shadow_size, cloud.shadow);
}

}  // namespace nephos
