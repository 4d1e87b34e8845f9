// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/height_file.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csetjmp>
#include <cstdint>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <string>

#include <fcntl.h>
#include <png.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "density/vdb/sandbox.h"
#include "render/image/exr_grid.h"
#include "render/options/height_format.h"
#include "render/terrain/height_parsers.h"

namespace nephos {
namespace {

constexpr SandboxLimits kLimits{
    .seconds = 120, .memory_bytes = std::size_t{1} << 30, .most_bytes = (std::size_t{4} << 24) + 4096};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& reason) {
    throw Error(ErrorCode::io, path.string() + ": " + reason);
}

std::string size_text(long long columns, long long rows) {
    return std::to_string(columns) + " x " + std::to_string(rows);
}

// Throws what is wrong with a size, for the child's message.
void require_size(long long columns, long long rows) {
    if (columns < 2 || rows < 2 || columns > kMostHeights || rows > kMostHeights) {
        throw std::runtime_error("is " + size_text(columns, rows) + " heights; expected 2 to " +
                                 std::to_string(kMostHeights) + " on a side");
    }
}

constexpr int kEndsEarly = -1;

// Reads `size` bytes of an open file from a place on. Returns 0, kEndsEarly, or errno of the call that failed.
int read_at(int fd, std::uint64_t from, void* to, std::size_t size) {
    auto* bytes = static_cast<char*>(to);
    while (size > 0) {
        const ssize_t got = ::pread(fd, bytes, size, off_t(from));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return errno;
        if (got == 0) return kEndsEarly;
        bytes += got;
        from += std::uint64_t(got);
        size -= std::size_t(got);
    }
    return 0;
}

struct PngSource {
    int fd = -1;
    std::uint64_t at = 0;
    int failure = 0;  // of read_at()
    char message[200] = {};
};

void read_png_bytes(png_structp png, png_bytep to, std::size_t size) {
    auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
    source->failure = read_at(source->fd, source->at, to, size);
    if (source->failure != 0) png_error(png, "it ends early");
    source->at += size;
}

[[noreturn]] void keep_png_error(png_structp png, png_const_charp message) {
    auto* source = static_cast<PngSource*>(png_get_error_ptr(png));
    std::strncpy(source->message, message, sizeof source->message - 1);
    png_longjmp(png, 1);
}
void ignore_png_warning(png_structp, png_const_charp) {}

// What a PNG is, or why it is none. libpng leaves by longjmp(): nothing here has a destructor that this would skip.
struct PngHeader {
    unsigned width = 0, height = 0;
    int depth = 0, colour = 0;
};

bool read_png_rows(PngSource& source, PngHeader& header, std::vector<std::uint16_t>& rows,
                   const std::function<void()>& begin) {
    png_structp png =
        png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, keep_png_error, ignore_png_warning);
    if (png == nullptr) throw std::bad_alloc();
    png_infop info = png_create_info_struct(png);
    volatile bool good = false;
    if (info != nullptr && setjmp(png_jmpbuf(png)) == 0) {
        png_set_user_limits(png, 1'000'000, 1'000'000);
        png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
        png_set_chunk_malloc_max(png, 0);  // they are skipped, however long
        png_set_read_fn(png, &source, read_png_bytes);
        png_read_info(png, info);
        header.width = png_get_image_width(png, info);
        header.height = png_get_image_height(png, info);
        header.depth = png_get_bit_depth(png, info);
        header.colour = png_get_color_type(png, info);
        begin();
        if (!rows.empty()) {
            // More pixels than there are, or another checksum of them, is damage.
            png_set_benign_errors(png, 0);
            png_set_swap(png);  // files have the high byte first
            const int passes = png_set_interlace_handling(png);
            png_read_update_info(png, info);
            for (int pass = 0; pass < passes; ++pass)
                for (unsigned y = 0; y < header.height; ++y)
                    png_read_row(png,
                                 reinterpret_cast<png_bytep>(rows.data() + std::size_t(y) * header.width),
                                 nullptr);
            png_read_end(png, nullptr);
        }
        good = true;
    }
    png_destroy_read_struct(&png, &info, nullptr);
    return good;
}

}  // namespace

