// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/binned_view.h"

#include <algorithm>
#include <cstring>

#include "render/frame/billboard_textures.h"
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

std::size_t pixels_of(const PicturePart& part) { return std::size_t(part.width) * std::size_t(part.height); }

}  // namespace

struct BinnedView::Pipelines {
    ShaderVariant variant;
    Pipeline project, finish, between;
    Pipeline tiles[2][2];  // [some are not fitted][with distances]

    Pipelines(const GpuDevice& gpu, const ShaderVariant& which) : variant(which) {
        const std::vector<ShaderConstant> constants = constants_of(variant);
        project = create_compute_pipeline(gpu, shaders().view_project_comp, constants);
        const ShaderSet& all = shaders();
        finish = create_compute_pipeline(gpu, variant.march ? all.march_finish_comp : all.view_finish_comp, constants);
        const ShaderCode air = variant.march ? all.march_shells_comp : all.view_shells_comp;
        if (variant.shells) between = create_compute_pipeline(gpu, air, constants);
    }

    // With billboards none are drawn as if all were fitted.
    bool draws(bool mixed) const { return mixed || !variant.billboards; }
    // Where rays march, one pipeline draws both kinds.
    const Pipeline& tiles_of(bool mixed, bool depth) const {
        return tiles[mixed || variant.march ? 1 : 0][depth ? 1 : 0];
    }

    void prepare(const GpuDevice& gpu, bool depth) {
        for (const bool mixed : {false, true}) {
            Pipeline& pipeline = tiles[mixed ? 1 : 0][depth ? 1 : 0];
            if (!draws(mixed) || pipeline.exists() || (variant.march && !mixed)) continue;
            pipeline = variant.march ? create_pixel_pipeline(gpu, shaders().march_tiles_comp, depth, variant)
                                     : create_tile_pipeline(gpu, shaders().view_tiles_comp, {mixed, depth}, variant);
        }
    }
};

// One part of a picture in flight.
struct BinnedView::Slot {
    explicit Slot(const GpuDevice& gpu)
        : sets(gpu),
          frame(uniform_buffer<shader::FrameUniforms>(gpu)),
          order_frame(uniform_buffer<shader::OrderFrame>(gpu)),
          shells(uniform_buffer<shader::Shells>(gpu)),
          march(uniform_buffer<shader::March>(gpu)),
          ground(gpu),
          fence(gpu.device, vk::FenceCreateInfo()) {
        upload(gpu, billboards, {});
        upload(gpu, clouds, {});
        upload(gpu, terrain, {});
        reserve_copy(gpu, counts, sizeof(shader::OrderCounts));
        const vk::CommandBufferAllocateInfo info(*gpu.pool, vk::CommandBufferLevel::ePrimary, 1);
        commands = std::move(vk::raii::CommandBuffers(gpu.device, info).front());
    }

    DescriptorSets sets;
    GpuBuffer frame, order_frame, shells, march, billboards, clouds, terrain;  // read by the device
    GroundBuffers ground;
    GpuBuffer radiance, depth, counts;                         // read back
    vk::raii::CommandBuffer commands{nullptr};
    vk::raii::Fence fence;
    bool submitted = false;      // and not known to be done: also after a wait that failed
    Picture* picture = nullptr;  // whose pixels are not stored yet
    ViewInputs what;
    PicturePart part;
    const Pipeline* ground_of = nullptr;  // null: the ground is plain and dry
    std::size_t billboard_count = 0;
    std::size_t capacity = 0, batch = 0;  // of the lists, in the commands
    bool with_order = true;               // else the order of the slot before

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
    std::size_t required() const {
        return reinterpret_cast<const shader::OrderCounts*>(counts.mapped)->required;
    }
};

