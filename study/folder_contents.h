// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells files that a sweep or fit wrote from those of others, before anything is written into their folder.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace nephos {

// The title of a sweep's series.nc, and the first line of a fit's scene; kWrittenBySweep is that of a sweep's TOML.
inline constexpr std::string_view kSweepTitle = "nephos sweep", kWrittenByFit = "# Written by nephos fit.\n";

// Lists the files that `nephos sweep --emit` writes, with their beginnings.
inline constexpr std::pair<std::string_view, std::string_view> kSweepScripts[] = {
    {"sweep.slurm", "#!/bin/bash\n# Runs a sweep in "},
    {"Snakefile", "# Runs a sweep in "},
    {"sweep.parallel", "\"${NEPHOS:-nephos}\" sweep sweep.toml --shard "},
};

// Throws Error(usage) that names a file in the folder which a sweep would replace and no sweep wrote, as a scene or a plan
// of the user's own, or what a run left. Each file tells by its beginning, beside records, too. Thread-safe.
void require_sweep_folder(const std::filesystem::path& folder);

// The same for a fit, and the files of its result.
void require_fit_folder(const std::filesystem::path& folder);

// Throws Error(usage) when something is there, which `by` would replace: "a sweep". Thread-safe.
void require_absent(const std::filesystem::path& file, std::string_view by);

// Throws Error(usage) when the file is there and does not begin as those that `by` writes: "a sweep". Thread-safe.
void require_own(const std::filesystem::path& file, std::string_view beginning, std::string_view by);

// Return the folder of the sweep, or of the fit, that wrote the file, through links, too; nothing: none did. Throw ReadFailure.
// Thread-safe.
std::optional<std::filesystem::path> sweep_with_file(const std::filesystem::path& file);
std::optional<std::filesystem::path> fit_with_file(const std::filesystem::path& file);

// Returns whose file it is, of a sweep, fit, run or export, as what to say of it: "a file of the run in /data/out". Throws as these.
std::optional<std::string> owner_of_file(const std::filesystem::path& file);

}  // namespace nephos
