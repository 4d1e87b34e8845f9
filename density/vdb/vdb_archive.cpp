// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_archive.h"

#include <stdexcept>

namespace nephos {

using openvdb::GridBase;
using openvdb::io::GridDescriptor;

VdbArchive::VdbArchive(const std::filesystem::path& path)
    : stream_metadata_(new openvdb::io::StreamMetadata) {
    file_size_ = std::int64_t(std::filesystem::file_size(path));
    stream_.open(path, std::ios::binary);
    if (!stream_) throw std::runtime_error("it cannot be opened");
    stream_.exceptions(std::ios::badbit | std::ios::failbit);
    readHeader(stream_);
    openvdb::io::setStreamMetadataPtr(stream_, stream_metadata_, false);
    setFormatVersion(stream_);
    setLibraryVersion(stream_);
    setDataCompression(stream_);
    metadata_.readMeta(stream_);
    const std::int32_t count = readGridCount(stream_);
    // A descriptor takes at least its two lengths of text, one flag and three offsets.
    if (count < 0 || count > file_size_ / 32) {
        throw std::runtime_error("it is damaged: " + std::to_string(count) + " grids cannot be in it");
    }
    if (inputHasGridOffsets()) {
        read_offsets(count);
    } else {
        read_sequence(count);
    }
}

void VdbArchive::check_offsets(const GridDescriptor& descriptor) const {
    const std::int64_t grid = descriptor.getGridPos(), end = descriptor.getEndPos();
    const std::int64_t blocks = descriptor.isInstance() ? grid : descriptor.getBlockPos();
    if (grid <= 0 || grid > blocks || blocks > end) {
        throw std::runtime_error("it is damaged: grid `" + descriptor.gridName() +
                                 "` has impossible offsets");
    }
    if (end > file_size_) {
        throw std::runtime_error("it is truncated: grid `" + descriptor.gridName() + "` ends at byte " +
                                 std::to_string(end) + " of " + std::to_string(file_size_));
    }
}

void VdbArchive::read_offsets(std::int32_t count) {
    for (std::int32_t n = 0; n < count; ++n) {
        GridDescriptor descriptor;
        const GridBase::Ptr header = descriptor.read(stream_);
        check_offsets(descriptor);
        descriptor.seekToGrid(stream_);
        readGridCompression(stream_);
        header->readMeta(stream_);
        header->readTransform(stream_);
        descriptor.seekToEnd(stream_);
        entries_.push_back({descriptor, header});
    }
}

void VdbArchive::read_sequence(std::int32_t count) {
    NamedGridMap by_name;
    for (std::int32_t n = 0; n < count; ++n) {
        GridDescriptor descriptor;
        const GridBase::Ptr grid = descriptor.read(stream_);
        readGrid(grid, descriptor, stream_);
        by_name[descriptor.uniqueName()] = grid;
        connectInstance(descriptor, by_name);
        entries_.push_back({descriptor, grid});
        sequence_.push_back(grid);
    }
}

GridBase::Ptr VdbArchive::read(std::size_t n) {
    if (!sequence_.empty()) return sequence_.at(n);
    const GridDescriptor& descriptor = entries_.at(n).descriptor;
    const GridBase::Ptr grid = entries_[n].header->copyGridWithNewTree();
    grid->clearMetadata();
    descriptor.seekToGrid(stream_);
    readGrid(grid, descriptor, stream_);
    if (!descriptor.isInstance()) return grid;
    for (std::size_t parent = 0; parent < entries_.size(); ++parent) {
        const GridDescriptor& candidate = entries_[parent].descriptor;
        if (candidate.uniqueName() != descriptor.instanceParentName() || candidate.isInstance()) continue;
        grid->setTree(read(parent)->baseTreePtr());
        return grid;
    }
    throw std::runtime_error("it is damaged: grid `" + descriptor.gridName() +
                             "` shares the voxels of a grid that is missing");
}

}  // namespace nephos
