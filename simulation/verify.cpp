// SPDX-License-Identifier: Apache-2.0
#include "simulation/verify.h"

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "core/descriptor.h"
#include "core/digest.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/run_listing.h"
#include "simulation/sealed_json.h"
#include "simulation/statistics_file.h"
#include "simulation/verify_content.h"
#include "simulation/verify_problems.h"
#include "simulation/verify_replay.h"

namespace nephos {
namespace {

// Adds the files below a part of the folder that the manifest does not list. What a link to a folder leads to is somebody else's.
void add_extra_files(const RunListing& run, const std::set<std::string>& listed,
                     const std::filesystem::path& part, std::vector<std::filesystem::path>& extra) {
    for (const std::string& name : names_in_folder(run.folder / part)) {
        const std::filesystem::path path = part / name;
        constexpr auto kFolder = std::filesystem::file_type::directory;
        if (type_at(run.folder / path) == kFolder) {
            add_extra_files(run, listed, path, extra);
        } else if (type_behind(run.folder / path) != kFolder && !listed.contains(path.generic_string())) {
            extra.push_back(path);
        }
    }
}

// Removes what is one of the listed files by another path, as where a link makes one folder of two.
void remove_listed(const RunListing& run, const std::set<std::string>& listed,
                   std::vector<std::filesystem::path>& extra) {
    if (extra.empty()) return;
    std::multimap<std::string, std::filesystem::path> by_name;
    for (const std::string& name : listed)
        by_name.emplace(std::filesystem::path(name).filename().string(), run.folder / name);
    const RunFolder own{run.folder, run.scene.name};
    for (const std::filesystem::path& path : {own.manifest(), own.checkpoint(), own.statistics()})
        by_name.emplace(path.filename().string(), path);
    std::erase_if(extra, [&](const std::filesystem::path& path) {
        const auto [begin, end] = by_name.equal_range(path.filename().string());
        return std::any_of(begin, end,
                           [&](const auto& file) { return is_same_place(run.folder / path, file.second); });
    });
}

Check check_numbers(const RunListing& run) {
    Problems problems;
    std::set<int> numbers;
    for (const ListedFrame& frame : run.frames) numbers.insert(frame.number);
    const int last = run.complete ? run.range.last_frame : (numbers.empty() ? 0 : *numbers.rbegin());
    int next = run.range.first_frame;
    const auto expect = [&](int number) {  // all from the next to the one before it are missing
        if (number == next + 1) problems.add(fmt::format("frame {} is missing", next));
        if (number > next + 1) problems.add(fmt::format("frames {} to {} are missing", next, number - 1));
        next = std::max(next, number + 1);
    };
    for (const int number : numbers)
        if (number <= last) expect(number);
    expect(last + 1);
    if (!run.complete)
        problems.add(fmt::format("the run is not complete: {} frames are done", numbers.size()));
    if (run.complete && last < run.range.first_frame && numbers.empty())
        return {"frames", true, "of statistics alone"};
    return problems.check(
        "frames", fmt::format("{} frames, {} to {}, no gap", numbers.size(), run.range.first_frame, last));
}

// The tables of a run that is not complete, to which it may have appended since.
Check check_tables(const RunListing& run) {
    Problems problems, unread;
    std::uint64_t bytes = 0;
    for (const FileRecord& table : run.tables) {
        try {
            const FileDigest found = file_digest(run.folder / table.path, table.digest.bytes);
            bytes += table.digest.bytes;
            if (!(found == table.digest))
                problems.add(fmt::format("{}: does not begin with the {} bytes that were written", table.path,
                                         table.digest.bytes));
        } catch (const ReadFailure& failure) {
            unread.add(failure.what());
        } catch (const Error& error) {
            problems.add(error.what());
        }
    }
    if (problems.none() && !unread.none()) return unread.not_done("tables");
    return problems.check("tables", fmt::format("begin with the {} bytes that were written", bytes));
}

// Returns the hashes of all steps that a run reports.
std::vector<StateHash> hashes_of_steps(const RunListing& run) {
    std::vector<StateHash> hashes;
    read_statistics(RunFolder{run.folder, run.scene.name}.statistics(), run.steps_reported,
                    [&](std::uint64_t, std::string_view, const StateHash& hash) { hashes.push_back(hash); });
    return hashes;
}

// Compares the tables of two runs, step by step. Returns how many steps both have.
std::size_t compare_steps(const RunListing& run, const RunListing& other, Problems& problems) {
    const std::vector<StateHash> own = hashes_of_steps(run), others = hashes_of_steps(other);
    if (others.size() != own.size())
        problems.add(fmt::format("it has {} steps, not {}", others.size(), own.size()));
    const std::size_t steps = std::min(own.size(), others.size());
    for (std::size_t n = 0; n < steps; ++n)
        if (!(own[n] == others[n])) problems.add(fmt::format("step {}: another state", n));
    return steps;
}

// Checksums of voxels by path; that of a picture is empty.
std::map<std::string, std::string> voxels_of(const ListedFrame& frame) {
    std::map<std::string, std::string> voxels;
    for (const FileRecord& file : frame.files) voxels[file.path] = file.voxels;
    return voxels;
}

// Manifests of earlier versions list no files.
bool is_unlisted(const RunListing& run, const ListedFrame& frame) {
    return frame.files.empty() && has_density(run.scene);
}

// Compares the frames of two runs by what their manifests say. Returns how many files have the same voxels.
std::size_t compare_frames(const RunListing& run, const RunListing& other, Problems& problems) {
    std::map<int, const ListedFrame*> frames;
    for (const ListedFrame& frame : other.frames) frames[frame.number] = &frame;
    if (other.frames.size() != run.frames.size())
        problems.add(fmt::format("it has {} frames, not {}", other.frames.size(), run.frames.size()));
    std::size_t same = 0;
    std::set<int> own;
    for (const ListedFrame& frame : run.frames) {
        own.insert(frame.number);
        const auto found = frames.find(frame.number);
        if (found == frames.end()) {
            problems.add(fmt::format("it has no frame {}", frame.number));
            continue;
        }
        if (found->second->state_hash != frame.state_hash)
            problems.add(fmt::format("frame {}: another state", frame.number));
        if (is_unlisted(run, frame) || is_unlisted(other, *found->second)) {
            problems.add("a manifest of an earlier version has no checksums: run its scene anew");
            continue;
        }
        std::map<std::string, std::string> others = voxels_of(*found->second);
        for (const auto& [path, voxels] : voxels_of(frame)) {
            const auto file = others.extract(path);
            const bool is_listed = !file.empty();
            if (voxels.empty() && (!is_listed || file.mapped().empty())) continue;
            if (!is_listed)
                problems.add(fmt::format("it has no {}", path));
            else if (voxels.empty() || file.mapped().empty())
                problems.add(path + ": a manifest has no checksum of its voxels: run its scene anew");
            else if (file.mapped() != voxels)
                problems.add(path + ": other voxels");
            else
                ++same;
        }
        for (const auto& [path, voxels] : others)
            if (!voxels.empty()) problems.add(fmt::format("it has {} besides", path));
    }
    for (const auto& [number, frame] : frames)
        if (!own.contains(number)) problems.add(fmt::format("it has frame {} besides", number));
    return same;
}

// Throws Error(usage) where there is none, or that of something else than a run. One that cannot be looked at, or is damaged, is
// told beside the other checks.
void require_manifest(const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "manifest.json";
    std::string format;
    try {
        if (!is_there(path))
            throw Error(ErrorCode::usage,
                        folder.string() + ": is no folder of a run: it has no manifest.json");
        format = foreign_format(path);
    } catch (const Error& error) {
        if (error.code() == ErrorCode::usage) throw;
        return;
    }
    if (!format.empty())
        throw Error(ErrorCode::usage,
                    fmt::format("{}: is no folder of a run: its manifest.json is that of a \"{}\"",
                                folder.string(), format));
}

Check compare_runs(const RunListing& run, const std::filesystem::path& other_folder) {
    Problems problems, unread;
    std::size_t steps = 0, files = 0;
    try {
        if (seal_of(other_folder / "manifest.json") == Seal::broken)
            problems.add("the bytes of its manifest.json are not those that were written");
        const RunListing other = read_run(other_folder);
        files = compare_frames(run, other, problems);
        steps = compare_steps(run, other, problems);
    } catch (const ReadFailure& failure) {
        unread.add(failure.what());
    } catch (const Error& error) {
        problems.add(error.what());
    }
    if (problems.none() && !unread.none()) return unread.not_done("against");
    return problems.check(
        "against",
        fmt::format("{}: by tables and manifests the same states in {} steps and the same voxels in {} files",
                    other_folder.string(), steps, files));
}

}  // namespace

bool Verification::passed() const {
    return std::ranges::all_of(checks, [](const Check& check) { return check.passed; });
}

bool Verification::failed() const {
    return std::ranges::any_of(checks, [](const Check& check) { return check.done && !check.passed; });
}

std::vector<Check> check_files(const std::filesystem::path& folder, const std::vector<ListedFile>& files,
                               const std::vector<std::filesystem::path>& extra, bool is_listed) {
    std::vector<std::string> wrong(files.size()), missing(files.size()), unread(files.size());
    tbb::parallel_for(std::size_t(0), files.size(), [&](std::size_t n) {
        const std::filesystem::path path = folder / files[n].path;
        try {
            if (!is_there(path)) {
                missing[n] = files[n].path.generic_string() + " is missing";
                return;
            }
            const FileDigest found = file_digest(path);
            if (found.bytes != files[n].bytes)
                wrong[n] = fmt::format("{}: {} bytes, not {}", files[n].path.generic_string(), found.bytes,
                                       files[n].bytes);
            else if (found.xxh3 != files[n].xxh3)
                wrong[n] = fmt::format("{}: its bytes are not those that were written",
                                       files[n].path.generic_string());
        } catch (const ReadFailure& failure) {
            unread[n] = failure.what();
        } catch (const Error& error) {
            wrong[n] = error.what();
        }
    });
    Problems presence, content, reading;
    const auto add = [](Problems& problems, const std::vector<std::string>& texts) {
        for (const std::string& text : texts)
            if (!text.empty()) problems.add(text);
    };
    add(presence, missing);
    add(content, wrong);
    add(reading, unread);
    for (const std::filesystem::path& path : extra)
        presence.add(path.generic_string() + " is listed nowhere");
    std::uint64_t bytes = 0;
    std::size_t compared = 0;
    for (std::size_t n = 0; n < files.size(); ++n) {
        if (!unread[n].empty() || !missing[n].empty()) continue;
        bytes += files[n].bytes;
        ++compared;
    }
    std::vector<Check> checks{presence.check(
        "files", fmt::format("{} files, none {}missing{}", files.size(), reading.none() ? "" : "known to be ",
                             is_listed ? ", none extra" : ""))};
    if (compared == files.size())
        checks.push_back(content.check("hashes", fmt::format("{} bytes agree with their checksums", bytes)));
    else if (compared == 0)
        checks.push_back((reading.none() ? presence : reading).not_done("hashes"));
    else
        checks.push_back(content.check(
            "hashes",
            fmt::format("{} bytes of {} of the files agree with their checksums", bytes, compared)));
    if (!reading.none()) checks.push_back(reading.not_done("reading"));
    return checks;
}

Check check_list(const std::filesystem::path& list) {
    Check check{"list", true, list.filename().string() + " is as it was written"};
    switch (seal_of(list)) {
        case Seal::whole:
            break;
        case Seal::none:
            check.detail = list.filename().string() + ", of an earlier version, has no checksum";
            break;
        case Seal::broken:
            check = {"list", false, list.filename().string() + ": its bytes are not those that were written"};
    }
    return check;
}

Verification verify_run(const std::filesystem::path& folder, const VerifyOptions& options) {
    const RunListing run = read_run(folder);
    if (options.against) require_manifest(*options.against);
    Verification result{"run", {check_list(folder / "manifest.json")}};
    result.checks.push_back(check_numbers(run));
    std::vector<ListedFile> files;
    std::set<std::string> names;
    const auto add = [&](const FileRecord& file) {
        files.push_back({file.path, file.digest.bytes, file.digest.xxh3});
        names.insert(file.path);
    };
    bool recorded = true;
    for (const ListedFrame& frame : run.frames) {
        recorded = recorded && !is_unlisted(run, frame);
        for (const FileRecord& file : frame.files) add(file);
    }
    for (const FileRecord& file : run.run_files) add(file);
    if (!run.complete) {
        for (const LayerOptions& layer : run.scene.layers) names.insert("statistics/" + layer.name + ".csv");
    }
    if (!recorded)
        result.checks.push_back(
            {"digests", false, "the manifest, of an earlier version, has no checksums: run the scene anew"});
    std::vector<std::filesystem::path> extra;
    Problems unlisted;
    try {
        for (const char* part : {"density", "frames", "statistics"}) add_extra_files(run, names, part, extra);
        remove_listed(run, names, extra);
        std::ranges::sort(extra);
    } catch (const ReadFailure& failure) {
        unlisted.add(failure.what());
    }
    for (Check& check : check_files(folder, files, extra, unlisted.none()))
        result.checks.push_back(std::move(check));
    if (!unlisted.none()) result.checks.push_back(unlisted.not_done("listing"));
    if (!run.complete && !run.tables.empty()) result.checks.push_back(check_tables(run));
    if (options.against) result.checks.push_back(compare_runs(run, *options.against));
    if (!options.hashes_only) check_content(run, options, result.checks);
    if (options.replay > 0) result.checks.push_back(replay_frames(run, options.replay));
    return result;
}

}  // namespace nephos
