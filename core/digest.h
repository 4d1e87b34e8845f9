// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checksums: XXH3-128 (seed 0) in xxHash's canonical form, 32 lower-case hexadecimal digits, as `xxhsum -H2` prints
// them. They find damage, not forgery: XXH3 is no cryptographic hash.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <memory>
#include <span>
#include <string>

namespace nephos {

// Computes the checksum of bytes that come in pieces. Movable, not copyable; not thread-safe.
class Digest {
  public:
    Digest();
    ~Digest();
    Digest(Digest&&) noexcept;
    Digest& operator=(Digest&&) noexcept;

    void add(std::span<const std::byte> bytes);
    void add(std::string_view text) { add(std::as_bytes(std::span(text.data(), text.size()))); }
    // Returns the checksum of all bytes so far.
    std::string hex() const;

  private:
    struct State;
    std::unique_ptr<State> state_;
};

// The size of a file and its checksum.
struct FileDigest {
    std::uint64_t bytes = 0;
    std::string xxh3;
    bool operator==(const FileDigest&) const = default;
};

// Reads a regular file, to its end or at most so many bytes. Throws Error(io) naming the path. Thread-safe.
FileDigest file_digest(const std::filesystem::path& path, std::uint64_t most = ~std::uint64_t{0});

// As that, from the beginning of a file that is open; `path` is for messages.
FileDigest file_digest(std::istream& file, const std::filesystem::path& path,
                       std::uint64_t most = ~std::uint64_t{0});

// Returns the checksum of bytes in memory. Thread-safe; pure.
std::string digest_of(std::span<const std::byte> bytes);

}  // namespace nephos
