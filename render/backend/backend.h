// SPDX-License-Identifier: Apache-2.0
#pragma once

// Interface of the render back-ends: CPU, Vulkan and blended. The renderer prepares what they share - the cloud at
// its level of detail, sky, scattering table, lightning, parts of the picture - and hands it over as a
// FrameDescription; a back-end completes the light of the cloud and draws.
//
// The light of a cloud is the optical depth towards the sun at each visible metaball, and a shadow map of
// transmittance. Multiple scattering is not part of it: that comes from a table when the cloud is drawn
// (render/frame/scattering_table.h), and for volumes with detail from render/cloud/cloud_volume.h.
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
#include "render/ground/ground_pass.h"
#include "render/image/picture.h"
#include "render/options/device_options.h"
#include "render/rain/rain_frame.h"

namespace nephos {

// A rectangle of the picture that is drawn at once, and its uniforms. Larger than the tiles, into which back-ends
// cut it again: at most DeviceOptions::part_size and Backend::longest_part() pixels wide and high.
struct FramePart {
    PicturePart area;
    PictureFrame frame;
};

// Noise of the fog and shade map of the shells, cached from picture to picture.
struct AirCache {
    FogNoise noise;
    ShadeCache shade;
};

// One picture to draw. The caller keeps everything referenced alive until Backend::begin() returns; metaballs and
// billboards until finish() or abandon().
struct FrameDescription {
    const Splats& splats;
    const RenderOptions& options;
    CameraFrame camera;
    std::vector<FramePart> parts;
    LitCloud& cloud;  // the back-end completes its light
    // Transmittance from the flash, 0..1, one for each entry of cloud.cloud.visible; empty: no lightning.
    std::vector<float> lightning;
    const SkyLight* sky = nullptr;               // null: the gradient sky model (AirModel::gradient)
    const Versioned<std::vector<float>>& table;  // scattering_table.h
    AirCache& air;
    StageTimes& times;
    std::span<const float> terrain{};  // TerrainView::distance_m; empty: level ground
    // Ground to draw behind the rest, by a back-end that Backend::draws_ground(); null: it is plain and dry. Its mirrored
    // view is on the host, or with `shows_kept` the one that was kept last.
    const GroundPass* ground = nullptr;
    bool shows_kept = false;
    // The picture is a mirrored view, which the back-end keeps for later ground instead of storing its pixels.
    bool keeps = false;
    bool rains = false;  // with the rain of Backend::prepare_rain()

    // Returns the splats that the camera sees in view order, the metaballs still without their light. Throws
    // Error(usage) naming a billboard that is not as splats.h requires.
    ViewSortedSplats view_sorted() const { return view_sorted(cloud.cloud); }
    // The same of the billboards alone.
    ViewSortedSplats view_sorted_billboards() const { return view_sorted(PreparedCloud{}); }
    // Returns the concentric shells of air around the eye that light shafts and fog are integrated over; none where a
    // scene has neither. Precondition: the light of `cloud` is on the host.
    AirShells shells() const { return shells(cloud.shadow); }
    // The same without the plane of the shade map that is made of the shadow map, which may be on a device. Not with veils.
    AirShells shells_without_light() const { return shells({}); }

  private:
    AirShells shells(std::span<const float> shadow) const {
        const AirLight light{cloud.frame, shadow, cloud.shadow_size, cloud.light,
                             cloud.screen ? &cloud.screen->veils : nullptr};
        return air_shells(options, cloud.cloud, cloud.casters(), light, splats.time_s, air.noise, air.shade);
    }
    ViewSortedSplats view_sorted(const PreparedCloud& metaballs) const {
        const StageTimer timer(&times, DrawStage::view_sorting);
        ViewSortedSplats order = sort_for_view(metaballs, splats, camera,
                                               pixels_per_unit(options.camera, camera), options.ground,
                                               footprint_scale(cloud.volumes), cloud.billboard_sunlight);
        // Balls are read twice; keys move through memory three times, and back and forth.
        times[DrawStage::view_sorting].bytes =
            metaballs.metaballs.size_bytes() +
            order.balls.size() * (sizeof(Metaball) + 7 * 8 + sizeof(shader::ViewBall));
        return order;
    }
};

// Not thread-safe. Every function throws Error(gpu) or vk::SystemError when a device fails; begin() also Error(usage)
// when the picture exceeds a limit of the device, such as its number of splats.
class Backend {
  public:
    virtual ~Backend() = default;

    virtual std::string name() const = 0;  // "cpu", "vulkan" or "blended"
    // The Vulkan device's name; of cpu, the SIMD instruction set and the number of threads: "cpu (AVX2, 8 threads)".
    virtual std::string device_name() const = 0;
    virtual int longest_part() const = 0;        // largest supported side of a FramePart, pixels
    virtual int largest_shadow_map() const = 0;  // largest supported side, texels

    // Computes all light of a cloud, whether a picture shows it or not, and leaves it on the host.
    virtual void light_all(LitCloud& cloud, StageTimes& times) = 0;
    // Copies the light of a cloud from the device to the host unless it is there. Precondition: the cloud is the one
    // last passed to begin() or light_all(); that is not checked.
    virtual void fetch_light(LitCloud&) {}

    // Draws a picture. Returns false if it is complete, true if it is in flight: then `picture` must not move until
    // finish() or abandon(). Two parts may be in flight; begin() blocks until a slot is free.
    virtual bool begin(const FrameDescription& frame, Picture& picture) = 0;
    // Waits until a picture in flight is complete. Throws the error of a part that failed in flight.
    virtual void finish(Picture&) {}
    // Waits for a picture in flight and discards it.
    virtual void abandon(const Picture&) noexcept {}

    // Returns whether it can draw rain with a picture: prepare_rain().
    virtual bool draws_rain() const { return false; }
    // Prepares rain for the next begin(), of `picture`, whose pixels are still to be drawn but whose light is there; it
    // stays where it is until then. Returns false if it cannot be drawn so: then begin_rain() may.
    virtual bool prepare_rain(const RainFrame&, const Weather&, const Picture&) { return false; }
    // Draws rain over a finished picture. Returns false if it has not: then the processor does (precipitation.h); true if
    // it is in flight: the picture must not move until finish() or abandon(). `cloud`: that of the picture, which is the one
    // last passed to begin(); null: it may be another, and Picture::shadow is read instead.
    virtual bool begin_rain(const RainFrame&, const Weather&, const LitCloud*, Picture&) { return false; }

    // Returns whether it draws level ground that is not plain and dry itself (FrameDescription::ground), with this cover
    // and the mirrored view of this camera; otherwise the processor does (wet_ground.h).
    virtual bool draws_ground(const GroundCoverView&, const Camera&) const { return false; }

    // Returns whether it ray-marches volumes with detail (LitCloud::volumes); otherwise it draws their metaballs.
    virtual bool marches() const { return false; }

    virtual std::vector<std::string> validation_messages() const { return {}; }
};

}  // namespace nephos
