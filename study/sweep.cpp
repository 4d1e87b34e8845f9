// SPDX-License-Identifier: Apache-2.0
#include "study/sweep.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <optional>
#include <set>
#include <span>
#include <string_view>

#include "study/folder_contents.h"
#include "study/folder_guard.h"
#include "study/plan_memory.h"
#include "study/shard_files.h"
#include "study/sweep_file.h"
#include "study/workers.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include "core/atomic_file.h"
#include "core/bytes.h"
#include "core/descriptor.h"
#include "core/error.h"

namespace nephos {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kNamedFailures = 5;

// Before the runs: what stands in its place is refused at once. Takes away what a kill or a full disk left of a last line.
Descriptor open_timing(const std::filesystem::path& path) {
    separate_from_links(path);
    Descriptor file = open_regular_file(path, O_RDWR | O_APPEND | O_CREAT | O_NOFOLLOW);
    struct stat status {};
    if (::fstat(file.get(), &status) != 0 || status.st_size == 0) return file;
    std::array<char, 4096> tail{};  // more than a line
    const off_t begin = std::max<off_t>(0, status.st_size - off_t(tail.size()));
    const ssize_t got = ::pread(file.get(), tail.data(), tail.size(), begin);
    if (got <= 0 || begin + got != status.st_size) return file;
    const std::string_view end(tail.data(), std::size_t(got));
    const std::size_t last = end.rfind('\n');
    if (last == end.npos && begin > 0) return file;
    const off_t whole = last == end.npos ? 0 : begin + off_t(last) + 1;
    if (whole < status.st_size && ::ftruncate(file.get(), whole) != 0)
        throw Error(ErrorCode::io, path.string() + ": cannot write: " + std::strerror(errno));
    return file;
}

// Appends the time that a shard took. Returns the system's error, 0 without one.
int add_timing(const Descriptor& file, const SweepJob& job, int workers, std::uint64_t runs, double wall_s) {
    struct stat status {};
    if (::fstat(file.get(), &status) != 0) return errno;
    const std::string text =
        fmt::format("{}{},{},{},{},{:.3f}\n", status.st_size == 0 ? "shard,shards,workers,runs,wall_s\n" : "",
                    job.shard, job.shards, workers, runs, wall_s);
    const int error = write_all(file.get(), std::as_bytes(std::span(text)));
    if (error != 0) {
        [[maybe_unused]] const int ignored = ::ftruncate(file.get(), status.st_size);
    }
    return error;
}

// By the value of the id: neither the order of runs nor a grown axis moves a run to another shard.
bool is_of_shard(const std::string& id, const SweepJob& job) {
    std::uint32_t number = 0;
    std::from_chars(id.data(), id.data() + std::min<std::size_t>(id.size(), 8), number, 16);
    return job.shards == 1 || number % job.shards == job.shard;
}

std::string packed(const RunResult& result) {
    ByteWriter writer;
    writer.put(result.regime);
    writer.put(std::array{result.steps, result.warm_up, result.used, result.period, result.snapshots});
    writer.put(result.statistics);
    writer.put(result.scales);
    writer.put(std::array{std::uint64_t(result.tracks.size()), std::uint64_t(result.profile.size()),
                          std::uint64_t(result.sizes.size()), std::uint64_t(result.series.size()),
                          std::uint64_t(result.state_hash.size()), std::uint64_t(result.thumbnail.size())});
    writer.put_bytes(std::as_bytes(std::span(result.tracks)));
    writer.put_bytes(std::as_bytes(std::span(result.profile)));
    writer.put_bytes(std::as_bytes(std::span(result.sizes)));
    writer.put_bytes(std::as_bytes(std::span(result.series)));
    writer.put_bytes(std::as_bytes(std::span(result.state_hash)));
    writer.put_bytes(std::as_bytes(std::span(result.thumbnail)));
    const std::vector<std::byte> bytes = writer.take();
    std::string text(bytes.size(), '\0');
    std::memcpy(text.data(), bytes.data(), bytes.size());
    return text;
}

RunResult unpacked(const std::string& text) {
    ByteReader reader(std::as_bytes(std::span(text)));
    RunResult result;
    result.regime = reader.get<Regime>();
    const auto counts = reader.get<std::array<std::uint64_t, 5>>();
    result.steps = counts[0];
    result.warm_up = counts[1];
    result.used = counts[2];
    result.period = counts[3];
    result.snapshots = counts[4];
    result.statistics = reader.get<decltype(result.statistics)>();
    result.scales = reader.get<decltype(result.scales)>();
    const auto sizes = reader.get<std::array<std::uint64_t, 6>>();
    result.tracks.resize(sizes[0]);
    result.profile.resize(sizes[1]);
    result.sizes.resize(sizes[2]);
    result.series.resize(sizes[3]);
    result.state_hash.resize(sizes[4]);
    result.thumbnail.resize(sizes[5]);
    reader.get_bytes(std::as_writable_bytes(std::span(result.tracks)));
    reader.get_bytes(std::as_writable_bytes(std::span(result.profile)));
    reader.get_bytes(std::as_writable_bytes(std::span(result.sizes)));
    reader.get_bytes(std::as_writable_bytes(std::span(result.series)));
    reader.get_bytes(std::as_writable_bytes(std::span(result.state_hash)));
    reader.get_bytes(std::as_writable_bytes(std::span(result.thumbnail)));
    return result;
}

bool has_content(const std::filesystem::path& path, const std::string& content) {
    if (!is_there(path)) return false;
    return read_beginning(path, content.size() + 1) == content;
}

Error changed_since(const std::filesystem::path& file) {
    return {ErrorCode::io,
            file.string() +
                ": was changed after the sweep began: what is done is kept, and the same command "
                "goes on with what is in the file now"};
}

// A folder whose plan is another one may get this one as soon as nobody makes runs of that; none has plans side by side.
// Throws Error(io) before anything is changed.
void require_place_for(const SweepPlan& plan, const FolderGuard& guard, const std::filesystem::path& folder) {
    const bool is_new = !is_there(folder / "sweep.toml");
    if (!is_new && !is_plan_of(plan, folder)) guard.require_no_writer();
}

void place_plan(const SweepPlan& plan, const std::filesystem::path& folder) {
    write_atomically(folder / "scene.toml", plan.scene_text_in(folder));
    write_atomically(folder / "sweep.toml", plan.to_toml_in(folder));
}

// Counts what is there. Goes over all runs, but keeps none; over none where nothing is there.
SweepReport status_of(const SweepPlan& plan, const SweepJob& job, const Records& records) {
    SweepReport report;
    if (records.size() == 0 && job.shards == 1) {
        report.progress.in_all = plan.runs();
        report.complete = plan.runs() == 0;
        report.problems = records.problems();
        return report;
    }
    std::uint64_t known = 0;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) {
        const PlannedRun run = plan.run(n);
        const RunRecord* record = records.find(run.id);
        known += record != nullptr;
        if (!is_of_shard(run.id, job)) continue;
        ++report.progress.in_all;
        if (record == nullptr) continue;
        ++report.progress.done;
        if (!record->failed) continue;
        ++report.progress.failed;
        if (report.failures.size() < kNamedFailures)
            report.failures.push_back(
                fmt::format("point {}, replicate {}: {}", run.point, run.replicate, record->message));
    }
    report.progress.before = report.progress.done;
    report.complete = report.progress.done == report.progress.in_all;
    report.unused = records.size() - known;
    report.problems = records.problems();
    return report;
}

