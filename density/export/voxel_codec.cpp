// SPDX-License-Identifier: Apache-2.0
// Values as voxels of 8, 16 and 32 bits, and as BC4 (DirectX: BC4_UNORM; OpenGL: RGTC1): Khronos Data Format 1.3,
// section 18.4. Loops are plain, so that the compiler makes vectors of them.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "density/export/volume.h"
#include "density/export/voxel_kernel.h"

namespace nephos {
namespace {

// Voxels of a task: its part of source and result stays in the second-level cache.
constexpr std::size_t kTask = std::size_t(1) << 16;

// Calls convert(values, count, codes) for parts of the values.
template <class Code, class Convert>
void convert_all(const std::vector<float>& values, std::vector<std::byte>& out, const Convert& convert) {
    auto* codes = reinterpret_cast<Code*>(out.data());
    const std::size_t tasks = (values.size() + kTask - 1) / kTask;
    tbb::parallel_for(std::size_t(0), tasks, [&](std::size_t task) {
        const std::size_t begin = task * kTask, end = std::min(values.size(), begin + kTask);
        convert(values.data() + begin, end - begin, codes + begin);
    });
}

float half_value(std::uint16_t bits) {
    const std::uint32_t sign = std::uint32_t(bits & 0x8000) << 16, rest = std::uint32_t(bits & 0x7FFF) << 13;
    // Infinities and what is no number have all bits of the exponent set in either width.
    if ((bits & 0x7C00) == 0x7C00) return std::bit_cast<float>(sign | 0x7F800000 | rest);
    return std::bit_cast<float>(sign | std::bit_cast<std::uint32_t>(std::bit_cast<float>(rest) * 0x1p112f));
}

void encode_bc4(const Volume& v, float to_code, std::vector<std::byte>& out) {
    const int bx = (v.nx + 3) / 4, by = (v.ny + 3) / 4;
    tbb::parallel_for(0, v.nz, [&](int k) {
        const float* slice = v.values.data() + std::size_t(k) * std::size_t(v.nx) * std::size_t(v.ny);
        std::byte* to = out.data() + std::size_t(k) * std::size_t(bx) * std::size_t(by) * 8;
        const auto whole = std::size_t(v.nx / 4);
        for (int j = 0; j < by; ++j, to += std::size_t(bx) * 8) {
            const float* rows[4];
            for (int y = 0; y < 4; ++y)
                rows[y] = slice + std::size_t(std::min(4 * j + y, v.ny - 1)) * std::size_t(v.nx);
            auto* blocks = reinterpret_cast<std::uint8_t*>(to);
            to_bc4_blocks(rows[0], rows[1], rows[2], rows[3], whole, to_code, blocks);
            if (v.nx % 4 == 0) continue;
            // The last voxels of each row are repeated.
            float rest[4][4];
            for (std::size_t y = 0; y < 4; ++y)
                for (std::size_t x = 0; x < 4; ++x)
                    rest[y][x] = rows[y][std::min(4 * whole + x, std::size_t(v.nx) - 1)];
            to_bc4_blocks(rest[0], rest[1], rest[2], rest[3], 1, to_code, blocks + 8 * whole);
        }
    });
}

void decode_bc4(const std::byte* bytes, Volume& v, float scale) {
    const int bx = (v.nx + 3) / 4, by = (v.ny + 3) / 4;
    for (int k = 0; k < v.nz; ++k) {
        for (int j = 0; j < by; ++j) {
            for (int i = 0; i < bx; ++i, bytes += 8) {
                std::uint64_t bits;
                std::memcpy(&bits, bytes, 8);
                const float first = float(bits & 255), second = float(bits >> 8 & 255);
                float palette[8] = {first, second};
                for (int n = 2; n < 8; ++n) {
                    palette[n] = first > second ? (float(8 - n) * first + float(n - 1) * second) / 7
                                 : n < 6        ? (float(6 - n) * first + float(n - 1) * second) / 5
                                                : (n == 6 ? 0.0f : 255.0f);
                }
                for (int n = 0; n < 16; ++n) {
                    const int x = 4 * i + (n & 3), y = 4 * j + (n >> 2);
                    if (x >= v.nx || y >= v.ny) continue;
                    v.values[(std::size_t(k) * std::size_t(v.ny) + std::size_t(y)) * std::size_t(v.nx) +
                             std::size_t(x)] = palette[bits >> (16 + 3 * n) & 7] / 255 * scale;
                }
            }
        }
    }
}

}  // namespace

std::string_view type_name(VoxelType type) {
    constexpr std::string_view kNames[] = {"r8", "r16", "r16f", "r32f", "bc4"};
    return kNames[std::size_t(type)];
}

std::size_t encoded_bytes(int nx, int ny, int nz, VoxelType type) {
    if (type == VoxelType::bc4)
        return std::size_t((nx + 3) / 4) * std::size_t((ny + 3) / 4) * std::size_t(nz) * 8;
    const std::size_t bytes = type == VoxelType::r8 ? 1 : type == VoxelType::r32f ? 4 : 2;
    return std::size_t(nx) * std::size_t(ny) * std::size_t(nz) * bytes;
}

std::uint64_t encoded_bytes(const std::vector<std::array<int, 3>>& sizes, VoxelType type) {
    std::uint64_t bytes = 0;
    for (const std::array<int, 3>& size : sizes) bytes += encoded_bytes(size[0], size[1], size[2], type);
    return bytes;
}

std::vector<std::byte> encode(const Volume& volume, VoxelType type, float scale) {
    std::vector<std::byte> out(encoded_bytes(volume.nx, volume.ny, volume.nz, type));
    const float inverse = 1 / scale;
    switch (type) {
        case VoxelType::r8:
            convert_all<std::uint8_t>(volume.values, out,
                                      [&](const float* values, std::size_t count, std::uint8_t* codes) {
                                          to_codes(values, count, 255 * inverse, codes);
                                      });
            break;
        case VoxelType::r16:
            convert_all<std::uint16_t>(volume.values, out,
                                       [&](const float* values, std::size_t count, std::uint16_t* codes) {
                                           to_codes(values, count, 65535 * inverse, codes);
                                       });
            break;
        case VoxelType::r16f:
            convert_all<std::uint16_t>(volume.values, out,
                                       [&](const float* values, std::size_t count, std::uint16_t* halves) {
                                           to_halves(values, count, inverse, halves);
                                       });
            break;
        case VoxelType::r32f:
            convert_all<float>(volume.values, out,
                               [&](const float* values, std::size_t count, float* scaled) {
                                   for (std::size_t n = 0; n < count; ++n) scaled[n] = values[n] * inverse;
                               });
            break;
        case VoxelType::bc4:
            encode_bc4(volume, 255 * inverse, out);
            break;
    }
    return out;
}

Volume decode(const std::byte* bytes, std::size_t count, int nx, int ny, int nz, VoxelType type,
              float scale) {
    if (count != encoded_bytes(nx, ny, nz, type))
        throw Error(ErrorCode::io, "its voxels are not of the size that it states");
    Volume volume{nx, ny, nz, std::vector<float>(std::size_t(nx) * std::size_t(ny) * std::size_t(nz))};
    std::vector<float>& values = volume.values;
    if (type == VoxelType::bc4) {
        decode_bc4(bytes, volume, scale);
    } else if (type == VoxelType::r32f) {
        std::memcpy(values.data(), bytes, count);
        for (float& value : values) value *= scale;
    } else if (type == VoxelType::r8) {
        for (std::size_t n = 0; n < values.size(); ++n)
            values[n] = float(std::to_integer<int>(bytes[n])) / 255 * scale;
    } else {
        for (std::size_t n = 0; n < values.size(); ++n) {
            std::uint16_t code;
            std::memcpy(&code, bytes + 2 * n, 2);
            values[n] = (type == VoxelType::r16f ? half_value(code) : float(code) / 65535) * scale;
        }
    }
    return volume;
}

double largest_error(VoxelType type) {
    switch (type) {
        case VoxelType::r8:
            return 1.0 / 510;
        case VoxelType::r16:
            return 1.0 / 131070;
        case VoxelType::r16f:
            return 0x1p-11;
        case VoxelType::bc4:
            return 1.0 / 14 + 1.0 / 255;
        case VoxelType::r32f:
            break;
    }
    return 0x1p-22;  // scaled, and scaled back: three roundings
}

}  // namespace nephos