HeightImage parse_height_png(int fd) {
    PngSource source;
    source.fd = fd;
    PngHeader header;
    std::vector<std::uint16_t> rows;
    const bool good = read_png_rows(source, header, rows, [&] {
        const bool fits = header.width >= 2 && header.height >= 2 && header.width <= unsigned(kMostHeights) &&
                          header.height <= unsigned(kMostHeights);
        if (fits && header.depth == 16 && header.colour == PNG_COLOR_TYPE_GRAY)
            rows.resize(std::size_t(header.width) * header.height);
    });
    if (source.failure > 0)
        throw std::runtime_error(std::string("cannot read: ") + std::strerror(source.failure));
    if (!good) throw std::runtime_error(std::string("cannot be read as PNG: ") + source.message);
    require_size(header.width, header.height);
    if (rows.empty()) {
        const int channels = header.colour == PNG_COLOR_TYPE_GRAY         ? 1
                             : header.colour == PNG_COLOR_TYPE_GRAY_ALPHA ? 2
                                                                          : 3;
        throw std::runtime_error("is a PNG of " + std::to_string(header.depth) + " bits" +
                                 (channels == 1 ? " of grey" : " with colours or transparency") +
                                 "; expected 16 bits of grey alone");
    }
    HeightImage image{int(header.width), int(header.height), {}};
    image.heights.assign(rows.begin(), rows.end());
    return image;
}

namespace {

void send(SandboxWriter& writer, const HeightImage& image) {
    writer.value(image.columns);
    writer.value(image.rows);
    writer.bytes(image.heights.data(), image.heights.size() * sizeof(float));
}

HeightImage received(SandboxReader& reader) {
    HeightImage image;
    image.columns = reader.value<int>();
    image.rows = reader.value<int>();
    require_size(image.columns, image.rows);
    image.heights.resize(std::size_t(image.columns) * std::size_t(image.rows));
    reader.bytes(image.heights.data(), image.heights.size() * sizeof(float));
    return image;
}

HeightImage parse_confined(const std::filesystem::path& path, const char* parser, HeightImage (*parse)(int)) {
    const Descriptor opened = open_regular_file(path, O_RDONLY);
    const int kept[] = {opened.get()};
    HeightImage image;
    run_sandboxed(
        path, parser, kLimits, kept, [&](SandboxWriter& writer) { send(writer, parse(opened.get())); },
        [&](SandboxReader& reader) { image = received(reader); });
    return image;
}

HeightImage read_raw(const std::filesystem::path& path, int columns, int rows) {
    if (columns < 2 || rows < 2 || columns > kMostHeights || rows > kMostHeights) {
        throw Error(ErrorCode::usage, path.string() +
                                          ": a raw file does not say its size; expected `raw_columns` and "
                                          "`raw_rows` in [terrain], 2 to " +
                                          std::to_string(kMostHeights) + ", not " + size_text(columns, rows));
    }
    const Descriptor opened = open_regular_file(path, O_RDONLY);
    struct stat facts {};
    if (::fstat(opened.get(), &facts) != 0) fail(path, std::strerror(errno));
    const std::size_t expected = 2 * std::size_t(columns) * std::size_t(rows);
    if (facts.st_size != off_t(expected)) {
        fail(path, "has " + std::to_string(facts.st_size) + " bytes; expected " + std::to_string(expected) +
                       ", " + size_text(columns, rows) + " numbers of 16 bits");
    }
    std::vector<std::uint8_t> bytes(expected);
    const int failure = read_at(opened.get(), 0, bytes.data(), bytes.size());
    if (failure > 0) throw ReadFailure(path, std::strerror(failure));
    if (failure != 0) fail(path, "ends early");
    HeightImage image{columns, rows, {}};
    image.heights.reserve(bytes.size() / 2);
    for (std::size_t n = 0; n < bytes.size(); n += 2)
        image.heights.push_back(float(bytes[n] | bytes[n + 1] << 8));
    return image;
}

}  // namespace

HeightFile read_height_file(const std::filesystem::path& path, int raw_columns, int raw_rows) {
    const HeightFormat format = height_format(path);
    HeightFile file;
    if (format == HeightFormat::png) {
        file.image = parse_confined(path, "libpng", parse_height_png);
    } else if (format == HeightFormat::exr) {
        file.image = parse_confined(path, "OpenEXR", [](int fd) {
            ExrGrid grid = parse_exr_grid(fd, kMostHeights);
            return HeightImage{grid.columns, grid.rows, std::move(grid.values)};
        });
        file.metres = true;
    } else if (format == HeightFormat::raw) {
        file.image = read_raw(path, raw_columns, raw_rows);
    } else {
        throw Error(ErrorCode::usage,
                    path.string() + ": is no height map by its name; expected .png, .exr, .raw or .r16");
    }
    const auto bad = std::ranges::find_if_not(
        file.image.heights, [](float z) { return std::isfinite(z) && std::abs(z) <= 1e5f; });
    if (bad != file.image.heights.end()) {
        const auto n = bad - file.image.heights.begin();
        fail(path, "has a height of " + std::to_string(double(*bad)) + " in column " +
                       std::to_string(n % file.image.columns + 1) + ", row " +
                       std::to_string(n / file.image.columns + 1) + "; expected -100,000 to 100,000 m");
    }
    return file;
}

}  // namespace nephos
