// SPDX-License-Identifier: Apache-2.0
// Summaries of layers in the forms of simulators: X-Plane, MSFS, CIGI 3.3 (SISO, "Common Image Generator Interface, ICD
// 3.3", 2008, sections 4.1.1 and 4.1.12).

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/bytes.h"
#include "scenes/metar/metar.h"
#include "simulation/export/weather.h"

namespace nephos {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint16_t kCigiRegion = 1;

// X-Plane's types: 0 cirrus, 1 stratus, 2 cumulus, 3 cumulonimbus. Of an unknown genus that of cumulus, which the automaton makes.
int xplane_type(const std::string& genus) {
    if (genus.starts_with("Ci") || genus == "Cc" || genus == "Cs") return 0;
    if (genus == "Cb") return 3;
    return genus == "Cu" || genus.empty() ? 2 : 1;
}

// CIGI's cloud types 1 to 10, likewise.
int cigi_type(const std::string& genus) {
    constexpr const char* kTypes[] = {"", "Ac", "As", "Cc", "Cs", "Ci", "Cb", "Cu", "Ns", "Sc", "St"};
    for (int n = 1; n <= 10; ++n)
        if (genus == kTypes[n]) return n;
    return genus == "VV" ? 10 : 7;  // an obscured sky: stratus
}

template <class T>
void put_big(ByteWriter& w, T value) {
    std::byte bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    std::reverse(std::begin(bytes), std::end(bytes));
    w.put_bytes(bytes);
}

// Internet checksum (RFC 1071) of an IPv4 header.
std::uint16_t checksum(std::span<const std::byte> header) {
    std::uint32_t sum = 0;
    for (std::size_t n = 0; n + 1 < header.size(); n += 2)
        sum += std::to_integer<std::uint32_t>(header[n]) << 8 | std::to_integer<std::uint32_t>(header[n + 1]);
    while (sum >> 16 != 0) sum = (sum & 0xFFFF) + (sum >> 16);
    return std::uint16_t(~sum);
}

enum class RegionState : std::uint8_t { active = 1, destroyed = 2 };

// Environmental Region Control (section 4.1.11): the rectangle of the clouds around their place on Earth, with the weather
// of its own. The region's axes are those of its place, X to the north and Y to the east (NED), turned clockwise: X is the
// world's y axis. In a region of no transition clouds would end like a wall.
void put_region(ByteWriter& w, const WeatherRegion& region, RegionState state) {
    w.put(std::uint8_t{11});
    w.put(std::uint8_t{48});
    put_big(w, kCigiRegion);
    w.put(std::uint8_t(
        state));  // its weather, aerosol, sea and land are not merged with those of other regions
    for (int n = 0; n < 3; ++n) w.put(std::uint8_t{0});
    put_big(w, region.latitude_deg);
    put_big(w, region.longitude_deg);
    for (const double value : {region.north_m, region.east_m, 0.0, std::remainder(region.heading_deg, 360.0),
                               0.1 * std::min(region.east_m, region.north_m)})
        put_big(w, float(value));
    put_big(w, std::uint32_t{0});
}

}  // namespace

std::string xplane_text(const RunListing& run, const std::vector<WeatherSummary>& frames) {
    Json list = Json::array();
    for (const WeatherSummary& w : frames) {
        Json clouds = Json::array(), winds = Json::array();
        for (const LayerSummary& s : three_layers(w.layers)) {
            clouds.push_back({{"cloud_type", xplane_type(s.genus)},
                              {"coverage", s.columns.cover},
                              {"alt_top", s.columns.top_m + w.elevation_m},
                              {"alt_base", s.columns.cloud_base_m + w.elevation_m}});
        }
        for (const auto& [height, v] : xplane_winds(w.wind)) {
            winds.push_back({{"alt_msl", height + w.elevation_m},
                             {"speed", std::hypot(v.east_m_per_s, v.north_m_per_s)},
                             {"direction", bearing_from(v, w.heading_deg)},
                             {"gust_speed", 0},
                             {"shear", 0},
                             {"turbulence", 0}});
        }
        Json entry = {{"number", w.number},           {"time_s", w.time_s},
                      {"visibility", w.visibility_m}, {"precip_rate", std::min(1.0, w.rain_mm_per_h / 20)},
                      {"cloud_layers", clouds},       {"wind_layers", winds}};
        const Georeference& place = run.scene.georeference;
        if (place.given)
            entry.update(Json{{"latitude", place.latitude_deg},
                              {"longitude", place.longitude_deg},
                              {"ground_altitude_msl", w.elevation_m}});
        list.push_back(std::move(entry));
    }
    return Json{{"structure", "XPLMWeatherInfo_t"}, {"frames", list}}.dump(2, ' ', false,
                                                                           Json::error_handler_t::replace) +
           "\n";
}

