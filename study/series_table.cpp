// SPDX-License-Identifier: Apache-2.0
#include "study/series_table.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "study/folder_contents.h"
#include "study/netcdf_file.h"
#include "study/run_statistics.h"
#include <fmt/format.h>

#include "core/error.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr int kSeedDigits = 19;  // of 63 bits

// A run that is done.
struct DoneRun {
    PlannedRun run;
    const RunRecord* record;
};

using Put = std::function<void(double)>;

NetcdfVariable variable(std::string name, NetcdfType type, std::vector<std::size_t> dimensions,
                        NetcdfAttributes attributes, std::function<void(const Put&)> values) {
    return {std::move(name), type, std::move(dimensions), std::move(attributes), std::move(values)};
}

NetcdfAttributes described(std::string_view unit, std::string_view definition,
                           std::string_view standard_name = {}) {
    NetcdfAttributes attributes{{"units", std::string(unit)}, {"long_name", std::string(definition)}};
    if (!standard_name.empty()) attributes.emplace_back("standard_name", standard_name);
    return attributes;
}

// The series of the runs of a table, which is written one series of all runs after the other: those that fit into so much
// memory are unpacked once, the others for each series anew.
class UnpackedSeries {
  public:
    UnpackedSeries(const Records& records, std::size_t runs) : records_(records), kept_(runs) {}
    // Returns the values, which live until the next call.
    const std::vector<float>& of(std::size_t run, const RunRecord& record) {
        if (!kept_[run].empty()) return kept_[run];
        std::vector<float> values = records_.series(record);
        const std::size_t bytes = values.size() * sizeof(float);
        if (bytes > left_) return current_ = std::move(values);
        left_ -= bytes;
        return kept_[run] = std::move(values);
    }

  private:
    const Records& records_;
    std::vector<std::vector<float>> kept_;
    std::size_t left_ = std::size_t(128) << 20;
    std::vector<float> current_;
};

// Places the values of a run in time and height.
struct RunCoordinates {
    double step_s, floor_m, level_m;
    bool operator==(const RunCoordinates&) const = default;
};

RunCoordinates coordinates_of(const AutomatonOptions& lattice) {
    return {lattice.time_step_s, lattice.placement.origin_m.z, lattice.placement.cell_size_m};
}

// Returns those of each run, or one where all runs have the same.
std::vector<RunCoordinates> coordinates_of(const SweepPlan& plan, const std::vector<DoneRun>& done) {
    if (!plan.varies_lattice()) return {coordinates_of(plan.lattice())};
    std::vector<RunCoordinates> all;
    for (std::size_t n = 0; n < done.size(); ++n)
        all.push_back(n > 0 && done[n].run.point == done[n - 1].run.point
                          ? all.back()
                          : coordinates_of(plan.lattice_of(done[n].run)));
    if (std::ranges::all_of(all, [&](const RunCoordinates& one) { return one == all.front(); }))
        all.resize(1);
    return all;
}

// The variables of the file, and what their values are taken from.
class SeriesTable {
  public:
    SeriesTable(const SweepPlan& plan, const Records& records);
    bool empty() const { return done_.empty(); }
    void write(const std::filesystem::path& path);

  private:
    // Indices of its dimensions.
    static constexpr std::size_t kRun = 0, kStep = 1, kLevel = 2, kSizeBin = 3, kIdLength = 4,
                                 kSeedLength = 5;

    template <class Value>
    void add_of_runs(const std::string& name, NetcdfType type, NetcdfAttributes attributes, Value value) {
        variables_.push_back(
            variable(name, type, {kRun}, std::move(attributes), [this, value](const Put& put) {
                for (const DoneRun& one : done_) put(value(one));
            }));
    }
    template <class Text>
    void add_text(const std::string& name, std::size_t length, const char* long_name, Text text) {
        variables_.push_back(variable(name, NetcdfType::text, {kRun, length}, {{"long_name", long_name}},
                                      [this, text](const Put& put) {
                                          for (const DoneRun& one : done_)
                                              for (const char c : text(one)) put(c);
                                      }));
    }
    void add_runs();
    void add_axes();
    void add_places();
    void add_means();
    void add_series();
    void name_coordinates();

