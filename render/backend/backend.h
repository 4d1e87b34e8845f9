// SPDX-License-Identifier: Apache-2.0
#pragma once

// The interface of what draws: the CPU, Vulkan and blended back-ends. The renderer prepares what they share - the
// cloud at its level of detail, sky, scattering table, lightning, parts of the picture - and hands it over as a
// FrameDescription; a back-end completes the light of the cloud and draws.
//
// Every resource that a back-end may hold a copy of has a version (render/frame/versioned.h). A back-end compares
// it with the version that it holds and waits for its own frames in flight before it replaces what they read.
// Private to the module.

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/backend/lit_cloud.h"
#include "render/cloud/splats.h"
#include "render/cloud/stage_times.h"
#include "render/frame/air_shells.h"
#include "render/frame/frame_data.h"
#include "render/frame/view_sorting.h"
#include "render/image/picture.h"
#include "render/options/device_options.h"

namespace nephos {

// A part of the picture, and its uniforms.
struct FramePart {
    PicturePart area;
    PictureFrame frame;
};

// Noise of the fog and shade map of the shells, cached from picture to picture.
struct AirCache {
    FogNoise noise;
    ShadeCache shade;
};

// One picture to draw. All that it refers to outlives Backend::begin(); metaballs and billboards, until the
// picture is finished.
struct FrameDescription {
    const Splats& splats;
    const RenderOptions& options;
    CameraFrame camera;
    std::vector<FramePart> parts;
    LitCloud& cloud;                             // whose light the back-end completes
    std::vector<float> lightning;                // fraction of it at each of cloud.cloud.visible; empty: none
    const SkyLight* sky = nullptr;               // null: gradient
    const Versioned<std::vector<float>>& table;  // scattering_table.h
    AirCache& air;
    StageTimes& times;

    // Returns what the camera sees of the splats, the metaballs still without their light. Throws Error(usage)
    // naming a billboard that is not as splats.h wants it.
    ViewSortedSplats view_sorted() const { return view_sorted(cloud.cloud); }
    // The same of the billboards alone.
    ViewSortedSplats view_sorted_billboards() const { return view_sorted(PreparedCloud{}); }
    // Returns the shells of air between the clouds, for which the light of `cloud` must be on the host.
    AirShells shells() const { return shells(cloud.shadow); }
    // The same without the plane of the shade map that is made of the shadow map, which may be on a device.
    AirShells shells_without_light() const { return shells({}); }

  private:
    AirShells shells(std::span<const float> shadow) const {
        return air_shells(options, cloud.cloud, cloud.frame, shadow, cloud.shadow_size, cloud.light,
                          splats.time_s, air.noise, air.shade);
    }
    ViewSortedSplats view_sorted(const PreparedCloud& metaballs) const {
        const StageTimer timer(&times, DrawStage::view_sorting);
        ViewSortedSplats order = sort_for_view(metaballs, splats, camera,
                                               pixels_per_unit(options.camera, camera), options.ground,
                                               footprint_scale(cloud.volumes));
        // Balls are read twice; keys move through memory three times, and back and forth.
        times[DrawStage::view_sorting].bytes =
            metaballs.metaballs.size_bytes() +
            order.balls.size() * (sizeof(Metaball) + 7 * 8 + sizeof(shader::ViewBall));
        return order;
    }
};

// Not thread-safe. Every function throws Error(gpu) or vk::SystemError when a device fails.
class Backend {
  public:
    virtual ~Backend() = default;

    virtual std::string name() const = 0;  // "cpu", "vulkan" or "blended"
    virtual std::string device_name()
        const = 0;                         // of the Vulkan device, or the processor's vectors and threads
    virtual int longest_part() const = 0;  // side of a part of the picture, pixels
    virtual int largest_shadow_map() const = 0;  // side, texels

    // Computes all light of a cloud, whether a picture shows it or not, and leaves it on the host.
    virtual void light_all(LitCloud& cloud, StageTimes& times) = 0;
    // Copies the light of a cloud to the host unless it is there: that which the last begin() or light_all()
    // computed.
    virtual void fetch_light(LitCloud&) {}

    // Draws a picture, or begins to: then returns true, and the picture must stay where it is until finish()
    // or abandon(). At most two are in flight; begin() waits for earlier ones.
    virtual bool begin(const FrameDescription& frame, Picture& picture) = 0;
    // Waits until a picture in flight is complete. Throws what failed in flight.
    virtual void finish(Picture&) {}
    // Waits for a picture in flight and throws it away.
    virtual void abandon(const Picture&) noexcept {}

    // Whether it marches through clouds with detail (LitCloud::volumes); otherwise it draws their metaballs.
    virtual bool marches() const { return false; }

    virtual std::vector<std::string> validation_messages() const { return {}; }
};

}  // namespace nephos
