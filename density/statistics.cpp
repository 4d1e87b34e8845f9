// SPDX-License-Identifier: Apache-2.0
#include "density/statistics.h"

#include "density/openvdb_access.h"

namespace nephos {

CloudStatistics cloud_statistics(const DensityGrid& density) {
    const Extent extent = density.extent();
    BitPlane cld(extent);
    for (const Block& block : blocks_of(density)) {
        for (int n = 0; n < kBlockVoxels; ++n) {
            if (!(block.value(n) > 0)) continue;
            const openvdb::Coord& o = block.origin;
            const int x = o.x() + (n >> 6), y = o.y() + (n >> 3 & 7), z = o.z() + (n & 7);
            if (x >= extent.x || y >= extent.y || z >= extent.z) continue;  // a whole block beyond the box
            cld.set(x, y, z, true);
        }
    }
    CloudStatistics result = cloud_statistics(count_cloud(cld.view(), {}), density.placement());
    result.mean_density = density.sum() / double(extent.cells());
    return result;
}

}  // namespace nephos
