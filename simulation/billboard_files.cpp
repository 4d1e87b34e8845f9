// SPDX-License-Identifier: Apache-2.0
#include "simulation/billboard_files.h"

#include <algorithm>

#include "core/error.h"
#include "render/image/alpha_image.h"

namespace nephos {

std::int32_t ModelTextures::picture_of(const BaseModel& model, std::uint32_t word) const {
    if (model.textures.empty()) return -1;
    return index.at(model.textures[word % model.textures.size()]);
}

std::vector<std::string> texture_files(std::span<const BaseModel> models) {
    std::vector<std::string> files;
    for (const BaseModel& model : models) {
        for (const std::string& file : model.textures)
            if (std::ranges::find(files, file) == files.end()) files.push_back(file);
    }
    return files;
}

std::shared_ptr<const ModelTextures> read_textures(std::span<const BaseModel> models) {
    const std::vector<std::string> files = texture_files(models);
    if (files.empty()) return nullptr;
    if (files.size() > kMostBillboardPictures) {
        throw Error(ErrorCode::usage, "the base models have " + std::to_string(files.size()) +
                                          " textures from files; expected at most " +
                                          std::to_string(kMostBillboardPictures));
    }
    auto textures = std::make_shared<ModelTextures>();
    std::vector<AlphaImage> images;
    for (const std::string& file : files) {
        textures->index[file] = std::int32_t(images.size());
        images.push_back(read_alpha_image(file));
    }
    textures->pictures = billboard_pictures(images);
    return textures;
}

}  // namespace nephos
