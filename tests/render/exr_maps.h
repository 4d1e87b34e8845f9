// SPDX-License-Identifier: Apache-2.0
#pragma once

// Height maps of OpenEXR for the tests of their reader, written by OpenEXR's own library, and their bytes.

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "render/terrain/height_file.h"

namespace nephos::exr_maps {

namespace fs = std::filesystem;

inline constexpr int kColumns = 20, kRows = 70;  // several chunks of each compression but DWAB
inline constexpr int kTile = 16;

// Whole numbers that a half holds.
inline std::vector<float> heights() {
    std::vector<float> values;
    for (int n = 0; n < kColumns * kRows; ++n) values.push_back(float(n / kColumns * 20 + n % kColumns));
    return values;
}

inline Imf::Header header_of(Imf::Compression compression) {
    Imf::Header header(kColumns, kRows);
    header.compression() = compression;
    header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
    return header;
}

template <typename File>
void set_pixels(File& file, const std::vector<float>& values) {
    Imf::FrameBuffer buffer;
    buffer.insert("Z", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(const_cast<float*>(values.data())),
                                  sizeof(float), sizeof(float) * kColumns));
    file.setFrameBuffer(buffer);
}

inline void write_rows(const fs::path& path, const Imf::Header& header) {
    const std::vector<float> values = heights();
    Imf::OutputFile file(path.c_str(), header, 0);
    set_pixels(file, values);
    file.writePixels(kRows);
}

inline void write_tiles(const fs::path& path, Imf::Header header) {
    const std::vector<float> values = heights();
    header.setTileDescription(Imf::TileDescription(kTile, kTile, Imf::ONE_LEVEL));
    Imf::TiledOutputFile file(path.c_str(), header, 0);
    set_pixels(file, values);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
}

inline std::string content(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

inline void write(const fs::path& path, const std::string& bytes) {
    std::ofstream(path, std::ios::binary) << bytes;
}

inline std::uint32_t number_at(const std::string& bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

// Why a file is no height map; empty: it is one.
inline std::string reason_of(const fs::path& path) {
    try {
        read_height_file(path, 0, 0);
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        return error.what();
    }
    return "";
}

}  // namespace nephos::exr_maps
