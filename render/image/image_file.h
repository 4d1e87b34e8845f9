// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures as EXR and PNG files. Writing is atomic (core/atomic_file.h); all functions throw Error(io) naming
// the file. They have no state and may run in several threads for different files.
//
// OpenEXR: two parts, 32-bit float, ZIP.
//
//     part "picture"   R, G, B            beauty as 16-bit floats: the default layer of viewers
//                      beauty.R, .G, .B   linear Rec. 709, exposure not applied
//                      transmittance.Y    of the clouds, 1 = none
//                      depth.Z            metres along the ray, infinity without cloud (picture.h)
//     part "shadow"    shadow.Y           the square shadow map; its ShadowFrame is in the attributes
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

// Returns the options with the exposure that the picture has with them (exposure.h), as a manual one: the text
// chunk and the attribute `exposure` say it.
RenderOptions with_exposure(const RenderOptions& options, const Picture& picture);

// Writes the picture with all its layers, and checks that the file is complete before renaming it.
void write_exr(const std::filesystem::path& path, const Picture& picture, const RenderOptions& options,
               const PictureMetadata& metadata);

// Writes the beauty as options.camera takes it: glare, exposure, tone curve. Throws Error(usage) on a picture whose layers
// do not have its size.
void write_png(const std::filesystem::path& path, const Picture& picture, const RenderOptions& options,
               const PictureMetadata& metadata);

// An 8-bit RGB image; row 0 at the top.
struct Rgb8Image {
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;  // 3 * width * height
};

// Writes a picture that has been encoded already: the 3 * width * height bytes of to_srgb8(). The image's own
// text chunks are not written.
void write_png(const std::filesystem::path& path, const Rgb8Image& image, const RenderOptions& options,
               const PictureMetadata& metadata);

// Encodes the beauty layer as write_png() does. Throws Error(usage) as it does.
Rgb8Image srgb8_image(const Picture& picture, const RenderOptions& options);

// Returns the text chunk `exposure` of a PNG that write_png() wrote, stops. Throws Error(io) without one.
double read_png_exposure(const std::filesystem::path& path);

// Reads a PNG of any kind as 8-bit RGB in sRGB (what is transparent over black), up to 16384 on a side.
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

// The headers of an OpenEXR file of any program.
struct ExrInfo {
    std::vector<ExrPart> parts;
};
// Reads the headers alone.
ExrInfo read_exr_info(const std::filesystem::path& path);

}  // namespace nephos
