// SPDX-License-Identifier: Apache-2.0
// Reads heights by OpenEXR's core library, which compares what each chunk gives with what its pixels take. OpenEXR's own reader
// (3.1.5) does not: of a chunk of fewer bytes its pixels are what memory held.

#include "render/image/exr_grid.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <iterator>
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
#include "render/image/exr_head.h"
#include "render/image/exr_packed.h"

namespace nephos {
namespace {

// Holds the file while the library reads it by the functions below, which C calls.
struct Reading {
    ExrSource source;
    bool has_head = false;
    bool lacks_memory = false;
    std::string message;
};

std::int64_t read_part(exr_const_context_t, void* user, void* to, std::uint64_t size, std::uint64_t from,
                       exr_stream_error_func_ptr_t) {
    return read_exr_bytes(static_cast<Reading*>(user)->source, to, size, from);
}

std::int64_t size_of(exr_const_context_t, void* user) {
    return std::int64_t(static_cast<Reading*>(user)->source.size);
}

// Keeps all of the head, as the library goes over the first ones; of chunks the first says most.
void keep_message(exr_const_context_t file, exr_result_t result, const char* text) {
    constexpr std::size_t kMost = 300;
    void* user = nullptr;
    if (exr_get_user_data(file, &user) != EXR_ERR_SUCCESS || user == nullptr) return;
    auto& reading = *static_cast<Reading*>(user);
    if (result == EXR_ERR_OUT_OF_MEMORY) reading.lacks_memory = true;
    if (reading.message.size() > kMost || (reading.has_head && !reading.message.empty())) return;
    try {
        if (!reading.message.empty()) reading.message += "; ";
        reading.message.append(text, std::min(std::strlen(text), kMost));
    } catch (const std::bad_alloc&) {
        reading.lacks_memory = true;
    }
}

std::string text_of(const std::array<std::int32_t, 4>& window) {
    const auto corner = [&](std::size_t n) {
        return "(" + std::to_string(window[n]) + " " + std::to_string(window[n + 1]) + ")";
    };
    return corner(0) + " to " + corner(2);
}

std::array<std::int32_t, 4> numbers_of(const exr_attr_box2i_t& window) {
    return {window.min.x, window.min.y, window.max.x, window.max.y};
}

// Tells how much a channel of this name is expected to hold heights; 0: it is not.
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
        ExrSource& source = reading_.source;
        source.fd = fd;
        const off_t size = ::lseek(fd, 0, SEEK_END);
        if (size < 0) throw_exr_failure(errno);
        source.size = std::uint64_t(size);
        head_ = read_exr_head(source);
        exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
        options.user_data = &reading_;
        options.read_fn = read_part;
        options.size_fn = size_of;
        options.error_handler_fn = keep_message;
        require(exr_start_read(&file_, "heights", &options));
    }
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;
    ~Part() { exr_finish(&file_); }

    ExrGrid read(int most) {
        require_same_head();
        require_rows_or_tiles();
        const long long columns = 1LL + window_.max.x - window_.min.x,
                        rows = 1LL + window_.max.y - window_.min.y;
        if (columns < 2 || rows < 2 || columns > most || rows > most)
            throw std::runtime_error("it is " + std::to_string(columns) + " x " + std::to_string(rows) +
                                     " heights; expected 2 to " + std::to_string(most) + " on a side");
        if (head_.data_window != head_.display_window)
            throw std::runtime_error("its data window is " + text_of(head_.data_window) +
                                     ", its display window " + text_of(head_.display_window) +
                                     "; expected the same, a height in each pixel of the map");
        choose_channel();
        if (compression_ == EXR_COMPRESSION_DWAA || compression_ == EXR_COMPRESSION_DWAB)
            throw std::runtime_error(
                "its compression is DWA, of which damage goes unnoticed; expected another one, as ZIP");
        grid_ = {int(columns), int(rows), {}};
        grid_.values.resize(std::size_t(columns) * std::size_t(rows));
        if (storage_ == EXR_STORAGE_TILED)
            read_tiles();
        else
            read_rows();
        require_apart();
        return std::move(grid_);
    }

