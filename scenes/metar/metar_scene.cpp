// SPDX-License-Identifier: Apache-2.0
#include "scenes/metar/metar_scene.h"

#include <algorithm>
#include <cmath>

#include "core/text.h"
#include "scenes/metar/scene_parts.h"

namespace nephos {
namespace {

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
        layer.base_m = std::max(30.0, *c.height_ft * kFoot);
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
    if (layers.empty()) text += clear_layer_text();
    if (p.any)
        text +=
            rain_sky_text() + rain_layer_text(p.code, lowest, rain_areas(p, {})) + falling_text(p.snow, true);
    if (has_descriptor(m, "TS")) text += lightning_text(lowest, 600);
    text += "\n[density]\nextinction_per_m = 0.05\n" + fog_text(m);
    return text + picture_text("start_s = 600\ntime_scale = 60\nper_second = 12\ncount = 12\n", lowest);
}

std::vector<std::string> metar_notes(const Metar& m, const MetarSceneOptions& o) {
    std::vector<std::string> notes;
    if (o.date.empty() || !o.place)
        notes.push_back("the sun is not that of the report: it takes --date and --at");
    for (std::string& text : left_out(m)) notes.push_back(std::move(text));
    if (m.temperature_c && m.dew_point_c) {
        const double expected = 125.0 * (*m.temperature_c - *m.dew_point_c);
        for (const MetarLayer& layer : layers_of(m)) {
            if (layer.genus == "Cu" && std::abs(layer.base_m - expected) > 300) {
                notes.push_back("cumulus at " + rounded_text(layer.base_m) +
                                " m does not fit temperature and dew point, from which a base at " +
                                rounded_text(expected) + " m follows");
                break;
            }
        }
    }
    return notes;
}

}  // namespace nephos
