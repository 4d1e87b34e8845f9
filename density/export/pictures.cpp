// SPDX-License-Identifier: Apache-2.0
// VTK ImageData, and slices as a PNG.

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <new>
#include <string_view>

#include <zlib.h>

#include "core/atomic_file.h"
#include "core/png/png_input.h"
#include "core/text.h"
#include "density/export/containers.h"
#include "density/export/png_bytes.h"
#include "density/export/whole_file.h"

namespace nephos {
namespace {

constexpr std::size_t kZipBlock = std::size_t(1) << 18;  // bytes before compression

std::string triple(double a, double b, double c) {
    return number_text(a) + " " + number_text(b) + " " + number_text(c);
}

std::string_view vtk_type(VoxelType type) {
    switch (type) {
        case VoxelType::r8:
            return "UInt8";
        case VoxelType::r16:
            return "UInt16";
        case VoxelType::r32f:
            return "Float32";
        default:
            throw Error(ErrorCode::usage,
                        "a VTI file holds r8, r16 or r32f, not " + std::string(type_name(type)));
    }
}

// Blocks of zlib behind their table: number, size, size of the last one (0 if whole), compressed sizes.
std::vector<std::byte> zipped(const std::vector<std::byte>& bytes) {
    ByteWriter table, blocks;
    const std::size_t count = (bytes.size() + kZipBlock - 1) / kZipBlock;
    table.put(std::uint64_t(count));
    table.put(std::uint64_t(kZipBlock));
    table.put(std::uint64_t(bytes.size() % kZipBlock));
    std::vector<std::byte> out(compressBound(uLong(kZipBlock)));
    for (std::size_t n = 0; n < count; ++n) {
        const std::size_t size = std::min(kZipBlock, bytes.size() - n * kZipBlock);
        uLongf length = uLongf(out.size());
        const int status =
            compress2(reinterpret_cast<Bytef*>(out.data()), &length,
                      reinterpret_cast<const Bytef*>(bytes.data() + n * kZipBlock), uLong(size), 1);
        if (status == Z_MEM_ERROR) throw std::bad_alloc();
        if (status != Z_OK) throw Error(ErrorCode::io, "zlib cannot compress");
        table.put(std::uint64_t(length));
        blocks.put_bytes(std::span(out).first(length));
    }
    table.put_bytes(blocks.bytes());
    return table.take();
}

// zlib's format packs at most 1,032 bytes into one: what states more is damaged, and needs no memory.
std::uint64_t most_inflated(std::uint64_t packed) { return 1032 * packed + 1024; }

std::vector<std::byte> unzipped(ByteReader& reader) {
    const auto count = reader.get<std::uint64_t>(), block = reader.get<std::uint64_t>(),
               last = reader.get<std::uint64_t>();
    if (count > reader.rest().size() / 8 || block > (std::uint64_t(1) << 30) || last > block)
        throw Error(ErrorCode::io, "its table of blocks is damaged");
    std::vector<std::uint64_t> sizes(count);
    for (std::uint64_t& size : sizes) size = reader.get<std::uint64_t>();
    const auto size_of = [&](std::size_t n) { return n + 1 == sizes.size() && last != 0 ? last : block; };
    std::uint64_t left = reader.rest().size(), all = 0;
    for (std::size_t n = 0; n < sizes.size(); ++n) {
        if (sizes[n] > left) throw Error(ErrorCode::io, "it ends inside of a block");
        if (size_of(n) > most_inflated(sizes[n]))
            throw Error(ErrorCode::io, "a block states more bytes than it can hold");
        left -= sizes[n];
        all += size_of(n);
    }
    std::vector<std::byte> out;
    out.reserve(std::size_t(all));
    for (std::size_t n = 0; n < sizes.size(); ++n) {
        const std::uint64_t size = size_of(n);
        const std::size_t at = out.size();
        out.resize(at + std::size_t(size));
        uLongf length = uLongf(size);
        const int status = uncompress(reinterpret_cast<Bytef*>(out.data() + at), &length,
                                      reinterpret_cast<const Bytef*>(reader.rest().data()), uLong(sizes[n]));
        if (status == Z_MEM_ERROR) throw std::bad_alloc();
        if (status != Z_OK || length != size) throw Error(ErrorCode::io, "a block is damaged");
        reader.skip(std::size_t(sizes[n]));
    }
    return out;
}

// The value of an attribute in our own XML.
std::string_view attribute(std::string_view xml, std::string_view name) {
    const std::string key = " " + std::string(name) + "=\"";
    const std::size_t at = xml.find(key);
    if (at == xml.npos) throw Error(ErrorCode::io, "its attribute " + std::string(name) + " is missing");
    const std::size_t begin = at + key.size();
    return xml.substr(begin, xml.find('"', begin) - begin);
}

// Throws Error(io) unless a text is so many numbers.
template <std::size_t Count>
std::array<double, Count> numbers_of(std::string_view text) {
    std::array<double, Count> numbers{};
    const char *at = text.data(), *end = at + text.size();
    for (double& number : numbers) {
        while (at < end && *at == ' ') ++at;
        const auto [after, error] = std::from_chars(at, end, number);
        if (error != std::errc()) throw Error(ErrorCode::io, "a number is missing in its head");
        at = after;
    }
    return numbers;
}

VtiPlace place_of(std::string_view xml) {
    constexpr std::string_view kTime = "Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">";
    const std::size_t time = xml.find(kTime);
    if (time == xml.npos) throw Error(ErrorCode::io, "its time is missing");
    const std::string_view rest = xml.substr(time + kTime.size());
    return {numbers_of<3>(attribute(xml, "Origin")), numbers_of<3>(attribute(xml, "Spacing")),
            numbers_of<1>(rest.substr(0, rest.find('<')))[0]};
}

// All before the voxels.
std::string vti_head(const std::array<int, 3>& size, VoxelType type, const VtiPlace& place, bool zip) {
    const std::string extent = "0 " + std::to_string(size[0] - 1) + " 0 " + std::to_string(size[1] - 1) +
                               " 0 " + std::to_string(size[2] - 1);
    std::string xml =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" "
        "header_type=\"UInt64\"";
    if (zip) xml += " compressor=\"vtkZLibDataCompressor\"";
    xml += ">\n<ImageData WholeExtent=\"" + extent + "\" Origin=\"" +
           triple(place.first_m[0], place.first_m[1], place.first_m[2]) + "\" Spacing=\"" +
           triple(place.voxel_m[0], place.voxel_m[1], place.voxel_m[2]) +
           "\" Direction=\"1 0 0 0 1 0 0 0 1\">\n";
    xml +=
        "<FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">" +
        number_text(place.time_s) + "</DataArray></FieldData>\n";
    xml += "<Piece Extent=\"" + extent + "\">\n<PointData Scalars=\"density\"><DataArray type=\"" +
           std::string(vtk_type(type)) +
           "\" Name=\"density\" format=\"appended\" "
           "offset=\"0\"/></PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_";
    return xml;
}

constexpr std::string_view kVtiEnd = "\n</AppendedData>\n</VTKFile>\n";

}  // namespace

void write_vti(const std::filesystem::path& path, const EncodedVolume& volume, const VtiPlace& place,
               bool zip) {
    const VolumeLevel& top = volume.levels.front();
    const std::string xml = vti_head({top.nx, top.ny, top.nz}, volume.type, place, zip);
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        append(xml);
        std::vector<std::byte> packed;
        if (zip) packed = zipped(top.bytes);
        const std::uint64_t size = top.bytes.size();
        if (!zip) append({reinterpret_cast<const char*>(&size), sizeof size});
        const std::vector<std::byte>& data = zip ? packed : top.bytes;
        append({reinterpret_cast<const char*>(data.data()), data.size()});
        append(kVtiEnd);
    });
}

