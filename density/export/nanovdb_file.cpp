// SPDX-License-Identifier: Apache-2.0
#include "density/export/nanovdb_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <istream>
#include <limits>
#include <new>
#include <ostream>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <ext/stdio_filebuf.h>
#include <fcntl.h>
#include <zlib.h>

#define NANOVDB_USE_OPENVDB
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#pragma GCC diagnostic ignored "-Wcast-qual"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wall"
#include <nanovdb/util/GridChecksum.h>
#include <nanovdb/util/IO.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#pragma GCC diagnostic pop

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "density/openvdb_access.h"
#include "density/vdb/block_stream.h"
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
        } catch (const std::system_error&) {  // of a thread that cannot start for want of addresses
            throw std::bad_alloc();
        } catch (const std::exception& error) {
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

namespace {

using openvdb::CoordBBox;

openvdb::Coord coordinates(const nanovdb::Coord& at) { return {at[0], at[1], at[2]}; }

void require_inside(const CoordBBox& extent, const CoordBBox& active) {
    if (!extent.isInside(active)) throw std::runtime_error("it has voxels outside of its box");
}

void send_tiles(SandboxWriter& writer, const CoordBBox& extent, const openvdb::Coord& origin, int edge,
                float value) {
    const CoordBBox box = CoordBBox::createCube(origin, edge);
    require_inside(extent, box);
    for (int z = box.min().z(); z <= box.max().z(); z += kBlock)
        for (int y = box.min().y(); y <= box.max().y(); y += kBlock)
            for (int x = box.min().x(); x <= box.max().x(); x += kBlock) send_tile(writer, {x, y, z}, value);
}

// Throws unless so many bytes at a place, to which offsets of the file lead, are of the grid's.
void require_within(const nanovdb::GridHandle<>& grid, const void* place, std::uint64_t bytes) {
    const auto begin = reinterpret_cast<std::uintptr_t>(grid.data()),
               at = reinterpret_cast<std::uintptr_t>(place);
    if (at < begin || at - begin > grid.size() || bytes > grid.size() - (at - begin))
        throw std::runtime_error("its nodes lie outside of it");
}

// Sends what a reader finds in a grid: each node by its slot, by which accessors look for it, wherever it says it is. (The library's
// conversion to OpenVDB would do, but for its threads: a child that was forked should start none.)
class GridSender {
  public:
    GridSender(const nanovdb::GridHandle<>& grid, const nanovdb::TreeData<3>& tree, const CoordBBox& extent,
               SandboxWriter& writer)
        : grid_(grid), tree_(tree), extent_(extent), writer_(writer) {}

    template <class Root>
    void send_root(const Root& root) {
        require_nothing(root.background());
        std::set<std::uint64_t> keys;
        for (std::uint32_t n = 0; n < root.data()->mTableSize; ++n) {
            const auto* tile = root.data()->tile(n);
            const openvdb::Coord origin = coordinates(tile->origin());
            if (!keys.insert(tile->key).second) throw std::runtime_error("two of its nodes are in one place");
            if (tile->isChild())
                send_node(*root.data()->getChild(tile), origin);
            else
                send_tile_of(tile->value, tile->isActive(), origin, int(Root::ChildNodeType::DIM));
        }
        for (int level = 0; level < 3; ++level)
            if (counts_[level] != tree_.mNodeCount[level])
                throw std::runtime_error("it counts other nodes than it has");
    }

  private:
    static void require_nothing(float value) {
        if (value != 0) throw std::runtime_error("it has a value where there is no voxel");
    }

    // Nodes of a level lie one behind the other.
    template <class Node>
    void require_place(const Node& node) {
        require_within(grid_, &node, sizeof node);
        const auto tree = reinterpret_cast<std::uintptr_t>(&tree_),
                   at = reinterpret_cast<std::uintptr_t>(&node) - tree;
        const std::uint64_t first = tree_.mNodeOffset[Node::LEVEL];
        if (at % NANOVDB_DATA_ALIGNMENT != 0 || at < first || (at - first) % sizeof node != 0 ||
            (at - first) / sizeof node >= tree_.mNodeCount[Node::LEVEL])
            throw std::runtime_error("its nodes do not lie where it says");
        ++counts_[Node::LEVEL];
    }

    void send_tile_of(float value, bool is_active, const openvdb::Coord& origin, int edge) {
        if (!is_active) return require_nothing(value);
        send_tiles(writer_, extent_, origin, edge, value);
    }

    template <class Node>
    void send_node(const Node& node, const openvdb::Coord& origin) {
        require_place(node);
        const auto place_of = [&](std::uint32_t n, int edge) {
            const openvdb::Coord slot = coordinates(Node::OffsetToLocalCoord(n));
            return origin + openvdb::Coord(slot.x() * edge, slot.y() * edge, slot.z() * edge);
        };
        if constexpr (Node::LEVEL == 0) {
            std::array<float, kBlockVoxels> values;
            for (std::uint32_t n = 0; n < kBlockVoxels; ++n) values[n] = node.getValue(n);
            if (!std::ranges::all_of(values, [](float v) { return v >= 0 && std::isfinite(v); }))
                throw std::runtime_error("it holds a value that is no density");
            for (auto active = node.valueMask().beginOn(); active; ++active)
                require_inside(extent_, CoordBBox::createCube(place_of(*active, 1), 1));
            send_leaf(writer_, origin, values.data());
        } else {
            constexpr int kEdge = int(Node::ChildNodeType::DIM);
            for (std::uint32_t n = 0; n < Node::SIZE; ++n) {
                if (node.data()->mChildMask.isOn(n))
                    send_node(*node.data()->getChild(n), place_of(n, kEdge));
                else
                    send_tile_of(node.data()->mTable[n].value, node.data()->mValueMask.isOn(n),
                                 place_of(n, kEdge), kEdge);
            }
        }
    }

    const nanovdb::GridHandle<>& grid_;
    const nanovdb::TreeData<3>& tree_;
    const CoordBBox& extent_;
    SandboxWriter& writer_;
    std::array<std::uint32_t, 3> counts_{};  // of nodes by level
};

// Reads a file from its beginning, and nothing beyond its end.
class FileBytes {
  public:
    explicit FileBytes(std::istream& stream) : stream_(stream) {
        stream.seekg(0, std::ios::end);
        left_ = std::uint64_t(stream.tellg());
        stream.seekg(0);
        if (!stream) throw std::ios_base::failure("seek", std::make_error_code(std::errc::io_error));
    }
    std::uint64_t left() const { return left_; }
    void read(void* to, std::uint64_t count) {
        if (count > left_ || !stream_.read(static_cast<char*>(to), std::streamsize(count)))
            throw std::runtime_error("it ends early");
        left_ -= count;
    }

  private:
    std::istream& stream_;
    std::uint64_t left_ = 0;
};

// Inflates what payload_of() wrote to exactly so many bytes.
void inflate_payload(FileBytes& file, char* to, std::uint64_t size) {
    nanovdb::io::fileSize_t stated = 0;
    file.read(&stated, sizeof stated);
    if (stated != file.left()) throw std::runtime_error("it states more or less bytes than it has");
    std::vector<Bytef> packed(stated);
    file.read(packed.data(), stated);
    uLongf bytes = uLong(size);
    uLong taken = uLong(stated);
    const int status = uncompress2(reinterpret_cast<Bytef*>(to), &bytes, packed.data(), &taken);
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    if (status != Z_OK || bytes != size || taken != stated)
        throw std::runtime_error("its compressed bytes are damaged");
}

// A file's only grid, and what stands ahead of it.
struct ReadGrid {
    nanovdb::io::Segment head;
    nanovdb::GridHandle<> grid;
};

// The library's own reader takes no notice of what zlib says, nor of what follows the grid.
ReadGrid read_grid(std::istream& stream) {
    FileBytes file(stream);
    ReadGrid read;
    file.read(&read.head.header, sizeof read.head.header);
    const nanovdb::io::Header& header = read.head.header;
    if (header.magic != NANOVDB_MAGIC_NUMBER) throw std::runtime_error("it does not begin as one");
    if (header.version.getMajor() != NANOVDB_MAJOR_VERSION_NUMBER)
        throw std::runtime_error("it is of another version of the format");
    if (header.gridCount != 1) throw std::runtime_error("it holds no single grid");
    nanovdb::io::GridMetaData& meta = read.head.meta.emplace_back();
    file.read(static_cast<nanovdb::io::MetaData*>(&meta), sizeof(nanovdb::io::MetaData));
    if (meta.nameSize == 0 || meta.nameSize > file.left()) throw std::runtime_error("it ends early");
    meta.gridName.resize(meta.nameSize);
    file.read(meta.gridName.data(), meta.nameSize);
    if (meta.gridName.back() != '\0') throw std::runtime_error("its grid's name has no end");
    meta.gridName.pop_back();
    const bool is_packed = header.codec == nanovdb::io::Codec::ZIP;
    if (!is_packed && header.codec != nanovdb::io::Codec::NONE)
        throw std::runtime_error("it is compressed by other means than zlib");
    if (meta.fileSize != file.left() || (!is_packed && meta.gridSize != meta.fileSize))
        throw std::runtime_error("it states more or less bytes than it has");
    constexpr std::uint64_t kMostPacked = 1032;  // bytes in one of zlib
    if (meta.gridSize / kMostPacked > file.left())
        throw std::runtime_error("it states more bytes than it can hold");
    read.grid = nanovdb::GridHandle<>(nanovdb::HostBuffer::create(meta.gridSize));
    char* to = reinterpret_cast<char*>(read.grid.data());
    if (is_packed)
        inflate_payload(file, to, meta.gridSize);
    else
        file.read(to, meta.gridSize);
    return read;
}

std::string bytes_of(const nanovdb::io::Segment& head) {
    std::ostringstream stream;
    head.write(stream);
    return std::move(stream).str();
}

// Throws unless the head says of the grid what the library does: sizes, places, counts and names are in both.
void require_head_of(const ReadGrid& read) {
    nanovdb::io::Segment head(read.head.header.codec);
    head.add(read.grid);
    head.header.version = read.head.header.version;
    head.meta.front().version = read.head.header.version;
    head.meta.front().fileSize = read.head.meta.front().fileSize;
    if (bytes_of(head) != bytes_of(read.head)) throw std::runtime_error("its head is of another grid");
}

// The library looks for a grid's type behind as many grids as its index says, wherever that leads.
void require_one_grid(const nanovdb::GridHandle<>& handle) {
    const nanovdb::GridMetaData* grid = handle.gridMetaData();
    if (handle.size() < sizeof(nanovdb::GridData) || grid->gridIndex() != 0 || grid->gridCount() != 1 ||
        grid->gridSize() != handle.size())
        throw std::runtime_error("it holds no single whole grid");
    if (!grid->isValid()) throw std::runtime_error("its grid does not begin as one");
}

template <class Build>
bool send_grid_of(const ReadGrid& read, const CoordBBox& extent, SandboxWriter& writer) {
    const nanovdb::NanoGrid<Build>* grid = read.grid.grid<Build>();
    if (grid == nullptr) return false;
    if (grid->hasLongGridName() || grid->blindDataCount() != 0)
        throw std::runtime_error("it says more than a grid of ours");
    require_within(read.grid, &grid->tree(), sizeof grid->tree());
    require_within(read.grid, &grid->tree().root(), sizeof grid->tree().root());
    require_within(read.grid, &grid->tree().root(), grid->tree().root().memUsage());
    // Partial: of its head, for which the library starts no threads.
    if (nanovdb::checksum(*grid, nanovdb::ChecksumMode::Partial) != grid->checksum())
        throw std::runtime_error("its own checksum is of another head");
    require_head_of(read);
    GridSender(read.grid, *grid->tree().data(), extent, writer).send_root(grid->tree().root());
    return true;
}

// Returns whether the edges that a grid states are those of its map: the library takes the difference of two places, along one axis
// for all.
bool has_edges_of_map(const nanovdb::GridMetaData& grid) {
    constexpr double kRounding = 8 * std::numeric_limits<double>::epsilon();
    const nanovdb::Map& map = grid.map();
    const double farthest =
        std::max({std::abs(map.mVecD[0]), std::abs(map.mVecD[1]), std::abs(map.mVecD[2])});
    for (int a = 0; a < 3; ++a) {
        const double edge = map.mMatD[4 * a], most = kRounding * (std::abs(edge) + farthest);
        if (!(std::abs(grid.voxelSize()[a] - edge) <= most)) return false;
    }
    return true;
}

// Returns whether a map is of doubles, of floats, which renderers on graphics cards take, and backwards the same.
bool is_consistent(const nanovdb::Map& map) {
    constexpr double kRounding = 1e-12;
    for (int n = 0; n < 9; ++n) {
        const double backwards = n % 4 == 0 ? 1 / map.mMatD[n] : 0;
        if (map.mMatF[n] != float(map.mMatD[n]) || map.mInvMatF[n] != float(map.mInvMatD[n])) return false;
        if (!(std::abs(map.mInvMatD[n] - backwards) <= kRounding * std::abs(backwards))) return false;
    }
    for (int n = 0; n < 3; ++n)
        if (map.mVecF[n] != float(map.mVecD[n])) return false;
    return map.mTaperD == 1 && map.mTaperF == 1;
}

// Size and places of voxels: a matrix, and what the centre of the first voxel is moved by.
void send_map(SandboxWriter& writer, const nanovdb::GridMetaData& grid) {
    const nanovdb::Map& map = grid.map();
    if (!is_consistent(map) || !has_edges_of_map(grid))
        throw std::runtime_error("its maps contradict each other");
    for (const double number : map.mMatD) writer.value(number);
    for (const double number : map.mVecD) writer.value(number);
}

Placement receive_placement(SandboxReader& reader) {
    std::array<double, 9> matrix{};
    std::array<double, 3> centre{};
    for (double& number : matrix) number = reader.value<double>();
    for (double& number : centre) number = reader.value<double>();
    const double size = matrix[0];
    const std::array<double, 9> uniform{size, 0, 0, 0, size, 0, 0, 0, size};
    const bool is_finite = std::ranges::all_of(centre, [](double at) { return std::isfinite(at); });
    if (matrix != uniform || !(size > 0) || !std::isfinite(size) || !is_finite)
        throw std::runtime_error("its voxels are no cubes along the axes");
    return {{centre[0] - size / 2, centre[1] - size / 2, centre[2] - size / 2}, size};
}

// In the child: place and blocks of the only grid of an open file, of values as they are or quantised.
void send_grid(int file, const Extent& extent, SandboxWriter& writer) {
    __gnu_cxx::stdio_filebuf<char> buffer(file, std::ios::in | std::ios::binary);
    std::istream stream(&buffer);
    stream.exceptions(std::ios::badbit);  // with the system's error
    const ReadGrid read = read_grid(stream);
    require_one_grid(read.grid);
    send_map(writer, *read.grid.gridMetaData());
    const CoordBBox box(openvdb::Coord(0), openvdb::Coord(extent.x - 1, extent.y - 1, extent.z - 1));
    const bool is_sent = send_grid_of<float>(read, box, writer) ||
                         send_grid_of<nanovdb::Fp8>(read, box, writer) ||
                         send_grid_of<nanovdb::Fp16>(read, box, writer);
    if (!is_sent) throw std::runtime_error("it holds no float grid of 32, 16 or 8 bits");
    send_end(writer);
}

}  // namespace

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
                send_grid(file.get(), extent, writer);
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
        [&](SandboxReader& reader) {
            const Placement placement = receive_placement(reader);
            density = receive_blocks(reader, extent, placement);
        });
    return density;
}

}  // namespace nephos
