// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D in compute shaders, the GPU-binned view: metaballs, and T's billboards, are sorted and binned into tiles
// of 8x16 pixels on the device (device_lists.h) and added up front to back, with a polynomial instead of a texture for
// their attenuation, until a tile is opaque. The cloud stays on the device; of a picture nothing but the camera, the
// billboards and what else has changed is uploaded. The same picture as that of the blended billboards (view_pass.h).
//
// Pictures, or parts of one, are in flight two at a time: each has frame data, billboards, descriptor sets, commands
// and buffers to read back of its own; what the passes hand to each other is shared, as the device takes one after the
// other. Private to the module.

#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/gpu/frame_uploads.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/image/picture.h"
#include "render/vulkan/device_ground.h"
#include "render/vulkan/device_lists.h"
#include "render/vulkan/device_mirror.h"
#include "render/vulkan/device_rain.h"
#include "render/vulkan/device_shade.h"
#include "render/vulkan/device_sun.h"
#include "render/vulkan/march_volumes.h"

namespace nephos {

// The data shared by all parts of a frame. Images and buffers must not change until the frame is finished.
struct ViewInputs {
    ShaderVariant variant;
    shader::OrderFrame order;
    const GpuImage* shadow_map = nullptr;
    const GpuImage* sky = nullptr;           // null: gradient
    const GpuBuffer* scattering = nullptr;   // scattering_table.h
    const shader::Shells* shells = nullptr;  // null: none
    std::size_t shell_count = 0;
    // What the camera sees of T's billboards, nearest first, and their clouds: until begin_part() returns.
    std::span<const shader::SeenBillboard> billboards;
    std::span<const shader::ViewCloud> clouds;
    const BillboardPictures* pictures = nullptr;  // of the billboards; until begin_part() returns
    const shader::March* march = nullptr;  // clouds with detail, see variant.march; until begin_part() returns
    MarchVolumes* volumes = nullptr;        // of these
    bool depth = true;
    std::span<const float> terrain;  // TerrainView::distance_m, see variant.terrain; until begin_part() returns
    const GroundPass* ground = nullptr;  // as FrameDescription::ground; until begin_part() returns
    bool shows_mirror = false;           // water shows the view in mirror()
    bool keeps = false;                  // the picture goes to mirror()
    DeviceRain::Recording rain;          // over the picture, whose only part this is; empty: none
};

class BinnedView {
  public:
    // Samplers for tables of the sky, whose edge goes on, and for the shadow map, beyond which there is
    // light; they and `unused`, for what a picture does not have, must outlive this.
    BinnedView(const GpuDevice& gpu, const GpuImage& unused, const vk::raii::Sampler& clamped,
               const vk::raii::Sampler& white_beyond);
    ~BinnedView();
    BinnedView(const BinnedView&) = delete;
    BinnedView& operator=(const BinnedView&) = delete;

    // Sets the metaballs of later frames; waits for frames in flight.
    void use_cloud(std::span<const shader::CloudBall> balls);
    // Gives the metaballs of use_cloud() their light on the device, and makes the shadow map in `tiles`
    // (device_sun.h). `largest_radius`: of any metaball, metres.
    void light(const ShadowFrame& frame, int shadow_size, float largest_radius, LightTiles& tiles);
    // Copies the optical depths between the centres of the metaballs and the sun that the last light()
    // computed.
    void read_depths(std::span<float> depths) const { sun_->read_depths(depths); }
    // Sets the transmitted fraction of the lightning at each metaball, 0..65535.
    void use_flash(std::span<const shader::uint> fractions);
    // Sets the shade map of later frames (device_shade.h).
    void use_shade(const ShadeInputs& shade);

    // Makes room for the mirrored view of a camera, the next picture: keep_mirror() when it is finished; or sets one that
    // is on the host. They wait for frames in flight.
    void begin_mirror(const Camera& camera);
    void keep_mirror() { mirror_.build(gpu_); }
    void use_mirror(const MirrorView& view);

    // Begins to draw a part into `picture`, which must stay where it is until it is finished. `first`: of it.
    void begin_part(const ViewInputs& what, const shader::FrameUniforms& frame, const PicturePart& part, Picture& picture,
                    bool first);
    // Waits for the parts of a picture and stores their pixels. Parts that have more entries than there is room for are
    // drawn again, with longer lists or in smaller batches. Throws what failed while the picture was in flight.
    void finish(const Picture& picture);
    // Waits for all parts in flight and stores their pixels; what fails is kept for finish(). To be called
    // before anything changes that they read.
    void flush() noexcept;
    // Waits for the parts of a picture and throws them away.
    void abandon(const Picture& picture) noexcept;

    // Limits of the device; lower for tests.
    ListLimits limits;
    // Parts that were drawn again because of their lists, for tests.
    std::size_t overflows = 0;
    // Pictures whose ground was drawn, for tests.
    std::size_t grounds = 0;

    // The lists of the last part that was drawn, for tests.
    struct Lists {
        std::vector<shader::ViewBall> balls;  // nearest first
        std::vector<shader::TileRange> ranges;
        std::vector<shader::uint> list;
    };
    Lists read_lists(const PicturePart& part);

  private:
    struct Pipelines;
    struct Slot;
    // Waits for everything in flight; its pixels are stored by finish(). Throws when a wait fails:
    // what was waited for then fails in its own finish(), too.
    void wait();
    void reserve(const PicturePart& part, Slot& slot);
    void complete(Slot& slot);
    void flush(Slot& slot) noexcept;
    void submit(Slot& slot);
    void record(const vk::raii::CommandBuffer& commands, Slot& slot);
    void record_ground(const vk::raii::CommandBuffer& commands, Slot& slot, const Resources& resources);
    void record_batch(const vk::raii::CommandBuffer& commands, Slot& slot, const Resources& resources,
                      std::size_t begin, std::size_t end);
    Resources view_resources(const Slot& slot) const;
    Pipelines& pipelines_for(const ShaderVariant& variant);

    const GpuDevice& gpu_;
    const GpuImage& unused_;
    const vk::raii::Sampler &clamped_, &white_beyond_;
    DeviceLists lists_;
    std::optional<DeviceSun> sun_;  // created when it is needed
    std::size_t balls_ = 0;
    std::size_t batch_ = 0;  // splats of a batch for which the lists of this cloud had room
    DeviceShade shade_;
    DeviceMirror mirror_;
    GroundPipelines grounds_;
    GpuBuffer radiance_, depth_;
    GpuImage billboard_textures_;  // created with the first billboard
    std::uint64_t pictures_ = 0;   // BillboardPictures::serial of these; 0: none
    std::vector<std::unique_ptr<Pipelines>> pipelines_;
    std::vector<std::unique_ptr<Slot>> slots_;
    std::size_t next_ = 0;
    const Picture* ordered_ = nullptr;  // whose order is on the device; null: it may be another's
    struct Failure {
        const Picture* picture;
        std::exception_ptr what;
    };
    std::vector<Failure> failures_;
};

}  // namespace nephos
