// SPDX-License-Identifier: Apache-2.0
#include "density/voxel_digest.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>

#include "core/digest.h"
#include "density/openvdb_access.h"

namespace nephos {

std::string voxel_digest(const DensityGrid& density, bool half) {
    const Extent extent = density.extent();
    Digest digest;
    const std::array<std::int32_t, 3> size{extent.x, extent.y, extent.z};
    digest.add(std::as_bytes(std::span(size)));
    std::array<float, kBlockVoxels> values;
    for (const Block& block : blocks_of(density)) {
        const openvdb::Coord& o = block.origin;
        const std::array<std::int32_t, 3> origin{o.x(), o.y(), o.z()};
        const bool whole =
            o.x() + kBlock <= extent.x && o.y() + kBlock <= extent.y && o.z() + kBlock <= extent.z;
        if (whole && !half && block.leaf) {  // nearly all: their values are those of the checksum as they are
            if (block.positive_count() == 0) continue;
            digest.add(std::as_bytes(std::span(origin)));
            digest.add(std::as_bytes(std::span(block.leaf->buffer().data(), kBlockVoxels)));
            continue;
        }
        bool any = false;
        for (int n = 0; n < kBlockVoxels; ++n) {
            const bool inside =
                o.x() + (n >> 6) < extent.x && o.y() + (n >> 3 & 7) < extent.y && o.z() + (n & 7) < extent.z;
            float value = inside ? std::max(block.value(n), 0.0f) : 0.0f;
            if (half) value = float(openvdb::math::half(value));
            values[std::size_t(n)] = value;
            any = any || value > 0;
        }
        if (!any) continue;
        digest.add(std::as_bytes(std::span(origin)));
        digest.add(std::as_bytes(std::span(values)));
    }
    return digest.hex();
}

}  // namespace nephos
