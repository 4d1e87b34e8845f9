// SPDX-License-Identifier: Apache-2.0
#pragma once

// Level ground that is wet, snowy, country or water (render/ground/wet_ground.h), drawn on the device behind a finished
// view: view_ground.comp, below clouds with detail march_ground.comp, one invocation a pixel. The host prepares what does
// not depend on the pixel: lattices of noise, waves, and the square of ripples, 128 KiB. Private to the module.

#include <memory>
#include <vector>

#include "render/gpu/descriptor_sets.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/ground/ground_pass.h"
#include "render/shared/ground.h"

namespace nephos {

// Returns the data of a pass as shaders read it; `mirror`: the view that water shows, or null.
shader::GroundData ground_data(const GroundPass& pass, const MirrorView* mirror);

// What shaders read of the ground of a part of a picture in flight.
class GroundBuffers {
  public:
    explicit GroundBuffers(const GpuDevice& gpu);
    // `mirror`: the view that water shows, or null; `part`: that of the picture.
    void use(const GpuDevice& gpu, const GroundPass& pass, const MirrorView* mirror,
             const shader::FrameUniforms& part);
    // Sets the bindings of these and of the mirrored view's texels in those of a view.
    void add_to(Resources& resources, const GpuBuffer& mirror_texels) const;

  private:
    GpuBuffer frame_, data_, octaves_, cover_, ripples_, waves_;
};

// The kinds of ground that a pipeline draws.
struct GroundKinds {
    bool sea = false, country = false, lying = false, mirror = false;  // constants 11..14 of ground.glsl
    bool physical_sky = false, march = false;                          // as in ShaderVariant
    bool operator==(const GroundKinds&) const = default;
};

class GroundPipelines {
  public:
    explicit GroundPipelines(const GpuDevice& gpu) : gpu_(gpu) {}
    // Returns the pipeline of these kinds, which stays where it is.
    const Pipeline& of(const GroundKinds& kinds);

  private:
    struct Made {
        GroundKinds kinds;
        Pipeline pipeline;
    };
    const GpuDevice& gpu_;
    std::vector<std::unique_ptr<Made>> made_;
};

}  // namespace nephos
