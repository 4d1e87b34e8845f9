// SPDX-License-Identifier: Apache-2.0
// Scene texts: read, or refused with places; what was read is written as text that reads back as the same scene.

#include "scenes/format/reader.h"
#include "scenes/format/writer.h"
#include "tests/fuzz/target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    fuzz::accepts([&] {
        const Scene scene = read_scene_text(fuzz::as_text(data, size), "input");
        const std::string text = to_toml(scene);
        fuzz::require(to_toml(read_scene_text(text, "written")) == text, "a written scene reads back");
    });
    return 0;
}
