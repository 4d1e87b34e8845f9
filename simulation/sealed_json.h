// SPDX-License-Identifier: Apache-2.0
#pragma once

// The checksum that a list of files (manifest.json, export.json) has of itself, as its last member: XXH3-128 of all bytes of
// the file before the comma that it follows.
//
//     {
//       ...
//       "timing": {...},
//       "xxh3": "5d1c29..."
//     }
//
// It finds damage, not forgery.

#include <filesystem>
#include <string>
#include <string_view>

#include "core/digest.h"

namespace nephos {

inline constexpr const char* kSealKey = "xxh3";

// Returns what an object ends with, from the comma after its last other member on: `before` has all bytes up to there.
std::string seal_text(const Digest& before);

// Returns the text of an object that has members, as dump(2) writes it, with its checksum and a newline.
std::string sealed_text(std::string_view object);

enum class Seal {
    whole,
    broken,
    none,  // the list of an earlier version, or one whose checksum was taken out
};

// Judges the bytes of a list that is JSON. Throws Error(io) as open_regular_file(). Thread-safe.
Seal seal_of(const std::filesystem::path& list);

}  // namespace nephos