BinnedView::BinnedView(const GpuDevice& gpu, const GpuImage& unused, const vk::raii::Sampler& clamped,
                       const vk::raii::Sampler& white_beyond)
    : limits(limits_of(gpu)),
      gpu_(gpu),
      unused_(unused),
      clamped_(clamped),
      white_beyond_(white_beyond),
      lists_(gpu),
      shade_(gpu),
      mirror_(gpu),
      grounds_(gpu) {
    for (std::size_t n = 0; n < kFramesInFlight; ++n) slots_.push_back(std::make_unique<Slot>(gpu));
    use_cloud({});
}

BinnedView::~BinnedView() {
    for (const std::unique_ptr<Slot>& slot : slots_) slot->wait_quietly(gpu_);
}

void BinnedView::abandon(const Picture& picture) noexcept {
    for (const std::unique_ptr<Slot>& slot : slots_) {
        if (slot->picture != &picture) continue;
        slot->picture = nullptr;
        slot->wait_quietly(gpu_);
    }
    std::erase_if(failures_, [&](const Failure& each) { return each.picture == &picture; });
}

BinnedView::Pipelines& BinnedView::pipelines_for(const ShaderVariant& variant) {
    for (const std::unique_ptr<Pipelines>& each : pipelines_)
        if (each->variant == variant) return *each;
    return *pipelines_.emplace_back(std::make_unique<Pipelines>(gpu_, variant));
}

void BinnedView::wait() {
    for (const std::unique_ptr<Slot>& slot : slots_) slot->wait(gpu_);
}

void BinnedView::use_cloud(std::span<const shader::CloudBall> balls) {
    flush();
    balls_ = balls.size();
    batch_ = limits.batch;
    lists_.reserve_cloud(gpu_, balls_);
    upload_staged(gpu_, lists_.cloud(), std::as_bytes(balls));
}

void BinnedView::light(const ShadowFrame& frame, int shadow_size, float largest_radius, LightTiles& tiles) {
    flush();
    if (!sun_) sun_.emplace(gpu_);
    sun_->run(gpu_, {balls_, frame, shadow_size, largest_radius}, lists_, limits, tiles);
    ordered_ = nullptr;
}

void BinnedView::use_flash(std::span<const shader::uint> fractions) {
    flush();
    upload_staged(gpu_, lists_.flash(), std::as_bytes(fractions));
}

void BinnedView::use_shade(const ShadeInputs& shade) {
    if (shade_.has(shade.serial)) return;
    flush();
    shade_.use(gpu_, shade, white_beyond_);
}

Resources BinnedView::view_resources(const Slot& slot) const {
    const ViewInputs& what = slot.what;
    const std::size_t tiles = TileGrid{slot.part.width, slot.part.height}.tiles();
    const GpuImage& textures = what.variant.billboards ? billboard_textures_ : unused_;
    Resources all{{0, slot.frame},
            {1, lists_.balls()},
            {2, lists_.splats()},
            {3, textures, clamped_},
            {4, *what.shadow_map, white_beyond_},
            {5, lists_.ranges()},
            {6, lists_.list(tiles)},
            {7, lists_.tails()},
            {8, radiance_},
            {9, depth_},
            {11, what.sky != nullptr ? *what.sky : unused_, clamped_},
            {12, *what.scattering},
            {13, slot.shells},
            {14, shade_.words()},
            {15, lists_.parts()},
            {16, slot.billboards},
            {17, slot.clouds},
            {23, slot.terrain}};
    if (what.variant.march) all.set(what.volumes->resources(slot.march));
    return all;
}

