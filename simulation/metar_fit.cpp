// SPDX-License-Identifier: Apache-2.0
#include "simulation/metar_fit.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <fmt/format.h>

#include "density/combine.h"
#include "density/detail.h"
#include "density/optical_columns.h"
#include "density/veil.h"
#include "scenes/format/reader.h"

namespace nephos {
namespace {

constexpr double kTolerance = 0.1 / 8;  // of cover
constexpr double kLeastCoverage = 0.01;

// The optical cover of a layer of the scene at a moment.
double cover_of_layer(const Scene& scene, std::size_t layer, double time_s) {
    const LayerOptions& options = scene.layers[layer];
    const DensityGrid density = veil_density(veil_options(scene, layer), layer_wind(scene, layer),
                                             options.extent, options.placement, time_s);
    return optical_columns(options.opacity < 1 ? scaled(density, options.opacity) : density,
                           scene.density.extinction_per_m)
        .cover;
}

// Measures the optical cover of the scene's layer `n` with a coverage, which it gets: the mean of some moments.
void measure(Scene& scene, std::size_t n, double coverage, std::span<const double> moments_s,
             FittedLayer& fit) {
    // A coverage of few digits makes a scene that people can read.
    fit.coverage = scene.layers[n].veil.coverage = std::round(coverage * 1000) / 1000;
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
}

// Chooses the coverage of the scene's layer `n`, which is `wanted`, by bisection for the mean of some moments.
FittedLayer fit_layer(Scene& scene, std::size_t n, const MetarLayer& wanted,
                      std::span<const double> moments_s) {
    FittedLayer fit;
    fit.layer = wanted;
    if (wanted.sheet) {
        measure(scene, n, 1, moments_s, fit);
        return fit;
    }
    double low = kLeastCoverage, high = 1;
    while (fit.tries < kMostTries) {
        const double middle = (low + high) / 2;
        measure(scene, n, middle, moments_s, fit);
        if (std::abs(fit.cover - wanted.cover) <= kTolerance) break;
        (fit.cover < wanted.cover ? low : high) = middle;
    }
    return fit;
}

// The same for many moments, of which few are looked at first: what all of them are off is then made good by as much coverage.
FittedLayer fit_layer_over_time(Scene& scene, std::size_t n, const TafLayer& layer, const Taf& taf) {
    const MetarLayer& wanted = layer.layer;
    FittedLayer fit = fit_layer(scene, n, wanted, moments_of(taf, layer, kFirstTafMoments));
    const std::vector<double> moments_s = moments_of(taf, layer, kTafMoments);
    measure(scene, n, fit.coverage, moments_s, fit);
    for (int round = 0; round < 3 && !wanted.sheet; ++round) {
        if (std::abs(fit.cover - wanted.cover) <= 2 * kTolerance) break;
        const double better = std::clamp(fit.coverage + wanted.cover - fit.cover, kLeastCoverage, 1.0);
        if (better == fit.coverage) break;
        measure(scene, n, better, moments_s, fit);
    }
    return fit;
}

// Takes a layer, and notes where its cover is not met.
void add(FittedScene& fitted, const FittedLayer& fit) {
    fitted.layers.push_back(fit);
    if (std::abs(fit.cover - fit.layer.cover) > 0.5 / 8)
        fitted.notes.push_back(
            fmt::format("{}: the cover of {:.2f} is not met within half an okta: it is {:.2f}",
                        fit.layer.group, fit.layer.cover, fit.cover));
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
    const std::vector first_frame_s{scene.frames.start_s};
    for (std::size_t n = 0; n < layers.size(); ++n)
        add(fitted, fit_layer(scene, n, layers[n], first_frame_s));
    fitted.text = metar_scene_text(metar, options, coverage_of(fitted));
    for (std::string& note : metar_notes(metar, options)) fitted.notes.push_back(std::move(note));
    return fitted;
}

FittedScene fit_taf(const Taf& taf, const MetarSceneOptions& options) {
    static_assert(kMostTafLayers <= kMaxLayers && kMostDetailedTafLayers <= kMaxDetailedClouds);
    FittedScene fitted;
    const std::vector<TafLayer> layers = layers_of(taf);
    Scene scene = read_scene_text(taf_scene_text(taf, options, std::vector<double>(layers.size(), 1.0)),
                                  "the scene of the forecast");
    for (std::size_t n = 0; n < layers.size(); ++n)
        add(fitted, fit_layer_over_time(scene, n, layers[n], taf));
    fitted.text = taf_scene_text(taf, options, coverage_of(fitted));
    for (std::string& note : taf_notes(taf, options)) fitted.notes.push_back(std::move(note));
    return fitted;
}

}  // namespace nephos
