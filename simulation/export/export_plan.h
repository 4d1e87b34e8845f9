// SPDX-License-Identifier: Apache-2.0
#pragma once

// Tells what an export will write, under which names, and whether memory and disk hold it; writes nothing (not installed).

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "simulation/export/export.h"
#include "simulation/export/sequence.h"

namespace nephos {

// Throws Error(usage) for options that contradict each other, or that a format does not take.
void check_options(const ExportOptions& options);

// Returns the files and bytes of sequences.
ExportReport report_of(const ExportOptions& options, const std::vector<ExportSequence>& sequences);

// Throws Error(io) unless the disk that holds the folder, or will, has room for the files whose size is known; of an export that
// goes on, those of them that it has written already are not counted again. Throws Error(usage) unless memory holds the box of
// each sequence: a sparse file may have any, whose voxels many formats hold all.
void require_room(const ExportOptions& options, const std::vector<ExportSequence>& sequences);

// Names of files: of the steps, and, behind that of the scene, of CIGI's packets.
inline constexpr const char *kReadme = "README.txt", *kPackets = ".cigi";

std::string sidecar_name(const ExportSequence& sequence);
std::string pvd_name(const ExportSequence& sequence);
// The scene of all layers together.
std::string usd_name(const std::vector<ExportSequence>& sequences);

// Returns the names of all files. `run`: that of summaries of weather.
std::vector<std::string> file_names(const ExportOptions& options, const std::optional<RunListing>& run,
                                    const std::vector<ExportSequence>& sequences);

}  // namespace nephos
