// SPDX-License-Identifier: Apache-2.0
#pragma once

// Draws figures of a report as inline SVG: axes with ticks, lines, bands, bars. Equal calls give equal text.

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace nephos::report {

// Returns the text with the characters that HTML reads as markup replaced; it may stand in an element or in quotes.
std::string html(std::string_view text);

// Returns a number with at most so many digits as a label: "0.00122", "1e-5".
std::string short_number(double value, int digits);

// Returns about how wide a text is in figures, in pixels, at most.
double text_width(std::string_view text);

// Returns the place of a colour between two ends, dark blue at 0 to yellow at 1 ("#440154"), which stays readable in
// grey and for colour-blind eyes; grey where `at` is not a number.
std::string colour_between(double at);

// Returns the colour of the n-th of a few lines (Okabe and Ito 2008).
std::string_view colour_of_line(std::size_t n);

// An axis of a figure: numbers, linear or logarithmic, or names at even distances.
struct PlotAxis {
    std::string label;
    double from = 0, to = 1;  // from < to; above 0 where logarithmic
    bool log = false;
    std::vector<std::string> names;  // then value n is the n-th name

    // Returns where a value lies, 0 at `from` and 1 at `to`.
    double place(double value) const;
    // Returns the values that get a tick, at most about `count`.
    std::vector<double> ticks(int count) const;
    std::string tick_label(double tick) const;
};

// Returns an axis that holds the finite ones of the values with some space around them; one that starts at 0 with `zero`.
// Logarithmic ones take values above 0 only.
PlotAxis axis_over(std::string label, std::span<const double> values, bool log = false, bool zero = false);

struct PlotPoint {
    double x, y;
};

// A figure while it is drawn. All coordinates are values of the axes; what lies outside is cut off by the frame, what is not
// finite is left out.
class Figure {
  public:
    Figure(PlotAxis x, PlotAxis y, int width = 380, int height = 250);

    void line(std::span<const PlotPoint> points, std::string_view colour, std::string_view title = {});
    // Fills between the two lines, each from left to right.
    void band(std::span<const PlotPoint> low, std::span<const PlotPoint> high, std::string_view colour);
    void dot(PlotPoint at, std::string_view colour, std::string_view title, std::string_view link = {});
    // Draws a vertical error bar with caps.
    void bar(double x, double low, double high, std::string_view colour);
    // Shades all between two values of the x axis.
    void shade(double from, double to, std::string_view title);
    // Names the lines to the right of the frame, and widens the figure for it: no curve is covered.
    void legend(std::span<const std::pair<std::string, std::string>> colours_and_names);

    std::string svg(std::string_view description) const;

  private:
    double x_of(double value) const;
    double y_of(double value) const;

    PlotAxis x_, y_;
    int width_, height_;
    int legend_width_ = 0;
    std::string content_, over_;
    static constexpr int kLeft = 68, kRight = 14, kTop = 12, kBottom = 42;
};

}  // namespace nephos::report
