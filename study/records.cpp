// SPDX-License-Identifier: Apache-2.0
#include "study/records.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <span>

#include "study/folder_contents.h"
#include "study/packed_series.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/file.h>

#include "automaton/checkpoint.h"
#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "core/random.h"
#include "core/text.h"
#include "simulation/checked_json.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kHashField = ",\"xxh3\":\"";
constexpr double kFlushAfter_s = 1;
constexpr int kFlushAfter = 64;
constexpr std::uint64_t kMostBytes = std::uint64_t(1) << 50;  // of a file of series: no disk holds more

std::string hash_text(std::string_view text) { return hash_of_bytes(std::as_bytes(std::span(text))).hex(); }

// Closes an object with the hash of all before.
std::string sealed(const Json& json) {
    std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    text.pop_back();
    const std::string hash = hash_text(text);
    return text + std::string(kHashField) + hash + "\"}\n";
}

bool is_whole(std::string_view line) {
    const std::size_t at = line.rfind(kHashField);
    if (at == line.npos || !line.ends_with("\"}")) return false;
    const std::size_t begin = at + kHashField.size();
    return line.substr(begin, line.size() - 2 - begin) == hash_text(line.substr(0, at));
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }
double number_of(const Json& json) { return json.is_number() ? json.get<double>() : std::nan(""); }

Json head(const PlannedRun& run, std::string_view status) {
    return {{"run", run.id},
            {"status", status},
            {"statistics_version", NEPHOS_STATISTICS_VERSION},
            {"random_stream_version", kRandomStreamVersion},
            {"replicate", run.replicate},
            {"seed", std::to_string(run.seed)},
            {"values", run.values}};
}

// Throws Error(usage) on a record of another version, with a cure that the command which reads it has.
void require_this_version(const Json& json, const std::filesystem::path& shard, RecordsFor use) {
    const Json &statistics = json.at("statistics_version"), &stream = json.at("random_stream_version");
    if (statistics == NEPHOS_STATISTICS_VERSION && stream == kRandomStreamVersion) return;
    const auto found = [](const Json& version) { return escaped(version.dump()); };
    const std::string folder = shard.parent_path().parent_path().string();
    throw Error(ErrorCode::usage,
                fmt::format("{}: has records of version {} of the statistics and {} of the random stream, and this "
                            "nephos makes versions {} and {}: {}",
                            shard.string(), found(statistics), found(stream), NEPHOS_STATISTICS_VERSION,
                            kRandomStreamVersion,
                            use == RecordsFor::running
                                ? "choose another --out, or give --overwrite"
                                : fmt::format("leave {0} out, or compute its runs again with `nephos sweep "
                                              "{0}/sweep.toml --out {0} --overwrite`",
                                              folder)));
}

Regime regime_of(const std::string& name) {
    for (int n = 0; n <= int(Regime::not_steady); ++n)
        if (regime_name(Regime(n)) == name) return Regime(n);
    throw Error(ErrorCode::io, "'" + name + "' is not a regime");
}

// Returns the text where it is base64, so that a page may contain it as it is; nothing otherwise.
std::string base64_only(std::string text) {
    const bool good = std::ranges::all_of(text, [](char c) {
        return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' ||
               c == '/' || c == '=';
    });
    return good ? text : std::string();
}

RunRecord record_of(const Json& json) {
    RunRecord record;
    record.id = json.at("run").get<std::string>();
    record.failed = json.at("status") != "done";
    if (record.failed) {
        record.message = json.at("message").get<std::string>();
        return record;
    }
    RunResult& result = record.result;
    result.regime = regime_of(json.at("regime").get<std::string>());
    result.steps = json.at("steps").get<std::uint64_t>();
    result.warm_up = json.at("warm_up_steps").get<std::uint64_t>();
    result.used = json.at("used_steps").get<std::uint64_t>();
    result.period = json.at("period_steps").get<std::uint64_t>();
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const Json& s = json.at("statistics").at(std::string(kStatistics[n].name));
        result.statistics[n] = {number_of(s.at(0)), number_of(s.at(1)), number_of(s.at(2)),
                                number_of(s.at(3)), number_of(s.at(4))};
    }
    result.profile = json.at("profile").get<std::vector<double>>();
    result.sizes = json.at("sizes").get<std::vector<std::uint64_t>>();
    result.snapshots = json.at("snapshots").get<std::uint64_t>();
    if (const auto tracks = json.find("tracks"); tracks != json.end())
        for (std::size_t n = 0; n < kTrackColumns.size(); ++n)
            result.tracks.push_back(number_of(tracks->at(n)));
    result.state_hash = json.at("state_hash").get<std::string>();
    record.series_offset = json.at("series_offset").get<std::uint64_t>();
    record.series_bytes = json.at("series_bytes").get<std::uint64_t>();
    if (const auto thumbnail = json.find("thumbnail"); thumbnail != json.end())
        result.thumbnail = base64_only(thumbnail->get<std::string>());
    return record;
}

