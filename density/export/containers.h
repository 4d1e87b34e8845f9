// SPDX-License-Identifier: Apache-2.0
#pragma once

// Files of dense voxels: raw, DirectDraw Surface, KTX 2 and VTK ImageData. Every file is complete or absent
// (atomic_file.h). Writers throw Error(io) naming the file, and Error(usage) for a type that the format lacks; readers
// throw Error(io) naming the file and what is wrong with it. Thread-safe for different files.

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "density/export/volume.h"

namespace nephos {

// A level of detail, encoded.
struct VolumeLevel {
    int nx = 0, ny = 0, nz = 0;
    std::vector<std::byte> bytes;
};

// Level 0 first; each next one has half of the size, at least 1, on each axis.
struct EncodedVolume {
    VoxelType type = VoxelType::r8;
    std::vector<VolumeLevel> levels;
};

// Little-endian voxels of level 0, then 1, ...; nothing else.
void write_raw(const std::filesystem::path& path, const EncodedVolume& volume);
// The reader is told type and size of level 0, and how many levels.
EncodedVolume read_raw(const std::filesystem::path& path, VoxelType type, int nx, int ny, int nz, int levels);

// A volume texture. `legacy`: the header before DirectX 10, as luminance (r8) or ATI1 (bc4), for OpenSceneGraph; other
// types are Error(usage) then. Source: Microsoft, "Programming Guide for DDS".
void write_dds(const std::filesystem::path& path, const EncodedVolume& volume, bool legacy = false);
EncodedVolume read_dds(const std::filesystem::path& path);

// A 3-D texture with `description` as the value of its key "nephos". Source: Khronos, "KTX File Format Specification
// 2.0", and "Data Format Specification 1.3".
void write_ktx2(const std::filesystem::path& path, const EncodedVolume& volume,
                const std::string& description);
EncodedVolume read_ktx2(const std::filesystem::path& path);

// Level 0 as point data `density` at the voxels' centres, appended raw or compressed by zlib, with the time as field
// data; of r16f, which VTK lacks, Error(usage). Source: Kitware, "VTK File Formats".
struct VtiPlace {
    std::array<double, 3> first_m{};  // centre of the first voxel
    std::array<double, 3> voxel_m{};
    double time_s = 0;
};
void write_vti(const std::filesystem::path& path, const EncodedVolume& volume, const VtiPlace& place,
               bool zip);
// `place`, unless null, becomes what the file says of it.
EncodedVolume read_vti(const std::filesystem::path& path, VtiPlace* place = nullptr);

// A collection of files with their times for ParaView (.pvd); names are relative to it.
struct PvdEntry {
    double time_s = 0;
    std::string file;
};
std::string pvd_text(const std::vector<PvdEntry>& entries);

// The slices of level 0 in a grid of `columns`, slice 0 at the upper left, as a grey PNG of 8 bits (r8) or 16 (r16).
// Within a slice the first row of voxels is the topmost of the picture. Others are Error(usage).
void write_slices(const std::filesystem::path& path, const EncodedVolume& volume, int columns);
EncodedVolume read_slices(const std::filesystem::path& path, int nx, int ny, int nz, int columns);
// Returns the columns that make the picture nearly square.
int slice_columns(int nx, int ny, int nz);

}  // namespace nephos
