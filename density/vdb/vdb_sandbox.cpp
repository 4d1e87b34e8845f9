// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_sandbox.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <new>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <openvdb/openvdb.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/memory.h"
#include "core/text.h"
#include "density/vdb/vdb_archive.h"

namespace nephos {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) {
    throw Error(ErrorCode::io, path.string() + ": " + what);
}

// Checks a file without OpenVDB, and opens it.
Descriptor opened(const std::filesystem::path& path) {
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (status.type() == std::filesystem::file_type::none)
        throw ReadFailure(path, error.message(), "examine");
    if (!std::filesystem::exists(status)) fail(path, error ? error.message() : "there is no such file");
    if (std::filesystem::is_directory(status)) fail(path, "it is a folder, not a file");
    if (!std::filesystem::is_regular_file(status)) fail(path, "it is not a regular file");
    std::ifstream stream = open_stream(path);
    std::array<char, 8> magic{};
    stream.read(magic.data(), magic.size());
    check_reading(stream, path);
    if (stream.gcount() == 0) fail(path, "the file is empty");
    constexpr std::array<char, 8> kMagic{' ', 'B', 'D', 'V', 0, 0, 0, 0};
    if (stream.gcount() != std::streamsize(magic.size()) || magic != kMagic)
        fail(path, "it is not an OpenVDB file");
    return open_regular_file(path, O_RDONLY);
}

// Why a stream has failed: the system's error, or its own for an end that comes early.
std::string reason_of(const std::error_code& code) {
    const bool of_system =
        code.category() == std::system_category() || code.category() == std::generic_category();
    return of_system ? std::string("cannot read: ") + std::strerror(code.value())
                     : "it is truncated or damaged";
}

}  // namespace

// Leaves of 512 voxels take at least 100 bytes in a file and
// some 3 KiB in memory; Blosc compresses values to 1/255 at best. A length that a damaged header states is not bounded
// by anything in the file, so that 100 bytes could take what the machine has.
std::size_t memory_bound(const std::filesystem::path& path) {
    constexpr std::uintmax_t kLeast = 256u << 20, kPerByte = 2000;
    constexpr std::uintmax_t kMost = std::numeric_limits<std::size_t>::max();
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(path, error);
    if (error) throw ReadFailure(path, error.message(), "examine");
    return size > (kMost - kLeast) / kPerByte ? kMost : kLeast + kPerByte * size;
}

std::size_t memory_limit(const VdbReadLimits& limits) {
    return limits.memory_bytes > 0 ? limits.memory_bytes : available_memory().bytes / 2;
}

void in_sandbox(const std::filesystem::path& path, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&)>& parent) {
    in_sandbox(std::span(&path, 1), limits, child, [&](SandboxReader& reader, std::size_t) { parent(reader); });
}

void in_sandbox(std::span<const std::filesystem::path> paths, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&, std::size_t)>& parent) {
    std::vector<Descriptor> files;
    std::vector<int> kept;
    std::size_t bound = 0;
    for (const std::filesystem::path& path : paths) {
        files.push_back(opened(path));
        kept.push_back(files.back().get());
        bound = std::max(bound, memory_bound(path));
    }
    const double count = double(paths.size());
    SandboxLimits bounded{.seconds = std::min(1e6, limits.seconds * count),
                          .quiet_seconds = std::min(1e6, limits.seconds),  // each file sends something
                          .memory_bytes = memory_limit(limits),
                          .most_bytes = 0};
    const bool by_size = limits.memory_bytes == 0 && bound < bounded.memory_bytes;
    if (by_size) bounded.memory_bytes = bound;
    bounded.most_bytes = bounded.memory_bytes > std::numeric_limits<std::size_t>::max() / paths.size()
                             ? std::numeric_limits<std::size_t>::max()
                             : bounded.memory_bytes * paths.size();
    openvdb::initialize();  // before the fork, so that the child finds it done
    std::filesystem::path subject = paths.front();  // of errors: the file that is read
    run_sandboxed(
        subject, "OpenVDB", bounded, kept,
        [&](SandboxWriter& writer) {
            try {
                for (const int file : kept) {
                    VdbArchive archive(file);
                    child(archive, writer);
                    writer.flush();
                }
            } catch (const std::bad_alloc&) {
                if (!by_size) throw;
                throw std::runtime_error("cannot read: it takes more than " +
                                         bytes_text(bounded.memory_bytes) +
                                         " of memory, the most for a file of its size");
            } catch (const std::ios_base::failure& error) {
                throw std::runtime_error(reason_of(error.code()));
            } catch (const openvdb::Exception& error) {
                throw std::runtime_error(std::string("it is damaged or not supported: ") + error.what());
            }
        },
        [&](SandboxReader& reader) {
            for (std::size_t n = 0; n < paths.size(); ++n) {
                subject = paths[n];
                parent(reader, n);
            }
        });
}

}  // namespace nephos
