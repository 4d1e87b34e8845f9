// SPDX-License-Identifier: Apache-2.0
// NanoVDB files as the confined process parses them, called in the open. An input is no file, as most of one is nothing but zeros:
// its first byte chooses one of six that nephos writes, the second whether the checksum of its head is made right again, and each
// twelve that follow change some bytes of it.

#include <algorithm>
#include <cstring>
#include <exception>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <zlib.h>

#include "density/export/nanovdb_file.h"
#include "density/export/nanovdb_stream.h"
#include "tests/fuzz/sent.h"
#include "tests/fuzz/target.h"

namespace {

using namespace nephos;

constexpr Extent kExtent{4112, 16, 8};  // of two nodes below the root

// Places in the format (NanoVDB 32), bytes: of the file, and of its grid.
constexpr std::size_t kFileSize = 24, kHead = 192;
constexpr std::size_t kChecksum = 8, kChecked = 16, kTree = 672, kFirstUpper = kTree + 16;

template <class T>
T number_at(const std::string& bytes, std::size_t at) {
    T number{};
    fuzz::require(at + sizeof number <= bytes.size(), "a number of the file");
    std::memcpy(&number, bytes.data() + at, sizeof number);
    return number;
}

template <class T>
void put_number(std::string& bytes, std::size_t at, T number) {
    if (at + sizeof number <= bytes.size()) std::memcpy(bytes.data() + at, &number, sizeof number);
}

// Holds a file that nephos writes, its grid uncompressed, and the places of its bytes that are not 0.
struct Original {
    std::string bytes;
    std::size_t grid = 0;       // first byte of the grid
    std::size_t head_size = 0;  // of the grid, with its root
    bool is_packed = false;     // once it is a file
    std::vector<std::size_t> places;
};

DensityGrid density() {
    std::vector<float> values(std::size_t(kExtent.cells()));
    const auto at = [&](int x, int y, int z) -> float& {
        return values[std::size_t((z * kExtent.y + y) * kExtent.x + x)];
    };
    for (int z = 0; z < 8; ++z)
        for (int y = 0; y < 8; ++y)
            for (int x = 0; x < 8; ++x) {
                at(x, y, z) = float(x + y * z) / 64;
                at(x + 128, y + 8, z) = 0.5F;  // a block of one value
                at(x + 4096, y, z) = float(x * y + z) / 64;
            }
    return DensityGrid::from_dense(values, kExtent, {{100, 200, 300}, 50});
}

std::string file_of(NanoCodec codec, NanoQuantise quantise) {
    const fuzz::Names folder;
    const std::filesystem::path path = folder.path() / "original.nvdb";
    write_nanovdb(path, density(), codec, quantise);
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

Original written(NanoCodec codec, NanoQuantise quantise) {
    Original original;
    original.is_packed = codec == NanoCodec::zip;
    original.grid = kHead + sizeof "density";
    original.bytes = file_of(codec, quantise).substr(0, original.grid) +
                     file_of(NanoCodec::none, quantise).substr(original.grid);
    original.head_size = kTree + number_at<std::uint64_t>(original.bytes, original.grid + kFirstUpper);
    for (std::size_t n = 0; n < original.bytes.size(); ++n)
        if (original.bytes[n] != 0) original.places.push_back(n);
    return original;
}

const Original& original_of(std::size_t n) {
    static const std::vector<Original> originals = [] {
        std::vector<Original> all;
        for (const NanoCodec codec : {NanoCodec::none, NanoCodec::zip})
            for (const NanoQuantise quantise : {NanoQuantise::none, NanoQuantise::fp8, NanoQuantise::fp16})
                all.push_back(written(codec, quantise));
        return all;
    }();
    return originals[n % originals.size()];
}

// Changes bytes as a record says: bytes 0 and 1 choose a place that is not 0, 2 a signed distance from it, 3 how many bytes (or that
// the file ends there), and 4 to 11 what they become.
void change(std::string& bytes, const Original& original, const std::uint8_t* record) {
    const std::size_t chosen = std::size_t(record[0] | record[1] << 8) % original.places.size();
    const auto beside = std::int64_t(static_cast<std::int8_t>(record[2]));
    const std::int64_t at = std::int64_t(original.places[chosen]) + beside;
    if (at < 0 || at >= std::int64_t(bytes.size())) return;
    constexpr unsigned kCut = 4;
    const unsigned width = record[3] % 5;
    if (width == kCut) return bytes.resize(std::size_t(at));
    const std::size_t count = std::min(std::size_t(1) << width, bytes.size() - std::size_t(at));
    std::memcpy(bytes.data() + at, record + 4, count);
}

void mend_checksum(std::string& bytes, const Original& original) {
    if (bytes.size() < original.grid + original.head_size) return;
    const uLong sum = crc32(0, reinterpret_cast<const Bytef*>(bytes.data() + original.grid + kChecked),
                            uInt(original.head_size - kChecked));
    put_number(bytes, original.grid + kChecksum, std::uint32_t(sum));
}

std::string packed(const std::string& bytes, const Original& original) {
    if (bytes.size() < original.grid) return bytes;
    const auto grid = bytes.size() - original.grid;
    std::vector<Bytef> compressed(compressBound(grid));
    uLongf size = compressed.size();
    const int status = compress2(compressed.data(), &size,
                                 reinterpret_cast<const Bytef*>(bytes.data() + original.grid), grid, 1);
    fuzz::require(status == Z_OK, "zlib compresses");
    const std::uint64_t stated = size;
    std::string file = bytes.substr(0, original.grid);
    file.append(reinterpret_cast<const char*>(&stated), sizeof stated);
    file.append(reinterpret_cast<const char*>(compressed.data()), size);
    put_number(file, kFileSize, std::uint64_t(sizeof stated + size));
    return file;
}

std::string sent_of(const fuzz::InputFile& file) {
    fuzz::InputFile sent({});
    SandboxWriter writer(sent.descriptor());
    send_nanovdb(file.descriptor(), kExtent, writer);
    writer.flush();
    return fuzz::sent_to(sent);
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    constexpr std::size_t kStart = 2, kRecord = 12, kMostRecords = 64;
    if (size < kStart) return 0;
    const Original& original = original_of(data[0]);
    std::string bytes = original.bytes;
    for (std::size_t at = kStart; at + kRecord <= std::min(size, kStart + kMostRecords * kRecord);
         at += kRecord)
        change(bytes, original, data + at);
    if (data[1] % 2 != 0) mend_checksum(bytes, original);
    if (original.is_packed) bytes = packed(bytes, original);
    const fuzz::InputFile file(bytes);
    try {
        fuzz::Sent sent(sent_of(file));
        fuzz::accepts([&] { receive_nanovdb(sent, kExtent); });
    } catch (const std::exception& error) {
        // Documented in nanovdb_stream.h; read_nanovdb() makes an Error of it.
        fuzz::require(error.what()[0] != '\0', "an error has a message");
    }
    return 0;
}
