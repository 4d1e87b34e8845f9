// SPDX-License-Identifier: Apache-2.0
// Cloud masks of strangers: pictures, and NetCDF variables with their times and missing values.

#include "study/cloud_mask.h"

#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

// Names that end as the reader wants them, for one file in memory after the other.
class Names {
  public:
    Names() {
        char name[] = "/tmp/nephos-fuzz-XXXXXX";
        fuzz::require(mkdtemp(name) != nullptr, "mkdtemp");
        folder_ = name;
    }
    ~Names() { std::filesystem::remove_all(folder_); }
    std::filesystem::path of(const std::filesystem::path& file, const char* extension) const {
        const std::filesystem::path link = folder_ / (std::string("input") + extension);
        std::filesystem::remove(link);
        std::filesystem::create_symlink(file, link);
        return link;
    }

  private:
    std::filesystem::path folder_;
};

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    static const Names names;
    const fuzz::InputFile file(fuzz::as_text(data, size));
    MaskOptions options;
    options.cell_size_m = 100;
    for (const char* extension : {".png", ".nc"}) {
        fuzz::accepts([&] {
            const CloudMasks masks = read_masks({names.of(file.path(), extension)}, options);
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
