// SPDX-License-Identifier: Apache-2.0
#include "core/keyed_order.h"

#include <algorithm>
#include <array>
#include <utility>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr unsigned kDigitBits = 11;
constexpr std::size_t kDigits = std::size_t{1} << kDigitBits;

// Entries of one digit after the other; each part of `from` has its own places in `to`.
void sort_by_digit(const std::vector<std::uint64_t>& from, std::vector<std::uint64_t>& to, int shift,
                   std::vector<std::array<std::uint32_t, kDigits>>& places) {
    const std::size_t parts = places.size();
    const auto each_entry = [&](std::size_t part, const auto& work) {
        const std::size_t begin = from.size() * part / parts, end = from.size() * (part + 1) / parts;
        for (std::size_t i = begin; i < end; ++i)
            work(from[i], places[part][from[i] >> shift & (kDigits - 1)]);
    };
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
        places[part] = {};
        each_entry(part, [](std::uint64_t, std::uint32_t& count) { ++count; });
    });
    std::uint32_t sum = 0;
    for (std::size_t digit = 0; digit < kDigits; ++digit)
        for (std::size_t part = 0; part < parts; ++part) sum += std::exchange(places[part][digit], sum);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
        each_entry(part, [&](std::uint64_t entry, std::uint32_t& place) { to[place++] = entry; });
    });
}

}  // namespace

void KeyedOrder::add_all(std::uint32_t first, std::size_t count,
                         const std::function<bool(std::uint32_t index, float& key)>& work) {
    constexpr std::size_t kPart = 4096;
    const std::size_t parts = (count + kPart - 1) / kPart;
    std::vector<std::vector<std::uint64_t>> found(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
        const std::size_t end = std::min(count, (part + 1) * kPart);
        found[part].reserve(end - part * kPart);
        for (std::size_t i = part * kPart; i < end; ++i) {
            float key = 0;
            const std::uint32_t index = first + std::uint32_t(i);
            if (work(index, key)) found[part].push_back(entry(key, index));
        }
    });
    for (const std::vector<std::uint64_t>& some : found)
        entries_.insert(entries_.end(), some.begin(), some.end());
}

void KeyedOrder::sort() {
    constexpr std::size_t kPart = 16384;
    std::vector<std::array<std::uint32_t, kDigits>> places(
        std::clamp<std::size_t>(entries_.size() / kPart, 1, 16));
    std::vector<std::uint64_t> other(entries_.size());
    for (const int shift : {32, 43, 54}) {
        sort_by_digit(entries_, other, shift, places);
        entries_.swap(other);
    }
}

}  // namespace nephos
