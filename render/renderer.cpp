// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <new>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/memory.h"
#include "core/text.h"
#include "render/backend/host_light.h"
#include "render/blended/blended_backend.h"
#include "render/cpu/cpu_backend.h"
#include "render/frame/frame_data.h"
#include "render/frame/scattering_table.h"
#include "render/ground/wet_ground.h"
#include "render/renderer_impl.h"
#include "render/veil/veil_shade.h"
#include "render/vulkan/vulkan_backend.h"

namespace nephos {
namespace {

std::size_t square(std::size_t side) { return side * side; }

// Bytes in main memory while a picture is drawn, on a device that shares it.
std::size_t memory_needed(const Splats& splats, const RenderOptions& options, int part_size) {
    const std::size_t pixels = std::size_t(options.camera.width) * std::size_t(options.camera.height);
    const std::size_t part = std::min(pixels, square(std::size_t(part_size)));
    // Orders, sort keys, light, box and splat of a metaball, and what is kept of it.
    constexpr std::size_t kPerMetaball = 36 + 16 + 4 * 5 + 16 + 64 + 16 + 24 + 24,
                          kPerBillboard = 32 + 16 + 4 * 5 + 16 + 64,
                          kPerCaster = 80 + 72 + 40 + 48 + 16;  // key, caster, sphere, footprint, lists
    return 20 * pixels + 40 * part + 12 * square(std::size_t(options.shadow_map_size)) +
           kPerMetaball * splats.metaballs.metaballs.size() + kPerBillboard * splats.billboards.size() +
           kPerCaster * (splats.billboards.size() + splats.unseen.size()) + (std::size_t(96) << 20);
}

void check_memory(const Splats& splats, const RenderOptions& options, int part_size) {
    const std::size_t needed = memory_needed(splats, options, part_size);
    const AvailableMemory available = available_memory();
    if (needed <= available.bytes) return;
    throw Error(ErrorCode::usage, "a picture of " + std::to_string(options.camera.width) + " x " +
                                      std::to_string(options.camera.height) + " pixels needs " +
                                      bytes_text(needed) + " of memory, but the " + available.limit +
                                      " leaves " + bytes_text(available.bytes));
}

PictureAir air_of(const SkyLight& sky) {
    PictureAir air{sky.ground_sun, sky.ground_sky, sky.horizon, sky.model.rayleigh_per_m};
    for (double& extinction : air.extinction_per_m) extinction += sky.model.mie_extinction_per_m;
    return air;
}

template <class Work>
decltype(auto) with_drawing_errors(Work&& work) {
    try {
        return with_gpu_errors("drawing", std::forward<Work>(work));
    } catch (const std::bad_alloc&) {
        throw Error(ErrorCode::io, "not enough memory for a picture of this size");
    }
}

// The back-end that options ask for.
std::unique_ptr<Backend> open_backend(const DeviceOptions& options) {
    switch (options.splatting) {
        case Splatting::cpu:
            if (!options.device.empty())
                throw Error(ErrorCode::usage,
                            "device: the back-end cpu uses no Vulkan device, but \"" + options.device +
                                "\" is asked for: leave it out, or choose vulkan or blended");
            return std::make_unique<CpuBackend>();
        case Splatting::vulkan:
            return std::make_unique<VulkanBackend>(open_device(options));
        case Splatting::blended:
            return std::make_unique<BlendedBackend>(open_device(options));
        case Splatting::automatic:
            break;
    }
    if (std::optional<GpuDevice> card = open_graphics_card(options))
        return std::make_unique<VulkanBackend>(std::move(*card));
    return std::make_unique<CpuBackend>();
}

}  // namespace

Renderer::Impl::Impl(const DeviceOptions& options)
    : backend(open_backend(options)), part_size(std::min(options.part_size, backend->longest_part())) {}

void Renderer::Impl::absorb_sunlight(LitCloud& cloud, const DensityBlocks& blocks,
                                     const RenderOptions& options) {
    const double distance = options.light.light_distance_m;
    cloud.shadow = shadow_by_absorption(blocks, cloud.frame, cloud.shadow_size, distance);
    cloud.sun_depths = light_by_absorption(cloud.cloud, blocks, direction_to_sun(options.sun), distance);
    to_sun_depths(cloud.sun_depths);
    add_screen(cloud);
    cloud.all_known = true;
    cloud.note_light_pass();
}

std::vector<float> Renderer::Impl::absorb_light(const Splats& splats, const RenderOptions& options) {
    const Flash* flash = splats.flash ? &*splats.flash : nullptr;
    const bool absorbs = options.light.lighting == Lighting::cfa && !lit.all_known;
    if (lit.cloud.visible.empty() || (flash == nullptr && !absorbs)) return {};
    const DensityBlocks blocks(lit.given, splats.metaballs.extinction_per_m);  // cubes of the voxels' size
    if (absorbs) absorb_sunlight(lit, blocks, options);
    if (flash == nullptr) return {};
    std::vector<float> light = flash_by_absorption(lit.cloud, blocks, flash->position_m, options.light.light_distance_m);
    if (!splats.to_flash.any()) return light;
    for (std::size_t i = 0; i < light.size(); ++i) {
        const Metaball& ball = lit.cloud.metaballs[lit.cloud.visible[i]];
        light[i] *= std::exp(-splats.to_flash.at({ball.x, ball.y, ball.z}));
    }
    return light;
}

void Renderer::Impl::shade_by_veils(const Splats& splats, const RenderOptions& options) {
    constexpr double kRainReach_m = 8000;
    veil_depth = {};
    if (veils.empty()) return;
    PlaceBox places;
    for (const Metaball& ball : splats.metaballs.metaballs)
        if (ball.density > 0) places.add({ball.x, ball.y, ball.z}, ball.radius);
    for (const CloudBillboard& each : splats.billboards)
        places.add(each.centre_m, 0.5 * std::max(each.width_m, each.height_m));
    if (options.precipitation.enabled) {
        Vec3 eye = options.camera.position_m;
        eye.z = options.ground.height_m;
        places.add(eye, kRainReach_m);
    }
    if (!places.any()) return;
    const auto shade = std::make_shared<const VeilShade>(veils, places, direction_to_sun(options.sun));
    veil_depth.key = key_of_numbers(shade->content());
    veil_depth.at = [shade](const Vec3& place_m) { return shade->depth_at(place_m); };
}

void Renderer::Impl::use_scattering(const CloudLight& light) {
    if (scattering.version() != 0 && light == scattering_light) return;
    scattering.set(scattering_table(light));
    scattering_light = light;
}

void Renderer::Impl::begin(Drawing& drawing) {
    if (!backend->marches()) drawing.splats.metaballs.detailed = {};
    const Splats& splats = drawing.splats;
    const RenderOptions& options = drawing.options;
    Picture& picture = drawing.picture = blank_picture(options);
    {
        const StageTimer timer(&times, DrawStage::prepare);
        cache_screen(lit, splats, veil_depth, options);
        // The key of the light says nothing of the view, from which other metaballs may be merged.
        cache_cloud(lit, splats.metaballs, options, drawing.detail);
        cache_volumes(lit, splats.metaballs, options);
        if (!lit.volumes.empty()) cache_ground_light(lit, options);
    }
    times[DrawStage::prepare].bytes = splats.metaballs.metaballs.size_bytes();
    picture.shadow_frame = lit.frame;
    cache_billboard_light(lit, splats, options, times);
    use_scattering(options.light);
    const Flash* flash = splats.flash ? &*splats.flash : nullptr;
    FrameDescription frame{.splats = splats,
                           .options = options,
                           .camera = camera_frame(options.camera),
                           .parts = {},
                           .cloud = lit,
                           .lightning = absorb_light(splats, options),
                           .sky = sky_of(splats, options),
                           .table = scattering,
                           .air = air,
                           .times = times};
    if (frame.sky != nullptr) picture.air = air_of(*frame.sky);
    if (splats.terrain != nullptr)
        drawing.terrain = terrain_view(*splats.terrain, options, double(earth_bend(frame.sky)));
    frame.terrain = drawing.terrain.distance_m;
    for (int y = 0; y < picture.height; y += part_size) {
        for (int x = 0; x < picture.width; x += part_size) {
            const PicturePart area{x, y, std::min(part_size, picture.width - x),
                                   std::min(part_size, picture.height - y)};
            frame.parts.push_back(
                {area, frame_data(options, frame.camera, lit.frame, flash, area, frame.sky)});
            PictureFrame& part = frame.parts.back().frame;
            part.terrain = drawing.terrain.distance_m.empty() ? nullptr : drawing.terrain.distance_m.data();
            part.scattering = scattering.get().data();
            part.bows = drawing.options.light.bows > 0;
            if (!lit.volumes.empty()) use_ground_light(lit.ground_light, options.camera.position_m, part);
        }
    }
    std::optional<GroundPass> ground;
    if (drawing.with_ground) {
        WetGround what{options, cover_of(splats), flash, splats.time_s, drawing.mirror ? &*drawing.mirror : nullptr};
        what.sky = frame.sky;
        frame.ground = &ground.emplace(ground_pass(what, lit.frame));
    }
    frame.shows_kept = drawing.shows_kept;
    frame.keeps = drawing.keeps;
    const bool with_rain = rains_with(drawing);
    if (with_rain) {
        backend->light_all(lit, times);
        hand_out_light(splats, options, picture);
        frame.rains = prepare_rain(drawing);
    }
    if (backend->begin(frame, picture)) drawing.backend = backend.get();
    if (splats.light && !with_rain) hand_out_light(splats, options, picture);
}

void Renderer::Impl::begin_picture(Drawing& drawing, std::optional<Rainfall> rain) {
    const bool by_host = !veils.empty() || drawing.splats.terrain != nullptr;
    if (by_host || (!add_ground(drawing) && shows_ground(drawing.options, cover_of(drawing.splats)))) {
        drawing.picture = draw_in_passes(drawing);
        drawing.rain = std::move(rain);
        begin_rain(drawing, true);
    } else {
        drawing.rain = std::move(rain);
        begin(drawing);
    }
}

void Renderer::Impl::finish(Drawing& drawing) {
    const StageTimer timer(&times, DrawStage::view);
    const auto wait = [&] {
        if (drawing.backend != nullptr) std::exchange(drawing.backend, nullptr)->finish(drawing.picture);
    };
    wait();
    begin_rain(drawing, false);
    wait();
}

bool Renderer::Impl::rains_with(const Drawing& drawing) const {
    const Picture& picture = drawing.picture;
    // Rain has the light of the metaballs that merged ones stand for, whose light is the device's then.
    const bool same = lit.merged.empty() || !lit.volumes.empty();
    return drawing.rain && drawing.splats.light && drawing.splats.depth && same &&
           std::max(picture.width, picture.height) <= part_size && backend->draws_rain();
}

bool Renderer::Impl::prepare_rain(Drawing& drawing) {
    const Rainfall& rain = *drawing.rain;
    const std::optional<RainFrame> frame = rain_frame(drawing.picture, rain.options, rain.weather, rain.time_s);
    if (frame && !backend->prepare_rain(*frame, rain.weather, drawing.picture)) return false;
    drawing.rain.reset();
    return frame.has_value();
}

void Renderer::Impl::begin_rain(Drawing& drawing, bool known) {
    if (!drawing.rain) return;
    const Rainfall rain = *std::exchange(drawing.rain, std::nullopt);
    Picture& picture = drawing.picture;
    const std::optional<RainFrame> frame = rain_frame(picture, rain.options, rain.weather, rain.time_s);
    if (!frame) return;
    // Of merged metaballs the picture has the light of those that they stand for.
    const bool same = known && (lit.merged.empty() || !lit.volumes.empty());
    // Devices know nothing of terrain that hides rain.
    const bool level = picture.terrain_m.empty();
    if (level && backend->begin_rain(*frame, rain.weather, same ? &lit : nullptr, picture))
        drawing.backend = backend.get();
    else
        painter.draw(picture, rain.options, rain.weather, rain.time_s);
}

Picture Renderer::Impl::draw(Drawing& drawing) {
    begin(drawing);
    finish(drawing);
    return std::move(drawing.picture);
}

// At full detail: the light of each metaball is that of its own centre.
void Renderer::Impl::hand_out_light(const Splats& splats, const RenderOptions& options, Picture& picture) {
    backend->fetch_light(lit);  // now: the light of another cloud replaces it on a device
    const LitCloud* known = &lit;
    LitCloud whole;
    if (!lit.merged.empty()) {
        RenderOptions given = options;
        given.level_of_detail.pixels = 0;
        whole.screen = lit.screen;
        whole.screen_key = lit.screen_key;
        cache_cloud(whole, splats.metaballs, given, {});
        if (options.light.lighting == Lighting::cfa)
            absorb_sunlight(whole, DensityBlocks(whole.cloud, splats.metaballs.extinction_per_m), given);
        else
            backend->light_all(whole, times);
        known = &whole;
    }
    picture.light.assign(splats.metaballs.metaballs.size(), 1.0f);
    for (std::size_t i = 0; i < known->sun_depths.size(); ++i)
        picture.light[known->cloud.visible[i]] = std::exp(-known->sun_depths[i]);
    picture.shadow = lit.volumes.empty() ? known->shadow : lit.shadow;
    picture.shadow_frame = known->frame;
    if (veil_depth.any())
        picture.sunlight_of_veils = [at = veil_depth.at](const Vec3& place_m) {
            return std::exp(-at(place_m));
        };
    if (options.precipitation.enabled) {
        cache_ground_light(lit, options);
        picture.ground_light = lit.ground_light;
    }
}

// Null: gradient. Until the next call.
const SkyLight* Renderer::Impl::sky_of(const Splats& splats, const RenderOptions& options) {
    if (options.atmosphere.model == AirModel::gradient) return nullptr;
    return &sky_lights.at(options, heights_of(lit.cloud, splats, veils));
}

Renderer::Renderer(const DeviceOptions& options) {
    if (options.part_size < 16 || options.part_size > 16384)
        throw Error(ErrorCode::usage, "device: part_size must be 16..16384 pixels");
    impl_ = with_gpu_errors("preparing the renderer", [&] { return std::make_unique<Impl>(options); });
}

Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

Picture Renderer::draw(const MetaballCloud& cloud, const RenderOptions& options) {
    Splats splats;
    splats.metaballs = cloud;
    return draw_splats(splats, options);
}

Picture Renderer::draw_splats(const Splats& splats, const RenderOptions& options, std::span<const DrawnVeil> veils,
                              std::optional<Rainfall> rain) {
    return finish(begin(splats, options, veils, std::move(rain)));
}

PendingPicture Renderer::begin(const Splats& splats, const RenderOptions& options, std::span<const DrawnVeil> veils,
                               std::optional<Rainfall> rain) {
    check(options);
    if (rain) check(rain->options.precipitation);
    const int limit = impl_->backend->largest_shadow_map();
    if (options.shadow_map_size > limit)
        throw Error(ErrorCode::usage, "shadow_map_size: this device allows at most " + std::to_string(limit));
    if (splats.ground_cover) check(*splats.ground_cover);
    if (splats.terrain != nullptr) require_above_terrain(*splats.terrain, options);
    if (!veils.empty() && !splats.depth)
        throw Error(ErrorCode::usage, "a picture with veils needs the distances of what stands before them: Splats::depth");
    check_memory(splats, options, impl_->part_size);
    const auto work = [&] {
        auto state = std::make_unique<PendingPicture::State>(splats, options);
        impl_->times = {};
        impl_->veils = veils;
        impl_->shade_by_veils(splats, options);
        const CameraFrame camera = camera_frame(options.camera);
        state->detail = {camera.position_m, pixels_per_unit(options.camera, camera)};
        impl_->begin_picture(*state, std::move(rain));
        return PendingPicture(std::move(state));
    };
    return with_drawing_errors(work);
}

Picture Renderer::finish(PendingPicture&& pending) {
    const std::unique_ptr<PendingPicture::State> state = std::move(pending.state_);
    assert(state != nullptr && (state->backend == nullptr || state->backend == impl_->backend.get()));
    with_drawing_errors([&] { impl_->finish(*state); });
    return std::move(state->picture);
}

PendingPicture::PendingPicture(std::unique_ptr<State> state) : state_(std::move(state)) {}
PendingPicture::PendingPicture(PendingPicture&&) noexcept = default;
PendingPicture& PendingPicture::operator=(PendingPicture&&) noexcept = default;
PendingPicture::~PendingPicture() = default;
bool PendingPicture::is_pending() const { return state_ && state_->backend != nullptr; }

const StageTimes& Renderer::times() const { return impl_->times; }

std::string Renderer::backend_name() const { return impl_->backend->name(); }

std::string Renderer::device_name() const { return impl_->backend->device_name(); }

void note_renderer(const Renderer& renderer, PictureMetadata& metadata) {
    metadata.backend = renderer.backend_name();
    // Vectors and threads of the processor are left out: on them the picture does not depend.
    metadata.device = metadata.backend == "cpu" ? "" : renderer.device_name();
}

std::vector<std::string> Renderer::validation_messages() const {
    return impl_->backend->validation_messages();
}

}  // namespace nephos
