// SPDX-License-Identifier: Apache-2.0
#include "density/export/nanovdb_file.h"

#include <algorithm>
#include <cstring>
#include <istream>
#include <new>
#include <sstream>
#include <stdexcept>

#include <ext/stdio_filebuf.h>
#include <fcntl.h>

#define NANOVDB_USE_OPENVDB
#define NANOVDB_USE_ZIP
#define NANOVDB_USE_BLOSC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wcast-qual"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wall"
#include <nanovdb/util/IO.h>
#include <nanovdb/util/NanoToOpenVDB.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#pragma GCC diagnostic pop

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "density/openvdb_access.h"
#include "density/vdb/block_stream.h"
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

}  // namespace

void write_nanovdb(const std::filesystem::path& path, const DensityGrid& density, NanoCodec codec,
                   NanoQuantise quantise) {
    openvdb::initialize();
    constexpr nanovdb::io::Codec kCodecs[] = {nanovdb::io::Codec::NONE, nanovdb::io::Codec::ZIP,
                                              nanovdb::io::Codec::BLOSC};
    const auto grid = described(density);
    // The library seeks over what precedes the voxels before there are bytes, which a string stream refuses.
    const std::size_t head =
        sizeof(nanovdb::io::Header) + sizeof(nanovdb::io::MetaData) + grid->getName().size() + 1;
    std::ostringstream stream(std::string(head, '\0'), std::ios::binary);
    try {
        nanovdb::io::writeGrid(stream, converted(*grid, quantise), kCodecs[std::size_t(codec)]);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& error) {
        throw Error(ErrorCode::io, path.string() + ": cannot convert to NanoVDB: " + error.what());
    }
    write_atomically(path, std::string_view(stream.view()));
}

namespace {

// The float grid of a file, of values as they are or quantised. (The conversion of a handle would compile all kinds of grids.)
FloatGrid::Ptr float_grid_of(const nanovdb::GridHandle<>& handle) {
    if (const auto* plain = handle.grid<float>()) return nanovdb::nanoToOpenVDB(*plain);
    if (const auto* fp8 = handle.grid<nanovdb::Fp8>()) return nanovdb::nanoToOpenVDB(*fp8);
    if (const auto* fp16 = handle.grid<nanovdb::Fp16>()) return nanovdb::nanoToOpenVDB(*fp16);
    return nullptr;
}

// In the child: the blocks of the only grid of an open file.
void send_grid(int file, const Extent& extent, SandboxWriter& writer) {
    __gnu_cxx::stdio_filebuf<char> buffer(file, std::ios::in | std::ios::binary);
    std::istream stream(&buffer);
    stream.exceptions(std::ios::badbit);  // with the system's error
    const auto handles = nanovdb::io::readGrids(stream);
    const FloatGrid::Ptr grid = handles.size() == 1 ? float_grid_of(handles.front()) : nullptr;
    if (grid == nullptr) throw std::runtime_error("it holds no float grid of 32, 16 or 8 bits");
    const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
    const openvdb::Coord last(extent.x - 1, extent.y - 1, extent.z - 1);
    if (!box.empty() && !openvdb::CoordBBox(openvdb::Coord(0), last).isInside(box))
        throw std::runtime_error("it has voxels outside of its box");
    for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf)
        send_leaf(writer, leaf->origin(), leaf->buffer().data());
    auto tile = grid->tree().cbeginValueOn();
    tile.setMaxDepth(FloatTree::ValueOnCIter::LEAF_DEPTH - 1);
    for (; tile; ++tile) {
        const openvdb::CoordBBox block = tile.getBoundingBox();
        for (int z = block.min().z(); z <= block.max().z(); z += kBlock)
            for (int y = block.min().y(); y <= block.max().y(); y += kBlock)
                for (int x = block.min().x(); x <= block.max().x(); x += kBlock)
                    send_tile(writer, {x, y, z}, *tile);
    }
    send_end(writer);
}

}  // namespace

DensityGrid read_nanovdb(const std::filesystem::path& path, Extent extent, const Placement& placement) {
    openvdb::initialize();  // before the fork, so that the child finds it done
    const Descriptor file = open_regular_file(path, O_RDONLY);
    constexpr double kSeconds = 120;
    const std::size_t memory = std::min(memory_limit({}), memory_bound(path));
    const int kept[] = {file.get()};
    DensityGrid density;
    run_sandboxed(
        path, "NanoVDB", {kSeconds, memory, memory}, kept,
        [&](SandboxWriter& writer) {
            try {
                send_grid(file.get(), extent, writer);
            } catch (const std::bad_alloc&) {
                throw;
            } catch (const std::ios_base::failure& error) {
                const bool of_system = error.code().category() != std::iostream_category();
                throw std::runtime_error(of_system ? std::string("cannot read: ") +
                                                         std::strerror(error.code().value())
                                                   : "it is no NanoVDB file, or is damaged: it ends early");
            } catch (const std::exception& error) {
                throw std::runtime_error(std::string("it is no NanoVDB file, or is damaged: ") +
                                         error.what());
            }
        },
        [&](SandboxReader& reader) { density = receive_blocks(reader, extent, placement); });
    return density;
}

}  // namespace nephos
