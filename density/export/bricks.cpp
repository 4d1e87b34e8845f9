// SPDX-License-Identifier: Apache-2.0
#include "density/export/bricks.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <string>
#include <tuple>
#include <utility>

#include "core/atomic_file.h"
#include "core/bytes.h"
#include "core/error.h"
#include "core/text.h"
#include "density/export/whole_file.h"

namespace nephos {
namespace {

constexpr std::uint64_t kMark = 0x314349524248504e;  // "NPHBRIC1"
constexpr int kBorder = 1;
constexpr std::uint64_t kHeadBytes = 32, kLevelBytes = 12, kEntryBytes = 40;

struct Entry {
    std::uint32_t level = 0, i = 0, j = 0, k = 0;
    std::uint64_t offset = 0, bytes = 0;
    float min = 0, max = 0;
};

// Codes precede the table's end in time and follow it in the file: those of the first bricks are kept, others are made again
// when they are written.
constexpr std::size_t kMostKept = std::size_t(16) << 20;

int bricks_along(int voxels, int edge) { return (voxels + edge - 1) / edge; }

std::uint64_t brick_count(const std::array<int, 3>& size, int edge) {
    std::uint64_t bricks = 1;
    for (const int voxels : size) bricks *= std::uint64_t(bricks_along(voxels, edge));
    return bricks;
}

// Places of the voxels of a brick along an axis of the level, -1 where there is none.
std::vector<int> places(int first, int edge, int voxels, bool periodic) {
    std::vector<int> result;
    for (int n = first - kBorder; n < first + edge + kBorder; ++n) {
        const int at = periodic ? (n + voxels) % voxels : n;
        // Beyond the last voxel of a brick that is not full there is nothing but the border.
        const bool there = n <= voxels && at >= 0 && at < voxels;
        result.push_back(there ? at : -1);
    }
    return result;
}

Volume brick_of(const Volume& level, const std::array<int, 3>& first, const BrickOptions& options) {
    const int side = options.edge + 2 * kBorder;
    const std::vector<int> x = places(first[0], options.edge, level.nx, options.periodic[0]),
                           y = places(first[1], options.edge, level.ny, options.periodic[1]),
                           z = places(first[2], options.edge, level.nz, options.periodic[2]);
    Volume brick{side, side, side,
                 std::vector<float>(std::size_t(side) * std::size_t(side) * std::size_t(side), 0.0f)};
    const auto inner = std::size_t(std::min(options.edge, level.nx - first[0]));  // of a row, side by side in both
    float* out = brick.values.data();
    for (const int k : z) {
        for (const int j : y) {
            if (k >= 0 && j >= 0) {
                const float* row =
                    level.values.data() +
                    (std::size_t(k) * std::size_t(level.ny) + std::size_t(j)) * std::size_t(level.nx);
                if (x.front() >= 0) out[0] = row[x.front()];
                std::memcpy(out + kBorder, row + first[0], inner * sizeof(float));
                for (std::size_t n = kBorder + inner; n < x.size(); ++n)
                    if (x[n] >= 0) out[n] = row[x[n]];
            }
            out += side;
        }
    }
    return brick;
}

// Calls `visit` with the place of each brick in the order of files.
void for_each_brick(const std::vector<Volume>& levels, int edge,
                    const std::function<void(const Entry&)>& visit) {
    for (std::size_t n = 0; n < levels.size(); ++n)
        for (int k = 0; k < bricks_along(levels[n].nz, edge); ++k)
            for (int j = 0; j < bricks_along(levels[n].ny, edge); ++j)
                for (int i = 0; i < bricks_along(levels[n].nx, edge); ++i)
                    visit({.level = std::uint32_t(n),
                           .i = std::uint32_t(i),
                           .j = std::uint32_t(j),
                           .k = std::uint32_t(k)});
}

std::array<int, 3> first_voxel(const Entry& entry, int edge) {
    return {int(entry.i) * edge, int(entry.j) * edge, int(entry.k) * edge};
}

// The least and the largest value, in lanes that the compiler makes vectors of.
std::pair<float, float> range_of(const std::vector<float>& values) {
    constexpr std::size_t kLanes = 16;
    float low[kLanes], high[kLanes];
    std::fill_n(low, kLanes, values.front());
    std::fill_n(high, kLanes, values.front());
    std::size_t n = 0;
    for (; n + kLanes <= values.size(); n += kLanes) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const float value = values[n + lane];
            low[lane] = value < low[lane] ? value : low[lane];
            high[lane] = high[lane] < value ? value : high[lane];
        }
    }
    for (; n < values.size(); ++n) {
        low[0] = std::min(low[0], values[n]);
        high[0] = std::max(high[0], values[n]);
    }
    return {*std::min_element(low, low + kLanes), *std::max_element(high, high + kLanes)};
}

}  // namespace

