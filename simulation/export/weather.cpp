// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/weather.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "density/vdb/vdb_file.h"
#include "scenes/format/given_keys.h"
#include "scenes/metar/metar.h"
#include "scenes/metar/metar_scene.h"
#include "seeds/genera.h"
#include "simulation/export/sequence.h"
#include "simulation/scene_place.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kKoschmieder = 3.912, kSurface_m = 10;
constexpr double kThunder_s = 1800;  // from a flash on, and to it
// Cumulus is towering (TCU) from this depth on, the uppermost 5 % of its mass left out.
constexpr double kTowering_m = 1200;

double speed_of(const Velocity& v) { return std::hypot(v.east_m_per_s, v.north_m_per_s); }

LayerSummary summary_of(const RunListing& run, const std::string& name, const DensityGrid& density,
                        const Wind& wind, double time_s) {
    LayerSummary s;
    s.name = name;
    s.columns = optical_columns(density, run.scene.density.extinction_per_m);
    s.oktas = 8 * s.columns.cover;
    const bool any = s.columns.cover > 0;
    const double base = any ? s.columns.cloud_base_m : density.placement().origin_m.z;
    s.transition_m = any ? std::max(0.0, 0.5 * (s.columns.base_m - base)) : 0;
    const Velocity v = wind_at(wind, base, time_s);
    s.wind_m_per_s = speed_of(v);
    s.wind_from_deg = bearing_from(v, run.scene.georeference.given ? run.scene.georeference.heading_deg : 0);
    return s;
}

WeatherRegion region_of(const Scene& scene) {
    const WorldRectangle world = whole_world(scene);
    const Georeference& at = scene.georeference;
    const GeodeticPlace centre =
        geodetic_place(at, {(world.min_x_m + world.max_x_m) / 2, (world.min_y_m + world.max_y_m) / 2, 0});
    return {centre.latitude_deg, centre.longitude_deg, world.max_x_m - world.min_x_m,
            world.max_y_m - world.min_y_m, at.heading_deg};
}

Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(); }

}  // namespace

std::string genus_of(const Scene& scene, std::size_t n) {
    const LayerOptions& layer = scene.layers.at(n);
    // "Cu", "Cu1", "Cu-2": a name that is an abbreviation, and perhaps a number.
    const auto of_name = [](const std::string& name) -> std::string {
        static constexpr const char* kGenera[] = {"Ci", "Cc", "Cs", "Ac", "As", "Ns",
                                                  "Sc", "St", "Cu", "Cb", "VV"};
        for (const char* genus : kGenera)
            if (name.starts_with(genus) && name.find_first_not_of("0123456789-_ ", 2) == name.npos)
                return genus;
        return {};
    };
    if (const std::string genus = given_genus(scene, n); !genus.empty()) return genus.substr(0, 2);
    if (std::string genus = of_name(layer.name); !genus.empty()) return genus;
    if (layer.is_veil) {
        switch (layer.veil.form) {
            case VeilForm::cumulus:
                return "Cu";
            case VeilForm::stratus:
                return "St";
            case VeilForm::cirrus:
                return "Ci";
            case VeilForm::cirrostratus:
                return "Cs";
        }
    }
    for (const NamedSky& sky : scene.skies) {
        if (std::ranges::count(layer.skies, sky.name) == 0) continue;
        for (const std::string& name : sky.models) {
            const auto model = std::ranges::find(scene.models, name, &BaseModel::name);
            if (model != scene.models.end() && model->genus)
                return std::string(facts_of(*model->genus).abbreviation.substr(0, 2));  // "St" of "St fra"
            if (std::string genus = of_name(name); !genus.empty()) return genus;
        }
    }
    return {};
}

double bearing_from(const Velocity& v, double heading_deg) {
    const double degrees =
        std::atan2(-v.east_m_per_s, -v.north_m_per_s) * 180 / std::numbers::pi + heading_deg;
    return degrees - 360 * std::floor(degrees / 360);
}

namespace {

// Reads a density file as the manifest lists it; notes that it is not.
DensityGrid listed_density(const RunListing& run, const ListedFrame& frame,
                           const std::optional<std::string>& layer, std::vector<std::string>& notes) {
    const SourceFrame source = frame_of_run(run, frame, layer);
    DensityGrid density = read_density(source.file);
    if (source.listed) {
        if (std::string note = damage_note(source, file_digest(source.file)); !note.empty())
            notes.push_back(std::move(note));
    }
    require_unchanged(source);
    return density;
}

// Returns whether it rains all over the box of an area's layer, as steady rain does, two of which overlap in a change.
bool is_over_its_box(const Scene& scene, const RainRecord& area) {
    const auto layer = std::ranges::find(scene.layers, area.layer, &LayerOptions::name);
    if (layer == scene.layers.end()) return false;
    const double side_m = layer->placement.cell_size_m * std::max(layer->extent.x, layer->extent.y);
    return std::min(area.semi_a_m, area.semi_b_m) >= 0.45 * side_m;
}

}  // namespace

