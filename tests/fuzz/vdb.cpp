// SPDX-License-Identifier: Apache-2.0
// OpenVDB files as the confined process reads them, called in the open: the stream that checks sizes of chunks, the archive that
// checks offsets, metadata, and grids from the library's voxels to ours. OpenVDB, Blosc and zlib do here what they do there, within
// a limit of memory; of them only OpenVDB's templates are compiled with sanitizers. An input is a file in which each run of zeros
// is two bytes, as masks of nodes are nothing but zeros (unpacked(); tests/fuzz/pack_zeros.py writes it).

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <malloc.h>
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include "core/descriptor.h"
#include "core/digest.h"
#include "density/density_grid.h"
#include "density/metaballs.h"
#include "density/vdb/mask_file.h"
#include "density/vdb/vdb_archive.h"
#include "density/vdb/vdb_file.h"
#include "density/vdb/vdb_sandbox.h"
#include "density/voxel_digest.h"
#include "tests/fuzz/sent.h"
#include "tests/fuzz/target.h"
#include "tests/fuzz/watched_memory.h"

namespace nephos {
namespace {

constexpr std::size_t kMostOfFile = std::size_t{1} << 20;
constexpr std::size_t kMostMemory = std::size_t{64} << 20;  // of reading and its result
constexpr VdbReadLimits kLimits{.memory_bytes = std::size_t{4} << 20, .seconds = 60};
constexpr Extent kState{12, 9, 6};  // of the states among the inputs
constexpr Placement kStatePlace{{-100, 200, 50}, 25};

// A zero stands for as many as the byte after it says: up to 128 one by one, beyond that in steps of 256.
std::string unpacked(std::string_view packed) {
    std::string bytes;
    for (std::size_t n = 0; n < packed.size() && bytes.size() < kMostOfFile; ++n) {
        if (packed[n] != 0 || n + 1 == packed.size()) {
            bytes += packed[n];
            continue;
        }
        const unsigned count = static_cast<unsigned char>(packed[++n]);
        bytes.append(count < 128 ? count + 1 : (count - 127) * 256, '\0');
    }
    bytes.resize(std::min(bytes.size(), kMostOfFile));
    return bytes;
}

// Opens the file anew, so that its position is its own, for an archive or buffer that closes it.
int reopened(const std::filesystem::path& path) { return open_regular_file(path, O_RDONLY).release(); }

class Archive : public VdbArchive {
  public:
    using VdbArchive::inputHasGridOffsets;
    using VdbArchive::VdbArchive;
};

// Checks the stream as OpenVDB asks it for a chunk: 8 bytes that are its size, negated where it is not compressed, and then as many as they say, into
// a block that has room for `room`. The stream hands over the bytes of the file or refuses them, and writes nothing behind the block.
void check_chunk(const fuzz::InputFile& file, std::string_view bytes, std::size_t at, std::size_t room) {
    CheckedBuffer buffer(reopened(file.path()));
    buffer.read_below(__builtin_frame_address(0));
    buffer.pubseekpos(std::streampos(std::streamoff(at)));
    std::int64_t number = 0;
    fuzz::require(buffer.sgetn(reinterpret_cast<char*>(&number), sizeof number) == sizeof number,
                  "8 bytes of the file");
    const std::unique_ptr<char, void (*)(void*)> block(static_cast<char*>(std::malloc(room)), std::free);
    fuzz::require(block != nullptr, "memory of a chunk");
    const std::size_t rest = bytes.size() - at - sizeof number, asked = std::size_t(-number);
    try {
        const std::streamsize got = buffer.sgetn(block.get(), std::streamsize(asked));
        fuzz::require(std::min(asked, rest) <= ::malloc_usable_size(block.get()),
                      "a chunk fits into its block");
        fuzz::require(got == std::streamsize(std::min(asked, rest)), "a chunk is whole");
        fuzz::require(std::memcmp(block.get(), bytes.data() + at + sizeof number, std::size_t(got)) == 0,
                      "a chunk is that of the file");
    } catch (const std::runtime_error&) {
        fuzz::require(asked > room, "a chunk that fits is read");
    }
}

void check_chunks(const fuzz::InputFile& file, std::string_view bytes) {
    constexpr std::size_t kMostChunks = 16;
    constexpr std::int64_t kLongest = 1 << 16;
    std::size_t chunks = 0;
    for (std::size_t at = 0; at + sizeof(std::int64_t) <= bytes.size() && chunks < kMostChunks; ++at) {
        std::int64_t number = 0;
        std::memcpy(&number, bytes.data() + at, sizeof number);
        if (number >= 0 || number < -kLongest) continue;
        ++chunks;
        check_chunk(file, bytes, at, 24);  // all blocks have room for as much
        check_chunk(file, bytes, at, 2048);
    }
}

void check_archive(const fuzz::InputFile& file, std::string_view bytes) {
    const Archive archive(reopened(file.path()));
    fuzz::require(archive.entries().size() <= bytes.size() / 32, "a file has room for its grids");
    for (const VdbArchive::Entry& entry : archive.entries()) {
        fuzz::require(entry.header != nullptr, "a grid has a header");
        const auto& descriptor = entry.descriptor;
        if (!archive.inputHasGridOffsets()) continue;
        fuzz::require(descriptor.getGridPos() > 0 && descriptor.getEndPos() <= std::int64_t(bytes.size()),
                      "a grid lies within its file");
        fuzz::require(descriptor.getGridPos() <= descriptor.getEndPos(), "a grid ends behind its beginning");
    }
}

void check_density(const LoadedDensity& loaded) {
    constexpr int kMost = kMaxExtent * kMaxRefine;
    const Extent extent = loaded.density.extent();
    for (const int size : {extent.x, extent.y, extent.z})
        fuzz::require(size >= 1 && size <= kMost, "a density has a possible extent");
    fuzz::require(loaded.density.placement().cell_size_m > 0, "voxels have a size");
    fuzz::require(loaded.refine >= 1 && loaded.refine <= kMaxRefine,
                  "a cell has a possible number of voxels");
}

void check_samples(const SampleGrid& samples) {
    std::size_t count = std::size_t(samples.parts);
    for (const int points : samples.points) count *= std::size_t(points);
    fuzz::require(samples.values.size() == count, "samples are whole");
    fuzz::require(std::ranges::all_of(samples.values, [](float value) { return std::isfinite(value); }),
                  "samples are numbers");
}

struct Reading {
    std::optional<std::string>
        checksum;          // of what was read, which is lost with the memory; nullopt where it was refused
    bool ran_out = false;  // of memory
};

Reading read_once(unsigned char filling, const std::function<std::string()>& read) {
    Reading reading;
    const fuzz::WatchedMemory memory(kMostMemory, filling);
    try {
        fuzz::accepts([&] {
            Digest digest;
            digest.add(read());
            reading.checksum = digest.hex();
        });
    } catch (const std::bad_alloc&) {  // of what this process makes of it, which run_sandboxed() lets through
    }
    reading.ran_out = memory.ran_out();
    return reading;
}

// Memory that is new holds nothing that anybody may read: twice the same comes out, whatever is in it. How much is alive at
// once is up to threads, so that one reading alone may run out of memory.
void read_twice(const std::function<std::string()>& read) {
    const Reading first = read_once(0xA5, read);
    if (!first.checksum) return;
    const Reading second = read_once(0x3C, read);
    fuzz::require(second.checksum == first.checksum || (second.ran_out && !second.checksum),
                  "what is read is in the file");
}

std::string text_of(const LoadedDensity& loaded) {
    check_density(loaded);
    std::string text = voxel_digest(loaded.density) + loaded.grid_name + std::to_string(loaded.negative);
    for (const std::string& note : loaded.notes) text += note;
    return text;
}

std::string text_of(const VdbInfo& info) {
    std::string text = info.file_version;
    for (const VdbGridInfo& grid : info.grids) {
        text += grid.name + grid.type + grid.grid_class + std::to_string(grid.active_voxels);
        for (const VdbMetadataEntry& entry : grid.metadata) text += entry.name + entry.value;
    }
    for (const VdbMetadataEntry& entry : info.metadata) text += entry.name + entry.value;
    return text;
}

// The voxels of a grid that only has to be read: its text is the numbers.
std::string text_of(const SampleGrid& samples) {
    check_samples(samples);
    return {reinterpret_cast<const char*>(samples.values.data()), samples.values.size() * sizeof(float)};
}

std::string text_of(const Lattice& state) {
    std::string text;
    for (const BitPlane* plane : {&state.hum, &state.act, &state.cld})
        for (int z = 0; z < kState.z; ++z)
            for (int y = 0; y < kState.y; ++y)
                for (int x = 0; x < kState.x; ++x) text += plane->get(x, y, z) ? '1' : '0';
    return text;
}

}  // namespace

// Takes the place of that of density/vdb/vdb_sandbox.cpp, which forks: the linker needs nothing else of it.
void in_sandbox(const std::filesystem::path& path, const VdbReadLimits&,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&)>& parent) {
    const fuzz::InputFile pipe({});
    try {
        VdbArchive archive(reopened(path));
        SandboxWriter writer(pipe.descriptor());
        child(archive, writer);
        writer.flush();
    } catch (const std::exception& error) {  // as vdb_archive.h promises
        fuzz::require(error.what()[0] != '\0', "an error has a message");
        throw Error(ErrorCode::io, error.what());
    }
    fuzz::Sent sent(fuzz::sent_to(pipe));
    try {
        parent(sent);
    } catch (const std::runtime_error& error) {  // as run_sandboxed() does
        throw Error(ErrorCode::io, error.what());
    }
    fuzz::require(sent.is_over(), "all that is sent is read");
}

