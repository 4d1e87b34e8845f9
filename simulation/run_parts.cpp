// SPDX-License-Identifier: Apache-2.0
#include "simulation/run_parts.h"

#include <algorithm>
#include <map>
#include <optional>

#include <fmt/format.h>

#include "core/error.h"

namespace nephos {

std::vector<std::filesystem::path> parts_of_run(const RunFolder& folder, const Scene& scene, bool frames,
                                                bool pictures) {
    std::vector<std::filesystem::path> parts;
    const auto add = [&](const std::filesystem::path& part) {
        if (std::ranges::count(parts, part) == 0) parts.push_back(part);
    };
    if (frames)
        for (const std::filesystem::path& file : density_files(folder, scene, 1)) add(file.parent_path());
    if (frames && pictures) add(folder.folder / "frames");
    if (!scene.layers.empty()) add(folder.folder / "statistics");
    return parts;
}

void make_parts(const RunFolder& folder, const Scene& scene, bool frames, bool pictures) {
    for (const std::filesystem::path& part : parts_of_run(folder, scene, frames, pictures))
        create_folders(part);
    if (!frames) return;
    std::map<FileIdentity, std::filesystem::path> known;
    for (const std::filesystem::path& file : density_files(folder, scene, 1)) {
        const std::filesystem::path each = file.parent_path();
        const std::optional<FileIdentity> identity = identity_behind(each);
        if (!identity) continue;  // removed meanwhile, which whoever writes there will find
        const auto [found, is_new] = known.try_emplace(*identity, each);
        if (!is_new)
            throw Error(ErrorCode::usage,
                        fmt::format("{} and {} are one folder: the frames of one layer would replace those "
                                    "of the other",
                                    found->second.string(), each.string()));
    }
}

HeldFolders::HeldFolders(const std::filesystem::path& own) {
    if (const std::optional<FileIdentity> identity = identity_behind(own)) known_.insert(*identity);
}

void HeldFolders::hold(const std::filesystem::path& folder) {
    const std::optional<FileIdentity> identity = identity_behind(folder);
    if (!identity || type_behind(folder) != std::filesystem::file_type::directory) return;
    if (!known_.contains(*identity)) locks_.emplace_back(folder, "run");
    known_.insert(*identity);
}

bool HeldFolders::holds(const std::filesystem::path& folder) const {
    const std::optional<FileIdentity> identity = identity_behind(folder);
    return identity && known_.contains(*identity);
}

}  // namespace nephos
