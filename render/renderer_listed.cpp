// SPDX-License-Identifier: Apache-2.0
// Pictures from lists that the device makes (listed_view.h).

#include <algorithm>

#include "render/renderer_impl.h"
#include "render/shared/half_floats.h"

namespace nephos {
ListedView& Renderer::Impl::lists_on_device() {
    if (!listed_view) listed_view.emplace(gpu, layout, attenuation_on_device(), clamped, white_beyond);
    return *listed_view;
}

bool Renderer::Impl::uses_lists(const Drawing& drawing, const CameraFrame& camera) {
    return uses_device_lists() && !drawing.too_much && drawing.splats.billboards.empty() &&
           !lit.cloud.visible.empty() && lit.cloud.visible.size() <= lists_on_device().limits.balls &&
           cloud_is_near && is_near_enough(camera.position_m);
}

void Renderer::Impl::send_cloud(const MetaballCloud& given, bool light_follows) {
    std::optional<LightKey> key;
    if (lit.merged.empty()) key = light_key(given, {});
    if (light_follows && key && key == metaballs_on_device) return;
    metaballs_on_device.reset();  // until all of it is there
    lists_on_device().use_cloud(cloud_balls(lit.cloud, lit.sun_depths));
    metaballs_on_device = key;
}

bool Renderer::Impl::light_listed(const MetaballCloud& given) {
    if (!uses_device_lists() || !cloud_is_near || lit.cloud.visible.empty() ||
        lit.cloud.visible.size() > lists_on_device().limits.balls)
        return false;
    ListedView& view = lists_on_device();
    send_cloud(given, true);
    float largest = 0;
    for (const std::uint32_t i : lit.cloud.visible)
        largest = std::max(largest, lit.cloud.metaballs[i].radius);
    if (!view.light(lit.frame, lit.shadow_size, largest, light_on_device(), lit.sun_depths, lit.shadow))
        return false;
    lit.all_known = true;
    map_on_device = lit.key;
    return true;
}

void Renderer::Impl::begin_listed(Drawing& drawing, const CameraFrame& camera,
                                  const std::vector<PartFrame>& parts) {
    const Splats& splats = drawing.splats;
    const RenderOptions& options = drawing.options;
    ListedView& view = lists_on_device();
    const std::vector<float> lightning = light_up(splats, options, {}, nullptr);
    if (!cloud_on_device) send_cloud(splats.metaballs, false);
    cloud_on_device = true;
    if (!lightning.empty()) {
        std::vector<shader::uint> shares(lightning.size());
        std::ranges::transform(lightning, shares.begin(), unorm16);
        view.use_flash(shares);
    }
    const AirShells shells = air_shells(options, lit.cloud, lit.frame, lit.shadow, lit.shadow_size,
                                        splats.time_s, fog_noise, shade_cache);
    if (shells.any()) view.use_shade(shells.shade, shells.serial);
    const StageTimer timer(&times, DrawStage::view);
    const ListedPicture what{
        .variant = {.physical_sky = sky != nullptr, .shells = shells.any(), .fog = shells.has_fog()},
        .order = order_frame(camera, options.camera, options.ground, !lightning.empty()),
        .shadow_map = &light_on_device().shadow_map(),
        .sky = sky != nullptr ? &image_of(*sky) : nullptr,
        .scattering = &scattering_buffer,
        .shells = shells.any() ? &shells.data : nullptr,
        .shell_count = shells.count(),
        .depth = splats.depth};
    drawing.view = &view;  // from here on the device may write into the picture
    for (const PartFrame& part : parts)
        view.begin_tile(what, part.frame, part.tile, drawing.picture, &part == &parts.front());
}

}  // namespace nephos
