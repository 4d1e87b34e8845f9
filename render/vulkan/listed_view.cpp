// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/listed_view.h"

#include <algorithm>
#include <cstring>

#include "render/frame/frame_data.h"

namespace nephos {
namespace {

constexpr std::size_t kFramesInFlight = 2;

template <class T>
GpuBuffer uniform_buffer(const GpuDevice& gpu) {
    return create_buffer(gpu, sizeof(T), vk::BufferUsageFlagBits::eUniformBuffer, HostAccess::write);
}

void copy(const vk::raii::CommandBuffer& commands, const GpuBuffer& from, const GpuBuffer& to,
          std::size_t bytes) {
    if (bytes > 0) commands.copyBuffer(*from.buffer, *to.buffer, vk::BufferCopy(0, 0, bytes));
}

// Shaders' writes before copies.
void copy_barrier(const vk::raii::CommandBuffer& commands) {
    const vk::MemoryBarrier2 change(access::compute.stages, vk::AccessFlagBits2::eShaderStorageWrite,
                                    access::copy_from.stages, access::copy_from.kinds);
    commands.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(change));
}

// Copies before what the processor reads.
void host_barrier(const vk::raii::CommandBuffer& commands) {
    const vk::MemoryBarrier2 change(access::copy_to.stages, access::copy_to.kinds, access::host.stages,
                                    access::host.kinds);
    commands.pipelineBarrier2(vk::DependencyInfo().setMemoryBarriers(change));
}

std::size_t pixels_of(const Tile& tile) { return std::size_t(tile.width) * std::size_t(tile.height); }

}  // namespace

struct ListedView::Pipelines {
    ShaderVariant variant;
    vk::raii::Pipeline project, finish, between;
    // [some are not fitted][with distances]
    vk::raii::Pipeline tiles[2][2] = {{nullptr, nullptr}, {nullptr, nullptr}};

    Pipelines(const GpuDevice& gpu, const PipelineLayout& layout, const ShaderVariant& which)
        : variant(which),
          project(create_compute_pipeline(gpu, layout, shaders().view_project_comp, variant)),
          finish(create_compute_pipeline(gpu, layout, shaders().view_finish_comp, variant)),
          between(variant.shells ? create_compute_pipeline(gpu, layout, shaders().view_shells_comp, variant)
                                 : nullptr) {}

    void prepare(const GpuDevice& gpu, const PipelineLayout& layout, bool depth) {
        for (const bool mixed : {false, true}) {
            vk::raii::Pipeline& pipeline = tiles[mixed ? 1 : 0][depth ? 1 : 0];
            if (!*pipeline)
                pipeline =
                    create_tile_pipeline(gpu, layout, shaders().view_tiles_comp, {mixed, depth}, variant);
        }
    }
};

// One tile of a picture that is on its way.
struct ListedView::Slot {
    Bindings bindings;
    DeviceLists::Sets sets{};
    GpuBuffer frame, order_frame, shells;  // read by the device
    GpuBuffer radiance, depth, counts;     // read back
    vk::raii::CommandBuffer commands{nullptr};
    vk::raii::Fence fence{nullptr};
    bool submitted = false;      // and not known to be done: also after a wait that failed
    Picture* picture = nullptr;  // whose pixels are not stored yet
    ListedPicture what;
    Tile tile;
    std::size_t capacity = 0;  // of the lists, in the commands
    bool with_order = true;    // else the order of the slot before

    void wait(const GpuDevice& gpu) {
        if (!submitted) return;
        const vk::Result result = gpu.device.waitForFences(*fence, VK_TRUE, UINT64_MAX);
        if (result != vk::Result::eSuccess) fail_gpu("waiting for the device", result);
        submitted = false;
    }
    void wait_quietly(const GpuDevice& gpu) noexcept {
        try {
            wait(gpu);
        } catch (...) {  // whoever waits for a picture hears of it
        }
    }
    std::size_t wanted() const { return reinterpret_cast<const shader::OrderCounts*>(counts.mapped)->wanted; }
};