[[noreturn]] void fail(const std::filesystem::path& path, int error) {
    throw Error(ErrorCode::io, path.string() + ": cannot write: " + std::strerror(error));
}

// Appends, or leaves the file as it was.
void append(const std::filesystem::path& path, const Descriptor& file, std::span<const std::byte> content,
            std::uint64_t& size) {
    int error = write_all(file.get(), content);
    while (error == 0 && ::fdatasync(file.get()) != 0)
        if (errno != EINTR) error = errno;
    if (error != 0) {
        [[maybe_unused]] const int ignored = ::ftruncate(file.get(), off_t(size));
        fail(path, error);
    }
    size += content.size();
}

// Returns true for "0003-of-0012.jsonl".
bool is_name_of_shard(const std::filesystem::path& path) {
    const std::string name = path.stem().string();
    const std::size_t middle = name.find("-of-");
    const auto is_number = [](std::string_view text) {
        return text.size() >= 4 && text.find_first_not_of("0123456789") == text.npos;
    };
    return path.extension() == ".jsonl" && middle != name.npos &&
           is_number(std::string_view(name).substr(0, middle)) &&
           is_number(std::string_view(name).substr(middle + 4));
}

// Throws Error(usage) where the file is there and begins as no shard does, nor as the first part of one.
void require_own_records(const std::filesystem::path& path) {
    constexpr std::string_view kRecord = "{\"run\":\"";
    const std::string beginning = read_beginning(path, kRecord.size());
    if (!kRecord.starts_with(beginning)) require_own(path, kRecord, "a sweep");
}

std::vector<std::filesystem::path> files_of_shards(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> files;
    std::error_code error;
    std::filesystem::directory_iterator at(folder / "shards", error), end;
    if (error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory) return files;
    for (; !error && at != end; at.increment(error))
        if (is_name_of_shard(at->path())) files.push_back(at->path());
    if (error) throw ReadFailure(folder / "shards", error.message());
    std::ranges::sort(files);
    return files;
}

std::filesystem::path shard_path(const std::filesystem::path& folder, std::uint32_t number,
                                 std::uint32_t of) {
    return folder / "shards" / fmt::format("{:04}-of-{:04}.jsonl", number, of);
}

void lock(const std::filesystem::path& path, const Descriptor& file) {
    if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
        throw Error(ErrorCode::io, path.string() +
                                       ": another sweep is writing this shard: wait for its end, or choose "
                                       "another --out or --shard");
}

}  // namespace

std::string record_line(const PlannedRun& run, const RunResult& result, std::uint64_t series_offset,
                        std::uint64_t series_bytes) {
    Json json = head(run, "done");
    json["regime"] = regime_name(result.regime);
    json["steps"] = result.steps;
    json["warm_up_steps"] = result.warm_up;
    json["used_steps"] = result.used;
    json["period_steps"] = result.period;
    Json statistics = Json::object();
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const SeriesMean& s = result.statistics[n];
        statistics[std::string(kStatistics[n].name)] = {number(s.mean), number(s.error), number(s.deviation),
                                                        number(s.tau), number(s.effective)};
    }
    json["statistics"] = std::move(statistics);
    json["profile"] = result.profile;
    json["sizes"] = result.sizes;
    json["snapshots"] = result.snapshots;
    if (!result.tracks.empty()) {
        Json tracks = Json::array();
        for (const double value : result.tracks) tracks.push_back(number(value));
        json["tracks"] = std::move(tracks);
    }
    json["state_hash"] = result.state_hash;
    json["series_offset"] = series_offset;
    json["series_bytes"] = series_bytes;
    if (!result.thumbnail.empty()) json["thumbnail"] = result.thumbnail;
    return sealed(json);
}

std::string failure_line(const PlannedRun& run, std::string_view message) {
    Json json = head(run, "failed");
    json["message"] = message;
    return sealed(json);
}

