// SPDX-License-Identifier: Apache-2.0
#include "scenes/metar/scene_parts.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/error.h"
#include "core/place.h"
#include "core/text.h"
#include "scenes/metar/report_words.h"

namespace nephos {
namespace {

constexpr double kSide_m = 20'000;      // of the clouds' box, which stands around the aerodrome
constexpr double kDeep_m = 2000;        // deeper layers have coarser cells
constexpr double kKoschmieder = 3.912;  // -ln 0.02: contrast that an eye still sees

bool has_phenomenon(const Metar& m, std::string_view phenomenon) {
    return std::ranges::any_of(m.weather, [&](const MetarWeather& w) {
        return !w.vicinity && std::ranges::find(w.phenomena, phenomenon) != w.phenomena.end();
    });
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

// The moment of a report's day, hour and minute: "2024-06-21T13:50:00Z".
std::string start_of(int of_month, int hour, int minute, const MetarSceneOptions& o) {
    std::string day = o.date;
    if (day.size() == 7) day += "-" + padded(of_month, 2);
    const std::string start = day + "T" + padded(hour, 2) + ":" + padded(minute, 2) + ":00Z";
    if (!utc_seconds(start) || (o.date.size() == 10 && o.date.substr(8) != padded(of_month, 2)))
        throw Error(ErrorCode::usage,
                    "--date '" + o.date + "' does not fit the report's day " + std::to_string(of_month) +
                        ": expected a month such as 2024-06, or that day of one, of the years 1900 to 2100");
    return start;
}

// Tells whether something floats in the air that takes the view, but for fog and mist.
bool has_haze(const Metar& m) {
    constexpr std::string_view kDry[] = {"HZ", "FU", "DU", "SA", "VA"};
    return std::ranges::any_of(kDry,
                               [&](std::string_view phenomenon) { return has_phenomenon(m, phenomenon); });
}

}  // namespace

std::string rounded_text(double value) { return number_text(std::round(value * 1000) / 1000); }

bool has_descriptor(const Metar& m, std::string_view descriptor) {
    return std::ranges::any_of(
        m.weather, [&](const MetarWeather& w) { return !w.vicinity && w.descriptor == descriptor; });
}

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
        if (!(rate > p.mm_per_h)) continue;
        p.mm_per_h = rate;
        p.code = code;
        p.snow = code.find("SN") != code.npos || code.find("SG") != code.npos;
        p.showers = w.descriptor == "SH" || w.descriptor == "TS";
    }
    return p;
}

std::vector<std::string> left_out(const Metar& m, bool with_fog) {
    std::vector<std::string> notes = m.warnings;
    for (const MetarGroup& group : m.groups)
        if (!group.used) notes.push_back("`" + group.text + "` (" + group.meaning + ") is not in the scene");
    if (std::ranges::any_of(m.clouds, [](const MetarCloud& cloud) {
            return cloud.amount == CloudAmount::obscured && !cloud.height_ft;
        }))
        notes.push_back("VV///: no layer is in the scene, as no height is told");
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
            const bool haze =
                phenomenon == "FU" || phenomenon == "DU" || phenomenon == "SA" || phenomenon == "VA";
            const bool lessens =
                phenomenon == "FG" || (plain && (phenomenon == "BR" || phenomenon == "HZ" || haze));
            if (lessens && !with_fog) continue;
            if (lessens && fog_text(m).empty())
                notes.push_back(w.descriptor + phenomenon +
                                " is not in the scene, as the visibility is not lessened");
            else if (phenomenon == "FG" && !plain)
                notes.push_back(w.descriptor + "FG is in the scene as fog everywhere");
            else if (plain && haze)
                notes.push_back(phenomenon + " is in the scene as haze");
            else if (!lessens)
                notes.push_back(w.descriptor + phenomenon + " is not in the scene");
        }
    }
    return notes;
}

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

std::string layer_text(const MetarLayer& layer, double coverage, bool detail, const std::string& keys) {
    const double depth = layer.top_m - layer.base_m;
    const Look look = look_of(layer.genus, depth > kDeep_m);
    const double cell = depth > kDeep_m ? 160 : look.cell_m;
    const int across = int(std::lround(kSide_m / cell)), levels = std::max(3, int(std::ceil(depth / cell)));
    std::string text = "\n# " + layer.group + "\n[[layer]]\nname = \"" + layer.name + "\"\n";
    if (look.opacity != 1) text += "opacity = " + rounded_text(look.opacity) + "\n";
    text += keys + "lattice = { cells = [" + std::to_string(across) + ", " + std::to_string(across) + ", " +
            std::to_string(levels) + "], cell_size_m = " + rounded_text(cell) + ", origin_m = [" +
            rounded_text(-kSide_m / 2) + ", " + rounded_text(-kSide_m / 2) + ", " +
            rounded_text(layer.base_m) + "] }\n\n[layer.veil]\n";
    text += std::string(look.veil) + "coverage = " + number_text(coverage) + "\n";
    if (layer.sheet) text += "sheet = 0.5\n";
    const bool flat = layer.genus == "Cu" || layer.genus == "Cb";
    text += "base_m = " + rounded_text(layer.base_m - cell / 2) +
            "\ntop_m = " + rounded_text(layer.base_m + levels * cell) +
            "\nsoft_base_m = " + rounded_text(cell / 4) +
            "\nsoft_top_m = " + rounded_text((flat ? 0.75 : 0.4) * depth) +
            "\nmargin_m = 0\n\n[layer.detail]\n";
    return text + (detail ? look.detail : "enabled = false\n");
}

