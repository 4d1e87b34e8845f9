// SPDX-License-Identifier: Apache-2.0
#include "core/digest.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <istream>
#include <new>
#include <vector>

#include <fcntl.h>
#include <unistd.h>
#include <xxhash.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

// Of one call of read(2): large enough that calls cost nothing, small enough to stay in the second-level cache.
constexpr std::size_t kPieceBytes = std::size_t(256) << 10;

std::string hex_of(XXH128_hash_t hash) {
    XXH128_canonical_t canonical;
    XXH128_canonicalFromHash(&canonical, hash);
    constexpr const char* kDigits = "0123456789abcdef";
    std::string text;
    for (const unsigned char byte : canonical.digest) {
        text += kDigits[byte >> 4];
        text += kDigits[byte & 15];
    }
    return text;
}

}  // namespace

struct Digest::State {
    struct Free {
        void operator()(XXH3_state_t* state) const { XXH3_freeState(state); }
    };
    std::unique_ptr<XXH3_state_t, Free> xxh3{XXH3_createState()};
};

Digest::Digest() : state_(std::make_unique<State>()) {
    if (!state_->xxh3) throw std::bad_alloc();
    XXH3_128bits_reset(state_->xxh3.get());
}

Digest::~Digest() = default;
Digest::Digest(Digest&&) noexcept = default;
Digest& Digest::operator=(Digest&&) noexcept = default;

void Digest::add(std::span<const std::byte> bytes) {
    if (!bytes.empty()) XXH3_128bits_update(state_->xxh3.get(), bytes.data(), bytes.size());
}

std::string Digest::hex() const { return hex_of(XXH3_128bits_digest(state_->xxh3.get())); }

namespace {

// Returns the checksum of at most so many bytes. `read` fills a piece from its front and returns how many it has; 0: the end.
template <typename Read>
FileDigest digest_of_pieces(std::uint64_t most, const Read& read) {
    std::vector<std::byte> piece(kPieceBytes);
    Digest digest;
    FileDigest result;
    while (result.bytes < most) {
        const std::size_t wanted = std::size_t(std::min<std::uint64_t>(piece.size(), most - result.bytes));
        const std::size_t count = read(std::span(piece).first(wanted));
        if (count == 0) break;
        digest.add(std::span(piece).first(count));
        result.bytes += count;
    }
    result.xxh3 = digest.hex();
    return result;
}

}  // namespace

FileDigest file_digest(const std::filesystem::path& path, std::uint64_t most) {
    const Descriptor file = open_regular_file(path, O_RDONLY);
    return digest_of_pieces(most, [&](std::span<std::byte> piece) {
        ssize_t count;
        do count = ::read(file.get(), piece.data(), piece.size());
        while (count < 0 && errno == EINTR);
        if (count < 0) throw ReadFailure(path, std::strerror(errno));
        return std::size_t(count);
    });
}

FileDigest file_digest(std::istream& file, const std::filesystem::path& path, std::uint64_t most) {
    rewind(file, path);
    return digest_of_pieces(most, [&](std::span<std::byte> piece) {
        file.read(reinterpret_cast<char*>(piece.data()), std::streamsize(piece.size()));
        check_reading(file, path);
        return std::size_t(file.gcount());
    });
}

std::string digest_of(std::span<const std::byte> bytes) {
    return hex_of(XXH3_128bits(bytes.data(), bytes.size()));
}

}  // namespace nephos
