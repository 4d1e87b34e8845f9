// SPDX-License-Identifier: Apache-2.0
#include "automaton/automaton.h"

#include <algorithm>
#include <memory>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <xxhash.h>

#include "automaton/advection.h"
#include "automaton/air_parcels.h"
#include "automaton/block_field.h"
#include "automaton/kernels.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/random.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr std::uint32_t kSaveVersion = 1;
constexpr std::int64_t kFractionMask = 0xFFFFFFFF;

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
    Impl(const AutomatonOptions& o, Lattice initial) : options(o), lattice(std::move(initial)), parcels(o) {
        check_extents(options, lattice);
        act_next = BitPlane(options.extent);
        zero_row.assign(lattice.hum.words_per_row() + 16, 0);
        fraction.resize(std::size_t(options.extent.z));
    }

    BlockField field_now() const {
        std::vector<ActiveEllipsoid> active = parcels.active(options, time_s());
        active.insert(active.end(), external.begin(), external.end());
        return BlockField(options, active);
    }
    double time_s() const { return double(steps) * options.time_step_s; }

    void draw_initial_state();
    void grow_and_draw();
    void advect();

    AutomatonOptions options;
    Lattice lattice;
    BitPlane act_next;
    AirParcels parcels;
    PoissonLadder ladder;
    std::vector<std::uint64_t> zero_row;
    std::vector<Displacement> fraction;  // of a cell that each layer has moved beyond whole cells, 0..1
    std::vector<ActiveEllipsoid> external;
    std::uint64_t steps = 0;
};

// Draws one step of births on the empty lattice, from its own domain of randomness. Cell by cell, because it
// happens once and each cell has a counter of its own.
void Automaton::Impl::draw_initial_state() {
    const BlockField field = field_now();
    const Extent& extent = options.extent;
    tbb::parallel_for(0, blocks(extent.z), [&](int bz) {
        std::vector<const FieldEllipsoid*> row;
        BlockPlan plan;
        for (int by = 0; by < blocks(extent.y); ++by) {
            field.collect(by, bz, row);
            for (int bx = 0; bx < blocks(extent.x); ++bx) {
                field.plan_blocks(bx, by, bz, row, std::span(&plan, 1));
                if (plan.draws[kHum].kind == DrawPlan::Kind::none &&
                    plan.draws[kAct].kind == DrawPlan::Kind::none) {
                    continue;
                }
                for (int cell = 0; cell < kBlockCells; ++cell) {
                    const int dx = cell % 8, dy = cell / 8 % 8, dz = cell / 64;
                    const int i = bx * kBlockEdge + dx, j = by * kBlockEdge + dy, k = bz * kBlockEdge + dz;
                    if (i >= extent.x || j >= extent.y || k >= extent.z) continue;
                    const auto words =
                        philox(options.seed, block_counter(Domain::initial_state, Draw::counts, 0, bx, by, bz,
                                                           std::uint32_t(cell)));
                    const auto happens = [&](int draw) {
                        const auto t = probability_threshold(probability_at(field, plan, draw, dx, dy, dz));
                        return t == kCertain || words[std::size_t(draw)] < t;
                    };
                    if (happens(kHum)) lattice.hum.set(i, j, k, true);
                    if (happens(kAct)) lattice.act.set(i, j, k, true);
                }
            }
        }
    });
}

void Automaton::Impl::grow_and_draw() {
    const BlockField field = field_now();
    const StepPlanes planes{.extent = options.extent,
                            .words_per_row = lattice.hum.words_per_row(),
                            .boundaries = options.boundaries,
                            .act = lattice.act.words().data(),
                            .act_next = act_next.words().data(),
                            .hum = lattice.hum.words().data(),
                            .cld = lattice.cld.words().data(),
                            .zero_row = zero_row.data() + 8};
    const StepRandom random{options.seed, std::uint32_t(steps), &field, &ladder};
    const int rows = rows_per_task(lattice.hum), all_rows = blocks(options.extent.y);
    const int parts = (all_rows + rows - 1) / rows;
    tbb::parallel_for(0, blocks(options.extent.z) * parts, [&](int task) {
        const int begin = task % parts * rows;
        step_part(planes, random, task / parts, begin, std::min(begin + rows, all_rows));
    });
    std::swap(lattice.act, act_next);
}