std::pair<std::uint64_t, std::uint64_t> Records::read_shard(const std::filesystem::path& path,
                                                            RecordsFor use) {
    std::ifstream stream = open_stream(path);
    const auto shard = std::uint32_t(files_.size());
    files_.push_back({std::filesystem::path(path).replace_extension(".series"), folders_ - 1});
    // Series are written before the records that name them: fewer are damage, and not to be filled with zeros.
    const std::filesystem::path& series_path = files_.back().path;
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(series_path, error);
    if (error && is_there(series_path)) throw ReadFailure(series_path, error.message(), "examine");
    const std::uint64_t stored = error ? 0 : size;
    std::uint64_t at = 0, bytes = 0, series = 0;
    std::string problem;
    const auto note = [&](std::uint64_t place, std::string_view message) {
        if (problem.empty())
            problem = fmt::format("{}: the record at byte {} {}", path.string(), place, message);
    };
    bool torn = false;
    for (std::string line; std::getline(stream, line); at += line.size() + 1) {
        if (torn) note(bytes, "is damaged, but others follow it");
        torn = stream.eof() || !is_whole(line);
        if (torn) continue;
        bytes = at + line.size() + 1;
        try {
            const Json json = parsed_json_text(line);
            require_this_version(json, path, use);
            RunRecord record = record_of(json);
            record.shard = shard;
            const std::uint64_t values = kSeries.size() * (std::min(record.result.steps, kMaxSteps) + 1);
            if (record.result.steps > kMaxSteps || record.series_offset > kMostBytes ||
                record.series_bytes > kMostBytes ||
                (!record.failed && values * sizeof(float) > kMostUnpacked * record.series_bytes + 64)) {
                note(at, "has impossible numbers");
                continue;
            }
            if (!record.failed) {
                const std::uint64_t end = record.series_offset + record.series_bytes;
                if (end > stored) {
                    note(at, fmt::format("names {} bytes of {}, which has fewer: {}", end,
                                         series_path.filename().string(), stored));
                    continue;
                }
                series = std::max(series, end);
            }
            const auto known = runs_.find(record.id);
            if (known == runs_.end()) {
                runs_.emplace(record.id, std::move(record));
            } else if (!record.failed || known->second.failed) {
                known->second = std::move(record);
            }
        } catch (const nlohmann::json::exception&) {
            note(at, "is not of a run");
        }
    }
    check_reading(stream, path);
    if (!problem.empty()) problems_.push_back(problem);
    return {bytes, series};
}

Records Records::read(const std::vector<std::filesystem::path>& folders, RecordsFor use) {
    Records records;
    for (const std::filesystem::path& folder : folders) {
        ++records.folders_;
        std::vector<std::filesystem::path> files;
        try {
            files = files_of_shards(folder);
        } catch (const Error& problem) {
            if (use == RecordsFor::running) throw;
            records.problems_.emplace_back(problem.what());
        }
        for (const std::filesystem::path& file : files) {
            try {
                records.read_shard(file, use);
            } catch (const ReadFailure& problem) {
                // All runs of it would be done once more, though nothing is wrong with it.
                if (use == RecordsFor::running) throw;
                records.problems_.emplace_back(problem.what());
            } catch (const Error& problem) {
                if (problem.code() != ErrorCode::io) throw;
                records.problems_.emplace_back(problem.what());
            }
        }
    }
    return records;
}

std::vector<std::uint64_t> Records::sizes_of_folders() const {
    std::vector<std::uint64_t> sizes(folders_, 0);
    for (const auto& [id, record] : runs_) ++sizes[folder_of(record)];
    return sizes;
}

const RunRecord* Records::find(const std::string& id) const {
    const auto found = runs_.find(id);
    return found == runs_.end() ? nullptr : &found->second;
}

std::vector<float> Records::series(const RunRecord& record) const {
    const std::filesystem::path& path = files_[record.shard].path;
    const Descriptor file = open_regular_file(path, O_RDONLY);
    std::string packed(record.series_bytes, '\0');
    for (std::size_t had = 0; had < packed.size();) {
        const ssize_t got =
            ::pread(file.get(), packed.data() + had, packed.size() - had, off_t(record.series_offset + had));
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) throw ReadFailure(path, std::strerror(errno));
        if (got == 0)
            throw Error(ErrorCode::io, path.string() + ": does not hold the series that the records name");
        had += std::size_t(got);
    }
    try {
        return unpack_series(packed, kSeries.size() * (record.result.steps + 1));
    } catch (const Error& error) {
        throw Error(ErrorCode::io,
                    fmt::format("{}: at byte {}: {}", path.string(), record.series_offset, error.what()));
    }
}

void remove_shards(const std::filesystem::path& folder, std::uint32_t number, std::uint32_t of) {
    std::vector<std::filesystem::path> files = files_of_shards(folder);
    if (of > 1)
        std::erase_if(files, [&](const auto& path) { return path != shard_path(folder, number, of); });
    std::vector<Descriptor> locks;
    for (const std::filesystem::path& path : files) {
        locks.push_back(open_regular_file(path, O_RDWR | O_NOFOLLOW));
        lock(path, locks.back());
        require_own_records(path);
    }
    for (const std::filesystem::path& path : files) {
        // Records last: series without them are nobody's.
        for (const std::filesystem::path& file :
             {std::filesystem::path(path).replace_extension(".series"), path}) {
            std::error_code error;
            std::filesystem::remove(file, error);
            if (error) throw Error(ErrorCode::io, file.string() + ": cannot remove: " + error.message());
        }
    }
}

