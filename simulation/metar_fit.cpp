// SPDX-License-Identifier: Apache-2.0
#include "simulation/metar_fit.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "density/combine.h"
#include "density/detail.h"
#include "density/optical_columns.h"
#include "density/veil.h"
#include "scenes/format/reader.h"

namespace nephos {
namespace {

constexpr double kTolerance = 0.1 / 8;  // of cover

// The optical cover of a layer of the scene at a moment.
double cover_of_layer(const Scene& scene, std::size_t layer, double time_s) {
    const LayerOptions& options = scene.layers[layer];
    const DensityGrid density = veil_density(veil_options(scene, layer), layer_wind(scene, layer),
                                             options.extent, options.placement, time_s);
    return optical_columns(options.opacity < 1 ? scaled(density, options.opacity) : density,
                           scene.density.extinction_per_m)
        .cover;
}

// Chooses the coverage of the scene's layer `n`, which is `wanted`, for the mean of its covers at some moments, and sets it.
FittedLayer fit_layer(Scene& scene, std::size_t n, const MetarLayer& wanted,
                      const std::vector<double>& moments_s) {
    FittedLayer fit;
    fit.layer = wanted;
    const auto measure = [&](double value) {
        // A coverage of few digits makes a scene that people can read.
        fit.coverage = scene.layers[n].veil.coverage = std::round(value * 1000) / 1000;
        ++fit.tries;
        fit.cover = 0;
        fit.least_cover = 1;
        fit.most_cover = 0;
        for (const double time_s : moments_s) {
            const double cover = cover_of_layer(scene, n, time_s);
            fit.cover += cover / double(moments_s.size());
            fit.least_cover = std::min(fit.least_cover, cover);
            fit.most_cover = std::max(fit.most_cover, cover);
        }
    };
    if (wanted.sheet) {
        measure(1);
        return fit;
    }
    double low = 0.01, high = 1;
    while (fit.tries < kMostTries) {
        const double middle = (low + high) / 2;
        measure(middle);
        if (std::abs(fit.cover - wanted.cover) <= kTolerance) break;
        (fit.cover < wanted.cover ? low : high) = middle;
    }
    return fit;
}

// Fits layers of a scene in which they come first; `moments_of` gives the moments of each.
void fit_layers(FittedScene& fitted, Scene scene, const std::vector<MetarLayer>& layers,
                const std::function<std::vector<double>(std::size_t)>& moments_of) {
    for (std::size_t n = 0; n < layers.size(); ++n) {
        fitted.layers.push_back(fit_layer(scene, n, layers[n], moments_of(n)));
        const FittedLayer& fit = fitted.layers.back();
        if (std::abs(fit.cover - layers[n].cover) > 0.5 / 8)
            fitted.notes.push_back(
                fmt::format("{}: the cover of {:.2f} is not met within half an okta: it is {:.2f}",
                            layers[n].group, layers[n].cover, fit.cover));
    }
}

std::vector<double> coverage_of(const FittedScene& fitted) {
    std::vector<double> coverage;
    for (const FittedLayer& layer : fitted.layers) coverage.push_back(layer.coverage);
    return coverage;
}

}  // namespace

FittedScene fit_metar(const Metar& metar, const MetarSceneOptions& options) {
    FittedScene fitted;
    const std::vector<MetarLayer> layers = layers_of(metar);
    Scene scene = read_scene_text(metar_scene_text(metar, options, std::vector<double>(layers.size(), 1.0)),
                                  "the scene of the report");
    const double first_frame_s = scene.frames.start_s;
    fit_layers(fitted, std::move(scene), layers, [&](std::size_t) { return std::vector{first_frame_s}; });
    fitted.text = metar_scene_text(metar, options, coverage_of(fitted));
    for (std::string& note : metar_notes(metar, options)) fitted.notes.push_back(std::move(note));
    return fitted;
}

FittedScene fit_taf(const Taf& taf, const MetarSceneOptions& options) {
    static_assert(kMostTafLayers <= kMaxLayers && kMostDetailedTafLayers <= kMaxDetailedClouds);
    FittedScene fitted;
    const std::vector<TafLayer> timed = layers_of(taf);
    std::vector<MetarLayer> layers;
    for (const TafLayer& layer : timed) layers.push_back(layer.layer);
    Scene scene = read_scene_text(taf_scene_text(taf, options, std::vector<double>(layers.size(), 1.0)),
                                  "the scene of the forecast");
    fit_layers(fitted, std::move(scene), layers,
               [&](std::size_t n) { return moments_of(taf, timed[n], kTafMoments); });
    fitted.text = taf_scene_text(taf, options, coverage_of(fitted));
    for (std::string& note : taf_notes(taf, options)) fitted.notes.push_back(std::move(note));
    return fitted;
}

}  // namespace nephos
