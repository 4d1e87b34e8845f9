// SPDX-License-Identifier: Apache-2.0
// Reads heights by OpenEXR's core library, which compares what each chunk gives with what its pixels take. OpenEXR's own reader
// (3.1.5) does not: of a chunk of fewer bytes its pixels are what memory held.

#include "render/image/exr_grid.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <Imath/half.h>
#include <OpenEXR/openexr.h>
#include <unistd.h>

#include "density/vdb/sandbox.h"

namespace nephos {
namespace {

// Holds the file while the library reads it by the functions below, which C calls.
struct Source {
    int fd = -1;
    std::uint64_t size = 0;
    int failure = 0;  // errno of a read
    bool has_head = false;
    char message[300] = "";
};

// Reads up to `size` bytes from a place on, fewer at the end of the file. Returns how many, or -1.
std::int64_t read_at(Source& source, void* to, std::uint64_t size, std::uint64_t from) {
    if (from >= source.size) return 0;
    std::uint64_t done = 0;
    while (done < size) {
        const ssize_t got =
            ::pread(source.fd, static_cast<char*>(to) + done, size - done, off_t(from + done));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) source.failure = errno;
        if (got < 0) return -1;
        if (got == 0) break;
        done += std::uint64_t(got);
    }
    return std::int64_t(done);
}

std::int64_t read_part(exr_const_context_t, void* user, void* to, std::uint64_t size, std::uint64_t from,
                       exr_stream_error_func_ptr_t) {
    return read_at(*static_cast<Source*>(user), to, size, from);
}

std::int64_t size_of(exr_const_context_t, void* user) {
    return std::int64_t(static_cast<Source*>(user)->size);
}

void keep_message(exr_const_context_t file, exr_result_t, const char* text) {
    void* user = nullptr;
    if (exr_get_user_data(file, &user) != EXR_ERR_SUCCESS || user == nullptr) return;
    auto* source = static_cast<Source*>(user);
    // Of the head the last one ended it, as others are gone over; of chunks the first says most.
    if (source->has_head && source->message[0] != '\0') return;
    std::strncpy(source->message, text, sizeof source->message - 1);
}

[[noreturn]] void throw_failure(int failure) {
    throw std::runtime_error(std::string(kCannotRead) + std::strerror(failure));
}

// Goes over the head of a file.
class HeadBytes {
  public:
    explicit HeadBytes(Source& source) : source_(source) {}

    char next() {
        if (at_ - begin_ >= filled_) fill();
        return buffer_[at_++ - begin_];
    }
    std::uint32_t number() {
        std::uint32_t value = 0;
        for (int n = 0; n < 4; ++n) value |= std::uint32_t(std::uint8_t(next())) << (8 * n);
        return value;
    }
    std::string text() {
        std::string found;
        while (const char c = next()) {
            found += c;
            if (found.size() > 255) throw std::runtime_error("its head has a name of more than 255 bytes");
        }
        return found;
    }
    void skip(std::uint32_t bytes) { at_ += bytes; }

  private:
    void fill() {
        const std::int64_t got = read_at(source_, buffer_.data(), buffer_.size(), at_);
        if (got < 0) throw_failure(source_.failure);
        if (got == 0) throw std::runtime_error("it ends early");
        begin_ = at_;
        filled_ = std::uint64_t(got);
    }

