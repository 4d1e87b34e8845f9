// SPDX-License-Identifier: Apache-2.0
#pragma once

// Access of the tests to a Renderer's internals (not installed).

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/renderer.h"
#include "render/shared/shared.h"

namespace nephos {

struct GpuDevice;
class VulkanBackend;

struct RendererTestAccess {
    // Returns the number of light passes so far.
    static std::size_t light_passes(const Renderer& renderer);
    // Returns the pictures whose rain the device has drawn so far.
    static std::size_t rains_on_device(const Renderer& renderer);
    // Likewise, whose ground it has drawn.
    static std::size_t grounds_on_device(const Renderer& renderer);
    // Fewer rows of a picture than the device draws rain over at once.
    static void limit_rain_rows(Renderer& renderer, int rows);
    // Returns the bytes uploaded to the device so far.
    static std::uint64_t uploaded_bytes(const Renderer& renderer);
    // Simulates a card whose memory the processor reads slowly; to be called before the first picture.
    static void divide_memory(Renderer& renderer);
    // Submits a deliberate write-after-write hazard, which the synchronization validation must report.
    static void provoke_hazard(Renderer& renderer);
    // Has a shader read beyond the end of a buffer.
    static void provoke_overrun(Renderer& renderer);

    // Indices of keys, sorted by the passes of device_sort.h over so many bits of them.
    static std::vector<std::uint32_t> sorted(Renderer& renderer, std::span<const std::uint32_t> keys,
                                             std::uint32_t bits);
    // Sums of the numbers before each, and of all at the end.
    static std::vector<std::uint32_t> prefix_sums(Renderer& renderer, std::span<const std::uint32_t> numbers);

    // The device's lists for the last tile of the previous picture, of its last batch (binned_view.h).
    struct Lists {
        std::vector<shader::ViewBall> balls;  // nearest first
        std::vector<shader::TileRange> ranges;
        std::vector<std::uint32_t> list;
    };
    static Lists lists(Renderer& renderer, int tile_width, int tile_height);
    // Lower limits than those of the device: entries of the lists, splats of a batch.
    static void limit_lists(Renderer& renderer, std::size_t entries, std::size_t batch = SIZE_MAX);
    // Fewer metaballs and billboards than the device takes.
    static void limit_splats(Renderer& renderer, std::size_t splats);
    // Tiles of pictures that were drawn again because their lists were too long.
    static std::size_t overflows(const Renderer& renderer);
    // As with a device whose shaders see less of a buffer.
    static void limit_storage(Renderer& renderer, std::uint32_t bytes);

  private:
    static VulkanBackend* vulkan(const Renderer& renderer);  // null: another back-end draws
    static GpuDevice& device(const Renderer& renderer);      // throws Error(usage) for the back-end cpu
};

}  // namespace nephos
