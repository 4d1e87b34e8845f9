// SPDX-License-Identifier: Apache-2.0
#include "study/run_until.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <vector>

#include "statistics/series.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/descriptor.h"
#include "core/error.h"
#include "scenes/format/writer.h"
#include "simulation/checked_json.h"

namespace nephos {
namespace {

// A statistic of kStatistics, the column of statistics.csv that it is made of, and the factor.
struct Column {
    std::string_view statistic, column;
    double factor;
};

std::vector<Column> columns_of(const Scene& scene) {
    const double cells = double(scene.automaton.extent.cells()), size = scene.automaton.placement.cell_size_m;
    const double area = double(scene.automaton.extent.x) * scene.automaton.extent.y * size * size;
    return {{"cover", "cloud_cover", 1},
            {"cloud_fraction", "cld", 1 / cells},
            {"act_fraction", "act", 1 / cells},
            {"hum_fraction", "hum", 1 / cells},
            {"base_mean_m", "base_mean_m", 1},
            {"top_mean_m", "top_mean_m", 1},
            {"edge_per_km", "perimeter_m", 1000 / area}};
}

// Throws Error(usage) where a row of statistics.csv does not say it.
Column column_of(const Scene& scene, const StopAt& stop) {
    if (!scene.layers.empty())
        throw Error(ErrorCode::usage,
                    "a run until an error is reached is of a scene without layers: sweep it with --layer");
    const std::vector<Column> columns = columns_of(scene);
    const auto found = std::ranges::find(columns, stop.statistic, &Column::statistic);
    if (found == columns.end()) {
        std::vector<std::string_view> names;
        for (const Column& one : columns) names.push_back(one.statistic);
        throw Error(ErrorCode::usage,
                    fmt::format("'{}' is not measured at every step of a run: expected one of {}",
                                stop.statistic, fmt::join(names, ", ")));
    }
    return *found;
}

std::vector<std::string> fields_of(const std::string& line) {
    std::vector<std::string> fields{""};
    for (const char c : line) {
        if (c == ',') {
            fields.emplace_back();
        } else {
            fields.back() += c;
        }
    }
    return fields;
}

double number_of(const std::string& text) {
    double number = std::nan("");
    std::from_chars(text.data(), text.data() + text.size(), number);
    return number;
}

// Returns the steps of the scene of the run that is in the folder; 0 where there is none. Throws Error(io) where the
// manifest cannot be read; what else is wrong with it is found when the run is resumed.
std::uint64_t steps_before(const RunSettings& settings) {
    const std::filesystem::path manifest = RunFolder{settings.folder, settings.scene.name}.manifest();
    std::error_code error;
    if (!std::filesystem::exists(std::filesystem::symlink_status(manifest, error))) return 0;
    nlohmann::ordered_json json = parsed_json(manifest, JsonLists::left_out);
    if (!json.is_object() || !json.contains("scene") || !json["scene"].is_object()) return 0;
    const nlohmann::ordered_json& steps = json["scene"]["steps"];
    return steps.is_number_unsigned() ? steps.get<std::uint64_t>() : 0;
}

}  // namespace

SeriesReport series_report(const std::filesystem::path& statistics, const Scene& scene, const StopAt& stop) {
    const Column column = column_of(scene, stop);
    std::ifstream stream = open_stream(statistics);
    std::string line;
    std::getline(stream, line);
    const std::vector<std::string> header = fields_of(line);
    const auto place = [&](std::string_view name) {
        const auto found = std::ranges::find(header, name);
        if (found == header.end())
            throw Error(ErrorCode::io, fmt::format("{}: has no column {}", statistics.string(), name));
        return std::size_t(found - header.begin());
    };
    const std::size_t cover_at = place("cloud_cover"), value_at = place(column.column), act_at = place("act");
    std::vector<double> cover, values;
    double act = 0;
    while (std::getline(stream, line)) {
        const std::vector<std::string> fields = fields_of(line);
        if (fields.size() != header.size()) break;  // a row that is being written
        cover.push_back(number_of(fields[cover_at]));
        values.push_back(number_of(fields[value_at]) * column.factor);
        act = number_of(fields[act_at]);
    }
    const Judgement judgement = judge(cover, act > 0 || largest_activation(scene) > 0);
    const SeriesMean mean = mean_over(values, judgement);
    return {std::string(regime_name(judgement.regime)), mean.mean, mean.error,
            judgement.regime == Regime::dead || mean.error <= stop.standard_error};
}

UntilReport run_until(RunSettings settings, const StopAt& stop, std::uint64_t max_steps,
                      const RunObserver& observer) {
    column_of(settings.scene, stop);  // before the first step
    const bool leaves_checkpoint = settings.checkpoint;
    std::uint64_t steps = settings.scene.steps;
    // Parts that an earlier call has finished were followed by longer ones.
    if (settings.resume) steps = std::clamp(steps_before(settings), steps, std::max(steps, max_steps));
    UntilReport report;
    // Keeps what was read at the beginning, whatever becomes of the files: all parts are of that.
    keep_inputs(settings);
    while (true) {
        RunSettings part = settings;
        part.scene.steps = steps;
        part.scene_text = to_toml(part.scene);
        part.scene_hash = scene_hash(part.scene);
        part.range = {steps, 1, 0};
        part.checkpoint = true;  // the next part goes on from it
        const std::filesystem::path file = RunFolder{part.folder, part.scene.name}.statistics();
        report.run = run_scene(std::move(part), observer);
        if (!report.run.complete) return report;
        report.series = series_report(file, settings.scene, stop);
        if (report.series.reached || steps >= max_steps) break;
        if (observer.stop && observer.stop()) {  // between two parts
            report.run.complete = false;
            return report;
        }
        steps = std::min(max_steps, steps + std::max<std::uint64_t>(steps / 2, 1));
        settings.stamps.clear();
        settings.resume = true;
        settings.overwrite = false;
    }
    if (!leaves_checkpoint) {
        settings.scene.steps = steps;
        settings.scene_text = to_toml(settings.scene);
        settings.scene_hash = scene_hash(settings.scene);
        settings.range = {steps, 1, 0};
        settings.resume = true;
        settings.stamps.clear();
        settings.checkpoint = false;
        report.run = run_scene(std::move(settings), observer);  // nothing is left to do but to remove it
    }
    return report;
}

}  // namespace nephos
