// SPDX-License-Identifier: Apache-2.0
#include "scenes/metar/metar_scene.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/error.h"
#include "core/place.h"
#include "core/text.h"
#include "scenes/metar/taf.h"

namespace nephos {
namespace {

constexpr double kFoot_m = 0.3048;
// Of the clouds' box, which stands around the aerodrome.
constexpr double kSide_m = 20'000;
constexpr double kDeep_m = 2000;        // deeper layers have coarser cells
constexpr double kKoschmieder = 3.912;  // -ln 0.02: contrast that an eye still sees

std::string text_of(double value) { return number_text(std::round(value * 1000) / 1000); }

bool has_phenomenon(const Metar& m, std::string_view phenomenon) {
    return std::ranges::any_of(m.weather, [&](const MetarWeather& w) {
        return !w.vicinity && std::ranges::find(w.phenomena, phenomenon) != w.phenomena.end();
    });
}

bool has_descriptor(const Metar& m, std::string_view descriptor) {
    return std::ranges::any_of(
        m.weather, [&](const MetarWeather& w) { return !w.vicinity && w.descriptor == descriptor; });
}

// What falls, the strongest of the groups.
struct Precipitation {
    bool any = false, snow = false, showers = false;
    double mm_per_h = 0;
    std::string code;  // as reports write it, without intensity
};

// What falls of a group, without intensity, SH and TS; "" of the others, blowing snow too.
std::string falling(const MetarWeather& w) {
    if (w.vicinity || w.descriptor == "BL" || w.descriptor == "DR") return {};
    std::string code;
    for (const std::string& phenomenon : w.phenomena)
        if (is_precipitation(phenomenon)) code += phenomenon;
    return code.empty() || w.descriptor != "FZ" ? code : "FZ" + code;
}

Precipitation precipitation_of(const Metar& m) {
    Precipitation p;
    for (const MetarWeather& w : m.weather) {
        const std::string code = falling(w);
        if (code.empty()) continue;
        // In the middle of the classes of FM 15: drizzle below 0.1 and above 0.5, others below 2.5 and above 10 mm/h.
        const bool drizzle = code.ends_with("DZ") && code.find("RA") == code.npos;
        const double rate = drizzle ? (w.intensity == '-'   ? 0.05
                                       : w.intensity == '+' ? 0.8
                                                            : 0.3)
                                    : (w.intensity == '-'   ? 1
                                       : w.intensity == '+' ? 15
                                                            : 5);
        p.any = true;
        p.snow = p.snow || code.find("SN") != code.npos || code.find("SG") != code.npos;
        p.showers = p.showers || w.descriptor == "SH" || w.descriptor == "TS";
        if (!(rate > p.mm_per_h)) continue;
        p.mm_per_h = rate;
        p.code = code;
    }
    return p;
}

struct Genus {
    const char* name;
    double depth_m;
};

// Limits of the three levels of cloud at 6,500 and 20,000 ft.
Genus genus_of(const MetarCloud& c, bool rain) {
    const int amount = int(c.amount);  // 0 FEW .. 3 OVC
    if (c.type == "CB") return {"Cb", 6000};
    if (c.type == "TCU") return {"Cu", 2400};
    if (*c.height_ft < 6500) {
        constexpr Genus kLow[] = {{"Cu", 500}, {"Cu", 700}, {"Sc", 400}, {"St", 350}};
        return amount == 3 && rain ? Genus{"Ns", 2400} : kLow[amount];
    }
    constexpr Genus kMiddle[] = {{"Ac", 280}, {"Ac", 280}, {"Ac", 320}, {"As", 600}};
    constexpr Genus kHigh[] = {{"Ci", 600}, {"Ci", 600}, {"Cs", 500}, {"Cs", 500}};
    return *c.height_ft < 20'000 ? kMiddle[amount] : kHigh[amount];
}

// The keys of a veil and of its detail, by genus. `coverage` and heights come first.
struct Look {
    const char* veil;
    const char* detail;
    double opacity, cell_m;
};

Look look_of(const std::string& genus, bool deep) {
    // Towers go through the whole layer: noise that changed within its depth would lift the base of half of the columns.
    if (deep && genus == "Cb")
        return {
            "form = \"cumulus\"\noctaves = 3\nwavelength_m = 5000\nstretch_up = 20\nsoftness = "
            "0.5\nevolution_m_per_s = 1\n",
            "strength = 1\nsize_m = 400\n", 1, 160};
    if (deep && genus == "Cu")
        return {
            "form = \"cumulus\"\noctaves = 3\nwavelength_m = 5000\nstretch_up = 8\nsoftness = "
            "0.5\nevolution_m_per_s = 1\n",
            "strength = 1\nsize_m = 400\n", 1, 160};
    if (genus == "Cu" || genus == "Cb")
        return {
            "form = \"cumulus\"\noctaves = 4\nwavelength_m = 2600\nstretch_up = 1.2\nsoftness = "
            "0.7\nevolution_m_per_s = 1\n",
            "strength = 1\nsize_m = 300\n", 1, 100};
    if (genus == "Sc")
        return {
            "form = \"stratus\"\nsoftness = 0.8\ndirection_deg = 20\noctave = [\n    { wavelength_m = [9000, "
            "7000, 4000], weight = 0.45 },\n"
            "    { wavelength_m = [6500, 1150, 4000], weight = 1, velocity_m_per_s = [0, 0.5, 0.2] },\n"
            "    { wavelength_m = [1100, 620, 3000], weight = 0.5, velocity_m_per_s = [0.5, -0.5, 0.4] "
            "},\n]\n",
            "strength = 0.7\nsize_m = 260\nwisps = 0.4\nthermals = 0.3\n", 1, 100};
    if (genus == "Ac")
        return {
            "form = \"stratus\"\nsoftness = 1\ndirection_deg = 30\noctave = [\n    { wavelength_m = [9000, "
            "6000, 4000], weight = 0.6 },\n"
            "    { wavelength_m = [820, 520, 2000], weight = 1, velocity_m_per_s = [0.3, 0.3, 0.2] },\n"
            "    { wavelength_m = [400, 300, 1500], weight = 0.25, velocity_m_per_s = [0.5, -0.5, 0.4] "
            "},\n]\n",
            "strength = 0.6\nsize_m = 130\nwisps = 0.4\nthermals = 0.2\n", 0.6, 80};
    if (genus == "Ci")
        return {
            "form = \"cirrus\"\noctaves = 4\nwavelength_m = 2200\nstretch = 6\ndisplacement = 0.3\nsoftness "
            "= 1\nfallstreak_m = 3000\n",
            "strength = 1.2\nsize_m = 220\nstretch = 20\nwisps = 0\nthermals = 0\n", 0.25, 100};
    if (genus == "Cs")
        return {
            "form = \"cirrostratus\"\noctaves = 3\nwavelength_m = 9000\nstretch = 4\ndisplacement = "
            "0.6\nsoftness = 0.5\n",
            "strength = 0.3\nsize_m = 900\nstretch = 20\nthermals = 0.3\nwisps = 0\n", 0.2, 100};
    // St, Ns, As, VV
    return {
        "form = \"stratus\"\noctaves = 3\nwavelength_m = 3600\nstretch = 1.8\nstretch_up = 0.6\nsoftness = "
        "0.6\n",
        "strength = 0.35\nsize_m = 500\nthermals = 0.4\nmean_free_path_m = 200\n", 1, 100};
}

// `keys` are further ones of the layer, a line each.
std::string layer_text(const MetarLayer& layer, double coverage, const std::string& keys = {}) {
    const double depth = layer.top_m - layer.base_m;
    const Look look = look_of(layer.genus, depth > kDeep_m);
    const double cell = depth > kDeep_m ? 160 : look.cell_m;
    const int across = int(std::lround(kSide_m / cell)), levels = std::max(3, int(std::ceil(depth / cell)));
    std::string text = "\n# " + layer.group + "\n[[layer]]\nname = \"" + layer.name + "\"\n";
    if (look.opacity != 1) text += "opacity = " + text_of(look.opacity) + "\n";
    text += keys + "lattice = { cells = [" + std::to_string(across) + ", " + std::to_string(across) + ", " +
            std::to_string(levels) + "], cell_size_m = " + text_of(cell) + ", origin_m = [" +
            text_of(-kSide_m / 2) + ", " + text_of(-kSide_m / 2) + ", " + text_of(layer.base_m) +
            "] }\n\n[layer.veil]\n";
    text += std::string(look.veil) + "coverage = " + number_text(coverage) + "\n";
    if (layer.sheet) text += "sheet = 0.5\n";
    const bool flat = layer.genus == "Cu" || layer.genus == "Cb";
    text += "base_m = " + text_of(layer.base_m - cell / 2) +
            "\ntop_m = " + text_of(layer.base_m + levels * cell) + "\nsoft_base_m = " + text_of(cell / 4) +
            "\nsoft_top_m = " + text_of((flat ? 0.75 : 0.4) * depth) + "\nmargin_m = 0\n\n[layer.detail]\n" +
            look.detail;
    return text;
}

// By 600 m the wind is 1.6 times as strong and turned by 20 degrees, to the right north of the equator.
std::string wind_text(const Metar& m, const MetarSceneOptions& o, double time_s = 0) {
    std::string text = "\n[[wind]]\n";
    if (time_s > 0) text += "time_s = " + text_of(time_s) + "\n";
    text += "levels = [\n";
    const double turn = o.place && o.place->latitude_deg < 0 ? -20 : 20;
    double from = m.wind.from_deg;
    if (m.wind.variable) from = double(std::int64_t{o.seed} * 73 % 36) * 10;
    const auto level = [&](double height, double speed, double direction) {
        direction -= 360 * std::floor(direction / 360);
        text += "    { height_m = " + text_of(height) + ", from_deg = " + text_of(direction) +
                ", speed_m_per_s = " + text_of(speed) + " },\n";
    };
    const double speed = m.wind.speed_m_per_s;
    level(10, speed, from);
    level(600, 1.6 * speed, from + turn);
    return text + "]\n";
}

// The moment of a report's day, hour and minute: "2024-06-21T13:50:00Z".
std::string start_of(int of_month, int hour, int minute, const MetarSceneOptions& o) {
    const auto two = [](int n) { return (n < 10 ? "0" : "") + std::to_string(n); };
    std::string day = o.date;
    if (day.size() == 7) day += "-" + two(of_month);
    const std::string start = day + "T" + two(hour) + ":" + two(minute) + ":00Z";
    if (!utc_seconds(start) || (o.date.size() == 10 && o.date.substr(8) != two(of_month)))
        throw Error(ErrorCode::usage,
                    "--date '" + o.date + "' does not fit the report's day " + std::to_string(of_month) +
                        ": expected a month such as 2024-06, or that day of one, of the years 1900 to 2100");
    return start;
}

// The areas of rain as items of a list; `times` are further keys of each.
std::string rain_areas(const Precipitation& p, const std::string& times) {
    const std::string rate = ", intensity_mm_per_h = " + text_of(p.mm_per_h) + times + " },\n";
    if (!p.showers) return "    { x_m = 0, y_m = 0, semi_a_m = 9500, semi_b_m = 9500" + rate;
    return "    { x_m = 0, y_m = 0, semi_a_m = 2200, semi_b_m = 1700, yaw_deg = 20" + rate +
           "    { x_m = -5200, y_m = 4200, semi_a_m = 1800, semi_b_m = 1300, yaw_deg = 70" + rate +
           "    { x_m = 4600, y_m = 5600, semi_a_m = 1500, semi_b_m = 1400" + rate;
}

std::string lightning_text(double base_m) {
    return "\n[[lightning]]\nposition_m = [1500, 2500, " + text_of(base_m + 800) +
           "]\ntime_s = 600\nduration_s = 0.4\nintensity = 3\n";
}

// `name` is that of the layer.
std::string rain_text(const Precipitation& p, const std::string& name, double base_m,
                      const std::string& areas) {
    std::string text =
        "\n# The area that it falls in; its clouds are those of the other layers.\n[[sky]]\nname = "
        "\"none\"\nstate = 0\nclouds = 0\n\n[[layer]]\nname = \"" +
        name + "\"\nskies = \"none\"\nbase_height_m = " + text_of(std::max(100.0, base_m)) +
        "\nlattice = { cells = [20, 20, 3], cell_size_m = 1000, origin_m = [-10000, -10000, " +
        text_of(base_m) + "] }\nbackground = { hum = 0, act = 0, ext = 1 }\n[layer.rain]\nplaced = [\n" +
        areas;
    text += "]\n\n[precipitation]\nenabled = true\n";
    if (p.snow) text += "kind = \"snow\"\n";
    text += "\n[wet_ground]\nenabled = true\n";
    text += p.snow ? "initial_snow_mm = 2\n" : "initial_water_mm = 1\n";
    return text;
}

// The scene's head; `day` to `minute` are its start.
std::string head_text(const std::string& report, const std::string& station, int day, int hour, int minute,
                      const MetarSceneOptions& o, const std::string& time) {
    std::string text = "# SPDX-License-Identifier: Apache-2.0\n#\n# " + escaped(report) +
                       "\n#\n# The sky of this report. Heights are above the aerodrome, which is z = 0.\n\n";
    if (o.name.find_first_of("\"\\") != std::string::npos || escaped(o.name) != o.name)
        throw Error(ErrorCode::usage, "--name '" + o.name + "': expected letters, digits, `-`, `_` or `.`");
    text += "name = \"" + (o.name.empty() ? station : o.name) + "\"\nseed = " + std::to_string(o.seed) +
            "\n\n[time]\n" + time;
    if (o.place) {
        text += "\n[georeference]\nlatitude_deg = " + number_text(o.place->latitude_deg) +
                "\nlongitude_deg = " + number_text(o.place->longitude_deg) +
                "\nheight_m = " + number_text(o.place->elevation_m) + "\n";
        if (!o.date.empty()) text += "start_utc = \"" + start_of(day, hour, minute, o) + "\"\n";
    } else if (!o.date.empty()) {
        start_of(day, hour, minute, o);
    }
    return text;
}

constexpr const char* kClearLayer =
    "\n# No cloud: an empty layer, which gives the box its place.\n[[sky]]\nname = \"clear\"\nstate "
    "= 0\nclouds = 0\n\n[[layer]]\nname = \"clear\"\nskies = \"clear\"\nbase_height_m = 1000\n"
    "lattice = { cells = [20, 20, 3], cell_size_m = 1000, origin_m = [-10000, -10000, 1000] "
    "}\nbackground = { hum = 0, act = 0, ext = 1 }\n";

// What floats in the air and takes the view, but for fog and mist.
bool has_haze(const Metar& m) {
    constexpr std::string_view kDry[] = {"HZ", "FU", "DU", "SA", "VA"};
    return std::ranges::any_of(kDry,
                               [&](std::string_view phenomenon) { return has_phenomenon(m, phenomenon); });
}

std::string fog_text(const Metar& m) {
    int visibility = m.visibility_m.value_or(9999);
    double depth = has_phenomenon(m, "FG")   ? FogDepth::fog
                   : has_phenomenon(m, "BR") ? FogDepth::mist
                   : has_haze(m)             ? FogDepth::haze
                                             : FogDepth::other;
    for (const MetarCloud& c : m.clouds) {
        if (c.amount != CloudAmount::obscured) continue;
        if (c.height_ft && has_phenomenon(m, "FG"))
            depth = std::clamp(1.5 * *c.height_ft * kFoot_m, 20.0, FogDepth::mist);
        if (!m.visibility_m) visibility = 500;
    }
    if (visibility >= 9999) return {};
    return "\n# " + std::to_string(visibility) +
           " m of visibility: 3.912 / visibility\n[fog]\nextinction_per_m = " +
           number_text(kKoschmieder / std::max(visibility, 20), 6) + "\nheight_m = " + text_of(depth) + "\n";
}

std::string picture_text(const std::string& frames, double lowest_m) {
    return "\n[frames]\n" + frames + "\n[camera]\nposition_m = [0, -9000, 120]\ntarget_m = [0, 0, " +
           text_of(std::min(lowest_m, 2500.0)) +
           "]\nvertical_fov_deg = 60\nexposure = \"automatic\"\ntone_curve = \"neutral\"\nglare = "
           "0.1\n\n[atmosphere]\nmodel = \"physical\"\ncolours = \"spectral\"\n\n[ground]\npattern = "
           "\"country\"\n";
}

bool is_same(const MetarWind& a, const MetarWind& b) {
    return a.variable == b.variable && a.from_deg == b.from_deg && a.speed_m_per_s == b.speed_m_per_s;
}

}  // namespace

double cover_of(CloudAmount amount) {
    constexpr double kCovers[] = {0.19, 0.44, 0.75, 1, 1, 0};
    return kCovers[std::size_t(amount)];
}

std::vector<MetarLayer> layers_of(const Metar& m) {
    const bool rain = precipitation_of(m).any && !precipitation_of(m).showers;
    std::vector<MetarLayer> layers;
    std::vector<MetarCloud> clouds = m.clouds;
    std::ranges::stable_sort(clouds, {}, [](const MetarCloud& c) { return c.height_ft.value_or(0); });
    for (const MetarCloud& c : clouds) {
        if (c.amount == CloudAmount::unknown || !c.height_ft) continue;
        const bool obscured = c.amount == CloudAmount::obscured;
        const Genus genus = obscured ? Genus{"VV", 300} : genus_of(c, rain);
        MetarLayer layer;
        layer.genus = genus.name;
        layer.name = layer.genus + std::to_string(layers.size() + 1);
        layer.base_m = std::max(30.0, *c.height_ft * kFoot_m);
        layer.top_m = layer.base_m + genus.depth_m;
        layer.cover = obscured ? 1 : cover_of(c.amount);
        layer.sheet = obscured || c.amount == CloudAmount::overcast;
        const std::string height = std::to_string(*c.height_ft / 100);
        layer.group = std::string(amount_text(c.amount)) +
                      std::string(3 - std::min<std::size_t>(3, height.size()), '0') + height + c.type;
        layers.push_back(layer);
    }
    return layers;
}

std::string metar_scene_text(const Metar& m, const MetarSceneOptions& o,
                             const std::vector<double>& coverage) {
    const std::vector<MetarLayer> layers = layers_of(m);
    const Precipitation p = precipitation_of(m);
    std::string text = head_text(m.text, m.station, m.day, m.hour, m.minute, o, "step_s = 10\nsteps = 90\n") +
                       wind_text(m, o);
    double lowest = 1000;
    for (std::size_t n = 0; n < layers.size(); ++n) {
        text += layer_text(layers[n], coverage.at(n));
        lowest = std::min(lowest, layers[n].base_m);
    }
    if (layers.empty()) text += kClearLayer;
    if (p.any) text += rain_text(p, p.code, lowest, rain_areas(p, {}));
    if (has_descriptor(m, "TS")) text += lightning_text(lowest);
    text += "\n[density]\nextinction_per_m = 0.05\n" + fog_text(m);
    return text + picture_text("start_s = 600\ntime_scale = 60\nper_second = 12\ncount = 12\n", lowest);
}

std::vector<TafLayer> layers_of(const Taf& taf) {
    std::vector<TafLayer> layers;
    for (std::size_t n = 0; n < taf.periods.size(); ++n) {
        for (const MetarLayer& layer : layers_of(taf.periods[n].weather)) {
            auto known = std::ranges::find_if(layers, [&](const TafLayer& l) {
                return l.layer.group == layer.group && l.layer.genus == layer.genus;
            });
            if (known == layers.end()) {
                layers.push_back({layer, std::vector<bool>(taf.periods.size())});
                known = layers.end() - 1;
            }
            known->present[n] = true;
        }
    }
    std::ranges::stable_sort(layers, {}, [](const TafLayer& l) { return l.layer.base_m; });
    for (std::size_t n = 0; n < layers.size(); ++n)
        layers[n].layer.name = layers[n].layer.genus + std::to_string(n + 1);
    return layers;
}

namespace {

// States of the climate are the periods of a forecast, evenly from 0 to 1.
std::string state_text(const Taf& taf, std::size_t period) {
    return number_text(taf.periods.size() > 1 ? double(period) / double(taf.periods.size() - 1) : 0, 6);
}

std::string schedule_text(const Taf& taf) {
    if (taf.periods.size() == 1) return {};
    std::string text = "\n[climate]\nschedule = [\n";
    for (std::size_t n = 1; n < taf.periods.size(); ++n) {
        const TafPeriod& period = taf.periods[n];
        // Where one change follows another at once the state is that of its end already.
        if (n == 1 || period.from_s > taf.periods[n - 1].until_s)
            text += "    { time_s = " + text_of(period.from_s) + ", state = " + state_text(taf, n - 1) + " },\n";
        text += "    { time_s = " + text_of(period.until_s) + ", state = " + state_text(taf, n) +
                " },  # " + period.change + "\n";
    }
    return text + "]\n";
}

std::string winds_text(const Taf& taf, const MetarSceneOptions& o) {
    std::string text = wind_text(taf.periods.front().weather, o);
    double last_s = 0;
    for (std::size_t n = 1; n < taf.periods.size(); ++n) {
        const TafPeriod &before = taf.periods[n - 1], &period = taf.periods[n];
        if (is_same(period.weather.wind, before.weather.wind)) continue;
        if (period.from_s > last_s) text += wind_text(before.weather, o, period.from_s);
        text += wind_text(period.weather, o, period.until_s);
        last_s = period.until_s;
    }
    return text;
}

std::string presence_text(const Taf& taf, const TafLayer& layer) {
    if (std::ranges::all_of(layer.present, [](bool there) { return there; })) return {};
    std::string text;
    for (std::size_t n = 0; n < layer.present.size(); ++n)
        text += (n > 0 ? ", { state = " : "presence = [{ state = ") + state_text(taf, n) +
                ", fraction = " + (layer.present[n] ? "1" : "0") + " }";
    return text + "]\n";
}

// Rain of all periods, which begins and ends as they do.
std::string rain_of_periods(const Taf& taf, double base_m, double step_s) {
    std::string areas;
    Precipitation all;
    bool thunder = false;
    for (std::size_t n = 0; n < taf.periods.size(); ++n) {
        const TafPeriod& period = taf.periods[n];
        const Precipitation p = precipitation_of(period.weather);
        thunder = thunder || has_descriptor(period.weather, "TS");
        if (!p.any) continue;
        all.any = true;
        all.snow = all.snow || p.snow;
        const double end_s = n + 1 < taf.periods.size() ? taf.periods[n + 1].until_s : taf.length_s + step_s;
        const double fade_s =
            std::min(std::max(step_s, period.until_s - period.from_s), (end_s - period.from_s) / 2);
        areas += rain_areas(p, ", start_s = " + text_of(period.from_s) + ", end_s = " + text_of(end_s) +
                                   ", fade_s = " + text_of(fade_s));
    }
    std::string text;
    if (all.any) text += rain_text(all, "precipitation", base_m, areas);
    if (thunder) text += lightning_text(base_m);
    return text;
}

}  // namespace

std::string taf_scene_text(const Taf& taf, const MetarSceneOptions& o, const std::vector<double>& coverage) {
    constexpr double kStep_s = 300;
    const std::vector<TafLayer> layers = layers_of(taf);
    std::string text = head_text(taf.text, taf.station, taf.day, taf.hour, 0, o,
                                 "step_s = " + text_of(kStep_s) + "\nsteps = " +
                                     std::to_string(int(std::ceil(taf.length_s / kStep_s))) + "\n");
    text += schedule_text(taf) + winds_text(taf, o);
    double lowest = 1000;
    for (std::size_t n = 0; n < layers.size(); ++n) {
        text += layer_text(layers[n].layer, coverage.at(n), presence_text(taf, layers[n]));
        lowest = std::min(lowest, layers[n].layer.base_m);
    }
    if (layers.empty()) text += kClearLayer;
    text += rain_of_periods(taf, lowest, kStep_s);
    text += "\n[density]\nextinction_per_m = 0.05\n" + fog_text(taf.periods.front().weather);
    return text +
           picture_text("time_scale = 3600\nper_second = 12\n", lowest);  // an hour is a second of film
}

std::vector<std::string> metar_notes(const Metar& m, const MetarSceneOptions& o) {
    std::vector<std::string> notes = m.warnings;
    if (o.date.empty() || !o.place)
        notes.push_back("the sun is not that of the report: it takes --date and --at");
    for (const MetarGroup& group : m.groups)
        if (!group.used) notes.push_back("`" + group.text + "` (" + group.meaning + ") is not in the scene");
    if (m.wind.known && m.wind.variable && m.wind.speed_m_per_s > 0)
        notes.push_back("the wind's direction follows from the seed");
    if (m.wind.gust_m_per_s) notes.push_back("gusts are not simulated");
    const std::string strongest = precipitation_of(m).code;
    for (const MetarWeather& w : m.weather) {
        if (w.vicinity) continue;
        const std::string code = falling(w);
        if (!code.empty() && code != strongest)
            notes.push_back("of what falls " + strongest + " alone is in the scene, not " + code);
        for (const std::string& phenomenon : w.phenomena) {
            if (code.find(phenomenon) != code.npos) continue;
            const bool plain = w.descriptor.empty();
            if (plain && (phenomenon == "FG" || phenomenon == "BR" || phenomenon == "HZ")) continue;
            if (phenomenon == "FG")
                notes.push_back(w.descriptor + "FG is in the scene as fog everywhere");
            else if (plain &&
                     (phenomenon == "FU" || phenomenon == "DU" || phenomenon == "SA" || phenomenon == "VA"))
                notes.push_back(phenomenon + " is in the scene as haze");
            else
                notes.push_back(w.descriptor + phenomenon + " is not in the scene");
        }
    }
    if (m.temperature_c && m.dew_point_c) {
        const double expected = 125.0 * (*m.temperature_c - *m.dew_point_c);
        for (const MetarLayer& layer : layers_of(m)) {
            if (layer.genus == "Cu" && std::abs(layer.base_m - expected) > 300) {
                notes.push_back("cumulus at " + text_of(layer.base_m) +
                                " m does not fit temperature and dew point, from which a base at " +
                                text_of(expected) + " m follows");
                break;
            }
        }
    }
    return notes;
}

}  // namespace nephos