WeatherSummary summarise(const RunListing& run, const ListedFrame& frame, std::vector<std::string>& notes) {
    const Scene& scene = run.scene;
    WeatherSummary w;
    w.number = frame.number;
    w.time_s = frame.time_s;
    w.utc = utc_at(scene.georeference, frame.time_s);
    w.elevation_m = msl_height_m(scene.georeference);
    const double heading = scene.georeference.given ? scene.georeference.heading_deg : 0;
    w.heading_deg = heading;
    if (scene.georeference.given) w.region = region_of(scene);
    // Fresh snow has a tenth of the density of water.
    if (scene.ground_cover.enabled) w.snow_depth_m = scene.ground_cover.initial_snow_mm / 100;
    if (scene.layers.empty()) {
        w.layers.push_back(summary_of(run, scene.name, listed_density(run, frame, {}, notes),
                                      scene.automaton.wind, frame.time_s));
    }
    for (std::size_t n = 0; n < scene.layers.size(); ++n) {
        if (!has_density(scene.layers[n])) continue;
        LayerSummary s =
            summary_of(run, scene.layers[n].name, listed_density(run, frame, scene.layers[n].name, notes),
                       layer_wind(scene, n), frame.time_s);
        s.genus = genus_of(scene, n);
        s.towering = s.genus == "Cu" && s.columns.top_m - s.columns.cloud_base_m > kTowering_m;
        for (const RainRecord& area : frame.rain)
            if (area.layer == s.name) s.rain_mm_per_h = std::max(s.rain_mm_per_h, area.intensity_mm_per_h);
        w.layers.push_back(std::move(s));
    }
    std::erase_if(w.layers, [](const LayerSummary& s) { return !(s.columns.cover > 0); });
    std::ranges::stable_sort(w.layers, {}, [](const LayerSummary& s) { return s.columns.cloud_base_m; });
    for (const WindLevel& level : wind_profile(scene, frame.time_s))
        w.wind.emplace_back(level.height_m, level.velocity);
    const Velocity surface = wind_at_height(scene, kSurface_m, frame.time_s);
    w.surface_m_per_s = speed_of(surface);
    w.surface_from_deg = bearing_from(surface, heading);
    const Fog& fog = scene.render.fog;
    if (fog.extinction_per_m > 0) {
        w.visibility_m = std::min(9999.0, kKoschmieder / fog.extinction_per_m);
        w.fog_depth_m = fog.height_m;
    }
    std::size_t raining = 0;
    bool steady = false;
    for (const RainRecord& area : frame.rain) {
        if (area.intensity_mm_per_h > 0) ++raining;
        if (!(area.intensity_mm_per_h > w.rain_mm_per_h)) continue;
        w.rain_mm_per_h = area.intensity_mm_per_h;
        w.precipitation = is_precipitation(area.layer) ? area.layer : "";
        steady = is_over_its_box(scene, area);
    }
    w.showers = raining > 1 && !steady;
    w.snow = scene.render.precipitation.kind == PrecipitationKind::snow;
    w.thunder = std::ranges::any_of(scene.render.lightning, [&](const LightningFlash& flash) {
        return std::abs(flash.time_s - frame.time_s) <= kThunder_s;
    });
    return w;
}

