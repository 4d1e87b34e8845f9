// SPDX-License-Identifier: Apache-2.0
// Lists grids and metadata of an OpenVDB file, for `nephos info`.

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <openvdb/openvdb.h>

#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_metadata.h"
#include "density/vdb/vdb_sandbox.h"

namespace nephos {
namespace {

using TextPairs = std::vector<std::pair<std::string, std::string>>;

void send_texts(const openvdb::MetaMap& map, SandboxWriter& writer) {
    writer.value(std::uint32_t(map.metaCount()));
    for (auto entry = map.beginMeta(); entry != map.endMeta(); ++entry) {  // a std::map: ordered by name
        writer.text(clamp_message(entry->first, kMaxMetadataText));
        writer.text(clamp_message(entry->second->str(), kMaxMetadataText));
    }
}

TextPairs receive_texts(SandboxReader& reader) {
    TextPairs texts;
    for (auto left = reader.value<std::uint32_t>(); left > 0; --left) {
        std::string name = reader.text();
        texts.emplace_back(std::move(name), reader.text());
    }
    return texts;
}

// Sends active bounds and count, from the file's metadata or else from the voxels.
void send_size(VdbArchive& archive, std::size_t n, SandboxWriter& writer) {
    const openvdb::GridBase& header = *archive.entries()[n].header;
    const auto low = meta_value<openvdb::Vec3i>(header, openvdb::GridBase::META_FILE_BBOX_MIN);
    const auto high = meta_value<openvdb::Vec3i>(header, openvdb::GridBase::META_FILE_BBOX_MAX);
    const auto stated = meta_value<std::int64_t>(header, openvdb::GridBase::META_FILE_VOXEL_COUNT);
    VoxelBox box;
    std::uint64_t voxels = 0;
    if (low && high && stated) {
        box = {{(*low)[0], (*low)[1], (*low)[2]}, {(*high)[0], (*high)[1], (*high)[2]}};
        voxels = std::uint64_t(*stated);
    } else {
        const auto grid = archive.read(n);
        voxels = grid->activeVoxelCount();
        const openvdb::CoordBBox active = grid->evalActiveVoxelBoundingBox();
        if (voxels > 0) {
            box = {{active.min().x(), active.min().y(), active.min().z()},
                   {active.max().x(), active.max().y(), active.max().z()}};
        }
    }
    writer.value(box);
    writer.value(voxels);
}

void send_info(VdbArchive& archive, SandboxWriter& writer) {
    writer.text(archive.version());
    writer.value(std::uint32_t(archive.entries().size()));
    for (std::size_t n = 0; n < archive.entries().size(); ++n) {
        const auto& [descriptor, header] = archive.entries()[n];
        const bool half = descriptor.saveFloatAsHalf();
        const std::string type = header->valueType();
        writer.text(clamp_message(descriptor.gridName()));
        writer.text(clamp_message(!half ? type : type == "float" ? "half" : type + " as half"));
        writer.text(openvdb::GridBase::gridClassToString(header->getGridClass()));
        const openvdb::Vec3d size = header->transform().voxelSize();
        writer.value(Vec3{size.x(), size.y(), size.z()});
        send_size(archive, n, writer);
        send_texts(*header, writer);
    }
    send_texts(archive.metadata(), writer);
}

VdbInfo receive_info(SandboxReader& reader) {
    VdbInfo info;
    info.file_version = reader.text();
    for (auto left = reader.value<std::uint32_t>(); left > 0; --left) {
        VdbGridInfo grid;
        grid.name = reader.text();
        grid.type = reader.text();
        grid.grid_class = reader.text();
        grid.voxel_size = reader.value<Vec3>();
        grid.active_box = reader.value<VoxelBox>();
        grid.active_voxels = reader.value<std::uint64_t>();
        grid.metadata = receive_texts(reader);
        info.grids.push_back(std::move(grid));
    }
    info.metadata = receive_texts(reader);
    return info;
}

}  // namespace

VdbInfo read_vdb_info(const std::filesystem::path& path, const VdbReadLimits& limits) {
    VdbInfo info;
    in_sandbox(
        path, limits, [&](VdbArchive& archive, SandboxWriter& writer) { send_info(archive, writer); },
        [&](SandboxReader& reader) { info = receive_info(reader); });
    return info;
}

}  // namespace nephos