    const SweepPlan& plan_;
    std::vector<DoneRun> done_;
    std::uint64_t longest_steps_ = 0;
    std::size_t levels_ = 1, bins_ = 1;
    std::vector<RunCoordinates> coordinates_;
    std::vector<NetcdfVariable> variables_;
    std::string of_run_ = "run_id realization point seed";  // auxiliary coordinates
    UnpackedSeries unpacked_;
};

// Returns those of the plan, in its order.
std::vector<DoneRun> done_runs(const SweepPlan& plan, const Records& records) {
    std::vector<DoneRun> done;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) {
        PlannedRun run = plan.run(n);
        const RunRecord* record = records.find(run.id);
        if (record != nullptr && !record->failed) done.push_back({std::move(run), record});
    }
    return done;
}

SeriesTable::SeriesTable(const SweepPlan& plan, const Records& records)
    : plan_(plan), done_(done_runs(plan, records)), unpacked_(records, done_.size()) {
    if (done_.empty()) return;
    for (const DoneRun& one : done_) {
        const RunResult& result = one.record->result;
        longest_steps_ = std::max(longest_steps_, result.steps);
        levels_ = std::max(levels_, result.profile.size());
        bins_ = std::max(bins_, result.sizes.size());
    }
    coordinates_ = coordinates_of(plan, done_);
    add_runs();
    add_axes();
    add_places();
    add_means();
    add_series();
    name_coordinates();
}

void SeriesTable::add_runs() {
    add_text("run_id", kIdLength, "id of the run, as in runs.csv",
             [](const DoneRun& one) { return one.run.id; });
    add_of_runs("realization", NetcdfType::int32, described("1", "replicate of the point", "realization"),
                [](const DoneRun& one) { return double(one.run.replicate); });
    // Text: the format has no whole numbers of 64 bits.
    add_text("seed", kSeedLength, "seed of the run, a whole number",
             [](const DoneRun& one) { return fmt::format("{:<{}}", one.run.seed, kSeedDigits); });
    add_of_runs("point", NetcdfType::int32, described("1", "point, as in points.csv"),
                [](const DoneRun& one) { return double(one.run.point); });
    add_of_runs("steps", NetcdfType::int32, described("1", "steps of the run; later values are missing"),
                [](const DoneRun& one) { return double(one.record->result.steps); });
    add_of_runs("warm_up_steps", NetcdfType::int32, described("1", "steps before the mean"),
                [](const DoneRun& one) { return double(one.record->result.warm_up); });
}

void SeriesTable::add_axes() {
    for (std::size_t axis = 0; axis < plan_.options().axes.size(); ++axis) {
        for (std::string key : plan_.options().axes[axis].keys) {
            const std::string long_name = key;
            for (char& c : key)
                if (c == '.' || c == '[' || c == ']') c = '_';
            of_run_ += " " + key;
            add_of_runs(key, NetcdfType::float64, {{"long_name", long_name}}, [axis](const DoneRun& one) {
                const std::string& text = one.run.values[axis];
                char* end = nullptr;
                const double value = std::strtod(text.c_str(), &end);
                return end != text.c_str() && *end == 0 ? value : kNaN;
            });
        }
    }
}

// The coordinates of steps, levels and bins of sizes.
void SeriesTable::add_places() {
    const auto in_runs = [&](std::size_t dimension) {
        return coordinates_.size() == 1 ? std::vector{dimension} : std::vector<std::size_t>{kRun, dimension};
    };
    variables_.push_back(variable("time", NetcdfType::float64, in_runs(kStep),
                                  described("s", "simulated time since the start"), [this](const Put& put) {
                                      for (const RunCoordinates& run : coordinates_)
                                          for (std::uint64_t n = 0; n <= longest_steps_; ++n)
                                              put(double(n) * run.step_s);
                                  }));
    variables_.push_back(variable("height", NetcdfType::float64, in_runs(kLevel),
                                  described("m", "centre of the level", "height"), [this](const Put& put) {
                                      for (const RunCoordinates& run : coordinates_)
                                          for (std::size_t k = 0; k < levels_; ++k)
                                              put(run.floor_m + (double(k) + 0.5) * run.level_m);
                                  }));
    variables_.push_back(variable("size_bin_begin", NetcdfType::float64, {kSizeBin},
                                  described("1", "smallest area of the bin, in columns"),
                                  [this](const Put& put) {
                                      for (std::size_t n = 0; n < bins_; ++n)
                                          put(double(size_bin_begin(int(n))));
                                  }));
}

