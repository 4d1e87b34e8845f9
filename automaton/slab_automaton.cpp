// SPDX-License-Identifier: Apache-2.0
#include "automaton/slab_automaton.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include <sys/mman.h>
#include <tbb/parallel_for.h>
#define XXH_STATIC_LINKING_ONLY  // XXH3_state_s, which is handed from process to process
#include <xxhash.h>

#include "automaton/advection.h"
#include "automaton/air_parcels.h"
#include "automaton/block_field.h"
#include "automaton/kernels.h"
#include "core/error.h"

namespace nephos {
namespace {

constexpr std::size_t kPadding_bytes =
    4096;  // before and after: kernels load vectors that begin just outside
constexpr int kHaloBelow = 2, kHaloAbove = 1;

int blocks(int cells) { return (cells + kBlockEdge - 1) / kBlockEdge; }

// Addresses for a plane of the whole lattice, of which only pages that are written take memory: own levels and halos stand
// at the place where the kernels look for them, whatever the boundaries.
class WholePlane {
  public:
    explicit WholePlane(std::size_t words) : bytes_(words * sizeof(std::uint64_t) + 2 * kPadding_bytes) {
        void* memory = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        if (memory == MAP_FAILED) throw std::bad_alloc();
        memory_ = static_cast<std::byte*>(memory);
    }
    ~WholePlane() { ::munmap(memory_, bytes_); }
    WholePlane(const WholePlane&) = delete;
    WholePlane& operator=(const WholePlane&) = delete;

    std::uint64_t* words() {
        return static_cast<std::uint64_t*>(static_cast<void*>(memory_ + kPadding_bytes));
    }
    const std::uint64_t* words() const {
        return static_cast<const std::uint64_t*>(static_cast<const void*>(memory_ + kPadding_bytes));
    }

  private:
    std::size_t bytes_;
    std::byte* memory_ = nullptr;
};

// Returns where word 0 of the whole plane would be, had the levels of `own` all those below them. An address only: what lies
// below `own` is never read or written, as kernels write their own part alone.
std::uint64_t* as_whole(BitPlane& own, std::size_t words_below) {
    const auto address = std::uintptr_t(own.words().data()) - words_below * sizeof(std::uint64_t);
    return reinterpret_cast<std::uint64_t*>(address);
}

}  // namespace

struct SlabAutomaton::Impl {
    Impl(const AutomatonOptions& o, int first_level, int end_level)
        : options(o),
          first(first_level),
          end(end_level),
          own{o.extent.x, o.extent.y, end_level - first_level},
          hum(own),
          act_next(own),
          cld(own),
          level_words(hum.words_per_row() * std::size_t(o.extent.y)),
          act(level_words * std::size_t(o.extent.z)),
          parcels(o),
          background(o) {
        zero_row.assign(hum.words_per_row() + 16, 0);
        fraction.resize(std::size_t(own.z));
    }

    // Valid until the next call.
    BlockField field_now() {
        background.set_time(options, time_s());
        return BlockField(options, parcels.active(options, time_s()), background);
    }
    double time_s() const { return double(steps) * options.time_step_s; }
    std::uint64_t* act_of(int level) { return act.words() + std::size_t(level) * level_words; }

    template <class Work>
    void for_rows_of_blocks(const Work& work) {
        const int rows = blocks(options.extent.y);
        tbb::parallel_for(0, blocks(own.z) * rows,
                          [&](int task) { work(first / kBlockEdge + task / rows, task % rows); });
    }
    StepPlanes planes() {
        const std::size_t below = std::size_t(first) * level_words;
        return {.extent = options.extent,
                .words_per_row = hum.words_per_row(),
                .boundaries = options.boundaries,
                .act = act.words(),
                .act_next = as_whole(act_next, below),
                .hum = as_whole(hum, below),
                .cld = as_whole(cld, below),
                .zero_row = zero_row.data() + 8};
    }
    void draw_initial_state();
    void grow_and_draw();
    void advect() { nephos::advect(options, first, time_s(), fraction, {&hum, &act_next, &cld}); }
    // The own levels of act go where the next step reads them.
    void publish() { std::ranges::copy(act_next.words(), act_of(first)); }

