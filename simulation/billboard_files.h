// SPDX-License-Identifier: Apache-2.0
#pragma once

// Textures that base models take from files.

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "render/cloud/splats.h"
#include "seeds/model.h"

namespace nephos {

// The files of all base models of a scene, each read once.
struct ModelTextures {
    std::map<std::string, std::int32_t> index;  // of a file's name in `pictures`
    std::shared_ptr<const BillboardPictures> pictures;

    // Returns the index of one of a model's textures by a random word; -1 for a model without.
    std::int32_t picture_of(const BaseModel& model, std::uint32_t word) const;
};

// Returns the names of all these files, each once, in their order.
std::vector<std::string> texture_files(std::span<const BaseModel> models);

// Returns null when no model has any. Throws Error(io) naming a file that is no PNG with transparency
// (render/image/alpha_image.h), Error(usage) for more than kMostBillboardPictures.
std::shared_ptr<const ModelTextures> read_textures(std::span<const BaseModel> models);

}  // namespace nephos
