// SPDX-License-Identifier: Apache-2.0
#include "study/cloud_mask_axes.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <string_view>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// In the order that a mask has them.
enum class Kind { time, levels, y, x, unknown };
constexpr std::array<std::string_view, 4> kKindNames{"time", "z", "y", "x"};
constexpr std::size_t kMostListed = 20;  // names of dimensions in a message

std::string lower(std::string text) {
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return text;
}

bool is_one_of(std::string_view word, std::initializer_list<std::string_view> words) {
    return std::ranges::count(words, word) > 0;
}

bool is_pressure(const std::string& units) {
    return is_one_of(units,
                     {"pa", "hpa", "kpa", "mbar", "mb", "millibar", "millibars", "bar", "dbar", "atm"});
}

Kind kind_of_attributes(const NetcdfAxis& axis) {
    const std::string letter = lower(axis.axis), standard = lower(axis.standard_name),
                      units = lower(axis.units), positive = lower(axis.positive);
    constexpr std::string_view kLetters = "tzyx";
    if (letter.size() == 1 && kLetters.find(letter[0]) != kLetters.npos)
        return Kind(kLetters.find(letter[0]));
    if (is_one_of(standard, {"time", "forecast_period", "forecast_reference_time"})) return Kind::time;
    if (is_one_of(standard, {"latitude", "grid_latitude", "projection_y_coordinate"})) return Kind::y;
    if (is_one_of(standard, {"longitude", "grid_longitude", "projection_x_coordinate"})) return Kind::x;
    if (is_one_of(standard, {"altitude", "height", "depth", "geopotential_height", "air_pressure",
                             "model_level_number"}) ||
        standard.starts_with("height_above_") ||
        (standard.starts_with("atmosphere_") && standard.ends_with("_coordinate")))
        return Kind::levels;
    if (units.find(" since ") != units.npos) return Kind::time;
    if (is_one_of(units, {"degrees_north", "degree_north", "degrees_n", "degree_n", "degreesn", "degreen"}))
        return Kind::y;
    if (is_one_of(units, {"degrees_east", "degree_east", "degrees_e", "degree_e", "degreese", "degreee"}))
        return Kind::x;
    if (is_pressure(units) || is_one_of(units, {"level", "layer", "sigma_level"}) ||
        is_one_of(positive, {"up", "down"}))
        return Kind::levels;
    return Kind::unknown;
}

// "bottom_top_stag" is bottom_top, "Height_2" is height.
std::string usual_name(const std::string& dimension) {
    std::string name = lower(dimension);
    if (name.ends_with("_stag")) name.resize(name.size() - 5);
    while (!name.empty() && std::isdigit(static_cast<unsigned char>(name.back()))) name.pop_back();
    if (name.ends_with("_")) name.pop_back();
    return name;
}

Kind kind_of_name(const std::string& dimension) {
    const std::string name = usual_name(dimension);
    if (is_one_of(name, {"time", "times", "t", "xtime", "time_counter", "nt"})) return Kind::time;
    if (is_one_of(name,
                  {"z",      "lev",        "level",    "levels",      "ilev",  "height", "altitude", "alt",
                   "depth",  "plev",       "pressure", "isobaric",    "pfull", "phalf",  "zt",       "zm",
                   "zc",     "zf",         "zh",       "zw",          "zu",    "nz",     "nk",       "k",
                   "hybrid", "bottom_top", "layer",    "model_level", "nlev",  "zlev",   "vertical", "zk"}))
        return Kind::levels;
    if (is_one_of(name, {"y", "lat", "latitude", "nlat", "south_north", "rlat", "yt", "ym", "yc", "yf", "yh",
                         "yu", "yv", "ny", "nj", "j", "grid_yt", "north", "northing"}))
        return Kind::y;
    if (is_one_of(name, {"x", "lon", "longitude", "nlon", "west_east", "rlon", "xt", "xm", "xc", "xf", "xh",
                         "xu", "xv", "nx", "ni", "i", "grid_xt", "east", "easting"}))
        return Kind::x;
    return Kind::unknown;
}

Kind kind_of(const NetcdfAxis& axis) {
    const Kind kind = kind_of_attributes(axis);
    return kind != Kind::unknown ? kind : kind_of_name(axis.name);
}