void Automaton::Impl::advect() {
    if (options.wind.keyframes.empty()) return;
    tbb::parallel_for(
        tbb::blocked_range<int>(0, options.extent.z), [&](const tbb::blocked_range<int>& layers) {
            std::vector<std::uint64_t> scratch;
            for (int k = layers.begin(); k != layers.end(); ++k) {
                const double height =
                    options.placement.origin_m.z + (k + 0.5) * options.placement.cell_size_m;
                Displacement moved = displacement_of_step(wind_at(options.wind, height, time_s()),
                                                          options.time_step_s, options.placement.cell_size_m);
                Displacement& rest = fraction[std::size_t(k)];
                moved.x += rest.x;
                moved.y += rest.y;
                rest = {moved.x & kFractionMask, moved.y & kFractionMask};
                if (moved.whole_x() == 0 && moved.whole_y() == 0) continue;
                for (BitPlane* plane : {&lattice.hum, &lattice.act, &lattice.cld}) {
                    shift_layer(*plane, k, moved.whole_x(), moved.whole_y(), options.boundaries, scratch);
                }
            }
        });
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
    impl_->parcels.advance(impl_->options, impl_->time_s());
    ++impl_->steps;
}

const AutomatonOptions& Automaton::options() const { return impl_->options; }
std::uint64_t Automaton::steps() const { return impl_->steps; }
double Automaton::time_s() const { return impl_->time_s(); }
BitPlaneView Automaton::hum() const { return impl_->lattice.hum.view(); }
BitPlaneView Automaton::act() const { return impl_->lattice.act.view(); }
BitPlaneView Automaton::cld() const { return impl_->lattice.cld.view(); }

StateHash Automaton::hash() const {
    const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
    if (!state) throw std::bad_alloc();
    XXH3_128bits_reset(state.get());
    const Extent& e = impl_->options.extent;
    const std::array<std::uint32_t, 3> extent{std::uint32_t(e.x), std::uint32_t(e.y), std::uint32_t(e.z)};
    XXH3_128bits_update(state.get(), extent.data(), sizeof extent);
    for (const BitPlane* plane : {&impl_->lattice.hum, &impl_->lattice.act, &impl_->lattice.cld}) {
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
    impl_->parcels.save(out);
    for (const BitPlane* plane : {&impl_->lattice.hum, &impl_->lattice.act, &impl_->lattice.cld}) {
        out.put_bytes(std::as_bytes(plane->words()));
    }
    return out.take();
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
    parcels.restore(in);
    if (in.rest().size() != 3 * impl_->lattice.hum.words().size_bytes()) {
        throw Error(ErrorCode::io, "saved state has another size than the scene's");
    }
    for (BitPlane* plane : {&impl_->lattice.hum, &impl_->lattice.act, &impl_->lattice.cld}) {
        in.get_bytes(std::as_writable_bytes(plane->words()));
    }
    impl_->steps = steps;
    impl_->fraction = std::move(fraction);
    impl_->parcels = std::move(parcels);
}

std::size_t Automaton::memory_bytes(const AutomatonOptions& options) {
    const std::size_t layer = std::size_t((options.extent.x + 63) / 64) * std::size_t(options.extent.y) * 8;
    return 4 * BitPlane::bytes(options.extent) + layer +
           std::size_t(ellipsoid_count(options)) *
               (sizeof(AirParcel) + sizeof(ActiveEllipsoid) + sizeof(FieldEllipsoid));
}

}  // namespace nephos
