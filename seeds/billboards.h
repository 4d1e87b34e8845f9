// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's billboards: textured sprites scattered in the boxes of a cloud, to render clouds without an automaton.

#include <cstdint>
#include <vector>

#include "seeds/cloud.h"
#include "seeds/model.h"

namespace nephos {

// One sprite that faces the camera.
struct Billboard {
    Vec3 centre_m{};  // model space; uniform in its box
    double width_m = 0, height_m = 0;
    std::uint32_t box = 0;  // index in Cloud::boxes, whose absorbed light and phase it has
    BillboardTexture texture = BillboardTexture::soft;
    std::uint32_t variant = 0;  // random word that selects the texture's variant and its rotation
    bool operator==(const Billboard&) const = default;
};

// Returns all billboards, box by box, of the cloud that reproduce() makes from the same arguments. Pure.
std::vector<Billboard> scatter_billboards(const BaseModel& model, const Cloud& cloud,
                                          std::uint64_t scene_seed, std::uint32_t model_index,
                                          std::uint32_t number);

}  // namespace nephos
