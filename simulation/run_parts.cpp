// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_parts.h"

#include <cerrno>
#include <cstring>
#include <optional>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

std::vector<std::filesystem::path> density_folders(const RunFolder& folder, const Scene& scene) {
    std::vector<std::filesystem::path> folders;
    constexpr int kAnyFrame = 1;
    for (const std::filesystem::path& file : density_files(folder, scene, kAnyFrame))
        folders.push_back(file.parent_path());
    return folders;
}

[[noreturn]] void throw_exchanged(const std::filesystem::path& folder) {
    throw Error(ErrorCode::io,
                folder.string() + ": the folder was removed or exchanged while the run was writing into it");
}

}  // namespace

std::vector<std::filesystem::path> parts_of_run(const RunFolder& folder, const Scene& scene,
                                                const SimulationRange& range, bool pictures) {
    std::vector<std::filesystem::path> parts;
    if (range.has_frames()) parts = density_folders(folder, scene);
    if (range.has_frames() && pictures) parts.push_back(folder.folder / "frames");
    if (!scene.layers.empty()) parts.push_back(folder.folder / "statistics");
    return parts;
}

void refuse_shared_density_folders(const RunFolder& folder, const Scene& scene) {
    std::map<FileIdentity, std::filesystem::path> known;
    for (const std::filesystem::path& each : density_folders(folder, scene)) {
        const std::optional<FileIdentity> identity = identity_behind(each);
        if (!identity) continue;
        const auto [found, is_new] = known.try_emplace(*identity, each);
        if (!is_new)
            throw Error(ErrorCode::usage,
                        fmt::format("{} and {} are one folder: the frames of one layer would replace those "
                                    "of the other",
                                    found->second.string(), each.string()));
    }
}

HeldFolders::HeldFolders(const std::filesystem::path& own, const FolderLock& lock) {
    if (const std::optional<FileIdentity> identity = identity_behind(own))
        known_.emplace(*identity, lock.held());
}

bool HeldFolders::hold(const std::filesystem::path& folder) {
    const std::optional<FileIdentity> identity = identity_behind(folder);
    if (!identity || known_.contains(*identity)) return false;
    if (type_behind(folder) != std::filesystem::file_type::directory) return false;
    known_.emplace(*identity, locks_.emplace_back(folder, "run").held());
    return true;
}

void HeldFolders::hold_in_place(const std::vector<std::filesystem::path>& folders) {
    for (const std::filesystem::path& folder : folders) {
        hold(folder);
        if (const std::optional<FileIdentity> identity = identity_behind(folder))
            places_.emplace_back(folder, *identity);
    }
}

void HeldFolders::require_in_place() const {
    for (const auto& [folder, identity] : places_)
        if (identity_behind(folder) != identity) throw_exchanged(folder);
}

void HeldFolders::remove(const std::vector<std::filesystem::path>& files) const {
    for (const std::filesystem::path& file : files) {
        const std::filesystem::path path = file.has_parent_path() ? file.parent_path() : ".";
        const Descriptor folder(::open(path.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC));
        struct stat status {};
        if (folder.get() < 0 && errno == ENOENT) throw_exchanged(path);
        if (folder.get() < 0 || ::fstat(folder.get(), &status) != 0)
            throw Error(ErrorCode::io, file.string() + ": cannot remove: " + std::strerror(errno));
        if (!known_.contains({status.st_dev, status.st_ino})) throw_exchanged(path);
        if (::unlinkat(folder.get(), file.filename().c_str(), 0) != 0 && errno != ENOENT)
            throw Error(ErrorCode::io, file.string() + ": cannot remove: " + std::strerror(errno));
    }
}

bool HeldFolders::can_hold(const std::filesystem::path& folder) {
    try {
        hold(folder);
    } catch (const Error&) {
        return false;
    }
    const std::optional<FileIdentity> identity = identity_behind(folder);
    const auto found = identity ? known_.find(*identity) : known_.end();
    return found != known_.end() && found->second;
}

}  // namespace nephos