std::string clear_layer_text() {
    return "\n# No cloud: an empty layer, which gives the box its place.\n[[sky]]\nname = \"clear\"\nstate "
           "= 0\nclouds = 0\n\n[[layer]]\nname = \"clear\"\nskies = \"clear\"\nbase_height_m = 1000\n"
           "lattice = { cells = [20, 20, 3], cell_size_m = 1000, origin_m = [-10000, -10000, 1000] "
           "}\nbackground = { hum = 0, act = 0, ext = 1 }\n";
}

// By 600 m the wind is 1.6 times as strong and turned by 20 degrees, to the right north of the equator.
std::string wind_text(const Metar& m, const MetarSceneOptions& o, double time_s) {
    std::string text = "\n[[wind]]\n";
    if (time_s > 0) text += "time_s = " + rounded_text(time_s) + "\n";
    text += "levels = [\n";
    const double turn = o.place && o.place->latitude_deg < 0 ? -20 : 20;
    double from = m.wind.from_deg;
    if (m.wind.variable) from = double(std::int64_t{o.seed} * 73 % 36) * 10;
    const auto level = [&](double height, double speed, double direction) {
        direction -= 360 * std::floor(direction / 360);
        text += "    { height_m = " + rounded_text(height) + ", from_deg = " + rounded_text(direction) +
                ", speed_m_per_s = " + rounded_text(speed) + " },\n";
    };
    const double speed = m.wind.speed_m_per_s;
    level(10, speed, from);
    level(600, 1.6 * speed, from + turn);
    return text + "]\n";
}

std::string rain_areas(const Precipitation& p, const std::string& times) {
    const std::string rate = ", intensity_mm_per_h = " + rounded_text(p.mm_per_h) + times + " },\n";
    if (!p.showers) return "    { x_m = 0, y_m = 0, semi_a_m = 9500, semi_b_m = 9500" + rate;
    return "    { x_m = 0, y_m = 0, semi_a_m = 2200, semi_b_m = 1700, yaw_deg = 20" + rate +
           "    { x_m = -5200, y_m = 4200, semi_a_m = 1800, semi_b_m = 1300, yaw_deg = 70" + rate +
           "    { x_m = 4600, y_m = 5600, semi_a_m = 1500, semi_b_m = 1400" + rate;
}

std::string lightning_text(double base_m, double time_s) {
    return "\n[[lightning]]\nposition_m = [1500, 2500, " + rounded_text(base_m + 800) +
           "]\ntime_s = " + rounded_text(time_s) + "\nduration_s = 0.4\nintensity = 3\n";
}

std::string rain_sky_text() {
    return "\n# The area that it falls in; its clouds are those of the other layers.\n[[sky]]\nname = "
           "\"none\"\nstate = 0\nclouds = 0\n";
}

std::string rain_layer_text(const std::string& name, double base_m, const std::string& areas) {
    return "\n[[layer]]\nname = \"" + name +
           "\"\nskies = \"none\"\nbase_height_m = " + rounded_text(std::max(100.0, base_m)) +
           "\nlattice = { cells = [20, 20, 3], cell_size_m = 1000, origin_m = [-10000, -10000, " +
           rounded_text(base_m) +
           "] }\nbackground = { hum = 0, act = 0, ext = 1 }\ndetail = { enabled = false "
           "}\n[layer.rain]\nplaced = [\n" +
           areas + "]\n";
}

std::string falling_text(bool snow, bool initial) {
    std::string text = "\n[precipitation]\nenabled = true\n";
    if (snow) text += "kind = \"snow\"\n";
    text += "\n[wet_ground]\nenabled = true\n";
    if (initial) text += snow ? "initial_snow_mm = 2\n" : "initial_water_mm = 1\n";
    return text;
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
            depth = std::clamp(1.5 * *c.height_ft * kFoot, 20.0, FogDepth::mist);
        if (!m.visibility_m) visibility = 500;
    }
    if (visibility >= 9999) return {};
    return "\n# " + std::to_string(visibility) +
           " m of visibility: 3.912 / visibility\n[fog]\nextinction_per_m = " +
           number_text(kKoschmieder / std::max(visibility, 20), 6) + "\nheight_m = " + rounded_text(depth) +
           "\n";
}

std::string picture_text(const std::string& frames, double lowest_m) {
    return "\n[frames]\n" + frames + "\n[camera]\nposition_m = [0, -9000, 120]\ntarget_m = [0, 0, " +
           rounded_text(std::min(lowest_m, 2500.0)) +
           "]\nvertical_fov_deg = 60\nexposure = \"automatic\"\ntone_curve = \"neutral\"\nglare = "
           "0.1\n\n[atmosphere]\nmodel = \"physical\"\ncolours = \"spectral\"\n\n[ground]\npattern = "
           "\"country\"\n";
}

}  // namespace nephos
