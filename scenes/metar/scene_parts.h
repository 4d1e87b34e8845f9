// SPDX-License-Identifier: Apache-2.0
#pragma once

// Makes the pieces of which scenes of reports and of forecasts are made: their text (TOML), each with its heads. Pure.

#include <string>
#include <string_view>
#include <vector>

#include "scenes/metar/metar_scene.h"
#include "scenes/metar/taf.h"

namespace nephos {

// Tells what falls: the strongest of the groups.
struct Precipitation {
    bool any = false, snow = false, showers = false;
    double mm_per_h = 0;
    std::string code;  // as reports write it, without intensity
    bool operator==(const Precipitation&) const = default;
};
Precipitation precipitation_of(const Metar& metar);

// Returns what falls of a group, without intensity, SH and TS; "" of the others, blowing snow too.
std::string falling(const MetarWeather& weather);

// Returns how many layers of rain a forecast's scene has: one of each kind.
std::size_t kinds_of_rain(const Taf& taf);

bool has_descriptor(const Metar& metar,
                    std::string_view descriptor);  // in a group that is not of the vicinity

// Returns what groups say that a scene leaves out, a sentence each; without fog, mist and haze where the scene has not those of
// this weather.
std::vector<std::string> left_out(const Metar& metar, bool with_fog = true);

// Returns a number with at most three decimals.
std::string rounded_text(double value);

// The scene's head; `day` to `minute` are its start, with MetarSceneOptions::date. Throws Error(usage) where they do not fit.
std::string head_text(const std::string& report, const std::string& station, int day, int hour, int minute,
                      const MetarSceneOptions& options, const std::string& time);

// `keys` are further ones of the layer, a line each.
std::string layer_text(const MetarLayer& layer, double coverage, bool detail = true,
                       const std::string& keys = {});
std::string clear_layer_text();  // an empty one, which gives a scene without clouds its place

std::string wind_text(const Metar& metar, const MetarSceneOptions& options, double time_s = 0);

// The areas of rain as items of a list; `times` are further keys of each.
std::string rain_areas(const Precipitation& precipitation, const std::string& times);
// A layer that it falls in, with rain_areas(); `base_m` is that of the lowest cloud. All share one empty sky.
std::string rain_sky_text();
std::string rain_layer_text(const std::string& name, double base_m, const std::string& areas);
// Says how it is drawn; `initial`: it has fallen before the scene begins.
std::string falling_text(bool snow, bool initial);

// A flash above a cloud's base.
std::string lightning_text(double base_m, double time_s);

std::string fog_text(const Metar& metar);  // "" where the view is not lessened
std::string picture_text(const std::string& frames, double lowest_m);

}  // namespace nephos
