// SPDX-License-Identifier: Apache-2.0
#pragma once

// Reads an OpenVDB file and reports every stream error (not installed; for use inside a sandbox only).
// io::File does not check its stream: a truncated file yields uninitialised voxels. This archive reads the
// same format through OpenVDB's own code from a stream with exceptions enabled, without delayed loading, and
// checks offsets before it follows them.

#include <cstdint>
#include <ios>
#include <istream>
#include <string>
#include <vector>

#include <ext/stdio_filebuf.h>
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>

namespace nephos {

// An open file. OpenVDB 10.0.1 (bloscFromStream, unzipFromStream) reads as many bytes as a negative size of a chunk says
// into a buffer of another size, and compares afterwards: such a read is refused here. So is a chunk of Blosc whose head states
// another size than it has: Blosc reads as much, behind the buffer's end. A chunk is what goes to a block of memory behind a
// number of 8 bytes that went to the stack, its size: numbers of values and metadata go to blocks themselves. Inactive values of
// nodes, which go to the stack, too, are told by the byte before them, which says how many there are. Grids of
// points are not checked: their chunks have sizes of 2 and 4 bytes. Reading and seeking that the system refuses throw
// std::ios_base::failure with its error; a stream alone has a code of its own, the same as for a damaged file.
class CheckedBuffer : public __gnu_cxx::stdio_filebuf<char> {
  public:
    explicit CheckedBuffer(int fd);  // which it closes

    // Says that the functions that read from now on are called by one that has this frame: theirs are on the stack below it.
    void read_below(const void* frame) { frame_ = frame; }
    // Takes chunks for Blosc's where this is the data compression of the stream, and nodes for those of its format.
    void take_format_of(std::ios_base& stream) { stream_ = &stream; }

  protected:
    // Throws std::runtime_error where `to` is a block of memory that has no room, or what was read would be read beyond its end.
    std::streamsize xsgetn(char* to, std::streamsize size) override;
    pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode which) override;
    pos_type seekpos(pos_type position, std::ios_base::openmode which) override;

  private:
    bool has_blosc() const;
    void note_on_stack(const char* bytes, std::streamsize size);
    void forget_last();

    std::int64_t number_ = 0;  // of 8 bytes on the stack, if it was read last: the size of a chunk
    int inactive_values_ = 0;  // that a node has and that have not been read yet
    const void* frame_ = nullptr;
    std::ios_base* stream_ = nullptr;
};

class VdbArchive : public openvdb::io::Archive {
  public:
    // Reads everything but the voxels of an open file, which it closes. Throws a std::exception when it is damaged.
    explicit VdbArchive(int fd);

    struct Entry {
        openvdb::io::GridDescriptor descriptor;
        openvdb::GridBase::Ptr header;  // metadata and transform, no voxels
    };
    const std::vector<Entry>& entries() const { return entries_; }
    const openvdb::MetaMap& metadata() const { return metadata_; }
    // Returns the names of the grids and the types of their values, for messages: "`density` (float), `cld` (bool)", or "none".
    std::string names() const;

    // Reads and returns grid `n` of entries() with its voxels.
    openvdb::GridBase::Ptr read(std::size_t n);

  private:
    void read_offsets(std::int32_t count);
    void read_sequence(std::int32_t count);
    void check_offsets(const openvdb::io::GridDescriptor& descriptor) const;

    CheckedBuffer buffer_;
    std::istream stream_{nullptr};
    std::int64_t file_size_ = 0;
    openvdb::io::StreamMetadata::Ptr stream_metadata_;
    openvdb::MetaMap metadata_;
    std::vector<Entry> entries_;
    std::vector<openvdb::GridBase::Ptr> sequence_;  // all grids, when the file has no offsets
};

}  // namespace nephos