  private:
    void require(exr_result_t result) const {
        if (result == EXR_ERR_SUCCESS) return;
        if (reading_.source.failure != 0) throw_exr_failure(reading_.source.failure);
        if (!reading_.has_head && reading_.lacks_memory) throw std::bad_alloc();
        // Some decompressors call damage so.
        const bool is_damage = reading_.message.starts_with("Unable to decompress");
        if (result == EXR_ERR_OUT_OF_MEMORY && !is_damage) throw std::bad_alloc();
        throw std::runtime_error(reading_.message.empty() ? exr_get_default_error_message(result)
                                                          : reading_.message);
    }

    // The library has gone over what failed while it read the head.
    void require_same_head() {
        if (reading_.source.failure != 0) throw_exr_failure(reading_.source.failure);
        if (reading_.lacks_memory) throw std::bad_alloc();
        exr_attr_box2i_t display{};
        require(exr_get_storage(file_, 0, &storage_));
        require(exr_get_data_window(file_, 0, &window_));
        require(exr_get_display_window(file_, 0, &display));
        require(exr_get_compression(file_, 0, &compression_));
        if (int(compression_) != head_.compression || numbers_of(window_) != head_.data_window ||
            numbers_of(display) != head_.display_window)
            throw std::runtime_error("its head is damaged" +
                                     (reading_.message.empty() ? "" : ": " + reading_.message));
        reading_.has_head = true;
        reading_.message.clear();
    }

    void require_rows_or_tiles() {
        int parts = 0;
        require(exr_get_count(file_, &parts));
        for (int n = 0; n < parts; ++n) {
            exr_storage_t storage{};
            require(exr_get_storage(file_, n, &storage));
            if (storage != EXR_STORAGE_SCANLINE && storage != EXR_STORAGE_TILED)
                throw std::runtime_error("it holds deep data");
        }
        const exr_attribute_t* tiles = nullptr;
        if (storage_ == EXR_STORAGE_SCANLINE &&
            exr_get_attribute_by_name(file_, 0, "tiles", &tiles) == EXR_ERR_SUCCESS && tiles != nullptr)
            throw std::runtime_error(
                "its rows have an attribute `tiles`, by which OpenEXR 3.1 counts them as tiles: leave that "
                "out");
        reading_.message.clear();
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
        const std::uint64_t before = (storage_ == EXR_STORAGE_TILED ? 20 : 8) + (head_.is_multipart ? 4 : 0);
        places_.emplace_back(chunk.data_offset - before, chunk.data_offset + chunk.packed_size);
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
        if (!is_raw) require_all_used(pipeline, compression_);
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

    // A size with one other bit may be that of raw pixels, which the next chunk then gives: also of another part or level.
    void require_apart() {
        const auto fail = [] { throw std::runtime_error("two chunks of its pixels share bytes"); };
        std::ranges::sort(places_);
        for (std::size_t n = 1; n < places_.size(); ++n)
            if (places_[n].first < places_[n - 1].second) fail();
        for (const std::uint64_t begin : table()) {
            const auto after = std::ranges::upper_bound(places_, begin, {}, &Place::first);
            if (after == places_.begin()) continue;
            const Place& place = *std::prev(after);
            if (begin > place.first && begin < place.second) fail();
        }
    }

    // The places of all chunks, as the file has them.
    std::vector<std::uint64_t> table() {
        int parts = 0;
        std::uint64_t chunks = 0;
        require(exr_get_count(file_, &parts));
        for (int n = 0; n < parts; ++n) {
            std::int32_t count = 0;
            require(exr_get_chunk_count(file_, n, &count));
            chunks += std::uint64_t(std::max(count, 0));
        }
        if (chunks > reading_.source.size / 8) throw std::runtime_error("it ends early");
        std::vector<std::uint64_t> places(chunks);
        const std::int64_t got = read_exr_bytes(reading_.source, places.data(), 8 * chunks, head_.table_at);
        if (got < 0) throw_exr_failure(reading_.source.failure);
        if (std::uint64_t(got) < 8 * chunks) throw std::runtime_error("it ends early");
        return places;
    }

    using Place = std::pair<std::uint64_t, std::uint64_t>;  // of a chunk in the file: its head, its end

    Reading reading_;
    ExrHead head_;
    exr_context_t file_ = nullptr;
    exr_compression_t compression_ = EXR_COMPRESSION_NONE;
    exr_storage_t storage_ = EXR_STORAGE_SCANLINE;
    exr_attr_box2i_t window_{};
    int channel_ = -1;
    ExrGrid grid_;
    std::vector<Place> places_;  // of chunks that were read
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
