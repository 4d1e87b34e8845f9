// SPDX-License-Identifier: Apache-2.0
#include "study/report/curves.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <tuple>

#include "statistics/cloud_sizes.h"
#include <fmt/format.h>

#include "core/text.h"

namespace nephos::report {
namespace {

constexpr std::size_t kMaxDots = 1500, kMaxAxisLines = 12, kMaxCurves = 10, kMaxSeries = 12, kMaxSteps = 800;

// What is drawn along axes, and how it is called there.
constexpr std::array<std::string_view, 10> kAlongAxes{
    "cover",         "cloud_fraction",       "base_mean_m", "top_mean_m", "clouds_per_km2",
    "cloud_area_m2", "correlation_length_m", "overlap",     "lifetime_s", "size_exponent"};

std::string values_text(const ReportPoint& point) {
    return point.labels.empty() ? "the scene" : fmt::format("{}", fmt::join(point.labels, ", "));
}

// Points of a grid that differ in one axis alone, by the places on the others.
std::map<std::vector<std::size_t>, std::vector<std::size_t>> lines_along(const ReportData& data,
                                                                         std::size_t axis) {
    std::map<std::vector<std::size_t>, std::vector<std::size_t>> lines;
    for (std::size_t n = 0; n < data.points.size(); ++n) {
        std::vector<std::size_t> place = grid_place(data.plan, n);
        place.erase(place.begin() + std::ptrdiff_t(axis));
        lines[place].push_back(n);
    }
    return lines;
}

std::string one_axis(const ReportData& data, const SweepAxis& x, std::size_t axis,
                     std::string_view statistic) {
    std::vector<double> values;
    for (const ReportPoint& point : data.points) {
        const PointMean& mean = point.mean(statistic);
        if (!std::isfinite(mean.mean)) continue;
        values.push_back(mean.mean);
        if (std::isfinite(mean.low)) values.insert(values.end(), {mean.low, mean.high});
    }
    if (values.empty()) return {};
    Figure drawing(x.plot, axis_over(std::string(statistic), values), 320, 220);
    if (data.plan.options().design == Design::grid) {
        const auto lines = lines_along(data, axis);
        const std::vector<std::size_t> chosen = evenly(lines.size(), kMaxAxisLines);
        std::size_t number = 0;
        for (const auto& [place, members] : lines) {
            const std::size_t n = number++;
            if (std::ranges::count(chosen, n) == 0) continue;
            std::vector<PlotPoint> points;
            for (const std::size_t member : members)
                points.push_back({x.values[member], data.points[member].mean(statistic).mean});
            drawing.line(points,
                         lines.size() > 1 ? colour_between(double(n) / double(lines.size() - 1)) : "#888888",
                         data.points[members[0]].name(data.plan) + " and on");
        }
    }
    for (const std::size_t n : evenly(data.points.size(), kMaxDots)) {
        const ReportPoint& point = data.points[n];
        const PointMean& mean = point.mean(statistic);
        const std::string_view colour = colour_of(main_regime(point.summary));
        drawing.bar(x.values[n], mean.low, mean.high, colour);
        drawing.dot({x.values[n], mean.mean}, colour,
                    fmt::format("{}: {} {}", point.name(data.plan), statistic, number_text(mean.mean, 4)),
                    fmt::format("p{}", n));
    }
    return figure(drawing.svg(fmt::format("{} along {}", statistic, x.plot.label)), "");
}

// Returns the points that have what is drawn, at most kMaxCurves.
std::vector<const ReportPoint*> chosen_points(const ReportData& data, bool (*has)(const RunResult&),
                                              std::size_t& of) {
    std::vector<const ReportPoint*> able, chosen;
    for (const ReportPoint& point : data.points)
        if (point.summary.runs > 0 && std::ranges::all_of(point.records, [&](const RunRecord* record) {
                return record != nullptr && !record->failed && has(record->result);
            }))
            able.push_back(&point);
    for (const std::size_t n : evenly(able.size(), kMaxCurves)) chosen.push_back(able[n]);
    of = able.size();
    return chosen;
}

std::string colour_of_curve(std::size_t n, std::size_t count) {
    return colour_between(count > 1 ? 0.92 * double(n) / double(count - 1) : 0.3);
}

using Legend = std::vector<std::pair<std::string, std::string>>;

struct Series {
    std::vector<double> steps, mean, low, high;
};

// Returns cover over steps: where there are many, the extremes of neighbouring steps together.
Series series_of(const ReportData& data, const ReportPoint& point) {
    std::vector<std::vector<float>> runs;
    std::size_t steps = 0;
    for (const RunRecord* record : point.records) {
        if (record == nullptr || record->failed) continue;
        std::vector<float> all = data.records.series(*record);
        all.resize(record->result.steps + 1);  // the first of kSeries is cover
        steps = std::max(steps, all.size());
        runs.push_back(std::move(all));
    }
    Series series;
    const std::size_t each = (steps + kMaxSteps - 1) / kMaxSteps;
    for (std::size_t begin = 0; begin < steps; begin += each) {
        double sum = 0, low = 2, high = -1;
        std::size_t count = 0;
        for (const std::vector<float>& run : runs)
            for (std::size_t n = begin; n < std::min(begin + each, run.size()); ++n, ++count) {
                sum += double(run[n]);
                low = std::min(low, double(run[n]));
                high = std::max(high, double(run[n]));
            }
        series.steps.push_back(double(begin));
        series.mean.push_back(sum / double(count));
        series.low.push_back(low);
        series.high.push_back(high);
    }
    return series;
}

std::string json_array(const std::vector<double>& values) {
    std::string text = "[";
    for (const double value : values) text += (text.size() > 1 ? "," : "") + number_text(value, 5);
    return text + "]";
}

std::vector<PlotPoint> points_of(const std::vector<double>& x, const std::vector<double>& y) {
    std::vector<PlotPoint> points;
    for (std::size_t n = 0; n < x.size(); ++n) points.push_back({x[n], y[n]});
    return points;
}

std::string series_figure(const ReportData& data, const ReportPoint& point) {
    const Series s = series_of(data, point);
    PlotAxis x{"step", 0, std::max(s.steps.back(), 1.0), false, {}};
    Figure drawing(x, axis_over("cover", s.high, false, true), 440, 210);
    std::uint64_t warm_up = 0;
    for (const RunRecord* record : point.records)
        if (record != nullptr && !record->failed) warm_up = std::max(warm_up, record->result.warm_up);
    drawing.shade(0, double(warm_up), "warm-up, in no mean");
    const std::string colour(colour_of(main_regime(point.summary)));
    drawing.band(points_of(s.steps, s.low), points_of(s.steps, s.high), colour);
    drawing.line(points_of(s.steps, s.mean), colour);
    return figure(
        drawing.svg("Cover over time of " + point.name(data.plan)) +
            fmt::format("<script "
                        "type=\"application/"
                        "json\">{{\"colour\":\"{}\",\"warmUp\":{},\"data\":[{},{},{},{}]}}</script>\n",
                        colour, warm_up, json_array(s.steps), json_array(s.mean), json_array(s.low),
                        json_array(s.high)),
        fmt::format("<a href=\"#p{}\">{}</a> ({})", point.summary.point, html(point.short_name(data.plan)),
                    regime_name(main_regime(point.summary))),
        "series");
}

}  // namespace

std::string along_axis(const ReportData& data, std::size_t axis) {
    const SweepAxis x = sweep_axis(data, axis);
    std::string text;
    for (const std::string_view statistic : kAlongAxes) text += one_axis(data, x, axis, statistic);
    return text;
}

std::string profiles(const ReportData& data) {
    std::size_t of = 0;
    const auto chosen = chosen_points(
        data, [](const RunResult& r) { return !r.profile.empty(); }, of);
    if (chosen.empty()) return {};
    std::vector<std::vector<PlotPoint>> curves;
    std::vector<double> fractions, heights;
    for (const ReportPoint* point : chosen) {
        std::vector<PlotPoint> curve;
        const Placement place = lattice_of(data, *point).placement;
        for (std::size_t k = 0; k < point->records[0]->result.profile.size(); ++k) {
            double sum = 0;
            for (const RunRecord* record : point->records) sum += record->result.profile[k];
            curve.push_back({sum / double(point->records.size()),
                             place.origin_m.z + (double(k) + 0.5) * place.cell_size_m});
            fractions.push_back(curve.back().x);
            heights.push_back(curve.back().y);
        }
        curves.push_back(std::move(curve));
    }
    Figure drawing(axis_over("cloud fraction of the level", fractions, false, true),
                   axis_over("height in m", heights), 460, 340);
    Legend legend;
    for (std::size_t n = 0; n < curves.size(); ++n) {
        const std::string colour = colour_of_curve(n, curves.size());
        drawing.line(curves[n], colour, chosen[n]->name(data.plan));
        legend.emplace_back(colour, values_text(*chosen[n]));
    }
    drawing.legend(legend);
    return figure(drawing.svg("Vertical profiles"),
                  choice_text(chosen.size(), of) + "Mean over the replicates.");
}

std::string sizes(const ReportData& data) {
    std::size_t of = 0;
    const auto chosen = chosen_points(
        data, [](const RunResult& r) { return !r.sizes.empty() && r.snapshots > 0; }, of);
    if (chosen.empty()) return {};
    std::vector<std::vector<PlotPoint>> curves;
    std::vector<double> areas, counts;
    // The columns of which exponents are taken, and their area: more than one where an axis changes the lattice.
    std::set<std::tuple<std::uint64_t, std::uint64_t, double>> ranges;
    for (const ReportPoint* point : chosen) {
        std::vector<PlotPoint> curve;
        const AutomatonOptions lattice = lattice_of(data, *point);
        const double column_m2 = lattice.placement.cell_size_m * lattice.placement.cell_size_m;
        const SizeRange range = default_size_range(lattice.extent);
        ranges.emplace(range.first, range.last, column_m2);
        for (int bin = 0; bin < kSizeBins - 1; ++bin) {
            const double begin = double(size_bin_begin(bin)), width = double(size_bin_begin(bin + 1)) - begin;
            double clouds = 0, snapshots = 0;
            for (const RunRecord* record : point->records) {
                const RunResult& r = record->result;
                clouds += std::size_t(bin) < r.sizes.size() ? double(r.sizes[std::size_t(bin)]) : 0;
                snapshots += double(r.snapshots);
            }
            if (width == 0 || clouds == 0) continue;
            curve.push_back({(begin + (width - 1) / 2) * column_m2, clouds / (snapshots * width)});
            areas.push_back(curve.back().x);
            counts.push_back(curve.back().y);
        }
        curves.push_back(std::move(curve));
    }
    Figure drawing(axis_over("area of a cloud in m2", areas, true),
                   axis_over("clouds a snapshot and column of area", counts, true), 460, 340);
    const auto [first, last, area_m2] = *ranges.begin();
    std::string range = "The range of the exponents is another one at each lattice. ";
    if (ranges.size() == 1 && last < first) range = "The box is too small for exponents. ";
    if (ranges.size() == 1 && last >= first) {
        range = fmt::format("Shaded: the range of the exponents, {} to {} columns. ", first, last);
        drawing.shade(double(first) * area_m2, double(last) * area_m2, "range of the exponents");
    }
    Legend legend;
    std::string table =
        "<table><tr><th>point</th><th>exponent, likelihood</th><th>exponent, line</th><th>fractal "
        "dimension</th></tr>\n";
    for (std::size_t n = 0; n < curves.size(); ++n) {
        const std::string colour = colour_of_curve(n, curves.size());
        drawing.line(curves[n], colour, chosen[n]->name(data.plan));
        legend.emplace_back(colour, values_text(*chosen[n]));
        table += fmt::format("<tr><td><a href=\"#p{}\">{}</a></td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
                             chosen[n]->summary.point, html(chosen[n]->name(data.plan)),
                             value_text(chosen[n]->mean("size_exponent")),
                             value_text(chosen[n]->mean("size_exponent_line")),
                             value_text(chosen[n]->mean("fractal_dimension")));
    }
    drawing.legend(legend);
    return figure(drawing.svg("Sizes of clouds"),
                  choice_text(chosen.size(), of) + range +
                      "A finite box shifts both exponents by 0.05 to 0.1, more than their intervals say.") +
           table + "</table>\n";
}

std::string series(const ReportData& data) {
    // Those that are not steady first: they are the ones to look at.
    std::vector<const ReportPoint*> unsteady, others, chosen;
    for (const ReportPoint& point : data.points) {
        if (point.summary.runs == 0) continue;
        (point.summary.regimes[std::size_t(Regime::not_steady)] > 0 ? unsteady : others).push_back(&point);
    }
    const std::size_t of = unsteady.size() + others.size();
    for (const std::size_t n : evenly(unsteady.size(), kMaxSeries / 2)) chosen.push_back(unsteady[n]);
    for (const std::size_t n : evenly(others.size(), kMaxSeries - chosen.size())) chosen.push_back(others[n]);
    if (chosen.empty()) return {};
    std::string text;
    for (const ReportPoint* point : chosen) text += series_figure(data, *point);
    return text + fmt::format(
                      "<p>{}{}The line is the mean over the replicates, the band goes from the lowest to the "
                      "highest; "
                      "the shaded part is the warm-up.<span class=\"zoom\"></span></p>\n",
                      chosen.size() < of ? fmt::format("{} of {} points. ", chosen.size(), of) : "",
                      unsteady.empty() ? "" : "Points with runs that are not steady come first. ");
}

}  // namespace nephos::report
