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
#include "render/frame/marched_scene.h"
#include "render/frame/scattering_table.h"
#include "render/ground/wet_ground.h"
#include "render/renderer_impl.h"
#include "render/terrain/terrain_edges.h"
#include "render/terrain/terrain_pass.h"
#include "render/veil/veil_pass.h"
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
        throw Error(ErrorCode::usage, "not enough memory for a picture of this size");
    }
}

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
    return flash_by_absorption(lit.cloud, blocks, flash->position_m, options.light.light_distance_m);
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
    if (backend->begin(frame, picture)) drawing.backend = backend.get();
    if (splats.light) hand_out_light(splats, options, picture);
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

Picture Renderer::Impl::draw(const Splats& splats, const RenderOptions& options, const DetailView& detail,
                             TerrainView& terrain) {
    Drawing drawing(splats, options);
    drawing.detail = detail;
    begin(drawing);
    finish(drawing);
    terrain = std::move(drawing.terrain);
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

Picture Renderer::Impl::draw_in_passes(const Splats& splats, const RenderOptions& options) {
    const CameraFrame camera = camera_frame(options.camera);
    const DetailView detail{camera.position_m, pixels_per_unit(options.camera, camera)};
    TerrainView terrain;
    Picture picture = draw(splats, options, detail, terrain);
    static const GroundCoverView kDry;
    const GroundCoverView& cover = splats.ground_cover ? *splats.ground_cover : kDry;
    const std::optional<MirrorView> mirror = mirror_of(splats, options, cover, detail);
    const MirrorView* const mirrored = mirror ? &*mirror : nullptr;
    if (splats.terrain != nullptr)
        draw_terrain_of(splats, options, cover, detail, terrain, mirrored, picture);
    if (shows_wet_ground(options, cover) || shows_pattern(options))
        draw_ground(splats, options, cover, detail, mirrored, picture);
    if (!veils.empty()) draw_veils_of(splats, options, detail, picture);
    if (splats.terrain != nullptr)
        smooth_edges(*splats.terrain, options, double(earth_bend(sky_of(splats, options))), terrain, picture);
    return picture;
}

std::optional<MirrorView> Renderer::Impl::mirror_of(const Splats& splats, const RenderOptions& options,
                                                    const GroundCoverView& cover, const DetailView& detail) {
    if (!shows_reflections(options, cover)) return std::nullopt;
    RenderOptions below = options;
    below.camera = mirrored_camera(options);
    // Waves make a glint of the sun.
    if (options.ground.pattern == GroundPattern::water) below.atmosphere.sun_disc = false;
    Splats mirrored = splats;
    mirrored.depth = !veils.empty();
    mirrored.light = false;
    // The merged metaballs are reused, and with them the light.
    TerrainView terrain;
    Picture view = draw(mirrored, below, detail, terrain);
    if (splats.terrain != nullptr) draw_terrain_of(splats, below, cover, detail, terrain, nullptr, view);
    if (!veils.empty()) draw_veils_of(splats, below, detail, view);
    return mirror_view(std::move(view), below.camera);
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
        const bool wet = splats.ground_cover && shows_wet_ground(options, *splats.ground_cover);
        if (wet || shows_pattern(options) || !veils.empty() || splats.terrain != nullptr) {
            state->picture = impl_->draw_in_passes(splats, options);
            state->rain = std::move(rain);
            impl_->begin_rain(*state, true);
        } else {
            state->rain = std::move(rain);
            const CameraFrame camera = camera_frame(options.camera);
            state->detail = {camera.position_m, pixels_per_unit(options.camera, camera)};
            impl_->begin(*state);
        }
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
