// SPDX-License-Identifier: Apache-2.0
#pragma once

// Atomic replacement of files: the content is written under a temporary name in the same folder, flushed to
// the device (fsync), renamed, and the folder flushed. A full disk, a kill or a power cut leaves the old file
// or none, never a part of the new one. All functions are thread-safe for different paths.

#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include <sys/stat.h>
#include <sys/types.h>

namespace nephos {

// Who may read and write the new file.
enum class Access {
    shared,  // whoever might the one that it replaces, if that is of this user; otherwise as the umask has it
    owner,   // this user alone
};

// Says what becomes of missing folders on the way to a file.
enum class Folders {
    made,
    expected,  // an error: their owner has moved or removed them
};

// Throws Error(usage) for the name of a folder: "a/", "..".
void require_file_name(const std::filesystem::path& path);

// A file that is written under a temporary name until it is complete. write_atomically() and the functions below it use
// one. It holds its folder open: no file is renamed into another one that gets the folder's name meanwhile.
class AtomicFile {
  public:
    // Creates an empty temporary file whose name nobody can foresee beside `path`; missing parent folders as `folders` has
    // it. Symbolic
    // links of this user or of root keep pointing to the new file, also where it is not there yet; one of another user, a
    // device, a pipe or a folder in the place of the file is refused. Throws Error(io) naming `path`, and as require_file_name().
    explicit AtomicFile(const std::filesystem::path& path, Access access = Access::shared,
                        Folders folders = Folders::made);
    // Removes the temporary file unless it was published, unless another was put in its place.
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    // Returns the path of the temporary file, which the caller opens, fills and closes.
    const std::filesystem::path& temporary() const { return temporary_; }
    // Flushes the temporary file to the device and renames it to its path. Throws Error(io) naming the path, also
    // when another file or a link was put in the place of the temporary one.
    void publish();
    // As publish(), but where nothing stands at its path. Returns whether it was renamed.
    bool publish_where_free();

  private:
    void open_folder(const std::filesystem::path& folder);
    void create_temporary(const std::filesystem::path& folder, Access access);
    void take_permissions(int fd);
    bool is_created_file(const struct stat& status) const;
    int open_again() const;
    void prepare() const;
    void flush_folder() const;
    void remove() const;

    std::filesystem::path path_, temporary_;
    std::string name_, temporary_name_;  // in the folder
    int folder_ = -1;                    // descriptor of it
    dev_t device_ = 0;
    ino_t inode_ = 0;
    std::optional<mode_t> permissions_;  // of the file that is replaced
    bool published_ = false;
};

// While one lives, AtomicFile calls `check` in this thread before it makes folders, when it has opened the file's folder, and before
// it renames the file in there: what `check` throws keeps it from going on. Of use where the writers in between, of libraries and formats, know
// nothing of the folder's owner, who may move it away while they work. Each library that is loaded by itself has its own.
class PublishCheck {
  public:
    explicit PublishCheck(const std::function<void()>& check);
    ~PublishCheck();
    PublishCheck(const PublishCheck&) = delete;
    PublishCheck& operator=(const PublishCheck&) = delete;

  private:
    const std::function<void()>* before_;
};

// Calls `write` with the path of an empty temporary file, which `write` must open, fill and close; then publishes it.
// Throws as AtomicFile; exceptions of `write` pass through. Every failure removes the temporary file.
void write_atomically(const std::filesystem::path& path,
                      const std::function<void(const std::filesystem::path& temporary)>& write);

// Writes content that is in memory; errors as above.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> content);
void write_atomically(const std::filesystem::path& path, std::string_view content);

// Writes content that is never in memory as a whole: `fill` calls `append` with one piece after the other.
// Errors as above.
using AppendPiece = std::function<void(std::string_view piece)>;
void write_pieces_atomically(const std::filesystem::path& path,
                             const std::function<void(const AppendPiece& append)>& fill,
                             Folders folders = Folders::made);

// Write and copy a file where nothing stands at its path, also no link; one to nowhere that is put there meanwhile is followed.
// Return false where something does. Errors as above.
bool write_where_free(const std::filesystem::path& path, std::string_view content);
bool copy_where_free(const std::filesystem::path& from, const std::filesystem::path& to);

// Renames a file in an open folder to where nothing stands in another one. Returns 0 or errno, EEXIST where something does. On a
// file system that cannot do both at once, as some network ones, there are microseconds in between.
int rename_where_free(int from_folder, const std::string& from, int to_folder, const std::string& to);

// Copies a regular file piece by piece. Errors as above, and as open_regular_file() for `from`.
void copy_atomically(const std::filesystem::path& from, const std::filesystem::path& to);

// Gives a file that has other names as well (hard links, as `cp -l` makes them) its content once more under this name alone, so
// that what is written into it or cut leaves theirs as it is. Returns whether it had; links to it (symbolic ones) are not
// followed, and nothing happens where there is no file. Errors as above.
bool separate_from_links(const std::filesystem::path& path);

// Returns the final name of a temporary file of the functions above ("cloud.vdb" for
// ".cloud.part123-456.vdb"), or "" for any other name. A killed process leaves such files behind.
std::string published_name(std::string_view temporary);

}  // namespace nephos
