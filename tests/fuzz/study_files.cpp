// SPDX-License-Identifier: Apache-2.0
// Files of sweeps and of fits.

#include "study/fit.h"
#include "study/sweep_file.h"
#include "tests/fuzz/target.h"

namespace {

// Named by the files of inputs/.
constexpr const char* tiny_scene = R"(
[lattice]
cells = [32, 32, 8]
cell_size_m = 100
[time]
step_s = 10
steps = 10
[field.background]
ext = 0.1
)";

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    static const fuzz::Names names("tiny.toml", tiny_scene);
    const fuzz::InputFile file(fuzz::as_text(data, size));
    const std::filesystem::path path = names.of(file, ".toml");
    fuzz::accepts([&] { read_sweep_file(path); });
    fuzz::accepts([&] { read_fit_file(path); });
    return 0;
}
