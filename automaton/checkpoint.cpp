// SPDX-License-Identifier: Apache-2.0
#include "automaton/checkpoint.h"

#include <array>
#include <fstream>
#include <memory>
#include <new>
#include <string_view>

#include <xxhash.h>

#include "core/atomic_file.h"
#include "core/bytes.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/memory.h"
#include "core/random.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr std::array<char, 8> kMagic = {'N', 'E', 'P', 'H', 'O', 'S', 'C', 'P'};
constexpr std::uint32_t kFormatVersion = 1;
constexpr std::size_t kHashDigits = 32;
constexpr const char* kStateName = "automaton's state";
constexpr const char* kHistoryName = "history";

XXH128_hash_t hash_of(std::span<const std::byte> bytes) { return XXH3_128bits(bytes.data(), bytes.size()); }

[[noreturn]] void ends_inside(const char* what, std::uint64_t size, std::uint64_t left) {
    throw Error(ErrorCode::io, std::string("ends inside the ") + what + ": " + std::to_string(size) +
                                   " bytes announced, " + std::to_string(left) + " left");
}

// Bytes before the first block (checkpoint.h), and after the last.
constexpr std::uint64_t kHeadBytes = 8 + 4 + 4 + kHashDigits + 3 * 8;
constexpr std::uint64_t kTailBytes = 2 * 8;

void check_head(ByteReader& in) {
    if (in.rest().size() < kMagic.size() || in.get<std::array<char, 8>>() != kMagic)
        throw Error(ErrorCode::io, "is not a nephos checkpoint");
    if (const auto version = in.get<std::uint32_t>(); version != kFormatVersion) {
        throw Error(ErrorCode::io, "has checkpoint format " + std::to_string(version) +
                                       "; this version reads " + std::to_string(kFormatVersion));
    }
    if (const auto version = in.get<std::uint32_t>(); version != kRandomStreamVersion) {
        throw Error(ErrorCode::io, "was written with random stream " + std::to_string(version) +
                                       "; this version draws stream " + std::to_string(kRandomStreamVersion));
    }
}

// An error of the system, as one while it is read, and no sign of damage.
void go_to(std::ifstream& in, std::uint64_t at) {
    if (!in.seekg(std::streamoff(at))) in.setstate(std::ios::badbit);
}

// The head and the sizes that a file states, against its own size, before anything is allocated for them.
void check_sizes(std::ifstream& in, std::uint64_t file_size) {
    std::array<std::byte, kHeadBytes> head{};
    in.read(reinterpret_cast<char*>(head.data()), head.size());
    ByteReader reader(std::span<const std::byte>(head).first(std::size_t(in.gcount())));
    check_head(reader);
    if (std::uint64_t(in.gcount()) < kHeadBytes) throw Error(ErrorCode::io, "ends early: inside its head");
    std::uint64_t at = kHeadBytes;
    for (const char* what : {kStateName, kHistoryName}) {
        std::uint64_t size = 0;
        go_to(in, at);
        if (at > file_size || file_size - at < sizeof size ||
            !in.read(reinterpret_cast<char*>(&size), sizeof size)) {
            throw Error(ErrorCode::io, std::string("ends before the ") + what);
        }
        at += sizeof size;
        if (size > file_size - at) ends_inside(what, size, file_size - at);
        at += size;
    }
    if (file_size - at < kTailBytes) throw Error(ErrorCode::io, "ends before its hash");
    if (file_size - at > kTailBytes) {
        throw Error(ErrorCode::io,
                    "has " + std::to_string(file_size - at - kTailBytes) + " bytes after its end");
    }
    if (const AvailableMemory memory = available_memory(); file_size > memory.bytes / 2) {
        throw Error(ErrorCode::io, "takes " + bytes_text(2 * file_size) + " to read, but the " +
                                       memory.limit + " leaves " + bytes_text(memory.bytes));
    }
}

std::vector<std::byte> read_all(const std::filesystem::path& path) {
    require_regular_file(path);
    const std::uint64_t size = std::filesystem::file_size(path);
    std::ifstream in = open_stream(path);
    try {
        check_sizes(in, size);
    } catch (const Error& error) {
        check_reading(in, path);
        throw Error(ErrorCode::io, path.string() + ": " + error.what());
    }
    std::vector<std::byte> bytes(size);
    go_to(in, 0);
    if (!in.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(size))) {
        check_reading(in, path);
        throw Error(ErrorCode::io, path.string() + ": became shorter while it was read");
    }
    return bytes;
}

std::vector<std::byte> get_block(ByteReader& in, const char* what) {
    const auto size = in.get<std::uint64_t>();
    if (size > in.rest().size()) ends_inside(what, size, in.rest().size());
    std::vector<std::byte> block(size);
    in.get_bytes(block);
    return block;
}

Checkpoint parse(std::span<const std::byte> bytes) {
    ByteReader in(bytes);
    check_head(in);
    Checkpoint checkpoint;
    checkpoint.simulation_hash.resize(kHashDigits);
    in.get_bytes(std::as_writable_bytes(std::span(checkpoint.simulation_hash)));
    checkpoint.state.high = in.get<std::uint64_t>();
    checkpoint.state.low = in.get<std::uint64_t>();
    checkpoint.steps = in.get<std::uint64_t>();
    checkpoint.automaton = get_block(in, kStateName);
    checkpoint.history = get_block(in, kHistoryName);
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
    const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
    if (!state) throw std::bad_alloc();
    XXH3_128bits_reset(state.get());
    // Piece by piece: the planes are large, and there is no room for a copy of them.
    write_pieces_atomically(
        path,
        [&](const AppendPiece& append) {
            const auto put = [&](std::span<const std::byte> bytes) {
                XXH3_128bits_update(state.get(), bytes.data(), bytes.size());
                append(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
            };
            ByteWriter head;
            head.put(kMagic);
            head.put(kFormatVersion);
            head.put(kRandomStreamVersion);
            head.put_bytes(std::as_bytes(std::span(checkpoint.simulation_hash)));
            head.put(checkpoint.state.high);
            head.put(checkpoint.state.low);
            head.put(checkpoint.steps);
            put(head.bytes());
            for (const auto* block : {&checkpoint.automaton, &checkpoint.history}) {
                const std::uint64_t size = block->size();
                put(std::as_bytes(std::span(&size, 1)));
                put(*block);
            }
            const XXH128_hash_t hash = XXH3_128bits_digest(state.get());
            put(std::as_bytes(std::span(&hash.high64, 1)));
            put(std::as_bytes(std::span(&hash.low64, 1)));
        },
        Folders::expected);
}

Checkpoint read_checkpoint(const std::filesystem::path& path) {
    const std::vector<std::byte> bytes = read_all(path);
    try {
        return parse(bytes);
    } catch (const Error& error) {
        throw Error(ErrorCode::io, path.string() + ": " + error.what());
    }
}

StateHash hash_of_bytes(std::span<const std::byte> bytes) {
    const XXH128_hash_t hash = hash_of(bytes);
    return {hash.high64, hash.low64};
}

bool is_checkpoint(const std::filesystem::path& path) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(path, error)) return false;
    return read_beginning(path, kMagic.size()) == std::string_view(kMagic.data(), kMagic.size());
}

}  // namespace nephos
