// SPDX-License-Identifier: Apache-2.0
#include "density/export/nanovdb_file.h"

#include <fstream>
#include <sstream>

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
    // The library seeks over the header before there are bytes, which a string stream refuses. No file is smaller.
    std::ostringstream stream(std::string(1024, '\0'), std::ios::binary);
    try {
        const auto grid = described(density);
        nanovdb::io::writeGrid(stream, converted(*grid, quantise), kCodecs[std::size_t(codec)]);
    } catch (const Error&) {
        throw;
    } catch (const std::exception& error) {
        throw Error(ErrorCode::io, path.string() + ": cannot convert to NanoVDB: " + error.what());
    }
    write_atomically(path, std::string_view(stream.view()));
}

DensityGrid read_nanovdb(const std::filesystem::path& path, Extent extent, const Placement& placement) {
    openvdb::initialize();
    require_regular_file(path);
    std::ifstream stream(path, std::ios::binary);
    TreeBuilder builder;
    try {
        const auto handles = nanovdb::io::readGrids(stream);
        const nanovdb::NanoGrid<float>* const nano = handles.size() == 1 ? handles.front().grid<float>() : nullptr;
        if (nano == nullptr) throw Error(ErrorCode::io, path.string() + ": holds no float grid that is not quantised");
        const auto grid = nanovdb::nanoToOpenVDB(*nano);  // of the handle: it would compile all kinds of grids
        const openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
        const openvdb::Coord last(extent.x - 1, extent.y - 1, extent.z - 1);
        if (!box.empty() && !openvdb::CoordBBox(openvdb::Coord(0), last).isInside(box))
            throw Error(ErrorCode::io, path.string() + ": has voxels outside of its box");
        for (int z = 0; z < extent.z; z += kBlock) {
            for (int y = 0; y < extent.y; y += kBlock) {
                for (int x = 0; x < extent.x; x += kBlock) {
                    auto leaf = uninitialised_leaf({x, y, z});
                    const FloatLeaf* from = grid->tree().probeConstLeaf({x, y, z});
                    for (int n = 0; n < kBlockVoxels; ++n) {
                        leaf->buffer().data()[n] =
                            from != nullptr
                                ? from->buffer().data()[n]
                                : grid->tree().getValue({x + (n >> 6), y + (n >> 3 & 7), z + (n & 7)});
                    }
                    NewBlock::from(std::move(leaf)).move_to(builder, {x, y, z});
                }
            }
        }
    } catch (const Error&) {
        throw;
    } catch (const std::exception& error) {
        throw Error(ErrorCode::io, path.string() + ": is no NanoVDB file, or is damaged: " + error.what());
    }
    return builder.finish(extent, placement);
}

}  // namespace nephos
