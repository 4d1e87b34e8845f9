// SPDX-License-Identifier: Apache-2.0
// Raw voxels, DDS and KTX 2.

#include <algorithm>
#include <cstring>
#include <fstream>
#include <numeric>
#include <string_view>

#include <fcntl.h>
#include <unistd.h>

#include "core/atomic_file.h"
#include "core/bytes.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "density/export/containers.h"
#include "density/export/whole_file.h"

namespace nephos {
namespace {

constexpr std::uint32_t kDdsMagic = 0x20534444;  // "DDS "
constexpr std::uint32_t kDx10 = 0x30315844, kAti1 = 0x31495441;
constexpr std::uint32_t kDdsBytes = 128, kDx10Bytes = 20;
// DXGI_FORMAT and VkFormat by VoxelType.
constexpr std::uint32_t kDxgi[] = {61, 56, 54, 41, 80};
constexpr std::uint32_t kVulkan[] = {9, 70, 76, 100, 139};
constexpr unsigned char kKtxMagic[12] = {0xAB, 'K', 'T', 'X', ' ', '2', '0', 0xBB, '\r', '\n', 0x1A, '\n'};

std::string_view text_of(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

int level_size(int n, std::size_t level) { return std::max(1, n >> level); }

void append_levels(const EncodedVolume& volume, const AppendPiece& append) {
    for (const VolumeLevel& level : volume.levels) append(text_of(level.bytes));
}

// Takes the levels that follow each other, level 0 first.
void take_levels(EncodedVolume& volume, ByteReader& reader, int nx, int ny, int nz, std::uint32_t levels) {
    for (std::uint32_t n = 0; n < levels; ++n) {
        VolumeLevel level{level_size(nx, n), level_size(ny, n), level_size(nz, n), {}};
        const std::size_t bytes = encoded_bytes(level.nx, level.ny, level.nz, volume.type);
        if (bytes > reader.rest().size())
            throw Error(ErrorCode::io, "it ends inside of level " + std::to_string(n));
        level.bytes.resize(bytes);
        reader.get_bytes(level.bytes);
        volume.levels.push_back(std::move(level));
    }
    if (!reader.rest().empty()) throw Error(ErrorCode::io, "there are bytes behind its last level");
}

void check_size(std::uint32_t nx, std::uint32_t ny, std::uint32_t nz, std::uint32_t levels) {
    constexpr std::uint32_t kMost = 1 << 20;
    if (nx < 1 || ny < 1 || nz < 1 || nx > kMost || ny > kMost || nz > kMost || levels < 1 || levels > 32)
        throw Error(ErrorCode::io, "its size is impossible");
}

// Khronos Data Format: one basic descriptor block with one sample.
std::vector<std::byte> data_format(VoxelType type) {
    const bool block = type == VoxelType::bc4, real = type == VoxelType::r16f || type == VoxelType::r32f;
    const std::uint32_t bytes = block ? 8 : type == VoxelType::r8 ? 1 : type == VoxelType::r32f ? 4 : 2;
    constexpr std::uint32_t kSamples = 1, kBlockBytes = 24 + 16 * kSamples;
    ByteWriter w;
    w.put(kBlockBytes + 4);
    w.put(std::uint32_t{0});                      // Khronos, basic format
    w.put(std::uint32_t{2} | kBlockBytes << 16);  // version 1.3
    w.put(std::uint32_t(block ? 131 : 1) | 1 << 8 |
          1 << 16);                                // BC4 or RGBSDA; BT.709, linear, straight alpha
    w.put(std::uint32_t(block ? 3 | 3 << 8 : 0));  // texels of a block, less 1
    w.put(bytes);                                  // of plane 0
    w.put(std::uint32_t{0});
    w.put((bytes * 8 - 1) << 16 | std::uint32_t(real ? 0xC0 : 0) << 24);  // bits, red, signed float
    w.put(std::uint32_t{0});
    w.put(real ? std::uint32_t{0xBF800000} : std::uint32_t{0});  // -1
    const std::uint32_t most = real ? 0x3F800000u : block ? 0xFFFFFFFFu : bytes == 1 ? 0xFFu : 0xFFFFu;
    w.put(most);
    return w.take();
}

void put_pair(ByteWriter& w, std::string_view key, std::string_view value) {
    w.put(std::uint32_t(key.size() + value.size() + 2));
    w.put_bytes(std::as_bytes(std::span(key.data(), key.size())));
    w.put(char(0));
    w.put_bytes(std::as_bytes(std::span(value.data(), value.size())));
    w.put(char(0));
    while (w.bytes().size() % 4 != 0) w.put(char(0));
}

}  // namespace

std::vector<std::byte> whole_file(const std::filesystem::path& path) {
    std::ifstream stream = open_stream(path);
    std::vector<std::byte> bytes(std::filesystem::file_size(path));
    stream.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()));
    check_reading(stream, path);
    if (std::size_t(stream.gcount()) != bytes.size()) throw ReadFailure(path, "it became shorter");
    return bytes;
}

