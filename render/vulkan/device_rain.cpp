// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_rain.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <tbb/parallel_for.h>

#include "render/rain/rain_shafts_pass.h"

namespace nephos {
namespace {

constexpr std::size_t kFramesInFlight = 2;

void copy(const vk::raii::CommandBuffer& commands, const GpuBuffer& from, const GpuBuffer& to,
          std::size_t bytes) {
    commands.copyBuffer(*from.buffer, *to.buffer, vk::BufferCopy(0, 0, bytes));
}

std::size_t groups_of(std::size_t count, std::size_t group) { return (count + group - 1) / group; }

// Makes a buffer at least so large that is written by the processor and copied from.
void reserve_staging(const GpuDevice& gpu, GpuBuffer& buffer, std::size_t bytes) {
    if (buffer.bytes >= bytes) return;
    buffer = {};
    buffer = create_buffer(gpu, bytes, vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
}

// Uploads data that no shader reads before it is there; not empty, as descriptors need a buffer.
template <class T>
void upload_some(const GpuDevice& gpu, GpuBuffer& buffer, std::vector<T> data) {
    if (data.empty()) data.push_back(T{});
    upload(gpu, buffer, std::as_bytes(std::span(data)));
}

}  // namespace

struct DeviceRain::Strip {
    int width = 0, first_row = 0, rows = 0;
};

struct DeviceRain::Target {
    const vk::raii::CommandBuffer& commands;
    DescriptorSets& sets;
    const GpuImage& shadow_map;
    const GpuBuffer &pixels, &depths;
};

struct DeviceRain::Inputs {
    explicit Inputs(const GpuDevice& gpu)
        : uniforms(create_buffer(gpu, sizeof(shader::RainUniforms), vk::BufferUsageFlagBits::eUniformBuffer,
                                 HostAccess::write)) {}

    GpuBuffer uniforms, passes, bases, ground;  // read by the device
    GpuBuffer splashes, splash_counts;          // copied to it
};

struct DeviceRain::Prepared {
    explicit Prepared(const GpuDevice& gpu) : inputs(gpu) {}

    Inputs inputs;
    RainData data{};
    Strip strip;
};

// One picture in flight, or a strip of it.
struct DeviceRain::Slot {
    explicit Slot(const GpuDevice& gpu)
        : sets(gpu),
          inputs(gpu),
          fence(gpu.device, vk::FenceCreateInfo()) {
        const vk::CommandBufferAllocateInfo info(*gpu.pool, vk::CommandBufferLevel::ePrimary, 1);
        commands = std::move(vk::raii::CommandBuffers(gpu.device, info).front());
    }

