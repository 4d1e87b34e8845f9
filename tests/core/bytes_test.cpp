// SPDX-License-Identifier: Apache-2.0
// Values from bytes (core/bytes.h), of files that may end anywhere.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "core/bytes.h"
#include "core/error.h"

namespace nephos {
namespace {

TEST(Bytes, AreReadAsTheyWereWritten) {
    ByteWriter writer;
    writer.put(std::uint32_t{7});
    writer.put(2.5);
    writer.put_bytes({});
    writer.put(std::uint16_t{9});
    EXPECT_EQ(writer.bytes().size(), 14u);
    const std::vector<std::byte> bytes = writer.take();
    ByteReader reader(bytes);
    EXPECT_EQ(reader.get<std::uint32_t>(), 7u);
    reader.skip(8);
    EXPECT_EQ(reader.get<std::uint16_t>(), 9u);
    reader.skip(0);
    EXPECT_TRUE(reader.rest().empty());
}

TEST(Bytes, NothingIsReadBehindTheEnd) {
    const std::vector<std::byte> bytes(6);
    ByteReader reader(bytes);
    std::vector<std::byte> more(7);
    EXPECT_THROW(reader.skip(7), Error);
    EXPECT_THROW(reader.get_bytes(more), Error);
    EXPECT_THROW(reader.get<std::uint64_t>(), Error);
    EXPECT_EQ(reader.rest().size(), 6u);
    reader.skip(6);
    EXPECT_THROW(reader.skip(1), Error);
    EXPECT_TRUE(reader.rest().empty());
}

}  // namespace
}  // namespace nephos