ListedView::ListedView(const GpuDevice& gpu, const PipelineLayout& layout, const GpuImage& unused,
                       const vk::raii::Sampler& clamped, const vk::raii::Sampler& white_beyond)
    : limits(limits_of(gpu)),
      gpu_(gpu),
      layout_(layout),
      unused_(unused),
      clamped_(clamped),
      white_beyond_(white_beyond),
      lists_(gpu),
      sets_(lists_.create_sets(gpu, kFramesInFlight * DeviceLists::kSets)) {
    for (std::size_t n = 0; n < kFramesInFlight; ++n) {
        Slot& slot = *slots_.emplace_back(std::make_unique<Slot>());
        slot.bindings = create_bindings(gpu, layout);
        std::copy_n(sets_.sets.begin() + std::ptrdiff_t(n * DeviceLists::kSets), DeviceLists::kSets,
                    slot.sets.begin());
        slot.frame = uniform_buffer<shader::Frame>(gpu);
        slot.order_frame = uniform_buffer<shader::OrderFrame>(gpu);
        slot.shells = uniform_buffer<shader::Shells>(gpu);
        reserve_copy(gpu, slot.counts, sizeof(shader::OrderCounts));
        const vk::CommandBufferAllocateInfo info(*gpu.pool, vk::CommandBufferLevel::ePrimary, 1);
        slot.commands = std::move(vk::raii::CommandBuffers(gpu.device, info).front());
        slot.fence = vk::raii::Fence(gpu.device, vk::FenceCreateInfo());
    }
    use_shade({}, 0);  // must be bound, used or not
}

ListedView::~ListedView() {
    for (const std::unique_ptr<Slot>& slot : slots_) slot->wait_quietly(gpu_);
}

void ListedView::abandon(const Picture& picture) noexcept {
    for (const std::unique_ptr<Slot>& slot : slots_) {
        if (slot->picture != &picture) continue;
        slot->picture = nullptr;
        slot->wait_quietly(gpu_);
    }
    std::erase(too_many_, &picture);
    std::erase_if(failures_, [&](const Failure& each) { return each.picture == &picture; });
}

ListedView::Pipelines& ListedView::pipelines_for(const ShaderVariant& variant) {
    for (const std::unique_ptr<Pipelines>& each : pipelines_)
        if (each->variant == variant) return *each;
    return *pipelines_.emplace_back(std::make_unique<Pipelines>(gpu_, layout_, variant));
}

void ListedView::wait() {
    for (const std::unique_ptr<Slot>& slot : slots_) slot->wait(gpu_);
}

void ListedView::upload(const GpuBuffer& to, std::span<const std::byte> bytes) {
    if (bytes.empty()) return;
    const GpuBuffer staging =
        create_buffer(gpu_, bytes.size(), vk::BufferUsageFlagBits::eTransferSrc, HostAccess::write);
    write(gpu_, staging, bytes);
    submit_and_wait(gpu_, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        copy(commands, staging, to, bytes.size());
        full_barrier(commands);
    });
}

void ListedView::use_cloud(std::span<const shader::CloudBall> balls) {
    flush();
    balls_ = balls.size();
    lists_.reserve(gpu_, balls_, 1, std::min(4 * balls_, limits.entries));
    upload(lists_.cloud(), std::as_bytes(balls));
}

bool ListedView::light(const ShadowFrame& frame, int shadow_size, float largest_radius, LightTiles& tiles) {
    flush();
    if (!sun_) sun_.emplace(gpu_, lists_);
    if (!sun_->run(gpu_, {balls_, frame, shadow_size, largest_radius}, lists_, limits, tiles)) return false;
    ++lit;
    return true;
}

void ListedView::use_flash(std::span<const shader::uint> shares) {
    flush();
    upload(lists_.flash(), std::as_bytes(shares));
}

void ListedView::use_shade(std::span<const std::uint32_t> words, std::uint64_t serial) {
    if (shade_.bytes != 0 && serial == shade_serial_) return;
    flush();
    const std::size_t bytes = std::max<std::size_t>(words.size_bytes(), 4);
    if (shade_.bytes < bytes) {
        shade_ = {};
        shade_ = create_buffer(
            gpu_, bytes, vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferDst,
            HostAccess::none);
    }
    upload(shade_, std::as_bytes(words));
    shade_serial_ = serial;
}

void ListedView::bind(Slot& slot) {
    lists_.bind(gpu_, slot.sets, slot.order_frame, slot.shells);
    const ListedPicture& what = slot.what;
    const std::size_t tiles = TileGrid{slot.tile.width, slot.tile.height}.tiles();
    const std::pair<std::uint32_t, const GpuBuffer*> buffers[] = {
        {0, &slot.frame},         {1, &lists_.balls()}, {2, &lists_.splats()}, {5, &lists_.ranges()},
        {6, &lists_.list(tiles)}, {7, &lists_.tails()}, {8, &radiance_},       {9, &depth_},
        {12, what.scattering},    {13, &slot.shells},   {14, &shade_},         {15, &lists_.parts()}};
    for (const auto& [binding, buffer] : buffers) bind_buffer(gpu_, slot.bindings, binding, *buffer);
    bind_image(gpu_, slot.bindings, 3, unused_, clamped_);
    bind_image(gpu_, slot.bindings, 4, *what.shadow_map, white_beyond_);
    bind_image(gpu_, slot.bindings, 11, what.sky != nullptr ? *what.sky : unused_, clamped_);
}