namespace {

// Rounded down as reports are (FM 15): to 50 m below 800 m, to 100 m below 5 km, to 1 km above; 9999 from 10 km on.
int reported_visibility(double metres) {
    if (metres >= 9999) return 9999;
    const double step = metres < 800 ? 50 : metres < 5000 ? 100 : 1000;
    return int(std::floor(metres / step + 1e-3) *
               step);  // a report's own figure comes back from its extinction
}

// What falls, and thunder.
std::optional<MetarWeather> falling_of(const WeatherSummary& weather) {
    MetarWeather w;
    w.descriptor = weather.thunder ? "TS" : weather.rain_mm_per_h > 0 && weather.showers ? "SH" : "";
    if (weather.rain_mm_per_h > 0) {
        const double rate = weather.rain_mm_per_h;
        std::string code = weather.precipitation;
        if (code.empty()) code = weather.snow ? "SN" : rate <= 0.5 ? "DZ" : "RA";
        const bool drizzle = code.ends_with("DZ") && code.find("RA") == code.npos;
        w.intensity = rate < (drizzle ? 0.1 : 2.5) ? '-' : rate > (drizzle ? 0.5 : 10) ? '+' : char(0);
        if (code.starts_with("FZ") && w.descriptor.empty()) w.descriptor = "FZ";
        if (code.starts_with("FZ")) code.erase(0, 2);
        for (std::size_t n = 0; n < code.size(); n += 2) w.phenomena.push_back(code.substr(n, 2));
    }
    if (w.descriptor.empty() && w.phenomena.empty()) return {};
    return w;
}

// What floats: fog, mist or haze by its depth, and by the visibility where nothing falls that could be the reason.
std::string floating_of(const WeatherSummary& weather, int visibility_m, bool falls) {
    if (visibility_m >= 9999) return {};
    const std::string mist = visibility_m < 1000 ? "FG" : "BR";
    if (weather.fog_depth_m < FogDepth::mist_limit) return mist;
    if (weather.fog_depth_m >= FogDepth::haze_limit) return "HZ";
    return visibility_m <= 5000 && !falls ? mist : "";
}

}  // namespace

std::string datum_note(const Scene& scene) {
    const Georeference& place = scene.georeference;
    if (!place.given || place.height_datum == HeightDatum::msl || place.geoid_height_m != 0) return {};
    return "heights are above the ellipsoid: the scene has no `georeference.geoid_height_m`, from which "
           "those above "
           "mean sea level follow";
}

std::string metar_of(const RunListing& run, const WeatherSummary& weather) {
    Metar m;
    const std::string& name = run.scene.name;
    const auto is_letter = [](char c) { return c >= 'A' && c <= 'Z'; };
    const bool station = name.size() == 4 && is_letter(name[0]) && std::ranges::all_of(name, [&](char c) {
                             return is_letter(c) || (c >= '0' && c <= '9');
                         });
    m.station = station ? name : "ZZZZ";
    m.day = 1;
    if (!weather.utc.empty()) {
        m.day = std::stoi(weather.utc.substr(8, 2));
        m.hour = std::stoi(weather.utc.substr(11, 2));
        m.minute = std::stoi(weather.utc.substr(14, 2));
    }
    m.wind.known = true;
    m.wind.speed_m_per_s = weather.surface_m_per_s;
    m.wind.from_deg = int(std::lround(weather.surface_from_deg)) % 360;
    m.visibility_m = reported_visibility(weather.visibility_m);
    const std::optional<MetarWeather> falling = falling_of(weather);
    if (falling) m.weather.push_back(*falling);
    if (const std::string floating = floating_of(weather, *m.visibility_m, weather.rain_mm_per_h > 0);
        !floating.empty())
        m.weather.push_back({0, false, "", {floating}});
    for (const LayerSummary& layer : weather.layers) {
        const std::optional<CloudAmount> amount = amount_of(layer.columns.cover);
        if (!amount) continue;
        MetarCloud c;
        c.amount = *amount;
        c.height_ft =
            100 * int(std::lround(std::clamp(layer.columns.cloud_base_m / kFoot / 100, 0.0, 999.0)));
        if (layer.genus == "Cb") c.type = "CB";
        if (layer.towering) c.type = "TCU";
        if (layer.genus == "VV") c.amount = CloudAmount::obscured;
        m.clouds.push_back(c);
    }
    return metar_text(m);
}

