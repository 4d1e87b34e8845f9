// SPDX-License-Identifier: Apache-2.0
#pragma once

// The files of shards in a folder: their names, who writes them, and whether they are a sweep's.

#include <cstdint>
#include <filesystem>
#include <vector>

namespace nephos {

// Returns whether a file is called as one of records: 0003-of-0012.jsonl.
bool is_name_of_shard(const std::filesystem::path& path);

// Returns the files of records in a folder, sorted by name. Throws Error(io). Thread-safe.
std::vector<std::filesystem::path> files_of_shards(const std::filesystem::path& folder);

// Returns whether a folder has a file of records, also one that is empty yet. Throws Error(io). Thread-safe.
bool has_shards(const std::filesystem::path& folder);

// Returns FOLDER/shards/0003-of-0012.jsonl.
std::filesystem::path shard_path(const std::filesystem::path& folder, std::uint32_t number, std::uint32_t of);

// Locks an open shard for writing. Throws Error(io) when another process has done so.
void lock_shard(const std::filesystem::path& path, int descriptor);

// Throws Error(usage) where the file is there and is no shard, not a damaged one either, nor the first part of one.
void require_own_records(const std::filesystem::path& path);

// Removes the shards of a folder, or only the one of a number where `of` is above 1. Throws Error(io), also when another
// process writes one of them; then none is removed.
void remove_shards(const std::filesystem::path& folder, std::uint32_t number, std::uint32_t of);

}  // namespace nephos
