// SPDX-License-Identifier: Apache-2.0
#pragma once

// Work on untrusted input in a child process (not installed). The child does everything that a damaged or
// hostile file may turn into a crash, an endless loop or an exhausted memory; what it finds, it sends through
// a pipe. This process only ever reads that stream, whose length and order its own code decides.
//
// fork() without exec() in a program with threads: the child has only the calling thread, and a lock that
// another thread held at that moment stays locked in it. glibc makes its own allocator safe; others' locks
// (OpenVDB's type registries) may be caught. A child that has neither sent anything nor used processor time
// for a while is therefore ended and started again, twice at most; after that only the time limit ends it.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "density/vdb/vdb_file.h"

namespace nephos {

// The child's end: a stream of plain values.
class SandboxWriter {
  public:
    explicit SandboxWriter(int fd) : fd_(fd) {}
    void bytes(const void* data, std::size_t size);
    template <class T>
    void value(const T& v) {
        static_assert(std::is_trivially_copyable_v<T>);
        bytes(&v, sizeof v);
    }
    void text(std::string_view text);  // its first 64 KiB
    void finish();                     // the result is complete
    void fail(std::string_view message);

  private:
    void flush();

    int fd_;
    std::vector<std::byte> buffer_;
};

// The parent's end. Every read throws Error(io) when the child failed, died or ran out of time.
class SandboxReader {
  public:
    virtual ~SandboxReader() = default;
    virtual void bytes(void* data, std::size_t size) = 0;
    template <class T>
    T value() {
        static_assert(std::is_trivially_copyable_v<T>);
        T v;
        bytes(&v, sizeof v);
        return v;
    }
    std::string text();
};

// Runs `child` in a child process and `parent` here, on what the child sends. When `child` throws, or dies,
// or exceeds a limit, Error(io) names `subject` and the reason. `parent` may be called again from the start
// and must throw away what it had. Messages are printable and at most 300 characters long.
void run_sandboxed(const std::filesystem::path& subject, const VdbReadLimits& limits,
                   const std::function<void(SandboxWriter&)>& child,
                   const std::function<void(SandboxReader&)>& parent);

// limits.memory_bytes, or what 0 stands for.
std::size_t memory_limit(const VdbReadLimits& limits);

// `text` without control characters and cut to `length`.
std::string clamp_message(std::string_view text, std::size_t length = 300);

}  // namespace nephos