std::uint64_t most_brick_bytes(const std::vector<std::array<int, 3>>& sizes, int edge, VoxelType type) {
    const int side = edge + 2 * kBorder;
    std::uint64_t bytes = kHeadBytes;
    for (const std::array<int, 3>& size : sizes)
        bytes +=
            kLevelBytes + brick_count(size, edge) * (kEntryBytes + encoded_bytes(side, side, side, type));
    return bytes;
}

std::uint64_t brick_work_bytes(const std::vector<std::array<int, 3>>& sizes, int edge, VoxelType type) {
    // A vector that grows takes its old room and, twice as large, the new one.
    constexpr std::uint64_t kGrowing = 3,
                            kOfBrick =
                                kGrowing * (sizeof(Entry) + sizeof(std::vector<std::byte>) + kEntryBytes);
    const int side = edge + 2 * kBorder;
    std::uint64_t bytes = kMostKept +
                          sizeof(float) * std::uint64_t(side) * std::uint64_t(side) * std::uint64_t(side) +
                          encoded_bytes(side, side, side, type);
    for (const std::array<int, 3>& size : sizes) bytes += kOfBrick * brick_count(size, edge);
    return bytes;
}

void write_bricks(const std::filesystem::path& path, const std::vector<Volume>& levels,
                  const BrickOptions& options) {
    if (options.type == VoxelType::bc4)
        throw Error(ErrorCode::usage, "--type bc4: bricks with a border have r8, r16, r16f or r32f");
    std::vector<Entry> entries;
    std::size_t kept = 0;
    std::vector<std::vector<std::byte>> data;
    for_each_brick(levels, options.edge, [&](Entry entry) {
        const Volume brick = brick_of(levels[entry.level], first_voxel(entry, options.edge), options);
        std::tie(entry.min, entry.max) = range_of(brick.values);
        const std::size_t bytes =
            entry.max > 0 ? encoded_bytes(brick.nx, brick.ny, brick.nz, options.type) : 0;
        const bool keep = bytes > 0 && kept + bytes <= kMostKept;
        data.push_back(keep ? encode(brick, options.type, options.scale) : std::vector<std::byte>());
        if (keep) kept += bytes;
        entry.bytes = bytes;
        entries.push_back(entry);
    });
    ByteWriter head;
    head.put(kMark);
    for (const int number : {int(options.type), options.edge, kBorder, int(levels.size())})
        head.put(std::uint32_t(number));
    head.put(std::uint64_t(entries.size()));
    for (const Volume& level : levels)
        for (const int voxels : {level.nx, level.ny, level.nz}) head.put(std::uint32_t(voxels));
    std::uint64_t offset = kHeadBytes + kLevelBytes * levels.size() + kEntryBytes * entries.size();
    for (Entry& entry : entries) {
        entry.offset = entry.bytes > 0 ? offset : 0;
        offset += entry.bytes;
        for (const std::uint32_t number : {entry.level, entry.i, entry.j, entry.k}) head.put(number);
        head.put(entry.offset);
        head.put(entry.bytes);
        head.put(entry.min);
        head.put(entry.max);
    }
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        const auto piece = [&](std::span<const std::byte> bytes) {
            append({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
        };
        piece(head.bytes());
        for (std::size_t n = 0; n < entries.size(); ++n) {
            const Entry& e = entries[n];
            if (e.bytes == 0) continue;
            if (!data[n].empty())
                piece(data[n]);
            else
                piece(encode(brick_of(levels[e.level], first_voxel(e, options.edge), options), options.type,
                             options.scale));
        }
    });
}