    AutomatonOptions options;
    int first, end;
    Extent own;
    BitPlane hum, act_next, cld;  // own levels
    std::size_t level_words;
    WholePlane act;
    AirParcels parcels;
    Background background;
    PoissonLadder ladder;
    std::vector<std::uint64_t> zero_row;
    std::vector<Displacement> fraction;
    std::uint64_t steps = 0;
};

void SlabAutomaton::Impl::draw_initial_state() {
    const BlockField field = field_now();
    if (!field.anything()) return;
    const StepRandom random{options.seed, Domain::initial_state, 0, &field, &ladder};
    const StepPlanes p = planes();
    for_rows_of_blocks([&](int bz, int by) { bear_part(p, random, bz, by, by + 1); });
    publish();
}

void SlabAutomaton::Impl::grow_and_draw() {
    const BlockField field = field_now();
    const StepRandom random{options.seed, Domain::lattice, std::uint32_t(steps), &field, &ladder};
    const StepPlanes p = planes();
    for_rows_of_blocks([&](int bz, int by) { step_part(p, random, bz, by, by + 1); });
}

SlabAutomaton::SlabAutomaton(const AutomatonOptions& options, int first, int end) {
    check(options);
    if (!is_profile(options.wind.fields))
        throw Error(ErrorCode::usage,
                    "the wind differs within a level or has a vertical part: expected a horizontal one that "
                    "is the same all over a level");
    if (first < 0 || end > options.extent.z || first >= end || first % kBlockEdge != 0 ||
        (end % kBlockEdge != 0 && end != options.extent.z))
        throw Error(ErrorCode::usage, "a slab of levels " + std::to_string(first) + " to " +
                                          std::to_string(end) + " of " + std::to_string(options.extent.z) +
                                          ": must begin and end at multiples of 8, or at the top");
    impl_ = std::make_unique<Impl>(options, first, end);
    if (options.initial == InitialState::field) impl_->draw_initial_state();
}

SlabAutomaton::~SlabAutomaton() = default;
SlabAutomaton::SlabAutomaton(SlabAutomaton&&) noexcept = default;
SlabAutomaton& SlabAutomaton::operator=(SlabAutomaton&&) noexcept = default;

const AutomatonOptions& SlabAutomaton::options() const { return impl_->options; }
int SlabAutomaton::first() const { return impl_->first; }
int SlabAutomaton::end() const { return impl_->end; }
std::uint64_t SlabAutomaton::steps() const { return impl_->steps; }

std::vector<int> SlabAutomaton::halo_levels() const {
    const int nz = impl_->options.extent.z;
    std::vector<int> levels;
    for (int level = impl_->first - kHaloBelow; level < impl_->end + kHaloAbove; ++level) {
        if ((level < 0 || level >= nz) && impl_->options.boundaries.z == Boundary::open) continue;
        const int wrapped = (level % nz + nz) % nz;
        const bool is_own = wrapped >= impl_->first && wrapped < impl_->end;
        if (!is_own && std::ranges::count(levels, wrapped) == 0) levels.push_back(wrapped);
    }
    return levels;
}

void SlabAutomaton::set_halo(int level, std::span<const std::uint64_t> words) {
    const std::vector<int> levels = halo_levels();
    if (std::ranges::count(levels, level) == 0 || words.size() != impl_->level_words)
        throw Error(ErrorCode::usage, "level " + std::to_string(level) + " with " +
                                          std::to_string(words.size()) + " words is no halo of this slab");
    std::ranges::copy(words, impl_->act_of(level));
}

std::span<const std::uint64_t> SlabAutomaton::act_level(int level) const {
    return {impl_->act.words() + std::size_t(level) * impl_->level_words, impl_->level_words};
}

void SlabAutomaton::step() {
    if (impl_->steps >= 0xFFFFFFFFu) throw Error(ErrorCode::usage, "a simulation has at most 2^32 - 1 steps");
    impl_->grow_and_draw();
    impl_->advect();
    impl_->publish();
    impl_->parcels.advance(impl_->options, impl_->steps);
    ++impl_->steps;
}

BitPlaneView SlabAutomaton::hum() const { return impl_->hum.view(); }
BitPlaneView SlabAutomaton::act() const {
    return {impl_->own, impl_->hum.words_per_row(), act_level(impl_->first).data()};
}
BitPlaneView SlabAutomaton::cld() const { return impl_->cld.view(); }

std::size_t SlabAutomaton::memory_bytes(const AutomatonOptions& options, int levels) {
    const std::size_t level = std::size_t((options.extent.x + 63) / 64) * std::size_t(options.extent.y) * 8;
    return 4 * level * std::size_t(levels) + (kHaloBelow + kHaloAbove + 1) * level;
}

struct SlabHash::State {
    XXH3_state_t* xxh = XXH3_createState();
    State() {
        if (xxh == nullptr) throw std::bad_alloc();
        XXH3_128bits_reset(xxh);
    }
    ~State() { XXH3_freeState(xxh); }
    State(const State&) = delete;
    State& operator=(const State&) = delete;
};

SlabHash::SlabHash(const Extent& whole) : state_(std::make_unique<State>()) {
    const std::array<std::uint32_t, 3> extent{std::uint32_t(whole.x), std::uint32_t(whole.y),
                                              std::uint32_t(whole.z)};
    XXH3_128bits_update(state_->xxh, extent.data(), sizeof extent);
}

SlabHash::SlabHash(std::span<const std::byte> bytes) : state_(std::make_unique<State>()) {
    if (bytes.size() != sizeof(XXH3_state_t))
        throw Error(ErrorCode::usage, "these bytes are no hash that goes on");
    // The only pointer in it is that of the constant secret, which lies elsewhere in each process.
    const unsigned char* secret = state_->xxh->extSecret;
    std::memcpy(state_->xxh, bytes.data(), bytes.size());
    state_->xxh->extSecret = secret;
}

SlabHash::~SlabHash() = default;

void SlabHash::add(const BitPlaneView& levels) {
    XXH3_128bits_update(state_->xxh, levels.words, levels.word_count() * sizeof(std::uint64_t));
}

std::vector<std::byte> SlabHash::bytes() const {
    std::vector<std::byte> bytes(sizeof(XXH3_state_t));
    std::memcpy(bytes.data(), state_->xxh, bytes.size());
    return bytes;
}

StateHash SlabHash::hash() const {
    const XXH128_hash_t hash = XXH3_128bits_digest(state_->xxh);
    return {hash.high64, hash.low64};
}

}  // namespace nephos
