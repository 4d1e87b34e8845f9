// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain and snow on the device (P: updated and drawn there), over a finished picture. As on the processor
// (render/rain/precipitation.h) particles are a function of seed and time, not records that are updated:
//
//     rain_shafts.comp    a ray a pixel through the curtains
//     and for each container of particles, kParticlesAtOnce at a time:
//     rain_streaks.comp   where particles are, and the streaks of those that show, in their order
//     rain_bands.comp     the streaks of each band of rows, in their order
//     rain_tiles.comp     those of a tile, blended in their order by depth and transmittance
//
// The latter two also draw the streaks of splashes, which the processor makes: they are few.
//
// Streaks overlap, so that their order shows: it is that of the particles, without atomic counters, and two pictures have
// the same bits.
//
// A picture that the view draws at once has its rain in the view's commands, and stays on the device until it is complete.
// Others, over which the processor has drawn or which are made in parts, are uploaded first. Two of these are in flight,
// each with uniforms and buffers to copy of its own. Private to the module.

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "render/gpu/gpu_pipeline.h"
#include "render/image/picture.h"
#include "render/rain/precipitation.h"
#include "render/vulkan/rain_data.h"

namespace nephos {

class DeviceRain {
  public:
    explicit DeviceRain(const GpuDevice& gpu, const vk::raii::Sampler& white_beyond);
    ~DeviceRain();
    DeviceRain(const DeviceRain&) = delete;
    DeviceRain& operator=(const DeviceRain&) = delete;

    // Begins to draw the rain of `rain` and its weather over a picture, which must stay where it is until it is finished.
    // `shadow_map`: that of the picture, which must not change before; null: Picture::shadow is uploaded. Returns false,
    // and draws nothing, where there are more curtains than shaders know or more particles than a buffer holds.
    bool begin(const RainFrame& rain, const Weather& weather, const GpuImage* shadow_map, Picture& picture);
    // Prepares the rain over a picture that the view is about to draw; what it reads of `picture` is its light. Returns as
    // begin(). Afterwards prepared() records it, or is empty where nothing falls in view.
    bool prepare(const RainFrame& rain, const Weather& weather, const Picture& picture);
    // Records the prepared rain, with the shadow map of the picture; may be called again as long as the
    // recording is kept, which must be while the picture is in flight. `pixels`, `depths`: as BinnedView has them. Needs barriers before and behind.
    using Recording = std::function<void(const vk::raii::CommandBuffer& commands, DescriptorSets& sets,
                                         const GpuBuffer& pixels, const GpuBuffer& depths)>;
    Recording prepared(const GpuImage& shadow_map);
    // Waits for what others have in flight that reads these buffers. Empty: nothing does.
    std::function<void()> wait_others;

    // Waits for a picture, and stores its pixels, if it is in flight.
    void finish(const Picture& picture);
    // Waits for all pictures in flight, and stores their pixels: before anything changes that they read.
    void flush();
    // Waits for a picture in flight and throws it away.
    void abandon(const Picture& picture) noexcept;

    int most_rows =
        4096;  // of a picture that are drawn at once, with 256 lists of streaks, 56 MiB; fewer for tests
    std::size_t pictures = 0;  // that were begun, for tests

  private:
    struct Inputs;  // what shaders read of a picture's rain
    struct Prepared;
    struct Slot;
    struct Strip;   // rows of the picture that are drawn at once
    struct Target;  // commands, and the pixels that they draw over

    void use_particles(PrecipitationKind kind, std::uint64_t seed, std::size_t count);
    void use_noise(std::uint64_t seed);
    void use_shadow(const Picture& picture, double ground_m);
    bool fits(const RainFrame& rain, const RainData& data) const;
    void use_all_of(const RainFrame& rain, const Weather& weather);
    void upload_frame(const RainData& data, const Picture& picture, Inputs& inputs);
    void reserve_shared(std::size_t pixels, std::size_t bands);
    void begin_strip(const RainData& data, const GpuImage& shadow_map, const Strip& strip, Picture& picture,
                     Slot& slot);
    void record(const vk::raii::CommandBuffer& commands, const RainData& data, const GpuImage& shadow_map,
                Slot& slot);
    // All passes over the pixels of a strip.
    void record_passes(const Target& target, const RainData& data, const Inputs& inputs, const Strip& strip);
    void record_particles(const Target& target, const Resources& resources, shader::RainStep step);
    void record_splashes(const Target& target, const Resources& resources, const RainData& data, const Inputs& inputs,
                         shader::RainStep step);
    void record_streaks(const vk::raii::CommandBuffer& commands, vk::DescriptorSet bands, vk::DescriptorSet tiles,
                        const shader::RainStep& step);
    void complete(Slot& slot);
    void wait(Slot& slot);

    const GpuDevice& gpu_;
    const vk::raii::Sampler& white_beyond_;
    Pipeline shafts_, streaks_of_, bands_of_, tiles_;
    // Shared by all pictures: the device takes one after the other.
    GpuBuffer noise_, bow_, particles_, streaks_, segment_counts_, band_counts_, band_lists_, pixels_,
        depths_;
    GpuImage shadow_;  // uploaded
    std::optional<std::uint64_t> noise_seed_;
    struct Made {  // what is in particles_
        PrecipitationKind kind = PrecipitationKind::rain;
        std::uint64_t seed = 0;
        std::size_t count = 0;
        bool operator==(const Made&) const = default;
    } made_;
    std::vector<std::unique_ptr<Slot>> slots_;
    std::size_t next_ = 0;
    std::vector<std::shared_ptr<Prepared>> all_prepared_;  // recordings keep what they read
    std::shared_ptr<Prepared> prepared_;                   // of the next picture
};

}  // namespace nephos