bool has_shards(const std::filesystem::path& folder) { return !files_of_shards(folder).empty(); }

FolderGuard::FolderGuard(const std::filesystem::path& folder) : folder_(folder) {
    const std::filesystem::path shards = folder / "shards";
    create_folders(shards);
    // A file that is open for writing: NFS locks no folders, and no others exclusively.
    file_ = open_regular_file(shards / "lock", O_RDWR | O_CREAT | O_NOFOLLOW).release();
    // Where a file system has no locks, nothing is kept apart, as with those of shards.
    while (::flock(file_, LOCK_EX) != 0 && errno == EINTR) {
    }
}

FolderGuard::~FolderGuard() { ::close(file_); }

void FolderGuard::require_no_writer() const {
    for (const std::filesystem::path& path : files_of_shards(folder_)) {
        const Descriptor file = open_regular_file(path, O_RDONLY);
        if (::flock(file.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK)
            throw Error(ErrorCode::io,
                        path.string() +
                            ": a sweep of another plan is writing into this folder: wait for its "
                            "end, or choose another --out");
    }
}

struct Shard::Files {
    Descriptor records, series;
};

Shard::Shard(const std::filesystem::path& folder, std::uint32_t number, std::uint32_t of)
    : path_(shard_path(folder, number, of)),
      series_path_(std::filesystem::path(path_).replace_extension(".series")),
      files_(std::make_unique<Files>()),
      flushed_(std::chrono::steady_clock::now()) {
    create_folders(path_.parent_path());
    // Records come with their series, and never after them.
    std::error_code error;
    const bool is_file =
        std::filesystem::is_regular_file(std::filesystem::symlink_status(series_path_, error));
    if (is_file && !std::filesystem::exists(path_, error) &&
        !begins_packed(read_beginning(series_path_, 2)) &&
        std::filesystem::file_size(series_path_, error) > 0)
        require_absent(series_path_, "a sweep");
    // What they are cut to is no file that somebody else has put a link to here.
    constexpr int kOwn = O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW;
    files_->records = open_regular_file(path_, kOwn);
    files_->series = open_regular_file(series_path_, kOwn);
    lock(path_, files_->records);
    require_own_records(path_);
    // A copy of the sweep may be made of links. Whoever holds the lock has no other writer.
    if (separate_from_links(path_)) {
        files_->records = open_regular_file(path_, kOwn);
        lock(path_, files_->records);
    }
    if (separate_from_links(series_path_)) files_->series = open_regular_file(series_path_, kOwn);
    Records records;
    records.folders_ = 1;
    const auto [bytes, series] = records.read_shard(path_, RecordsFor::running);
    if (!records.problems().empty())
        throw Error(ErrorCode::io,
                    records.problems().front() + "; --overwrite computes the runs of this shard again");
    bytes_ = bytes;
    series_bytes_ = series;
    if (::ftruncate(files_->records.get(), off_t(bytes_)) != 0) fail(path_, errno);
    if (::ftruncate(files_->series.get(), off_t(series_bytes_)) != 0) fail(series_path_, errno);
}

Shard::~Shard() {
    try {
        flush();
    } catch (const Error&) {
        // Whoever wants to know has called flush().
    }
}

void Shard::add(const PlannedRun& run, const RunResult& result) {
    const std::string packed = pack_series(result.series, result.scales);
    lines_ += record_line(run, result, series_bytes_ + series_.size(), packed.size());
    series_ += packed;
    flush_if_due();
}

void Shard::add_failure(const PlannedRun& run, std::string_view message) {
    lines_ += failure_line(run, message);
    flush_if_due();
}

void Shard::flush_if_due() {
    const double waited = std::chrono::duration<double>(std::chrono::steady_clock::now() - flushed_).count();
    if (++waiting_ >= kFlushAfter || waited > kFlushAfter_s) flush();
}

void Shard::flush() {
    for (const auto& [file, path] :
         {std::pair(&files_->records, &path_), std::pair(&files_->series, &series_path_)})
        if (!is_same_file(file->get(), *path))
            throw Error(ErrorCode::io, path->string() + ": was removed or replaced while the sweep wrote it");
    if (lines_.empty()) return;
    const std::string lines = std::exchange(lines_, {});
    const std::string series = std::exchange(series_, {});
    waiting_ = 0;
    flushed_ = std::chrono::steady_clock::now();
    // The series first: a record never refers to what is not there.
    append(series_path_, files_->series, std::as_bytes(std::span(series)), series_bytes_);
    append(path_, files_->records, std::as_bytes(std::span(lines)), bytes_);
}

}  // namespace nephos
