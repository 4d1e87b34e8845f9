// SPDX-License-Identifier: Apache-2.0
#pragma once

// Parsing of untrusted input in a child process (not installed). A damaged or hostile file may crash the
// child, hang it or exhaust its memory; the child sends its results through a pipe, and the parent reads
// nothing but that stream, whose order its own code determines. Whoever has taken over the child chooses the values:
// the parent checks them as it would a file's.
//
// fork() without exec() in a program with threads: the child has only the calling thread, and a lock that
// another thread held at that moment stays locked in it. glibc makes its own allocator safe; other locks
// (OpenVDB's type registries) may deadlock, and those of oneTBB spin (density/vdb/serial_tree.h). A child that has sent nothing
// at all is therefore killed and restarted, twice at most, once it has used no processor time for a while, or, where the limit
// of all its time leaves that, once it may not be silent any longer; after that only the limits end it.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace nephos {

// Begins a message of the child that says nothing of what is in the file: of the system, or of limits.
inline constexpr std::string_view kCannotRead = "cannot read: ";

// Limits of the child.
struct SandboxLimits {
    double seconds = 60;         // of wall-clock time, of all attempts together: above 0, at most 1e6
    double quiet_seconds = 1e6;  // that it may send nothing: likewise
    std::size_t memory_bytes = std::size_t{256} << 20;  // more than this process has
    std::size_t most_bytes = std::size_t{64} << 20;     // that it may send
};

// The child's end of the pipe: a stream of plain values.
class SandboxWriter {
  public:
    explicit SandboxWriter(int fd) : fd_(fd) {}
    void bytes(const void* data, std::size_t size);
    template <class T>
    void value(const T& v) {
        static_assert(std::is_trivially_copyable_v<T>);
        bytes(&v, sizeof v);
    }
    void text(std::string_view text);  // sends the first 64 KiB
    void flush();   // sends what was gathered, so that a failure that follows does not lose it
    void finish();  // marks the result as complete
    void fail(std::string_view message);

  private:
    int fd_;
    std::vector<std::byte> buffer_;
};

// The parent's end of the pipe. Every read throws Error(io) when the child failed, died or ran out of time.
class SandboxReader {
  public:
    virtual ~SandboxReader() = default;
    virtual void bytes(void* data, std::size_t size) = 0;
    // Returns how much memory may be taken for what comes: that which the child may take.
    virtual std::size_t memory_bytes() const { return std::numeric_limits<std::size_t>::max(); }
    template <class T>
    T value() {
        static_assert(std::is_trivially_copyable_v<T>);
        static_assert(!std::is_same_v<T, bool>, "not every byte is a bool: send 0 or 1 as a std::uint8_t");
        T v;
        bytes(&v, sizeof v);
        return v;
    }
    std::string text();
};

// Runs `child` in a child process and `parent` in this one, on the values that the child sends. The child may do nothing
// but compute, send, and read `kept`, descriptors of files that are open already, from their beginning (confinement.h).
// When `child` throws, dies or exceeds a limit, throws Error(io) that names `subject`, `parser` (the library that reads)
// and the reason, printable and at most 300 characters long. After a restart `parent` is called again and must discard
// its earlier results.
void run_sandboxed(const std::filesystem::path& subject, std::string_view parser, const SandboxLimits& limits,
                   std::span<const int> kept, const std::function<void(SandboxWriter&)>& child,
                   const std::function<void(SandboxReader&)>& parent);

// Returns the reason of an error where reading takes more memory than this.
std::string too_large(std::size_t memory_bytes);

// Returns `text` in ASCII without control characters, cut to `length`: a message of a foreign parser.
std::string clamp_message(std::string_view text, std::size_t length = 300);

// Returns `text` as UTF-8, whose invalid bytes are `?`, cut to `length` between characters: a name or value of a foreign file. Control
// characters stay; whoever prints it escapes them.
std::string clamp_text(std::string_view text, std::size_t length = 300);

}  // namespace nephos
