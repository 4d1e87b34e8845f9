// SPDX-License-Identifier: Apache-2.0
#include "study/tables.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <set>

#include "study/folder_contents.h"
#include "study/folder_guard.h"
#include "study/netcdf_file.h"
#include "study/placed_scene.h"
#include "study/student.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "core/random.h"
#include "scenes/format/writer.h"
#include "simulation/layer_simulation.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kErrorsDiffer = 3;
constexpr double kChance = 0.01;
constexpr int kSeedDigits = 19;  // of 63 bits

std::string field(double value) { return std::isfinite(value) ? fmt::format("{}", value) : std::string(); }

// A text as a field of CSV (RFC 4180); TOML texts lose their quotes.
std::string field(std::string text) {
    if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
    if (text.find_first_of(",\"\n\r") == text.npos) return text;
    std::string quoted = "\"";
    for (const char c : text) {
        if (c == '"') quoted += '"';
        quoted += c;
    }
    return quoted + '"';
}

std::string axis_columns(const SweepPlan& plan) {
    std::string columns;
    for (const Axis& axis : plan.options().axes)
        for (const std::string& key : axis.keys) columns += "," + field(key);
    return columns;
}

std::string axis_fields(const SweepPlan& plan, const std::vector<std::string>& values) {
    std::string fields;
    for (std::size_t n = 0; n < values.size(); ++n)
        for (std::size_t key = 0; key < plan.options().axes[n].keys.size(); ++key)
            fields += "," + field(values[n]);
    return fields;
}

void write_runs(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        std::string line = "run,point,replicate" + axis_columns(plan) +
                           ",seed,status,regime,steps,warm_up_steps,used_steps,period_steps";
        for (const StatisticInfo& s : kStatistics)
            line += fmt::format(",{0},{0}_se,{0}_sd,{0}_tau_steps,{0}_n", s.name);
        append(line + ",state_hash\n");
        for (std::uint64_t n = 0; n < plan.runs(); ++n) {
            const PlannedRun run = plan.run(n);
            const RunRecord* record = records.find(run.id);
            line = fmt::format("{},{},{}{},{},", run.id, run.point, run.replicate,
                               axis_fields(plan, run.values), run.seed);
            if (record == nullptr || record->failed) {
                line += record == nullptr ? "missing" : "failed";
                line += std::string(5 + 5 * kStatistics.size() + 1, ',') + "\n";
                append(line);
                continue;
            }
            const RunResult& r = record->result;
            line += fmt::format("done,{},{},{},{},{}", regime_name(r.regime), r.steps, r.warm_up, r.used,
                                r.period);
            for (const SeriesMean& s : r.statistics)
                line += fmt::format(",{},{},{},{},{}", field(s.mean), field(s.error), field(s.deviation),
                                    field(s.tau), field(s.effective));
            append(line + "," + r.state_hash + "\n");
        }
    });
}

void write_points(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        std::string line = "point" + axis_columns(plan) + ",runs,missing,failed";
        for (int n = 0; n <= int(Regime::not_steady); ++n) line += fmt::format(",{}", regime_name(Regime(n)));
        for (const StatisticInfo& s : kStatistics)
            line +=
                fmt::format(",{0},{0}_se,{0}_sd,{0}_low,{0}_high,{0}_se_within,{0}_errors_differ", s.name);
        append(line + "\n");
        for (std::uint64_t point = 0; point < plan.points(); ++point) {
            const PointSummary summary = summarise(plan, records, point);
            line = fmt::format("{}{},{},{},{}", point, axis_fields(plan, summary.values), summary.runs,
                               summary.missing, summary.failed);
            for (const std::uint32_t runs : summary.regimes) line += fmt::format(",{}", runs);
            for (const PointMean& s : summary.statistics)
                line += fmt::format(",{},{},{},{},{},{},{}", field(s.mean), field(s.error),
                                    field(s.deviation), field(s.low), field(s.high), field(s.error_within),
                                    s.errors_differ ? "1" : "");
            append(line + "\n");
        }
    });
}

