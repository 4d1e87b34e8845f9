// SPDX-License-Identifier: Apache-2.0
#include "render/blended/blended_backend.h"

#include <span>
#include <vector>

#include "render/blended/attenuation_texture.h"

namespace nephos {
namespace {

GpuImage upload_attenuation(const GpuDevice& gpu) {
    const std::vector<float> texels = attenuation_textures();
    constexpr std::uint32_t kSide = shader::kAttenuationTexels;
    GpuImage image = create_image(gpu, kSide, kSide, shader::kAttenuationLevels, vk::Format::eR32G32Sfloat,
                                  vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst);
    upload_image(gpu, image, std::as_bytes(std::span(texels)));
    return image;
}

}  // namespace

void BlendedBackend::light_all(LitCloud& cloud, StageTimes& times) {
    scene_.light(cloud, times);
    scene_.fetch_map(cloud);
}

ViewPass& BlendedBackend::pass_for(const FrameDescription& frame, const AirShells& shells,
                                   const ViewSortedSplats& order) {
    const ShaderVariant variant{
        .physical_sky = frame.sky != nullptr, .shells = shells.any(), .fog = shells.has_fog(), .terrain = !frame.terrain.empty(),
        .bows = frame.options.light.bows > 0};
    auto& pass = passes_[variant.bows ? 1 : 0][variant.terrain ? 1 : 0][variant.physical_sky ? 1 : 0][variant.fog ? 2 : variant.shells ? 1 : 0];
    if (!pass) pass.emplace(scene_.gpu, variant);
    if (!attenuation_) attenuation_.emplace(upload_attenuation(scene_.gpu));
    const GpuImage& sky = frame.sky != nullptr ? scene_.sky_image(*frame.sky) : scene_.unused();
    pass->use({{3, *attenuation_, scene_.clamped},
               {4, scene_.shadow_map(frame.cloud), scene_.white_beyond},
               {11, sky, scene_.clamped},
               {12, scene_.scattering(frame.table)}});
    if (shells.any()) pass->use_shells(scene_.gpu, shells, order);
    if (variant.terrain) pass->use_terrain(scene_.gpu, frame.terrain);
    return *pass;
}

bool BlendedBackend::begin(const FrameDescription& frame, Picture& picture) {
    LitCloud& cloud = frame.cloud;
    ViewSortedSplats order = frame.view_sorted();
    scene_.light(cloud, frame.times);
    set_light(order, {cloud.sun_depths, frame.lightning});
    if (has_shells(frame.options, cloud.casts_shadow())) scene_.fetch_map(cloud);
    const AirShells shells = frame.shells();
    const StageTimer timer(&frame.times, DrawStage::view);
    ViewPass& pass = pass_for(frame, shells, order);
    for (const FramePart& part : frame.parts)
        pass.draw_part(scene_.gpu, part.frame, part.area, order, picture);
    return false;
}

}  // namespace nephos
