// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checkpoints: the state of a simulation on disk, to resume it with the same bits. One file, little-endian:
//
//     "NEPHOSCP"  8 bytes
//     format version  u32, random stream version  u32
//     simulation hash  32 characters          state hash  2 x u64          steps  u64
//     size of the automaton's state  u64, its bytes (Automaton::save)
//     size of the history  u64, its bytes (the caller's own state, such as earlier cld planes)
//     XXH3-128 of everything above  2 x u64

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "automaton/automaton.h"

namespace nephos {

struct Checkpoint {
    std::string simulation_hash;  // of what decides the bits; 32 hexadecimal digits
    std::uint64_t steps = 0;
    StateHash state;
    std::vector<std::byte> automaton;  // Automaton::save()
    std::vector<std::byte> history;    // the caller's own state
};

// Writes atomically, into a folder that is there; throws Error(io).
void write_checkpoint(const std::filesystem::path& path, const Checkpoint& checkpoint);

// Reads a checkpoint and verifies magic, versions, sizes against the file's, and the hash of the content.
// Throws Error(io) with the failed check.
Checkpoint read_checkpoint(const std::filesystem::path& path);

// Returns the XXH3-128 of bytes. Pure.
StateHash hash_of_bytes(std::span<const std::byte> bytes);

// Returns true for a regular file that starts with a checkpoint's magic. Throws Error(io) when it cannot be opened or read.
bool is_checkpoint(const std::filesystem::path& path);

}  // namespace nephos
