// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export_work.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <span>
#include <sstream>
#include <system_error>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/stat.h>
#include <unistd.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/checked_json.h"
#include "simulation/export/export_list.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kNotes = "notes.jsonl";
constexpr std::size_t kMostNote = std::size_t(64) << 10;  // bytes; paths have at most 4096

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what, int error) {
    throw Error(ErrorCode::io, path.string() + ": " + what + ": " + std::strerror(error));
}

// Returns whether a folder has what an export leaves in its own: notes, files and no folders; or nothing.
bool is_of_export(const std::filesystem::path& work) {
    const std::vector<std::string> names = names_in_folder(work);
    const auto is_file = [&](const std::string& name) {
        return type_at(work / name) == std::filesystem::file_type::regular;
    };
    return names.empty() || (std::ranges::count(names, kNotes) > 0 && std::ranges::all_of(names, is_file));
}

[[noreturn]] void throw_in_the_way(const std::filesystem::path& work) {
    throw Error(ErrorCode::usage,
                work.string() +
                    ": is in the way, and no export of this user has made it: move it away, or "
                    "choose another folder");
}

// Renames a file where nothing stands. Returns 0 or errno.
int rename_to_free_place(int from_folder, const char* name, int to_folder) {
    if (::renameat2(from_folder, name, to_folder, name, RENAME_NOREPLACE) == 0) return 0;
    if (errno != EINVAL && errno != ENOSYS && errno != EOPNOTSUPP) return errno;
    // A file system that cannot, as some network ones.
    struct stat status {};
    if (::fstatat(to_folder, name, &status, AT_SYMLINK_NOFOLLOW) == 0) return EEXIST;
    if (errno != ENOENT) return errno;
    return ::renameat(from_folder, name, to_folder, name) == 0 ? 0 : errno;
}

}  // namespace

Json export_entry(const ExportedFile& file) {
    Json entry = {
        {"path", file.path.generic_string()}, {"bytes", file.digest.bytes}, {"xxh3", file.digest.xxh3}};
    if (!file.source.empty()) entry.update(Json{{"format", file.format}, {"source", file.source}});
    if (file.source_digest)
        entry.update(
            Json{{"source_bytes", file.source_digest->bytes}, {"source_xxh3", file.source_digest->xxh3}});
    return entry;
}

std::vector<ExportedFile> noted_files(const std::filesystem::path& folder) {
    const std::filesystem::path work = folder / kExportWork, path = work / kNotes;
    std::vector<ExportedFile> files;
    if (type_at(work) != std::filesystem::file_type::directory ||
        type_at(path) != std::filesystem::file_type::regular)
        return files;
    std::istringstream notes(read_json_text(path));
    for (std::string line; std::getline(notes, line);) {
        if (line.empty() || line.size() > kMostNote) continue;
        const Json entry = parsed_json_text(line);
        try {
            files.push_back(exported_file(CheckedJson(entry, path)));
        } catch (const Error&) {
            continue;  // a power cut has torn it; its file is then taken for another's
        }
    }
    return files;
}

ExportWork::ExportWork(std::filesystem::path folder) : folder_(std::move(folder)) {
    const std::filesystem::path work = folder_ / kExportWork;
    struct stat status {};
    if (::lstat(work.c_str(), &status) != 0) {
        if (errno != ENOENT) fail(work, "cannot be examined", errno);
        return;
    }
    if (!S_ISDIR(status.st_mode) || !is_trusted_owner(status.st_uid) || !is_of_export(work))
        throw_in_the_way(work);
}

// Trusts who has written the list with notes, too: for root, and where a file system has one owner for all.
bool ExportWork::is_trusted_owner(unsigned user) const {
    struct stat list {};
    return user == ::geteuid() ||
           (::lstat((folder_ / "export.json").c_str(), &list) == 0 && list.st_uid == user);
}

