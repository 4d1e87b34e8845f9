// SPDX-License-Identifier: Apache-2.0
#include "study/report/svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "core/text.h"

namespace nephos::report {
namespace {

constexpr int kTickDigits = 4;
constexpr double kLetterWidth = 6.6;  // of 11 pixels high sans serif, of digits and small letters
constexpr int kLegendLine = 13, kLegendMark = 14;

// Returns the step of round numbers, 1, 2 or 5 times a power of ten, that cuts a range into at most `count` parts.
double round_step(double range, int count) {
    const double rough = range / count;
    const double power = std::pow(10, std::floor(std::log10(rough)));
    for (const double factor : {1.0, 2.0, 5.0})
        if (factor * power >= rough) return factor * power;
    return 10 * power;
}

std::string title_element(std::string_view title) {
    return title.empty() ? std::string() : fmt::format("<title>{}</title>", html(title));
}

}  // namespace

std::string html(std::string_view text) {
    std::string safe;
    for (const char c : escaped(text, "\n")) {
        switch (c) {
            case '&':
                safe += "&amp;";
                break;
            case '<':
                safe += "&lt;";
                break;
            case '>':
                safe += "&gt;";
                break;
            case '"':
                safe += "&quot;";
                break;
            case '\'':
                safe += "&#39;";
                break;
            default:
                safe += c;
        }
    }
    return safe;
}

std::string short_number(double value, int digits) {
    std::string text = number_text(value, digits);
    for (const std::string_view zero : {"e-0", "e+0"})
        if (const std::size_t at = text.find(zero); at != text.npos) text.erase(at + 2, 1);
    return text;
}

double text_width(std::string_view text) {
    std::size_t letters = 0;
    while (!text.empty()) {
        text.remove_prefix(character_at(text, 0).bytes.size());
        ++letters;
    }
    return kLetterWidth * double(letters);
}

std::string colour_between(double at) {
    if (!std::isfinite(at)) return "#9a9a9a";
    // Samples of the colour map viridis (van der Walt and Smith, CC0), linear between them.
    constexpr std::array<std::array<double, 3>, 6> kSamples{
        {{68, 1, 84}, {65, 68, 135}, {42, 120, 142}, {34, 168, 132}, {122, 209, 81}, {253, 231, 37}}};
    const double place = std::clamp(at, 0.0, 1.0) * (kSamples.size() - 1);
    const std::size_t first = std::min(std::size_t(place), kSamples.size() - 2);
    std::string colour = "#";
    for (std::size_t n = 0; n < 3; ++n) {
        const double low = kSamples[first][n], high = kSamples[first + 1][n];
        colour += fmt::format("{:02x}", int(std::lround(low + (place - double(first)) * (high - low))));
    }
    return colour;
}

std::string_view colour_of_line(std::size_t n) {
    constexpr std::array<std::string_view, 7> kColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                                       "#e69f00", "#56b4e9", "#000000"};
    return kColours[n % kColours.size()];
}

double PlotAxis::place(double value) const {
    if (!names.empty()) return (value + 0.5) / double(names.size());
    return log ? std::log(value / from) / std::log(to / from) : (value - from) / (to - from);
}

std::vector<double> PlotAxis::ticks(int count) const {
    std::vector<double> found;
    if (!names.empty()) {
        const std::size_t each = (names.size() + std::size_t(count) - 1) / std::size_t(count);
        for (std::size_t n = 0; n < names.size(); n += each) found.push_back(double(n));
        return found;
    }
    if (log) {
        const double decades = std::log10(to / from);
        const int first = int(std::floor(std::log10(from))), last = int(std::ceil(std::log10(to)));
        const int each = std::max(1, int(std::ceil(decades / count)));
        for (int decade = first; decade <= last; decade += each)
            for (const double factor : {1.0, 2.0, 5.0}) {
                const double value = factor * std::pow(10, decade);
                if ((factor == 1 || decades < 2.5) && value >= from * 0.999 && value <= to * 1.001)
                    found.push_back(value);
            }
        if (found.size() >= 2) return found;
        found.clear();
    }
    const double step = round_step(to - from, count);
    const double first = std::ceil(from / step - 1e-6);
    for (int n = 0; n <= 2 * count && (first + n) * step <= to + 1e-6 * step; ++n)
        found.push_back((first + n) * step);
    return found;
}

std::string PlotAxis::tick_label(double tick) const {
    if (!names.empty()) return names[std::size_t(tick)];
    return short_number(std::abs(tick) < 1e-9 * (to - from) ? 0 : tick, kTickDigits);
}

PlotAxis axis_over(std::string label, std::span<const double> values, bool log, bool zero) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const double value : values) {
        if (!std::isfinite(value) || (log && value <= 0)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
    }
    if (low > high) {
        low = log ? 0.1 : 0;
        high = 1;
    }
    PlotAxis axis{std::move(label), low, high, log, {}};
    if (log) {
        const double margin = std::max(std::pow(high / low, 0.04), 1.05);
        axis.from = low / margin;
        axis.to = high * margin;
    } else {
        if (zero) low = std::min(low, 0.0);
        // Values that differ by rounding alone are one: there is nothing between them to be drawn.
        const bool differ = high - low > 1e-12 * std::max(std::abs(low), std::abs(high));
        const double margin = differ ? 0.05 * (high - low) : std::max(0.05 * std::abs(high), 1e-6);
        axis.from = zero && low == 0 ? 0 : low - margin;
        axis.to = high + margin;
    }
    return axis;
}

Figure::Figure(PlotAxis x, PlotAxis y, int width, int height)
    : x_(std::move(x)), y_(std::move(y)), width_(width), height_(height) {}

