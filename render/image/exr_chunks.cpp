// SPDX-License-Identifier: Apache-2.0
#include "render/image/exr_chunks.h"

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>
#include <string_view>

#include <OpenEXR/openexr.h>
#include <unistd.h>

#include "density/vdb/sandbox.h"

namespace nephos {
namespace {

// Holds the file while the library reads it by the functions below, which C calls.
struct Source {
    int fd = -1;
    int failure = 0;  // errno of a read
    char message[300] = "";
};

std::int64_t read_part(exr_const_context_t, void* user, void* to, std::uint64_t size, std::uint64_t from,
                       exr_stream_error_func_ptr_t) {
    auto* source = static_cast<Source*>(user);
    std::uint64_t done = 0;
    while (done < size) {
        const ssize_t got =
            ::pread(source->fd, static_cast<char*>(to) + done, size - done, off_t(from + done));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) source->failure = errno;
        if (got < 0) return -1;
        if (got == 0) break;
        done += std::uint64_t(got);
    }
    return std::int64_t(done);
}

std::int64_t size_of(exr_const_context_t, void* user) {
    return ::lseek(static_cast<Source*>(user)->fd, 0, SEEK_END);
}

void keep_message(exr_const_context_t file, exr_result_t, const char* text) {
    void* user = nullptr;
    if (exr_get_user_data(file, &user) != EXR_ERR_SUCCESS || user == nullptr) return;
    auto* source = static_cast<Source*>(user);
    if (source->message[0] != '\0') return;  // the first says most
    std::strncpy(source->message, text, sizeof source->message - 1);
}

class Chunks {
  public:
    explicit Chunks(int fd) {
        source_.fd = fd;
        exr_context_initializer_t options = EXR_DEFAULT_CONTEXT_INITIALIZER;
        options.user_data = &source_;
        options.read_fn = read_part;
        options.size_fn = size_of;
        options.error_handler_fn = keep_message;
        options.flags = EXR_CONTEXT_FLAG_STRICT_HEADER;  // else what the head lacks has a default
        require(exr_start_read(&file_, "heights", &options));
    }
    Chunks(const Chunks&) = delete;
    Chunks& operator=(const Chunks&) = delete;
    ~Chunks() { exr_finish(&file_); }

    void require_whole() {
        exr_storage_t storage{};
        exr_attr_box2i_t window{};
        require(exr_get_storage(file_, 0, &storage));
        require(exr_get_data_window(file_, 0, &window));
        require(exr_get_compression(file_, 0, &compression_));
        const exr_attr_chlist_t* channels = nullptr;
        require(exr_get_channels(file_, 0, &channels));
        for (int c = 0; c < channels->num_channels; ++c)
            if (channels->entries[c].y_sampling > 2)
                throw std::runtime_error(std::string("its channel ") + channels->entries[c].name.str +
                                         " has less than half the rows, of which damage goes unnoticed");
        if (compression_ == EXR_COMPRESSION_DWAA || compression_ == EXR_COMPRESSION_DWAB)
            throw std::runtime_error(
                "its compression is DWA, of which damage goes unnoticed; expected another one, as ZIP");
        if (storage == EXR_STORAGE_TILED)
            require_tiles(window);
        else
            require_rows(window);
    }

  private:
    void require(exr_result_t result) const {
        if (result == EXR_ERR_SUCCESS) return;
        if (source_.failure != 0)
            throw std::runtime_error(std::string(kCannotRead) + std::strerror(source_.failure));
        // Some decompressors call damage so.
        const bool is_damage = std::string_view(source_.message).starts_with("Unable to decompress");
        if (result == EXR_ERR_OUT_OF_MEMORY && !is_damage) throw std::bad_alloc();
        throw std::runtime_error(source_.message[0] != '\0' ? source_.message
                                                            : exr_get_default_error_message(result));
    }

    void require_rows(const exr_attr_box2i_t& window) {
        std::int32_t rows = 0;
        require(exr_get_scanlines_per_chunk(file_, 0, &rows));
        for (std::int64_t y = window.min.y; y <= window.max.y; y += rows) {
            exr_chunk_info_t chunk{};
            require(exr_read_scanline_chunk_info(file_, 0, int(y), &chunk));
            require_pixels(chunk);
        }
    }

    void require_tiles(const exr_attr_box2i_t& window) {
        std::int32_t width = 0, height = 0;
        require(exr_get_tile_sizes(file_, 0, 0, 0, &width, &height));
        const auto tiles = [](std::int64_t low, std::int64_t high, std::int64_t size) {
            return int((high - low + size) / size);
        };
        for (int y = 0; y < tiles(window.min.y, window.max.y, height); ++y)
            for (int x = 0; x < tiles(window.min.x, window.max.x, width); ++x) {
                exr_chunk_info_t chunk{};
                require(exr_read_tile_chunk_info(file_, 0, x, y, 0, 0, &chunk));
                require_pixels(chunk);
            }
    }

    void require_pixels(const exr_chunk_info_t& chunk) {
        if (chunk.packed_size == 0) throw std::runtime_error("a chunk of its pixels is empty");
        // Skips a chunk that did not become smaller and is stored as it is, which the core does not know of B44.
        if (chunk.packed_size == chunk.unpacked_size) return;
        // OpenEXR's reader takes what has more bytes than its pixels as it is, too; the core would unpack it.
        if (compression_ == EXR_COMPRESSION_NONE || chunk.packed_size > chunk.unpacked_size)
            throw std::runtime_error("a chunk of its pixels has " + std::to_string(chunk.packed_size) +
                                     " bytes; expected " + std::to_string(chunk.unpacked_size));
        exr_decode_pipeline_t pipeline{};
        require(exr_decoding_initialize(file_, 0, &chunk, &pipeline));
        const exr_result_t result = decode(pipeline);
        exr_decoding_destroy(file_, &pipeline);
        require(result);
    }

    // Unpacks a chunk, and leaves out the pixels themselves.
    exr_result_t decode(exr_decode_pipeline_t& pipeline) {
        const exr_result_t chosen = exr_decoding_choose_default_routines(file_, 0, &pipeline);
        pipeline.unpack_and_convert_fn = nullptr;
        return chosen != EXR_ERR_SUCCESS ? chosen : exr_decoding_run(file_, 0, &pipeline);
    }

    Source source_;
    exr_context_t file_ = nullptr;
    exr_compression_t compression_ = EXR_COMPRESSION_NONE;
};

}  // namespace

void require_whole_chunks(int fd) { Chunks(fd).require_whole(); }

}  // namespace nephos
