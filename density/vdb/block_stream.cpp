// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/block_stream.h"

#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <unordered_set>

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

// Counts the nodes of the tree that blocks make. A tile of a few bytes in the stream takes a node of 34 KB where it lies
// alone in 128 x 128 x 128 voxels, and one of 270 KB more where it lies alone in 4096 x 4096 x 4096.
class NodeCount {
  public:
    explicit NodeCount(std::size_t most_bytes) : most_bytes_(most_bytes) {}

    // Throws std::runtime_error when the nodes take too much memory.
    void add(const Coord& origin) {
        const std::uint64_t lower = key(origin, Lower::TOTAL);
        if (lower == last_) return;
        last_ = lower;
        if (!lower_.insert(lower).second) return;
        bytes_ += sizeof(Lower);
        if (upper_.insert(key(origin, Upper::TOTAL)).second) bytes_ += sizeof(Upper);
        if (bytes_ > most_bytes_) throw std::runtime_error(too_large(most_bytes_));
    }

  private:
    using Upper = FloatTree::RootNodeType::ChildNodeType;
    using Lower = Upper::ChildNodeType;

    // Returns the key of the node of edge 2^bits around an origin, which lies in 0 .. 2^19.
    static std::uint64_t key(const Coord& origin, unsigned bits) {
        std::uint64_t key = 0;
        for (int a = 0; a < 3; ++a) key = key << 21 | std::uint64_t(origin[a] >> bits);
        return key;
    }

    std::size_t most_bytes_, bytes_ = 0;
    std::unordered_set<std::uint64_t> lower_, upper_;
    std::uint64_t last_ = ~std::uint64_t{0};
};

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
    NodeCount nodes(reader.memory_bytes());
    for (;;) {
        const auto record = reader.value<Record>();
        if (record == Record::end) break;
        const Coord origin = receive_origin(reader, extent);
        nodes.add(origin);
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
