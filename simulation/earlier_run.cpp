// SPDX-License-Identifier: Apache-2.0
#include "simulation/earlier_run.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <system_error>
#include <unordered_map>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "automaton/checkpoint.h"
#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/writer.h"
#include "simulation/manifest.h"
#include "simulation/own_files.h"
#include "simulation/statistics_file.h"

namespace nephos {
namespace {

using Parameters = std::vector<std::pair<std::string, std::string>>;

// Parts of the folder that hold frames: a folder of its own for the densities of each layer.
std::vector<std::string> frame_parts(const RunFolder& folder) {
    std::vector<std::string> parts{"density", "frames"};
    for (const std::string& name : names_in_folder(folder.folder / "density")) {
        // Also behind a link, as to another disk: what a run writes there it must not take from others.
        if (type_behind(folder.folder / "density" / name) == std::filesystem::file_type::directory)
            parts.push_back("density/" + name);
    }
    return parts;
}

// Returns the name of the scene of the run that is in the folder; empty where none tells it.
std::string earlier_name(const RunFolder& folder) {
    if (type_behind(folder.manifest()) != std::filesystem::file_type::regular) return {};
    try {
        const std::string name = read_manifest(folder.manifest()).name;
        return std::filesystem::path(name).filename() == name ? name : "";  // leads nowhere else
    } catch (const ReadFailure&) {
        throw;
    } catch (const Error&) {
        return {};
    }
}

[[noreturn]] void refuse(const RunFolder& folder, const std::string& reason) {
    throw Error(ErrorCode::usage,
                fmt::format("{}: nothing was written, because {}: choose another --out, or give --overwrite",
                            folder.folder.string(), reason));
}

void refuse_foreign_table(const RunFolder& folder, const std::filesystem::path& table,
                          std::string_view header) {
    if (!stands_there(table) || is_statistics(table, header) || is_begun_statistics(table, header)) return;
    refuse(folder, fmt::format("the folder holds a {} that is not of a run",
                               table.lexically_relative(folder.folder).string()));
}

// Reads the manifest of the run that is in the folder.
EarlierRun manifest_of_run(const RunFolder& folder) {
    try {
        return read_manifest(folder.manifest());
    } catch (const ReadFailure&) {
        throw;
    } catch (const Error& reason) {
        refuse(folder,
               fmt::format("the folder holds a manifest.json that is not of a run ({})", reason.what()));
    }
}

// Returns whether a new run of the same scene makes all files of an earlier one again.
bool makes_again(const EarlierRun& earlier, const RunSettings& settings) {
    const SimulationRange &then = earlier.range, &now = settings.range;
    return now.last_step >= then.last_step && (settings.render || !earlier.render) &&
           (!then.has_frames() || (now.first_frame <= then.first_frame && now.last_frame >= then.last_frame));
}

std::string range_text(const EarlierRun& run) {
    if (!run.range.has_frames()) return "statistics alone";
    return fmt::format("frames {}..{}{}", run.range.first_frame, run.range.last_frame,
                       run.render ? "" : ", without pictures");
}

// Names what differs where no key does.
std::string other_content(const EarlierRun& earlier, const RunSettings& settings) {
    const std::vector<RunInput> now = inputs_of(settings);
    const std::string states = changed_inputs(earlier.inputs, now, {FileKind::first_state}),
                      others = changed_inputs(earlier.inputs, now, {FileKind::simulation, FileKind::picture});
    if (!states.empty())
        return fmt::format("the initial state differs: {}{}{}", states, others.empty() ? "" : ", and ",
                           others);
    if (!others.empty()) return "the content of a file differs: " + others;
    if (earlier.branch.has_value() != settings.branch.has_value())
        return earlier.branch ? "it branched off another run: give the same --from"
                              : "it did not branch off another run";
    if (settings.branch) return "the run that it branched off differs";
    return "the content of a file that it names differs";
}

// Names the keys in which two scenes differ, at most three of them.
std::string changed_keys(const EarlierRun& earlier, const RunSettings& settings) {
    std::vector<std::string> keys;
    // Manifests of earlier versions have only the keys that were not at their defaults.
    const Parameters list_now = parameters(settings.scene), list_default = parameters(Scene{});
    using Values = std::unordered_map<std::string, std::string>;
    const Values then(earlier.parameters.begin(), earlier.parameters.end()),
        now(list_now.begin(), list_now.end()), defaults(list_default.begin(), list_default.end());
    const auto value_in = [&](const Values& values, const std::string& key) -> std::string {
        for (const Values* list : {&values, &defaults})
            if (const auto found = list->find(key); found != list->end()) return found->second;
        return "not there";
    };
    const auto compare = [&](const std::string& key) {
        const std::string was = value_in(then, key), is = value_in(now, key);
        if (was != is) keys.push_back(fmt::format("`{}` was {}, now {}", key, was, is));
    };
    for (const auto& [key, value] : earlier.parameters) compare(key);
    for (const auto& [key, value] : list_now)
        if (!then.contains(key)) compare(key);
    if (keys.empty()) return other_content(earlier, settings);
    const std::size_t more = keys.size() > 3 ? keys.size() - 3 : 0;
    keys.resize(keys.size() - more);
    return fmt::format("{}{}", fmt::join(keys, "; "), more > 0 ? fmt::format("; and {} more", more) : "");
}

// Describes what makes the scene another one than that of the earlier run. `before`: with the steps of then.
std::string difference(const EarlierRun& earlier, const RunSettings& settings, const Scene& before) {
    if (earlier.scene_hash == scene_hash(before)) return other_content(earlier, settings);
    Scene other_video = settings.scene;
    other_video.frames.video = !other_video.frames.video;
    if (earlier.scene_hash == scene_hash(other_video)) {
        return settings.scene.frames.video ? "only the video differs: the first call was without --video"
                                           : "only the video differs: the first call was with --video";
    }
    return changed_keys(earlier, settings);
}

// Returns the scene of an earlier run, which may have fewer steps. Throws Error(usage) when it is another one.
Scene scene_before(const EarlierRun& earlier, const RunSettings& settings, const RunFolder& folder) {
    Scene before = settings.scene;
    before.steps = std::min(earlier.scene_steps, settings.scene.steps);
    if (earlier.simulation_hash == settings.simulation_hash && earlier.scene_hash == scene_hash(before))
        return before;
    const std::string hashes =
        earlier.scene_hash == settings.scene_hash
            ? ""
            : fmt::format("hash {}, now {}; ", earlier.scene_hash, settings.scene_hash);
    throw Error(ErrorCode::usage,
                fmt::format("{}: was started with another scene ({}{}). Resume with the scene, "
                            "--seed, --set and --video of the first call (manifest.json has the scene under "
                            "\"scene_text\"; only time.steps may be larger), or start anew with --overwrite",
                            folder.folder.string(), hashes, difference(earlier, settings, before)));
}

// Throws Error(usage) when the run in the folder is not that of the settings, or began otherwise.
void refuse_other_run(const RunFolder& folder, const EarlierRun& earlier, const RunSettings& settings,
                      const std::vector<RunInput>& inputs, Resumption found) {
    if (found == Resumption::start_anew) {
        scene_before(earlier, settings, folder);  // which may have fewer steps
    } else if (earlier.scene_hash != settings.scene_hash) {
        refuse(folder, fmt::format("it holds a run of '{}' with another scene or seed ({})", earlier.name,
                                   changed_keys(earlier, settings)));
    }
    const std::string changed = changed_inputs(
        earlier.inputs, inputs, {FileKind::first_state, FileKind::simulation, FileKind::picture});
    if (earlier.simulation_hash != settings.simulation_hash || !changed.empty()) {
        refuse(folder, fmt::format("it holds a run of '{}' with another beginning ({})", earlier.name,
                                   changed.empty() ? other_content(earlier, settings)
                                                   : "another content of " + changed));
    }
}

// Throws Error(usage) when frames that are to come would be drawn with other pictures than those that are there.
void refuse_other_pictures(const EarlierRun& earlier, const std::vector<RunInput>& inputs,
                           const RunFolder& folder) {
    const std::string changed = changed_inputs(earlier.inputs, inputs, {FileKind::picture});
    if (changed.empty()) return;
    throw Error(
        ErrorCode::usage,
        fmt::format(
            "{}: was started with another content of {}: put the file of then back to resume, or start "
            "anew with --overwrite",
            folder.folder.string(), changed));
}

// The range that the same command line gives for the scene as it was: of two that it may mean that of the earlier run.
SimulationRange range_before(const RunSettings& settings, const Scene& before,
                             const SimulationRange& earlier) {
    const SimulationRange& now = settings.range;
    std::vector<SimulationRange> ranges;
    const auto full = [&](const Scene& scene) {
        SimulationRange range = full_range(scene);
        if (settings.branch) range.first_frame = now.first_frame;  // the next of the run that it branched off
        return range;
    };
    if (now == full(settings.scene)) ranges.push_back(full(before));
    // To the last frame that there is, as --frames 5.. says.
    const auto to_the_end = [&](const Scene& scene) {
        return range_of_frames(scene, now.first_frame, kLastFrame);
    };
    if (now.has_frames() && now == to_the_end(settings.scene) && now.first_frame <= frame_count(before))
        ranges.push_back(to_the_end(before));
    if (ranges.empty()) ranges.push_back(now);
    if (!now.has_frames()) ranges.back().last_step = before.steps;
    const auto found = std::ranges::find(ranges, earlier);
    return found == ranges.end() ? ranges.front() : *found;
}

}  // namespace

std::vector<std::filesystem::path> earlier_files(const RunFolder& folder) {
    std::vector<std::filesystem::path> files;
    std::vector<std::string> names{folder.name};
    if (const std::string earlier = earlier_name(folder); !earlier.empty() && earlier != folder.name)
        names.push_back(earlier);
    for (const std::string& part : frame_parts(folder)) {
        for (const std::string& file : names_in_folder(folder.folder / part)) {
            if (std::ranges::any_of(names, [&](const std::string& name) { return is_frame_of(file, name); }))
                files.push_back(folder.folder / part / file);
        }
    }
    for (const std::string& name : names_in_folder(folder.folder / "statistics")) {
        if (!published_name(name).empty()) continue;  // the leftover of a run that was killed
        const std::filesystem::path path = folder.folder / "statistics" / name;
        if (is_statistics(path, kLayerStatisticsHeader)) files.push_back(path);
    }
    std::vector<std::filesystem::path> others{folder.checkpoint(), folder.statistics()};
    for (const std::string& name : names) others.push_back(RunFolder{folder.folder, name}.video());
    others.push_back(folder.manifest());
    for (const std::filesystem::path& path : others)
        if (stands_there(path)) files.push_back(path);
    return files;
}

void remove_leftovers(const RunFolder& folder, HeldFolders& held) {
    const auto remove_if = [&](const std::filesystem::path& part, const auto& is_ours) {
        const std::filesystem::path place = part.empty() ? folder.folder : folder.folder / part;
        std::vector<std::filesystem::path> leftovers;
        for (const std::string& name : names_in_folder(place)) {
            const std::string published = published_name(name);
            const bool is_file = type_at(place / name) == std::filesystem::file_type::regular;
            if (is_file && !published.empty() && is_ours(published)) leftovers.push_back(place / name);
        }
        if (!leftovers.empty() && held.can_hold(place)) held.remove(leftovers);
    };
    remove_if({}, [&](const std::string& name) {
        return name == folder.manifest().filename() || name == folder.checkpoint().filename() ||
               name == folder.statistics().filename();
    });
    remove_if("statistics", [](const std::string& name) { return name.ends_with(".csv"); });
    const auto is_frame = [&](const std::string& name) {
        return is_frame_of(name, folder.name) || name == folder.video().filename();
    };
    for (const std::string& part : frame_parts(folder)) remove_if(part, is_frame);
}

void refuse_to_remove_inputs(const RunFolder& folder, const std::vector<std::filesystem::path>& files,
                             const std::vector<RunInput>& inputs) {
    std::map<FileIdentity, const RunInput*> begins_with;
    for (const RunInput& input : inputs)
        if (const auto identity = identity_behind(path_of(folder.folder, input.path)))
            begins_with[*identity] = &input;
    if (begins_with.empty()) return;
    for (const std::filesystem::path& file : files) {
        const std::optional<FileIdentity> identity = identity_behind(file);
        const auto found = identity ? begins_with.find(*identity) : begins_with.end();
        if (found == begins_with.end()) continue;
        throw Error(ErrorCode::usage, fmt::format("{}: is what `{}` names, and a file of the run in {}, "
                                                  "which is replaced: choose another --out",
                                                  file.string(), found->second->key, folder.folder.string()));
    }
}

void refuse_to_replace_next_frames(const RunFolder& folder, const RunSettings& settings) {
    const EarlierRun earlier = read_manifest(folder.manifest());
    if (!earlier.complete) {
        const bool has_video = settings.render && wants_video(settings.scene);
        for (const std::filesystem::path& file : earlier_files(folder)) {
            const bool is_video = has_video && file == folder.video();
            const bool is_frame =
                is_frame_place(folder, settings.scene, settings.range, settings.render, file);
            if ((is_frame || is_video) && !names_hash(file, earlier.frames_hash))
                throw Error(
                    ErrorCode::usage,
                    fmt::format("{}: is of another run, or of none, and has the place of {} of this one: "
                                "move it away, or start anew with --overwrite",
                                file.string(), is_video ? "the video" : "a frame"));
        }
        return;
    }
    const SimulationRange next{.last_step = settings.range.last_step,
                               .first_frame = earlier.range.last_frame + 1,
                               .last_frame = settings.range.last_frame};
    const auto refuse_file = [](const std::filesystem::path& file, const char* as) {
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: would be replaced by {} of the run, which has not written it: move it away, or "
                        "start anew with --overwrite",
                        file.string(), as));
    };
    for (const std::filesystem::path& file : earlier_files(folder))
        if (is_frame_place(folder, settings.scene, next, settings.render, file))
            refuse_file(file, "the next frame");
    // With no further frame the video stays, and is listed anew.
    if (settings.render && wants_video(settings.scene) && stands_there(folder.video()) &&
        OwnFiles(folder.folder, earlier, settings.scene).why_foreign(folder.video()))
        refuse_file(folder.video(), "the video");
}

