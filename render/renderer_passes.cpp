// SPDX-License-Identifier: Apache-2.0
// What the renderer draws beside clouds: ground that is not plain, by the back-end or by the processor, and veils.

#include <algorithm>
#include <optional>
#include <utility>

#include "render/frame/frame_data.h"
#include "render/frame/marched_scene.h"
#include "render/ground/wet_ground.h"
#include "render/renderer_impl.h"
#include "render/terrain/terrain_edges.h"
#include "render/terrain/terrain_pass.h"
#include "render/veil/veil_pass.h"

namespace nephos {

CloudHeights heights_of(const PreparedCloud& cloud, const Splats& splats, std::span<const DrawnVeil> veils) {
    CloudHeights heights{cloud.base_m, cloud.top_m};
    bool some = !cloud.visible.empty();
    for (const BillboardCloud& each : splats.clouds) {
        heights.base_m = some ? std::min(heights.base_m, each.base_m) : each.base_m;
        heights.top_m = some ? std::max(heights.top_m, each.top_m) : each.top_m;
        some = true;
    }
    for (const DrawnVeil& veil : veils) {
        heights.base_m = some ? std::min(heights.base_m, veil.slab->base_m()) : veil.slab->base_m();
        heights.top_m = some ? std::max(heights.top_m, veil.slab->top_m()) : veil.slab->top_m();
        some = true;
    }
    return heights;
}

Picture Renderer::Impl::draw_in_passes(Drawing& drawing) {
    const Splats& splats = drawing.splats;
    const RenderOptions& options = drawing.options;
    const DetailView& detail = drawing.detail;
    const GroundCoverView& cover = cover_of(splats);
    const bool by_backend = add_ground(drawing);
    Picture picture = draw(drawing);
    std::optional<MirrorView> mirror;
    if (!by_backend) mirror = mirror_of(splats, options, cover, detail);
    const MirrorView* const mirrored = mirror ? &*mirror : nullptr;
    if (splats.terrain != nullptr)
        draw_terrain_of(splats, options, cover, detail, drawing.terrain, mirrored, picture);
    if (!by_backend && shows_ground(options, cover)) draw_ground(splats, options, cover, detail, mirrored, picture);
    if (!veils.empty()) draw_veils_of(splats, options, detail, picture);
    if (splats.terrain != nullptr)
        smooth_edges(*splats.terrain, options, double(earth_bend(sky_of(splats, options))), drawing.terrain, picture);
    return picture;
}

bool Renderer::Impl::add_ground(Drawing& drawing) {
    const RenderOptions& options = drawing.options;
    const GroundCoverView& cover = cover_of(drawing.splats);
    const bool draws = shows_ground(options, cover) && drawing.splats.terrain == nullptr &&
                       backend->draws_ground(cover, mirrored_camera(options));
    if (!draws) return false;
    drawing.with_ground = true;
    if (!shows_reflections(options, cover)) return true;
    if (!veils.empty()) {  // which the processor draws into the mirrored view
        drawing.mirror = mirror_of(drawing.splats, options, cover, drawing.detail);
        return true;
    }
    const Mirrored what = mirrored_of(drawing.splats, options);
    Drawing mirrored(what.splats, what.options);
    mirrored.detail = drawing.detail;
    mirrored.keeps = true;
    draw(mirrored);
    drawing.shows_kept = true;
    return true;
}

Renderer::Impl::Mirrored Renderer::Impl::mirrored_of(const Splats& splats, const RenderOptions& options) const {
    Mirrored what{options, splats};
    what.options.camera = mirrored_camera(options);
    // Waves make a glint of the sun.
    if (options.ground.pattern == GroundPattern::water) what.options.atmosphere.sun_disc = false;
    what.splats.depth = !veils.empty();
    what.splats.light = false;
    return what;
}

std::optional<MirrorView> Renderer::Impl::mirror_of(const Splats& splats, const RenderOptions& options,
                                                    const GroundCoverView& cover, const DetailView& detail) {
    if (!shows_reflections(options, cover)) return std::nullopt;
    const Mirrored what = mirrored_of(splats, options);
    Drawing mirrored(what.splats, what.options);
    mirrored.detail = detail;  // the merged metaballs are reused, and with them the light
    Picture view = draw(mirrored);
    if (splats.terrain != nullptr)
        draw_terrain_of(what.splats, what.options, cover, detail, mirrored.terrain, nullptr, view);
    if (!veils.empty()) draw_veils_of(what.splats, what.options, detail, view);
    return mirror_view(view, what.options.camera);
}

void Renderer::Impl::draw_terrain_of(const Splats& splats, const RenderOptions& options, const GroundCoverView& cover,
                                     const DetailView& detail, const TerrainView& view, const MirrorView* mirror,
                                     Picture& picture) {
    backend->fetch_light(lit);
    const CloudHeights clouds = heights_of(lit.cloud, splats, {});
    TerrainGround ground{options, *splats.terrain, view, cover, splats.flash ? &*splats.flash : nullptr, splats.time_s, mirror};
    ground.shadow = lit.shadow.data();
    ground.shadow_size = lit.shadow_size;
    ground.sky = sky_of(splats, options);
    const MarchedScene marched(lit.volumes, camera_frame(options.camera), detail.pixels_per_unit, options.light,
                               earth_bend(ground.sky));
    if (marched.repeats) ground.endless = &marched;
    if (!lit.volumes.empty()) ground.light = &lit.ground_light;
    ground.cloud_base_m = clouds.base_m;
    ground.cloud_top_m = clouds.top_m;
    draw_terrain(ground, picture);
}

void Renderer::Impl::draw_ground(const Splats& splats, const RenderOptions& options,
                                 const GroundCoverView& cover, const DetailView& detail, const MirrorView* mirror,
                                 Picture& picture) {
    WetGround ground{options, cover, splats.flash ? &*splats.flash : nullptr, splats.time_s, mirror};
    backend->fetch_light(lit);
    ground.shadow = lit.shadow.data();  // the mirrored view may have completed it
    ground.shadow_size = lit.shadow_size;
    ground.sky = sky_of(splats, options);  // the mirrored view has another
    const MarchedScene marched(lit.volumes, camera_frame(options.camera), detail.pixels_per_unit,
                               options.light, earth_bend(ground.sky));
    if (marched.repeats) ground.endless = &marched;
    if (!lit.volumes.empty()) ground.light = &lit.ground_light;
    draw_wet_ground(ground, picture);
}

void Renderer::Impl::draw_veils_of(const Splats& splats, const RenderOptions& options,
                                   const DetailView& detail, Picture& picture) {
    backend->fetch_light(lit);
    const CameraFrame camera = camera_frame(options.camera);
    const SkyLight* const sky = sky_of(splats, options);
    const PicturePart whole{0, 0, picture.width, picture.height};
    VeilPass pass{veils,
                  frame_data(options, camera, lit.frame, splats.flash ? &*splats.flash : nullptr, whole, sky),
                  camera.position_m,
                  options.ground.albedo,
                  lit.shadow.data(),
                  lit.shadow_size};
    const MarchedScene marched(lit.volumes, camera, detail.pixels_per_unit, options.light, earth_bend(sky));
    if (marched.repeats) pass.frame.endless = &marched;
    if (!lit.volumes.empty()) use_ground_light(lit.ground_light, camera.position_m, pass.frame);
    draw_veils(pass, picture);
}

}  // namespace nephos