std::uint64_t write_failures(const SweepPlan& plan, const Records& records,
                             const std::filesystem::path& path) {
    std::uint64_t missing = 0;
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        append("run,point,replicate" + axis_columns(plan) + ",seed,message,command\n");
        for (std::uint64_t n = 0; n < plan.runs(); ++n) {
            const PlannedRun run = plan.run(n);
            const RunRecord* record = records.find(run.id);
            missing += record == nullptr;
            if (record == nullptr || !record->failed) continue;
            append(fmt::format("{},{},{}{},{},{},{}\n", run.id, run.point, run.replicate,
                               axis_fields(plan, run.values), run.seed, field(record->message),
                               field(plan.command_of(run, plan.options().steps.max))));
        }
    });
    return missing;
}

void write_tracks(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    write_pieces_atomically(path, [&](const AppendPiece& append) {
        std::string line = "run,point,replicate" + axis_columns(plan) + ",seed,status,regime,used_steps";
        for (const StatisticInfo& column : kTrackColumns) line += fmt::format(",{}", column.name);
        append(line + "\n");
        for (std::uint64_t n = 0; n < plan.runs(); ++n) {
            const PlannedRun run = plan.run(n);
            const RunRecord* record = records.find(run.id);
            line = fmt::format("{},{},{}{},{},", run.id, run.point, run.replicate,
                               axis_fields(plan, run.values), run.seed);
            if (record == nullptr || record->failed) {
                line += record == nullptr ? "missing" : "failed";
                line += std::string(2 + kTrackColumns.size(), ',');
            } else {
                line += fmt::format("done,{},{}", regime_name(record->result.regime), record->result.used);
                for (const double value : record->result.tracks) line += "," + field(value);
            }
            append(line + "\n");
        }
    });
}

// The runs that are done, in the order of the plan.
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

void remove_table(const std::filesystem::path& path) {
    std::error_code error;
    std::filesystem::remove(path, error);
    if (error) throw Error(ErrorCode::io, path.string() + ": cannot remove: " + error.message());
}

