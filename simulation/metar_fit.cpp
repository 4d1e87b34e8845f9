// SPDX-License-Identifier: Apache-2.0
#include "simulation/metar_fit.h"

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

}  // namespace nephos
