// SPDX-License-Identifier: Apache-2.0
#include "study/report/maps.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "core/text.h"

namespace nephos::report {
namespace {

constexpr std::size_t kMaxPanels = 16, kMaxPairs = 6, kMaxLines = 1000, kMaxThumbnails = 60;
constexpr double kMinLabelWidth = 34, kMinLabelHeight = 14;

std::string title_of(const ReportData& data, const ReportPoint& point) {
    std::string title = fmt::format("point {}: {}", point.summary.point, point.name(data.plan));
    for (std::size_t n = 0; n < point.summary.regimes.size(); ++n)
        if (point.summary.regimes[n] > 0)
            title += fmt::format("; {} {}", point.summary.regimes[n], regime_name(Regime(n)));
    if (point.summary.failed > 0) title += fmt::format("; {} failed", point.summary.failed);
    if (point.summary.missing > 0) title += fmt::format("; {} missing", point.summary.missing);
    const PointMean& cover = point.mean("cover");
    if (std::isfinite(cover.mean)) title += "; cover " + number_text(cover.mean, 4);
    return title;
}

struct Box {
    double x, y, width, height;
};

// Draws the regimes of a point side by side, each as wide as its share of the runs.
std::string cell(const ReportData& data, const ReportPoint& point, const Box& box) {
    std::string text =
        fmt::format("<a href=\"#p{}\"><title>{}</title>", point.summary.point, html(title_of(data, point)));
    double x = box.x;
    const double width = (box.width - 1) / data.plan.options().replicates;
    for (std::size_t n = 0; n < point.summary.regimes.size(); ++n) {
        if (point.summary.regimes[n] == 0) continue;
        const double share = width * point.summary.regimes[n];
        text +=
            fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>", x,
                        box.y, share, box.height - 1, colour_of(Regime(n)));
        x += share;
    }
    // What is missing or failed stays white within the frame.
    text += fmt::format(
        "<rect class=\"cell\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
        "fill=\"{}\"/>",
        box.x, box.y, box.width - 1, box.height - 1,
        is_doubtful(point.summary) ? "url(#hatch)" : "transparent");
    const PointMean& cover = point.mean("cover");
    if (std::isfinite(cover.mean) && box.width >= kMinLabelWidth && box.height >= kMinLabelHeight)
        text += fmt::format("<text class=\"cell\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>", box.x + box.width / 2,
                            box.y + box.height / 2 + 4, number_text(cover.mean, 2));
    return text + "</a>\n";
}

std::string title_of_axis(double x, double y, std::string_view anchor, const Axis& axis) {
    return fmt::format("<text style=\"font-weight:600;text-anchor:{}\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", anchor, x, y,
                       html(axis_title(axis)));
}

double widest(const std::vector<std::string>& labels) {
    double width = 0;
    for (const std::string& label : labels) width = std::max(width, text_width(label));
    return width;
}

// One panel of a grid: the first axis to the right, the second upwards, the others fixed. The title of the second stands above
// it, where it has room.
std::string panel(const ReportData& data, const std::vector<std::size_t>& fixed, double max_width) {
    const std::vector<Axis>& axes = data.plan.options().axes;
    const std::size_t nx = axes[0].values.size(), ny = axes.size() > 1 ? axes[1].values.size() : 1;
    const std::vector<std::string> x_labels = axis_labels(axes[0].values),
                                   y_labels = ny > 1 ? axis_labels(axes[1].values) : std::vector<std::string>();
    const Box box{widest(y_labels) + 10, ny > 1 ? 22.0 : 8.0, std::min(max_width / double(nx), 64.0),
                  std::min(420.0 / double(ny), 34.0)};
    const double bottom = box.y + box.height * double(ny), right = box.x + box.width * double(nx);
    double title_width = text_width(axis_title(axes[0]));
    if (ny > 1) title_width = std::max(title_width, text_width(axis_title(axes[1])));
    const double svg_width = std::max({right + widest(x_labels) / 2, title_width + 10, 220.0});
    std::string text = fmt::format(
        "<svg viewBox=\"0 0 {0:.0f} {1:.0f}\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
        "role=\"img\" aria-label=\"Regimes\">\n",
        svg_width, bottom + 38);
    std::size_t rest = 1;
    for (std::size_t n = 2; n < axes.size(); ++n) rest *= axes[n].values.size();
    std::size_t offset = 0;
    for (std::size_t n = 2; n < axes.size(); ++n) offset = offset * axes[n].values.size() + fixed[n - 2];
    for (std::size_t i = 0; i < nx; ++i)
        for (std::size_t j = 0; j < ny; ++j)
            text += cell(data, data.points[(i * ny + j) * rest + offset],
                         {box.x + double(i) * box.width, box.y + double(ny - 1 - j) * box.height, box.width,
                          box.height});
    const auto label = [](std::string_view kind, double x, double y, const std::string& shown,
                          const std::string& value) {
        return fmt::format("<text class=\"{}\" x=\"{:.1f}\" y=\"{:.1f}\">{}<title>{}</title></text>\n", kind, x, y,
                           html(shown), html(value));
    };
    const std::size_t each_x = std::size_t(std::ceil((widest(x_labels) + 6) / box.width)),
                      each_y = std::size_t(std::ceil(12 / box.height));
    for (std::size_t i = 0; i < nx; i += each_x)
        text += label("x", box.x + (double(i) + 0.5) * box.width, bottom + 13, x_labels[i], axes[0].values[i]);
    const double half_title = text_width(axis_title(axes[0])) / 2;
    text += title_of_axis(std::max((box.x + right) / 2, half_title + 4), bottom + 31, "middle", axes[0]);
    for (std::size_t j = 0; j < y_labels.size(); j += each_y)
        text += label("y", box.x - 5, box.y + (double(ny - 1 - j) + 0.5) * box.height + 4, y_labels[j],
                      axes[1].values[j]);
    if (ny > 1) text += title_of_axis(4, 12, "start", axes[1]);
    return text + "</svg>\n";
}

std::string map_of_grid(const ReportData& data) {
    const std::vector<Axis>& axes = data.plan.options().axes;
    std::size_t panels = 1;
    for (std::size_t n = 2; n < axes.size(); ++n) panels *= axes[n].values.size();
    const std::vector<std::size_t> chosen = evenly(panels, kMaxPanels);
    std::string text;
    for (std::size_t number : chosen) {
        std::vector<std::size_t> fixed(axes.size() > 2 ? axes.size() - 2 : 0);
        std::vector<std::string> names;
        for (std::size_t n = axes.size(); n-- > 2;) {
            fixed[n - 2] = number % axes[n].values.size();
            number /= axes[n].values.size();
            names.insert(names.begin(),
                         fmt::format("{} = {}", fmt::join(axes[n].keys, "+"), axes[n].values[fixed[n - 2]]));
        }
        text += figure(panel(data, fixed, panels > 1 ? 300 : 780),
                       html(fmt::format("{}", fmt::join(names, ", "))));
    }
    if (chosen.size() < panels)
        text += fmt::format("<p>{} of {} combinations of the further axes, evenly apart.</p>\n",
                            chosen.size(), panels);
    return text;
}

std::string map_of_samples(const ReportData& data) {
    const std::size_t axes = data.plan.options().axes.size();
    std::string text;
    std::size_t pairs = 0;
    for (std::size_t i = 0; i < axes; ++i)
        for (std::size_t j = i + 1; j < axes && pairs < kMaxPairs; ++j, ++pairs) {
            const SweepAxis x = sweep_axis(data, i), y = sweep_axis(data, j);
            Figure drawing(x.plot, y.plot, 420, 320);
            for (std::size_t n = 0; n < data.points.size(); ++n)
                drawing.dot({x.values[n], y.values[n]}, colour_of(main_regime(data.points[n].summary)),
                            title_of(data, data.points[n]), fmt::format("p{}", n));
            text += figure(drawing.svg("Regimes over two axes"), "");
        }
    return text;
}

// A vertical axis of the parallel coordinates, with each point's value.
struct Coordinate {
    PlotAxis plot;
    std::vector<double> values;
};

std::vector<Coordinate> coordinates(const ReportData& data) {
    std::vector<Coordinate> all;
    for (std::size_t n = 0; n < data.plan.options().axes.size(); ++n) {
        const SweepAxis axis = sweep_axis(data, n);
        all.push_back({axis.plot, axis.values});
    }
    for (const std::string_view name :
         {"cover", "cloud_fraction", "correlation_length_m", "lifetime_s", "size_exponent"}) {
        std::vector<double> values;
        for (const ReportPoint& point : data.points) values.push_back(point.mean(name).mean);
        if (std::ranges::count_if(values, [](double value) { return std::isfinite(value); }) < 2) continue;
        PlotAxis plot = axis_over(std::string(name), values);
        all.push_back({std::move(plot), std::move(values)});
    }
    return all;
}

}  // namespace

