// SPDX-License-Identifier: Apache-2.0
#pragma once

// The view order and the lists of the tiles, made on the device from a cloud that stays there. The twin of
// view_sorting.h, screen_box.h and tile_bins.h:
//
//     cull      keys: distances of the metaballs that may be seen, and of the billboards
//     compact   what is seen moves together: metaballs in their order, then billboards
//     sort      by distance; stable, so that equal distances stay in this order
//     view      shader::ViewBall of each, nearest first
//     boxes     the tiles that each touches
//
// and for each batch, consecutive splats of this order:
//
//     count     entries of each splat of the batch
//     emit      (tile, splat) pairs, splat by splat
//     sort      by tile; stable, so that each tile has its splats nearest first
//     ranges    of each tile
//
// All splats are one batch unless their lists would be too long (ListLimits). Distances are the host's floats but for
// one of some 10^6 (render/vulkan/exact_distance.glsl); boxes may be larger or smaller by what rounding leaves, which
// is far less than the half pixel that would show. Private to the module.

#include <cstdint>
#include <span>

#include "render/cloud/cloud_preparation.h"
#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"
#include "render/options/camera.h"
#include "render/vulkan/device_sort.h"

namespace nephos {

// Limits of what a device draws.
struct ListLimits {
    std::size_t splats = 0;                          // metaballs and billboards of a cloud
    std::size_t entries = std::size_t{1} << 24;      // of the lists of a batch: 256 MiB
    std::size_t batch = 0xffffffff;                  // splats of a batch
    std::size_t batch_with_billboards = 0xffffffff;  // where some of them are billboards
    std::size_t batch_with_march = 0xffffffff;       // where rays march between them
};

// Returns the limits of a device: no storage buffer is larger than it allows, and on a device of type CPU no list
// longer than what its loops go through.
ListLimits limits_of(const GpuDevice& gpu);

// Returns the splats of a batch for which `required` entries would be too many when `batch` splats require them.
// Throws Error(gpu) when there is but one.
std::size_t smaller_batch(std::size_t batch, std::size_t required, const ListLimits& limits);

// Bits that the numbers of tiles take: 0 to `tiles` - 1. `tiles`: 1 at least.
std::uint32_t bits_of(std::size_t tiles);

// Throws Error(usage) when a metaball or the eye is farther from the origin than kFarthest_m along an axis.
void check_distances(const PreparedCloud& cloud, const Vec3& eye);

// Converts a cloud to its form in device memory.
std::vector<shader::CloudBall> cloud_balls(const PreparedCloud& cloud, std::span<const float> sun_depths);

shader::OrderFrame order_frame(const CameraFrame& camera, const Camera& options, const Ground& ground,
                               bool has_flash, double footprint_scale = 0);

// What there must be room for; what only some pictures need has no less than one element.
struct ListSizes {
    std::size_t splats = 0;  // metaballs and billboards
    std::size_t billboards = 0, tiles = 0, entries = 0;
};

// Buffers of all pictures.
class DeviceLists {
  public:
    explicit DeviceLists(const GpuDevice& gpu) : pipelines_(create_order_pipelines(gpu)) {}

    // Make room; then buffers may be others than before, without content. Nothing may use the old ones any more.
    void reserve_cloud(const GpuDevice& gpu, std::size_t balls);
    void reserve(const GpuDevice& gpu, const ListSizes& sizes);
    bool has_room(const ListSizes& sizes) const;

    OrderRecorder recorder(const vk::raii::CommandBuffer& commands, DescriptorSets& sets) const {
        return {commands, pipelines_, sets, counts_};
    }
    // Returns what all passes share. For a picture there are, too: OrderFrame (0), Shells (14) and SeenBillboard (15).
    Resources resources() const;
    // Returns those with the order as it is, or to be moved.
    Resources with_order(const Resources& resources, std::size_t from = 0) const;

    shader::OrderStep step_of(const PicturePart& part, std::size_t shells) const;
    // Records the passes up to `view`, for metaballs in cloud() and billboards.
    void record_order(const OrderRecorder& recorder, const Resources& resources, std::size_t balls,
                      std::size_t billboards) const;
    // Records the lists of the batch step.begin .. step.end - 1, whose boxes are there, and the parts between shells of
    // air. The list is then in list(step.tiles).
    void record_batch(const OrderRecorder& recorder, const Resources& resources,
                      const shader::OrderStep& step) const;

    const SortBuffers& order() const { return order_; }
    const GpuBuffer& list(std::size_t tiles) const;
    const GpuBuffer& cloud() const { return cloud_; }
    const GpuBuffer& flash() const { return flash_; }
    const GpuBuffer& balls() const { return balls_; }
    const GpuBuffer& splats() const { return splats_; }
    const GpuBuffer& tails() const { return tails_; }
    const GpuBuffer& ranges() const { return ranges_; }
    const GpuBuffer& parts() const { return parts_; }
    const GpuBuffer& counts() const { return counts_; }
    const GpuBuffer& table() const { return table_; }
    std::size_t splat_capacity() const { return splat_capacity_; }
    std::size_t entry_capacity() const { return entry_capacity_; }

  private:
    void reserve_splats(const GpuDevice& gpu, std::size_t count, std::size_t billboards);
    void reserve_entries(const GpuDevice& gpu, std::size_t count);

    std::vector<Pipeline> pipelines_;
    GpuBuffer cloud_, flash_, balls_, splats_, tails_, boxes_, table_, sums_, ranges_, parts_, counts_;
    SortBuffers order_, entries_;
    std::size_t ball_capacity_ = 0, splat_capacity_ = 0, billboard_capacity_ = 0, entry_capacity_ = 0,
                tile_capacity_ = 0;
};

}  // namespace nephos
