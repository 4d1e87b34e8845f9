// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the targets share. A target is a function of arbitrary bytes in which a reader of the library either reads them or
// throws the Error that its header promises; all else (another exception, a crash, a check of the target) ends the
// program. libFuzzer makes the bytes (preset `fuzz`), or replay.cpp.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include <sys/mman.h>
#include <unistd.h>

#include "core/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace nephos::fuzz {

// Ends the program with a message when a property does not hold.
inline void require(bool holds, const char* property) {
    if (holds) return;
    std::fprintf(stderr, "property violated: %s\n", property);
    std::abort();
}

// Calls of accepts() that returned true: an input that no reader takes tests only the first checks of all of them.
inline std::size_t accepted = 0;

// Calls a reader; returns true when it accepted its input, false on an Error.
template <class Read>
bool accepts(const Read& read) {
    try {
        read();
        ++accepted;
        return true;
    } catch (const Error& error) {
        require(error.what()[0] != '\0', "an error has a message");
        return false;
    }
}

inline std::string_view as_text(const std::uint8_t* data, std::size_t size) {
    return {reinterpret_cast<const char*>(data), size};
}

// The bytes as a file in memory, with a name while the object lives.
class InputFile {
  public:
    explicit InputFile(std::string_view bytes) : fd_(memfd_create("input", MFD_CLOEXEC)) {
        require(fd_ >= 0, "memfd_create");
        while (!bytes.empty()) {
            const ssize_t written = write(fd_, bytes.data(), bytes.size());
            require(written > 0, "write");
            bytes.remove_prefix(std::size_t(written));
        }
    }
    ~InputFile() { close(fd_); }
    InputFile(const InputFile&) = delete;
    InputFile& operator=(const InputFile&) = delete;

    std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(fd_); }
    int descriptor() const { return fd_; }

  private:
    int fd_;
};

// Names with an ending, as a reader wants them, for one file in memory after the other.
class Names {
  public:
    Names() {
        std::string name = (std::filesystem::temp_directory_path() / "nephos-fuzz-XXXXXX").string();
        require(mkdtemp(name.data()) != nullptr, "mkdtemp");
        folder_ = name;
    }
    // With a file beside them, which they may name.
    Names(const char* name, std::string_view text) : Names() { std::ofstream(folder_ / name) << text; }
    ~Names() { std::filesystem::remove_all(folder_); }
    Names(const Names&) = delete;
    Names& operator=(const Names&) = delete;
    const std::filesystem::path& path() const { return folder_; }
    std::filesystem::path of(const InputFile& file, const char* ending) const {
        const std::filesystem::path link = folder_ / (std::string("input") + ending);
        std::filesystem::remove(link);
        std::filesystem::create_symlink(file.path(), link);
        return link;
    }

  private:
    std::filesystem::path folder_;
};

}  // namespace nephos::fuzz
