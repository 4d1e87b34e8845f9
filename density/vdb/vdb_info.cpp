// SPDX-License-Identifier: Apache-2.0
// Lists grids and metadata of an OpenVDB file, for `nephos info` and `nephos verify`.

#include "density/vdb/vdb_info.h"

#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "density/vdb/serial_tree.h"
#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_metadata.h"
#include "density/vdb/vdb_sandbox.h"

namespace nephos {
namespace {

using Entries = std::vector<VdbMetadataEntry>;

// The numbers as JSON lists them; nullopt when one of them is none there, as infinity.
template <class T>
std::optional<std::string> numbers_json(const T* numbers, int count) {
    std::string text;
    for (int n = 0; n < count; ++n) {
        if (!std::isfinite(double(numbers[n]))) return std::nullopt;
        text += n == 0 ? "" : ", ";
        // The shortest text that reads back as the same number of its own type.
        char digits[64];
        const auto [end, error] = std::to_chars(digits, digits + sizeof digits, numbers[n]);
        text.append(digits, end);
    }
    return text;
}

template <class T>
std::optional<std::string> number_json(const openvdb::Metadata& value) {
    const auto* typed = dynamic_cast<const openvdb::TypedMetadata<T>*>(&value);
    return typed ? numbers_json(&typed->value(), 1) : std::nullopt;
}

// Of vectors and matrices, whose numbers stand one after the other.
template <class T>
std::optional<std::string> list_json(const openvdb::Metadata& value) {
    const auto* typed = dynamic_cast<const openvdb::TypedMetadata<T>*>(&value);
    if (!typed) return std::nullopt;
    const T vector = typed->value();
    const auto list = numbers_json(vector.asPointer(), int(sizeof(T) / sizeof(*vector.asPointer())));
    return list ? std::optional("[" + *list + "]") : std::nullopt;
}

VdbMetadataEntry entry_of(const std::string& name, const openvdb::Metadata& value) {
    if (const auto* truth = dynamic_cast<const openvdb::BoolMetadata*>(&value))
        return {name, truth->value() ? "true" : "false", true};
    for (const auto& text :
         {number_json<double>(value), number_json<float>(value), number_json<std::int32_t>(value),
          number_json<std::int64_t>(value), list_json<openvdb::Vec2i>(value), list_json<openvdb::Vec2s>(value),
          list_json<openvdb::Vec2d>(value), list_json<openvdb::Vec3i>(value), list_json<openvdb::Vec3s>(value),
          list_json<openvdb::Vec3d>(value), list_json<openvdb::Mat4s>(value), list_json<openvdb::Mat4d>(value)}) {
        if (text) return {name, *text, true};
    }
    return {name, value.str(), false};
}

void send_entries(const openvdb::MetaMap& map, SandboxWriter& writer) {
    writer.value(std::uint32_t(map.metaCount()));
    for (auto at = map.beginMeta(); at != map.endMeta(); ++at) {  // a std::map: ordered by name
        const VdbMetadataEntry entry = entry_of(at->first, *at->second);
        writer.text(clamp_text(entry.name, kMaxMetadataText));
        writer.text(clamp_text(entry.value, kMaxMetadataText));
        writer.value(std::uint8_t(entry.is_json));
    }
}

Entries receive_entries(SandboxReader& reader) {
    Entries entries;
    for (auto left = reader.value<std::uint32_t>(); left > 0; --left) {
        VdbMetadataEntry entry;
        entry.name = reader.text();
        entry.value = reader.text();
        entry.is_json = reader.value<std::uint8_t>() != 0;
        entries.push_back(std::move(entry));
    }
    return entries;
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
        const auto count = [&](const auto& typed) { voxels = count_active(typed.tree()); };
        if (!grid->apply<openvdb::GridTypes>(count)) voxels = grid->activeVoxelCount();
        const openvdb::CoordBBox active = grid->evalActiveVoxelBoundingBox();
        if (voxels > 0) {
            box = {{active.min().x(), active.min().y(), active.min().z()},
                   {active.max().x(), active.max().y(), active.max().z()}};
        }
    }
    writer.value(box);
    writer.value(voxels);
}

// The affine part of a transform; of a frustum, which is none, that at its origin.
Matrix4 world_from_index(const openvdb::math::Transform& transform) {
    const openvdb::Vec3d origin = transform.indexToWorld(openvdb::Vec3d(0.0));
    Matrix4 m{};
    for (int axis = 0; axis < 3; ++axis) {
        openvdb::Vec3d unit(0.0);
        unit[axis] = 1;
        const openvdb::Vec3d column = transform.indexToWorld(unit) - origin;
        for (int row = 0; row < 3; ++row) m[std::size_t(4 * row + axis)] = column[row];
        m[std::size_t(4 * axis + 3)] = origin[axis];
    }
    m[15] = 1;
    return m;
}

}  // namespace

void send_info(VdbArchive& archive, SandboxWriter& writer) {
    writer.text(archive.version());
    writer.value(std::uint32_t(archive.entries().size()));
    for (std::size_t n = 0; n < archive.entries().size(); ++n) {
        const auto& [descriptor, header] = archive.entries()[n];
        const bool half = descriptor.saveFloatAsHalf();
        const std::string type = header->valueType();
        writer.text(clamp_text(descriptor.gridName()));
        writer.text(clamp_message(!half ? type : type == "float" ? "half" : type + " as half"));
        writer.text(openvdb::GridBase::gridClassToString(header->getGridClass()));
        const openvdb::Vec3d size = header->transform().voxelSize();
        writer.value(Vec3{size.x(), size.y(), size.z()});
        writer.value(world_from_index(header->transform()));
        send_size(archive, n, writer);
        send_entries(*header, writer);
    }
    send_entries(archive.metadata(), writer);
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
        grid.world_from_index = reader.value<Matrix4>();
        grid.active_box = reader.value<VoxelBox>();
        grid.active_voxels = reader.value<std::uint64_t>();
        grid.metadata = receive_entries(reader);
        info.grids.push_back(std::move(grid));
    }
    info.metadata = receive_entries(reader);
    return info;
}

VdbInfo read_vdb_info(const std::filesystem::path& path, const VdbReadLimits& limits) {
    VdbInfo info;
    in_sandbox(
        path, limits, [&](VdbArchive& archive, SandboxWriter& writer) { send_info(archive, writer); },
        [&](SandboxReader& reader) { info = receive_info(reader); });
    return info;
}

}  // namespace nephos
