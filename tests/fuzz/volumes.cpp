// SPDX-License-Identifier: Apache-2.0
// Exported volumes, as `nephos verify` reads them.

#include "density/export/bricks.h"
#include "density/export/cloud_picture.h"
#include "density/export/containers.h"
#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

void check(const EncodedVolume& volume) {
    fuzz::require(!volume.levels.empty(), "a volume has a level");
    for (const VolumeLevel& level : volume.levels) {
        fuzz::require(level.nx > 0 && level.ny > 0 && level.nz > 0, "a level has voxels");
    }
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const fuzz::InputFile file(fuzz::as_text(data, size));
    fuzz::accepts([&] { check(read_dds(file.path())); });
    fuzz::accepts([&] { check(read_ktx2(file.path())); });
    fuzz::accepts([&] { check(read_vti(file.path())); });
    fuzz::accepts([&] { check(read_bricks(file.path())); });
    fuzz::accepts([&] { check(read_slices(file.path(), 4, 3, 3, 2)); });
    fuzz::accepts([&] { fuzz::require(read_cloud_picture(file.path()).side > 0, "a picture of a cloud has voxels"); });
    fuzz::accepts([&] { check(read_raw(file.path(), VoxelType::r8, 8, 4, 4, 3)); });
    return 0;
}
