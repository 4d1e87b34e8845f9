// SPDX-License-Identifier: Apache-2.0

// nephos stats: the statistics of cloud masks that others made.

#include <cmath>
#include <limits>
#include <memory>

#include "study/cloud_mask.h"
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/study_commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

struct StatsArguments {
    std::vector<std::string> files;
    MaskOptions mask;
    WorkArguments work;
};

constexpr double kLargest = std::numeric_limits<double>::max();

void parse_periodic(const std::string& text, Boundaries& boundaries) {
    if (text != "x" && text != "y" && text != "xy")
        throw Error(ErrorCode::usage, fmt::format("'{}' is not one of x, y and xy", text));
    if (text != "y") boundaries.x = Boundary::periodic;
    if (text != "x") boundaries.y = Boundary::periodic;
}

std::string number(double value, int digits) {
    return std::isfinite(value) ? number_text(value, digits) : "-";
}

nlohmann::ordered_json json_of(const CloudMasks& masks, const MaskStatistics& found) {
    const auto value = [](double v) {
        return std::isfinite(v) ? nlohmann::ordered_json(v) : nlohmann::ordered_json();
    };
    const auto organisation = [&](const Organisation& o) {
        return nlohmann::ordered_json{
            {"iorg", value(o.iorg)}, {"scai", value(o.scai)}, {"cop", value(o.cop)}};
    };
    nlohmann::ordered_json statistics = nlohmann::ordered_json::object();
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const SeriesMean& s = found.statistics[n];
        statistics[std::string(kStatistics[n].name)] = {
            {"mean", value(s.mean)}, {"se", value(s.error)}, {"sd", value(s.deviation)}};
    }
    const Extent extent = masks.snapshots.front().extent();
    return {{"snapshots", masks.snapshots.size()},
            {"cells", {extent.x, extent.y, extent.z}},
            {"cell_size_m", masks.cell_size_m},
            {"level_height_m",
             masks.seen_from_above ? nlohmann::ordered_json() : nlohmann::ordered_json(masks.level_height_m)},
            {"seen_from_above", masks.seen_from_above},
            {"missing_values", masks.missing},
            {"statistics", statistics},
            {"organisation", organisation(found.organisation)},
            {"organisation_random", organisation(found.random.mean)},
            {"organisation_random_sd", organisation(found.random.deviation)}};
}

// Why a mask has no value of a statistic.
std::string_view why_none(const CloudMasks& masks, std::string_view statistic) {
    if (statistic == "act_fraction" || statistic == "hum_fraction" || statistic == "lifetime_s" ||
        statistic == "pulse_period_s")
        return "none: of runs alone";
    if (masks.seen_from_above && needs_levels(statistic)) return "none: a view from above has no levels";
    if (statistic.starts_with("size_exponent") || statistic == "fractal_dimension")
        return "none: too few clouds of different sizes";
    return "none: not defined in every snapshot";
}

void print_table(const CloudMasks& masks, const MaskStatistics& found) {
    const Extent extent = masks.snapshots.front().extent();
    Output output;
    output.line(fmt::format("{} snapshot{} of {} x {}{} cells of {} m", masks.snapshots.size(),
                            masks.snapshots.size() == 1 ? "" : "s", extent.x, extent.y,
                            masks.seen_from_above ? "" : fmt::format(" x {}", extent.z),
                            number_text(masks.cell_size_m)) +
                (!masks.seen_from_above && masks.level_height_m != masks.cell_size_m
                     ? fmt::format(", {} m high", number_text(masks.level_height_m))
                     : "") +
                (masks.seen_from_above ? ", seen from above" : ""));
    output.line(fmt::format("{:22} {:>11} {:>10}  {}", "statistic", "mean", "se", "what it is"));
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        const SeriesMean& s = found.statistics[n];
        const std::string_view name = kStatistics[n].name;
        output.line(fmt::format("{:22} {:>11} {:>10}  {}", name, number(s.mean, 5), number(s.error, 2),
                                std::isfinite(s.mean) ? kStatistics[n].definition : why_none(masks, name)));
    }
    output.line(fmt::format("{:22} {:>11} {:>10}  {}", "organisation", "value", "random",
                            "of random shadows of the same cover, their sd"));
    const auto line = [&](std::string_view name, double value, double random, double deviation) {
        output.line(fmt::format("{:22} {:>11} {:>10}  +- {}", name, number(value, 4), number(random, 4),
                                number(deviation, 2)));
    };
    line("iorg", found.organisation.iorg, found.random.mean.iorg, found.random.deviation.iorg);
    line("scai", found.organisation.scai, found.random.mean.scai, found.random.deviation.scai);
    line("cop", found.organisation.cop, found.random.mean.cop, found.random.deviation.cop);
}

int stats(const StatsArguments& a) {
    start_threads(1);  // one suffices, and where processes are limited another could fail
    const CloudMasks masks =
        read_masks(std::vector<std::filesystem::path>(a.files.begin(), a.files.end()), a.mask);
    for (const std::string& note : masks.notes) print_note(note);
    const MaskStatistics found = mask_statistics(masks);
    if (a.work.json)
        Output().line(json_text(json_of(masks, found)));
    else
        print_table(masks, found);
    return 0;
}

}  // namespace

void add_stats_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("stats", "Statistics of a cloud mask: VDB, NetCDF or PNG");
    const auto a = std::make_shared<StatsArguments>();
    command
        ->add_option("FILE", a->files,
                     "Masks of one size: .vdb, .nc (classic), .png; several are snapshots in time")
        ->required()
        ->type_name("FILE");
    command->add_option("--variable", a->mask.variable, "Variable of a NetCDF file, grid of a VDB file")
        ->type_name("NAME");
    add_value(*command, "--threshold", "X", "Values above it are cloud (default: 0; of PNG 127 of 255)",
              [a](const std::string& text) { a->mask.threshold = parse_real(text, -kLargest, kLargest); });
    add_value(*command, "--cell-size", "METRES", "Edge of a column; needed but for VDB",
              [a](const std::string& text) { a->mask.cell_size_m = parse_real(text, 1e-6, kLargest); });
    add_value(*command, "--level-height", "METRES", "Height of a level (default: the cell size)",
              [a](const std::string& text) { a->mask.level_height_m = parse_real(text, 1e-6, kLargest); });
    add_value(*command, "--periodic", "AXES", "x, y or xy: clouds go on across those sides (default: none)",
              [a](const std::string& text) { parse_periodic(text, a->mask.boundaries); });
    add_json(*command, a->work);
    command->footer(
        "The definitions are those of a sweep's tables (docs/research.md), so that an observation or another "
        "model's\n"
        "cloud can be compared with runs, and be the target of a fit: from = \"observed.nc\" in its "
        "[[target]].\n"
        "Standard errors need several snapshots.\n"
        "\n"
        "Examples:\n"
        "  nephos stats observed.png --cell-size 30\n"
        "  nephos stats les.nc --variable ql --threshold 1e-5 --cell-size 100 --level-height 40 --periodic "
        "xy\n"
        "  nephos stats run/density_*.vdb --threshold 0.5 --json");
    command->callback([a, &action] { action = [a] { return stats(*a); }; });
}

}  // namespace nephos