int workers_for(const SweepJob& job, const SweepProgress& count) {
    return int(std::min<std::uint64_t>(std::uint64_t(job.workers), count.in_all - count.done));
}

// Throws Error(usage) unless the workers that are left something to do fit into memory with a run each.
void require_memory_for_runs(const SweepPlan& plan, const SweepJob& job, const SweepProgress& count) {
    if (const int workers = workers_for(job, count); workers > 0) require_memory_for(plan, workers);
}

}  // namespace

void write_plan(const SweepPlan& plan, const std::filesystem::path& folder) {
    require_sweep_folder(folder);
    const FolderGuard guard(folder);
    require_place_for(plan, guard, folder);
    place_plan(plan, folder);
}

bool is_plan_of(const SweepPlan& plan, const std::filesystem::path& folder) {
    return has_content(folder / "scene.toml", plan.scene_text_in(folder)) &&
           has_content(folder / "sweep.toml", plan.to_toml_in(folder));
}

bool has_runs_of(const SweepPlan& plan, const std::filesystem::path& folder) {
    // Shards that were copied together have no plan yet.
    if (!is_there(folder / "sweep.toml") || is_plan_of(plan, folder)) return true;
    const SweepPlan other = plan_of_folder(folder);
    if (other.points() != plan.points() || other.runs() != plan.runs()) return false;
    for (std::uint64_t n = 0; n < plan.runs(); ++n)
        if (other.run(n).id != plan.run(n).id) return false;
    return true;
}

