// SPDX-License-Identifier: Apache-2.0
#include "density/export/nanovdb_file.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <ios>
#include <new>
#include <ostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <zlib.h>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/threads.h"
#include "density/export/nanovdb_library.h"
#include "density/export/nanovdb_stream.h"
#include "density/openvdb_access.h"
#include "density/vdb/vdb_output.h"
#include "density/vdb/vdb_sandbox.h"

namespace nephos {
namespace {

// The same tree with the transform and the class of the files of vdb_file.h.
FloatGrid::Ptr described(const DensityGrid& density) {
    const auto tree = OpenvdbAccess::grid(density).treePtr();
    const auto grid = FloatGrid::create(openvdb::ConstPtrCast<FloatTree>(tree));
    const Placement& at = density.placement();
    const double size = at.cell_size_m;
    const auto transform = openvdb::math::Transform::createLinearTransform(size);
    transform->postTranslate({at.origin_m.x + size / 2, at.origin_m.y + size / 2, at.origin_m.z + size / 2});
    grid->setTransform(transform);
    grid->setGridClass(openvdb::GRID_FOG_VOLUME);
    grid->setName("density");
    return grid;
}

nanovdb::GridHandle<> converted(const FloatGrid& grid, NanoQuantise quantise) {
    switch (quantise) {
        case NanoQuantise::fp8:
            return nanovdb::openToNanoVDB<nanovdb::HostBuffer, FloatTree, nanovdb::Fp8>(grid);
        case NanoQuantise::fp16:
            return nanovdb::openToNanoVDB<nanovdb::HostBuffer, FloatTree, nanovdb::Fp16>(grid);
        case NanoQuantise::none:
            break;
    }
    return nanovdb::openToNanoVDB(grid);
}

// The library tells a lack of memory by words.
bool is_of_memory(const std::exception& error) {
    const std::string_view what = error.what();
    return dynamic_cast<const std::bad_alloc*>(&error) != nullptr || what.ends_with("malloc failed");
}

// Holds what follows the head of a file: its bytes, and, of compressed ones, their number before them.
struct Payload {
    std::vector<char> compressed;  // of them
    std::string stated;
    std::string_view bytes;
};

// The library's own writer takes no notice of a compression that fails. Throws std::bad_alloc, for nothing else fails in it.
Payload payload_of(const nanovdb::GridHandle<>& handle, NanoCodec codec) {
    const auto* data = reinterpret_cast<const char*>(handle.data());
    if (codec == NanoCodec::none) return {{}, {}, {data, handle.size()}};
    Payload payload;
    uLongf size = compressBound(uLong(handle.size()));
    payload.compressed.resize(size);
    if (compress(reinterpret_cast<Bytef*>(payload.compressed.data()), &size,
                 reinterpret_cast<const Bytef*>(data), uLong(handle.size())) != Z_OK)
        throw std::bad_alloc();
    const nanovdb::io::fileSize_t stated = size;
    payload.stated.assign(reinterpret_cast<const char*>(&stated), sizeof stated);
    payload.bytes = {payload.compressed.data(), size};
    return payload;
}

}  // namespace

void write_nanovdb(const std::filesystem::path& path, const DensityGrid& density, NanoCodec codec,
                   NanoQuantise quantise) {
    openvdb::initialize();
    const nanovdb::GridHandle<> handle = [&] {
        try {
            return converted(*described(density), quantise);
        } catch (const std::exception& error) {
            if (is_lack_of_threads(error)) throw;
            if (is_of_memory(error)) throw std::bad_alloc();
            throw Error(ErrorCode::io, path.string() + ": cannot convert to NanoVDB: " + error.what());
        }
    }();
    const Payload payload = payload_of(handle, codec);
    nanovdb::io::Segment segment(codec == NanoCodec::zip ? nanovdb::io::Codec::ZIP
                                                         : nanovdb::io::Codec::NONE);
    segment.add(handle);
    segment.meta.front().fileSize = payload.stated.size() + payload.bytes.size();
    write_atomically(path, [&](const std::filesystem::path& temporary) {
        VdbOutput file(temporary);
        std::ostream stream(&file);
        if (file.error() == 0) segment.write(stream);
        for (const std::string_view part : {std::string_view(payload.stated), payload.bytes})
            stream.write(part.data(), std::streamsize(part.size()));
        if (!stream || !file.close()) file.fail(path);
    });
}

std::uint64_t nanovdb_work_bytes(std::uint64_t grid_bytes, NanoCodec codec, NanoQuantise quantise) {
    const std::uint64_t grid =
        grid_bytes / 16 + grid_bytes / 32 * std::uint64_t(bits_of(quantise));  // nodes and masks, and voxels
    return codec == NanoCodec::zip ? 2 * grid : grid;
}

DensityGrid read_nanovdb(const std::filesystem::path& path, Extent extent) {
    openvdb::initialize();  // before the fork, so that the child finds it done
    const Descriptor file = open_regular_file(path, O_RDONLY);
    constexpr double kSeconds = 120;
    const std::size_t memory = std::min(memory_limit({}), memory_bound(path));
    const int kept[] = {file.get()};
    DensityGrid density;
    run_sandboxed(
        path, "NanoVDB", {.seconds = kSeconds, .memory_bytes = memory, .most_bytes = memory}, kept,
        [&](SandboxWriter& writer) {
            try {
                send_nanovdb(file.get(), extent, writer);
            } catch (const std::bad_alloc&) {
                throw;
            } catch (const std::ios_base::failure& error) {
                const bool of_system = error.code().category() != std::iostream_category();
                throw std::runtime_error(of_system ? std::string("cannot read: ") +
                                                         std::strerror(error.code().value())
                                                   : "it is no NanoVDB file, or is damaged: it ends early");
            } catch (const std::exception& error) {
                if (is_of_memory(error)) throw std::bad_alloc();
                throw std::runtime_error(std::string("it is no NanoVDB file, or is damaged: ") +
                                         error.what());
            }
        },
        [&](SandboxReader& reader) { density = receive_nanovdb(reader, extent); });
    return density;
}

}  // namespace nephos
