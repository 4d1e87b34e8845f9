// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a Renderer consists of. Private to the module.

#include <optional>
#include <vector>

#include "render/atmosphere/sky_light.h"
#include "render/blended/view_pass.h"
#include "render/cloud/voxel_absorption.h"
#include "render/cpu/processor_light.h"
#include "render/cpu/processor_view.h"
#include "render/gpu/sky_image.h"
#include "render/lit_cloud.h"
#include "render/renderer.h"
#include "render/vulkan/light_tiles.h"
#include "render/vulkan/listed_view.h"
#include "render/vulkan/view_tiles.h"

namespace nephos {

// Tiles of the picture hold its address.
struct PendingPicture::State {
    State(const Splats& what, const RenderOptions& how) : splats(what), options(how) {}
    ~State() {
        if (view != nullptr) view->abandon(picture);
    }
    State(const State&) = delete;
    State& operator=(const State&) = delete;

    Splats splats;
    RenderOptions options;
    DetailView detail;
    Picture picture;
    ListedView* view = nullptr;  // that draws it; null: it is finished
    bool too_much = false;       // for the lists of the device
};

struct Renderer::Impl {
    explicit Impl(const DeviceOptions& device_options);

    using Drawing = PendingPicture::State;
    void begin(Drawing& drawing);
    void finish(Drawing& drawing);
    // Both at once.
    Picture draw(const Splats& splats, const RenderOptions& options, const DetailView& detail);
    // The same, and what lies on the ground.
    Picture draw_with_ground(const Splats& splats, const RenderOptions& options);
    // A part of the picture that is drawn at once.
    struct PartFrame {
        Tile tile;
        PictureFrame frame;
    };
    void pass_sunlight(LitCloud& kept);
    void absorb_sunlight(LitCloud& kept, const DensityBlocks& blocks, const RenderOptions& options);
    std::vector<float> light_up(const Splats& splats, const RenderOptions& options,
                                const ViewSortedSplats& order, const VisibleSet* seen);
    void light_all(LitCloud& cloud, const Splats& splats, const RenderOptions& options);
    void hand_out_light(const Splats& splats, const RenderOptions& options, Picture& picture);
    void put_map_on_device();
    void use_scattering(const CloudLight& light);
    void draw_on_processor(const Splats& splats, const RenderOptions& options, const CameraFrame& camera,
                           const std::vector<PartFrame>& parts, ViewSortedSplats& order, Picture& picture);
    // From the order that the host makes.
    void draw_ordered(const Splats& splats, const RenderOptions& options, const CameraFrame& camera,
                      const std::vector<PartFrame>& parts, Picture& picture);
    // Light of `lit` from lists of the device, and the cloud itself; false if that is too much. `given`: the
    // cloud before level of detail.
    bool light_listed(const MetaballCloud& given);
    // Sends what is drawn, with the light that is known, unless that light comes and the rest is there.
    void send_cloud(const MetaballCloud& given, bool light_follows);
    // Begins to draw from lists that the device makes.
    void begin_listed(Drawing& drawing, const CameraFrame& camera, const std::vector<PartFrame>& parts);
    bool uses_lists(const Drawing& drawing, const CameraFrame& camera);
    ListedView& lists_on_device();
    // Before what frames in flight look at changes.
    void settle() {
        if (listed_view) listed_view->settle();
    }
    void draw_on_device(const Splats& splats, const RenderOptions& options, const CameraFrame& camera,
                        const std::vector<PartFrame>& parts, ViewSortedSplats& order, Picture& picture);
    const GpuImage& image_of(const SkyLight& sky);
    const SkyLight* sky_of(const Splats& splats, const RenderOptions& options);
    bool uses_device_lists() const { return splatting == Splatting::tiles && lists == TileLists::device; }
    bool on_processor() const { return splatting == Splatting::processor; }
    LightTiles& light_on_device();
    // What was made from the light before is of no use any more.
    void light_changed() { cloud_on_device = shade_cache.known = false; }

    LitCloud lit;                           // of the last picture
    std::optional<LightKey> map_on_device;  // whose map it is; reset when that map changes
    std::size_t light_passes = 0;
    StageTimes times;
    int tile_size;
    GpuDevice gpu;
    PipelineLayout layout;
    vk::raii::Sampler clamped, white_beyond;
    Splatting splatting;  // not automatic
    TileLists lists;      // likewise
    const GpuImage& attenuation_on_device();
    // Made when they are needed.
    std::optional<GpuImage> attenuation;
    std::vector<float> scattering;  // table of `scattering_light`
    CloudLight scattering_light;
    GpuBuffer scattering_buffer;  // its copy on the device
    std::optional<LightTiles> light_tiles;
    // Without and with the physical sky; without shells of air, with them, and with fog in them.
    std::optional<ViewTiles> view_tiles[2][2][3];  // the first index: without and with billboards
    std::optional<ViewPass> view_pass[2][3];
    bool cloud_is_near = false;    // is_near_enough(lit.cloud)
    bool cloud_on_device = false;  // in listed_view, with its light
    // Whose metaballs are there, with whatever light: a key as of one and the same sun; none: unknown.
    std::optional<LightKey> metaballs_on_device;
    FogNoise fog_noise;
    ShadeCache shade_cache;
    std::optional<SkyImage> sky_image;
    SkyLights sky_lights;
    const SkyLight* sky = nullptr;  // of the picture that is drawn; null: gradient
    // Last, and so the first to go: it waits for pictures that look at the others.
    std::optional<ListedView> listed_view;
};

}  // namespace nephos
