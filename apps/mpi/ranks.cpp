// SPDX-License-Identifier: Apache-2.0
#include "apps/mpi/ranks.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <string>

#include <mpi.h>

#include "core/error.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

constexpr int kBlock = 8;
constexpr int kHashTag = 1'000'000, kShadowTag = 1'000'001;  // those of levels are below

int rank_of_world() {
    int rank = 0;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    return rank;
}

int size_of_world() {
    int size = 1;
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    return size;
}

// Returns how many processes share the memory of this one's machine.
int size_of_machine() {
    MPI_Comm machine = MPI_COMM_NULL;
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
    int size = 1;
    MPI_Comm_size(machine, &size);
    MPI_Comm_free(&machine);
    return size;
}

// The slab of a rank: blocks of 8 levels, as even as they go.
int end_of(int rank, int ranks, int levels) {
    const int blocks = (levels + kBlock - 1) / kBlock;
    return std::min(levels, (rank + 1) * blocks / ranks * kBlock);
}

std::uint64_t sum_over_ranks(std::uint64_t value) {
    std::uint64_t sum = 0;
    MPI_Reduce(&value, &sum, 1, MPI_UINT64_T, MPI_SUM, 0, MPI_COMM_WORLD);
    return sum;
}

// MPI counts in int; a level of 65536 x 65536 cells has 67 million words.
int count_of(std::size_t words) { return int(words); }

}  // namespace

SlabAutomaton Ranks::make_slab(const AutomatonOptions& options) {
    const int ranks = size_of_world(), blocks = (options.extent.z + kBlock - 1) / kBlock;
    if (ranks > blocks)
        throw Error(ErrorCode::usage,
                    std::to_string(ranks) + " processes for " + std::to_string(options.extent.z) +
                        " levels: a process has at least " + std::to_string(kBlock) +
                        " of them, so at most " + std::to_string(blocks) + " processes can help");
    const int rank = rank_of_world(), machine = size_of_machine();
    const int begin = end_of(rank - 1, ranks, options.extent.z), end = end_of(rank, ranks, options.extent.z);
    const std::size_t bytes = SlabAutomaton::memory_bytes(options, end - begin);
    constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
    require_memory(bytes > kAll / std::size_t(machine) ? kAll : bytes * std::size_t(machine),
                   std::to_string(machine) + " processes of this machine with " +
                       std::to_string(end - begin) + " levels each");
    return SlabAutomaton(options, begin, end);
}

Ranks::Ranks(const AutomatonOptions& options)
    : rank_(rank_of_world()), ranks_(size_of_world()), slab_(make_slab(options)) {
    for (int rank = 0; rank < ranks_; ++rank) ends_.push_back(end_of(rank, ranks_, options.extent.z));
    // Which levels a slab needs, everybody knows: at most three each.
    constexpr std::size_t kMost = 3;
    std::vector<int> mine = slab_.halo_levels();
    mine.resize(kMost, -1);
    std::vector<int> all(kMost * std::size_t(ranks_));
    MPI_Allgather(mine.data(), int(kMost), MPI_INT, all.data(), int(kMost), MPI_INT, MPI_COMM_WORLD);
    for (int rank = 0; rank < ranks_; ++rank) {
        std::vector<int>& levels = all_halos_.emplace_back();
        for (std::size_t n = 0; n < kMost; ++n)
            if (const int level = all[std::size_t(rank) * kMost + n]; level >= 0) levels.push_back(level);
    }
}

int Ranks::owner_of(int level) const { return int(std::ranges::upper_bound(ends_, level) - ends_.begin()); }

void Ranks::exchange() {
    std::vector<MPI_Request> requests;
    for (int rank = 0; rank < ranks_; ++rank)
        for (const int level : all_halos_[std::size_t(rank)]) {
            if (owner_of(level) != rank_) continue;
            const std::span<const std::uint64_t> words = slab_.act_level(level);
            MPI_Isend(words.data(), count_of(words.size()), MPI_UINT64_T, rank, level, MPI_COMM_WORLD,
                      &requests.emplace_back());
        }
    std::vector<std::uint64_t> words(slab_.act_level(slab_.first()).size());
    for (const int level : slab_.halo_levels()) {
        MPI_Recv(words.data(), count_of(words.size()), MPI_UINT64_T, owner_of(level), level, MPI_COMM_WORLD,
                 MPI_STATUS_IGNORE);
        slab_.set_halo(level, words);
    }
    MPI_Waitall(int(requests.size()), requests.data(), MPI_STATUSES_IGNORE);
}