// Splats up to the next shell, that shell and those that follow at once, splats again; the device knows how
// many.
void BinnedView::record_batch(const vk::raii::CommandBuffer& commands, Slot& slot, const Resources& resources,
                              std::size_t begin, std::size_t end) {
    const Pipelines& pipelines = pipelines_for(slot.what.variant);
    const TileGrid grid{slot.part.width, slot.part.height};
    Resources of_order = lists_.resources();
    of_order.set({{0, slot.order_frame}, {14, slot.shells}, {15, slot.billboards}});
    shader::OrderStep lists = lists_.step_of(slot.part, slot.what.shell_count);
    lists.count = shader::uint(balls_);
    lists.begin = shader::uint(begin);
    lists.end = shader::uint(end);
    lists_.record_batch(lists_.recorder(commands, slot.sets), of_order, lists);

    shader::TileStep step = step_over(grid);
    step.first_batch = begin == 0;
    step.distances = slot.what.depth;
    vk::DescriptorSet tiles[2], between;
    for (const bool mixed : {false, true})
        if (pipelines.draws(mixed))
            tiles[mixed ? 1 : 0] = slot.sets.fill(pipelines.tiles_of(mixed, slot.what.depth), resources);
    if (slot.what.shell_count > 0) between = slot.sets.fill(pipelines.between, resources);
    for (std::size_t part = 0; part <= slot.what.shell_count; ++part) {
        const std::size_t offset = part * sizeof(shader::ViewPart);
        step.part = shader::uint(part);
        pass_barrier(commands);
        for (const bool mixed : {false, true}) {
            if (!pipelines.draws(mixed)) continue;
            begin_compute(commands, pipelines.tiles_of(mixed, slot.what.depth), tiles[mixed ? 1 : 0], step);
            commands.dispatchIndirect(
                *lists_.parts().buffer,
                offset + (mixed ? offsetof(shader::ViewPart, mixed) : offsetof(shader::ViewPart, fitted)));
        }
        step.first_batch = 0;
        if (part == slot.what.shell_count) break;
        pass_barrier(commands);
        begin_compute(commands, pipelines.between, between, step);
        commands.dispatchIndirect(*lists_.parts().buffer, offset + offsetof(shader::ViewPart, air));
    }
}

void BinnedView::begin_mirror(const Camera& camera) {
    flush();
    mirror_.begin(gpu_, camera);
}

void BinnedView::use_mirror(const MirrorView& view) {
    flush();
    mirror_.use(gpu_, view);
}

void BinnedView::record_ground(const vk::raii::CommandBuffer& commands, Slot& slot, const Resources& resources) {
    Resources all = resources;
    slot.ground.add_to(all, mirror_.texels(gpu_));
    pass_barrier(commands);
    begin_compute(commands, *slot.ground_of, slot.sets.fill(*slot.ground_of, all), step_over({slot.part.width, slot.part.height}));
    dispatch_groups(commands, (pixels_of(slot.part) + shader::kComputeGroup - 1) / shader::kComputeGroup);
}

void BinnedView::record(const vk::raii::CommandBuffer& commands, Slot& slot) {
    const std::size_t pixels = pixels_of(slot.part), splats = balls_ + slot.billboard_count;
    const Pipelines& pipelines = pipelines_for(slot.what.variant);
    const Resources resources = view_resources(slot);
    Resources of_order = lists_.resources();
    of_order.set({{0, slot.order_frame}, {14, slot.shells}, {15, slot.billboards}});
    full_barrier(commands);  // the picture before has the same buffers
    const OrderRecorder recorder = lists_.recorder(commands, slot.sets);
    if (slot.with_order) lists_.record_order(recorder, of_order, balls_, slot.billboard_count);
    shader::OrderStep boxes = lists_.step_of(slot.part, slot.what.shell_count);
    boxes.count = shader::uint(balls_);
    recorder.run_indirect(OrderPass::boxes, lists_.with_order(of_order), boxes,
                          offsetof(shader::OrderCounts, visible_each));
    shader::TileStep step = step_over({slot.part.width, slot.part.height});
    step.tile_count = shader::uint(lists_.splat_capacity());
    begin_compute(commands, pipelines.project, slot.sets.fill(pipelines.project, resources), step);
    commands.dispatchIndirect(*lists_.counts().buffer, offsetof(shader::OrderCounts, splats));
    std::size_t begin = 0;
    do {  // once even without splats, for the background
        const std::size_t end = std::min(splats, begin + slot.batch);
        record_batch(commands, slot, resources, begin, end);
        begin = end;
    } while (begin < splats);
    pass_barrier(commands);
    step.distances = slot.what.depth;
    begin_compute(commands, pipelines.finish, slot.sets.fill(pipelines.finish, resources), step);
    dispatch_groups(commands, (pixels + shader::kComputeGroup - 1) / shader::kComputeGroup);
    if (slot.ground_of != nullptr) record_ground(commands, slot, resources);
    if (slot.what.rain) {
        full_barrier(commands);
        slot.what.rain(commands, slot.sets, radiance_, depth_);
        full_barrier(commands);
    }
    copy_barrier(commands);
    if (slot.what.keeps)
        mirror_.record_part(commands, radiance_, slot.part);
    else
        copy(commands, radiance_, slot.radiance, 4 * sizeof(float) * pixels);
    if (slot.what.depth) copy(commands, depth_, slot.depth, sizeof(float) * pixels);
    copy(commands, lists_.counts(), slot.counts, sizeof(shader::OrderCounts));
    host_barrier(commands);
}

