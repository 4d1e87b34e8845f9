// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <string>

#include <openvdb/openvdb.h>

#include "core/error.h"
#include "density/vdb/sandbox.h"
#include "density/vdb/vdb_archive.h"

namespace nephos {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) {
    throw Error(ErrorCode::io, path.string() + ": " + what);
}

// Checks a file without OpenVDB.
void check_file(const std::filesystem::path& path) {
    std::error_code error;
    const auto status = std::filesystem::status(path, error);
    if (!std::filesystem::exists(status)) fail(path, error ? error.message() : "there is no such file");
    if (std::filesystem::is_directory(status)) fail(path, "it is a folder, not a file");
    if (!std::filesystem::is_regular_file(status)) fail(path, "it is not a regular file");
    std::ifstream stream(path, std::ios::binary);
    if (!stream) fail(path, std::string("cannot be opened: ") + std::strerror(errno));
    std::array<char, 8> magic{};
    stream.read(magic.data(), magic.size());
    if (stream.gcount() == 0) fail(path, "the file is empty");
    constexpr std::array<char, 8> kMagic{' ', 'B', 'D', 'V', 0, 0, 0, 0};
    if (stream.gcount() != std::streamsize(magic.size()) || magic != kMagic)
        fail(path, "it is not an OpenVDB file");
}

}  // namespace

void in_sandbox(const std::filesystem::path& path, const VdbReadLimits& limits,
                const std::function<void(VdbArchive&, SandboxWriter&)>& child,
                const std::function<void(SandboxReader&)>& parent) {
    check_file(path);
    openvdb::initialize();  // before the fork, so that the child finds it done
    run_sandboxed(
        path, limits,
        [&](SandboxWriter& writer) {
            try {
                VdbArchive archive(path);
                child(archive, writer);
            } catch (const std::ios_base::failure&) {
                throw std::runtime_error("it is truncated or damaged");
            } catch (const openvdb::Exception& error) {
                throw std::runtime_error(std::string("it is damaged or not supported: ") + error.what());
            }
        },
        parent);
}

}  // namespace nephos