// The series of the runs of a table, which is written one series of all runs after the other: those that fit into so much
// memory are unpacked once, the others for each series anew.
class UnpackedSeries {
  public:
    UnpackedSeries(const Records& records, std::size_t runs) : records_(records), kept_(runs) {}
    // What is returned lives until the next call.
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

// Names the auxiliary coordinates of every variable over runs that is not one of them (CF 1.8, section 5).
void add_coordinates(std::vector<NetcdfVariable>& variables, const std::string& of_run) {
    constexpr std::string_view kOfDimension[] = {"", " time", " height", " size_bin_begin"};
    for (NetcdfVariable& variable : variables) {
        const bool is_coordinate =
            (" " + of_run + " time height ").find(" " + variable.name + " ") != std::string::npos;
        if (variable.dimensions.front() != 0 || is_coordinate) continue;
        const std::size_t other = variable.dimensions.size() > 1 ? variable.dimensions[1] : 0;
        variable.attributes.emplace_back("coordinates", of_run + std::string(kOfDimension[other]));
    }
}

void write_series(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    std::vector<DoneRun> done;
    std::uint64_t steps = 0;
    std::size_t levels = 0, bins = 1;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) {
        PlannedRun run = plan.run(n);
        const RunRecord* record = records.find(run.id);
        if (record == nullptr || record->failed) continue;
        steps = std::max(steps, record->result.steps);
        levels = std::max(levels, record->result.profile.size());
        bins = std::max(bins, record->result.sizes.size());
        done.push_back({std::move(run), record});
    }
    if (done.empty()) return remove_table(path);
    levels = std::max<std::size_t>(levels, 1);
    const std::vector<RunCoordinates> coordinates = coordinates_of(plan, done);
    const std::vector<NetcdfDimension> dimensions{{"run", done.size()},
                                                  {"step", steps + 1},
                                                  {"level", levels},
                                                  {"size_bin", bins},
                                                  {"run_id_length", 32},
                                                  {"seed_length", kSeedDigits}};
    std::vector<NetcdfVariable> variables;
    std::string of_run = "run_id realization point seed";  // auxiliary coordinates
    const auto each_run = [&done](auto value) {
        return [&done, value](const Put& put) {
            for (const DoneRun& one : done) put(value(one));
        };
    };
    variables.push_back(variable("run_id", NetcdfType::text, {0, 4},
                                 {{"long_name", "id of the run, as in runs.csv"}}, [&](const Put& put) {
                                     for (const DoneRun& one : done)
                                         for (const char c : one.run.id) put(c);
                                 }));
    variables.push_back(variable("realization", NetcdfType::int32, {0},
                                 described("1", "replicate of the point", "realization"),
                                 each_run([](const DoneRun& one) { return double(one.run.replicate); })));
    // Text: the format has no whole numbers of 64 bits.
    variables.push_back(variable("seed", NetcdfType::text, {0, 5}, {{"long_name", "seed of the run, a whole number"}},
                                 [&](const Put& put) {
                                     for (const DoneRun& one : done)
                                         for (const char c : fmt::format("{:<{}}", one.run.seed, kSeedDigits)) put(c);
                                 }));
    variables.push_back(variable("point", NetcdfType::int32, {0}, described("1", "point, as in points.csv"),
                                 each_run([](const DoneRun& one) { return double(one.run.point); })));
    variables.push_back(variable(
        "steps", NetcdfType::int32, {0}, described("1", "steps of the run; later values are missing"),
        each_run([](const DoneRun& one) { return double(one.record->result.steps); })));
    variables.push_back(
        variable("warm_up_steps", NetcdfType::int32, {0}, described("1", "steps before the mean"),
                 each_run([](const DoneRun& one) { return double(one.record->result.warm_up); })));
    for (std::size_t axis = 0; axis < plan.options().axes.size(); ++axis) {
        for (std::string key : plan.options().axes[axis].keys) {
            const std::string long_name = key;
            for (char& c : key)
                if (c == '.' || c == '[' || c == ']') c = '_';
            of_run += " " + key;
            variables.push_back(variable(key, NetcdfType::float64, {0}, {{"long_name", long_name}},
                                         each_run([axis](const DoneRun& one) {
                                             const std::string& text = one.run.values[axis];
                                             char* end = nullptr;
                                             const double value = std::strtod(text.c_str(), &end);
                                             return end != text.c_str() && *end == 0 ? value : kNaN;
                                         })));
        }
    }
    const auto in_runs = [&](std::size_t dimension) {
        return coordinates.size() == 1 ? std::vector{dimension} : std::vector<std::size_t>{0, dimension};
    };
    variables.push_back(variable("time", NetcdfType::float64, in_runs(1),
                                 described("s", "simulated time since the start"), [&](const Put& put) {
                                     for (const RunCoordinates& run : coordinates)
                                         for (std::uint64_t n = 0; n <= steps; ++n)
                                             put(double(n) * run.step_s);
                                 }));
    variables.push_back(variable("height", NetcdfType::float64, in_runs(2),
                                 described("m", "centre of the level", "height"), [&](const Put& put) {
                                     for (const RunCoordinates& run : coordinates)
                                         for (std::size_t k = 0; k < levels; ++k)
                                             put(run.floor_m + (double(k) + 0.5) * run.level_m);
                                 }));
    variables.push_back(variable("size_bin_begin", NetcdfType::float64, {3},
                                 described("1", "smallest area of the bin, in columns"), [&](const Put& put) {
                                     for (std::size_t n = 0; n < bins; ++n)
                                         put(double(size_bin_begin(int(n))));
                                 }));
    NetcdfAttributes profile =
        described("1", "mean cloud fraction of the level", "cloud_area_fraction_in_atmosphere_layer");
    profile.emplace_back("cell_methods", "time: mean");
    variables.push_back(variable("cloud_area_fraction_in_atmosphere_layer", NetcdfType::float32, {0, 2},
                                 profile, [&](const Put& put) {
                                     for (const DoneRun& one : done) {
                                         const std::vector<double>& values = one.record->result.profile;
                                         for (std::size_t k = 0; k < levels; ++k)
                                             put(k < values.size() ? values[k] : kNaN);
                                     }
                                 }));
    variables.push_back(variable("clouds_of_size", NetcdfType::float64, {0, 3},
                                 described("1", "mean number of clouds of a snapshot in the size bin"),
                                 [&](const Put& put) {
                                     for (const DoneRun& one : done) {
                                         const RunResult& r = one.record->result;
                                         for (std::size_t n = 0; n < bins; ++n)
                                             put(n < r.sizes.size() ? double(r.sizes[n]) / double(r.snapshots)
                                                 : r.snapshots > 0  ? 0.0
                                                                    : kNaN);
                                     }
                                 }));
    UnpackedSeries unpacked(records, done.size());
    for (std::size_t s = 0; s < kSeries.size(); ++s) {
        variables.push_back(
            variable(std::string(kSeries[s].name), NetcdfType::float32, {0, 1},
                     described(kSeries[s].unit, kSeries[s].definition, kSeries[s].standard_name),
                     [&, s](const Put& put) {
                         for (std::size_t run = 0; run < done.size(); ++run) {
                             const RunRecord& record = *done[run].record;
                             const std::vector<float>& values = unpacked.of(run, record);
                             const std::uint64_t count = record.result.steps + 1;
                             for (std::uint64_t n = 0; n <= steps; ++n)
                                 put(n < count ? double(values[s * count + n]) : kNaN);
                         }
                     }));
    }
    add_coordinates(variables, of_run);
    write_netcdf(
        path, dimensions,
        {{"Conventions", "CF-1.8"}, {"title", std::string(kSweepTitle)}, {"source", "nephos " + version()}},
        variables);
}

