// SPDX-License-Identifier: Apache-2.0
#include "study/tables.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <set>

#include "study/folder_contents.h"
#include "study/folder_guard.h"
#include "study/placed_scene.h"
#include "study/series_table.h"
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

void remove_table(const std::filesystem::path& path) {
    std::error_code error;
    std::filesystem::remove(path, error);
    if (error) throw Error(ErrorCode::io, path.string() + ": cannot remove: " + error.message());
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
    // First, for damaged series alone can end it: the tables before it then stay as they are. Series that are more than a file
    // of NetCDF holds leave the others.
    std::optional<Error> too_many;
    try {
        if (!write_series_table(plan, records, folder / "series.nc")) remove_table(folder / "series.nc");
    } catch (const Error& error) {
        if (error.code() != ErrorCode::usage) throw;
        too_many = Error(error.code(), error.what() + std::string("; the other tables are written"));
        remove_table(folder / "series.nc");
    }
    write_runs(plan, records, folder / "runs.csv");
    write_points(plan, records, folder / "points.csv");
    const std::uint64_t missing = write_failures(plan, records, folder / "failures.csv");
    if (plan.options().tracks)
        write_tracks(plan, records, folder / "tracks.csv");
    else
        remove_table(folder / "tracks.csv");  // of another plan
    write_manifest(plan, records, folder / "manifest.json");
    if (too_many) throw *too_many;
    return missing;
}

}  // namespace nephos