void write_raw(const std::filesystem::path& path, const EncodedVolume& volume) {
    write_pieces_atomically(path, [&](const AppendPiece& append) { append_levels(volume, append); });
}

EncodedVolume read_raw(const std::filesystem::path& path, VoxelType type, int nx, int ny, int nz,
                       int levels) {
    return with_whole_file(path, [&](ByteReader& reader) {
        EncodedVolume volume{type, {}};
        take_levels(volume, reader, nx, ny, nz, std::uint32_t(levels));
        return volume;
    });
}

void write_dds(const std::filesystem::path& path, const EncodedVolume& volume, bool legacy) {
    const VolumeLevel& top = volume.levels.front();
    const bool block = volume.type == VoxelType::bc4;
    if (legacy && !block && volume.type != VoxelType::r8)
        throw Error(ErrorCode::usage, "a DDS file with the old header holds r8 or bc4, not " +
                                          std::string(type_name(volume.type)));
    const auto levels = std::uint32_t(volume.levels.size());
    ByteWriter w;
    w.put(kDdsMagic);
    w.put(std::uint32_t{124});
    // Caps, height, width, pixel format, depth; pitch or linear size; mip maps.
    w.put(std::uint32_t{0x801007} | (block ? 0x80000u : 0x8u) | (levels > 1 ? 0x20000u : 0u));
    w.put(std::uint32_t(top.ny));
    w.put(std::uint32_t(top.nx));
    w.put(std::uint32_t(block ? encoded_bytes(top.nx, top.ny, 1, volume.type)
                              : encoded_bytes(top.nx, 1, 1, volume.type)));
    w.put(std::uint32_t(top.nz));
    w.put(levels);
    for (int n = 0; n < 11; ++n) w.put(std::uint32_t{0});
    w.put(std::uint32_t{32});  // the pixel format
    const bool luminance = legacy && !block;
    w.put(luminance ? std::uint32_t{0x20000} : std::uint32_t{4});
    w.put(luminance ? std::uint32_t{0} : legacy ? kAti1 : kDx10);
    w.put(std::uint32_t(luminance ? 8 : 0));
    w.put(std::uint32_t(luminance ? 0xFF : 0));
    for (int n = 0; n < 3; ++n) w.put(std::uint32_t{0});
    w.put(std::uint32_t{0x1000 | 0x400008} & ~(levels > 1 ? 0u : 0x400000u));  // texture, complex; mip maps
    w.put(std::uint32_t{0x200000});                                            // volume
    for (int n = 0; n < 3; ++n) w.put(std::uint32_t{0});
    if (!legacy) {
        w.put(kDxgi[std::size_t(volume.type)]);
        for (const std::uint32_t value : {4u, 0u, 1u, 0u}) w.put(value);  // 3-D, one of them
    }
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        append(text_of(w.bytes()));
        append_levels(volume, append);
    });
}

EncodedVolume read_dds(const std::filesystem::path& path) {
    return with_whole_file(path, [&](ByteReader& reader) {
        std::uint32_t head[32];
        if (reader.rest().size() < kDdsBytes) throw Error(ErrorCode::io, "it is no DDS file");
        reader.get_bytes(std::as_writable_bytes(std::span(head)));
        if (head[0] != kDdsMagic || head[1] != 124) throw Error(ErrorCode::io, "it is no DDS file");
        EncodedVolume volume;
        if (head[21] == kDx10) {
            const auto dxgi = reader.get<std::uint32_t>();
            reader.skip(kDx10Bytes - 4);
            const auto* found = std::find(std::begin(kDxgi), std::end(kDxgi), dxgi);
            if (found == std::end(kDxgi))
                throw Error(ErrorCode::io, "its format " + std::to_string(dxgi) + " is not supported");
            volume.type = VoxelType(found - std::begin(kDxgi));
        } else if (head[21] == kAti1) {
            volume.type = VoxelType::bc4;
        } else if (head[21] != 0 || head[22] != 8) {
            throw Error(ErrorCode::io, "its format is not supported");
        }
        const std::uint32_t levels = std::max<std::uint32_t>(1, head[7]);
        check_size(head[4], head[3], head[6], levels);
        take_levels(volume, reader, int(head[4]), int(head[3]), int(head[6]), levels);
        return volume;
    });
}

