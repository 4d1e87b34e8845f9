// SPDX-License-Identifier: Apache-2.0
// When voxels are drawn together as one larger metaball.

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"

namespace nephos {

using namespace schema_build;

const Section& level_of_detail_section() {
    static const Section section{
        "Level of detail",
        "Blocks of 2 x 2 x 2, 4 x 4 x 4 and 8 x 8 x 8 voxels that are drawn as one metaball with the same "
        "optical mass where that hardly shows.",
        {key<&Scene::render, &RenderOptions::level_of_detail, &LevelOfDetailOptions::pixels>(
            "pixels", "pixels", between(0, 1000),
            "Radius in the picture at which metaballs are drawn as one if their optical depths spread by "
            "less "
            "than 1; at n times that radius they must spread n^2 times less. Larger is faster and softer, 0: "
            "every voxel is drawn for itself.",
            "D, S: voxels far away larger, fewer metaballs")},
        nullptr};
    return section;
}

}  // namespace nephos