void in_sandbox(std::span<const std::filesystem::path> paths, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&, std::size_t)>& parent) {
    for (std::size_t n = 0; n < paths.size(); ++n)
        in_sandbox(paths[n], limits, child, [&](SandboxReader& reader) { parent(reader, n); });
}

std::size_t memory_limit(const VdbReadLimits& limits) { return limits.memory_bytes; }

}  // namespace nephos

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    static const bool is_ready = [] {
        openvdb::initialize();
        std::cerr.setstate(
            std::ios::badbit);  // where OpenVDB warns of each file; the confined process has none
        // Takes what libraries keep from their first use on, before memory is watched.
        const auto grid = openvdb::FloatGrid::create();
        grid->setName("density");
        grid->tree().setValue(openvdb::Coord(0, 0, 0), 1.0f);
        std::ostringstream file(std::ios::binary);
        openvdb::io::Stream(file).write(openvdb::GridCPtrVec{grid});
        const fuzz::InputFile whole(file.str());
        VdbReadOptions options;
        options.limits = kLimits;
        return load_density(whole.path(), options).density.value(0, 0, 0) == 1.0f;
    }();
    fuzz::require(is_ready, "a file of one voxel is read");
    const std::string bytes = unpacked(fuzz::as_text(data, size));
    const fuzz::InputFile file(bytes);
    check_chunks(file, bytes);
    {
        const fuzz::WatchedMemory memory(kMostMemory, 0x77);
        try {
            check_archive(file, bytes);
        } catch (const std::exception& error) {
            fuzz::require(error.what()[0] != '\0', "an error has a message");
        }
    }
    VdbReadOptions options;
    options.limits = kLimits;
    read_twice([&] { return text_of(load_density(file.path(), options)); });
    read_twice([&] { return text_of(load_mask(file.path(), 0, options)); });
    read_twice([&] { return text_of(read_vdb_info(file.path(), kLimits)); });
    read_twice([&] { return text_of(read_state(file.path(), kState, kStatePlace, kLimits)); });
    for (const int parts : {1, 3})
        read_twice([&] { return text_of(read_samples(file.path(), "", parts, kLimits)); });
    return 0;
}
