// SPDX-License-Identifier: Apache-2.0
// Foreign NetCDF files.

#include "study/netcdf_file.h"
#include "tests/fuzz/target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    const fuzz::InputFile file(fuzz::as_text(data, size));
    fuzz::accepts([&] {
        const NetcdfData read = read_netcdf(file.path(), "");
        std::uint64_t values = 1;
        for (const std::uint64_t n : read.sizes) values *= n;
        fuzz::require(read.values.size() == values, "as many values as the dimensions say");
        fuzz::require(read.dimensions.size() == read.sizes.size(), "each dimension has a size");
    });
    fuzz::accepts([&] { read_netcdf(file.path(), "cloud_area_fraction"); });
    return 0;
}
