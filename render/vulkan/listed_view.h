// SPDX-License-Identifier: Apache-2.0
#pragma once

// Step 2 of D in compute shaders from lists that the device makes itself (device_lists.h): of a picture
// nothing but the camera and what else has changed goes to the device. Metaballs only; the same picture as
// that of view_tiles.h. Private to the module.
//
// Pictures, or tiles of one, are on their way two at a time: each has a set of descriptors, frame data,
// commands and buffers to read back of its own; what the passes hand to each other is shared, as the device
// takes one after the other.

#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/gpu/frame_uploads.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/image/picture.h"
#include "render/vulkan/device_lists.h"
#include "render/vulkan/device_sun.h"

namespace nephos {

// The data shared by all tiles of a frame. Images and buffers must not change until the frame is finished.
struct ListedPicture {
    ShaderVariant variant;
    shader::OrderFrame order;
    const GpuImage* shadow_map = nullptr;
    const GpuImage* sky = nullptr;           // null: gradient
    const GpuBuffer* scattering = nullptr;   // scattering_table.h
    const shader::Shells* shells = nullptr;  // null: none
    std::size_t shell_count = 0;
    bool depth = true;
};

class ListedView {
  public:
    // Samplers for tables of the sky, whose edge goes on, and for the shadow map, beyond which there is
    // light; they and the rest must outlive this. `unused` is not read, but lavapipe (Mesa 22.3) wants every
    // sampler of a set to be bound.
    ListedView(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& unused,
               const vk::raii::Sampler& clamped, const vk::raii::Sampler& white_beyond);
    ~ListedView();
    ListedView(const ListedView&) = delete;
    ListedView& operator=(const ListedView&) = delete;

    // Sets the metaballs of later frames; waits for frames in flight.
    void use_cloud(std::span<const shader::CloudBall> balls);
    // Gives the metaballs of use_cloud() their light on the device, and makes the shadow map in `tiles`
    // (device_sun.h). `largest_radius`: of any metaball, metres. Returns false if the lists would be too
    // long: then the light on the device is not to be used.
    bool light(const ShadowFrame& frame, int shadow_size, float largest_radius, LightTiles& tiles);
    // Copies the optical depths between the centres of the metaballs and the sun that the last light()
    // computed.
    void read_depths(std::span<float> depths) const { sun_->read_depths(depths); }
    // Sets the transmitted fraction of the lightning at each metaball, 0..65535.
    void use_flash(std::span<const shader::uint> shares);
    // Uploads the shade map of the shells and the noise of the fog (air_shells.h), unless these are there
    // already.
    void use_shade(std::span<const std::uint32_t> words, std::uint64_t serial);

    // Begins to draw a tile into `picture`, which must stay where it is until it is finished. `first`: of it.
    void begin_tile(const ListedPicture& what, const shader::Frame& frame, const Tile& tile, Picture& picture,
                    bool first);
    // Waits for the tiles of a picture and stores their pixels. False if one of them has more entries than
    // the lists may have: nothing of that tile is drawn. Throws what failed while the picture was on its way.
    bool finish(const Picture& picture);
    // Waits for all tiles in flight and stores their pixels; what fails is kept for finish(). To be called
    // before anything changes that they read.
    void flush() noexcept;
    // Waits for the tiles of a picture that nobody wants any more.
    void abandon(const Picture& picture) noexcept;

    // Balls and entries that there may be; less for tests.
    ListLimits limits;
    // For tests: tiles that were begun, and of those the ones with too many entries; passes of light.
    std::size_t drawn = 0, too_long = 0, lit = 0;

    // The lists of the last tile that was drawn, for tests.
    struct Lists {
        std::vector<shader::ViewBall> balls;  // nearest first
        std::vector<shader::TileRange> ranges;
        std::vector<shader::uint> list;
    };
    Lists read_lists(const Tile& tile);

  private:
    struct Pipelines;
    struct Slot;
    // Waits for everything that is on its way; its pixels are stored by finish(). Throws when a wait fails:
    // what was waited for then fails in its own finish(), too.
    void wait();
    void reserve(const Tile& tile, Slot& slot);
    void complete(Slot& slot);
    void flush(Slot& slot) noexcept;
    void submit(Slot& slot);
    void record(const vk::raii::CommandBuffer& commands, Slot& slot);
    void record_view(const vk::raii::CommandBuffer& commands, Slot& slot);
    void bind(Slot& slot);
    Pipelines& pipelines_for(const ShaderVariant& variant);
    void upload(const GpuBuffer& to, std::span<const std::byte> bytes);
    void download(const GpuBuffer& from, std::span<std::byte> bytes);

    const GpuDevice& gpu_;
    const PipelineLayout& layout_;
    const GpuImage& unused_;
    const vk::raii::Sampler &clamped_, &white_beyond_;
    DeviceLists lists_;
    OrderSets sets_;
    std::optional<DeviceSun> sun_;  // made when it is needed
    std::size_t balls_ = 0;
    GpuBuffer shade_, radiance_, depth_;
    std::uint64_t shade_serial_ = 0;
    std::vector<std::unique_ptr<Pipelines>> pipelines_;
    std::vector<std::unique_ptr<Slot>> slots_;
    std::size_t next_ = 0;
    const Picture* ordered_ = nullptr;      // whose order is on the device; null: it may be another's
    std::vector<const Picture*> too_many_;  // not drawn: too many entries
    struct Failure {
        const Picture* picture;
        std::exception_ptr what;
    };
    std::vector<Failure> failures_;
};

}  // namespace nephos
