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

// Prepares the library, once, before a process that shall read is made.
void prepare_exr();

// Reads the only channel of the first part of an open file, or of several the one named Z, Y, height or R. Throws
// std::runtime_error with what is wrong: no EXR, a chunk that does not give its pixels, a data window that is not the display window, no such channel, several samples a pixel or fewer than one, a side
// outside of 2..most.
ExrGrid parse_exr_grid(int fd, int most);

}  // namespace nephos