EncodedVolume read_vti(const std::filesystem::path& path, VtiPlace* place) {
    return with_whole_file(path, [&](ByteReader& reader) {
        const std::span<const std::byte> all = reader.rest();
        const std::string_view text(reinterpret_cast<const char*>(all.data()), all.size());
        constexpr std::string_view kMark = "<AppendedData encoding=\"raw\">\n_";
        const std::size_t mark = text.substr(0, 4096).find(kMark);
        if (mark == text.npos) throw Error(ErrorCode::io, "it is no VTI file of nephos");
        const std::string_view xml = text.substr(0, mark), extent = attribute(xml, "WholeExtent");
        int bounds[6] = {};
        const char* at = extent.data();
        for (int& bound : bounds) {
            while (at < extent.data() + extent.size() && *at == ' ') ++at;
            at = std::from_chars(at, extent.data() + extent.size(), bound).ptr;
        }
        const std::size_t points = xml.find("<PointData");
        constexpr int kMostSide = 1 << 20;
        if (points == xml.npos ||
            std::ranges::any_of(bounds, [](int bound) { return bound < 0 || bound >= kMostSide; }))
            throw Error(ErrorCode::io, "it is no VTI file of nephos");
        EncodedVolume volume{VoxelType::r32f, {}};
        const std::string_view type = attribute(xml.substr(points), "type");
        for (const VoxelType one : {VoxelType::r8, VoxelType::r16, VoxelType::r32f})
            if (vtk_type(one) == type) volume.type = one;
        VolumeLevel level{bounds[1] + 1, bounds[3] + 1, bounds[5] + 1, {}};
        const VtiPlace stated = place_of(xml);
        const bool zip = xml.find("vtkZLibDataCompressor") != xml.npos;
        if (text.substr(0, mark + kMark.size()) !=
            vti_head({level.nx, level.ny, level.nz}, volume.type, stated, zip))
            throw Error(ErrorCode::io, "its head is not as nephos writes it");
        if (place != nullptr) *place = stated;
        reader.skip(mark + kMark.size());
        if (zip) {
            level.bytes = unzipped(reader);
        } else {
            const auto size = reader.get<std::uint64_t>();
            if (size > reader.rest().size()) throw Error(ErrorCode::io, "it ends inside of its voxels");
            level.bytes.assign(reader.rest().begin(), reader.rest().begin() + std::ptrdiff_t(size));
            reader.skip(std::size_t(size));
        }
        if (text.substr(text.size() - reader.rest().size()) != kVtiEnd)
            throw Error(ErrorCode::io, "it does not end behind its voxels as nephos writes it");
        if (level.nx < 1 || level.ny < 1 || level.nz < 1 ||
            level.bytes.size() != encoded_bytes(level.nx, level.ny, level.nz, volume.type))
            throw Error(ErrorCode::io, "its voxels are not of the size that it states");
        volume.levels.push_back(std::move(level));
        return volume;
    });
}

