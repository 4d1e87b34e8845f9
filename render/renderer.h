// SPDX-License-Identifier: Apache-2.0
#pragma once

// The renderer of D: clouds as metaballs, each drawn as a billboard with a precomputed attenuation texture;
// and of T: clouds as textured billboards, lit by their absorption factors (splats.h).
//
//     step 0   64 attenuation textures as one array (attenuation_texture.h), once per Renderer
//     step 1   from the sun: the light that reaches every metaball, and the shadow map; or T's absorption
//     factor
//              over blocks of voxels instead (voxel_absorption.h)
//     step 2   from the eye: sky and ground, which wears the shadow map, then all splats back to front:
//              buffer = buffer * attenuation + colour
//
// Clouds drawn as billboards take sunlight away as what they hide when they are looked at from the sun
// (render/frame/billboard_shade.h): on the ground, in voxel clouds and air, from rain, and from other billboards.
//
// Drawn by one of three back-ends (Splatting in device_options.h): vectors on the processor, compute shaders,
// or D's blended billboards, the latter two offscreen in Vulkan 1.3. The picture is a function of cloud and
// options alone: two calls give the same bits with the same back-end, device, driver and processor, for any
// number of threads.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/cloud/splats.h"
#include "render/cloud/stage_times.h"
#include "render/image/picture.h"
#include "render/options/device_options.h"
#include "render/options/options.h"
#include "render/rain/precipitation.h"
#include "render/veil/drawn_veil.h"

namespace nephos {

// A frame in flight: begun and not finished. Its destructor waits for the device and discards the picture.
// Must not outlive its Renderer.
class PendingPicture {
  public:
    PendingPicture(PendingPicture&&) noexcept;
    PendingPicture& operator=(PendingPicture&&) noexcept;
    ~PendingPicture();
    // Returns true while a device is still drawing; false: finish() does not wait.
    bool is_pending() const;

  private:
    friend class Renderer;
    struct State;
    explicit PendingPicture(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

class Renderer {
  public:
    // Opens the back-end of the options. Throws Error(gpu) when options need a Vulkan device, by the back-end
    // or by name, and there is no Vulkan loader or no suitable device, with the package to install;
    // Error(usage) when options name an unknown device, or one for the back-end cpu.
    explicit Renderer(const DeviceOptions& options = {});
    ~Renderer();
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;

    // Draws one picture. Metaballs smaller than 1.25 pixels are widened to that radius with the same product
    // of opacity and area, in the picture and in the shadow map, so that a distant cloud is smooth instead of
    // aliased.
    //
    // Not thread-safe; different Renderers may be used in different threads. Throws Error(usage) on bad
    // options, on metaballs that are not finite or have no radius, on billboards with a field out of the
    // range in splats.h, and when the picture does not fit into memory; Error(gpu) when the device fails,
    // after which this Renderer cannot be used any more.
    //
    // View-independent results (light, shadow map) are cached and reused while metaballs, extinction, sun and
    // size of the shadow map are the same, by their content.
    // `veils` are drawn per pixel over the rest; with them Splats::depth is needed.
    Picture draw_splats(const Splats& splats, const RenderOptions& options, std::span<const DrawnVeil> veils = {},
                        std::optional<Rainfall> rain = {});
    Picture draw(const MetaballCloud& cloud, const RenderOptions& options);

    // Draw in two steps, so that a graphics card draws one frame while the next is prepared:
    //
    //     PendingPicture next = renderer.begin(splats, options);
    //     Picture before = renderer.finish(std::move(pending));
    //
    // The memory behind the spans of `splats` must not change until the frame is finished. Pictures have the
    // same bits as those of draw_splats(), in whatever order they are finished. At most two frames are in
    // flight: begin() of a third waits for the first, and of one with another cloud or sky, or with ground that mirrors, for
    // both. The
    // back-ends cpu and blended draw in begin(), as do all back-ends with ground that is not level, or veils. Both throw
    // as draw_splats(); an error of a frame in flight is thrown by its own finish(). Only the Renderer that
    // began a frame may finish it, and only once.
    //
    // `rain` is drawn over the rest, by the back-end `vulkan` on its device; it needs Splats::depth and Splats::light.
    PendingPicture begin(const Splats& splats, const RenderOptions& options, std::span<const DrawnVeil> veils = {},
                         std::optional<Rainfall> rain = {});
    Picture finish(PendingPicture&& pending);

    std::string backend_name() const;  // "cpu", "vulkan" or "blended"
    // Returns the name of the Vulkan device, or as in "cpu (AVX2, 8 threads)".
    std::string device_name() const;

    // Returns the times of the stages since the last begin() or draw_splats(), including finish() of an
    // earlier frame.
    const StageTimes& times() const;

    // Returns all messages of the validation layer so far; empty without DeviceOptions::validation.
    std::vector<std::string> validation_messages() const;

  private:
    friend struct RendererTestAccess;  // tests/render/renderer_test_access.h
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// Writes the back-end of a renderer into the metadata of its pictures, and the Vulkan device where it has
// one.
void note_renderer(const Renderer& renderer, PictureMetadata& metadata);

// Names of all Vulkan devices of this machine, in the loader's order. Throws Error(gpu) when there is none.
std::vector<std::string> device_names();

}  // namespace nephos
