// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_archive.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include <malloc.h>
#include <openvdb/io/Compression.h>
#include <openvdb/io/DelayedLoadMetadata.h>
#include <unistd.h>

#include "density/vdb/sanitized.h"
#include "density/vdb/serial_tree.h"

namespace nephos {

using openvdb::GridBase;
using openvdb::io::GridDescriptor;

namespace {

using FileBuffer = __gnu_cxx::stdio_filebuf<char>;

// Passes on where a seek has led. A place that no file has is not the system's failure but the file's.
std::streampos checked(std::streampos position) {
    if (position == std::streampos(std::streamoff(-1)) && errno != 0 && errno != EINVAL && errno != EOVERFLOW)
        throw std::ios_base::failure("cannot seek", std::error_code(errno, std::generic_category()));
    return position;
}

// Returns the size of an open file, and goes to its beginning.
std::int64_t size_from_beginning(int fd) {
    const off_t size = ::lseek(fd, 0, SEEK_END);
    if (size < 0 || ::lseek(fd, 0, SEEK_SET) != 0)
        throw std::runtime_error(std::string("cannot read: ") + std::strerror(errno));
    return std::int64_t(size);
}

// Throws std::runtime_error where a chunk of Blosc has no whole head, which Blosc reads before it looks at the version, or
// states another size than it has. Blosc takes no version but its own.
void check_blosc(std::string_view chunk) {
    constexpr std::size_t kHead = 16, kSize = 12;
    constexpr char kVersion = 2;
    if (chunk.empty() || (chunk.size() >= kHead && chunk[0] != kVersion)) return;
    std::uint32_t size = 0;
    if (chunk.size() >= kHead) std::memcpy(&size, chunk.data() + kSize, sizeof size);
    if (size != chunk.size())
        throw std::runtime_error("it is damaged: a chunk of " + std::to_string(chunk.size()) +
                                 " bytes states another size");
}

// Returns how many inactive values follow the byte with which the values of a node begin.
int inactive_values(char node) {
    if (node == openvdb::io::MASK_AND_TWO_INACTIVE_VALS) return 2;
    return node == openvdb::io::NO_MASK_AND_ONE_INACTIVE_VAL || node == openvdb::io::MASK_AND_ONE_INACTIVE_VAL
               ? 1
               : 0;
}

// Returns whether memory lies on the stack between two frames.
bool is_between(const void* last_frame, const void* memory, const void* first_frame) {
    const auto place = [](const void* at) { return reinterpret_cast<std::uintptr_t>(at); };
    return place(last_frame) <= place(memory) && place(memory) < place(first_frame);
}

}  // namespace

CheckedBuffer::CheckedBuffer(int fd) : FileBuffer(fd, std::ios::in | std::ios::binary) {
    if (!is_open()) throw std::runtime_error(std::string("cannot read: ") + std::strerror(errno));
}

std::streamsize CheckedBuffer::xsgetn(char* to, std::streamsize size) {
    const bool is_on_stack = is_between(__builtin_frame_address(0), to, frame_);
    // Where such a size precedes, OpenVDB passes the beginning of the block that it has allocated for the voxels. All
    // blocks of glibc have room for 24 bytes.
    constexpr std::streamsize kLeastBlock = NEPHOS_SANITIZED ? 0 : 24;
    const bool is_negated =
        number_ < 0 && number_ != std::numeric_limits<std::int64_t>::min() && size == -number_;
    if (!is_on_stack && is_negated && size > kLeastBlock && ::malloc_usable_size(to) < std::size_t(size))
        throw std::runtime_error("it is damaged: a chunk of " + std::to_string(size) + " bytes where fewer belong");
    // The mask of a node goes to a block right before the byte that tells of its inactive values, and nothing between that and
    // them does: what lies elsewhere, such as the flag of a tile, told of none.
    if (!is_on_stack) inactive_values_ = 0;
    const std::streamsize got = FileBuffer::xsgetn(to, size);
    if (!is_on_stack && number_ == size && got == size && has_blosc()) check_blosc({to, std::size_t(size)});
    number_ = 0;
    if (is_on_stack && got == size) note_on_stack(to, size);
    return got;
}

void CheckedBuffer::note_on_stack(const char* bytes, std::streamsize size) {
    if (inactive_values_ > 0) {
        --inactive_values_;
    } else if (size == 1) {
        const bool has_them = stream_ != nullptr && openvdb::io::getFormatVersion(*stream_) >=
                                                        openvdb::OPENVDB_FILE_VERSION_NODE_MASK_COMPRESSION;
        inactive_values_ = has_them ? inactive_values(*bytes) : 0;
    } else if (size == sizeof number_) {
        std::memcpy(&number_, bytes, sizeof number_);
    }
}

void CheckedBuffer::forget_last() {
    errno = 0;
    number_ = 0;
    inactive_values_ = 0;
}

CheckedBuffer::pos_type CheckedBuffer::seekoff(off_type offset, std::ios_base::seekdir from,
                                               std::ios_base::openmode which) {
    forget_last();
    return checked(FileBuffer::seekoff(offset, from, which));
}

CheckedBuffer::pos_type CheckedBuffer::seekpos(pos_type position, std::ios_base::openmode which) {
    forget_last();
    return checked(FileBuffer::seekpos(position, which));
}

bool CheckedBuffer::has_blosc() const {
    return stream_ != nullptr &&
           (openvdb::io::getDataCompression(*stream_) & openvdb::io::COMPRESS_BLOSC) != 0;
}

VdbArchive::VdbArchive(int fd) : buffer_(fd), stream_(&buffer_), stream_metadata_(new openvdb::io::StreamMetadata) {
    file_size_ = size_from_beginning(fd);
    buffer_.read_below(__builtin_frame_address(0));
    buffer_.take_format_of(stream_);
    stream_.exceptions(std::ios::badbit | std::ios::failbit);
    // Skips what is of use to delayed loading alone, and which Blosc unpacks from whatever size its text states.
    openvdb::Metadata::unregisterType(openvdb::io::DelayedLoadMetadata::staticTypeName());
    readHeader(stream_);
    openvdb::io::setStreamMetadataPtr(stream_, stream_metadata_, false);
    // Before it, transforms stand behind the topology; two versions earlier tiles of 8 bytes stand before masks one by one, and would
    // be taken for sizes of chunks.
    constexpr std::uint32_t kOldest = openvdb::OPENVDB_FILE_VERSION_GRID_INSTANCING;
    if (fileVersion() < kOldest)
        throw std::runtime_error("its format has version " + std::to_string(fileVersion()) +
                                 "; expected at least " + std::to_string(kOldest));
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
        header->removeMeta(GridBase::META_FILE_DELAYED_LOAD);
        header->readTransform(stream_);
        descriptor.seekToEnd(stream_);
        entries_.push_back({descriptor, header});
    }
}

void VdbArchive::read_sequence(std::int32_t count) {
    NamedGridMap by_name;
    for (std::int32_t n = 0; n < count; ++n) {
        GridDescriptor descriptor;
        const GridBase::Ptr grid = freed_serially(descriptor.read(stream_));
        readGrid(grid, descriptor, stream_);
        by_name[descriptor.uniqueName()] = grid;
        connectInstance(descriptor, by_name);
        entries_.push_back({descriptor, grid});
        sequence_.push_back(grid);
    }
}

std::string VdbArchive::names() const {
    std::string names;
    for (const Entry& entry : entries_)
        names += (names.empty() ? "`" : ", `") + entry.descriptor.gridName() + "` (" +
                 entry.header->valueType() + ")";
    return names.empty() ? "none" : names;
}

GridBase::Ptr VdbArchive::read(std::size_t n) {
    if (!sequence_.empty()) return sequence_.at(n);
    buffer_.read_below(__builtin_frame_address(0));
    const GridDescriptor& descriptor = entries_.at(n).descriptor;
    const GridBase::Ptr grid = freed_serially(entries_[n].header->copyGridWithNewTree());
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
