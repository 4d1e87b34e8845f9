// SPDX-License-Identifier: Apache-2.0
#pragma once

// The order from the eye and the lists of the tiles, made on the device from a cloud that stays there. The
// twin of view_sorting.h, screen_box.h and tile_bins.h:
//
//     cull      keys: distances of the metaballs that may be seen
//     compact   what is seen moves together, in the order of the metaballs
//     sort      by distance; stable, so that equal distances stay in the order of the metaballs
//     view      shader::ViewBall of each, nearest first
//     boxes     the tiles that each touches
//     emit      (tile, splat) pairs, splat by splat
//     sort      by tile; stable, so that each tile has its splats nearest first
//     ranges    of each tile
//
// Distances are the host's floats but for one of some 10^6 (render/vulkan/exact_distance.glsl); boxes may be
// larger or smaller by what rounding leaves, which is far less than the half pixel that would show. Private
// to the module.

#include <cstdint>
#include <span>

#include "render/cloud/cloud_preparation.h"
#include "render/frame/frame_data.h"
#include "render/frame/tile_bins.h"
#include "render/options/camera.h"
#include "render/vulkan/device_sort.h"

namespace nephos {

// Limits of the lists in device memory; beyond them the host makes the lists, in batches.
struct ListLimits {
    std::size_t balls = std::size_t{1} << 22;
    std::size_t entries = std::size_t{1} << 24;
};

// Returns the limits of a device: no storage buffer is larger than it allows, and no list longer than what
// the loops of a device of type CPU go through.
ListLimits limits_of(const GpuDevice& gpu);

// Bits that the numbers of tiles take: 0 to `tiles` - 1. `tiles`: 1 at least.
std::uint32_t bits_of(std::size_t tiles);

// Returns true when all positions are near enough to be sums of two floats.
bool is_near_enough(const PreparedCloud& cloud);
bool is_near_enough(const Vec3& eye);

// Converts a cloud to its form in device memory.
std::vector<shader::CloudBall> cloud_balls(const PreparedCloud& cloud, std::span<const float> sun_depths);

shader::OrderFrame order_frame(const CameraFrame& camera, const Camera& options, const Ground& ground,
                               bool has_flash);

// Buffers of all pictures; what only some need has no less than one element.
class DeviceLists {
  public:
    explicit DeviceLists(const GpuDevice& gpu) : pipelines_(create_order_pipelines(gpu)) {}

    // Makes room; then buffers may be others than before, and sets must be bound anew. Nothing may use the
    // old ones any more.
    void reserve(const GpuDevice& gpu, std::size_t balls, std::size_t tiles, std::size_t entries);
    bool has_room(std::size_t balls, std::size_t tiles, std::size_t entries) const;

    // Four sets for each picture that is on its way.
    using Sets = std::array<vk::DescriptorSet, 4>;
    static constexpr std::uint32_t kSets = 4;
    OrderSets create_sets(const GpuDevice& gpu, std::uint32_t count) const {
        return create_order_sets(gpu, pipelines_, count);
    }
    void bind(const GpuDevice& gpu, const Sets& sets, const GpuBuffer& frame, const GpuBuffer& shells) const;

    // Records the passes up to `view`, for `count` metaballs in cloud().
    void record_order(const vk::raii::CommandBuffer& commands, const Sets& sets, std::size_t count) const;
    // Records the others for a tile of the picture, and the parts between `shells` shells of air. The list is
    // then in list(tiles).
    void record_bins(const vk::raii::CommandBuffer& commands, const Sets& sets, const Tile& tile,
                     std::size_t shells) const;

    // The steps of both, for other sorts (device_sun.h).
    OrderRecorder recorder(const vk::raii::CommandBuffer& commands) const {
        return {commands, pipelines_, counts_};
    }
    shader::OrderStep step_of(const Tile& tile, std::size_t shells) const;
    // Records the passes after the boxes and their sizes in the table.
    void record_lists(const OrderRecorder& recorder, const Sets& sets, const shader::OrderStep& step) const;

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
    std::size_t ball_capacity() const { return ball_capacity_; }
    std::size_t entry_capacity() const { return entry_capacity_; }

  private:
    void reserve_balls(const GpuDevice& gpu, std::size_t count);
    void reserve_entries(const GpuDevice& gpu, std::size_t count);

    OrderPipelines pipelines_;
    GpuBuffer cloud_, flash_, balls_, splats_, tails_, boxes_, table_, sums_, ranges_, parts_, counts_;
    SortBuffers order_, entries_;
    std::size_t ball_capacity_ = 0, entry_capacity_ = 0, tile_capacity_ = 0;
};

}  // namespace nephos
