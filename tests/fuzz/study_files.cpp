// SPDX-License-Identifier: Apache-2.0
// Files of sweeps and of fits.

#include "study/fit.h"
#include "study/sweep_file.h"
#include "tests/fuzz/target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    const fuzz::InputFile file(fuzz::as_text(data, size));
    fuzz::accepts([&] { read_sweep_file(file.path()); });
    fuzz::accepts([&] { read_fit_file(file.path()); });
    return 0;
}