// Whether the height falls from the first level to the last, as the coordinate variable has it.
bool is_downwards(const NetcdfAxis& axis) {
    if (!axis.first || !axis.last || !std::isfinite(*axis.last - *axis.first) || *axis.first == *axis.last)
        return false;
    const std::string positive = lower(axis.positive), name = usual_name(axis.name);
    const bool falls_with_height =
        positive == "down" ||
        (positive != "up" && (is_pressure(lower(axis.units)) || lower(axis.standard_name) == "air_pressure" ||
                              is_one_of(name, {"plev", "pressure", "isobaric", "depth"})));
    return (*axis.last > *axis.first) == falls_with_height;
}

std::string names_of(const std::vector<NetcdfAxis>& axes) {
    std::vector<std::string> names;
    for (const NetcdfAxis& axis : axes) {
        if (names.size() == kMostListed) {
            names.push_back("...");
            break;
        }
        names.push_back(shortened(axis.name));
    }
    return fmt::format("{}", fmt::join(names, ", "));
}

std::string names_of(const std::vector<Kind>& kinds) {
    std::vector<std::string_view> names;
    for (const Kind kind : kinds)
        names.push_back(kind == Kind::unknown ? std::string_view("unknown") : kKindNames[std::size_t(kind)]);
    return fmt::format("{}", fmt::join(names, ", "));
}

[[noreturn]] void refuse(const std::filesystem::path& path, const NetcdfSource& source,
                         const std::vector<Kind>& kinds) {
    const std::vector<NetcdfAxis>& axes = source.axes();
    std::vector<std::size_t> order;
    for (std::size_t n = 0; n < axes.size(); ++n) order.push_back(n);
    std::ranges::stable_sort(order, {}, [&](std::size_t n) { return kinds[n]; });
    std::vector<std::string> names;
    bool differ = true;
    for (std::size_t n = 0; n < order.size(); ++n) {
        names.push_back(shortened(axes[order[n]].name));
        differ = differ && (n == 0 || kinds[order[n]] != kinds[order[n - 1]]);
    }
    const auto has = [&](Kind kind) { return std::ranges::count(kinds, kind) > 0; };
    const std::string cure =
        differ && has(Kind::y) && has(Kind::x) && !has(Kind::unknown)
            ? fmt::format("`ncpdq -a {} IN.nc OUT.nc` reorders them", fmt::join(names, ","))
            : "`ncwa -a NAME` or `ncks -d NAME,0` takes one away, `ncpdq -a` reorders them";
    throw Error(ErrorCode::usage,
                fmt::format("{}: the dimensions ({}) of the variable {} are {}; expected (time,) (z,) y, x, "
                            "the last fastest: {}",
                            path.string(), names_of(axes), shortened(source.name()), names_of(kinds), cure));
}

}  // namespace

MaskAxes mask_axes(const std::filesystem::path& path, const NetcdfSource& source) {
    const std::vector<NetcdfAxis>& axes = source.axes();
    if (axes.size() < 2 || axes.size() > 4)
        throw Error(ErrorCode::usage,
                    fmt::format("{}: the variable {} has {} dimensions ({}); expected (y, x), (z, y, x), "
                                "(time, y, x) or (time, z, y, x)",
                                path.string(), shortened(source.name()), axes.size(), names_of(axes)));
    std::vector<Kind> kinds, places{Kind::y, Kind::x};
    for (const NetcdfAxis& axis : axes) kinds.push_back(kind_of(axis));
    if (axes.size() == 4) places = {Kind::time, Kind::levels, Kind::y, Kind::x};
    if (axes.size() == 3) places = {kinds[0] == Kind::time ? Kind::time : Kind::levels, Kind::y, Kind::x};
    MaskAxes found{places[0] == Kind::time, axes.size() == 4 || places[0] == Kind::levels, false, {}};
    for (std::size_t n = 0; n < axes.size(); ++n) {
        if (kinds[n] != Kind::unknown && kinds[n] != places[n]) refuse(path, source, kinds);
        if (places[n] == Kind::levels) found.downwards = is_downwards(axes[n]);
    }
    if (std::ranges::count(kinds, Kind::unknown) > 0)
        found.note = fmt::format(
            "the dimensions ({}) of the variable {} are taken as {} by their places: not all of the names "
            "are "
            "known, nor do attributes `axis` tell",
            names_of(axes), shortened(source.name()), names_of(places));
    return found;
}

}  // namespace nephos
