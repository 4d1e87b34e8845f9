// SPDX-License-Identifier: Apache-2.0
// Cloud masks of strangers: pictures, and NetCDF variables with their times and missing values.

#include "study/cloud_mask.h"

#include "tests/fuzz/target.h"

using namespace nephos;

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const fuzz::Names names;
    const fuzz::InputFile file(fuzz::as_text(data, size));
    MaskOptions options;
    options.cell_size_m = 100;
    for (const char* extension : {".png", ".nc"}) {
        fuzz::accepts([&] {
            const CloudMasks masks = read_masks({names.of(file, extension)}, options);
            fuzz::require(!masks.snapshots.empty(), "a mask has a snapshot");
            const Extent extent = masks.snapshots.front().extent();
            if (extent.cells() > 10000) return;  // time
            const MaskStatistics statistics = mask_statistics(masks);
            const double cover = statistics.statistics[statistic_index("cover")].mean;
            fuzz::require(cover >= 0 && cover <= 1, "a cover of 0 to 1");
        });
    }
    return 0;
}
