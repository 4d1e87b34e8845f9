// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures as files. Every file is either complete or not there (core/atomic_file.h); all functions
// throw Error(io) naming the file, and none keeps state: they may run in several threads for different files.
//
// OpenEXR: two parts, 32-bit float, ZIP.
//
//     part "picture"   R, G, B            beauty as 16-bit floats: the layer that every viewer opens first
//                      beauty.R, .G, .B   linear Rec. 709, exposure not applied
//                      transmittance.Y    of the clouds, 1 = none
//                      depth.Z            metres along the ray, infinity without cloud (picture.h)
//     part "shadow"    shadow.Y           the square shadow map; where it lies is told by the attributes
//                                         shadowOrigin, shadowU, shadowV, shadowDirection
//
// Attributes of both: scene, seed, sceneHash, stateHash, nephosVersion, time, extinctionPerMetre; of
// "picture" also the standard worldToCamera, framesPerSecond and chromaticities, and verticalFieldOfView
// (degrees), exposure (stops).
//
// PNG: 8 bits, sRGB, tone-mapped (tone_map.h), the same metadata as text chunks.

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "render/image/picture.h"
#include "render/options/options.h"

namespace nephos {

// Writes the picture with all its layers. The file is opened again and found complete before it gets its
// name.
void write_exr(const std::filesystem::path& path, const Picture& picture, const RenderOptions& options,
               const PictureMetadata& metadata);

// Writes the tone-mapped beauty with options.camera.exposure_ev.
void write_png(const std::filesystem::path& path, const Picture& picture, const RenderOptions& options,
               const PictureMetadata& metadata);

// A decoded 8-bit RGB image; row 0 at the top.
struct Rgb8Image {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;                              // 3 * width * height
    std::vector<std::pair<std::string, std::string>> metadata;  // text chunks in file order
};

// Reads a PNG of any kind as 8-bit RGB (alpha dropped, grey and palette expanded), up to 16384 on a side.
Rgb8Image read_png(const std::filesystem::path& path);

struct ExrChannel {
    std::string name;
    std::string type;  // "half", "float" or "uint"
};

struct ExrPart {
    std::string name;  // empty in a file of one part
    int width = 0, height = 0;
    bool complete = false;  // every line was written
    std::string compression;
    std::vector<ExrChannel> channels;                             // sorted by name
    std::vector<std::pair<std::string, std::string>> attributes;  // name, value as text; sorted by name
};

// What an OpenEXR file of any origin says of itself; only headers are read.
struct ExrInfo {
    std::vector<ExrPart> parts;
};
ExrInfo read_exr_info(const std::filesystem::path& path);

// Reads a file of write_exr back; throws Error(io) when layers are missing. `light` is not stored and stays
// empty.
Picture read_exr(const std::filesystem::path& path);

}  // namespace nephos
