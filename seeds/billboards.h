// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's billboards: scattered in the boxes of a cloud, for pictures of clouds without an automaton.

#include <cstdint>
#include <vector>

#include "seeds/cloud.h"
#include "seeds/model.h"

namespace nephos {

struct Billboard {
    Vec3 centre_m{};  // model space; uniform in its box
    double width_m = 0, height_m = 0;
    std::uint32_t box = 0;  // index in Cloud::boxes: its absorbed light, its phase
    BillboardTexture texture = BillboardTexture::soft;
    std::uint32_t variant = 0;  // random word: which of the texture's pictures, which turn
    bool operator==(const Billboard&) const = default;
};

// All billboards of the cloud that reproduce() made from the same arguments, box by box; a pure function.
std::vector<Billboard> scatter_billboards(const BaseModel& model, const Cloud& cloud,
                                          std::uint64_t scene_seed, std::uint32_t model_index,
                                          std::uint32_t number);

}  // namespace nephos
