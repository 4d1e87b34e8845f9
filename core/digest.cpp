// SPDX-License-Identifier: Apache-2.0
#include "core/digest.h"

#include <algorithm>
#include <cstring>
#include <fstream>
#include <new>
#include <vector>

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

FileDigest file_digest(const std::filesystem::path& path, std::uint64_t most) {
    std::ifstream file = open_stream(path);
    return file_digest(file, path, most);
}

FileDigest file_digest(std::istream& file, const std::filesystem::path& path, std::uint64_t most) {
    std::vector<char> piece(kPieceBytes);
    Digest digest;
    FileDigest result;
    file.clear();
    file.seekg(0);
    while (file && result.bytes < most) {
        file.read(piece.data(), std::streamsize(std::min<std::uint64_t>(piece.size(), most - result.bytes)));
        const auto count = std::size_t(file.gcount());
        digest.add(std::string_view(piece.data(), count));
        result.bytes += count;
    }
    check_reading(file, path);
    result.xxh3 = digest.hex();
    return result;
}

std::string digest_of(std::span<const std::byte> bytes) {
    return hex_of(XXH3_128bits(bytes.data(), bytes.size()));
}

}  // namespace nephos
