// SPDX-License-Identifier: Apache-2.0
#include "study/records.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <span>
#include <thread>

#include "study/folder_contents.h"
#include "study/packed_series.h"
#include "study/record_lines.h"
#include "study/shard_files.h"
#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/file_stamp.h"
#include "core/paths.h"
#include "core/random.h"
#include "core/text.h"
#include "simulation/checked_json.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kFlushAfter_s = 1;
constexpr int kFlushAfter = 64;
constexpr std::uint64_t kMostBytes = std::uint64_t(1) << 50;  // of a file of series: no disk holds more

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
                            use != RecordsFor::showing
                                ? "choose another --out, or give --overwrite"
                                : fmt::format("leave {0} out, or compute its runs again with `nephos sweep "
                                              "{0}/sweep.toml --out {0} --overwrite`",
                                              folder)));
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

bool has_impossible_numbers(const RunRecord& record) {
    const std::uint64_t values = kSeries.size() * (std::min(record.result.steps, kMaxSteps) + 1);
    return record.result.steps > kMaxSteps || record.series_offset > kMostBytes ||
           record.series_bytes > kMostBytes ||
           (!record.failed && values * sizeof(float) > kMostUnpacked * record.series_bytes + 64);
}

// Of a record of an earlier version, whose series have no hash.
Error damaged_series(const std::filesystem::path& path, const RunRecord& record, std::string_view what) {
    return {ErrorCode::io,
            fmt::format("{}: at byte {}, of run {}: {}; `nephos sweep` with --overwrite computes it again",
                        path.string(), record.series_offset, record.id, what)};
}

// A record that was read, and the byte of the shard where it begins.
struct PlacedRecord {
    std::uint64_t at = 0;
    RunRecord record;
    bool is_sound = true;
};

// Returns those whose packed series are not as they were written, in the order of the file of series, which is read once and
// forwards. Throws ReadFailure. Precondition: the file holds the bytes that the records name.
std::vector<const PlacedRecord*> with_damaged_series(const std::vector<PlacedRecord>& records,
                                                     const std::filesystem::path& path,
                                                     const CheckedRuns& checked) {
    std::vector<const PlacedRecord*> order, damaged;
    for (const PlacedRecord& one : records)
        if (one.is_sound && !one.record.series_xxh3.empty() && (!checked || checked(one.record.id)))
            order.push_back(&one);
    if (order.empty()) return damaged;
    std::ranges::sort(order, {}, [](const PlacedRecord* one) { return one->record.series_offset; });
    if (!is_there(path)) return order;  // removed meanwhile
    std::ifstream stream = open_stream(path);
    std::string packed;
    std::uint64_t at = 0;
    for (const PlacedRecord* one : order) {
        // Seeking throws away what is read ahead.
        if (at != one->record.series_offset) stream.seekg(std::streamoff(one->record.series_offset));
        packed.resize(one->record.series_bytes);
        stream.read(packed.data(), std::streamsize(packed.size()));
        check_reading(stream, path);
        at = one->record.series_offset + packed.size();
        if (!stream || hash_text(packed) != one->record.series_xxh3) damaged.push_back(one);
        stream.clear();
    }
    return damaged;
}

}  // namespace

