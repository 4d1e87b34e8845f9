// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <new>
#include <optional>

#include "automaton/available_memory.h"
#include "automaton/error.h"
#include "automaton/text.h"
#include "render/attenuation_texture.h"
#include "render/light_tiles.h"
#include "render/processor_light.h"
#include "render/processor_view.h"
#include "render/renderer_test_access.h"
#include "render/view_pass.h"
#include "render/view_tiles.h"
#include "render/voxel_absorption.h"

namespace nephos {
namespace {

std::size_t square(std::size_t side) { return side * side; }

// Bytes in main memory while a picture is drawn, on a device that shares it.
std::size_t memory_needed(const Splats& splats, const RenderOptions& options, int tile_size) {
    const std::size_t pixels = std::size_t(options.camera.width) * std::size_t(options.camera.height);
    const std::size_t tile = std::min(pixels, square(std::size_t(tile_size)));
    // Orders, sort keys, light, box and splat of a metaball.
    constexpr std::size_t kPerMetaball = 32 + 16 + 4 * 5 + 16 + 64, kPerBillboard = 2 * 32 + 16;
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
    std::memcpy(staging.mapped, texels.data(), bytes);
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

}  // namespace

struct Renderer::Impl {
    explicit Impl(const DeviceOptions& device_options);

    Picture draw(const Splats& splats, const RenderOptions& options);
    // The sunlight that arrives at each visible metaball, and the shadow map into the picture; also onto the
    // device, unless the processor draws.
    std::vector<float> pass_sunlight(const PreparedCloud& cloud, const RenderOptions& options,
                                     Picture& picture);
    std::vector<float> absorb_sunlight(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                       const RenderOptions& options, Picture& picture);
    bool on_processor() const { return splatting == Splatting::processor; }
    LightTiles& light_on_device();
    // Draws a part of the picture after it has been told the picture's shadow map.
    using DrawPart = std::function<void(const shader::Frame&, const Tile&)>;
    DrawPart part_drawer(const EyeOrder& order, const CameraFrame& camera, const RenderOptions& options,
                         Picture& picture);

