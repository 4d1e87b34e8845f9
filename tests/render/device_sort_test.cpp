// SPDX-License-Identifier: Apache-2.0
// Sorting and summing on the device, against the standard library.

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/renderer_test_access.h"
#include "tests/render/picture_checks.h"

namespace nephos {
namespace {

class DeviceSort : public ::testing::Test {
  protected:
    void TearDown() override { test::expect_no_messages(renderer_); }

    void expect_sorted(const std::vector<std::uint32_t>& keys, std::uint32_t bits) {
        std::vector<std::uint32_t> expected(keys.size());
        std::iota(expected.begin(), expected.end(), 0u);
        const std::uint32_t mask = bits < 32 ? (1u << bits) - 1 : ~0u;
        std::ranges::stable_sort(expected, {}, [&](std::uint32_t i) { return keys[i] & mask; });
        EXPECT_EQ(RendererTestAccess::sorted(renderer_, keys, bits), expected) << keys.size() << " keys";
    }

    Renderer renderer_{DeviceOptions{.device = {}, .validation = true, .splatting = Splatting::vulkan}};
};

// None, one, around a work group and a block of it, and so many that the sums have several blocks; random
// keys, few different ones, equal ones, in order and the other way round.
TEST_F(DeviceSort, EqualsStableSort) {
    std::mt19937 random(11);
    for (const std::size_t count : {0, 1, 2, 255, 256, 257, 2047, 2048, 2049, 100003}) {
        std::vector<std::uint32_t> keys(count);
        std::ranges::generate(keys, std::ref(random));
        expect_sorted(keys, 32);
        std::ranges::sort(keys);
        expect_sorted(keys, 32);
        std::ranges::reverse(keys);
        expect_sorted(keys, 32);
        std::ranges::fill(keys, 0x3f8012abu);
        expect_sorted(keys, 32);
        for (std::uint32_t& key : keys) key = random() % 5 * 0x01010101u;
        expect_sorted(keys, 32);
    }
}

// Digits beyond the bits that count have zeros, as the numbers of tiles have.
TEST_F(DeviceSort, TakesNoMorePassesThanNeeded) {
    std::mt19937 random(12);
    for (const std::uint32_t bits : {1u, 8u, 9u, 14u, 21u}) {
        std::vector<std::uint32_t> keys(5000);
        for (std::uint32_t& key : keys) key = random() & ((1u << bits) - 1);
        expect_sorted(keys, bits);
    }
}

TEST_F(DeviceSort, PrefixSums) {
    std::mt19937 random(13);
    for (const std::size_t count : {0, 1, 2, 255, 256, 257, 2047, 2048, 2049, 100003, 600000}) {
        std::vector<std::uint32_t> numbers(count), expected(count + 1, 0);
        for (std::uint32_t& number : numbers) number = random() % 1000;
        std::partial_sum(numbers.begin(), numbers.end(), expected.begin() + 1);
        EXPECT_EQ(RendererTestAccess::prefix_sums(renderer_, numbers), expected) << count;
    }
}

// Lists that are far too long must not look short.
TEST_F(DeviceSort, PrefixSumsEndAtTheLargestNumber) {
    for (const std::size_t count : {2u, 2000u, 9000u}) {
        const std::vector<std::uint32_t> numbers(count, 0xf0000000u);
        const std::vector<std::uint32_t> sums = RendererTestAccess::prefix_sums(renderer_, numbers);
        EXPECT_EQ(sums[0], 0u);
        EXPECT_EQ(sums[1], 0xf0000000u);
        EXPECT_EQ(sums.back(), 0xffffffffu) << count;
    }
}

}  // namespace
}  // namespace nephos
