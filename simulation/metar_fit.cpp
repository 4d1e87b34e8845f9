// SPDX-License-Identifier: Apache-2.0
#include "simulation/metar_fit.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "density/combine.h"
#include "density/optical_columns.h"
#include "density/veil.h"
#include "scenes/format/reader.h"

namespace nephos {
namespace {

constexpr double kTolerance = 0.1 / 8;  // of cover

// The optical cover of a layer of the scene in its first frame.
double cover_of_layer(const Scene& scene, std::size_t layer) {
    const LayerOptions& options = scene.layers[layer];
    const DensityGrid density = veil_density(veil_options(scene, layer), layer_wind(scene, layer),
                                             options.extent, options.placement, scene.frames.start_s);
    return optical_columns(options.opacity < 1 ? scaled(density, options.opacity) : density,
                           scene.density.extinction_per_m)
        .cover;
}

bool is_same(const MetarLayer& a, const MetarLayer& b) { return a.group == b.group && a.genus == b.genus; }

}  // namespace

FittedScene fit_metar(const Metar& metar, const MetarSceneOptions& options) {
    FittedScene fitted;
    const std::vector<MetarLayer> layers = layers_of(metar);
    std::vector<double> coverage(layers.size(), 1.0);
    for (std::size_t n = 0; n < layers.size(); ++n) {
        FittedLayer fit{layers[n], 1, 0, 0};
        const auto measure = [&](double value) {
            // A coverage of few digits makes a scene that people can read.
            coverage[n] = std::round(value * 1000) / 1000;
            ++fit.tries;
            return cover_of_layer(read_scene_text(metar_scene_text(metar, options, coverage), "scene"), n);
        };
        double low = 0.01, high = 1;
        if (layers[n].sheet) {
            fit.cover = measure(1);
        } else {
            while (fit.tries < kMostTries) {
                const double middle = (low + high) / 2;
                fit.cover = measure(middle);
                if (std::abs(fit.cover - layers[n].cover) <= kTolerance) break;
                (fit.cover < layers[n].cover ? low : high) = middle;
            }
        }
        fit.coverage = coverage[n];
        if (std::abs(fit.cover - layers[n].cover) > 0.5 / 8)
            fitted.notes.push_back(
                fmt::format("{}: the cover of {:.2f} is not met within half an okta: it is {:.2f}",
                            layers[n].group, layers[n].cover, fit.cover));
        fitted.layers.push_back(fit);
    }
    fitted.text = metar_scene_text(metar, options, coverage);
    for (std::string& note : metar_notes(metar, options)) fitted.notes.push_back(std::move(note));
    return fitted;
}

FittedScene fit_taf(const Taf& taf, const MetarSceneOptions& options) {
    FittedScene fitted;
    const std::vector<TafLayer> layers = layers_of(taf);
    std::vector<double> coverage(layers.size(), 1.0);
    fitted.layers.resize(layers.size());
    MetarSceneOptions undated = options;  // a period has no day of its own
    undated.date.clear();
    for (const TafPeriod& period : taf.periods) {
        const auto is_new = [&](const MetarLayer& wanted) {
            return std::ranges::none_of(fitted.layers,
                                        [&](const FittedLayer& f) { return is_same(f.layer, wanted); });
        };
        if (std::ranges::none_of(layers_of(period.weather), is_new)) continue;
        const FittedScene sky = fit_metar(period.weather, undated);
        for (const FittedLayer& fit : sky.layers) {
            if (!is_new(fit.layer)) continue;
            const auto known =
                std::ranges::find_if(layers, [&](const TafLayer& l) { return is_same(l.layer, fit.layer); });
            const auto n = std::size_t(known - layers.begin());
            coverage[n] = fit.coverage;
            fitted.layers[n] = fit;
            fitted.layers[n].layer.name = known->layer.name;
        }
        for (const std::string& note : sky.notes)
            if (note.find("is not met") != note.npos) fitted.notes.push_back(note);
    }
    fitted.text = taf_scene_text(taf, options, coverage);
    if (options.date.empty() || !options.place)
        fitted.notes.push_back("the sun is not that of the forecast: it takes --date and --at");
    const auto visibility = [](const TafPeriod& period) {
        return period.weather.visibility_m.value_or(9999);
    };
    if (std::ranges::any_of(taf.periods, [&](const TafPeriod& p) {
            return visibility(p) != visibility(taf.periods.front());
        }))
        fitted.notes.push_back("visibility that changes is not in the scene: it is that of the beginning");
    fitted.notes.insert(fitted.notes.end(), taf.notes.begin(), taf.notes.end());
    return fitted;
}

}  // namespace nephos
