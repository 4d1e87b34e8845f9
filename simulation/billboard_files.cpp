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
    for (std::size_t n = 0; n < files.size(); ++n) textures->index[files[n]] = std::int32_t(n);
    textures->pictures =
        billboard_pictures(files.size(), [&](std::size_t n) { return read_alpha_image(files[n]); });
    return textures;
}

}  // namespace nephos