namespace {

[[noreturn]] void bad(const std::string& what) { throw Error(ErrorCode::io, what); }

// The part of a file before its table.
struct Head {
    EncodedVolume volume;  // levels without bytes
    int edge = 0;
    std::uint64_t bricks = 0;
};

// Bricks without density take no bytes, so a file may be much smaller than its voxels; a few bytes must not ask for all
// memory nevertheless.
std::uint64_t most_voxel_bytes(std::size_t file_bytes) {
    constexpr std::uint64_t kAlways = std::uint64_t(256) << 20, kRatio = 2000;
    return kAlways + kRatio * file_bytes;
}

Head read_head(ByteReader& reader, std::size_t file_bytes, std::uint64_t known_bytes) {
    Head head;
    if (reader.get<std::uint64_t>() != kMark) bad("is no file of bricks");
    const auto type = reader.get<std::uint32_t>(), edge = reader.get<std::uint32_t>(),
               border = reader.get<std::uint32_t>(), levels = reader.get<std::uint32_t>();
    const auto count = reader.get<std::uint64_t>();
    if (type > 3 || edge < 8 || edge > 256 || border != kBorder || levels == 0 || levels > 32)
        bad("its head is impossible");
    head.volume.type = VoxelType(type);
    head.edge = int(edge);
    std::uint64_t bytes = 0;
    for (std::uint32_t n = 0; n < levels; ++n) {
        std::array<int, 3> size{};
        for (int& voxels : size) {
            const auto stated = reader.get<std::uint32_t>();
            if (stated == 0 || stated > 1u << 20) bad("its sizes are impossible");
            voxels = int(stated);
        }
        const std::uint64_t bricks = brick_count(size, head.edge);
        if (bricks > file_bytes / kEntryBytes) bad("its sizes are impossible");
        head.bricks += bricks;
        bytes += encoded_bytes(size[0], size[1], size[2], head.volume.type);
        if (bytes > std::max(known_bytes, most_voxel_bytes(file_bytes)))
            bad("its sizes take " + std::to_string(bytes) + " bytes of memory, too many for a file of " +
                std::to_string(file_bytes));
        head.volume.levels.push_back({size[0], size[1], size[2], {}});
    }
    if (count != head.bricks) bad("its number of bricks does not fit its sizes");
    return head;
}

Entry read_entry(ByteReader& reader) {
    Entry entry;
    for (std::uint32_t* number : {&entry.level, &entry.i, &entry.j, &entry.k})
        *number = reader.get<std::uint32_t>();
    entry.offset = reader.get<std::uint64_t>();
    entry.bytes = reader.get<std::uint64_t>();
    entry.min = reader.get<float>();
    entry.max = reader.get<float>();
    return entry;
}

[[noreturn]] void bad_brick(std::uint64_t n, const std::string& what) {
    bad("brick " + std::to_string(n) + " " + what);
}

// The range that a brick states may be of means that were rounded otherwise.
void require_range(std::uint64_t n, const Entry& entry, const std::pair<float, float>& range) {
    const double slack = 1e-6 * double(range.second) + double(std::numeric_limits<float>::min());
    if (std::abs(double(entry.min) - double(range.first)) <= slack &&
        std::abs(double(entry.max) - double(range.second)) <= slack)
        return;
    const auto text = [](float low, float high) {
        return number_text(low, 6) + " to " + number_text(high, 6);
    };
    bad_brick(n, "states values from " + text(entry.min, entry.max) + ", and has " +
                     text(range.first, range.second));
}

// Returns the codes of brick n, in its order in the table; none of an empty one.
std::span<const std::byte> brick_in(std::span<const std::byte> file, const Head& head, const Entry& entry,
                                    std::uint64_t n) {
    if (entry.bytes == 0 && entry.offset == 0) return {};
    const int side = head.edge + 2 * kBorder;
    if (entry.level >= head.volume.levels.size() ||
        entry.bytes != encoded_bytes(side, side, side, head.volume.type) || entry.offset > file.size() ||
        file.size() - entry.offset < entry.bytes)
        bad_brick(n, "lies outside of the file");
    return file.subspan(entry.offset, entry.bytes);
}

// Copies the voxels of a brick without its border into its level.
void place_brick(const Entry& entry, std::span<const std::byte> brick, int edge, VolumeLevel& level,
                 std::size_t voxel) {
    const auto range = [&](std::uint32_t index, int voxels) {
        if (index >= std::uint32_t(bricks_along(voxels, edge))) bad("a brick lies beside its level");
        const int first = int(index) * edge;
        return std::pair{first, std::min(first + edge, voxels)};
    };
    const auto [x, x_end] = range(entry.i, level.nx);
    const auto [y, y_end] = range(entry.j, level.ny);
    const auto [z, z_end] = range(entry.k, level.nz);
    const int side = edge + 2 * kBorder;
    for (int k = z; k < z_end; ++k) {
        for (int j = y; j < y_end; ++j) {
            const std::size_t from =
                                  linear_index({side, side, side}, kBorder, j - y + kBorder, k - z + kBorder),
                              to = linear_index({level.nx, level.ny, level.nz}, x, j, k);
            std::memcpy(level.bytes.data() + to * voxel, brick.data() + from * voxel,
                        std::size_t(x_end - x) * voxel);
        }
    }
}

}  // namespace