void BinnedView::submit(Slot& slot) {
    slot.sets.reset();
    slot.capacity = lists_.entry_capacity();
    slot.batch = std::min(batch_, slot.billboard_count > 0 ? limits.batch_with_billboards : batch_);
    if (slot.what.variant.march) slot.batch = std::min(slot.batch, limits.batch_with_march);
    nephos::submit(gpu_, slot.commands, slot.fence, [&] { record(slot.commands, slot); });
    slot.submitted = true;
}

// Draws again what did not fit into the lists, and stores the pixels.
void BinnedView::complete(Slot& slot) {
    if (slot.picture == nullptr) return;
    Picture& picture = *std::exchange(slot.picture, nullptr);
    slot.wait(gpu_);
    while (slot.required() > slot.capacity) {
        ++overflows;
        wait();
        const std::size_t required = slot.required(), splats = balls_ + slot.billboard_count;
        if (required > limits.entries) batch_ = smaller_batch(std::min(slot.batch, splats), required, limits);
        lists_.reserve(gpu_, {.splats = splats,
                              .billboards = slot.billboard_count,
                              .tiles = 1,
                              .entries = std::min(required + required / 4, limits.entries)});
        slot.with_order = true;
        ordered_ = nullptr;
        submit(slot);
        slot.wait(gpu_);
    }
    if (slot.what.keeps) return;
    store_part(reinterpret_cast<const float*>(slot.radiance.mapped),
               slot.what.depth ? reinterpret_cast<const float*>(slot.depth.mapped) : nullptr, slot.part,
               picture);
}

BinnedView::Lists BinnedView::read_lists(const PicturePart& part) {
    wait();
    const std::size_t tiles = TileGrid{part.width, part.height}.tiles();
    shader::OrderCounts counts;
    download_staged(gpu_, lists_.counts(), std::as_writable_bytes(std::span(&counts, 1)));
    Lists lists;
    lists.balls.resize(counts.visible);
    lists.ranges.resize(tiles);
    lists.list.resize(counts.entries);
    download_staged(gpu_, lists_.balls(), std::as_writable_bytes(std::span(lists.balls)));
    download_staged(gpu_, lists_.ranges(), std::as_writable_bytes(std::span(lists.ranges)));
    download_staged(gpu_, lists_.list(tiles), std::as_writable_bytes(std::span(lists.list)));
    return lists;
}

void BinnedView::flush(Slot& slot) noexcept {
    const Picture* const picture = slot.picture;
    try {
        complete(slot);
    } catch (...) {
        failures_.push_back({picture, std::current_exception()});
    }
}

void BinnedView::flush() noexcept {
    for (const std::unique_ptr<Slot>& slot : slots_) flush(*slot);
}