std::string wpr_text(const RunListing& run, const WeatherSummary& w) {
    std::string text = fmt::format(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<SimBase.Document Type=\"WeatherPreset\" "
        "version=\"1,3\">\n  <Descr>AceXML Document</Descr>\n"
        "  <WeatherPreset.Preset>\n    <Name>{}</Name>\n    <IsAltitudeAMGL>False</IsAltitudeAMGL>\n",
        run.scene.name);
    // Pressure and temperature are those of the standard atmosphere; aerosol is that of the fog, 1 at 1,000 m of visibility.
    text += fmt::format(
        "    <MSLPressure Value=\"101325.0\" Unit=\"pa\"/>\n    <MSLTemperature Value=\"288.15\" "
        "Unit=\"k\"/>\n"
        "    <AerosolDensity Value=\"{:.3f}\" Unit=\"(0 - 1)\"/>\n    <Precipitations Value=\"{:.2f}\" "
        "Unit=\"mm/h\"/>\n"
        "    <SnowCover Value=\"{:.3f}\" Unit=\"m\"/>\n    <ThunderstormIntensity Value=\"{:.1f}\" "
        "Unit=\"(0 - 1)\"/>\n",
        w.visibility_m < 9999 ? std::min(1.0, 1000 / w.visibility_m) : 0.0, w.rain_mm_per_h, w.snow_depth_m,
        w.thunder ? 1.0 : 0.0);
    for (const LayerSummary& s : three_layers(w.layers)) {
        text += fmt::format(
            "    <CloudLayer>\n      <CloudLayerAltitudeBot Value=\"{:.1f}\" Unit=\"m\"/>\n      "
            "<CloudLayerAltitudeTop Value=\"{:.1f}\" Unit=\"m\"/>\n"
            "      <CloudLayerDensity Value=\"{:.3f}\" Unit=\"(0 - 1)\"/>\n      <CloudLayerScattering "
            "Value=\"{:.3f}\" Unit=\"(0 - 1)\"/>\n    </CloudLayer>\n",
            s.columns.cloud_base_m + w.elevation_m, s.columns.top_m + w.elevation_m,
            std::min(1.0, s.columns.median_depth / 20), s.columns.cover);
    }
    for (const auto& [height, v] : w.wind) {
        text += fmt::format(
            "    <WindLayer>\n      <WindLayerAltitude Value=\"{:.1f}\" Unit=\"m\"/>\n      <WindLayerAngle "
            "Value=\"{:.1f}\" Unit=\"degrees\"/>\n"
            "      <WindLayerSpeed Value=\"{:.1f}\" Unit=\"knts\"/>\n    </WindLayer>\n",
            height + w.elevation_m, bearing_from(v, w.heading_deg),
            std::hypot(v.east_m_per_s, v.north_m_per_s) / kKnot);
    }
    return text + "  </WeatherPreset.Preset>\n</SimBase.Document>\n";
}

namespace {

// Layers of Weather Control: 0 is ground fog, 1 to 3 are clouds.
constexpr int kFogLayer = 0, kCloudLayers = 3;

// Weather Control (section 4.1.12) of one layer; all zero but for its number where it is switched off.
struct WeatherLayer {
    int id = 0;
    bool enabled = false, lightning = false;
    int type = 0;       // of cloud
    int humidity = 95;  // per cent
    double visibility_m = 100, coverage = 0, base_m = 0, thickness_m = 0,
           transition_m = 0;  // heights above sea level
    double wind_m_per_s = 0, wind_from_deg = 0;
};

// Temperature and pressure of the standard atmosphere (ISO 2533) below its tropopause at 11 km, and of the layer of one
// temperature above it, to which all higher clouds are assigned.
struct StandardAir {
    double temperature_c = 0, pressure_hpa = 0;
};
StandardAir standard_air(double height_m) {
    constexpr double kTropopause_m = 11'000, kLapse = 0.0065, kScale_m = 6341.62;
    const double below = std::min(height_m, kTropopause_m);
    StandardAir air{15 - kLapse * below, 1013.25 * std::pow(1 - kLapse / 288.15 * below, 5.25588)};
    if (height_m > kTropopause_m) air.pressure_hpa *= std::exp((kTropopause_m - height_m) / kScale_m);
    return air;
}

void put_layer(ByteWriter& w, const WeatherLayer& layer, bool regional) {
    w.put(std::uint8_t{12});
    w.put(std::uint8_t{56});
    put_big(w, regional ? kCigiRegion : std::uint16_t{0});
    w.put(std::uint8_t(layer.id));
    w.put(std::uint8_t(layer.enabled ? layer.humidity : 0));
    w.put(std::uint8_t((layer.enabled ? 1 : 0) | (layer.lightning ? 8 : 0) | layer.type << 4));
    w.put(std::uint8_t(regional ? 1 : 0));  // scope: regional or global; no severity
    const double from = layer.wind_from_deg > 180 ? layer.wind_from_deg - 360 : layer.wind_from_deg;
    const StandardAir air = standard_air(layer.base_m);
    const double on[] = {air.temperature_c,
                         layer.visibility_m,
                         0.0,
                         100 * layer.coverage,
                         layer.base_m,
                         layer.thickness_m,
                         layer.transition_m,
                         layer.wind_m_per_s,
                         0.0,
                         from,
                         air.pressure_hpa,
                         0.0};
    for (const double value : on) put_big(w, float(layer.enabled ? value : 0.0));
}

WeatherLayer fog_layer(const WeatherSummary& weather) {
    WeatherLayer fog;
    fog.id = kFogLayer;
    fog.enabled = weather.visibility_m < 9999;
    fog.humidity = 100;
    fog.visibility_m = weather.visibility_m;
    fog.coverage = 1;
    fog.base_m = weather.elevation_m;
    fog.thickness_m = weather.fog_depth_m;
    fog.transition_m = 0.5 * weather.fog_depth_m;
    fog.wind_m_per_s = weather.surface_m_per_s;
    fog.wind_from_deg = weather.surface_from_deg;
    return fog;
}

WeatherLayer cloud_layer(const WeatherSummary& weather, const LayerSummary& s, int id, bool lightning) {
    WeatherLayer cloud;
    cloud.id = id;
    cloud.enabled = true;
    cloud.lightning = lightning;
    cloud.type = cigi_type(s.genus);
    cloud.coverage = s.columns.cover;
    cloud.base_m = s.columns.cloud_base_m + weather.elevation_m;
    cloud.thickness_m = std::max(0.0, s.columns.top_m + weather.elevation_m - cloud.base_m);
    cloud.transition_m = s.transition_m;
    cloud.wind_m_per_s = s.wind_m_per_s;
    cloud.wind_from_deg = s.wind_from_deg;
    return cloud;
}

}  // namespace

