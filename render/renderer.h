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
// Clouds drawn as billboards cast no shadow on the ground or on other clouds.
//
// Drawn by one of three back-ends (Splatting in device_options.h): vectors on the processor, compute shaders, or
// D's blended billboards, the latter two offscreen in Vulkan 1.3. The picture is a function of cloud and options
// alone: two calls give the same bits with the same back-end, device, driver and processor, for any number of
// threads.

#include <memory>
#include <string>
#include <vector>

#include "render/cloud/splats.h"
#include "render/cloud/stage_times.h"
#include "render/image/picture.h"
#include "render/options/device_options.h"
#include "render/options/options.h"

namespace nephos {

// A picture that was begun and is not finished. Dropped without finish(), it is waited for and thrown away.
// Must not outlive its Renderer.
class PendingPicture {
  public:
    PendingPicture(PendingPicture&&) noexcept;
    PendingPicture& operator=(PendingPicture&&) noexcept;
    ~PendingPicture();
    // Whether a device is still drawing it, as far as is known; false: finish() does not wait.
    bool is_pending() const;

  private:
    friend class Renderer;
    struct State;
    explicit PendingPicture(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

class Renderer {
  public:
    // Opens the back-end that options ask for. Throws Error(gpu) when a Vulkan device is asked for, by the
    // back-end or by name, and there is no Vulkan loader or no device that can do it, saying what to install;
    // Error(usage) when options name an unknown device, or one for the back-end cpu.
    explicit Renderer(const DeviceOptions& options = {});
    ~Renderer();
    Renderer(Renderer&&) noexcept;
    Renderer& operator=(Renderer&&) noexcept;

    // Draws one picture. Metaballs smaller than 1.25 pixels are widened to that radius and thinned out by the
    // same area, in the picture as in the shadow map: a distant cloud is smooth instead of a sparkle of
    // points.
    //
    // Many may be drawn with one Renderer, one at a time: not thread-safe, but different
    // Renderers may work in different threads. Throws Error(usage) on bad options, on metaballs that are not
    // finite or have no radius, on billboards that are not as splats.h wants them, and when the picture does
    // not fit into memory; Error(gpu) when the device fails, after which this Renderer cannot be used any
    // more.
    //
    // What does not depend on the camera is kept for the next picture and used again if neither metaballs nor
    // extinction, sun or size of the shadow map have changed, which their contents tell.
    Picture draw_splats(const Splats& splats, const RenderOptions& options);
    Picture draw(const MetaballCloud& cloud, const RenderOptions& options);

    // The same in two steps, so that a graphics card draws one picture while the next is prepared:
    //
    //     PendingPicture next = renderer.begin(splats, options);
    //     Picture before = renderer.finish(std::move(pending));
    //
    // What `splats` refers to must stay as it is until the picture is finished. Pictures have the same bits
    // as those of draw_splats(), in whatever order they are finished. Two are on their way to the device at
    // most: a third waits for the first, and one of another cloud, or under another sky, for both. What the
    // processor draws is drawn by begin(), as are pictures with wet ground, and those with billboards. Each
    // throws as draw_splats(); what fails while a picture is on its way is thrown by its own finish(). Only
    // the Renderer that began a picture may finish it, and only once.
    PendingPicture begin(const Splats& splats, const RenderOptions& options);
    Picture finish(PendingPicture&& pending);

    std::string backend_name() const;  // what draws: "cpu", "vulkan" or "blended"
    // On what: the name of the Vulkan device, or as in "cpu (AVX2, 8 threads)".
    std::string device_name() const;

    // Where the time went since the last begin() or draw_splats(): also that of finish() for a picture
    // before.
    const StageTimes& times() const;

    // What the validation layer has said so far; empty without DeviceOptions::validation.
    std::vector<std::string> validation_messages() const;

  private:
    friend struct RendererTestAccess;  // render/renderer_test_access.h
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

// Writes the back-end of a renderer into the metadata of its pictures, and the Vulkan device where it has one.
void note_renderer(const Renderer& renderer, PictureMetadata& metadata);

// Names of all Vulkan devices of this machine, in the loader's order. Throws Error(gpu) when there is none.
std::vector<std::string> device_names();

}  // namespace nephos
