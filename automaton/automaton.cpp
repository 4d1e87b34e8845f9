// SPDX-License-Identifier: Apache-2.0
#include "automaton/automaton.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include <tbb/parallel_for.h>
#include <xxhash.h>

#include "automaton/advection.h"
#include "automaton/air_parcels.h"
#include "automaton/block_field.h"
#include "automaton/cell_motion.h"
#include "automaton/kernels.h"
#include "automaton/plane_bytes.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/random.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr std::uint32_t kSaveVersion = 1;

int blocks(int cells) { return (cells + kBlockEdge - 1) / kBlockEdge; }

// Rows of blocks per task: about 4 KiB of each layer, so that a task's planes stay in the second-level cache.
int rows_per_task(const BitPlane& plane) {
    return int(std::clamp<std::size_t>(4096 / (plane.words_per_row() * 8 * kBlockEdge), 1, 8));
}

void check_extents(const AutomatonOptions& options, const Lattice& lattice) {
    for (const BitPlane* plane : {&lattice.hum, &lattice.act, &lattice.cld}) {
        if (plane->extent() == options.extent) continue;
        const Extent& e = plane->extent();
        throw Error(ErrorCode::usage,
                    "the initial state has " + std::to_string(e.x) + " x " + std::to_string(e.y) + " x " +
                        std::to_string(e.z) + " cells, the scene " + std::to_string(options.extent.x) +
                        " x " + std::to_string(options.extent.y) + " x " + std::to_string(options.extent.z));
    }
}

Lattice empty_lattice(Extent extent) { return {BitPlane(extent), BitPlane(extent), BitPlane(extent)}; }

}  // namespace

std::string StateHash::hex() const {
    std::string text;
    for (std::uint64_t part : {high, low}) {
        for (int shift = 60; shift >= 0; shift -= 4) text += "0123456789abcdef"[(part >> shift) & 15];
    }
    return text;
}

struct Automaton::Impl {
    Impl(const AutomatonOptions& o, Lattice initial) : options(o), lattice(std::move(initial)), parcels(o), background(o) {
        check_extents(options, lattice);
        act_next = BitPlane(options.extent);
        zero_row.assign(lattice.hum.words_per_row() + 16, 0);
        fraction.resize(std::size_t(options.extent.z));
        if (!is_profile(options.wind.fields)) motion.emplace(options.extent);
    }

    // Valid until the next call.
    BlockField field_now() {
        background.set_time(options, time_s());
        std::vector<ActiveEllipsoid> active = parcels.active(options, time_s());
        active.insert(active.end(), external.begin(), external.end());
        return BlockField(options, active, background);
    }
    double time_s() const { return double(steps) * options.time_step_s; }

    StepPlanes planes_of(BitPlane& act_out);
    template <class Work>
    void for_parts(const Work& work);
    void draw_initial_state();
    void grow_and_draw();
    void advect() {
        if (motion && !is_calm(options.wind)) return motion->step(lattice, options, time_s());
        nephos::advect(options, 0, time_s(), fraction, {&lattice.hum, &lattice.act, &lattice.cld});
    }

    AutomatonOptions options;
    Lattice lattice;
    BitPlane act_next;
    AirParcels parcels;
    Background background;
    PoissonLadder ladder;
    std::vector<std::uint64_t> zero_row;
    std::vector<Displacement> fraction;  // of a cell that each layer has moved beyond whole cells, 0..1
    std::optional<CellMotion> motion;    // instead of shifts of whole layers, where the wind differs within them
    std::vector<ActiveEllipsoid> external;
    std::uint64_t steps = 0;
};

StepPlanes Automaton::Impl::planes_of(BitPlane& act_out) {
    return {.extent = options.extent,
            .words_per_row = lattice.hum.words_per_row(),
            .boundaries = options.boundaries,
            .act = lattice.act.words().data(),
            .act_next = act_out.words().data(),
            .hum = lattice.hum.words().data(),
            .cld = lattice.cld.words().data(),
            .zero_row = zero_row.data() + 8};
}

// Calls `work` with each slab of blocks and a range of its rows, in parallel.
template <class Work>
void Automaton::Impl::for_parts(const Work& work) {
    const int rows = rows_per_task(lattice.hum), all_rows = blocks(options.extent.y);
    const int parts = (all_rows + rows - 1) / rows;
    tbb::parallel_for(0, blocks(options.extent.z) * parts, [&](int task) {
        const int begin = task % parts * rows;
        work(task / parts, begin, std::min(begin + rows, all_rows));
    });
}

void Automaton::Impl::draw_initial_state() {
    const BlockField field = field_now();
    if (!field.anything()) return;
    const StepPlanes planes = planes_of(lattice.act);
    const StepRandom random{options.seed, Domain::initial_state, 0, &field, &ladder};
    for_parts([&](int bz, int begin, int end) { bear_part(planes, random, bz, begin, end); });
}

void Automaton::Impl::grow_and_draw() {
    const BlockField field = field_now();
    const StepPlanes planes = planes_of(act_next);
    const StepRandom random{options.seed, Domain::lattice, std::uint32_t(steps), &field, &ladder};
    for_parts([&](int bz, int begin, int end) { step_part(planes, random, bz, begin, end); });
    std::swap(lattice.act, act_next);
}

Automaton::Automaton(const AutomatonOptions& options, std::vector<ActiveEllipsoid> external) {
    check(options);
    impl_ = std::make_unique<Impl>(options, empty_lattice(options.extent));
    set_external_ellipsoids(std::move(external));
    if (options.initial == InitialState::field) impl_->draw_initial_state();
}

Automaton::Automaton(const AutomatonOptions& options, Lattice initial) {
    check(options);
    impl_ = std::make_unique<Impl>(options, std::move(initial));
}

