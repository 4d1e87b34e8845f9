// SPDX-License-Identifier: Apache-2.0
#pragma once

// The results of a sweep on disk while it goes on, in files to which whole records are appended:
//
//     DIR/shards/0000-of-0001.jsonl   a line of JSON a run, at whose end its XXH3-128 stands
//     DIR/shards/0000-of-0001.series  the series of the runs one after the other, packed (packed_series.h)
//
// A shard belongs to one process; several processes share no file. What a kill or a full disk leaves of a last record is
// recognised by its hash and dropped. The order of records means nothing.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "study/run_statistics.h"
#include "study/sweep_plan.h"

namespace nephos {

// A run as a shard has it.
struct RunRecord {
    std::string id;
    bool failed = false;
    std::string message;      // of a failed run
    RunResult result;         // without its series
    std::uint32_t shard = 0;  // place in the list of files that were read
    std::uint64_t series_offset = 0, series_bytes = 0;
    std::string series_xxh3 = {};  // of the packed series; empty of a record that an earlier version wrote
};

// Returns a record as its line, with the newline; its packed series stand at a place of the shard's file of series.
std::string record_line(const PlannedRun& run, const RunResult& result, std::uint64_t series_offset,
                        std::string_view series);
std::string failure_line(const PlannedRun& run, std::string_view message);

// Says what the records are read for, which decides what helps against those of another version, and against files that cannot be
// read.
enum class RecordsFor {
    running,  // by a command that has --overwrite
    showing,  // by one that writes no records
};

// Selects the records whose packed series are compared with their hashes, by their run's id; empty: all. It takes a pass over
// these series.
using CheckedRuns = std::function<bool(const std::string& id)>;

// All records of some shards, the last of each run; failed ones where there is no other.
class Records {
  public:
    // Reads every shard of the folders. What cannot be read, or is damaged, is left out, and stands in problems(). Throws
    // Error(usage) when records are of another version of the statistics or of the random stream: which, and what helps.
    static Records read(const std::vector<std::filesystem::path>& folders,
                        RecordsFor use = RecordsFor::running, const CheckedRuns& checked = {});

    // "PATH: what is wrong", one a file. A run whose packed series are not as they were written is left out. The last record
    // of a shard is no problem of its own: where an append was cut short, and where it is damaged.
    const std::vector<std::string>& problems() const { return problems_; }
    // Shards whose last record is whole, and damaged, in the same form: whether that cost a run depends on the plan, as it may
    // be in another shard, or have been done once more.
    const std::vector<std::string>& damaged_ends() const { return damaged_ends_; }
    void count_damaged_ends_as_problems();

    const RunRecord* find(const std::string& id) const;
    std::size_t size() const { return runs_.size(); }
    // Returns the number of records of each of the folders that were read; one of several folders counts in the last.
    std::vector<std::uint64_t> sizes_of_folders() const;
    std::size_t folder_of(const RunRecord& record) const { return files_[record.shard].folder; }
    // Returns the series of a run: kSeries one after the other, steps + 1 values each. Throws Error(io).
    std::vector<float> series(const RunRecord& record) const;

  private:
    friend class Shard;
    struct SeriesFile {
        std::filesystem::path path;
        std::size_t folder;  // place among those that were read
    };
    // Reads a shard, and gives back the bytes of its records and those of the series that they refer to. Throws Error(io)
    // when it cannot be opened.
    std::pair<std::uint64_t, std::uint64_t> read_shard(const std::filesystem::path& path, RecordsFor use,
                                                       const CheckedRuns& checked, int look = 0);

    // Keeps the last record of a run, but none of a failure where there is another.
    void take(RunRecord record);

    std::unordered_map<std::string, RunRecord> runs_;
    std::vector<std::string> problems_, damaged_ends_;
    std::vector<SeriesFile> files_;  // by RunRecord::shard
    std::size_t folders_ = 0;        // that were begun
};

// A shard while its process appends to it.
class Shard {
  public:
    // Opens or creates the shard and takes away what is left of a torn record. Throws Error(io), also when another
    // process holds it, and when records before the last one are damaged.
    Shard(const std::filesystem::path& folder, std::uint32_t number, std::uint32_t of);
    ~Shard();
    Shard(const Shard&) = delete;
    Shard& operator=(const Shard&) = delete;

    // Keep a record for the next flush(), which follows by itself after 64 records or a second. Throw Error(io).
    void add(const PlannedRun& run, const RunResult& result);
    void add_failure(const PlannedRun& run, std::string_view message);
    // Writes what was kept; when it returns, it is on the device. On a full disk throws Error(io), and what is on disk is
    // whole; also when the file was removed or replaced, for then what is written is in no folder.
    void flush();

  private:
    void flush_if_due();

    std::filesystem::path path_, series_path_;
    struct Files;
    std::unique_ptr<Files> files_;                // open while this object lives
    std::uint64_t bytes_ = 0, series_bytes_ = 0;  // that are written
    std::string lines_, series_;                  // that wait
    int waiting_ = 0;
    std::chrono::steady_clock::time_point flushed_;
};

}  // namespace nephos
