// SPDX-License-Identifier: Apache-2.0
#include "core/paths.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what,
                       const std::string& reason) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + reason);
}

// Returns the folders that hold the missing ones of a path, innermost first.
std::vector<std::filesystem::path> holders_of_missing(std::filesystem::path folder) {
    std::vector<std::filesystem::path> holders;
    std::error_code error;
    while (!folder.empty() && !std::filesystem::exists(folder, error) && !error) {
        std::filesystem::path holder = folder.parent_path();
        if (holder == folder) break;
        // The last part of "a/b/" is empty: "a/b" is no other folder.
        if (folder.has_filename()) holders.push_back(holder.empty() ? std::filesystem::path(".") : holder);
        folder = std::move(holder);
    }
    return holders;
}

// Flushes which files are in a folder to the device. Some file systems cannot, and a folder that may be written but not read
// cannot be opened: there nothing is done. Throws Error(io) naming `reported`.
void flush_folder(const std::filesystem::path& folder, const std::filesystem::path& reported) {
    const Descriptor descriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (descriptor.get() < 0 && errno == EACCES) return;
    if (descriptor.get() < 0) fail(reported, "cannot open its folder after writing", std::strerror(errno));
    const int error = flush_to_device(descriptor.get());
    if (error != 0 && error != EINVAL)
        fail(reported, "cannot flush its folder to the device", std::strerror(error));
}

std::filesystem::file_type known_type(const std::filesystem::path& path, std::filesystem::file_type type,
                                      const std::error_code& error) {
    if (type == std::filesystem::file_type::none) throw ReadFailure(path, error.message(), "examine");
    return type;
}

}  // namespace

void create_folders(const std::filesystem::path& folder) {
    const std::vector<std::filesystem::path> holders = holders_of_missing(folder);
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error == std::errc::file_exists && type_behind(folder) == std::filesystem::file_type::not_found)
        fail(folder, "cannot create the folder", "a link stands there that leads nowhere");
    if (error) fail(folder, "cannot create the folder", error.message());
    for (const std::filesystem::path& holder : holders) flush_folder(holder, folder);
}

std::filesystem::file_type type_at(const std::filesystem::path& path) {
    std::error_code error;
    return known_type(path, std::filesystem::symlink_status(path, error).type(), error);
}

std::filesystem::file_type type_behind(const std::filesystem::path& path) {
    std::error_code error;
    const auto type = std::filesystem::status(path, error).type();
    if (error == std::errc::too_many_symbolic_link_levels) return std::filesystem::file_type::not_found;
    return known_type(path, type, error);
}

bool stands_there(const std::filesystem::path& path) {
    return type_at(path) != std::filesystem::file_type::not_found;
}

std::optional<FileIdentity> identity_behind(const std::filesystem::path& path) {
    struct stat status {};
    if (path.empty()) return std::nullopt;
    if (::stat(path.c_str(), &status) == 0) return FileIdentity{status.st_dev, status.st_ino};
    if (errno == ENOENT || errno == ENOTDIR || errno == ELOOP) return std::nullopt;
    throw ReadFailure(path, std::strerror(errno), "examine");
}

bool is_same_place(const std::filesystem::path& a, const std::filesystem::path& b) {
    const std::optional<FileIdentity> first = identity_behind(a), second = identity_behind(b);
    return first && second && *first == *second;
}

std::vector<std::string> names_in_folder(const std::filesystem::path& folder) {
    std::vector<std::string> names;
    std::error_code error;
    std::filesystem::directory_iterator at(folder, error), end;
    if (error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory) return names;
    for (; !error && at != end; at.increment(error)) names.push_back(at->path().filename().string());
    if (error) throw ReadFailure(folder, error.message());
    std::ranges::sort(names);
    return names;
}

std::filesystem::path normal_path(const std::filesystem::path& path) {
    std::filesystem::path by_text = path.lexically_normal();
    std::error_code error;
    if (std::ranges::find(path, std::filesystem::path("..")) == path.end() ||
        std::filesystem::equivalent(path, by_text, error))
        return by_text;
    // A file that is a link keeps its own name.
    const std::filesystem::path name = path.filename();
    const bool is_folder = name.empty() || name == "." || name == "..";
    const std::filesystem::path folder = is_folder ? path : path.parent_path();
    const std::filesystem::path whole = std::filesystem::canonical(folder.empty() ? "." : folder, error);
    if (error) return by_text;
    return is_folder ? whole : whole / name;
}

std::vector<std::filesystem::path> paths_to(const std::filesystem::path& file) {
    constexpr std::size_t kMostLinks = 40;  // as the system
    std::vector<std::filesystem::path> paths{file};
    std::filesystem::path done;  // has no links
    std::filesystem::path left = file;
    while (!left.empty() && paths.size() <= kMostLinks) {
        const std::filesystem::path part = *left.begin();
        std::filesystem::path rest;
        for (auto next = std::next(left.begin()); next != left.end(); ++next) rest /= *next;
        const std::filesystem::path at = done / part;
        std::error_code error;
        const bool is_link =
            std::filesystem::symlink_status(at, error).type() == std::filesystem::file_type::symlink;
        const std::filesystem::path target =
            is_link ? std::filesystem::read_symlink(at, error) : std::filesystem::path();
        // Links of /proc lead to files without a name.
        if (error == std::errc::no_such_file_or_directory) break;
        if (error) throw ReadFailure(at, error.message(), "examine");
        if (is_link) {
            left = rest.empty() ? target : target / rest;
            paths.push_back(done / left);  // an absolute target replaces what was done
            if (target.is_absolute()) done.clear();
        } else {
            left = rest;
            done = at;
        }
    }
    return paths;
}

std::filesystem::path holder_of(const std::filesystem::path& path) {
    const std::filesystem::path name = path.filename();
    if (name.empty() && path.has_relative_path()) return holder_of(path.parent_path());
    if (path.empty() || name == "." || name == "..") return path / "..";
    const std::filesystem::path holder = path.parent_path();
    return holder.empty() ? "." : holder;
}

}  // namespace nephos
