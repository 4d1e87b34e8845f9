// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/gpu_scene.h"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <span>
#include <utility>

#include "render/backend/host_light.h"

namespace nephos {
namespace {

// Side of the map of no cloud: the smallest will do.
constexpr int kWhiteMap = 16;

// Longest side of a square of elements that a shader may see as one buffer.
int largest_square(const GpuDevice& gpu, std::size_t element_bytes) {
    return int(std::sqrt(double(gpu.properties.limits.maxStorageBufferRange / element_bytes)));
}

GpuImage create_unused_image(const GpuDevice& gpu) {
    GpuImage image = create_image(gpu, 1, 1, 2, vk::Format::eR32Sfloat, vk::ImageUsageFlagBits::eSampled);
    submit_and_wait(
        gpu, [&](const vk::raii::CommandBuffer& commands) { begin_image(commands, image, access::sample); });
    return image;
}

}  // namespace

GpuScene::GpuScene(GpuDevice device)
    : gpu(std::move(device)),
      clamped(create_sampler(gpu, vk::SamplerAddressMode::eClampToEdge)),
      white_beyond(create_sampler(gpu, vk::SamplerAddressMode::eClampToBorder)) {}

int GpuScene::longest_part() const {
    const vk::PhysicalDeviceLimits& limits = gpu.properties.limits;
    return std::min({int(limits.maxImageDimension2D), int(limits.maxFramebufferWidth),
                     largest_square(gpu, 4 * sizeof(float))});  // of radiance
}

int GpuScene::largest_shadow_map() const {
    return std::min(int(gpu.properties.limits.maxImageDimension2D), largest_square(gpu, sizeof(float)));
}

std::vector<std::string> GpuScene::validation_messages() const {
    if (gpu.log == nullptr) return {};
    const std::scoped_lock lock(gpu.log->mutex);
    return gpu.log->messages;
}

const GpuImage& GpuScene::unused() {
    if (!unused_) unused_.emplace(create_unused_image(gpu));
    return *unused_;
}

LightTiles& GpuScene::light_tiles() {
    if (!light_tiles_) light_tiles_.emplace(gpu);
    return *light_tiles_;
}

const GpuImage& GpuScene::sky_image(const SkyLight& sky) {
    if (!sky_image_) sky_image_.emplace(gpu);
    if (!sky_image_->has(sky)) {
        wait();
        sky_image_->use(gpu, sky);
    }
    return sky_image_->image();
}

const GpuBuffer& GpuScene::scattering(const Versioned<std::vector<float>>& table) {
    if (scattering_version_ == table.version()) return scattering_;
    wait();
    const std::span<const std::byte> bytes = std::as_bytes(std::span(table.get()));
    scattering_ =
        create_buffer(gpu, bytes.size(), vk::BufferUsageFlagBits::eStorageBuffer, HostAccess::write);
    write(gpu, scattering_, bytes);
    scattering_version_ = table.version();
    return scattering_;
}

const GpuImage& GpuScene::shadow_map(const LitCloud& cloud) {
    if (has_map(cloud)) return light_tiles().shadow_map();
    wait();
    map_ = 0;
    if (!cloud.casts_shadow())
        light_tiles().use(gpu, std::vector<float>(std::size_t{kWhiteMap} * kWhiteMap, 1.0f), kWhiteMap);
    else
        light_tiles().use(gpu, cloud.shadow, cloud.shadow_size);
    map_ = cloud.light;
    return light_tiles().shadow_map();
}

void GpuScene::light(LitCloud& cloud, StageTimes& times) {
    if (cloud.all_known) return;
    if (cloud.lit_on_host()) return complete_light_on_host(cloud, times);
    wait();
    map_ = 0;
    const LightSortedSplats order = sort_for_light(cloud.cloud, cloud.frame, cloud.shadow_size);
    const std::vector<float> ordered = light_tiles().run(gpu, order, cloud.shadow_size);
    for (std::size_t i = 0; i < ordered.size(); ++i) cloud.sun_depths[order.source[i]] = ordered[i];
    cloud.all_known = true;
    cloud.note_light_pass();
    cloud.host_light = 0;  // the map is not there
    map_ = cloud.light;
}

void GpuScene::fetch_map(LitCloud& cloud) {
    if (cloud.host_light == cloud.light) return;
    light_tiles().read_map(gpu, cloud.shadow);
    cloud.host_light = cloud.light;
}

}  // namespace nephos
