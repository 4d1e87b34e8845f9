// SPDX-License-Identifier: Apache-2.0
#pragma once

// One channel of an OpenEXR file of any program, as numbers. For a confined child process (density/vdb/sandbox.h): the
// caller runs it there. Private to the module.

#include <vector>

namespace nephos {

// Row 0 is the top.
struct ExrGrid {
    int columns = 0, rows = 0;
    std::vector<float> values;
};

// Reads the only channel of the first part of an open file, or of several the one named Z, Y, height or R, each chunk once:
// heights are numbers of the file, never what memory held. Throws std::runtime_error with what is wrong: no EXR; a head
// without what pixels are read by; a chunk that does not give its pixels, or shares bytes with another; a data window that is
// not the display window; no such channel; several samples a pixel or fewer than one; a side outside of 2..most; deep data in
// any part; rows with an attribute `tiles`; DWA and channels of less than half the rows, of which OpenEXR's core library
// (3.1.5) notices no damage; "cannot read: ..." where a read failed. Also std::bad_alloc.
ExrGrid parse_exr_grid(int fd, int most);

}  // namespace nephos
