// SPDX-License-Identifier: Apache-2.0
#include "render/image/exr_packed.h"

#include <array>
#include <cstdint>
#include <new>
#include <stdexcept>

#include <zlib.h>

namespace nephos {
namespace {

// Rows that a channel has in a chunk.
std::uint64_t rows_of(const exr_coding_channel_info_t& channel, const exr_chunk_info_t& chunk) {
    std::uint64_t rows = 0;
    for (int y = 0; y < chunk.height; ++y)
        rows += channel.y_samples <= 1 || (chunk.start_y + y) % channel.y_samples == 0;
    return rows;
}

// Bytes of pixels before zlib packed them: a float has lost its last eight bits.
std::uint64_t pxr24_bytes(const exr_decode_pipeline_t& chunk) {
    std::uint64_t bytes = 0;
    for (int c = 0; c < chunk.channel_count; ++c) {
        const exr_coding_channel_info_t& channel = chunk.channels[c];
        const std::uint64_t size = channel.data_type == EXR_PIXEL_HALF    ? 2
                                   : channel.data_type == EXR_PIXEL_FLOAT ? 3
                                                                          : 4;
        bytes += size * std::uint64_t(channel.width) * rows_of(channel, chunk.chunk);
    }
    return bytes;
}

// Returns how many bytes a chunk unpacks to, or one more than `most`.
std::uint64_t inflated_bytes(const exr_decode_pipeline_t& chunk, std::uint64_t most) {
    z_stream stream{};
    if (inflateInit(&stream) != Z_OK) throw std::bad_alloc();
    std::array<Bytef, 16384> piece;
    stream.next_in = static_cast<Bytef*>(chunk.packed_buffer);
    stream.avail_in = uInt(chunk.chunk.packed_size);
    int result = Z_OK;
    while (result == Z_OK && stream.total_out <= most) {
        stream.next_out = piece.data();
        stream.avail_out = uInt(piece.size());
        result = inflate(&stream, Z_NO_FLUSH);
    }
    const std::uint64_t total = stream.total_out;
    inflateEnd(&stream);
    if (result == Z_MEM_ERROR) throw std::bad_alloc();
    return result == Z_STREAM_END ? total : most + 1;
}

// Bytes of a chunk whose halves are packed in blocks of 4 x 4: 3 of one that is even, else 14. Other numbers are as they are.
std::uint64_t b44_bytes(const exr_decode_pipeline_t& chunk) {
    constexpr int kEven = 13 << 2;  // the shift of one that is
    const auto* packed = static_cast<const std::uint8_t*>(chunk.packed_buffer);
    const std::uint64_t size = chunk.chunk.packed_size;
    std::uint64_t at = 0;
    for (int c = 0; c < chunk.channel_count; ++c) {
        const exr_coding_channel_info_t& channel = chunk.channels[c];
        const std::uint64_t rows = rows_of(channel, chunk.chunk), width = std::uint64_t(channel.width);
        if (channel.data_type != EXR_PIXEL_HALF) {
            at += 4 * width * rows;
            continue;
        }
        for (std::uint64_t left = (width + 3) / 4 * ((rows + 3) / 4); left > 0; --left) {
            if (at + 3 > size) return size + 1;
            at += packed[at + 2] >= kEven ? 3 : 14;
        }
    }
    return at;
}

}  // namespace

void require_all_used(const exr_decode_pipeline_t& chunk, exr_compression_t compression) {
    bool is_all = true;
    if (compression == EXR_COMPRESSION_PXR24) {
        const std::uint64_t expected = pxr24_bytes(chunk);
        is_all = inflated_bytes(chunk, expected) == expected;
    }
    if (compression == EXR_COMPRESSION_B44 || compression == EXR_COMPRESSION_B44A)
        is_all = b44_bytes(chunk) == chunk.chunk.packed_size;
    if (!is_all) throw std::runtime_error("a chunk has other pixels than those of its channels");
}

}  // namespace nephos
