// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/block_stream.h"

#include <cmath>
#include <span>
#include <stdexcept>

namespace nephos {
namespace {

using openvdb::Coord;

void send_head(SandboxWriter& writer, Record record, const Coord& origin) {
    writer.value(record);
    for (int a = 0; a < 3; ++a) writer.value(std::int32_t(origin[a]));
}

void check(std::span<const float> values) {
    for (const float value : values)
        if (!(value >= 0 && std::isfinite(value))) throw std::runtime_error("the reading process sent an impossible density");
}

}  // namespace

void send_leaf(SandboxWriter& writer, const Coord& origin, const float* values) {
    send_head(writer, Record::leaf, origin);
    writer.bytes(values, kBlockVoxels * sizeof(float));
}

void send_tile(SandboxWriter& writer, const Coord& origin, float value) {
    send_head(writer, Record::tile, origin);
    writer.value(value);
}

Coord receive_origin(SandboxReader& reader, const Extent& extent) {
    const auto x = reader.value<std::int32_t>(), y = reader.value<std::int32_t>(),
               z = reader.value<std::int32_t>();
    const bool inside = x >= 0 && y >= 0 && z >= 0 && x < extent.x && y < extent.y && z < extent.z;
    if (!inside || ((x | y | z) & (kBlock - 1)) != 0)
        throw std::runtime_error("the reading process sent a misplaced block");
    return {x, y, z};
}

DensityGrid receive_blocks(SandboxReader& reader, const Extent& extent, const Placement& placement) {
    TreeBuilder builder;
    for (;;) {
        const auto record = reader.value<Record>();
        if (record == Record::end) break;
        const Coord origin = receive_origin(reader, extent);
        if (record == Record::tile) {
            const auto density = reader.value<float>();
            check({&density, 1});
            NewBlock{nullptr, density}.move_to(builder, origin);
            continue;
        }
        auto leaf = uninitialised_leaf(origin);
        reader.bytes(leaf->buffer().data(), kBlockVoxels * sizeof(float));
        check({leaf->buffer().data(), kBlockVoxels});
        NewBlock::from(std::move(leaf)).move_to(builder, origin);
    }
    return builder.finish(extent, placement);
}

}  // namespace nephos