SweepReport sweep_status(const SweepPlan& plan, const SweepJob& job) {
    const Records records = Records::read({job.folder});
    SweepReport report = status_of(plan, job, records);
    if (!report.complete || report.progress.failed > 0)
        report.problems.insert(report.problems.end(), records.damaged_ends().begin(),
                               records.damaged_ends().end());
    return report;
}

SweepReport run_sweep(const SweepPlan& plan, const SweepJob& job,
                      const std::function<void(const SweepProgress&)>& progress,
                      const std::function<bool()>& stop) {
    const Clock::time_point begin = Clock::now();
    require_sweep_folder(job.folder);
    if (!is_there(job.folder / "shards"))
        require_memory_for_runs(plan, job, status_of(plan, job, Records()).progress);
    std::optional<FolderGuard> guard(std::in_place, job.folder, stop);
    if (!guard->is_held()) {  // stopped while another process had the folder
        SweepReport report = status_of(plan, job, Records::read({job.folder}));
        report.complete = false;
        return report;
    }
    require_place_for(plan, *guard, job.folder);
    // Whoever overwrites does not ask what other shards have done: they may be of another version. Of many shards each compares
    // the series of its own runs, in whichever file they are.
    const auto is_own = [&](const std::string& id) { return is_of_shard(id, job); };
    Records records = job.overwrite ? Records() : Records::read({job.folder}, RecordsFor::running, is_own);
    SweepReport report = status_of(plan, job, records);
    SweepProgress& count = report.progress;
    const auto is_wanted = [&](const PlannedRun& run) {
        if (!is_of_shard(run.id, job)) return false;
        const RunRecord* record = records.find(run.id);
        return record == nullptr || (record->failed && job.retry_failed);
    };
    if (job.retry_failed) {
        count.done -= count.failed;
        count.before = count.done;
        count.failed = 0;
        report.failures.clear();
    }
    WorkerOptions workers;
    workers.count = workers_for(job, count);
    require_memory_for_runs(plan, job, count);
    if (job.overwrite) remove_shards(job.folder, job.shard, job.shards);
    std::optional<Shard> opened;
    if (count.done < count.in_all) opened.emplace(job.folder, job.shard, job.shards);
    place_plan(plan, job.folder);
    guard.reset();
    if (!opened) {
        if (!job.overwrite) report.records = std::move(records);
        return report;
    }
    Shard& shard = *opened;
    std::uint64_t at = 0;
    bool give_up = false;
    std::optional<std::filesystem::path> changed;  // a file that the plan was made of: no more runs
    const auto look_at_files_of = [&](const PlannedRun& run) {
        if (!changed) changed = plan.changed_file(run);
        return changed.has_value();
    };
    const auto next = [&]() -> std::optional<std::uint64_t> {
        while (at < plan.runs() && !is_wanted(plan.run(at))) ++at;
        if (give_up || at == plan.runs() || look_at_files_of(plan.run(at))) return std::nullopt;
        return at++;
    };
    const Task task = [&](std::uint64_t number) {
        const PlannedRun run = plan.run(number);
        return packed(run_for_statistics(plan.scene_of(run), plan.options(), run.replicate == 0, [&] {
            if (const auto file = plan.changed_file(run)) throw changed_since(*file);
        }));
    };
    const TaskEnd end = [&](std::uint64_t number, const std::string& result,
                            const std::optional<std::string>& failure) {
        const PlannedRun run = plan.run(number);
        if (failure && look_at_files_of(run)) return;  // it failed for that
        if (failure) {
            shard.add_failure(run, *failure);
            ++count.failed;
            give_up = give_up || job.fail_fast;
            if (report.failures.size() < kNamedFailures)
                report.failures.push_back(
                    fmt::format("point {}, replicate {}: {}", run.point, run.replicate, *failure));
        } else {
            shard.add(run, unpacked(result));
        }
        ++count.done;
    };
    workers.stop = stop;
    workers.idle = [&] {
        if (progress) progress(count);
    };
    const std::filesystem::path times = job.folder / "timing.csv";
    const Descriptor timing = open_timing(times);
    work(workers, next, task, end);
    shard.flush();
    report.complete = count.done == count.in_all;
    report.wall_s = std::chrono::duration<double>(Clock::now() - begin).count();
    if (const int error = add_timing(timing, job, workers.count, count.done - count.before, report.wall_s))
        report.problems.push_back(times.string() + ": cannot write: " + std::strerror(error));
    if (changed) throw changed_since(*changed);
    return report;
}