// Splats up to the next shell, that shell and those that follow at once, splats again; the device knows how
// many.
void ListedView::record_view(const vk::raii::CommandBuffer& commands, Slot& slot) {
    const Pipelines& pipelines = pipelines_for(slot.what.variant);
    const TileGrid grid{slot.tile.width, slot.tile.height};
    shader::TileStep step = step_over(grid);
    step.tile_count = shader::uint(lists_.ball_capacity());
    step.distances = slot.what.depth;
    step.listed = 1;
    begin_compute(commands, layout_, slot.bindings, pipelines.project, step);
    commands.dispatchIndirect(*lists_.counts().buffer, offsetof(shader::OrderCounts, splats));
    step.tile_count = shader::uint(grid.tiles());
    for (std::size_t part = 0; part <= slot.what.shell_count; ++part) {
        const std::size_t offset = part * sizeof(shader::ViewPart);
        step.first = shader::uint(part);
        pass_barrier(commands);
        for (const bool mixed : {false, true}) {
            begin_compute(commands, layout_, slot.bindings,
                          pipelines.tiles[mixed ? 1 : 0][slot.what.depth ? 1 : 0], step);
            commands.dispatchIndirect(
                *lists_.parts().buffer,
                offset + (mixed ? offsetof(shader::ViewPart, mixed) : offsetof(shader::ViewPart, fitted)));
        }
        step.first_batch = 0;
        if (part == slot.what.shell_count) break;
        pass_barrier(commands);
        begin_compute(commands, layout_, slot.bindings, pipelines.between, step);
        commands.dispatchIndirect(*lists_.parts().buffer, offset + offsetof(shader::ViewPart, air));
    }
    pass_barrier(commands);
    begin_compute(commands, layout_, slot.bindings, pipelines.finish, step);
    dispatch_groups(commands, (pixels_of(slot.tile) + shader::kComputeGroup - 1) / shader::kComputeGroup);
}

void ListedView::record(const vk::raii::CommandBuffer& commands, Slot& slot) {
    const std::size_t pixels = pixels_of(slot.tile);
    full_barrier(commands);  // the picture before has the same buffers
    if (slot.with_order) lists_.record_order(commands, slot.sets, balls_);
    lists_.record_bins(commands, slot.sets, slot.tile, slot.what.shell_count);
    record_view(commands, slot);
    copy_barrier(commands);
    copy(commands, radiance_, slot.radiance, 4 * sizeof(float) * pixels);
    if (slot.what.depth) copy(commands, depth_, slot.depth, sizeof(float) * pixels);
    copy(commands, lists_.counts(), slot.counts, sizeof(shader::OrderCounts));
    host_barrier(commands);
}

void ListedView::submit(Slot& slot) {
    bind(slot);
    slot.capacity = lists_.entry_capacity();
    slot.commands.reset();
    slot.commands.begin(vk::CommandBufferBeginInfo(vk::CommandBufferUsageFlagBits::eOneTimeSubmit));
    record(slot.commands, slot);
    slot.commands.end();
    gpu_.device.resetFences(*slot.fence);
    const vk::CommandBufferSubmitInfo commands(*slot.commands);
    vk::SubmitInfo2 info;
    info.setCommandBufferInfos(commands);
    gpu_.queue.submit2(info, *slot.fence);
    slot.submitted = true;
}

// Draws again what did not fit into the lists, and stores the pixels.
void ListedView::complete(Slot& slot) {
    if (slot.picture == nullptr) return;
    Picture& picture = *std::exchange(slot.picture, nullptr);
    slot.wait(gpu_);
    while (slot.wanted() > slot.capacity) {
        if (slot.wanted() > limits.entries) {
            too_many_.push_back(&picture);
            ++too_long;
            return;
        }
        wait();
        lists_.reserve(gpu_, balls_, 1, std::min(slot.wanted() + slot.wanted() / 4, limits.entries));
        slot.with_order = true;
        ordered_ = nullptr;
        submit(slot);
        slot.wait(gpu_);
    }
    store_tile(reinterpret_cast<const float*>(slot.radiance.mapped),
               slot.what.depth ? reinterpret_cast<const float*>(slot.depth.mapped) : nullptr, slot.tile,
               picture);
}

