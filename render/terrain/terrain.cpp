// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/terrain.h"

#include <algorithm>
#include <mutex>
#include <vector>

#include "render/options/height_format.h"
#include "render/terrain/height_file.h"
#include "render/terrain/relief.h"

namespace nephos {
namespace {

// A terrain that was generated and is in use.
struct Generated {
    TerrainOptions options;
    double ground_m = 0;
    std::weak_ptr<const HeightMap> map;
};

std::shared_ptr<const HeightMap> terrain_of(HeightImage&& image, double scale, const TerrainOptions& options,
                                            double ground_m) {
    for (float& z : image.heights) z = float(options.offset_m + scale * double(z));
    return std::make_shared<const HeightMap>(height_map(image, options, ground_m));
}

}  // namespace

std::shared_ptr<const HeightMap> make_terrain(const TerrainOptions& options, const Ground& ground) {
    if (!options.any()) return nullptr;
    check(options);
    if (options.height_map) {
        HeightFile file = read_height_file(*options.height_map, options.raw_columns, options.raw_rows);
        const double scale = file.metres ? 1 : options.height_scale_m / 65535;
        return terrain_of(std::move(file.image), scale, options, ground.height_m);
    }
    // Generating takes seconds: painters of one scene share what one of them has. The lock is held meanwhile, so that two
    // that begin together do not both generate it.
    static std::mutex mutex;
    static std::vector<Generated> in_use;
    const std::scoped_lock lock(mutex);
    std::erase_if(in_use, [](const Generated& one) { return one.map.expired(); });
    for (const Generated& one : in_use) {
        if (!(one.options == options) || one.ground_m != ground.height_m) continue;
        if (std::shared_ptr<const HeightMap> map = one.map.lock()) return map;
    }
    std::shared_ptr<const HeightMap> map =
        terrain_of(relief_heights(options), options.height_scale_m, options, ground.height_m);
    in_use.push_back({options, ground.height_m, map});
    return map;
}

}  // namespace nephos
