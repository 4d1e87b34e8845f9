// SPDX-License-Identifier: Apache-2.0
#pragma once

// The mirrored view (render/ground/mirror_view.h) on the device, where it was drawn: its parts are copied from one buffer
// to another, and the levels of its pyramid are made there. Private to the module.

#include "render/frame/frame_data.h"
#include "render/gpu/descriptor_sets.h"
#include "render/gpu/gpu_pipeline.h"
#include "render/ground/mirror_view.h"

namespace nephos {

class DeviceMirror {
  public:
    explicit DeviceMirror(const GpuDevice& gpu);

    // While any of these three is called, nothing that reads the texels may be in flight.
    // Makes room for the view of a camera.
    void begin(const GpuDevice& gpu, const Camera& camera);
    // Copies the pixels of a part into the first level.
    void record_part(const vk::raii::CommandBuffer& commands, const GpuBuffer& radiance, const PicturePart& part) const;
    // Makes the other levels, when all parts are there.
    void build(const GpuDevice& gpu);
    // Uploads a view that is on the host.
    void use(const GpuDevice& gpu, const MirrorView& view);

    const MirrorView& layout() const { return layout_; }  // without texels
    // For descriptors, which must be there, used or not: at least one texel, also where memory ran out before.
    const GpuBuffer& texels(const GpuDevice& gpu);

  private:
    Pipeline level_;
    DescriptorSets sets_;
    MirrorView layout_;
    GpuBuffer texels_;
};

}  // namespace nephos
