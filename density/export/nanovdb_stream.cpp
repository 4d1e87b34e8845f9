// SPDX-License-Identifier: Apache-2.0
#include "density/export/nanovdb_stream.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <istream>
#include <iterator>
#include <limits>
#include <new>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <ext/stdio_filebuf.h>
#include <zlib.h>

#include "density/export/nanovdb_library.h"
#include "density/openvdb_access.h"
#include "density/vdb/block_stream.h"

namespace nephos {
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

// Throws unless so many bytes at an address, to which offsets of the file lead, are of the grid's.
void require_within(const nanovdb::GridHandle<>& grid, std::uintptr_t at, std::uint64_t bytes) {
    const auto begin = reinterpret_cast<std::uintptr_t>(grid.data());
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
                send_node(node_at<typename Root::ChildNodeType>(root.data(), tile->child), origin);
            else
                send_tile_of(tile->value, tile->isActive(), origin, int(Root::ChildNodeType::DIM));
        }
        for (int level = 0; level < 3; ++level)
            if (counts_[level] != tree_.mNodeCount[level])
                throw std::runtime_error("it counts more nodes than it has");
    }

  private:
    static void require_nothing(float value) {
        if (value != 0) throw std::runtime_error("it has a value where there is no voxel");
    }

    // Returns the node so many bytes behind its parent: those of a level lie one behind the other.
    template <class Node>
    const Node& node_at(const void* parent, std::int64_t offset) {
        const auto tree = reinterpret_cast<std::uintptr_t>(&tree_);
        const std::uint64_t at = reinterpret_cast<std::uintptr_t>(parent) - tree + std::uint64_t(offset),
                            first = tree_.mNodeOffset[Node::LEVEL];
        require_within(grid_, tree + at, sizeof(Node));
        if (at % NANOVDB_DATA_ALIGNMENT != 0 || at < first || (at - first) % sizeof(Node) != 0 ||
            (at - first) / sizeof(Node) >= tree_.mNodeCount[Node::LEVEL])
            throw std::runtime_error("its nodes do not lie where it says");
        if (++counts_[Node::LEVEL] > tree_.mNodeCount[Node::LEVEL])
            throw std::runtime_error("one of its nodes is in two places");
        return *reinterpret_cast<const Node*>(tree + at);
    }

    void send_tile_of(float value, bool is_active, const openvdb::Coord& origin, int edge) {
        if (!is_active) return require_nothing(value);
        send_tiles(writer_, extent_, origin, edge, value);
    }

    template <class Node>
    void send_node(const Node& node, const openvdb::Coord& origin) {
        if (coordinates(node.origin()) != origin)
            throw std::runtime_error("one of its nodes says that it is elsewhere");
        const auto place_of = [&](std::uint32_t n, int edge) {
            const openvdb::Coord slot = coordinates(Node::OffsetToLocalCoord(n));
            return origin + openvdb::Coord(slot.x() * edge, slot.y() * edge, slot.z() * edge);
        };
        if constexpr (Node::LEVEL == 0) {
            std::array<float, kBlockVoxels> values;
            for (std::uint32_t n = 0; n < kBlockVoxels; ++n) values[n] = node.getValue(n);
            if (!std::ranges::all_of(values, [](float v) { return v >= 0 && std::isfinite(v); }))
                throw std::runtime_error("it holds a value that is no density");
            for (std::uint32_t n = 0; n < kBlockVoxels; ++n) {
                if (extent_.isInside(place_of(n, 1))) continue;
                if (values[n] != 0 || node.valueMask().isOn(n))
                    throw std::runtime_error("it has voxels outside of its box");
            }
            send_leaf(writer_, origin, values.data());
        } else {
            constexpr int kEdge = int(Node::ChildNodeType::DIM);
            for (std::uint32_t n = 0; n < Node::SIZE; ++n) {
                if (node.data()->mChildMask.isOn(n))
                    send_node(
                        node_at<typename Node::ChildNodeType>(node.data(), node.data()->mTable[n].child),
                        place_of(n, kEdge));
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
    const auto& name = reinterpret_cast<const nanovdb::GridData*>(handle.data())->mGridName;
    if (std::ranges::find(name, '\0') == std::end(name))
        throw std::runtime_error("its grid's name has no end");
}

// The head of a grid ends with its root, of whose nodes there may be any number.
template <class Build>
void require_root_of(const nanovdb::NanoGrid<Build>& grid, const nanovdb::GridHandle<>& handle) {
    using Root = typename nanovdb::NanoTree<Build>::RootType;
    constexpr std::uint64_t kRoot = sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>);
    const auto begin = reinterpret_cast<std::uintptr_t>(handle.data());
    require_within(handle, begin + kRoot, sizeof(Root));
    if (grid.tree().data()->mNodeOffset[Root::LEVEL] != sizeof(nanovdb::TreeData<3>))
        throw std::runtime_error("its root does not lie where it says");
    require_within(handle, begin + kRoot, grid.tree().root().memUsage());
}

// The first and last voxel of a grid of ours are active, and its boxes are around them, in the world up to the far side of the last.
template <class Build>
void require_boxes_of(const nanovdb::NanoGrid<Build>& grid, const CoordBBox& extent) {
    const auto& box = grid.tree().root().data()->mBBox;
    if (coordinates(box[0]) != extent.min() || coordinates(box[1]) != extent.max())
        throw std::runtime_error("its box is not that of its voxels");
    const nanovdb::Map& map = grid.map();
    for (int a = 0; a < 3; ++a) {
        const double low = map.mVecD[a], high = low + map.mMatD[4 * a] * (extent.max()[a] + 1);
        const double most = 8 * std::numeric_limits<double>::epsilon() * (std::abs(low) + std::abs(high));
        if (!(std::abs(grid.worldBBox()[0][a] - low) <= most &&
              std::abs(grid.worldBBox()[1][a] - high) <= most))
            throw std::runtime_error("its box in the world is not that of its voxels");
    }
}

template <class Build>
bool send_grid_of(const ReadGrid& read, const CoordBBox& extent, SandboxWriter& writer) {
    const nanovdb::NanoGrid<Build>* grid = read.grid.grid<Build>();
    if (grid == nullptr) return false;
    if (grid->hasLongGridName() || grid->blindDataCount() != 0)
        throw std::runtime_error("it says more than a grid of ours");
    if (!grid->isFogVolume()) throw std::runtime_error("it is no fog volume");
    require_root_of(*grid, read.grid);
    // Partial: of its head, for which the library starts no threads.
    if (nanovdb::checksum(*grid, nanovdb::ChecksumMode::Partial) != grid->checksum())
        throw std::runtime_error("its own checksum is of another head");
    require_head_of(read);
    require_boxes_of(*grid, extent);
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
    // OpenVDB eliminates in matrices of small voxels, and so rounds the zeros of their inverse by how far away they are.
    double inverse = 0, farthest_m = 0;
    for (const int n : {0, 4, 8}) inverse = std::max(inverse, std::abs(1 / map.mMatD[n]));
    for (const double at : map.mVecD) farthest_m = std::max(farthest_m, std::abs(at));
    const double most =
        std::max(1e-12, 16 * std::numeric_limits<double>::epsilon() * (1 + farthest_m * inverse)) * inverse;
    for (int n = 0; n < 9; ++n) {
        const double backwards = n % 4 == 0 ? 1 / map.mMatD[n] : 0;
        if (map.mMatF[n] != float(map.mMatD[n]) || map.mInvMatF[n] != float(map.mInvMatD[n])) return false;
        if (!(std::abs(map.mInvMatD[n] - backwards) <= most)) return false;
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

}  // namespace

void send_nanovdb(int file, const Extent& extent, SandboxWriter& writer) {
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

DensityGrid receive_nanovdb(SandboxReader& reader, const Extent& extent) {
    const Placement placement = receive_placement(reader);
    return receive_blocks(reader, extent, placement);
}

}  // namespace nephos