void ListedView::download(const GpuBuffer& from, std::span<std::byte> bytes) {
    if (bytes.empty()) return;
    const GpuBuffer staging =
        create_buffer(gpu_, bytes.size(), vk::BufferUsageFlagBits::eTransferDst, HostAccess::read);
    submit_and_wait(gpu_, [&](const vk::raii::CommandBuffer& commands) {
        full_barrier(commands);
        copy(commands, from, staging, bytes.size());
        host_barrier(commands);
    });
    std::ranges::copy(std::span(staging.mapped, bytes.size()), bytes.begin());
}

ListedView::Lists ListedView::read_lists(const Tile& tile) {
    wait();
    const std::size_t tiles = TileGrid{tile.width, tile.height}.tiles();
    shader::OrderCounts counts;
    download(lists_.counts(), std::as_writable_bytes(std::span(&counts, 1)));
    Lists lists;
    lists.balls.resize(counts.visible);
    lists.ranges.resize(tiles);
    lists.list.resize(counts.entries);
    download(lists_.balls(), std::as_writable_bytes(std::span(lists.balls)));
    download(lists_.ranges(), std::as_writable_bytes(std::span(lists.ranges)));
    download(lists_.list(tiles), std::as_writable_bytes(std::span(lists.list)));
    return lists;
}

void ListedView::flush(Slot& slot) noexcept {
    const Picture* const picture = slot.picture;
    try {
        complete(slot);
    } catch (...) {
        failures_.push_back({picture, std::current_exception()});
    }
}

void ListedView::flush() noexcept {
    for (const std::unique_ptr<Slot>& slot : slots_) flush(*slot);
}

bool ListedView::finish(const Picture& picture) {
    for (const std::unique_ptr<Slot>& slot : slots_)
        if (slot->picture == &picture) flush(*slot);
    const auto failed = std::ranges::find(failures_, &picture, &Failure::picture);
    if (failed != failures_.end()) {
        const std::exception_ptr what = failed->what;
        abandon(picture);
        std::rethrow_exception(what);
    }
    return std::erase(too_many_, &picture) == 0;
}

void ListedView::reserve(const Tile& tile, Slot& slot) {
    const std::size_t pixels = pixels_of(tile), tiles = TileGrid{tile.width, tile.height}.tiles();
    const std::size_t entries = std::min(std::max<std::size_t>(4 * balls_, tiles), limits.entries);
    if (!lists_.has_room(balls_, tiles, entries) || depth_.bytes < sizeof(float) * pixels) {
        wait();
        lists_.reserve(gpu_, balls_, tiles, entries);
        const vk::BufferUsageFlags usage =
            vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eTransferSrc;
        radiance_ = {};
        depth_ = {};
        radiance_ = create_buffer(gpu_, 4 * sizeof(float) * pixels, usage, HostAccess::none);
        depth_ = create_buffer(gpu_, sizeof(float) * pixels, usage, HostAccess::none);
    }
    reserve_copy(gpu_, slot.radiance, 4 * sizeof(float) * pixels);
    reserve_copy(gpu_, slot.depth, sizeof(float) * pixels);
}

void ListedView::begin_tile(const ListedPicture& what, const shader::Frame& frame, const Tile& tile,
                            Picture& picture, bool first) {
    Slot& slot = *slots_[next_];
    next_ = (next_ + 1) % slots_.size();
    flush(slot);
    slot.wait(gpu_);  // of a picture that nobody wants
    too_many_.reserve(too_many_.size() + slots_.size());
    failures_.reserve(failures_.size() + slots_.size());  // flush() may not throw
    reserve(tile, slot);
    pipelines_for(what.variant).prepare(gpu_, layout_, what.depth);
    slot.what = what;
    slot.tile = tile;
    write(gpu_, slot.frame, frame);
    write(gpu_, slot.order_frame, what.order);
    if (what.shells != nullptr) write(gpu_, slot.shells, *what.shells);
    slot.what.shells = nullptr;  // it is there
    slot.with_order = first || ordered_ != &picture;
    submit(slot);
    slot.picture = &picture;
    ordered_ = &picture;
    ++drawn;
}

}  // namespace nephos