    DescriptorSets sets;
    Inputs inputs;
    GpuBuffer given, given_depths, result;  // copied to and from the device
    vk::raii::CommandBuffer commands{nullptr};
    vk::raii::Fence fence;
    bool submitted = false;      // and not known to be done
    Picture* picture = nullptr;  // whose pixels are not stored yet
    Strip strip;
};

DeviceRain::DeviceRain(const GpuDevice& gpu, const vk::raii::Sampler& white_beyond)
    : gpu_(gpu),
      white_beyond_(white_beyond),
      shafts_(create_compute_pipeline(gpu, shaders().rain_shafts_comp)),
      streaks_of_(create_compute_pipeline(gpu, shaders().rain_streaks_comp)),
      bands_of_(create_compute_pipeline(gpu, shaders().rain_bands_comp)),
      tiles_(create_compute_pipeline(gpu, shaders().rain_tiles_comp)) {
    for (std::size_t n = 0; n < kFramesInFlight; ++n) slots_.push_back(std::make_unique<Slot>(gpu));
    const std::vector<shader::vec4> nodes = bow_nodes();
    make_storage(gpu, bow_, sizeof(shader::vec4) * nodes.size());
    upload_staged(gpu, bow_, std::as_bytes(std::span(nodes)));
    make_storage(gpu, streaks_, 3 * sizeof(shader::vec4) * shader::kParticlesAtOnce);
    make_storage(gpu, segment_counts_, sizeof(shader::uint) * shader::kStreakSegments);
}

DeviceRain::~DeviceRain() {
    if (wait_others) wait_others();
    for (const std::unique_ptr<Slot>& slot : slots_)
        if (slot->picture != nullptr) abandon(*slot->picture);
}

void DeviceRain::use_particles(PrecipitationKind kind, std::uint64_t seed, std::size_t count) {
    const Made wanted{kind, seed, count};
    if (count == 0 || wanted == made_) return;
    flush();
    made_ = {};  // until all of it is there
    const std::vector<shader::RainParticle> all = rain_particles(make_particles(kind, seed, count));
    reserve_storage(gpu_, particles_, sizeof(shader::RainParticle) * all.size());
    upload_staged(gpu_, particles_, std::as_bytes(std::span(all)));
    made_ = wanted;
}

void DeviceRain::use_noise(std::uint64_t seed) {
    if (noise_seed_ == seed) return;
    flush();
    noise_seed_.reset();
    const std::vector<std::uint32_t> cells = shaft_noise_cells(seed);
    reserve_storage(gpu_, noise_, sizeof(std::uint32_t) * cells.size());
    upload_staged(gpu_, noise_, std::as_bytes(std::span(cells)));
    noise_seed_ = seed;
}

// A picture without a map has one texel, which is not read.
void DeviceRain::use_shadow(const Picture& picture, double ground_m) {
    flush();
    const std::vector<float> white(1, 1.0f);
    const bool some = !picture.shadow.empty();
    const auto size = some ? std::uint32_t(picture.shadow_size) : 1u;
    if (shadow_.width != size) {
        shadow_ = {};
        shadow_ = create_image(gpu_, size, size, 1, vk::Format::eR32Sfloat,
                               vk::ImageUsageFlagBits::eSampled | vk::ImageUsageFlagBits::eTransferDst);
    }
    const std::vector<float> veiled = shadow_with_veils(picture, ground_m);
    upload_image(gpu_, shadow_,
                 std::as_bytes(std::span(!some            ? white
                                         : veiled.empty() ? picture.shadow
                                                          : veiled)));
}

bool DeviceRain::fits(const RainFrame& rain, const RainData& data) const {
    const std::size_t most = gpu_.properties.limits.maxStorageBufferRange;
    return sizeof(shader::RainParticle) * rain.particles <= most && sizeof(float) * data.bases.size() <= most;
}

bool DeviceRain::prepare(const RainFrame& rain, const Weather& weather, const Picture& picture) {
    std::optional<RainData> data = rain_data(rain, weather, picture);
    const std::size_t width = std::size_t(picture.width), rows = std::size_t(picture.height);
    if (!data || !fits(rain, *data) || picture.height > most_rows) return false;
    prepared_ = nullptr;
    if (!data->shafts && data->passes.empty() && data->splashes.empty()) return true;
    ++pictures;
    use_all_of(rain, weather);
    reserve_shared(width * rows, groups_of(rows, shader::kStreakBandRows));
    data->uniforms.extra.y = picture.shadow.empty() ? 0.0f : 1.0f;
    data->uniforms.forward.w = 1;
    const auto unused = std::ranges::find_if(all_prepared_, [](const auto& one) { return one.use_count() == 1; });
    prepared_ = unused != all_prepared_.end() ? *unused : all_prepared_.emplace_back(std::make_shared<Prepared>(gpu_));
    Prepared& next = *prepared_;
    next.data = std::move(*data);
    upload_frame(next.data, picture, next.inputs);
    next.strip = {picture.width, 0, picture.height};
    return true;
}

DeviceRain::Recording DeviceRain::prepared(const GpuImage& shadow_map) {
    if (prepared_ == nullptr) return {};
    return [this, what = prepared_, &shadow_map](const vk::raii::CommandBuffer& commands, DescriptorSets& sets,
                                                 const GpuBuffer& pixels, const GpuBuffer& depths) {
        record_passes({commands, sets, shadow_map, pixels, depths}, what->data, what->inputs, what->strip);
    };
}

void DeviceRain::use_all_of(const RainFrame& rain, const Weather& weather) {
    use_noise(weather.seed);
    use_particles(rain.options.precipitation.kind, weather.seed, rain.particles);
    if (particles_.bytes == 0) make_storage(gpu_, particles_, sizeof(shader::RainParticle));
}

bool DeviceRain::begin(const RainFrame& rain, const Weather& weather, const GpuImage* shadow_map,
                       Picture& picture) {
    std::optional<RainData> data = rain_data(rain, weather, picture);
    if (!data || !fits(rain, *data)) return false;
    if (!data->shafts && data->passes.empty() && data->splashes.empty()) return true;  // nothing falls in view
    ++pictures;
    use_all_of(rain, weather);
    if (shadow_map == nullptr) use_shadow(picture, rain.options.ground.height_m);
    data->uniforms.extra.y = shadow_map != nullptr || !picture.shadow.empty() ? 1.0f : 0.0f;
    const std::size_t row_bytes = 4 * sizeof(float) * std::size_t(picture.width);
    const int rows = int(std::clamp<std::size_t>(gpu_.properties.limits.maxStorageBufferRange / row_bytes, 1,
                                                 std::size_t(most_rows)));
    for (int row = 0; row < picture.height; row += rows) {
        Slot& slot = *slots_[next_];
        next_ = (next_ + 1) % slots_.size();
        complete(slot);
        upload_frame(*data, picture, slot.inputs);
        begin_strip(*data, shadow_map != nullptr ? *shadow_map : shadow_,
                    {picture.width, row, std::min(rows, picture.height - row)}, picture, slot);
    }
    return true;
}

void DeviceRain::upload_frame(const RainData& data, const Picture& picture, Inputs& inputs) {
    write(gpu_, inputs.uniforms, data.uniforms);
    upload_some(gpu_, inputs.passes, data.passes);
    upload_some(gpu_, inputs.bases, data.bases);
    upload_some(gpu_, inputs.ground, picture.ground_light.words);
    if (data.splashes.empty()) return;
    const std::size_t bytes = sizeof(shader::vec4) * data.splashes.size(),
                      count_bytes = sizeof(shader::uint) * data.splash_counts.size();
    reserve_staging(gpu_, inputs.splashes, bytes);
    reserve_staging(gpu_, inputs.splash_counts, count_bytes);
    std::memcpy(inputs.splashes.mapped, data.splashes.data(), bytes);
    std::memcpy(inputs.splash_counts.mapped, data.splash_counts.data(), count_bytes);
    gpu_.uploaded_bytes += bytes + count_bytes;
}

// Makes the buffers of all pictures large enough. Each is tested: one may be missing since memory ran out.
void DeviceRain::reserve_shared(std::size_t pixels, std::size_t bands) {
    const struct {
        GpuBuffer& buffer;
        std::size_t bytes;
    } all[] = {{pixels_, 4 * sizeof(float) * pixels},
               {depths_, sizeof(float) * pixels},
               {band_counts_, sizeof(shader::uint) * bands},
               {band_lists_, sizeof(shader::uint) * bands * shader::kParticlesAtOnce}};
    if (std::ranges::all_of(all, [](const auto& each) { return each.buffer.bytes >= each.bytes; })) return;
    flush();
    for (const auto& each : all) reserve_storage(gpu_, each.buffer, each.bytes);
}

void DeviceRain::begin_strip(const RainData& data, const GpuImage& shadow_map, const Strip& strip,
                             Picture& picture, Slot& slot) {
    const std::size_t width = std::size_t(picture.width), pixels = width * std::size_t(strip.rows),
                      first = width * std::size_t(strip.first_row);
    const std::size_t bands = groups_of(std::size_t(strip.rows), shader::kStreakBandRows);
    reserve_staging(gpu_, slot.given, 4 * sizeof(float) * pixels);
    reserve_staging(gpu_, slot.given_depths, sizeof(float) * pixels);
    reserve_copy(gpu_, slot.result, 4 * sizeof(float) * pixels);
    reserve_shared(pixels, bands);
    float* const to = reinterpret_cast<float*>(slot.given.mapped);
    tbb::parallel_for(0, strip.rows, [&](int row) {
        for (std::size_t i = std::size_t(row) * width; i < std::size_t(row + 1) * width; ++i) {
            std::copy_n(&picture.beauty[3 * (first + i)], 3, to + 4 * i);
            to[4 * i + 3] = picture.transmittance[first + i];
        }
    });
    std::memcpy(slot.given_depths.mapped, &picture.depth_m[first], sizeof(float) * pixels);
    gpu_.uploaded_bytes += 5 * sizeof(float) * pixels;
    slot.strip = strip;
    slot.sets.reset();
    submit(gpu_, slot.commands, slot.fence, [&] { record(slot.commands, data, shadow_map, slot); });
    slot.submitted = true;
    slot.picture = &picture;
}

void DeviceRain::record(const vk::raii::CommandBuffer& commands, const RainData& data,
                        const GpuImage& shadow_map, Slot& slot) {
    const std::size_t pixels = std::size_t(slot.strip.width) * std::size_t(slot.strip.rows);
    full_barrier(commands);  // the picture before has the same buffers
    copy(commands, slot.given, pixels_, 4 * sizeof(float) * pixels);
    copy(commands, slot.given_depths, depths_, sizeof(float) * pixels);
    full_barrier(commands);
    record_passes({commands, slot.sets, shadow_map, pixels_, depths_}, data, slot.inputs, slot.strip);
    full_barrier(commands);
    copy(commands, pixels_, slot.result, 4 * sizeof(float) * pixels);
    buffer_barrier(commands, slot.result, access::copy_to, access::host);
}

void DeviceRain::record_passes(const Target& target, const RainData& data, const Inputs& inputs, const Strip& strip) {
    const std::size_t width = std::size_t(strip.width), rows = std::size_t(strip.rows);
    const std::size_t tiles_x = groups_of(width, shader::kRainTile);
    shader::RainStep step{};
    step.y = shader::uint(strip.first_row);
    step.width = shader::uint(width);
    step.height = shader::uint(rows);
    step.tiles_x = shader::uint(tiles_x);
    step.tiles = shader::uint(tiles_x * groups_of(rows, shader::kRainTile));
    step.bands = shader::uint(groups_of(rows, shader::kStreakBandRows));
    const Resources resources{{0, inputs.uniforms}, {1, target.shadow_map, white_beyond_},
                              {2, inputs.bases},    {3, inputs.ground},
                              {4, bow_},            {5, noise_},
                              {6, target.pixels},   {7, target.depths},
                              {8, inputs.passes},   {9, particles_},
                              {10, streaks_},       {11, segment_counts_},
                              {12, band_counts_},   {13, band_lists_}};
    if (data.shafts) {
        begin_compute(target.commands, shafts_, target.sets.fill(shafts_, resources), step);
        dispatch_groups(target.commands, step.tiles);
        compute_barrier(target.commands);
    }
    if (!data.splashes.empty()) record_splashes(target, resources, data, inputs, step);
    for (std::size_t n = 0; n < data.passes.size(); ++n) {
        step.pass = shader::uint(n);
        record_particles(target, resources, step);
    }
}

void DeviceRain::record_particles(const Target& target, const Resources& resources, shader::RainStep step) {
    const vk::DescriptorSet streaks = target.sets.fill(streaks_of_, resources),
                            bands = target.sets.fill(bands_of_, resources),
                            tiles = target.sets.fill(tiles_, resources);
    for (std::size_t first = 0; first < made_.count; first += shader::kParticlesAtOnce) {
        step.first = shader::uint(first);
        step.count = shader::uint(std::min<std::size_t>(shader::kParticlesAtOnce, made_.count - first));
        begin_compute(target.commands, streaks_of_, streaks, step);
        dispatch_groups(target.commands, groups_of(step.count, shader::kStreakSegment));
        compute_barrier(target.commands);
        record_streaks(target.commands, bands, tiles, step);
    }
}

void DeviceRain::record_streaks(const vk::raii::CommandBuffer& commands, vk::DescriptorSet bands,
                                vk::DescriptorSet tiles, const shader::RainStep& step) {
    begin_compute(commands, bands_of_, bands, step);
    dispatch_groups(commands, step.bands);
    compute_barrier(commands);
    begin_compute(commands, tiles_, tiles, step);
    dispatch_groups(commands, step.tiles);
    compute_barrier(commands);
}

void DeviceRain::record_splashes(const Target& target, const Resources& resources, const RainData& data,
                                 const Inputs& inputs, shader::RainStep step) {
    constexpr std::size_t kStreakBytes = 3 * sizeof(shader::vec4);
    const vk::DescriptorSet bands = target.sets.fill(bands_of_, resources), tiles = target.sets.fill(tiles_, resources);
    const std::size_t count = data.splashes.size() / 3;
    for (std::size_t first = 0; first < count; first += shader::kParticlesAtOnce) {
        step.count = shader::uint(std::min<std::size_t>(shader::kParticlesAtOnce, count - first));
        const std::size_t segment = first / shader::kStreakSegment;
        full_barrier(target.commands);
        target.commands.copyBuffer(*inputs.splashes.buffer, *streaks_.buffer,
                                   vk::BufferCopy(kStreakBytes * first, 0, kStreakBytes * step.count));
        target.commands.copyBuffer(*inputs.splash_counts.buffer, *segment_counts_.buffer,
                                   vk::BufferCopy(sizeof(shader::uint) * segment, 0,
                                                  sizeof(shader::uint) * groups_of(step.count, shader::kStreakSegment)));
        full_barrier(target.commands);
        record_streaks(target.commands, bands, tiles, step);
    }
}

void DeviceRain::wait(Slot& slot) {
    if (!slot.submitted) return;
    const vk::Result result = gpu_.device.waitForFences(*slot.fence, VK_TRUE, UINT64_MAX);
    if (result != vk::Result::eSuccess) fail_gpu("waiting for the device", result);
    slot.submitted = false;
}

void DeviceRain::complete(Slot& slot) {
    wait(slot);
    if (slot.picture == nullptr) return;
    Picture& picture = *std::exchange(slot.picture, nullptr);
    const std::size_t width = std::size_t(picture.width), first = width * std::size_t(slot.strip.first_row);
    const float* const from = reinterpret_cast<const float*>(slot.result.mapped);
    tbb::parallel_for(0, slot.strip.rows, [&](int row) {
        for (std::size_t i = std::size_t(row) * width; i < std::size_t(row + 1) * width; ++i)
            std::copy_n(from + 4 * i, 3, &picture.beauty[3 * (first + i)]);
    });
}

void DeviceRain::finish(const Picture& picture) {
    try {
        for (const std::unique_ptr<Slot>& slot : slots_)
            if (slot->picture == &picture) complete(*slot);
    } catch (...) {
        abandon(picture);  // its strips are no longer anybody's
        throw;
    }
}

void DeviceRain::flush() {
    if (wait_others) wait_others();
    for (const std::unique_ptr<Slot>& slot : slots_) complete(*slot);
}

void DeviceRain::abandon(const Picture& picture) noexcept {
    for (const std::unique_ptr<Slot>& slot : slots_) {
        if (slot->picture != &picture) continue;
        slot->picture = nullptr;
        try {
            wait(*slot);
        } catch (...) {  // whoever waits for another picture hears of it
        }
    }
}

}  // namespace nephos
