// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain.h"

#include "render/terrain/height_file.h"
#include "render/terrain/relief.h"

namespace nephos {

std::shared_ptr<const HeightMap> make_terrain(const TerrainOptions& options, const Ground& ground) {
    if (!options.any()) return nullptr;
    HeightImage image;
    double scale = options.height_scale_m;
    if (options.height_map) {
        HeightFile file = read_height_file(*options.height_map, options.raw_columns, options.raw_rows);
        image = std::move(file.image);
        scale = file.metres ? 1 : scale / 65535;
    } else {
        image = relief_heights(options);
    }
    for (float& z : image.heights) z = float(options.offset_m + scale * double(z));
    return std::make_shared<const HeightMap>(height_map(image, options, ground.height_m));
}

}  // namespace nephos
