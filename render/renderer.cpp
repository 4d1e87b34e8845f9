// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstring>
#include <new>
#include <optional>
#include <utility>

#include "core/available_memory.h"
#include "core/error.h"
#include "core/text.h"
#include "render/blended/attenuation_texture.h"
#include "render/frame/scattering_table.h"
#include "render/ground/wet_ground.h"
#include "render/renderer_impl.h"

namespace nephos {
namespace {

std::size_t square(std::size_t side) { return side * side; }

// Longest side of a square of elements that a shader may see as one buffer.
int largest_square(const GpuDevice& gpu, std::size_t element_bytes) {
    return int(std::sqrt(double(gpu.properties.limits.maxStorageBufferRange / element_bytes)));
}

// Bytes in main memory while a picture is drawn, on a device that shares it.
std::size_t memory_needed(const Splats& splats, const RenderOptions& options, int tile_size) {
    const std::size_t pixels = std::size_t(options.camera.width) * std::size_t(options.camera.height);
    const std::size_t tile = std::min(pixels, square(std::size_t(tile_size)));
    // Orders, sort keys, light, box and splat of a metaball, and what is kept of it.
    constexpr std::size_t kPerMetaball = 36 + 16 + 4 * 5 + 16 + 64 + 16 + 24 + 24,
                          kPerBillboard = 32 + 16 + 4 * 5 + 16 + 64;
    return 20 * pixels + 40 * tile + 12 * square(std::size_t(options.shadow_map_size)) +
           kPerMetaball * splats.metaballs.metaballs.size() + kPerBillboard * splats.billboards.size() +
           (std::size_t(96) << 20);
}

void check_memory(const Splats& splats, const RenderOptions& options, int tile_size) {
    const std::size_t needed = memory_needed(splats, options, tile_size);
    const AvailableMemory available = available_memory();
    if (needed <= available.bytes) return;
    throw Error(ErrorCode::usage, "a picture of " + std::to_string(options.camera.width) + " x " +
                                      std::to_string(options.camera.height) + " pixels needs " +
                                      bytes_text(needed) + " of memory, but the " + available.limit +
                                      " leaves " + bytes_text(available.bytes));
}

GpuImage upload_attenuation(const GpuDevice& gpu) {
    const std::vector<float> texels = attenuation_textures();
    const std::size_t bytes = texels.size() * sizeof(float);
    constexpr std::uint32_t kSide = shader::kAttenuationTexels;
    GpuImage image = create_image(gpu, kSide, kSide, shader::kAttenuationLevels, vk::Format::eR32G32Sfloat,
                                  vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst);
    const GpuBuffer staging =
        create_buffer(gpu, bytes, vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    write(gpu, staging, std::as_bytes(std::span(texels)));
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        begin_image(commands, image, access::copy_to);
        const vk::BufferImageCopy region(0, 0, 0,
                                         {vk::ImageAspectFlagBits::eColor, 0, 0, shader::kAttenuationLevels},
                                         {0, 0, 0}, {kSide, kSide, 1});
        commands.copyBufferToImage(*staging.buffer, *image.image, vk::ImageLayout::eGeneral, region);
        image_barrier(commands, image, access::copy_to, access::sample);
    });
    return image;
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

CloudHeights heights_of(const PreparedCloud& cloud, const Splats& splats) {
    CloudHeights heights{cloud.base_m, cloud.top_m};
    bool some = !cloud.visible.empty();
    for (const BillboardCloud& each : splats.clouds) {
        heights.base_m = some ? std::min(heights.base_m, each.base_m) : each.base_m;
        heights.top_m = some ? std::max(heights.top_m, each.top_m) : each.top_m;
        some = true;
    }
    return heights;
}

}  // namespace

Renderer::Impl::Impl(const DeviceOptions& device_options)
    : tile_size(device_options.tile_size),
      gpu(open_device(device_options)),
      layout(create_pipeline_layout(gpu)),
      clamped(create_sampler(gpu, vk::SamplerAddressMode::eClampToEdge)),
      white_beyond(create_sampler(gpu, vk::SamplerAddressMode::eClampToBorder)),
      splatting(device_options.splatting),
      lists(device_options.lists) {
    const bool software = gpu.properties.deviceType == vk::PhysicalDeviceType::eCpu;
    if (splatting == Splatting::automatic) splatting = software ? Splatting::processor : Splatting::tiles;
    const std::string missing = missing_for_lists(gpu);
    if (lists == TileLists::device && !missing.empty())
        throw Error(ErrorCode::usage,
                    "the Vulkan device cannot make the lists of tiles: it lacks " + missing);
    if (lists == TileLists::automatic)
        lists = software || !missing.empty() ? TileLists::host : TileLists::device;
    tile_size = std::min(tile_size, int(std::min(gpu.properties.limits.maxImageDimension2D,
                                                 gpu.properties.limits.maxFramebufferWidth)));
    tile_size = std::min(tile_size, largest_square(gpu, 4 * sizeof(float)));  // ViewTiles has its radiance
}

const GpuImage& Renderer::Impl::attenuation_on_device() {
    if (!attenuation) attenuation.emplace(upload_attenuation(gpu));
    return *attenuation;
}

LightTiles& Renderer::Impl::light_on_device() {
    if (!light_tiles) light_tiles.emplace(gpu, layout, attenuation_on_device(), clamped);
    return *light_tiles;
}

// D, step 1, in compute shaders.
void Renderer::Impl::pass_sunlight(LitCloud& kept) {
    settle();
    const LightSortedSplats order = sort_for_light(kept.cloud, kept.frame, kept.shadow_size);
    if (kept.cloud.visible.empty()) {  // on the device the smallest map will do
        std::vector<float> small;
        light_on_device().run(gpu, order, 16, small);
    } else {
        const std::vector<float> ordered = light_on_device().run(gpu, order, kept.shadow_size, kept.shadow);
        for (std::size_t i = 0; i < ordered.size(); ++i) kept.sun_depths[order.source[i]] = ordered[i];
    }
    kept.all_known = true;
    map_on_device = kept.key;
}

// T's absorption factor in its place.
void Renderer::Impl::absorb_sunlight(LitCloud& kept, const DensityBlocks& blocks,
                                     const RenderOptions& options) {
    const double distance = options.light.light_distance_m;
    kept.shadow = shadow_by_absorption(blocks, kept.frame, kept.shadow_size, distance);
    kept.sun_depths = light_by_absorption(kept.cloud, blocks, direction_to_sun(options.sun), distance);
    to_sun_depths(kept.sun_depths);
    kept.all_known = true;
}

// What is missing of the light that the picture needs, and the lightning.
std::vector<float> Renderer::Impl::light_up(const Splats& splats, const RenderOptions& options,
                                            const ViewSortedSplats& order, const VisibleSet* seen) {
    const Flash* flash = splats.flash ? &*splats.flash : nullptr;
    const bool absorbs = options.light.lighting == Lighting::cfa && !lit.all_known;
    std::optional<DensityBlocks> blocks;
    if (!lit.cloud.visible.empty() && (flash != nullptr || absorbs))
        blocks.emplace(lit.given, splats.metaballs.extinction_per_m);  // cubes of the voxels' size
    // A map that is known but is not on the device goes there below; of no cloud at all it is made there.
    const bool on_device =
        !on_processor() && (!lit.all_known || (lit.cloud.visible.empty() && map_on_device != lit.key));
    const std::size_t passes = light_passes;
    bool listed = false;  // the light is with the cloud on the device
    if (blocks && absorbs) {
        absorb_sunlight(lit, *blocks, options);
        ++light_passes;
    } else if (on_processor()) {
        if (light_seen(lit, order.source, seen != nullptr ? &seen->balls : nullptr,
                       seen != nullptr ? &seen->map_tiles : nullptr, &times)) {
            ++light_passes;
            map_on_device.reset();
        }
    } else if (on_device && options.light.lighting == Lighting::light_pass) {
        settle();
        listed = light_listed(splats.metaballs);
        if (!listed) pass_sunlight(lit);
        ++light_passes;
    }
    if (light_passes != passes) {
        light_changed();
        cloud_on_device = listed;
    }
    if (!on_processor() && map_on_device != lit.key) put_map_on_device();
    if (flash == nullptr || !blocks) return {};
    return flash_by_absorption(lit.cloud, *blocks, flash->position_m, options.light.light_distance_m);
}

void Renderer::Impl::put_map_on_device() {
    settle();
    light_on_device().use(gpu, lit.shadow, lit.shadow_size);
    map_on_device = lit.key;
}

// Makes the table anew when the light is another one.
void Renderer::Impl::use_scattering(const CloudLight& light) {
    if (!scattering.empty() && light == scattering_light) return;
    settle();
    scattering = scattering_table(light);
    scattering_light = light;
    const std::size_t bytes = scattering.size() * sizeof(float);
    scattering_buffer = create_buffer(gpu, bytes, vk::BufferUsageFlagBits::eStorageBuffer, HostAccess::write);
    write(gpu, scattering_buffer, std::as_bytes(std::span(scattering)));
}

void Renderer::Impl::begin(Drawing& drawing) {
    const Splats& splats = drawing.splats;
    const RenderOptions& options = drawing.options;
    const CameraFrame camera = camera_frame(options.camera);
    Picture& picture = drawing.picture = blank_picture(options);
    {
        const StageTimer timer(&times, DrawStage::prepare);
        // The key says nothing of the view, from which others may be merged.
        if (!cache_cloud(lit, splats.metaballs, options, drawing.detail)) {
            map_on_device.reset();
            light_changed();
            cloud_is_near = lists == TileLists::device && is_near_enough(lit.cloud);
        }
    }
    times[DrawStage::prepare].bytes = splats.metaballs.metaballs.size_bytes();
    picture.shadow_frame = lit.frame;
    use_scattering(options.light);
    const Flash* flash = splats.flash ? &*splats.flash : nullptr;
    sky = sky_of(splats, options);
    if (sky != nullptr) picture.air = air_of(*sky);
    std::vector<PartFrame> parts;
    for (int y = 0; y < picture.height; y += tile_size) {
        for (int x = 0; x < picture.width; x += tile_size) {
            const Tile tile{x, y, std::min(tile_size, picture.width - x),
                            std::min(tile_size, picture.height - y)};
            parts.push_back({tile, frame_data(options, camera, lit.frame, flash, tile, sky)});
            parts.back().frame.scattering = scattering.data();
        }
    }
    if (uses_lists(drawing, camera))
        begin_listed(drawing, camera, parts);
    else
        draw_ordered(splats, options, camera, parts, picture);
    if (splats.light) hand_out_light(splats, options, picture);
}

void Renderer::Impl::finish(Drawing& drawing) {
    if (drawing.view == nullptr) return;
    {
        const StageTimer timer(&times, DrawStage::view);
        if (std::exchange(drawing.view, nullptr)->finish(drawing.picture)) return;
    }
    drawing.too_much = true;
    begin(drawing);
}

Picture Renderer::Impl::draw(const Splats& splats, const RenderOptions& options, const DetailView& detail) {
    Drawing drawing(splats, options);
    drawing.detail = detail;
    begin(drawing);
    finish(drawing);
    return std::move(drawing.picture);
}

void Renderer::Impl::draw_ordered(const Splats& splats, const RenderOptions& options,
                                  const CameraFrame& camera, const std::vector<PartFrame>& parts,
                                  Picture& picture) {
    ViewSortedSplats order;
    {
        const StageTimer timer(&times, DrawStage::view_sorting);
        order =
            sort_for_view(lit.cloud, splats, camera, pixels_per_unit(options.camera, camera), options.ground);
    }
    // Balls are read twice; keys move through memory three times, and back and forth.
    times[DrawStage::view_sorting].bytes =
        lit.cloud.metaballs.size_bytes() +
        order.balls.size() * (sizeof(Metaball) + 7 * 8 + sizeof(shader::ViewBall));
    if (on_processor())
        draw_on_processor(splats, options, camera, parts, order, picture);
    else
        draw_on_device(splats, options, camera, parts, order, picture);
}

// At full detail: the light of each metaball is that of its own centre.
void Renderer::Impl::hand_out_light(const Splats& splats, const RenderOptions& options, Picture& picture) {
    const LitCloud* known = &lit;
    LitCloud whole;
    if (!lit.merged.empty()) {
        RenderOptions given = options;
        given.level_of_detail.pixels = 0;
        cache_cloud(whole, splats.metaballs, given, {});
        light_all(whole, splats, given);
        known = &whole;
    }
    picture.light.assign(splats.metaballs.metaballs.size(), 1.0f);
    for (std::size_t i = 0; i < known->sun_depths.size(); ++i)
        picture.light[known->cloud.visible[i]] = std::exp(-known->sun_depths[i]);
    picture.shadow = known->shadow;
    picture.shadow_frame = known->frame;
}

// All of a cloud's light, whether the picture needs it or not.
void Renderer::Impl::light_all(LitCloud& cloud, const Splats& splats, const RenderOptions& options) {
    if (options.light.lighting == Lighting::cfa)
        absorb_sunlight(cloud, DensityBlocks(cloud.cloud, splats.metaballs.extinction_per_m), options);
    else if (on_processor())
        light_seen(cloud, {}, nullptr, nullptr, &times);
    else
        pass_sunlight(cloud);
}

Picture Renderer::Impl::draw_with_ground(const Splats& splats, const RenderOptions& options) {
    const CameraFrame camera = camera_frame(options.camera);
    const DetailView detail{camera.position_m, pixels_per_unit(options.camera, camera)};
    Picture picture = draw(splats, options, detail);
    WetGround ground{options, *splats.ground_cover, splats.flash ? &*splats.flash : nullptr, splats.time_s};
    std::optional<MirrorView> mirror;
    if (shows_reflections(options, *splats.ground_cover)) {
        RenderOptions below = options;
        below.camera =
            mirrored_camera(options.camera, options.ground.height_m, options.wet_ground.reflection_scale);
        Splats mirrored = splats;
        mirrored.depth = mirrored.light = false;
        // What is merged stays, and with it the light.
        mirror = mirror_view(draw(mirrored, below, detail), below.camera);
        ground.mirror = &*mirror;
    }
    ground.shadow = lit.shadow.data();  // the mirrored view may have completed it
    ground.shadow_size = lit.shadow_size;
    ground.sky = sky_of(splats, options);  // the mirrored view has another
    draw_wet_ground(ground, picture);
    return picture;
}

void Renderer::Impl::draw_on_processor(const Splats& splats, const RenderOptions& options,
                                       const CameraFrame& camera, const std::vector<PartFrame>& parts,
                                       ViewSortedSplats& order, Picture& picture) {
    std::vector<ProcessorView> views;
    for (const PartFrame& part : parts)
        views.emplace_back(options, camera, part.frame, part.tile, order, BatchLimits{}, &times);
    std::optional<VisibleSet> seen;
    if (!splats.light && !lit.all_known) {
        seen.emplace(order, lit.shadow_size);
        for (ProcessorView& view : views) view.find_visible(lit.shadow_size, *seen);
        if (has_shells(options, lit.cloud)) std::ranges::fill(seen->map_tiles, std::uint8_t{1});
    }
    const VisibleSet* const known = seen ? &*seen : nullptr;
    const std::vector<float> lightning = light_up(splats, options, order, known);
    set_light(order, {lit.sun_depths, lightning});
    const AirShells shells = air_shells(options, lit.cloud, lit.frame, lit.shadow, lit.shadow_size,
                                        splats.time_s, fog_noise, shade_cache);
    for (ProcessorView& view : views) view.draw(picture, lit.shadow.data(), lit.shadow_size, shells, known);
}

void Renderer::Impl::draw_on_device(const Splats& splats, const RenderOptions& options,
                                    const CameraFrame& camera, const std::vector<PartFrame>& parts,
                                    ViewSortedSplats& order, Picture& picture) {
    const std::vector<float> lightning = light_up(splats, options, order, nullptr);
    set_light(order, {lit.sun_depths, lightning});
    const GpuImage& map = light_on_device().shadow_map();
    const AirShells shells = air_shells(options, lit.cloud, lit.frame, lit.shadow, lit.shadow_size,
                                        splats.time_s, fog_noise, shade_cache);
    const bool tiles = splatting == Splatting::tiles;
    const StageTimer timer(&times, DrawStage::view);
    const auto prepared = [&](auto& passes) -> auto& {
        const ShaderVariant variant{.physical_sky = sky != nullptr,
                                    .shells = shells.any(),
                                    .fog = shells.has_fog(),
                                    .billboards = tiles && !order.billboards.empty()};
        auto& pass = passes[variant.physical_sky ? 1 : 0][shells.has_fog() ? 2 : shells.any() ? 1 : 0];
        if (!pass) pass.emplace(gpu, layout, attenuation_on_device(), clamped, variant);
        if (sky != nullptr) pass->use_sky(gpu, image_of(*sky), clamped);
        pass->use_shadow_map(gpu, map, white_beyond);
        pass->use_scattering(gpu, scattering_buffer);
        if (shells.any()) pass->use_shells(gpu, shells, order);
        return *pass;
    };
    if (tiles) {
        ViewTiles& pass = prepared(view_tiles[order.billboards.empty() ? 0 : 1]);
        for (const PartFrame& part : parts)
            pass.draw_tile(gpu, options, camera, part.frame, part.tile, order, picture);
        return;
    }
    ViewPass& pass = prepared(view_pass);
    for (const PartFrame& part : parts) pass.draw_tile(gpu, part.frame, part.tile, order, picture);
}

// Null: gradient. Until the next call.
const SkyLight* Renderer::Impl::sky_of(const Splats& splats, const RenderOptions& options) {
    if (options.atmosphere.model == AirModel::gradient) return nullptr;
    return &sky_lights.at(options, heights_of(lit.cloud, splats));
}

const GpuImage& Renderer::Impl::image_of(const SkyLight& light) {
    if (!sky_image) sky_image.emplace(gpu);
    if (!sky_image->has(light)) {
        settle();
        sky_image->use(gpu, light);
    }
    return sky_image->image();
}

Renderer::Renderer(const DeviceOptions& options) {
    if (options.tile_size < 16 || options.tile_size > 16384)
        throw Error(ErrorCode::usage, "device: tile_size must be 16..16384 pixels");
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

Picture Renderer::draw_splats(const Splats& splats, const RenderOptions& options) {
    return finish(begin(splats, options));
}

PendingPicture Renderer::begin(const Splats& splats, const RenderOptions& options) {
    check(options);
    int limit = int(impl_->gpu.properties.limits.maxImageDimension2D);
    if (!impl_->on_processor()) limit = std::min(limit, largest_square(impl_->gpu, sizeof(float)));
    if (options.shadow_map_size > limit)
        throw Error(ErrorCode::usage, "shadow_map_size: this device allows at most " + std::to_string(limit));
    if (splats.ground_cover) check(*splats.ground_cover);
    check_memory(splats, options, impl_->tile_size);
    const auto work = [&] {
        auto state = std::make_unique<PendingPicture::State>(splats, options);
        impl_->times = {};
        if (splats.ground_cover && shows_wet_ground(options, *splats.ground_cover)) {
            state->picture = impl_->draw_with_ground(splats, options);
        } else {
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
    assert(state != nullptr &&
           (state->view == nullptr || (impl_->listed_view && state->view == &*impl_->listed_view)));
    with_drawing_errors([&] { impl_->finish(*state); });
    return std::move(state->picture);
}

PendingPicture::PendingPicture(std::unique_ptr<State> state) : state_(std::move(state)) {}
PendingPicture::PendingPicture(PendingPicture&&) noexcept = default;
PendingPicture& PendingPicture::operator=(PendingPicture&&) noexcept = default;
PendingPicture::~PendingPicture() = default;
bool PendingPicture::is_pending() const { return state_ && state_->view != nullptr; }

const StageTimes& Renderer::times() const { return impl_->times; }

std::string Renderer::device_name() const { return std::string(impl_->gpu.properties.deviceName.data()); }

std::vector<std::string> Renderer::validation_messages() const {
    const ValidationLog* log = impl_->gpu.log.get();
    if (log == nullptr) return {};
    const std::scoped_lock lock(log->mutex);
    return log->messages;
}

}  // namespace nephos
