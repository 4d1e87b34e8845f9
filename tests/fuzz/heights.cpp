// SPDX-License-Identifier: Apache-2.0
// Height maps of strangers: PNG of 16 bits, EXR, raw numbers. The parsers of the first two run in a confined child process;
// here they are called in this one, where a fault of theirs is seen.

#include <algorithm>
#include <cmath>
#include <exception>
#include <string>

#include <fcntl.h>

#include "core/descriptor.h"
#include "render/image/exr_grid.h"
#include "render/terrain/height_file.h"
#include "render/terrain/height_parsers.h"
#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

constexpr int kColumns = 9, kRows = 7;  // of the raw seed

void check(int columns, int rows, const std::vector<float>& heights) {
    fuzz::require(columns >= 2 && rows >= 2 && columns <= kMostHeights && rows <= kMostHeights,
                  "2 to 4096 on a side");
    fuzz::require(heights.size() == std::size_t(columns) * std::size_t(rows),
                  "as many heights as the sides say");
}

// What a parser throws ends as an Error of the file; whatever is no std::exception ends the program.
template <class Parse>
void parse(const std::filesystem::path& path, const Parse& parser) {
    fuzz::accepts([&] {
        const Descriptor opened = open_regular_file(path, O_RDONLY);
        try {
            parser(opened.get());
        } catch (const std::exception& reason) {
            throw Error(ErrorCode::io, reason.what());
        }
    });
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const fuzz::Names names;
    const fuzz::InputFile file(fuzz::as_text(data, size));
    parse(file.path(), [](int fd) {
        const HeightImage image = parse_height_png(fd);
        check(image.columns, image.rows, image.heights);
        fuzz::require(std::ranges::all_of(image.heights, [](float z) { return z >= 0 && z <= 65535; }),
                      "16 bits each");
    });
    parse(file.path(), [](int fd) {
        const ExrGrid grid = parse_exr_grid(fd, kMostHeights);
        check(grid.columns, grid.rows, grid.values);
    });
    fuzz::accepts([&] {
        const HeightFile read = read_height_file(names.of(file, ".raw"), kColumns, kRows);
        fuzz::require(!read.metres && read.image.columns == kColumns && read.image.rows == kRows,
                      "the size it was given");
        check(read.image.columns, read.image.rows, read.image.heights);
    });
    return 0;
}