void write_manifest(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    using Json = nlohmann::ordered_json;
    Json regimes = Json::object();
    std::array<std::uint64_t, 6> counts{};
    std::uint64_t done = 0, failed = 0;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) {
        const RunRecord* record = records.find(plan.run(n).id);
        if (record == nullptr) continue;
        if (record->failed) {
            ++failed;
            continue;
        }
        ++done;
        ++counts[std::size_t(record->result.regime)];
    }
    for (std::size_t n = 0; n < counts.size(); ++n) regimes[std::string(regime_name(Regime(n)))] = counts[n];
    Json keys = Json::object();
    for (const auto& [key, value] : parameters(placed_scene(plan.scene(), path.parent_path())))
        keys[key] = value;
    Json columns = Json::object();
    for (const StatisticInfo& s : kStatistics)
        columns[std::string(s.name)] = {{"unit", s.unit}, {"definition", s.definition}};
    const Json json = {{"format", "nephos sweep"},
                       {"format_version", 1},
                       {"nephos_version", version()},
                       {"random_stream_version", kRandomStreamVersion},
                       {"statistics_version", NEPHOS_STATISTICS_VERSION},
                       {"complete", done + failed == plan.runs()},
                       {"points", plan.points()},
                       {"replicates", plan.options().replicates},
                       {"runs", {{"planned", plan.runs()}, {"done", done}, {"failed", failed}}},
                       {"regimes", regimes},
                       {"scene_hash", scene_hash(plan.scene())},
                       {"parameters", keys},
                       {"statistics", columns}};
    write_atomically(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace

bool errors_differ(double between, double within, int replicates) {
    if (replicates < 3 || std::max(between, within) <= kErrorsDiffer * std::min(between, within))
        return false;
    if (!(within > 0)) return true;
    const double ratio = between / within;
    const double below = chi_squared_probability(replicates - 1, (replicates - 1) * ratio * ratio);
    return std::min(below, 1 - below) < kChance / 2;
}

PointSummary summarise(const SweepPlan& plan, const Records& records, std::uint64_t point) {
    PointSummary summary;
    summary.point = point;
    summary.values = plan.values_of_point(point);
    summary.statistics.fill({kNaN, kNaN, kNaN, kNaN, kNaN, kNaN, false});
    std::vector<const RunResult*> results;
    for (std::uint32_t replicate = 0; replicate < plan.options().replicates; ++replicate) {
        const RunRecord* record = records.find(plan.run(point * plan.options().replicates + replicate).id);
        if (record == nullptr) {
            ++summary.missing;
        } else if (record->failed) {
            ++summary.failed;
        } else {
            ++summary.regimes[std::size_t(record->result.regime)];
            results.push_back(&record->result);
        }
    }
    summary.runs = std::uint32_t(results.size());
    if (summary.missing > 0 || summary.failed > 0 || summary.regimes[std::size_t(Regime::not_steady)] > 0)
        return summary;
    const double n = double(results.size());
    for (std::size_t s = 0; s < kStatistics.size(); ++s) {
        PointMean& to = summary.statistics[s];
        double sum = 0, squares = 0, within = 0;
        for (const RunResult* result : results) {
            sum += result->statistics[s].mean;
            within += result->statistics[s].error * result->statistics[s].error;
        }
        to.mean = sum / n;
        if (!std::isfinite(to.mean)) continue;
        for (const RunResult* result : results)
            squares += (result->statistics[s].mean - to.mean) * (result->statistics[s].mean - to.mean);
        to.error_within = std::sqrt(within) / n;
        if (results.size() < 2) continue;
        to.deviation = std::sqrt(squares / (n - 1));
        to.error = to.deviation / std::sqrt(n);
        const double half = student_quantile(int(results.size()) - 1, 0.95) * to.error;
        to.low = to.mean - half;
        to.high = to.mean + half;
        to.errors_differ = errors_differ(to.error, to.error_within, int(results.size()));
    }
    return summary;
}

LostRuns runs_lost(const SweepPlan& plan, const Records& records, const std::filesystem::path& folder) {
    const std::filesystem::path path = folder / "runs.csv";
    LostRuns lost;
    if (std::filesystem::symlink_status(path).type() == std::filesystem::file_type::not_found) return lost;
    std::ifstream table = open_stream(path);
    std::set<std::string, std::less<>> ids;  // of runs that are in a record
    for (std::string line; std::getline(table, line);) {
        // The last column, state_hash, has a value where the run is done.
        if (line.starts_with("run,") || line.ends_with(',')) continue;
        std::string id = line.substr(0, line.find(','));
        const RunRecord* record = records.find(id);
        if (record == nullptr || record->failed)
            ++lost.unreadable;
        else
            ids.insert(std::move(id));
    }
    check_reading(table, path);
    for (std::uint64_t n = 0; !ids.empty() && n < plan.runs(); ++n) ids.erase(plan.run(n).id);
    lost.of_another_plan = ids.size();
    return lost;
}

std::uint64_t write_tables(const SweepPlan& plan, const Records& records,
                           const std::filesystem::path& folder) {
    create_folders(folder);
    const Descriptor held = identity_of_folder(folder);
    const std::function<void()> check = [&] { require_in_place(held, folder, "its tables were written"); };
    const PublishCheck keeps_in_place(check);
    // First, for damaged series alone can end it: the tables before it then stay as they are.
    write_series(plan, records, folder / "series.nc");
    write_runs(plan, records, folder / "runs.csv");
    write_points(plan, records, folder / "points.csv");
    const std::uint64_t missing = write_failures(plan, records, folder / "failures.csv");
    if (plan.options().tracks)
        write_tracks(plan, records, folder / "tracks.csv");
    else
        remove_table(folder / "tracks.csv");  // of another plan
    write_manifest(plan, records, folder / "manifest.json");
    return missing;
}

}  // namespace nephos