EncodedVolume read_bricks(const std::filesystem::path& path, std::uint64_t known_bytes) {
    return with_whole_file(path, [known_bytes](ByteReader& reader) {
        const std::span<const std::byte> file = reader.rest();
        Head head = read_head(reader, file.size(), known_bytes);
        for (VolumeLevel& level : head.volume.levels)
            level.bytes.resize(encoded_bytes(level.nx, level.ny, level.nz, head.volume.type));
        const std::size_t voxel = encoded_bytes(1, 1, 1, head.volume.type);
        for (std::uint64_t n = 0; n < head.bricks; ++n) {
            const Entry entry = read_entry(reader);
            const std::span<const std::byte> brick = brick_in(file, head, entry, n);
            if (brick.empty()) continue;
            place_brick(entry, brick, head.edge, head.volume.levels[entry.level], voxel);
        }
        return std::move(head.volume);
    });
}

void check_bricks(const std::filesystem::path& path, const std::vector<Volume>& levels,
                  const BrickOptions& options, float most, const std::function<double(float)>& allowed) {
    std::uint64_t voxels = 0;
    for (const Volume& level : levels) voxels += level.voxels();
    with_whole_file(path, [&](ByteReader& reader) {
        const std::span<const std::byte> file = reader.rest();
        const Head head = read_head(reader, file.size(), sizeof(float) * voxels);
        if (head.edge != options.edge || head.volume.type != options.type ||
            head.volume.levels.size() != levels.size())
            bad("its bricks are of another edge or type, or of other levels");
        std::uint64_t n = 0, end = kHeadBytes + kLevelBytes * levels.size() + kEntryBytes * head.bricks;
        for_each_brick(levels, options.edge, [&](const Entry& expected) {
            const Entry entry = read_entry(reader);
            end = std::max(end, entry.offset + entry.bytes);
            if (std::tie(entry.level, entry.i, entry.j, entry.k) !=
                std::tie(expected.level, expected.i, expected.j, expected.k))
                bad_brick(n, "is another one than its place says");
            const Volume brick = brick_of(levels[entry.level], first_voxel(entry, options.edge), options);
            require_range(n, entry, range_of(brick.values));
            const std::span<const std::byte> codes = brick_in(file, head, entry, n);
            std::vector<float> found(brick.values.size(), 0.0f);
            if (!codes.empty())
                found = decode(codes.data(), codes.size(), brick.nx, brick.ny, brick.nz, options.type,
                               options.scale)
                            .values;
            for (std::size_t v = 0; v < found.size(); ++v) {
                const float value = std::min(brick.values[v], most);
                if (!(std::abs(double(found[v]) - double(value)) <= allowed(value)))
                    bad_brick(n, "or its border has " + number_text(found[v], 6) + " in place of " +
                                     number_text(value, 6));
            }
            ++n;
        });
        if (file.size() != end) bad("it does not end behind its bricks");
        return n;
    });
}

}  // namespace nephos