    Source& source_;
    std::array<char, 4096> buffer_{};
    std::uint64_t at_ = 0, begin_ = 0, filled_ = 0;
};

// Throws unless the head of the first part has what its pixels are read by, once each and as the format says: for what lacks,
// or is of another type, the library takes something else without a word, as ZIP for the compression.
void require_head(Source& source) {
    constexpr std::uint32_t kMagic = 20000630, kDeep = 1u << 11;
    struct Attribute {
        std::string_view name, type;
        std::uint32_t size;  // 0: any
        int count = 0;
    };
    std::array<Attribute, 4> needed{{{"channels", "chlist", 0},
                                     {"compression", "compression", 1},
                                     {"dataWindow", "box2i", 16},
                                     {"displayWindow", "box2i", 16}}};
    HeadBytes head(source);
    if (head.number() != kMagic) throw std::runtime_error("it is no EXR file");
    if ((head.number() & kDeep) != 0) throw std::runtime_error("it holds deep data");
    for (std::string name; !(name = head.text()).empty();) {
        const std::string type = head.text();
        std::uint32_t size = head.number();
        const auto found = std::ranges::find(needed, name, &Attribute::name);
        if (found != needed.end()) {
            if (type != found->type || (found->size != 0 && size != found->size))
                throw std::runtime_error("its " + name + " is not of the type " + std::string(found->type));
            if (++found->count > 1) throw std::runtime_error("its head has two of " + name);
            if (name == "compression") {
                const auto value = std::uint8_t(head.next());
                if (value >= EXR_COMPRESSION_LAST_TYPE)
                    throw std::runtime_error("its compression is " + std::to_string(value) +
                                             ", which is none");
                --size;
            }
        }
        head.skip(size);
    }
    for (const Attribute& attribute : needed)
        if (attribute.count == 0) throw std::runtime_error("its head has no " + std::string(attribute.name));
}

std::string text_of(const exr_attr_box2i_t& window) {
    const auto corner = [](const exr_attr_v2i_t& at) {
        return "(" + std::to_string(at.x) + " " + std::to_string(at.y) + ")";
    };
    return corner(window.min) + " to " + corner(window.max);
}

bool operator==(const exr_attr_box2i_t& a, const exr_attr_box2i_t& b) {
    return std::pair(a.min.x, a.min.y) == std::pair(b.min.x, b.min.y) &&
           std::pair(a.max.x, a.max.y) == std::pair(b.max.x, b.max.y);
}

// How much a channel of this name is expected to hold heights; 0: it is not.
int rank_of(std::string_view name) {
    constexpr std::string_view kNames[] = {"R", "height", "Y", "Z"};
    const auto* found = std::ranges::find(kNames, name);
    return found == std::end(kNames) ? 0 : int(found - kNames) + 1;
}

// Numbers of a row of a channel, which has them in the order of bytes of this machine by then.
void copy_row(const std::uint8_t* from, exr_pixel_type_t type, float* to, int count) {
    for (int n = 0; n < count; ++n) {
        std::uint32_t whole = 0;
        std::uint16_t half = 0;
        switch (type) {
            case EXR_PIXEL_HALF:
                std::memcpy(&half, from + 2 * n, sizeof half);
                to[n] = imath_half_to_float(half);
                break;
            case EXR_PIXEL_UINT:
                std::memcpy(&whole, from + 4 * n, sizeof whole);
                to[n] = float(whole);
                break;
            default:
                std::memcpy(to + n, from + 4 * n, sizeof(float));
        }
    }
}

// The first part of a file.
class Part {
  public:
    explicit Part(int fd) {
        source_.fd = fd;
        const off_t size = ::lseek(fd, 0, SEEK_END);
        if (size < 0) throw_failure(errno);
        source_.size = std::uint64_t(size);
        require_head(source_);
        exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
        options.user_data = &source_;
        options.read_fn = read_part;
        options.size_fn = size_of;
        options.error_handler_fn = keep_message;
        require(exr_start_read(&file_, "heights", &options));
        source_.has_head = true;
        source_.message[0] = '\0';
    }
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;
    ~Part() { exr_finish(&file_); }