Automaton::~Automaton() = default;
Automaton::Automaton(Automaton&&) noexcept = default;
Automaton& Automaton::operator=(Automaton&&) noexcept = default;

void Automaton::step() {
    if (impl_->steps >= 0xFFFFFFFFu) throw Error(ErrorCode::usage, "a simulation has at most 2^32 - 1 steps");
    impl_->grow_and_draw();
    impl_->advect();
    impl_->parcels.advance(impl_->options, impl_->steps);
    ++impl_->steps;
}

const AutomatonOptions& Automaton::options() const { return impl_->options; }
std::uint64_t Automaton::steps() const { return impl_->steps; }
double Automaton::time_s() const { return impl_->time_s(); }
BitPlaneView Automaton::hum() const { return impl_->lattice.hum.view(); }
BitPlaneView Automaton::act() const { return impl_->lattice.act.view(); }
BitPlaneView Automaton::cld() const { return impl_->lattice.cld.view(); }

std::uint64_t Automaton::crowded_out() const { return impl_->motion ? impl_->motion->crowded_out() : 0; }
Displacement Automaton::displacement_of_layer(int k, std::uint64_t step) const {
    return nephos::displacement_of_layer(impl_->options, k, double(step) * impl_->options.time_step_s);
}

std::span<const Displacement> Automaton::beyond_whole_cells() const { return impl_->fraction; }

StateHash Automaton::hash() const { return hash_of(impl_->lattice); }

StateHash hash_of(const Lattice& lattice) {
    const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
    if (!state) throw std::bad_alloc();
    XXH3_128bits_reset(state.get());
    const Extent& e = lattice.hum.extent();
    const std::array<std::uint32_t, 3> extent{std::uint32_t(e.x), std::uint32_t(e.y), std::uint32_t(e.z)};
    XXH3_128bits_update(state.get(), extent.data(), sizeof extent);
    for (const BitPlane* plane : {&lattice.hum, &lattice.act, &lattice.cld}) {
        XXH3_128bits_update(state.get(), plane->words().data(), plane->words().size_bytes());
    }
    const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
    return {hash.high64, hash.low64};
}

std::vector<ActiveEllipsoid> Automaton::ellipsoids() const {
    return impl_->parcels.active(impl_->options, impl_->time_s());
}

void Automaton::set_external_ellipsoids(std::vector<ActiveEllipsoid> ellipsoids) {
    for (const ActiveEllipsoid& e : ellipsoids) {
        nephos::check(e.ellipsoid, impl_->options, "external ellipsoid");
        if (!(e.weight >= 0 && e.weight <= 1)) {
            throw Error(ErrorCode::usage,
                        "weight " + number_text(e.weight, 6) + " of an external ellipsoid: expected 0..1");
        }
    }
    impl_->external = std::move(ellipsoids);
}

std::vector<std::byte> Automaton::save() const {
    ByteWriter out;
    out.put(kSaveVersion);
    out.put(impl_->options.extent);
    out.put(impl_->steps);
    for (const Displacement& d : impl_->fraction) out.put(d);
    impl_->parcels.save(out, impl_->options);
    if (impl_->motion) impl_->motion->save(out);
    // The planes at their exact size: a growing buffer would hold them several times.
    std::vector<std::byte> bytes = out.take();
    const std::array planes{&impl_->lattice.hum, &impl_->lattice.act, &impl_->lattice.cld};
    bytes.reserve(bytes.size() + planes.size() * impl_->lattice.hum.words().size_bytes());
    for (const BitPlane* plane : planes) {
        const std::span<const std::byte> words = std::as_bytes(plane->words());
        bytes.insert(bytes.end(), words.begin(), words.end());
    }
    return bytes;
}

void Automaton::restore(std::span<const std::byte> bytes) {
    ByteReader in(bytes);
    if (in.get<std::uint32_t>() != kSaveVersion) {
        throw Error(ErrorCode::io, "saved state was written by another version of nephos");
    }
    if (in.get<Extent>() != impl_->options.extent) {
        throw Error(ErrorCode::io, "saved state has another extent than the scene");
    }
    // Into fresh values first: bytes that end early must leave this simulation as it is.
    const auto steps = in.get<std::uint64_t>();
    std::vector<Displacement> fraction(impl_->fraction.size());
    for (Displacement& d : fraction) d = in.get<Displacement>();
    AirParcels parcels = impl_->parcels;
    parcels.restore(in, impl_->options);
    std::optional<CellMotion> motion = impl_->motion;
    if (motion) motion->restore(in);
    if (in.rest().size() != 3 * impl_->lattice.hum.words().size_bytes()) {
        throw Error(ErrorCode::io, "saved state has another size than the scene's");
    }
    require_clear_padding(in.rest(), impl_->options.extent);
    for (BitPlane* plane : {&impl_->lattice.hum, &impl_->lattice.act, &impl_->lattice.cld}) {
        in.get_bytes(std::as_writable_bytes(plane->words()));
    }
    impl_->steps = steps;
    impl_->fraction = std::move(fraction);
    impl_->parcels = std::move(parcels);
    impl_->motion = std::move(motion);
}

std::size_t Automaton::memory_bytes(const AutomatonOptions& options) {
    const std::size_t layer = std::size_t((options.extent.x + 63) / 64) * std::size_t(options.extent.y) * 8;
    const std::size_t motion =
        is_profile(options.wind.fields) ? 0 : CellMotion::memory_bytes(options.extent);
    return 4 * BitPlane::bytes(options.extent) + layer + motion + Background::memory_bytes(options) +
           std::size_t(ellipsoid_count(options)) *
               (sizeof(AirParcel) + sizeof(ActiveEllipsoid) + sizeof(FieldEllipsoid));
}

}  // namespace nephos
