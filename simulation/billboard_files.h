// SPDX-License-Identifier: Apache-2.0
#pragma once

// Textures that base models take from files.

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "render/cloud/splats.h"
#include "scenes/format/scene.h"

namespace nephos {

// The files of all base models of a scene, each read once.
struct ModelTextures {
    std::map<std::string, std::int32_t> index;  // of a file's name in `pictures`
    std::shared_ptr<const BillboardPictures> pictures;

    // Returns the index of one of a model's textures by a random word; -1 for a model without.
    std::int32_t picture_of(const BaseModel& model, std::uint32_t word) const;
};

struct TextureFile {
    std::string file;
    std::string key;  // the first that names it: "model[0].textures[1]"
};

// Returns all these files, each once, in their order. Throws Error(usage) for more than kMostBillboardPictures.
std::vector<TextureFile> texture_files(const Scene& scene);

// Returns null when no model has any. Throws Error(io) with the key's place (simulation/scene_files.h) for a file that is no
// PNG with transparency (render/image/alpha_image.h), and as texture_files().
std::shared_ptr<const ModelTextures> read_textures(const Scene& scene);

}  // namespace nephos