void refuse_to_lose(const RunFolder& folder, const std::vector<std::filesystem::path>& files,
                    const RunSettings& settings, const std::vector<RunInput>& inputs, Resumption found) {
    for (const LayerOptions& layer : settings.scene.layers)
        refuse_foreign_table(folder, folder.statistics(layer.name), kLayerStatisticsHeader);
    if (files.empty()) return;
    if (files.back() != folder.manifest()) {
        refuse(folder, fmt::format("there is {}, but no manifest.json that says that it is of a run",
                                   files.back().lexically_relative(folder.folder).string()));
    }
    const EarlierRun earlier = manifest_of_run(folder);
    refuse_foreign_table(folder, folder.statistics(), kStatisticsHeader);
    refuse_other_run(folder, earlier, settings, inputs, found);
    if (earlier.complete && !makes_again(earlier, settings)) {
        refuse(folder, fmt::format("it holds a complete run for {}, not all of which would be made again",
                                   range_text(earlier)));
    }
    const bool has_checkpoint = std::ranges::count(files, folder.checkpoint()) > 0;
    if (has_checkpoint && !is_checkpoint(folder.checkpoint()))
        refuse(folder, "the folder holds a checkpoint.nephos that is not of a run");
    if (has_checkpoint && !earlier.complete) {
        throw Error(
            ErrorCode::usage,
            fmt::format("{}: holds an interrupted run of '{}' ({} of {} steps): give --resume to go on, or "
                        "--overwrite to start anew",
                        folder.folder.string(), earlier.name,
                        earlier.steps_reported == 0 ? 0 : earlier.steps_reported - 1,
                        earlier.range.last_step));
    }
    const OwnFiles own(folder.folder, earlier, settings.scene);
    for (const std::filesystem::path& file : files) {
        if (file == folder.manifest()) continue;
        if (const std::optional<std::string> why = own.why_foreign(file)) refuse(folder, *why);
    }
}