namespace {

std::string xml_attribute(std::string_view text) {
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '"':
                out += "&quot;";
                break;
            default:
                out += c;
        }
    }
    return out;
}

}  // namespace

std::string pvd_text(const std::vector<PvdEntry>& entries) {
    std::string text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" "
        "byte_order=\"LittleEndian\">\n<Collection>\n";
    for (const PvdEntry& entry : entries)
        text += "<DataSet timestep=\"" + number_text(entry.time_s) + "\" group=\"\" part=\"0\" file=\"" +
                xml_attribute(entry.file) + "\"/>\n";
    return text + "</Collection>\n</VTKFile>\n";
}

int slice_columns(int nx, int ny, int nz) {
    return std::clamp(int(std::lround(std::sqrt(double(nz) * ny / nx))), 1, nz);
}

void write_slices(const std::filesystem::path& path, const EncodedVolume& volume, int columns) {
    if (volume.type != VoxelType::r8 && volume.type != VoxelType::r16)
        throw Error(ErrorCode::usage, "slices hold r8 or r16, not " + std::string(type_name(volume.type)));
    const VolumeLevel& top = volume.levels.front();
    const std::size_t bytes = volume.type == VoxelType::r8 ? 1 : 2;
    const int rows = (top.nz + columns - 1) / columns;
    const std::size_t row_bytes = std::size_t(top.nx) * bytes;
    PngShape shape;
    shape.width = std::uint32_t(top.nx) * std::uint32_t(columns);
    shape.height = std::uint32_t(top.ny) * std::uint32_t(rows);
    shape.bits = int(8 * bytes);
    const std::string png = png_bytes(path, shape, [&](std::uint32_t line, std::span<std::byte> row) {
        const int r = int(line) / top.ny, y = int(line) % top.ny;
        for (int c = 0; c < columns; ++c) {
            const int k = r * columns + c;
            std::byte* to = row.data() + std::size_t(c) * row_bytes;
            if (k >= top.nz)
                std::fill_n(to, row_bytes, std::byte{0});
            else
                std::memcpy(
                    to, top.bytes.data() + (std::size_t(k) * std::size_t(top.ny) + std::size_t(y)) * row_bytes,
                    row_bytes);
        }
    });
    write_atomically(path, std::string_view(png));
}

EncodedVolume read_slices(const std::filesystem::path& path, int nx, int ny, int nz, int columns) {
    return with_whole_file(path, [&](ByteReader& reader) {
        PngInput picture(reader.rest(), {});
        if (picture.channels() != 1 || picture.is_interlaced())
            throw Error(ErrorCode::io, "it is no grey picture of 8 or 16 bits");
        const int rows = (nz + columns - 1) / columns;
        if (std::int64_t(picture.width()) != std::int64_t(nx) * columns ||
            std::int64_t(picture.height()) != std::int64_t(ny) * rows)
            throw Error(ErrorCode::io, "it is no picture of slices of this size");
        const std::vector<std::byte> samples = picture.samples();
        if (picture.goes_on()) throw Error(ErrorCode::io, "it goes on behind its picture");
        const std::size_t voxel = std::size_t(picture.bits() / 8), row_bytes = std::size_t(nx) * voxel;
        EncodedVolume volume{voxel == 1 ? VoxelType::r8 : VoxelType::r16, {}};
        VolumeLevel level{nx, ny, nz, std::vector<std::byte>(encoded_bytes(nx, ny, nz, volume.type))};
        for (int k = 0; k < nz; ++k) {
            for (int y = 0; y < ny; ++y) {
                const std::size_t from = ((std::size_t(k / columns) * std::size_t(ny) + std::size_t(y)) *
                                              std::size_t(picture.width()) +
                                          std::size_t(k % columns) * std::size_t(nx)) *
                                         voxel;
                std::memcpy(
                    level.bytes.data() + (std::size_t(k) * std::size_t(ny) + std::size_t(y)) * row_bytes,
                    samples.data() + from, row_bytes);
            }
        }
        volume.levels.push_back(std::move(level));
        return volume;
    });
}

}  // namespace nephos