std::pair<std::uint64_t, std::uint64_t> Records::read_shard(const std::filesystem::path& path, RecordsFor use,
                                                            const CheckedRuns& checked, int look) {
    const FileStamp begun = file_stamp(path),
                    begun_series = file_stamp(std::filesystem::path(path).replace_extension(".series"));
    std::ifstream stream = open_stream(path);
    const auto shard = std::uint32_t(files_.size());
    files_.push_back({std::filesystem::path(path).replace_extension(".series"), folders_ - 1});
    const std::filesystem::path& series_path = files_.back().path;
    std::uint64_t at = 0, bytes = 0, series = 0;
    std::string problem, damaged_end;
    const auto note = [&](std::uint64_t place, std::string_view message) {
        if (problem.empty())
            problem = fmt::format("{}: the record at byte {} {}", path.string(), place, message);
    };
    std::vector<PlacedRecord> found;
    bool torn = false, cut_short = false;
    for (std::string line; std::getline(stream, line); at += line.size() + 1) {
        if (torn) note(bytes, "is damaged, but others follow it");
        cut_short = stream.eof();
        torn = cut_short || !is_whole_record(line);
        if (torn) continue;
        bytes = at + line.size() + 1;
        try {
            const Json json = parsed_json_text(line);
            require_this_version(json, path, use);
            RunRecord record = record_of(json);
            record.shard = shard;
            if (has_impossible_numbers(record)) {
                note(at, "has impossible numbers");
                continue;
            }
            found.push_back({at, std::move(record)});
        } catch (const nlohmann::json::exception&) {
            note(at, "is not of a run");
        } catch (const Error& wrong) {
            if (wrong.code() != ErrorCode::io) throw;
            note(at, fmt::format("is not of a run: {}", wrong.what()));
        }
    }
    check_reading(stream, path);
    // An append that was cut short leaves no end of a line.
    if (torn && !cut_short)
        damaged_end = fmt::format("{}: the record at byte {} is damaged", path.string(), bytes);
    // Series are written before the records that name them: fewer are damage, and not to be filled with zeros. Their size is
    // asked for after the last record was read, as another process may be writing both.
    std::error_code error;
    const std::uintmax_t size = std::filesystem::file_size(series_path, error);
    if (error && is_there(series_path)) throw ReadFailure(series_path, error.message(), "examine");
    const std::uint64_t stored = error ? 0 : size;
    for (PlacedRecord& one : found) {
        if (one.record.failed) continue;
        const std::uint64_t end = one.record.series_offset + one.record.series_bytes;
        one.is_sound = end <= stored;
        if (one.is_sound)
            series = std::max(series, end);
        else
            note(one.at, fmt::format("names {} bytes of {}, which has fewer: {}", end,
                                     series_path.filename().string(), stored));
    }
    for (const PlacedRecord* one : with_damaged_series(found, series_path, checked)) {
        note(one->at,
             fmt::format("is of run {}, whose packed series are damaged, at byte {} of {}", one->record.id,
                         one->record.series_offset, series_path.filename().string()));
        found[std::size_t(one - found.data())].is_sound = false;
    }
    // Begun again with --overwrite meanwhile, the records are of the old shard and the series of the new one, or of neither.
    constexpr std::chrono::milliseconds kPause(50);
    constexpr int kMostLooks = 40;
    if ((!problem.empty() || !damaged_end.empty()) && look < kMostLooks) {
        std::this_thread::sleep_for(kPause);
        if (!(file_stamp(path) == begun && file_stamp(series_path) == begun_series)) {
            files_.pop_back();
            return is_there(path) ? read_shard(path, use, checked, look + 1)
                                  : std::pair<std::uint64_t, std::uint64_t>{};
        }
    }
    for (PlacedRecord& one : found)
        if (one.is_sound) take(std::move(one.record));
    if (!problem.empty())
        problems_.push_back(problem);
    else if (!damaged_end.empty())
        damaged_ends_.push_back(damaged_end);
    return {bytes, series};
}

void Records::count_damaged_ends_as_problems() {
    problems_.insert(problems_.end(), damaged_ends_.begin(), damaged_ends_.end());
    damaged_ends_.clear();
}

void Records::take(RunRecord record) {
    const auto known = runs_.find(record.id);
    if (known == runs_.end()) {
        std::string id = record.id;
        runs_.emplace(std::move(id), std::move(record));
    } else if (!record.failed || known->second.failed) {
        known->second = std::move(record);
    }
}

Records Records::read(const std::vector<std::filesystem::path>& folders, RecordsFor use,
                      const CheckedRuns& checked) {
    Records records;
    for (const std::filesystem::path& folder : folders) {
        ++records.folders_;
        std::vector<std::filesystem::path> files;
        try {
            files = files_of_shards(folder);
        } catch (const Error& problem) {
            if (use != RecordsFor::showing) throw;
            records.problems_.emplace_back(problem.what());
        }
        for (const std::filesystem::path& file : files) {
            try {
                records.read_shard(file, use, checked);
            } catch (const ReadFailure& problem) {
                // All runs of it would be done once more, though nothing is wrong with it.
                if (use != RecordsFor::showing) throw;
                records.problems_.emplace_back(problem.what());
            } catch (const Error& problem) {
                if (problem.code() != ErrorCode::io) throw;
                std::error_code error;
                const auto type = std::filesystem::symlink_status(file, error).type();
                if (type == std::filesystem::file_type::not_found) continue;  // removed since it was listed
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
        if (got == 0) throw damaged_series(path, record, "they are cut");
        had += std::size_t(got);
    }
    try {
        return unpack_series(packed, kSeries.size() * (record.result.steps + 1));
    } catch (const Error& error) {
        throw damaged_series(path, record, error.what());
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
    if (type_at(series_path_) == std::filesystem::file_type::regular && !is_there(path_) &&
        !begins_packed(read_beginning(series_path_, 2)) && !read_beginning(series_path_, 1).empty())
        require_absent(series_path_, "a sweep");
    // What they are cut to is no file that somebody else has put a link to here.
    constexpr int kOwn = O_WRONLY | O_APPEND | O_CREAT | O_NOFOLLOW;
    files_->records = open_regular_file(path_, kOwn);
    files_->series = open_regular_file(series_path_, kOwn);
    lock_shard(path_, files_->records.get());
    require_own_records(path_);
    // A copy of the sweep may be made of links. Whoever holds the lock has no other writer.
    if (separate_from_links(path_)) {
        files_->records = open_regular_file(path_, kOwn);
        lock_shard(path_, files_->records.get());
    }
    if (separate_from_links(series_path_)) files_->series = open_regular_file(series_path_, kOwn);
    Records records;
    records.folders_ = 1;
    const auto [bytes, series] = records.read_shard(path_, RecordsFor::running, {});
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
    lines_ += record_line(run, result, series_bytes_ + series_.size(), packed);
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
