// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/march_volumes.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/detail_noise.h"
#include "render/frame/frame_data.h"
#include "render/frame/marched_scene.h"

namespace nephos {
namespace {

constexpr std::size_t kEdge = CoverageField::kBrickNodes, kNodes = kEdge * kEdge * kEdge;
static_assert(shader::kNodeEdge == kEdge && shader::kNodeWords == kNodes);
static_assert(shader::kMarchLightNodes == kLightNodes && shader::kMarchLightWords == kLightNodesOfBrick);
static_assert(4 * shader::kCellWords == CoverageField::kCellBytes && shader::kOccupied == CoverageField::kOccupied);
static_assert((1 + shader::kPatchSpread) / (1 + shader::kOccupied) == CoverageField::kFactorStep);
static_assert(std::endian::native == std::endian::little);
static_assert(shader::kGroundTexels == GroundLight::kTexels);
static_assert(shader::kLargeNoiseWords == kLargeNoiseVoxels * kLargeNoiseVoxels * kLargeNoiseVoxels);

// Where the words of a volume begin.
struct Places {
    std::size_t table = 0, cells = 0, nodes = 0, bands = 0, light = 0, shade = 0;
    std::size_t cells_end = 0, light_end = 0;
};

Places places_after(const Places& before, const CloudVolume& volume) {
    const std::size_t bricks = volume.field.places().size();
    Places at;
    at.table = before.cells_end;
    at.cells = at.table + volume.field.table().size();
    at.nodes = at.cells + bricks * shader::kCellWords;
    at.bands = at.nodes + bricks * kNodes;
    at.cells_end = at.bands + 4 * volume.field.erosion().bands.size();
    at.light = before.light_end;
    at.shade = at.light + 4 * bricks * kLightNodesOfBrick;
    at.light_end = at.shade + volume.shade.size();
    return at;
}

// Calls what(volume, places) for each that holds cloud; returns the last places.
template <class What>
Places for_each_volume(std::span<const CloudVolume> volumes, const What& what) {
    Places at;
    for (const CloudVolume& volume : volumes) {
        if (volume.field.places().empty()) continue;
        at = places_after(at, volume);
        what(volume, at);
    }
    return at;
}

// Words of all volumes that hold cloud, one volume after the other: table, cells and nodes of their fields. A node's
// word has its t and growth, and those of the next along x: what a look-up interpolates.
void write_cells(std::span<const CloudVolume> volumes, std::span<std::uint32_t> words) {
    for_each_volume(volumes, [&](const CloudVolume& volume, const Places& at) {
        const CoverageField& field = volume.field;
        std::memcpy(&words[at.table], field.table().data(), 4 * field.table().size());
        std::memcpy(&words[at.cells], field.cells().data(), 4 * shader::kCellWords * field.places().size());
        tbb::parallel_for(std::size_t{0}, field.places().size(), [&](std::size_t brick) {
            const std::uint8_t* const from = &field.nodes()[brick * CoverageField::kBrickBytes];
            std::uint32_t* const to = &words[at.nodes + brick * kNodes];
            for (std::size_t i = 0; i < kNodes; ++i)
                to[i] = from[2 * i] | std::uint32_t(from[2 * i + 1]) << 8 |
                        std::uint32_t(from[2 * i + 2]) << 16 | std::uint32_t(from[2 * i + 3]) << 24;
        });
        const auto& bands = field.erosion().bands;
        if (!bands.empty()) std::memcpy(&words[at.bands], bands.data(), sizeof bands[0] * bands.size());
    });
}

// Words of the corners of cells, with what the next along x has: sun depths, then surroundings, of each volume; then those
// of the light on the ground.
void write_light(const LitCloud& cloud, std::span<std::uint32_t> words) {
    const Places end = for_each_volume(cloud.volumes, [&](const CloudVolume& volume, const Places& at) {
        const std::size_t bricks = volume.field.places().size(), plane = bricks * kLightNodesOfBrick;
        const auto pairs = [&](const std::vector<std::uint16_t>& of, std::size_t brick, std::size_t nth) {
            const std::size_t first = brick * kLightNodesOfBrick;
            for (std::size_t i = first; i < first + kLightNodesOfBrick; ++i)
                words[at.light + nth * plane + i] =
                    of.empty() ? 0 : std::uint32_t(of[i]) | std::uint32_t(of[i + 1]) << 16;
        };
        tbb::parallel_for(std::size_t{0}, bricks, [&](std::size_t brick) {
            pairs(volume.sun_depths, brick, 0);
            pairs(volume.surroundings, brick, 1);
            pairs(volume.diffuse.upwards, brick, 2);
            pairs(volume.diffuse.sideways, brick, 3);
        });
        std::ranges::copy(volume.shade, words.begin() + std::ptrdiff_t(at.shade));
    });
    std::ranges::copy(cloud.ground_light.words, words.begin() + std::ptrdiff_t(end.light_end));
}

Places all_places(std::span<const CloudVolume> volumes) {
    return for_each_volume(volumes, [](const CloudVolume&, const Places&) {});
}

}  // namespace

shader::March march_constants(const LitCloud& cloud, const CameraFrame& camera, double pixels_per_unit,
                              const CloudLight& light, float bend) {
    const MarchedScene scene(cloud.volumes, camera, pixels_per_unit, light, bend);
    shader::March march{shader::uint(scene.volumes.size()), scene.per_unit, scene.fade_begins, scene.fade_ends,
                         scene.least_step, scene.diffuse, scene.mean_cosine, scene.most_step,
                         ground_light_place(cloud.ground_light, camera.position_m), 0, 0, 0, 0, {}};
    std::size_t n = 0;
    const Places end = for_each_volume(cloud.volumes, [&](const CloudVolume& volume, const Places& at) {
        const MarchedVolume& from = scene.volumes[n];
        const ErosionConstants& e = volume.field.erosion();
        shader::MarchVolume& to = march.volumes[n++];
        to.corner = {from.corner[0], from.corner[1], from.corner[2], from.kernel.node_m};
        for (std::size_t row = 0; row < 3; ++row)
            to.to_noise[row] = {e.to_noise[row][0], e.to_noise[row][1], e.to_noise[row][2], e.to_noise[row][3]};
        to.bricks_x = shader::uint(from.kernel.bricks[0]);
        to.bricks_y = shader::uint(from.kernel.bricks[1]);
        to.bricks_z = shader::uint(from.kernel.bricks[2]);
        to.per_node = 1.0f / from.kernel.node_m;
        to.first_table = shader::uint(at.table);
        to.first_cells = shader::uint(at.cells);
        to.first_nodes = shader::uint(at.nodes);
        to.first_light = shader::uint(at.light);
        to.light_words = shader::uint((at.shade - at.light) / 4);
        to.reach = from.reach;
        to.extinction_per_m = from.kernel.extinction_per_m;
        to.half_density = e.half_density;
        to.cap = e.cap;
        to.base_width = e.base_width;
        to.top_width = e.top_width;
        to.dissolving_width = e.dissolving_width;
        to.medium_width = e.medium_width;
        to.fine_width = e.fine_width;
        to.wisps = e.wisps;
        to.base_m = e.base_m;
        to.gain_fine = e.gain[0];
        to.gain_coarse = e.gain[1];
        to.medium_scale = e.medium_scale;
        to.fine_scale = e.fine_scale;
        to.medium_per_m = e.medium_per_m;
        to.fine_per_m = e.fine_per_m;
        to.footprint_scale = e.footprint_scale;
        to.least_coverage = e.least_coverage;
        to.cloud_odds = from.cloud_odds;
        to.whole = e.whole;
        to.home = from.home;
        to.period_x = from.period[0];
        to.period_y = from.period[1];
        to.per_period_x = from.per_period[0];
        to.per_period_y = from.per_period[1];
        to.bend = from.bend;
        to.repeats = from.repeats ? 1.0f : 0.0f;
        to.to_patches = {from.to_patches[0], from.to_patches[1], from.to_patches[2], from.to_patches[3]};
        to.shade_u = from.shade_u;
        to.shade_v = from.shade_v;
        to.shade_mid_x = from.shade_mid[0];
        to.shade_mid_y = from.shade_mid[1];
        to.patch_ramp = from.patch_ramp;
        to.shade_top = from.shade_top;
        to.per_shade_height = from.per_shade_height;
        to.first_shade = shader::uint(at.shade);
        to.shade_columns = shader::uint(from.shade_columns);
        to.shade_rows = shader::uint(from.shade_rows);
        to.mean_sunlight = from.mean_sunlight;
        to.bands = shader::uint(e.bands.size());
        to.first_bands = shader::uint(at.bands);
        to.bands_begin = e.bands_begin_m;
        to.bands_per_m = e.bands_per_m;
    });
    march.first_ground_light = shader::uint(end.light_end);
    return march;
}

MarchVolumes::MarchVolumes(const GpuDevice& gpu) {
    const auto &large = detail_noise().large, &small = detail_noise().small;
    upload(gpu, noise_, large.size() + small.size(), [&](std::span<std::uint32_t> words) {
        std::ranges::copy(small, std::ranges::copy(large, words.begin()).out);
    });
}

void MarchVolumes::reserve(const GpuDevice& gpu, std::size_t pixels) {
    make_storage(gpu, states_, 4 * sizeof(float) * pixels);
}

void MarchVolumes::upload(const GpuDevice& gpu, Words& to, std::size_t count,
                          const std::function<void(std::span<std::uint32_t> words)>& write_words) {
    const std::size_t bytes = std::max<std::size_t>(count, 1) * sizeof(std::uint32_t),
                      most = gpu.properties.limits.maxStorageBufferRange;
    if (bytes > most)
        throw Error(ErrorCode::usage, "this Vulkan device has no room for clouds with detail of " + std::to_string(bytes) +
                                          " bytes, but for at most " + std::to_string(most) +
                                          ": choose the back-end cpu");
    // A card takes longer to hand out memory than to fill it: buffers stay until they are too small, or far too large.
    const auto make_fit = [&](const GpuBuffer& buffer, const std::function<void(std::size_t)>& make) {
        if (buffer.bytes >= bytes && buffer.bytes / 4 <= bytes) return;
        try {
            make(std::min(bytes + bytes / 8, most));
        } catch (const vk::OutOfDeviceMemoryError&) {
            make(bytes);
        }
    };
    to.bytes = 0;
    make_fit(to.buffer, [&](std::size_t size) { make_storage(gpu, to.buffer, size); });
    make_fit(staging_, [&](std::size_t size) {
        staging_ = {};  // the old one goes before the new one comes
        staging_ = create_buffer(gpu, size, vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    });
    write_words({reinterpret_cast<std::uint32_t*>(staging_.mapped), count});
    gpu.uploaded_bytes += bytes;
    submit_and_wait(gpu, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        commands.copyBuffer(*staging_.buffer, *to.buffer.buffer, vk::BufferCopy(0, 0, bytes));
        full_barrier(commands);
    });
    to.bytes = bytes;
}

void MarchVolumes::use(const GpuDevice& gpu, const LitCloud& cloud) {
    const Places all = all_places(cloud.volumes);
    if (cells_version_ != cloud.volumes_version) {
        cells_version_ = 0;  // until it is there
        upload(gpu, cells_, all.cells_end, [&](std::span<std::uint32_t> words) { write_cells(cloud.volumes, words); });
        cells_version_ = cloud.volumes_version;
    }
    if (light_version_ != cloud.volumes_light) {
        light_version_ = 0;
        upload(gpu, light_, all.light_end + cloud.ground_light.words.size(),
               [&](std::span<std::uint32_t> words) { write_light(cloud, words); });
        light_version_ = cloud.volumes_light;
    }
}

}  // namespace nephos
