// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/live_picture.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "apps/editor/voxel_picture.h"
#include "render/image/tone_map.h"

namespace nephos {
namespace {

constexpr double kSmallestScale = 0.3;

// The scene as a picture of the window shows it.
Scene scene_of_view(const Scene& scene, const LiveView& view, double scale, bool detail) {
    Scene out = scene;
    out.frames = film_of_steps(scene);
    Camera& camera = out.render.camera;
    camera.position_m = view.camera.position_m;
    camera.target_m = view.camera.target_m;
    camera.above_ground = view.camera.above_ground;
    camera.vertical_fov_deg = view.camera.vertical_fov_deg;
    camera.path.clear();
    camera.width = std::max(16, int(std::lround(scale * view.width)));
    camera.height = std::max(16, int(std::lround(scale * view.height)));
    out.render.debug_view = view.debug;
    if (!detail) {
        out.density.detail.enabled = false;
        for (LayerOptions& layer : out.layers) layer.detail.enabled = false;
        camera.glare = 0;
        out.render.shadow_map_size = std::min(out.render.shadow_map_size, 512);
    }
    if (view.mode == kLightOnly) {  // clouds without a sun-lit sky before them
        out.render.light.ambient_top = out.render.light.ambient_base = {0, 0, 0};
    }
    return out;
}

// A frame without the layers that are hidden.
FrameResult shown_part(const FrameResult& frame, const LiveView& view) {
    FrameResult out = frame;
    bool any = false;
    for (std::size_t n = 0; n < out.layers.size() && n < view.hidden.size(); ++n) {
        if (!view.hidden[n]) continue;
        any = true;
        LayerFrame& layer = out.layers[n];
        layer.density = DensityGrid();
        layer.moisture.reset();
        layer.clouds.clear();
        layer.rain.clear();
        layer.hum.reset();
    }
    if (any) out.density = DensityGrid();  // of all together
    return out;
}

// Transmittance of the clouds: 0 black, 1 white.
std::vector<std::uint8_t> grey(const Picture& picture) {
    std::vector<std::uint8_t> rgb(3 * picture.pixels());
    for (std::size_t n = 0; n < picture.pixels(); ++n) {
        const float clear = std::clamp(picture.transmittance[n], 0.0f, 1.0f);
        rgb[3 * n] = rgb[3 * n + 1] = rgb[3 * n + 2] = std::uint8_t(std::lround(255 * clear));
    }
    return rgb;
}

// The optical depth of the clouds from blue (thin) over green to red (8 and more).
std::vector<std::uint8_t> optical_depth_colours(const Picture& picture) {
    std::vector<std::uint8_t> rgb(3 * picture.pixels());
    for (std::size_t n = 0; n < picture.pixels(); ++n) {
        const double depth = -std::log(std::max(double(picture.transmittance[n]), 1e-6));
        const double t = std::clamp(depth / 8, 0.0, 1.0);
        const auto part = [&](double centre) {
            return std::clamp(1.5 - 4 * std::abs(t - centre), 0.0, 1.0) * std::min(1.0, 6 * t);
        };
        const double colour[3] = {part(0.75), part(0.5), part(0.25)};
        for (int c = 0; c < 3; ++c)
            rgb[3 * n + std::size_t(c)] = std::uint8_t(std::lround(20 + 235 * colour[c]));
    }
    return rgb;
}

std::vector<std::uint8_t> with_alpha(const std::vector<std::uint8_t>& rgb) {
    std::vector<std::uint8_t> rgba(rgb.size() / 3 * 4);
    for (std::size_t from = 0, to = 0; from < rgb.size(); from += 3, to += 4) {
        rgba[to] = rgb[from];
        rgba[to + 1] = rgb[from + 1];
        rgba[to + 2] = rgb[from + 2];
        rgba[to + 3] = 255;
    }
    return rgba;
}

}  // namespace

std::shared_ptr<LivePicture> LivePictureMaker::draw(FramePainter& painter, const Scene& scene,
                                                    const std::shared_ptr<const LiveFrame>& frame,
                                                    const LiveView& view, bool refine, bool same_layers) {
    using Clock = std::chrono::steady_clock;
    const auto begin = Clock::now();
    const double scale = refine ? 1 : draft_scale_;
    const Scene drawn = scene_of_view(scene, view, scale, refine && view.detail);
    Picture picture;
    Camera seen = drawn.render.camera;
    const bool voxels = view.mode == kWireframe || view.mode == kVoxels;
    if (!voxels || seen.above_ground) painter.set_scene(drawn, same_layers);
    if (seen.above_ground) seen = painter.camera(frame->frame.time_s);
    auto made = std::make_shared<LivePicture>();
    made->position_m = seen.position_m;
    made->target_m = seen.target_m;
    if (voxels) {
        seen.exposure = Exposure::manual;
        seen.exposure_ev = seen.glare = 0;
        seen.tone_curve = ToneCurve::exponential;
        picture = voxel_picture(drawn, shown_part(frame->frame, view), seen,
                                {view.hum, view.act, view.cld, view.slab_low, view.slab_high,
                                 view.mode == kWireframe});
    } else {
        picture = painter.draw(shown_part(frame->frame, view));
    }
    std::vector<std::uint8_t> rgb;
    if (view.mode == kDensityMode) {
        rgb = optical_depth_colours(picture);
    } else if (view.mode == kTransmittanceMode) {
        rgb = grey(picture);
    } else {
        rgb = to_srgb8(picture, seen);
    }
    made->width = picture.width;
    made->height = picture.height;
    made->rgba = with_alpha(rgb);
    made->step = frame->frame.step;
    made->time_s = frame->frame.time_s;
    made->view = view;
    made->refined = refine;
    made->draw_ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
    if (!refine) {
        const double wanted = draft_scale_ * std::sqrt(kDraftMs / std::max(made->draw_ms, 1.0));
        draft_scale_ = std::clamp(0.7 * draft_scale_ + 0.3 * wanted, kSmallestScale, 1.0);
    }
    return made;
}

}  // namespace nephos
