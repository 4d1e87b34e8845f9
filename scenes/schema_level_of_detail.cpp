// SPDX-License-Identifier: Apache-2.0
// When voxels are drawn together as one larger metaball.

#include "scenes/schema_build.h"
#include "scenes/schema_sections.h"

namespace nephos {

using namespace schema_build;

namespace {

template <auto... Members>
Key detail_key(std::string name, std::string unit, Limits limits, std::string effect, std::string source) {
    return key<&Scene::render, &RenderOptions::level_of_detail, Members...>(
        std::move(name), std::move(unit), limits, std::move(effect), std::move(source));
}

}  // namespace

const Section& level_of_detail_section() {
    static const Section section{
        "Level of detail",
        "Blocks of 2 x 2 x 2, 4 x 4 x 4 and 8 x 8 x 8 voxels that are drawn as one metaball with the same "
        "optical mass where that hardly shows.",
        {detail_key<&LevelOfDetailOptions::contrast>("contrast", "optical depth", between(0, 10),
                                                     "Blocks whose metaballs differ by less are drawn as "
                                                     "one, near and far; larger is faster and softer, "
                                                     "0: every voxel is drawn for itself.",
                                                     "D, S: level of detail"),
         detail_key<&LevelOfDetailOptions::pixels>(
             "pixels", "pixels", between(0, 1000),
             "Metaballs whose radius in the picture is n times smaller than this may differ n^2 times as "
             "much; "
             "larger is faster and softer far away, 0: distance makes no difference.",
             "D, S: voxels far away larger, fewer metaballs")},
        nullptr};
    return section;
}

}  // namespace nephos
