// SPDX-License-Identifier: Apache-2.0
#include "study/report/report_data.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "core/text.h"

namespace nephos::report {
namespace {

constexpr double kWideInterval = 0.1;  // of the mean
constexpr int kFewestDigits = 3, kLabelDigits = 4, kAllDigits = 17;  // of labels
constexpr double kLogRatio = 20;  // values above 0 that differ more than this are drawn on a logarithmic axis

std::string unquoted(const std::string& value) {
    const bool quoted = value.size() >= 2 && value.front() == '"' && value.back() == '"';
    return quoted ? value.substr(1, value.size() - 2) : value;
}

bool number_of(const std::string& text, double& number) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size();
}

std::string joined_name(const SweepPlan& plan, const std::vector<std::string>& values) {
    std::vector<std::string> parts;
    for (std::size_t n = 0; n < values.size(); ++n)
        parts.push_back(
            fmt::format("{}={}", fmt::join(plan.options().axes[n].keys, "+"), unquoted(values[n])));
    return parts.empty() ? "the scene" : fmt::format("{}", fmt::join(parts, ", "));
}

// Gives every point the labels of its values.
void label_points(ReportData& data) {
    const std::vector<Axis>& axes = data.plan.options().axes;
    for (std::size_t axis = 0; axis < axes.size(); ++axis) {
        std::vector<std::string> values;
        for (const ReportPoint& point : data.points) values.push_back(point.summary.values[axis]);
        // Points of a sample need no label that tells them apart: a figure shows few of them.
        const std::vector<std::string> labels =
            axis_labels(values, axes[axis].values.empty() ? kLabelDigits : kAllDigits);
        for (std::size_t n = 0; n < labels.size(); ++n) data.points[n].labels.push_back(labels[n]);
    }
}

}  // namespace

std::vector<std::string> axis_labels(const std::vector<std::string>& values, int most) {
    const std::set<std::string> different(values.begin(), values.end());
    std::vector<std::string> labels;
    for (int digits = kFewestDigits; digits <= most; ++digits) {
        labels.clear();
        for (const std::string& value : values) {
            double number = 0;
            labels.push_back(number_of(value, number) ? short_number(number, digits) : unquoted(value));
        }
        if (std::set<std::string>(labels.begin(), labels.end()).size() == different.size()) break;
    }
    return labels;
}

std::string axis_title(const Axis& axis) {
    const std::size_t dot = axis.keys.front().rfind('.');
    const std::string section = axis.keys.front().substr(0, dot == std::string::npos ? 0 : dot + 1);
    const bool together = axis.keys.size() > 1 && !section.empty() &&
                          std::ranges::all_of(axis.keys, [&](const std::string& key) {
                              return key.starts_with(section) && key.find('.', section.size()) == key.npos;
                          });
    if (!together) return fmt::format("{}", fmt::join(axis.keys, "+"));
    std::vector<std::string> names;
    for (const std::string& key : axis.keys) names.push_back(key.substr(section.size()));
    return fmt::format("{}{{{}}}", section, fmt::join(names, ","));
}

const PointMean& ReportPoint::mean(std::string_view statistic) const {
    return summary.statistics[statistic_index(statistic)];
}

std::string ReportPoint::name(const SweepPlan& plan) const {
    return joined_name(plan, summary.values);
}

std::string ReportPoint::short_name(const SweepPlan& plan) const { return joined_name(plan, labels); }

ReportData gather(const SweepPlan& plan, const Records& records) {
    ReportData data{plan, records, plan.lattice(), {}};
    const std::uint32_t replicates = plan.options().replicates;
    for (std::uint64_t number = 0; number < plan.points(); ++number) {
        ReportPoint point{summarise(plan, records, number), {}, {}, {}};
        for (std::uint32_t replicate = 0; replicate < replicates; ++replicate) {
            point.runs.push_back(plan.run(number * replicates + replicate));
            point.records.push_back(records.find(point.runs.back().id));
        }
        data.points.push_back(std::move(point));
    }
    label_points(data);
    return data;
}