    ExrGrid read(int most) {
        exr_storage_t storage{};
        exr_attr_box2i_t display{};
        require(exr_get_storage(file_, 0, &storage));
        require(exr_get_data_window(file_, 0, &window_));
        require(exr_get_display_window(file_, 0, &display));
        require(exr_get_compression(file_, 0, &compression_));
        const long long columns = 1LL + window_.max.x - window_.min.x,
                        rows = 1LL + window_.max.y - window_.min.y;
        if (columns < 2 || rows < 2 || columns > most || rows > most)
            throw std::runtime_error("it is " + std::to_string(columns) + " x " + std::to_string(rows) +
                                     " heights; expected 2 to " + std::to_string(most) + " on a side");
        if (!(display == window_))
            throw std::runtime_error("its data window is " + text_of(window_) + ", its display window " +
                                     text_of(display) +
                                     "; expected the same, a height in each pixel of the map");
        choose_channel();
        if (compression_ == EXR_COMPRESSION_DWAA || compression_ == EXR_COMPRESSION_DWAB)
            throw std::runtime_error(
                "its compression is DWA, of which damage goes unnoticed; expected another one, as ZIP");
        grid_ = {int(columns), int(rows), {}};
        grid_.values.resize(std::size_t(columns) * std::size_t(rows));
        if (storage == EXR_STORAGE_TILED)
            read_tiles();
        else
            read_rows();
        require_apart();
        return std::move(grid_);
    }

  private:
    void require(exr_result_t result) const {
        if (result == EXR_ERR_SUCCESS) return;
        if (source_.failure != 0) throw_failure(source_.failure);
        // Some decompressors call damage so.
        const bool is_damage = std::string_view(source_.message).starts_with("Unable to decompress");
        if (result == EXR_ERR_OUT_OF_MEMORY && !is_damage) throw std::bad_alloc();
        throw std::runtime_error(source_.message[0] != '\0' ? source_.message
                                                            : exr_get_default_error_message(result));
    }

    // The only channel, or of several the one named as a height.
    void choose_channel() {
        const exr_attr_chlist_t* channels = nullptr;
        require(exr_get_channels(file_, 0, &channels));
        const auto name = [&](int c) { return std::string_view(channels->entries[c].name.str); };
        std::string all;
        int best = 0;
        for (int c = 0; c < channels->num_channels; ++c) {
            (all += c > 0 ? ", " : "") += name(c);
            const int rank = channels->num_channels == 1 ? 1 : rank_of(name(c));
            if (rank > best) channel_ = c;
            best = std::max(best, rank);
        }
        if (channel_ < 0)
            throw std::runtime_error("its channels are " + all +
                                     "; expected one alone, or one named Z, Y, height or R");
        const exr_attr_chlist_entry_t& chosen = channels->entries[channel_];
        if (chosen.x_sampling != 1 || chosen.y_sampling != 1)
            throw std::runtime_error("its channel " + std::string(name(channel_)) +
                                     " has fewer samples than pixels");
        // The library miscounts their bytes.
        for (int c = 0; c < channels->num_channels; ++c)
            if (channels->entries[c].y_sampling > 2)
                throw std::runtime_error("its channel " + std::string(name(c)) +
                                         " has less than half the rows, of which damage goes unnoticed");
    }

    void read_rows() {
        std::int32_t rows = 0;
        require(exr_get_scanlines_per_chunk(file_, 0, &rows));
        for (std::int64_t y = window_.min.y; y <= window_.max.y; y += rows) {
            exr_chunk_info_t chunk{};
            require(exr_read_scanline_chunk_info(file_, 0, int(y), &chunk));
            read_chunk(chunk, 0, int(y - window_.min.y));
        }
    }

    // Those of full size alone.
    void read_tiles() {
        std::int32_t width = 0, height = 0;
        require(exr_get_tile_sizes(file_, 0, 0, 0, &width, &height));
        for (int y = 0; y * std::int64_t(height) < grid_.rows; ++y)
            for (int x = 0; x * std::int64_t(width) < grid_.columns; ++x) {
                exr_chunk_info_t chunk{};
                require(exr_read_tile_chunk_info(file_, 0, x, y, 0, 0, &chunk));
                read_chunk(chunk, x * width, y * height);
            }
    }