std::string layers_json_text(const RunListing& run, const std::vector<WeatherSummary>& frames) {
    Json list = Json::array();
    for (const WeatherSummary& w : frames) {
        Json layers = Json::array();
        for (const LayerSummary& s : w.layers) {
            layers.push_back({{"name", s.name},
                              {"genus", s.genus},
                              {"base_m", number_or_null(s.columns.base_m + w.elevation_m)},
                              {"top_m", number_or_null(s.columns.top_m + w.elevation_m)},
                              {"cloud_base_m", number_or_null(s.columns.cloud_base_m + w.elevation_m)},
                              {"coverage", s.columns.cover},
                              {"oktas", s.oktas},
                              {"optical_depth_median", s.columns.median_depth},
                              {"transition_m", s.transition_m},
                              {"rain_mm_per_h", s.rain_mm_per_h},
                              {"wind_from_deg", s.wind_from_deg},
                              {"wind_m_per_s", s.wind_m_per_s}});
        }
        Json entry = {{"number", w.number}, {"time_s", w.time_s}};
        if (!w.utc.empty()) entry["utc"] = w.utc;
        entry.update(Json{{"layers", layers},
                          {"visibility_m", w.visibility_m},
                          {"rain_mm_per_h", w.rain_mm_per_h},
                          {"kind", w.rain_mm_per_h == 0 ? "none"
                                   : w.snow             ? "snow"
                                                        : "rain"},
                          {"surface_wind_from_deg", w.surface_from_deg},
                          {"surface_wind_m_per_s", w.surface_m_per_s},
                          {"metar", metar_of(run, w)}});
        list.push_back(std::move(entry));
    }
    const Json json = {{"format", "nephos layers"},
                       {"format_version", 1},
                       {"scene_hash", run.scene_hash},
                       {"heights", datum_note(run.scene).empty() ? "metres above mean sea level"
                                                                 : "metres above the ellipsoid"},
                       {"frames", list}};
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::vector<LayerSummary> three_layers(std::vector<LayerSummary> layers) {
    while (layers.size() > 3) {
        std::size_t nearest = 0;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t n = 0; n + 1 < layers.size(); ++n) {
            const double gap = layers[n + 1].columns.base_m - layers[n].columns.top_m;
            if (gap < least) {
                least = gap;
                nearest = n;
            }
        }
        LayerSummary& low = layers[nearest];
        const LayerSummary& high = layers[nearest + 1];
        low.name += "+" + high.name;
        // Of the larger cover, but a cumulonimbus is what a pilot must know of.
        if (high.genus == "Cb" || (low.genus != "Cb" && high.columns.cover > low.columns.cover))
            low.genus = high.genus;
        // Of clouds that lie over each other at random.
        low.columns.cover = 1 - (1 - low.columns.cover) * (1 - high.columns.cover);
        low.columns.top_m = std::max(low.columns.top_m, high.columns.top_m);
        low.columns.median_depth = std::max(low.columns.median_depth, high.columns.median_depth);
        low.rain_mm_per_h = std::max(low.rain_mm_per_h, high.rain_mm_per_h);
        low.oktas = 8 * low.columns.cover;
        layers.erase(layers.begin() + std::ptrdiff_t(nearest) + 1);
    }
    return layers;
}

std::vector<std::pair<double, Velocity>> xplane_winds(const std::vector<std::pair<double, Velocity>>& wind) {
    if (wind.size() <= kXplaneWinds) return wind;
    std::vector<std::pair<double, Velocity>> chosen;
    for (std::size_t n = 0; n < kXplaneWinds; ++n)
        chosen.push_back(wind[(n * (wind.size() - 1) + (kXplaneWinds - 1) / 2) / (kXplaneWinds - 1)]);
    return chosen;
}

std::vector<std::string> limit_notes(const std::vector<WeatherFormat>& formats,
                                     const std::vector<WeatherSummary>& frames) {
    std::size_t merged = 0, most_layers = 0, most_winds = 0;
    for (const WeatherSummary& frame : frames) {
        if (frame.layers.size() > 3) ++merged;
        most_layers = std::max(most_layers, frame.layers.size());
        most_winds = std::max(most_winds, frame.wind.size());
    }
    std::string three;
    for (const NamedWeather& named : weather_formats()) {
        const bool limited = named.format == WeatherFormat::xplane || named.format == WeatherFormat::wpr ||
                             named.format == WeatherFormat::cigi;
        if (limited && std::ranges::count(formats, named.format) > 0)
            three += (three.empty() ? "" : ", ") + std::string(named.name);
    }
    std::vector<std::string> notes;
    if (merged > 0 && !three.empty())
        notes.push_back(fmt::format(
            "{}: up to {} layers of clouds, but there is room for three: the nearest are merged in "
            "{} of {} frames (`layers` has all)",
            three, most_layers, merged, frames.size()));
    if (most_winds > kXplaneWinds && std::ranges::count(formats, WeatherFormat::xplane) > 0)
        notes.push_back(
            fmt::format("xplane: the wind is told at {} heights, but there is room for {}: those evenly from "
                        "the lowest to the highest",
                        most_winds, kXplaneWinds));
    if (frames.size() > 1 && std::ranges::count(formats, WeatherFormat::wpr) > 0)
        notes.push_back(
            fmt::format("wpr: a preset has one moment: that of frame {} (--frames chooses another)",
                        frames.front().number));
    return notes;
}

}  // namespace nephos