std::string regime_legend() {
    std::string text = "<ul class=\"legend\">";
    for (int n = 0; n <= int(Regime::not_steady); ++n)
        text += fmt::format("<li><span style=\"background:{}\"></span>{}</li>", colour_of(Regime(n)),
                            regime_name(Regime(n)));
    return text +
           "<li><svg width=\"16\" height=\"12\"><rect class=\"cell\" width=\"16\" height=\"12\" "
           "fill=\"url(#hatch)\"/></svg>no mean, or an uncertain one</li></ul>\n";
}

std::string regime_map(const ReportData& data) {
    const SweepOptions& options = data.plan.options();
    if (options.axes.empty()) return {};
    return options.design == Design::grid ? map_of_grid(data) : map_of_samples(data);
}

std::string parallel_coordinates(const ReportData& data) {
    const std::vector<Coordinate> all = coordinates(data);
    if (all.size() < 3 || data.points.size() < 2) return {};
    const int width = 880, height = 300, top = 34, bottom = height - 16, left = 60, right = width - 70;
    const auto x_of = [&](std::size_t n) {
        return left + double(n) * (right - left) / double(all.size() - 1);
    };
    const auto y_of = [&](const Coordinate& c, double value) {
        return bottom - c.plot.place(value) * (bottom - top);
    };
    std::string text = fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" "
        "aria-label=\"Parallel coordinates\">\n",
        width, height);
    const std::vector<std::size_t> chosen = evenly(data.points.size(), kMaxLines);
    const auto cover = std::ranges::find(all, "cover", [](const Coordinate& c) { return c.plot.label; });
    for (const std::size_t n : chosen) {
        std::string path;
        for (std::size_t c = 0; c < all.size(); ++c) {
            const double value = all[c].values[n];
            if (!std::isfinite(value)) break;  // a point without means ends at its parameters
            path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? 'M' : 'L', x_of(c), y_of(all[c], value));
        }
        const double place = cover == all.end() ? std::nan("") : cover->plot.place(cover->values[n]);
        text += fmt::format(
            "<a href=\"#p{}\"><path class=\"thread\" stroke=\"{}\" d=\"{}\"><title>{}</title></path></a>\n",
            n, colour_between(place), path, html(title_of(data, data.points[n])));
    }
    for (std::size_t c = 0; c < all.size(); ++c) {
        const double x = x_of(c);
        text += fmt::format(
            "<path class=\"frame\" d=\"M{0:.1f} {1}V{2}\"/><text class=\"label\" x=\"{0:.1f}\" "
            "y=\"{3}\">{4}</text>\n",
            x, top, bottom, c % 2 == 0 ? 12 : 26, html(all[c].plot.label));
        for (const double tick : all[c].plot.ticks(5))
            text += fmt::format("<text class=\"y halo\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x - 4,
                                y_of(all[c], tick) + 4, html(all[c].plot.tick_label(tick)));
    }
    return figure(
        text + "</svg>\n",
        choice_text(chosen.size(), data.points.size()) +
            "A line a point, coloured by its cover, blue to yellow. A line ends where a value is missing.");
}

std::string thumbnails(const ReportData& data) {
    std::vector<const ReportPoint*> shown;
    for (const ReportPoint& point : data.points)
        if (point.records[0] != nullptr && !point.records[0]->result.thumbnail.empty())
            shown.push_back(&point);
    if (shown.empty()) return {};
    std::string text = "<div class=\"thumbnails\">\n";
    const std::vector<std::size_t> chosen = evenly(shown.size(), kMaxThumbnails);
    for (const std::size_t n : chosen) {
        const ReportPoint& point = *shown[n];
        const PointMean& cover = point.mean("cover");
        text += fmt::format(
            "<a href=\"#p{}\"><img alt=\"Point {} from above\" "
            "src=\"data:image/png;base64,{}\"><span>{}{}</span></a>\n",
            point.summary.point, point.summary.point, point.records[0]->result.thumbnail,
            html(point.short_name(data.plan)),
            std::isfinite(cover.mean) ? "<br>cover " + number_text(cover.mean, 3) : "");
    }
    return text + "</div>\n<p>" + choice_text(chosen.size(), shown.size()) +
           "The last state of the first replicate, from above, north up; brighter where a column has more "
           "cloud.</p>\n";
}

}  // namespace nephos::report
