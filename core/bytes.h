// SPDX-License-Identifier: Apache-2.0
#pragma once

// Little-endian serialisation of plain values for checkpoints and exported files.

#include <bit>
#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/error.h"

namespace nephos {

static_assert(std::endian::native == std::endian::little, "checkpoints and bit planes are little-endian");

// Appends plain values to a buffer in their memory representation, without padding between them.
class ByteWriter {
  public:
    template <class T>
    requires std::is_trivially_copyable_v<T>
    void put(const T& value) { put_bytes(std::as_bytes(std::span(&value, 1))); }
    void put_bytes(std::span<const std::byte> content) {
        if (content.empty()) return;
        const std::size_t at = bytes_.size();
        bytes_.resize(at + content.size());
        std::memcpy(bytes_.data() + at, content.data(), content.size());
    }
    std::span<const std::byte> bytes() const { return bytes_; }
    std::vector<std::byte> take() { return std::move(bytes_); }

  private:
    std::vector<std::byte> bytes_;
};

// Reads values in the order in which ByteWriter wrote them; throws Error(io) when the bytes end early. Does
// not own the bytes.
class ByteReader {
  public:
    explicit ByteReader(std::span<const std::byte> bytes) : left_(bytes) {}

    template <class T>
    requires std::is_trivially_copyable_v<T> T get() {
        T value;
        get_bytes(std::as_writable_bytes(std::span(&value, 1)));
        return value;
    }
    void get_bytes(std::span<std::byte> out) {
        check(out.size());
        if (!out.empty()) std::memcpy(out.data(), left_.data(), out.size());
        left_ = left_.subspan(out.size());
    }
    void skip(std::size_t bytes) {
        check(bytes);
        left_ = left_.subspan(bytes);
    }
    std::span<const std::byte> rest() const { return left_; }

  private:
    void check(std::size_t bytes) const {
        if (bytes > left_.size()) throw Error(ErrorCode::io, "it ends early");
    }

    std::span<const std::byte> left_;
};

}  // namespace nephos