void write_ktx2(const std::filesystem::path& path, const EncodedVolume& volume,
                const std::string& description) {
    const VolumeLevel& top = volume.levels.front();
    const bool block = volume.type == VoxelType::bc4;
    const std::uint32_t unit = block                            ? 8
                               : volume.type == VoxelType::r8   ? 1
                               : volume.type == VoxelType::r32f ? 4
                                                                : 2;
    const std::vector<std::byte> format = data_format(volume.type);
    ByteWriter pairs;
    put_pair(pairs, "KTXorientation", "ruo");  // x right, y up, z out
    put_pair(pairs, "KTXwriter", "nephos");
    put_pair(pairs, "nephos", description);
    const auto levels = std::uint32_t(volume.levels.size());
    const std::size_t begin = 80 + 24 * volume.levels.size();
    const std::size_t head = begin + format.size() + pairs.bytes().size();
    const std::size_t alignment = std::lcm(std::size_t(unit), std::size_t(4));
    // The smallest level stands first.
    std::vector<std::size_t> offsets(volume.levels.size());
    std::size_t end = head;
    for (std::size_t n = volume.levels.size(); n-- > 0;) {
        offsets[n] = (end + alignment - 1) / alignment * alignment;
        end = offsets[n] + volume.levels[n].bytes.size();
    }
    ByteWriter w;
    w.put_bytes(std::as_bytes(std::span(kKtxMagic)));
    for (const std::uint32_t value :
         {kVulkan[std::size_t(volume.type)], block ? 1u : unit, std::uint32_t(top.nx), std::uint32_t(top.ny),
          std::uint32_t(top.nz), 0u, 1u, levels, 0u})
        w.put(value);
    w.put(std::uint32_t(begin));
    w.put(std::uint32_t(format.size()));
    w.put(std::uint32_t(begin + format.size()));
    w.put(std::uint32_t(pairs.bytes().size()));
    w.put(std::uint64_t{0});
    w.put(std::uint64_t{0});
    for (std::size_t n = 0; n < volume.levels.size(); ++n) {
        w.put(std::uint64_t(offsets[n]));
        w.put(std::uint64_t(volume.levels[n].bytes.size()));
        w.put(std::uint64_t(volume.levels[n].bytes.size()));
    }
    w.put_bytes(format);
    w.put_bytes(pairs.bytes());
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        append(text_of(w.bytes()));
        std::size_t at = head;
        for (std::size_t n = volume.levels.size(); n-- > 0;) {
            append(std::string(offsets[n] - at, '\0'));
            append(text_of(volume.levels[n].bytes));
            at = offsets[n] + volume.levels[n].bytes.size();
        }
    });
}

EncodedVolume read_ktx2(const std::filesystem::path& path) {
    return with_whole_file(path, [&](ByteReader& reader) {
        const std::span<const std::byte> all = reader.rest();
        unsigned char magic[12];
        std::uint32_t head[9];
        if (all.size() < 80) throw Error(ErrorCode::io, "it is no KTX 2 file");
        reader.get_bytes(std::as_writable_bytes(std::span(magic)));
        reader.get_bytes(std::as_writable_bytes(std::span(head)));
        if (!std::equal(std::begin(magic), std::end(magic), std::begin(kKtxMagic)))
            throw Error(ErrorCode::io, "it is no KTX 2 file");
        reader.skip(32);
        const auto* found = std::find(std::begin(kVulkan), std::end(kVulkan), head[0]);
        if (found == std::end(kVulkan) || head[8] != 0)
            throw Error(ErrorCode::io, "its format is not supported");
        EncodedVolume volume{VoxelType(found - std::begin(kVulkan)), {}};
        check_size(head[2], head[3], head[4], head[7]);
        std::uint64_t end = 0;
        for (std::uint32_t n = 0; n < head[7]; ++n) {
            const auto offset = reader.get<std::uint64_t>(), bytes = reader.get<std::uint64_t>();
            reader.skip(std::min<std::size_t>(8, reader.rest().size()));
            VolumeLevel level{
                level_size(int(head[2]), n), level_size(int(head[3]), n), level_size(int(head[4]), n), {}};
            if (bytes != encoded_bytes(level.nx, level.ny, level.nz, volume.type) || offset > all.size() ||
                bytes > all.size() - offset)
                throw Error(ErrorCode::io, "it ends inside of level " + std::to_string(n));
            const auto part = all.subspan(std::size_t(offset), std::size_t(bytes));
            level.bytes.assign(part.begin(), part.end());
            volume.levels.push_back(std::move(level));
            end = std::max(end, offset + bytes);
        }
        if (end != all.size()) throw Error(ErrorCode::io, "it does not end behind its levels");
        return volume;
    });
}

}  // namespace nephos
