// SPDX-License-Identifier: Apache-2.0
#pragma once

// A sweep on disk. Every function does only what is missing: the same call again, after a kill or after an axis grew,
// computes the other runs. Whatever the number of workers, the shards, their order, kills and resumptions, the tables have
// the same bytes.
//
//     DIR/sweep (TOML)    the plan, canonical; `nephos sweep` of it repeats it
//     DIR/scene (TOML)    the scene with every key
//     DIR/shards/         records of the runs (records.h)
//     DIR/runs.csv, points.csv, failures.csv, series.nc, manifest.json     tables.h
//     DIR/timing.csv      seconds of each call: the only file that differs from machine to machine

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "study/records.h"
#include "study/sweep_plan.h"

namespace nephos {

struct SweepJob {
    std::filesystem::path folder;
    int workers = 1;
    std::uint32_t shard = 0, shards = 1;  // this process takes the runs whose id modulo `shards` is `shard`
    bool retry_failed = false;
    bool fail_fast = false;  // end at the first failure
    bool overwrite = false;  // throw the records away, of a shard only its own, and compute all runs again
};

struct SweepProgress {
    std::uint64_t done = 0, in_all = 0, failed = 0;  // of this shard
    std::uint64_t before = 0;                        // done by earlier calls
};

struct SweepReport {
    SweepProgress progress;
    bool complete = false;     // every run of the shard is done or failed
    std::uint64_t unused = 0;  // records in the folder that are of no run of this plan
    double wall_s = 0;
    std::vector<std::string> failures;  // "point 3, replicate 1: message", at most five
    std::vector<std::string> problems;  // of shards that could not be read as a whole (Records::problems)
    std::optional<Records> records;     // of the folder, where run_sweep() had nothing to run and added none
};

// Writes the plan and the scene, as run_sweep() does, and runs nothing. Throws Error(io), also when the folder has another plan
// whose shards are being written: its tables are made by it.
void write_plan(const SweepPlan& plan, const std::filesystem::path& folder);

// Returns what is done of a plan in some folders.
SweepReport sweep_status(const SweepPlan& plan, const SweepJob& job);

// Runs what is missing. Writes the plan, the scene and the shard; not the tables. Throws Error(io) on a full disk: what is on
// disk is whole; also when the folder is removed meanwhile; before it changes anything, when another process writes the shard,
// or any shard of another plan in the folder; Error(usage) when the folder's records are of another version.
// Precondition: the process has one thread.
SweepReport run_sweep(const SweepPlan& plan, const SweepJob& job,
                      const std::function<void(const SweepProgress&)>& progress,
                      const std::function<bool()>& stop);

// Returns whether the folder has this plan.
bool is_plan_of(const SweepPlan& plan, const std::filesystem::path& folder);

// Returns whether the plan in the folder, with whatever words, asks for the same runs as this one.
bool has_runs_of(const SweepPlan& plan, const std::filesystem::path& folder);

// Reads the plan of a folder from its sweep file. Throws SceneErrors and Error(io), also when it has none.
SweepPlan plan_of_folder(const std::filesystem::path& folder);

// Reads the records of several folders, to show them by the plan of the first. Throws Error(usage) when one of the others has
// records, but none of a run of the plan: they are of another sweep. Throws as Records::read() and plan_of_folder().
Records records_of_folders(const SweepPlan& plan, const std::vector<std::filesystem::path>& folders);

// Returns how many records are of no run of the plan.
std::uint64_t unused_records(const SweepPlan& plan, const Records& records);

// Writes the plan and the scene beside tables that were made of the records of other folders, so that the commands which
// stand in them work there. A folder with records has its own, and keeps them. Throws Error(io).
void write_plan_of_tables(const SweepPlan& plan, const std::filesystem::path& folder);

}  // namespace nephos
