// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_parts.h"

#include <optional>

#include <fmt/format.h>

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
        if (identity_behind(folder) != identity)
            throw Error(
                ErrorCode::io,
                folder.string() + ": the folder was removed or exchanged while the run was writing into it");
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