void BinnedView::finish(const Picture& picture) {
    for (const std::unique_ptr<Slot>& slot : slots_)
        if (slot->picture == &picture) flush(*slot);
    const auto failed = std::ranges::find(failures_, &picture, &Failure::picture);
    if (failed == failures_.end()) return;
    const std::exception_ptr what = failed->what;
    abandon(picture);
    std::rethrow_exception(what);
}

void BinnedView::reserve(const PicturePart& part, Slot& slot) {
    const std::size_t pixels = pixels_of(part), tiles = TileGrid{part.width, part.height}.tiles();
    const std::size_t splats = balls_ + slot.billboard_count;
    const ListSizes sizes{.splats = splats,
                          .billboards = slot.billboard_count,
                          .tiles = tiles,
                          .entries = std::min(std::max<std::size_t>(4 * splats, tiles), limits.entries)};
    // What is in flight may be drawn once more if its lists were too short, into what it was given.
    if (!lists_.has_room(sizes) || depth_.bytes < sizeof(float) * pixels) {
        flush();
        lists_.reserve(gpu_, sizes);
        ordered_ = nullptr;
        depth_ = {};  // until both are there
        make_storage(gpu_, radiance_, 4 * sizeof(float) * pixels);
        make_storage(gpu_, depth_, sizeof(float) * pixels);
    }
    if (slot.what.variant.march && !slot.what.volumes->has_room(pixels)) {
        flush();
        slot.what.volumes->reserve(gpu_, pixels);
    }
    reserve_copy(gpu_, slot.radiance, 4 * sizeof(float) * pixels);
    reserve_copy(gpu_, slot.depth, sizeof(float) * pixels);
}

void BinnedView::begin_part(const ViewInputs& what, const shader::FrameUniforms& frame, const PicturePart& part,
                            Picture& picture, bool first) {
    Slot& slot = *slots_[next_];
    next_ = (next_ + 1) % slots_.size();
    flush(slot);
    slot.wait(gpu_);                                      // of a picture that was thrown away
    failures_.reserve(failures_.size() + slots_.size());  // flush() may not throw
    slot.what = what;
    slot.billboard_count = what.billboards.size();
    reserve(part, slot);
    pipelines_for(what.variant).prepare(gpu_, what.depth);
    const std::uint64_t pictures = what.pictures != nullptr ? what.pictures->serial : 0;
    if (what.variant.billboards && (billboard_textures_.width == 0 || pictures != pictures_)) {
        flush();  // what is in flight reads those that there were
        billboard_textures_ = upload_billboard_textures(gpu_, what.pictures);
        pictures_ = pictures;
    }
    slot.part = part;
    write(gpu_, slot.frame, frame);
    write(gpu_, slot.order_frame, what.order);
    if (what.shells != nullptr) write(gpu_, slot.shells, *what.shells);
    upload(gpu_, slot.billboards, std::as_bytes(what.billboards));
    upload(gpu_, slot.clouds, std::as_bytes(what.clouds));
    upload_terrain(gpu_, slot.terrain, what.terrain);
    if (what.march != nullptr) write(gpu_, slot.march, *what.march);
    slot.ground_of = nullptr;
    if (what.ground != nullptr) {
        grounds += first ? 1 : 0;
        slot.ground.use(gpu_, *what.ground, what.shows_mirror ? &mirror_.layout() : nullptr, frame);
        slot.ground_of = &grounds_.of({.sea = what.ground->water.enabled,
                                       .country = what.ground->country.enabled,
                                       .lying = what.ground->lying,
                                       .mirror = what.shows_mirror,
                                       .physical_sky = what.variant.physical_sky,
                                       .march = what.variant.march});
    }
    slot.what.shells = nullptr;  // these are there
    slot.what.march = nullptr;
    slot.what.billboards = {};
    slot.what.clouds = {};
    slot.what.terrain = {};
    slot.what.ground = nullptr;
    slot.with_order = first || ordered_ != &picture;
    submit(slot);
    slot.picture = &picture;
    ordered_ = &picture;
}

}  // namespace nephos