double Figure::x_of(double value) const { return kLeft + x_.place(value) * (width_ - kLeft - kRight); }
double Figure::y_of(double value) const {
    return height_ - kBottom - y_.place(value) * (height_ - kTop - kBottom);
}

void Figure::line(std::span<const PlotPoint> points, std::string_view colour, std::string_view title) {
    std::string path;
    bool down = false;
    for (const PlotPoint& point : points) {
        const double x = x_of(point.x), y = y_of(point.y);
        const bool drawn = std::isfinite(x) && std::isfinite(y);
        if (drawn) path += fmt::format("{}{:.1f} {:.1f}", down ? 'L' : 'M', x, y);
        down = drawn;
    }
    if (!path.empty())
        content_ += fmt::format("<path class=\"line\" stroke=\"{}\" d=\"{}\">{}</path>\n", colour, path,
                                title_element(title));
}

void Figure::band(std::span<const PlotPoint> low, std::span<const PlotPoint> high, std::string_view colour) {
    std::string path;
    const auto add = [&](const PlotPoint& point) {
        const double x = x_of(point.x), y = y_of(point.y);
        if (std::isfinite(x) && std::isfinite(y))
            path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? 'M' : 'L', x, y);
    };
    for (const PlotPoint& point : low) add(point);
    for (std::size_t n = high.size(); n-- > 0;) add(high[n]);
    if (!path.empty())
        content_ += fmt::format("<path class=\"band\" fill=\"{}\" d=\"{}Z\"/>\n", colour, path);
}

void Figure::dot(PlotPoint at, std::string_view colour, std::string_view title, std::string_view link) {
    const double x = x_of(at.x), y = y_of(at.y);
    if (!std::isfinite(x) || !std::isfinite(y)) return;
    std::string circle = fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.2\" fill=\"{}\">{}</circle>",
                                     x, y, colour, title_element(title));
    if (!link.empty()) circle = fmt::format("<a href=\"#{}\">{}</a>", html(link), circle);
    content_ += circle + '\n';
}

void Figure::bar(double x, double low, double high, std::string_view colour) {
    const double at = x_of(x), from = y_of(low), to = y_of(high);
    if (!std::isfinite(at) || !std::isfinite(from) || !std::isfinite(to)) return;
    content_ += fmt::format(
        "<path class=\"line\" stroke=\"{0}\" d=\"M{1:.1f} {4:.1f}H{2:.1f}M{1:.1f} {5:.1f}"
        "H{2:.1f}M{3:.1f} {4:.1f}V{5:.1f}\"/>\n",
        colour, at - 3, at + 3, at, from, to);
}

void Figure::shade(double from, double to, std::string_view title) {
    const double left = x_of(std::max(from, x_.from)), right = x_of(std::min(to, x_.to));
    if (!(right > left)) return;
    content_ +=
        fmt::format("<rect class=\"shade\" x=\"{:.1f}\" y=\"{}\" width=\"{:.1f}\" height=\"{}\">{}</rect>\n",
                    left, kTop, right - left, height_ - kTop - kBottom, title_element(title));
}

void Figure::legend(std::span<const std::pair<std::string, std::string>> colours_and_names) {
    double longest = 0;
    const int left = width_ - kRight + 10;
    int y = kTop + 9;
    for (const auto& [colour, name] : colours_and_names) {
        longest = std::max(longest, text_width(name));
        over_ += fmt::format(
            "<path class=\"line\" stroke=\"{}\" d=\"M{} {}h{}\"/><text x=\"{}\" y=\"{}\">{}</text>\n", colour,
            left, y - 4, kLegendMark, left + kLegendMark + 5, y, html(name));
        y += kLegendLine;
    }
    legend_width_ = kLegendMark + 5 + int(std::ceil(longest));
}

std::string Figure::svg(std::string_view description) const {
    const int bottom = height_ - kBottom, right = width_ - kRight;
    std::string text = fmt::format(
        "<svg viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" role=\"img\" aria-label=\"{2}\">\n",
        width_ + legend_width_, height_, html(description));
    for (const double tick : x_.ticks(6)) {
        const double x = x_of(tick);
        text += fmt::format(
            "<path class=\"grid\" d=\"M{0:.1f} {1}V{2}\"/><text class=\"x\" x=\"{0:.1f}\" "
            "y=\"{3}\">{4}</text>\n",
            x, kTop, bottom, bottom + 15, html(x_.tick_label(tick)));
    }
    for (const double tick : y_.ticks(5)) {
        const double y = y_of(tick);
        text += fmt::format(
            "<path class=\"grid\" d=\"M{0} {2:.1f}H{1}\"/><text class=\"y\" x=\"{3}\" "
            "y=\"{4:.1f}\">{5}</text>\n",
            kLeft, right, y, kLeft - 6, y + 4, html(y_.tick_label(tick)));
    }
    // The frame cuts off what is drawn: an <svg> of its own clips, and needs no name that is unique in the page.
    text += fmt::format(
        "<svg x=\"{0}\" y=\"{1}\" width=\"{2}\" height=\"{3}\" viewBox=\"{0} {1} {2} {3}\">\n{4}"
        "</svg>\n",
        kLeft - 4, kTop - 4, right - kLeft + 8, bottom - kTop + 8, content_);
    text += fmt::format("<path class=\"frame\" d=\"M{0} {1}V{2}H{3}\"/>\n", kLeft, kTop, bottom, right);
    text += fmt::format("<text class=\"label\" x=\"{}\" y=\"{}\">{}</text>\n", (kLeft + right) / 2,
                        height_ - 8, html(x_.label));
    text += fmt::format("<text class=\"label\" transform=\"translate(13 {}) rotate(-90)\">{}</text>\n",
                        (kTop + bottom) / 2, html(y_.label));
    return text + over_ + "</svg>\n";
}

}  // namespace nephos::report
