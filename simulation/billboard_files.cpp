// SPDX-License-Identifier: Apache-2.0
#include "simulation/billboard_files.h"

#include <algorithm>

#include "core/error.h"
#include "render/image/alpha_image.h"
#include "scenes/format/text.h"
#include "simulation/scene_files.h"

namespace nephos {

std::int32_t ModelTextures::picture_of(const BaseModel& model, std::uint32_t word) const {
    if (model.textures.empty()) return -1;
    return index.at(model.textures[word % model.textures.size()]);
}

std::vector<TextureFile> texture_files(const Scene& scene) {
    std::vector<TextureFile> files;
    for (std::size_t m = 0; m < scene.models.size(); ++m) {
        const std::vector<std::string>& textures = scene.models[m].textures;
        for (std::size_t n = 0; n < textures.size(); ++n)
            if (std::ranges::find(files, textures[n], &TextureFile::file) == files.end())
                files.push_back({textures[n], key_of_file(scene, indexed("model", m) + ".textures", n)});
    }
    if (files.size() <= kMostBillboardPictures) return files;
    throw Error(ErrorCode::usage, "the base models have " + std::to_string(files.size()) +
                                      " textures from files; expected at most " +
                                      std::to_string(kMostBillboardPictures));
}

std::shared_ptr<const ModelTextures> read_textures(const Scene& scene) {
    const std::vector<TextureFile> files = texture_files(scene);
    if (files.empty()) return nullptr;
    auto textures = std::make_shared<ModelTextures>();
    for (std::size_t n = 0; n < files.size(); ++n) textures->index[files[n].file] = std::int32_t(n);
    textures->pictures = billboard_pictures(files.size(), [&](std::size_t n) {
        return read_at_key(scene, files[n].key, [&] { return read_alpha_image(files[n].file); });
    });
    return textures;
}

}  // namespace nephos