void Ranks::step() {
    exchange();
    slab_.step();
}

StateHash Ranks::hash() const {
    const BitPlaneView planes[] = {slab_.hum(), slab_.act(), slab_.cld()};
    std::vector<std::byte> bytes = SlabHash(slab_.options().extent).bytes();
    const int size = int(bytes.size());
    for (std::size_t plane = 0; plane < std::size(planes); ++plane) {
        // From rank to rank; from the last one back to the first for the next plane.
        if (ranks_ > 1 && (plane > 0 || rank_ > 0))
            MPI_Recv(bytes.data(), size, MPI_BYTE, (rank_ + ranks_ - 1) % ranks_, kHashTag, MPI_COMM_WORLD,
                     MPI_STATUS_IGNORE);
        SlabHash hash(bytes);
        hash.add(planes[plane]);
        bytes = hash.bytes();
        if (ranks_ > 1)
            MPI_Send(bytes.data(), size, MPI_BYTE, (rank_ + 1) % ranks_, kHashTag, MPI_COMM_WORLD);
    }
    if (ranks_ > 1 && rank_ == 0)
        MPI_Recv(bytes.data(), size, MPI_BYTE, ranks_ - 1, kHashTag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    return rank_ == 0 ? SlabHash(bytes).hash() : StateHash{};
}

// The counts of the whole on rank 0. Columns that slabs below and above have covered go from rank to rank, upwards for bases,
// downwards for tops.
CloudCounts Ranks::counts() const {
    const BitPlaneView cld = slab_.cld();
    const Extent whole = slab_.options().extent, own = cld.extent;
    const std::size_t level_words = cld.words_per_row * std::size_t(own.y);
    CloudCounts mine;
    const std::size_t levels = std::size_t(whole.z);
    mine.level_cells.assign(levels, 0);
    mine.bases.assign(levels, 0);
    mine.tops.assign(levels, 0);
    BitPlane shadow({own.x, own.y, 1});
    const auto pass = [&](bool upwards, std::vector<std::uint64_t>& found) {
        std::vector<std::uint64_t> seen(level_words);
        const int before = upwards ? rank_ - 1 : rank_ + 1, after = upwards ? rank_ + 1 : rank_ - 1;
        if (before >= 0 && before < ranks_)
            MPI_Recv(seen.data(), count_of(level_words), MPI_UINT64_T, before, kShadowTag, MPI_COMM_WORLD,
                     MPI_STATUS_IGNORE);
        for (int n = 0; n < own.z; ++n) {
            const int k = upwards ? n : own.z - 1 - n;
            const std::uint64_t* words = cld.words + std::size_t(k) * level_words;
            std::uint64_t cells = 0, fresh = 0;
            for (std::size_t w = 0; w < level_words; ++w) {
                cells += std::uint64_t(std::popcount(words[w]));
                fresh += std::uint64_t(std::popcount(words[w] & ~seen[w]));
                seen[w] |= words[w];
            }
            mine.level_cells[std::size_t(slab_.first() + k)] = cells;
            found[std::size_t(slab_.first() + k)] = fresh;
        }
        if (after >= 0 && after < ranks_)
            MPI_Send(seen.data(), count_of(level_words), MPI_UINT64_T, after, kShadowTag, MPI_COMM_WORLD);
        std::ranges::copy(seen, shadow.words().begin());
    };
    pass(true, mine.bases);
    pass(false, mine.tops);
    CloudCounts all = mine;
    for (auto [from, to] : {std::pair(&mine.level_cells, &all.level_cells),
                            std::pair(&mine.bases, &all.bases), std::pair(&mine.tops, &all.tops)})
        MPI_Reduce(from->data(), to->data(), whole.z, MPI_UINT64_T, MPI_SUM, 0, MPI_COMM_WORLD);
    // On rank 0, the last of the way down, the shadow is that of all levels.
    const CloudCounts of_shadow = count_cloud(shadow.view(), slab_.options().boundaries);
    all.extent = whole;
    all.columns = of_shadow.columns;
    all.edges = of_shadow.edges;
    for (const std::uint64_t cells : all.level_cells) all.cells += cells;
    return all;
}

CloudStatistics Ranks::statistics() const {
    CloudStatistics statistics = cloud_statistics(counts(), slab_.options().placement);
    statistics.hum = sum_over_ranks(count_cells(slab_.hum()));
    statistics.act = sum_over_ranks(count_cells(slab_.act()));
    statistics.cld = sum_over_ranks(count_cells(slab_.cld()));
    return statistics;
}

}  // namespace nephos