void ExportWork::begin() {
    const std::filesystem::path work = folder_ / kExportWork;
    place_.reset(::open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (place_.get() < 0) fail(folder_, "cannot open", errno);
    work_.reset(::openat(place_.get(), kExportWork, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (work_.get() >= 0) {
        struct stat status {};
        if (::fstat(work_.get(), &status) != 0) fail(work, "cannot be examined", errno);
        if (!is_trusted_owner(status.st_uid)) throw_in_the_way(work);  // put there since
        clear();
    } else if (errno != ENOENT) {
        fail(work, "cannot open", errno);
    }
    if (::mkdirat(place_.get(), kExportWork, 0700) != 0) fail(work, "cannot create", errno);
    try {
        open();
    } catch (const Error&) {
        ::unlinkat(work_.get(), kNotes, 0);
        ::unlinkat(place_.get(), kExportWork, AT_REMOVEDIR);
        work_.reset(-1);
        throw;
    }
}

void ExportWork::open() {
    const std::filesystem::path work = folder_ / kExportWork;
    work_.reset(::openat(place_.get(), kExportWork, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (work_.get() < 0) fail(work, "cannot open", errno);
    notes_.reset(
        ::openat(work_.get(), kNotes, O_WRONLY | O_APPEND | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
    if (notes_.get() < 0) fail(work / kNotes, "cannot create", errno);
    if (const int failed = flush_to_device(work_.get()); failed != 0 && failed != EINVAL)
        fail(work, "cannot flush to the device", failed);
    flush();
}

// Removes the folder that is held, and what is in it: the notes last, by which it is known.
void ExportWork::clear() {
    const std::filesystem::path work = folder_ / kExportWork;
    const auto remove = [&](const char* name) {
        if (::unlinkat(work_.get(), name, 0) != 0 && errno != ENOENT)
            fail(work / name, "cannot remove", errno);
    };
    for (const std::string& name : names_in_folder(held_path_of({})))
        if (name != kNotes) remove(name.c_str());
    remove(kNotes);
    if (::unlinkat(place_.get(), kExportWork, AT_REMOVEDIR) != 0 && errno != ENOENT)
        fail(work, "cannot remove", errno);
    work_.reset(-1);
}

// Returns the path by the folder's descriptor where the system has such paths.
std::filesystem::path ExportWork::held_path_of(const std::string& name) const {
    const std::filesystem::path held = "/proc/self/fd/" + std::to_string(work_.get());
    std::error_code error;
    return std::filesystem::is_directory(held, error) ? held / name : path_of(name);
}

void ExportWork::write(const std::string& name,
                       const std::function<void(const std::filesystem::path& path)>& write) const {
    const std::filesystem::path held = held_path_of(name);
    try {
        write(held);
    } catch (const Error& error) {
        std::string text = error.what();
        const std::string folder = held.parent_path().string();
        const std::size_t at = text.find(folder);
        if (at == text.npos) throw;
        throw Error(error.code(), text.replace(at, folder.size(), (folder_ / kExportWork).string()));
    }
}

FileDigest ExportWork::digest_of(const std::string& name) const { return file_digest(held_path_of(name)); }

void ExportWork::note(const ExportedFile& file) {
    // Behind one that a full disk has torn it is a line of its own, too.
    const std::string note =
        "\n" + export_entry(file).dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    const std::scoped_lock lock(mutex_);
    const std::filesystem::path notes = path_of(kNotes);
    if (const int error = write_all(notes_.get(), std::as_bytes(std::span(note))))
        fail(notes, "cannot write", error);
    if (const int error = flush_to_device(notes_.get()); error != 0 && error != EINVAL)
        fail(notes, "cannot flush to the device", error);
}

void ExportWork::place(const std::string& name) {
    const int error = rename_to_free_place(work_.get(), name.c_str(), place_.get());
    if (error == 0) return;
    // Some unions of file systems rename within a folder alone.
    if (error == EXDEV && !stands_there(folder_ / name)) return replace(name);
    ::unlinkat(work_.get(), name.c_str(), 0);
    if (error == EEXIST || error == EXDEV) throw_place_taken(folder_ / name);
    fail(folder_ / name, "cannot rename into place", error);
}

void ExportWork::require_in_place() const {
    if (is_same_file(place_.get(), folder_) && is_same_file(work_.get(), folder_ / kExportWork)) return;
    throw Error(
        ErrorCode::io,
        folder_.string() + ": the folder was removed or renamed while the export was writing into it");
}

void ExportWork::replace(const std::string& name) {
    const std::function<void()> check = [this] { require_in_place(); };
    const PublishCheck keeps_in_place(check);
    copy_atomically(held_path_of(name), folder_ / name);
    ::unlinkat(work_.get(), name.c_str(), 0);
}

void ExportWork::flush() const {
    if (place_.get() < 0) return;
    const int error = flush_to_device(place_.get());
    if (error != 0 && error != EINVAL) fail(folder_, "cannot flush to the device", error);
}

void ExportWork::end() {
    notes_.reset(-1);
    if (work_.get() >= 0) clear();
    place_.reset(-1);
}

void throw_place_taken(const std::filesystem::path& path, bool may_be_own) {
    throw Error(ErrorCode::usage,
                path.string() + ": is there already, and no export of this has listed it: " +
                    (may_be_own ? "if the one that was interrupted has written it, whose notes are not "
                                  "there, remove it; otherwise move it away, or choose another folder"
                                : "move it away, or choose another folder"));
}

}  // namespace nephos