Resumption find_resumption(const RunSettings& settings, const RunFolder& folder) {
    if (std::filesystem::exists(folder.checkpoint())) return Resumption::go_on;
    if (!std::filesystem::exists(folder.manifest())) return Resumption::nothing_there;
    const EarlierRun earlier = read_manifest(folder.manifest());
    const Scene before = scene_before(earlier, settings, folder);
    const bool same =
        earlier.range == settings.range && earlier.render == settings.render;  // without frames neither draws
    if (same && earlier.complete && settings.statistics_only) return Resumption::complete;
    if (!same && earlier.range != range_before(settings, before, earlier.range))
        refuse(folder, "it holds a run of the same scene for " + range_text(earlier));
    return Resumption::start_anew;
}

void require_tables_of_run(const RunFolder& folder, const EarlierRun& run, std::string_view cure) {
    for (const FileRecord& table : run.tables)
        if (const std::filesystem::path path = folder.folder / table.path; is_there(path))
            require_table_of_run(path, table.digest, cure);
}

void require_nothing_appended(const RunFolder& folder, const EarlierRun& run) {
    for (const FileRecord& table : run.tables) {
        const std::filesystem::path path = folder.folder / table.path;
        if (type_behind(path) == std::filesystem::file_type::not_found) continue;
        std::error_code error;
        const std::uintmax_t size = std::filesystem::file_size(path, error);
        if (error) throw ReadFailure(path, error.message(), "examine");
        if (size > table.digest.bytes)
            throw Error(
                ErrorCode::io,
                fmt::format("{}: {} bytes were appended to what the complete run has written, and would be "
                            "lost: move them to another file{}",
                            path.string(), size - table.digest.bytes, kStartAnew));
    }
}

Simulation resumed_simulation(const RunSettings& settings, const RunFolder& folder,
                              const std::vector<RunInput>& inputs) {
    const EarlierRun earlier = read_manifest(folder.manifest());
    const Scene before = scene_before(earlier, settings, folder);
    refuse_other_pictures(earlier, inputs, folder);
    const SimulationRange range = range_before(settings, before, earlier.range);
    const EarlierRun now{.render = settings.render, .range = range};
    // One that had no frame yet has said nothing of its pictures.
    if (earlier.range != range || (range.has_frames() && earlier.render != settings.render)) {
        throw Error(
            ErrorCode::usage,
            fmt::format(
                "{}: was started for {}, now it is {}: resume with the same --frames, --no-render and "
                "--statistics-only",
                folder.folder.string(), range_text(earlier), range_text(now)));
    }
    const Checkpoint checkpoint = read_checkpoint(folder.checkpoint());
    try {
        return Simulation(settings.scene, settings.range, settings.simulation_hash, checkpoint,
                          settings.results());
    } catch (const Error& error) {
        throw Error(error.code(), folder.checkpoint().string() + ": " + error.what());
    }
}

}  // namespace nephos
