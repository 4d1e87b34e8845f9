// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export_work.h"

#include <algorithm>
#include <cerrno>
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
bool is_of_export(const std::filesystem::path& work, const std::vector<std::string>& names) {
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

// Returns the text of an error, in which files of the one folder are called by their path in the other.
std::string renamed(std::string text, const std::string& from, const std::string& to) {
    for (std::size_t at = text.find(from); at != text.npos; at = text.find(from, at + to.size()))
        text.replace(at, from.size(), to);
    return text;
}

}  // namespace

Json export_entry(const ExportedFile& file) {
    Json entry = {
        {"path", file.path.generic_string()}, {"bytes", file.digest.bytes}, {"xxh3", file.digest.xxh3}};
    if (!file.source.empty()) entry.update(Json{{"format", file.format}, {"source", file.source}});
    if (file.source_digest)
        entry.update(
            Json{{"source_bytes", file.source_digest->bytes}, {"source_xxh3", file.source_digest->xxh3}});
    if (file.is_lost) entry["lost"] = true;
    return entry;
}

std::filesystem::path notes_of(const std::filesystem::path& folder) { return folder / kExportWork / kNotes; }

std::vector<ExportedFile> noted_files(const std::filesystem::path& folder) {
    const std::filesystem::path work = folder / kExportWork, path = notes_of(folder);
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

ExportWork::ExportWork(const FolderLock& lock)
    : lock_(lock), folder_(lock.path()), path_(folder_ / kExportWork) {
    struct stat status {};
    if (::fstatat(lock_.descriptor(), kExportWork, &status, AT_SYMLINK_NOFOLLOW) != 0) {
        if (errno != ENOENT) fail(path_, "cannot be examined", errno);
        return;
    }
    if (!S_ISDIR(status.st_mode) || !is_trusted_owner(status.st_uid)) throw_in_the_way(path_);
    open();
    if (::fstat(work_.get(), &status) != 0) fail(path_, "cannot be examined", errno);
    if (!is_trusted_owner(status.st_uid) || !is_of_export(held_path_of({}), held_names()))
        throw_in_the_way(path_);
}

void ExportWork::open() {
    work_.reset(::openat(lock_.descriptor(), kExportWork, O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (work_.get() < 0) fail(path_, "cannot open", errno);
}

// Trusts who has written the list with notes, too: for root, and where a file system has one owner for all.
bool ExportWork::is_trusted_owner(unsigned user) const {
    struct stat list {};
    return user == ::geteuid() ||
           (::lstat((folder_ / "export.json").c_str(), &list) == 0 && list.st_uid == user);
}

void ExportWork::begin() {
    if (work_.get() >= 0) {
        if (is_same_file(work_.get(), path_))
            clear();
        else if (stands_there(path_))
            throw_in_the_way(path_);
    }
    if (::mkdirat(lock_.descriptor(), kExportWork, 0700) != 0) {
        if (errno == EEXIST) throw_in_the_way(path_);
        fail(path_, "cannot create", errno);
    }
    try {
        open();
        struct stat status {};
        if (::fstat(work_.get(), &status) != 0) fail(path_, "cannot be examined", errno);
        if (!is_trusted_owner(status.st_uid) || !held_names().empty())
            throw_in_the_way(path_);  // put there since
        notes_.reset(::openat(work_.get(), kNotes,
                              O_WRONLY | O_APPEND | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600));
        if (notes_.get() < 0) fail(path_ / kNotes, "cannot create", errno);
        if (const int failed = flush_to_device(work_.get()); failed != 0 && failed != EINVAL)
            fail(path_, "cannot flush to the device", failed);
        flush();
    } catch (const Error&) {
        if (notes_.get() >= 0) ::unlinkat(work_.get(), kNotes, 0);
        notes_.reset(-1);
        work_.reset(-1);
        ::unlinkat(lock_.descriptor(), kExportWork, AT_REMOVEDIR);  // if it is empty
        throw;
    }
}

// Removes the folder that is held, and what is in it: the notes last, by which it is known.
void ExportWork::clear() {
    const auto remove = [&](const char* name) {
        if (::unlinkat(work_.get(), name, 0) != 0 && errno != ENOENT)
            fail(path_ / name, "cannot remove", errno);
    };
    for (const std::string& name : held_names())
        if (name != kNotes) remove(name.c_str());
    remove(kNotes);
    if (::unlinkat(lock_.descriptor(), kExportWork, AT_REMOVEDIR) != 0) fail(path_, "cannot remove", errno);
    work_.reset(-1);
}

// Returns the path by the folder's descriptor, which leads there wherever the folder is.
std::filesystem::path ExportWork::held_path_of(const std::string& name) const {
    return std::filesystem::path("/proc/self/fd") / std::to_string(work_.get()) / name;
}

void ExportWork::write(const std::string& name,
                       const std::function<void(const std::filesystem::path& path)>& write) const {
    const std::filesystem::path held = held_path_of(name);
    try {
        write(held);
    } catch (const Error& error) {
        throw Error(error.code(),
                    renamed(error.what(), (held.parent_path() / "").string(), (path_ / "").string()));
    }
}

std::vector<std::string> ExportWork::held_names() const {
    std::vector<std::string> names;
    write({}, [&](const std::filesystem::path& held) { names = names_in_folder(held); });
    return names;
}

FileDigest ExportWork::digest_of(const std::string& name) const {
    FileDigest digest;
    write(name, [&](const std::filesystem::path& held) { digest = file_digest(held); });
    return digest;
}

void ExportWork::note(const ExportedFile& file) {
    // Behind one that a full disk has torn it is a line of its own, too.
    const std::string note =
        "\n" + export_entry(file).dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    const std::scoped_lock lock(mutex_);
    if (const int error = write_all(notes_.get(), std::as_bytes(std::span(note))))
        fail(path_ / kNotes, "cannot write", error);
    if (const int error = flush_to_device(notes_.get()); error != 0 && error != EINVAL)
        fail(path_ / kNotes, "cannot flush to the device", error);
}

void ExportWork::place(const std::string& name) {
    const int error = rename_where_free(work_.get(), name, lock_.descriptor(), name);
    if (error == EXDEV) copy_to_free_place(name);  // some unions of file systems rename within a folder alone
    if (error != 0) ::unlinkat(work_.get(), name.c_str(), 0);
    if (error == 0 || error == EXDEV) return;
    if (error == EEXIST) throw_place_taken(folder_ / name);
    fail(folder_ / name, "cannot rename into place", error);
}

void ExportWork::copy_to_free_place(const std::string& name) const {
    const std::function<void()> check = [this] { require_in_place(); };
    const PublishCheck keeps_in_place(check);
    bool is_free = false;
    write(name, [&](const std::filesystem::path& held) { is_free = copy_where_free(held, folder_ / name); });
    if (!is_free) throw_place_taken(folder_ / name);
}

void ExportWork::require_in_place() const {
    lock_.require_in_place();
    if (!is_same_file(work_.get(), path_))
        throw Error(ErrorCode::io,
                    path_.string() + ": was removed or renamed while the export was writing into it");
}

void ExportWork::replace(const std::string& name) {
    const std::function<void()> check = [this] { require_in_place(); };
    const PublishCheck keeps_in_place(check);
    write(name, [&](const std::filesystem::path& held) { copy_atomically(held, folder_ / name); });
    ::unlinkat(work_.get(), name.c_str(), 0);
}

void ExportWork::flush() const {
    const int error = flush_to_device(lock_.descriptor());
    if (error != 0 && error != EINVAL) fail(folder_, "cannot flush to the device", error);
}

void ExportWork::end() {
    if (notes_.get() < 0) return;
    require_in_place();
    notes_.reset(-1);
    clear();
}

void throw_place_taken(const std::filesystem::path& path, bool may_be_own) {
    throw Error(ErrorCode::usage,
                path.string() + ": is there already, and no export of this has listed it: " +
                    (may_be_own ? "if the one that was interrupted has written it, whose notes are not "
                                  "there, remove it; otherwise move it away, or choose another folder"
                                : "move it away, or choose another folder"));
}

}  // namespace nephos