    int tile_size;
    GpuDevice gpu;
    PipelineLayout layout;
    vk::raii::Sampler clamped, white_beyond;
    Splatting splatting;  // not automatic
    const GpuImage& attenuation_on_device();
    // Made when they are needed.
    std::optional<GpuImage> attenuation;
    std::optional<LightTiles> light_tiles;
    std::optional<ViewTiles> view_tiles;
    std::optional<ViewPass> view_pass;
};

Renderer::Impl::Impl(const DeviceOptions& device_options)
    : tile_size(device_options.tile_size),
      gpu(open_device(device_options)),
      layout(create_pipeline_layout(gpu)),
      clamped(create_sampler(gpu, vk::SamplerAddressMode::eClampToEdge)),
      white_beyond(create_sampler(gpu, vk::SamplerAddressMode::eClampToBorder)),
      splatting(device_options.splatting) {
    if (splatting == Splatting::automatic) {
        const bool software = gpu.properties.deviceType == vk::PhysicalDeviceType::eCpu;
        splatting = software ? Splatting::processor : Splatting::tiles;
    }
    tile_size = std::min(tile_size, int(std::min(gpu.properties.limits.maxImageDimension2D,
                                                 gpu.properties.limits.maxFramebufferWidth)));
}

const GpuImage& Renderer::Impl::attenuation_on_device() {
    if (!attenuation) attenuation.emplace(upload_attenuation(gpu));
    return *attenuation;
}

LightTiles& Renderer::Impl::light_on_device() {
    if (!light_tiles) light_tiles.emplace(gpu, layout, attenuation_on_device(), clamped);
    return *light_tiles;
}

// D, step 1.
std::vector<float> Renderer::Impl::pass_sunlight(const PreparedCloud& cloud, const RenderOptions& options,
                                                 Picture& picture) {
    const int size = options.shadow_map_size;
    const SunOrder order = order_from_sun(cloud, picture.shadow_frame, size);
    if (cloud.visible.empty()) {  // the map is white, and on the device the smallest will do
        picture.shadow.assign(square(std::size_t(size)), 1.0f);
        std::vector<float> small;
        return on_processor() ? std::vector<float>{} : light_on_device().run(gpu, order, 16, small);
    }
    const std::vector<float> ordered = on_processor()
                                           ? light_by_processor(order, size, picture.shadow)
                                           : light_on_device().run(gpu, order, size, picture.shadow);
    std::vector<float> light(ordered.size());
    for (std::size_t i = 0; i < ordered.size(); ++i) light[order.source[i]] = ordered[i];
    return light;
}

// T's absorption factor in its place.
std::vector<float> Renderer::Impl::absorb_sunlight(const PreparedCloud& cloud, const DensityBlocks& blocks,
                                                   const RenderOptions& options, Picture& picture) {
    const double distance = options.light.light_distance_m;
    picture.shadow = shadow_by_absorption(blocks, picture.shadow_frame, picture.shadow_size, distance);
    if (!on_processor()) light_on_device().use(gpu, picture.shadow, picture.shadow_size);
    return light_by_absorption(cloud, blocks, direction_to_sun(options.sun), distance);
}

Picture Renderer::Impl::draw(const Splats& splats, const RenderOptions& options) {
    const MetaballCloud& cloud = splats.metaballs;
    const Flash* flash = splats.flash ? &*splats.flash : nullptr;
    const PreparedCloud prepared = prepare(cloud);
    const CameraFrame camera = camera_frame(options.camera);
    Picture picture = blank_picture(options);

    picture.shadow_frame = shadow_frame(prepared, direction_to_sun(options.sun), options.shadow_map_size);
    std::optional<DensityBlocks> blocks;
    if (!prepared.visible.empty() && (flash != nullptr || options.light.lighting == Lighting::cfa))
        blocks.emplace(prepared, cloud.extinction_per_m);
    const std::vector<float> light = options.light.lighting == Lighting::cfa && blocks
                                         ? absorb_sunlight(prepared, *blocks, options, picture)
                                         : pass_sunlight(prepared, options, picture);
    std::vector<float> lightning;
    if (flash != nullptr && blocks)
        lightning = flash_by_absorption(prepared, *blocks, flash->position_m, options.light.light_distance_m);
    picture.light.assign(cloud.metaballs.size(), 1.0f);
    for (std::size_t i = 0; i < light.size(); ++i) picture.light[prepared.visible[i]] = light[i];

    const EyeOrder order = order_from_eye(prepared, {light, lightning}, splats, camera,
                                          pixels_per_unit(options.camera, camera), options.ground);
    const DrawPart draw_part = part_drawer(order, camera, options, picture);
    for (int y = 0; y < picture.height; y += tile_size) {
        for (int x = 0; x < picture.width; x += tile_size) {
            const Tile tile{x, y, std::min(tile_size, picture.width - x),
                            std::min(tile_size, picture.height - y)};
            draw_part(frame_data(options, camera, picture.shadow_frame, flash, tile), tile);
        }
    }
    return picture;
}

Renderer::Impl::DrawPart Renderer::Impl::part_drawer(const EyeOrder& order, const CameraFrame& camera,
                                                     const RenderOptions& options, Picture& picture) {
    if (order.puffs.empty() && on_processor()) {
        return [&](const shader::Frame& frame, const Tile& tile) {
            view_by_processor(options, camera, frame, tile, order, picture);
        };
    }
    if (on_processor()) light_on_device().use(gpu, picture.shadow, picture.shadow_size);
    const GpuImage& map = light_on_device().shadow_map();
    if (order.puffs.empty() && splatting == Splatting::tiles) {
        if (!view_tiles) view_tiles.emplace(gpu, layout, attenuation_on_device(), clamped);
        view_tiles->use_shadow_map(gpu, map, white_beyond);
        return [&](const shader::Frame& frame, const Tile& tile) {
            view_tiles->draw_tile(gpu, options, camera, frame, tile, order, picture);
        };
    }
    if (!view_pass) view_pass.emplace(gpu, layout, attenuation_on_device(), clamped);
    view_pass->use_shadow_map(gpu, map, white_beyond);
    return [&](const shader::Frame& frame, const Tile& tile) {
        view_pass->draw_tile(gpu, frame, tile, order, picture);
    };
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
    check(options);
    const std::uint32_t limit = impl_->gpu.properties.limits.maxImageDimension2D;
    if (std::uint32_t(options.shadow_map_size) > limit)
        throw Error(ErrorCode::usage, "shadow_map_size: this device allows at most " + std::to_string(limit));
    check_memory(splats, options, impl_->tile_size);
    try {
        return with_gpu_errors("drawing", [&] { return impl_->draw(splats, options); });
    } catch (const std::bad_alloc&) {
        throw Error(ErrorCode::usage, "not enough memory for a picture of this size");
    }
}

std::string Renderer::device_name() const { return std::string(impl_->gpu.properties.deviceName.data()); }

std::vector<std::string> Renderer::validation_messages() const {
    const ValidationLog* log = impl_->gpu.log.get();
    if (log == nullptr) return {};
    const std::scoped_lock lock(log->mutex);
    return log->messages;
}

// Two copies into the same buffer with no barrier between them.
void RendererTestAccess::provoke_hazard(Renderer& renderer) {
    const GpuDevice& gpu = renderer.impl_->gpu;
    with_gpu_errors("provoking a hazard", [&] {
        using Usage = vk::BufferUsageFlagBits;
        const GpuBuffer from = create_buffer(gpu, 64, Usage::eTransferSrc, HostAccess::write);
        const GpuBuffer to = create_buffer(gpu, 64, Usage::eTransferDst, HostAccess::read);
        submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
            for (int i = 0; i < 2; ++i)
                commands.copyBuffer(*from.buffer, *to.buffer, vk::BufferCopy(0, 0, 64));
        });
    });
}

}  // namespace nephos
