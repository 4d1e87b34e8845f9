// SPDX-License-Identifier: Apache-2.0
// Writes the generated descriptions of the scene format into the source tree, whose root is the only
// argument.

#include <cstdio>

#include "core/atomic_file.h"
#include "core/error.h"
#include "scenes/format/describe.h"

int main(int count, char** arguments) {
    if (count != 2) {
        std::fputs("usage: scene_descriptions SOURCE_ROOT\n", stderr);
        return 2;
    }
    const std::filesystem::path root = arguments[1];
    try {
        nephos::write_atomically(root / "scenes/nephos.schema.json", nephos::scene_json_schema());
        nephos::write_atomically(root / "docs/scene-reference.md", nephos::scene_reference());
    } catch (const nephos::Error& error) {
        std::fprintf(stderr, "error: %s\n", error.what());
        return int(error.code());
    }
    return 0;
}