SweepPlan plan_of_folder(const std::filesystem::path& folder) {
    const std::filesystem::path file = folder / "sweep.toml";
    if (!is_there(file))
        throw Error(ErrorCode::io,
                    folder.string() + ": is no folder of a sweep: it has no sweep.toml (expected the --out of "
                                      "`nephos sweep`)");
    return SweepPlan(read_sweep_file(file));
}

Records records_of_folders(const SweepPlan& plan, const std::vector<std::filesystem::path>& folders) {
    for (const std::filesystem::path& folder : folders) {
        std::error_code error;
        if (!std::filesystem::is_directory(folder, error))
            throw Error(ErrorCode::io, folder.string() + ": is no folder");
    }
    Records records = Records::read(folders, RecordsFor::showing);
    const std::vector<std::uint64_t> all = records.sizes_of_folders();
    std::vector<std::uint64_t> used(all.size(), 0);
    bool complete = true;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) {
        const RunRecord* record = records.find(plan.run(n).id);
        complete = complete && record != nullptr && !record->failed;
        if (record != nullptr) ++used[records.folder_of(*record)];
    }
    if (!complete) records.count_damaged_ends_as_problems();
    for (std::size_t n = 1; n < folders.size(); ++n) {
        if (all[n] == 0 || used[n] > 0) continue;
        throw Error(ErrorCode::usage,
                    fmt::format("{0}: has {1} records, and none is of a run that {2}/sweep.toml asks for: it is of "
                                "another scene or plan; leave it out (`nephos merge {0}` makes its own tables)",
                                folders[n].string(), all[n], folders.front().string()));
    }
    return records;
}

std::uint64_t unused_records(const SweepPlan& plan, const Records& records) {
    std::uint64_t used = 0;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) used += records.find(plan.run(n).id) != nullptr;
    return records.size() - used;
}

void write_plan_of_tables(const SweepPlan& plan, const std::filesystem::path& folder) {
    if (!has_shards(folder) || !is_there(folder / "sweep.toml")) place_plan(plan, folder);
}

}  // namespace nephos