void SeriesTable::add_means() {
    NetcdfAttributes profile =
        described("1", "mean cloud fraction of the level", "cloud_area_fraction_in_atmosphere_layer");
    profile.emplace_back("cell_methods", "time: mean");
    variables_.push_back(variable("cloud_area_fraction_in_atmosphere_layer", NetcdfType::float32,
                                  {kRun, kLevel}, profile, [this](const Put& put) {
                                      for (const DoneRun& one : done_) {
                                          const std::vector<double>& values = one.record->result.profile;
                                          for (std::size_t k = 0; k < levels_; ++k)
                                              put(k < values.size() ? values[k] : kNaN);
                                      }
                                  }));
    variables_.push_back(variable(
        "clouds_of_size", NetcdfType::float64, {kRun, kSizeBin},
        described("1", "mean number of clouds of a snapshot in the size bin"), [this](const Put& put) {
            for (const DoneRun& one : done_) {
                const RunResult& r = one.record->result;
                for (std::size_t n = 0; n < bins_; ++n)
                    put(n < r.sizes.size() ? double(r.sizes[n]) / double(r.snapshots)
                        : r.snapshots > 0  ? 0.0
                                           : kNaN);
            }
        }));
}

void SeriesTable::add_series() {
    for (std::size_t s = 0; s < kSeries.size(); ++s) {
        variables_.push_back(
            variable(std::string(kSeries[s].name), NetcdfType::float32, {kRun, kStep},
                     described(kSeries[s].unit, kSeries[s].definition, kSeries[s].standard_name),
                     [this, s](const Put& put) {
                         for (std::size_t run = 0; run < done_.size(); ++run) {
                             const RunRecord& record = *done_[run].record;
                             const std::vector<float>& values = unpacked_.of(run, record);
                             const std::uint64_t count = record.result.steps + 1;
                             for (std::uint64_t n = 0; n <= longest_steps_; ++n)
                                 put(n < count ? double(values[s * count + n]) : kNaN);
                         }
                     }));
    }
}

// Names the auxiliary coordinates of every variable over runs that is not one of them (CF 1.8, section 5).
void SeriesTable::name_coordinates() {
    constexpr std::string_view kOfDimension[] = {"", " time", " height", " size_bin_begin"};
    for (NetcdfVariable& variable : variables_) {
        const bool is_coordinate =
            (" " + of_run_ + " time height ").find(" " + variable.name + " ") != std::string::npos;
        if (variable.dimensions.front() != kRun || is_coordinate) continue;
        const std::size_t other = variable.dimensions.size() > 1 ? variable.dimensions[1] : kRun;
        variable.attributes.emplace_back("coordinates", of_run_ + std::string(kOfDimension[other]));
    }
}

void SeriesTable::write(const std::filesystem::path& path) {
    constexpr std::uint64_t kIdCharacters = 32;
    write_netcdf(
        path,
        {{"run", done_.size()},
         {"step", longest_steps_ + 1},
         {"level", levels_},
         {"size_bin", bins_},
         {"run_id_length", kIdCharacters},
         {"seed_length", kSeedDigits}},
        {{"Conventions", "CF-1.8"}, {"title", std::string(kSweepTitle)}, {"source", "nephos " + version()}},
        variables_);
}

}  // namespace

bool write_series_table(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    SeriesTable table(plan, records);
    if (table.empty()) return false;
    table.write(path);
    return true;
}

}  // namespace nephos
