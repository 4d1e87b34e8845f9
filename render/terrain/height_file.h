// SPDX-License-Identifier: Apache-2.0
#pragma once

// Height maps from files of other programs, by the ending of their names:
//
//     .png          one channel of 16 bits, 0..65535; colour profiles and gamma do not count
//     .exr          the first part, with one channel or one named Z, Y, height or R, of any type: metres. Its data window is its
//                   display window; compressed in any way but by DWA
//     .raw .r16     rows of unsigned 16-bit numbers, little-endian, without a header
//
// All with the north at the top, 2 to 4096 on a side. PNG and EXR are parsed in a confined child process (docs/security.md).

#include <filesystem>

#include "render/terrain/height_map.h"

namespace nephos {

// What a file holds: numbers as they are there.
struct HeightFile {
    HeightImage image;
    bool metres = false;  // false: 0..65535
};

// Reads a file; `raw_columns` and `raw_rows` are those of a raw one. Throws Error(io) naming the file when it cannot be read,
// is not as above, or has heights that are not finite; Error(usage) for another ending.
HeightFile read_height_file(const std::filesystem::path& path, int raw_columns, int raw_rows);

}  // namespace nephos