// The layer that lightning comes from, counted from 1: the lowest cumulonimbus, or the lowest layer where none is named.
static int thundery_layer(const std::vector<LayerSummary>& clouds) {
    const auto found = std::ranges::find(clouds, "Cb", &LayerSummary::genus);
    return found == clouds.end() ? 1 : int(found - clouds.begin()) + 1;
}

std::vector<std::byte> cigi_packets(const WeatherSummary& weather) {
    ByteWriter w;
    // IG Control: version 3.3, operate, byte swap magic number, frame.
    for (const int byte : {1, 24, 3, 0, 3 << 4 | 1, 0}) w.put(std::uint8_t(byte));
    put_big(w, std::uint16_t{0x8000});
    put_big(w, std::uint32_t(weather.number));
    for (int n = 0; n < 3; ++n) put_big(w, std::uint32_t{0});
    const bool regional = weather.region.has_value();
    put_region(w, weather.region.value_or(WeatherRegion{}),
               regional ? RegionState::active : RegionState::destroyed);
    put_layer(w, fog_layer(weather), regional);
    const std::vector<LayerSummary> clouds = three_layers(weather.layers);
    const int thundery = weather.thunder ? thundery_layer(clouds) : 0;
    for (int id = 1; id <= kCloudLayers; ++id) {
        WeatherLayer layer;
        layer.id = id;
        if (std::size_t(id) <= clouds.size())
            layer = cloud_layer(weather, clouds[std::size_t(id) - 1], id, id == thundery);
        put_layer(w, layer, regional);
    }
    return w.take();
}

std::vector<std::byte> cigi_capture(const std::vector<WeatherSummary>& frames) {
    ByteWriter w;
    w.put(std::uint32_t{0xA1B2C3D4});  // microseconds
    w.put(std::uint16_t{2});
    w.put(std::uint16_t{4});
    w.put(std::uint64_t{0});
    w.put(std::uint32_t{65535});
    w.put(std::uint32_t{1});  // Ethernet
    for (const WeatherSummary& frame : frames) {
        const std::vector<std::byte> payload = cigi_packets(frame);
        ByteWriter ip;
        for (const int byte : {0x45, 0}) ip.put(std::uint8_t(byte));
        put_big(ip, std::uint16_t(28 + payload.size()));
        put_big(ip, std::uint16_t(frame.number));
        put_big(ip, std::uint16_t{0});
        for (const int byte : {64, 17, 0, 0, 127, 0, 0, 1, 127, 0, 0, 1}) ip.put(std::uint8_t(byte));
        std::vector<std::byte> header = ip.take();
        const std::uint16_t sum = checksum(header);
        header[10] = std::byte(sum >> 8);
        header[11] = std::byte(sum & 0xFF);
        const auto size = std::uint32_t(14 + 28 + payload.size());
        w.put(std::uint32_t(frame.time_s));
        w.put(std::uint32_t(std::fmod(frame.time_s, 1) * 1e6));
        w.put(size);
        w.put(size);
        for (int n = 0; n < 12; ++n) w.put(std::uint8_t(n == 5 || n == 11 ? n : 2));  // locally administered
        put_big(w, std::uint16_t{0x0800});
        w.put_bytes(header);
        put_big(w, std::uint16_t{8004});
        put_big(w, std::uint16_t{8005});
        put_big(w, std::uint16_t(8 + payload.size()));
        put_big(w, std::uint16_t{0});  // no checksum
        w.put_bytes(payload);
    }
    return w.take();
}

}  // namespace nephos
