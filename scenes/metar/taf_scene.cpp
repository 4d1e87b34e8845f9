// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include "core/text.h"
#include "scenes/metar/scene_parts.h"
#include "scenes/metar/taf.h"

namespace nephos {
namespace {

constexpr double kStep_s = 300;  // of the simulation, and from frame to frame
constexpr double kHour_s = 3600;

bool is_same(const MetarWind& a, const MetarWind& b) {
    return a.variable == b.variable && a.from_deg == b.from_deg && a.speed_m_per_s == b.speed_m_per_s;
}

// A time in which the weather is wholly that of a period, or of several.
struct Stretch {
    double begin_s, end_s;
};

Stretch full_stretch(const Taf& taf, std::size_t first, std::size_t end) {
    const double begin_s = first == 0 ? 0 : taf.periods[first].until_s;
    const double end_s = end < taf.periods.size() ? taf.periods[end].from_s : taf.length_s;
    return {begin_s, std::max(begin_s, end_s)};
}

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
            text += "    { time_s = " + rounded_text(period.from_s) + ", state = " + state_text(taf, n - 1) +
                    " },\n";
        text += "    { time_s = " + rounded_text(period.until_s) + ", state = " + state_text(taf, n) +
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

// The same falls in the periods from `first` on and before `end`.
struct RainStretch {
    Precipitation what;
    std::size_t first, end;
};

std::vector<RainStretch> rain_of(const Taf& taf) {
    std::vector<RainStretch> stretches;
    for (std::size_t n = 0; n < taf.periods.size(); ++n) {
        const Precipitation p = precipitation_of(taf.periods[n].weather);
        if (!p.any) continue;
        if (!stretches.empty() && stretches.back().end == n && stretches.back().what == p)
            ++stretches.back().end;
        else
            stretches.push_back({p, n, n + 1});
    }
    return stretches;
}

// Keys of an area's time. What begins with a change does so in its first half, and what ends with one in its second half, so that
// of two kinds that follow each other one is there at any moment, and outside of changes all of it.
std::string times_text(const Taf& taf, const RainStretch& rain) {
    const bool begins = rain.first > 0, ends = rain.end < taf.periods.size();
    const auto half_s = [&](std::size_t n) { return (taf.periods[n].until_s - taf.periods[n].from_s) / 2; };
    if (!begins && !ends) return {};
    const double fade_s = !ends     ? half_s(rain.first)
                          : !begins ? half_s(rain.end)
                                    : std::min(half_s(rain.first), half_s(rain.end));
    std::string text = ", start_s = " + rounded_text(begins ? taf.periods[rain.first].from_s : -fade_s);
    if (ends) text += ", end_s = " + rounded_text(taf.periods[rain.end].until_s);
    return text + ", fade_s = " + rounded_text(fade_s);
}

// Tells what falls in all, and that it is drawn as the one of which more falls.
struct Falling {
    bool rain = false, snow = false, drawn_as_snow = false;
};

Falling falling_of(const Taf& taf) {
    Falling falling;
    double rain_mm = 0, snow_mm = 0;
    for (const RainStretch& stretch : rain_of(taf)) {
        const Stretch full = full_stretch(taf, stretch.first, stretch.end);
        const double mm = stretch.what.mm_per_h * (full.end_s - full.begin_s + kStep_s) / kHour_s;
        (stretch.what.snow ? falling.snow : falling.rain) = true;
        (stretch.what.snow ? snow_mm : rain_mm) += mm;
    }
    falling.drawn_as_snow = snow_mm > rain_mm;
    return falling;
}

std::string rain_text(const Taf& taf, double base_m) {
    std::map<std::string, std::string> areas;  // by what falls
    for (const RainStretch& rain : rain_of(taf))
        areas[rain.what.code] += rain_areas(rain.what, times_text(taf, rain));
    if (areas.empty()) return {};
    std::string text = rain_sky_text();
    for (const auto& [code, list] : areas) text += rain_layer_text(code, base_m, list);
    const Precipitation first = precipitation_of(taf.periods.front().weather);
    const bool snow = falling_of(taf).drawn_as_snow;
    return text + falling_text(snow, first.any && first.snow == snow);
}

// The base of the cloud that lightning comes from: a cumulonimbus, or the lowest.
double thundery_base_m(const Metar& weather) {
    const std::vector<MetarLayer> layers = layers_of(weather);
    const auto tower = std::ranges::find(layers, "Cb", &MetarLayer::genus);
    if (layers.empty()) return 1000;
    return (tower != layers.end() ? *tower : layers.front()).base_m;
}

// Flashes on frames, less than an hour apart, as long as there is thunder: none of its moments is half an hour from one.
std::string flashes_text(const Taf& taf) {
    constexpr double kApart_s = 3000;
    const auto thunders = [&](std::size_t n) {
        return n < taf.periods.size() && has_descriptor(taf.periods[n].weather, "TS");
    };
    std::string text;
    for (std::size_t first = 0; first < taf.periods.size(); ++first) {
        if (!thunders(first)) continue;
        std::size_t end = first + 1;
        while (thunders(end)) ++end;
        const Stretch full = full_stretch(taf, first, end);
        const double length_s = full.end_s - full.begin_s;
        const int count = std::max(1, int(std::ceil(length_s / kApart_s)));
        for (int k = 0; k < count; ++k) {
            const double time_s =
                kStep_s * std::round((full.begin_s + (k + 0.5) / count * length_s) / kStep_s);
            if (time_s > taf.length_s) continue;
            std::size_t period = first;
            while (period + 1 < end && taf.periods[period + 1].from_s <= time_s) ++period;
            text += lightning_text(thundery_base_m(taf.periods[period].weather), time_s);
        }
        first = end;
    }
    return text;
}

}  // namespace

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

std::size_t kinds_of_rain(const Taf& taf) {
    std::vector<std::string> codes;
    for (const RainStretch& rain : rain_of(taf))
        if (std::ranges::find(codes, rain.what.code) == codes.end()) codes.push_back(rain.what.code);
    return codes.size();
}

std::vector<double> moments_of(const Taf& taf, const TafLayer& layer, int count) {
    std::vector<Stretch> stretches;
    double whole_s = 0;
    for (std::size_t n = 0; n < layer.present.size();) {
        std::size_t end = n;
        while (end < layer.present.size() && layer.present[end]) ++end;
        if (end > n) {
            stretches.push_back(full_stretch(taf, n, end));
            whole_s += stretches.back().end_s - stretches.back().begin_s;
        }
        n = std::max(end, n + 1);
    }
    if (!(whole_s > 0)) return {stretches.front().begin_s};
    std::vector<double> moments;
    for (int k = 0; k < count; ++k) {
        double after_s = (k + 0.5) / count * whole_s;
        auto stretch = stretches.begin();
        for (; stretch + 1 != stretches.end() && after_s > stretch->end_s - stretch->begin_s; ++stretch)
            after_s -= stretch->end_s - stretch->begin_s;
        moments.push_back(stretch->begin_s + after_s);
    }
    return moments;
}

std::string taf_scene_text(const Taf& taf, const MetarSceneOptions& o, const std::vector<double>& coverage) {
    const std::vector<TafLayer> layers = layers_of(taf);
    MetarSceneOptions dated = o;
    dated.date = taf.date;
    std::string text = head_text(taf.text, taf.station, taf.day, taf.hour, 0, dated,
                                 "step_s = " + rounded_text(kStep_s) + "\nsteps = " +
                                     std::to_string(int(std::ceil(taf.length_s / kStep_s))) + "\n");
    text += schedule_text(taf) + winds_text(taf, o);
    double lowest = 1000;
    for (std::size_t n = 0; n < layers.size(); ++n) {
        text += layer_text(layers[n].layer, coverage.at(n), n < kMostDetailedTafLayers,
                           presence_text(taf, layers[n]));
        lowest = std::min(lowest, layers[n].layer.base_m);
    }
    if (layers.empty()) text += clear_layer_text();
    text += rain_text(taf, lowest) + flashes_text(taf);
    text += "\n[density]\nextinction_per_m = 0.05\n" + fog_text(taf.periods.front().weather);
    return text +
           picture_text("time_scale = 3600\nper_second = 12\n", lowest);  // an hour is a second of film
}

std::vector<std::string> taf_notes(const Taf& taf, const MetarSceneOptions& options) {
    std::vector<std::string> notes;
    if (taf.date.empty() || !options.place)
        notes.push_back("the sun is not that of the forecast: it takes --date and --at");
    const std::string fog = fog_text(taf.periods.front().weather);
    if (std::ranges::any_of(taf.periods, [&](const TafPeriod& p) { return fog_text(p.weather) != fog; }))
        notes.push_back(
            "visibility, fog, mist or haze that changes is not in the scene: it is that of the beginning");
    if (const Falling falling = falling_of(taf); falling.rain && falling.snow)
        notes.push_back(std::string("rain and snow fall: all of it is drawn as ") +
                        (falling.drawn_as_snow ? "snow" : "rain") + ", of which more falls");
    if (layers_of(taf).size() > kMostDetailedTafLayers)
        notes.push_back("the lowest " + std::to_string(kMostDetailedTafLayers) +
                        " layers alone have fine detail, as scenes have room for no more");
    notes.insert(notes.end(), taf.notes.begin(), taf.notes.end());
    return notes;
}

}  // namespace nephos