AutomatonOptions lattice_of(const ReportData& data, const ReportPoint& point) {
    return data.plan.varies_lattice() ? data.plan.lattice_of(point.runs.front()) : data.lattice;
}

SweepAxis sweep_axis(const ReportData& data, std::size_t axis) {
    SweepAxis found;
    const std::string label = axis_title(data.plan.options().axes[axis]);
    bool numbers = true, positive = true;
    for (const ReportPoint& point : data.points) {
        double number = 0;
        numbers = numbers && number_of(point.summary.values[axis], number);
        positive = positive && number > 0;
        found.values.push_back(number);
    }
    if (numbers) {
        const auto [low, high] = std::ranges::minmax(found.values);
        found.plot = axis_over(label, found.values, positive && high >= kLogRatio * low);
        return found;
    }
    found.plot.label = label;
    found.values.clear();
    for (const ReportPoint& point : data.points) {
        const std::string name = unquoted(point.summary.values[axis]);
        const auto at = std::ranges::find(found.plot.names, name);
        found.values.push_back(double(at - found.plot.names.begin()));
        if (at == found.plot.names.end()) found.plot.names.push_back(name);
    }
    return found;
}

std::vector<std::size_t> grid_place(const SweepPlan& plan, std::uint64_t point) {
    const std::vector<Axis>& axes = plan.options().axes;
    std::vector<std::size_t> place(axes.size());
    for (std::size_t n = axes.size(); n-- > 0;) {
        place[n] = point % axes[n].values.size();
        point /= axes[n].values.size();
    }
    return place;
}

std::vector<std::size_t> evenly(std::size_t count, std::size_t most) {
    std::vector<std::size_t> chosen;
    const std::size_t wanted = std::min(count, most);
    for (std::size_t n = 0; n < wanted; ++n)
        chosen.push_back(wanted == 1 ? 0 : n * (count - 1) / (wanted - 1));
    return chosen;
}

std::string choice_text(std::size_t drawn, std::size_t of) {
    return drawn < of ? fmt::format("{} of {} points, evenly apart. ", drawn, of) : std::string();
}

std::string value_text(const PointMean& mean) {
    if (!std::isfinite(mean.mean)) return "&ndash;";
    const double half = (mean.high - mean.low) / 2;
    return std::isfinite(half)
               ? fmt::format("{} &plusmn; {}", number_text(mean.mean, 4), number_text(half, 2))
               : number_text(mean.mean, 4);
}

std::string_view colour_of(Regime regime) {
    switch (regime) {
        case Regime::dead:
            return "#8c8c8c";
        case Regime::sparse:
            return "#7fc4ee";
        case Regime::steady:
            return "#2f9e77";
        case Regime::pulsing:
            return "#e69f00";
        case Regime::overcast:
            return "#2a5fa5";
        case Regime::not_steady:
            return "#d1495b";
    }
    return "#000000";
}

Regime main_regime(const PointSummary& summary) {
    return Regime(std::ranges::max_element(summary.regimes) - summary.regimes.begin());
}

bool is_doubtful(const PointSummary& summary) {
    const PointMean& cover = summary.statistics[statistic_index("cover")];
    return !std::isfinite(cover.mean) || cover.errors_differ || !std::isfinite(cover.high - cover.low) ||
           has_wide_interval(summary);
}

bool has_wide_interval(const PointSummary& summary) {
    const PointMean& cover = summary.statistics[statistic_index("cover")];
    return (cover.high - cover.low) / 2 > kWideInterval * cover.mean;  // false where there is none
}

std::string figure(std::string_view drawing, std::string_view caption, std::string_view kind) {
    return fmt::format("<figure{}>\n{}<figcaption>{}</figcaption>\n</figure>\n",
                       kind.empty() ? "" : fmt::format(" class=\"{}\"", kind), drawing, caption);
}

}  // namespace nephos::report