    // Puts the heights of a chunk into the grid, from this column and row on.
    void read_chunk(const exr_chunk_info_t& chunk, int column, int row) {
        if (chunk.packed_size == 0) throw std::runtime_error("a chunk of its pixels is empty");
        places_.emplace_back(chunk.data_offset, chunk.data_offset + chunk.packed_size);
        // One that did not become smaller is stored as it is.
        const bool is_raw = chunk.packed_size == chunk.unpacked_size;
        if (!is_raw && (compression_ == EXR_COMPRESSION_NONE || chunk.packed_size > chunk.unpacked_size))
            throw std::runtime_error("a chunk of its pixels has " + std::to_string(chunk.packed_size) +
                                     " bytes; expected " + std::to_string(chunk.unpacked_size));
        struct Pipeline : exr_decode_pipeline_t {
            explicit Pipeline(exr_const_context_t from) : exr_decode_pipeline_t{}, file(from) {}
            Pipeline(const Pipeline&) = delete;
            Pipeline& operator=(const Pipeline&) = delete;
            ~Pipeline() { exr_decoding_destroy(file, this); }
            exr_const_context_t file;
        } pipeline(file_);
        require(exr_decoding_initialize(file_, 0, &chunk, &pipeline));
        require(exr_decoding_choose_default_routines(file_, 0, &pipeline));
        pipeline.unpack_and_convert_fn =
            nullptr;  // what it chooses for one of several channels writes them all
        if (is_raw) pipeline.decompress_fn = nullptr;  // which does not know such chunks of B44
        require(exr_decoding_run(file_, 0, &pipeline));
        copy_heights(pipeline, column, row);
    }

    // A chunk has its rows one after the other, of each row the numbers of each channel.
    void copy_heights(const exr_decode_pipeline_t& pipeline, int column, int row) {
        const auto* from = static_cast<const std::uint8_t*>(pipeline.unpacked_buffer);
        std::uint64_t left = pipeline.chunk.unpacked_size;
        const auto short_chunk = [] { return std::runtime_error("a chunk does not have its pixels"); };
        if (column + pipeline.chunk.width > grid_.columns || row + pipeline.chunk.height > grid_.rows)
            throw short_chunk();
        for (int y = 0; y < pipeline.chunk.height; ++y)
            for (int c = 0; c < pipeline.channel_count; ++c) {
                const exr_coding_channel_info_t& channel = pipeline.channels[c];
                if (channel.y_samples > 1 && (pipeline.chunk.start_y + y) % channel.y_samples != 0) continue;
                const std::uint64_t bytes =
                    std::uint64_t(channel.width) * std::uint64_t(std::uint8_t(channel.bytes_per_element));
                if (bytes > left) throw short_chunk();
                if (c == channel_)
                    copy_row(
                        from, exr_pixel_type_t(channel.data_type),
                        &grid_
                             .values[std::size_t(row + y) * std::size_t(grid_.columns) + std::size_t(column)],
                        channel.width);
                from += bytes;
                left -= bytes;
            }
        if (left > 0) throw short_chunk();
    }

    // A size with one other bit may be that of raw pixels, which the next chunk then gives.
    void require_apart() {
        std::ranges::sort(places_);
        for (std::size_t n = 1; n < places_.size(); ++n)
            if (places_[n].first < places_[n - 1].second)
                throw std::runtime_error("two chunks of its pixels share bytes");
    }

    Source source_;
    exr_context_t file_ = nullptr;
    exr_compression_t compression_ = EXR_COMPRESSION_NONE;
    exr_attr_box2i_t window_{};
    int channel_ = -1;
    ExrGrid grid_;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> places_;  // of chunks that were read, in the file
};

}  // namespace

ExrGrid parse_exr_grid(int fd, int most) {
    try {
        return Part(fd).read(most);
    } catch (const std::bad_alloc&) {
        throw;
    } catch (const std::exception& reason) {
        if (std::string_view(reason.what()).starts_with(kCannotRead)) throw std::runtime_error(reason.what());
        throw std::runtime_error(std::string("cannot read heights of OpenEXR: ") + reason.what());
    }
}

}  // namespace nephos
