// SPDX-License-Identifier: Apache-2.0
#pragma once

// What a sweep is to run: a scene, axes of its keys, replicates. The runs are never listed: run number n is computed from
// n, so that a million of them take no memory.
//
//     run n = replicate n % replicates of point n / replicates
//     id    = XXH3-128 of the scene, the point's keys and values, what is in the files that a value names, the seed, the
//             rules of steps and the version of the statistics: never of n, of the order, of a shard or of a worker
//     seed  = Philox(seed of the sweep; domain sweep, replicate, hash of the point's keys and values), so a replicate of a
//             point has the same seed when an axis grows; with common seeds without the hash: replicate r has one seed
//             at all points

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "study/axis_files.h"
#include "study/design.h"

#include "core/file_stamp.h"
#include "scenes/format/reader.h"
#include "scenes/format/scene.h"

namespace nephos {

// The first line of the plan and of the scene that a sweep writes.
inline constexpr std::string_view kWrittenBySweep = "# Written by nephos sweep.\n";

enum class Scale { linear, log, integer };

// A place in the file of a plan, line and column from 1; 0 of what stands in no file.
struct PlanPlace {
    int line = 0, column = 0;
};

// Where the parts of an axis stand: no part of what it says, so that all are equal.
struct AxisPlaces {
    std::vector<PlanPlace> keys, values;
    PlanPlace range, from, to;
    bool operator==(const AxisPlaces&) const { return true; }
};

// Says where the other keys of a plan stand, for the checks that tell what is wrong with them.
struct PlanPlaces {
    std::vector<PlanPlace> overrides;  // the first ones of the plan, those of the file
    PlanPlace scene, design, points, until, layer, tracks;
};

// The file of a plan, that messages quote.
struct PlanFile {
    std::string label, text;
};

// Keys of the scene that take a value together.
struct Axis {
    std::vector<std::string> keys;    // "field.background.ext"; at least one
    std::vector<std::string> values;  // as TOML; of a grid and a list
    std::filesystem::path folder;     // of relative names of files among the values; empty: the current one
    // Of the other designs.
    double from = 0, to = 1;
    Scale scale = Scale::linear;
    AxisPlaces places = {};
    bool operator==(const Axis&) const = default;
};

// A statistic whose standard error decides when a run is long enough.
struct StopAt {
    std::string statistic;  // of run_statistics.h
    double standard_error = 0;
    bool operator==(const StopAt&) const = default;
};

// How long a run is: `min` steps, then half as many again and again until it is steady and as exact as asked for, at
// most `max`. Dead and overcast runs stop.
struct StepRules {
    std::uint64_t min = 300, max = 3000;
    std::optional<StopAt> until;
    bool operator==(const StepRules&) const = default;
};

struct SweepOptions {
    std::filesystem::path scene_file;
    std::optional<SceneSource> source;   // what is in that file; none: the plan reads it
    std::vector<std::string> overrides;  // of all runs, as of --set
    Design design = Design::grid;
    std::uint64_t points = 0;  // of designs other than grid and list
    std::vector<Axis> axes;
    std::uint32_t replicates = 5;
    std::uint64_t seed = 1;
    bool common_seeds = false;
    StepRules steps;
    int clouds_every = 10;  // steps between the snapshots whose clouds are labelled; 0: none
    bool tracks = false;    // clouds are followed from step to step (statistics/tracks.h)
    std::string layer;      // whose statistics are taken; empty: the only lattice of the scene
    std::shared_ptr<const PlanFile> file = {};  // that the places are of; null: none
    PlanPlaces places = {};
};

// One run, as its worker needs it.
struct PlannedRun {
    std::string id;  // 32 hexadecimal digits
    std::uint64_t number = 0, point = 0;
    std::uint32_t replicate = 0;
    std::uint64_t seed = 0;
    std::vector<std::string> values;  // of each axis
};

class SweepPlan {
  public:
    // Reads the scene and checks every value of every axis (of a range its ends) against it, before anything is run. A value
    // that is the name of a file becomes absolute. Throws SceneErrors that point at the value, Error(usage) on axes that
    // contradict each other or overlap, Error(io).
    explicit SweepPlan(SweepOptions options);

    const SweepOptions& options() const { return options_; }
    const Scene& scene() const { return scene_; }                  // with the overrides of all runs
    // Returns the text of the scene for a folder, with the keys that it was given (given_keys.h) and names of files as
    // placed_scene(): with the values of a run it is the scene of that run.
    std::string scene_text_in(const std::filesystem::path& folder) const;
    // The lattice that is measured: of scene(); of a run; and whether an axis may change it.
    const AutomatonOptions& lattice() const { return lattice_; }
    AutomatonOptions lattice_of(const PlannedRun& run) const;
    bool varies_lattice() const;
    std::uint64_t points() const { return points_; }
    std::uint64_t runs() const { return points_ * options_.replicates; }
    std::vector<std::string> values_of_point(std::uint64_t point) const;
    PlannedRun run(std::uint64_t number) const;
    // Returns the scene of a run, as its text was when the plan was made. Throws as read_scene().
    Scene scene_of(const PlannedRun& run) const;
    // Returns a file of a run that is not as it was when the plan was made: the run would have another id.
    std::optional<std::filesystem::path> changed_file(const PlannedRun& run) const;
    const std::string& simulation_hash() const { return simulation_hash_; }  // of scene()
    // Returns the options of scene_of(), quoted for a shell: "--set KEY=VALUE ... --seed N".
    std::string options_of(const PlannedRun& run) const;
    // Returns the command that repeats so many steps of a run, in the folder of the sweep: "nephos run ...".
    std::string command_of(const PlannedRun& run, std::uint64_t steps) const;
    // Returns the canonical sweep file for a folder; the scene that it names is scene_text_in() of it.
    std::string to_toml_in(const std::filesystem::path& folder) const;

  private:
    // Returns for each value of each axis the first one of the axis that is the same.
    std::vector<std::vector<std::string>> check_axes();
    // Checks a scene with the n-th value of an axis: it has the lattice that is measured, and clouds can be followed in its
    // wind. Throws Error(usage) and SceneErrors with the place of the value.
    void check_measured(const Axis& axis, std::size_t n, const std::string& value, const Scene& scene) const;
    // `equals`: as check_axes() returns it.
    void require_different_points(const std::vector<std::vector<std::string>>& equals) const;
    std::string identity(const std::vector<std::string>& values) const;

    SweepOptions options_;
    Scene scene_;
    AutomatonOptions lattice_;
    FileStamps stamps_;  // of the files of scene(), before they were read
    std::string simulation_hash_;
    std::vector<std::map<std::string, AxisFiles>> files_;  // of each axis, by value
    std::uint64_t points_ = 0;
    std::vector<double> unit_points_;  // of sampled designs
};

// Returns the largest probability of activation anywhere and ever, 0 where no act can come; 1 where clouds of layers make
// the field.
double largest_activation(const Scene& scene);

}  // namespace nephos
