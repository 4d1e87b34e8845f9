// SPDX-License-Identifier: Apache-2.0
#include "automaton/checkpoint.h"

#include <array>
#include <fstream>

#include <xxhash.h>

#include "automaton/atomic_file.h"
#include "automaton/bytes.h"
#include "automaton/error.h"
#include "automaton/random.h"

namespace nephos {
namespace {

constexpr std::array<char, 8> kMagic = {'N', 'E', 'P', 'H', 'O', 'S', 'C', 'P'};
constexpr std::uint32_t kFormatVersion = 1;
constexpr std::size_t kHashDigits = 32;

XXH128_hash_t hash_of(std::span<const std::byte> bytes) { return XXH3_128bits(bytes.data(), bytes.size()); }

std::vector<std::byte> read_all(const std::filesystem::path& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) {
        throw Error(
            ErrorCode::io,
            path.string() + ": " + (std::filesystem::exists(path, error) ? "is not a file" : "no such file"));
    }
    const auto size = std::filesystem::file_size(path, error);
    if (error) throw Error(ErrorCode::io, path.string() + ": " + error.message());
    std::ifstream in(path, std::ios::binary);
    if (!is_checkpoint(path)) throw Error(ErrorCode::io, path.string() + ": is not a nephos checkpoint");
    std::vector<std::byte> bytes(size);
    if (!in.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(size))) {
        throw Error(ErrorCode::io, path.string() + ": cannot read");
    }
    return bytes;
}

std::vector<std::byte> get_block(ByteReader& in, const char* what) {
    const auto size = in.get<std::uint64_t>();
    if (size > in.rest().size()) {
        throw Error(ErrorCode::io, std::string("ends inside the ") + what + ": " + std::to_string(size) +
                                       " bytes announced, " + std::to_string(in.rest().size()) + " left");
    }
    std::vector<std::byte> block(size);
    in.get_bytes(block);
    return block;
}

Checkpoint parse(std::span<const std::byte> bytes) {
    ByteReader in(bytes);
    if (in.get<std::array<char, 8>>() != kMagic) throw Error(ErrorCode::io, "is not a nephos checkpoint");
    if (const auto version = in.get<std::uint32_t>(); version != kFormatVersion) {
        throw Error(ErrorCode::io, "has checkpoint format " + std::to_string(version) +
                                       "; this version reads " + std::to_string(kFormatVersion));
    }
    if (const auto version = in.get<std::uint32_t>(); version != kRandomStreamVersion) {
        throw Error(ErrorCode::io, "was written with random stream " + std::to_string(version) +
                                       "; this version draws stream " + std::to_string(kRandomStreamVersion));
    }
    Checkpoint checkpoint;
    checkpoint.simulation_hash.resize(kHashDigits);
    in.get_bytes(std::as_writable_bytes(std::span(checkpoint.simulation_hash)));
    checkpoint.state.high = in.get<std::uint64_t>();
    checkpoint.state.low = in.get<std::uint64_t>();
    checkpoint.steps = in.get<std::uint64_t>();
    checkpoint.automaton = get_block(in, "automaton's state");
    checkpoint.history = get_block(in, "history");
    const std::size_t hashed = bytes.size() - in.rest().size();
    const auto high = in.get<std::uint64_t>(), low = in.get<std::uint64_t>();
    const XXH128_hash_t actual = hash_of(bytes.first(hashed));
    if (high != actual.high64 || low != actual.low64) {
        throw Error(ErrorCode::io, "is damaged: its content does not match its hash");
    }
    if (!in.rest().empty()) {
        throw Error(ErrorCode::io, "has " + std::to_string(in.rest().size()) + " bytes after its end");
    }
    return checkpoint;
}

}  // namespace

void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint) {
    if (checkpoint.simulation_hash.size() != kHashDigits) {
        throw Error(ErrorCode::usage, "a checkpoint needs a simulation hash of 32 digits");
    }
    ByteWriter out;
    out.put(kMagic);
    out.put(kFormatVersion);
    out.put(kRandomStreamVersion);
    out.put_bytes(std::as_bytes(std::span(checkpoint.simulation_hash)));
    out.put(checkpoint.state.high);
    out.put(checkpoint.state.low);
    out.put(checkpoint.steps);
    for (const auto* block : {&checkpoint.automaton, &checkpoint.history}) {
        out.put(std::uint64_t(block->size()));
        out.put_bytes(*block);
    }
    const XXH128_hash_t hash = hash_of(out.bytes());
    out.put(std::uint64_t(hash.high64));
    out.put(std::uint64_t(hash.low64));
    write_atomically(path, out.bytes());
}

Checkpoint read_checkpoint(const std::filesystem::path& path) {
    const std::vector<std::byte> bytes = read_all(path);
    try {
        return parse(bytes);
    } catch (const Error& error) {
        throw Error(ErrorCode::io, path.string() + ": " + error.what());
    }
}

bool is_checkpoint(const std::filesystem::path& path) {
    std::array<char, 8> magic{};
    std::ifstream in(path, std::ios::binary);
    return in.read(magic.data(), magic.size()) && magic == kMagic;
}

}  // namespace nephos
