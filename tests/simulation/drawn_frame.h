// SPDX-License-Identifier: Apache-2.0
#pragma once

// A frame of a simulation as a run draws it, for tests.

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "density/metaballs.h"
#include "scenes/format/scene.h"
#include "simulation/frame_painter.h"
#include "simulation/simulation.h"
#include "simulation/sky_picture.h"

namespace nephos::test {

// `all`: with depth, light and shadow map, as for EXR files.
inline Picture drawn_frame(const Scene& scene, const FrameResult& frame, Renderer& renderer,
                           SkyPainter& painter, bool all) {
    const double radius = scene.density.metaball_radius_cells;
    std::vector<Metaball> balls;
    std::vector<SkyLayer> layers;
    if (frame.layers.empty()) balls = metaballs(frame.density, radius);
    for (const LayerFrame& layer : frame.layers) {
        if (!layer.direct) {
            const std::vector<Metaball> more = metaballs(layer.density, radius);
            balls.insert(balls.end(), more.begin(), more.end());
        }
        if (layer.sky != nullptr) layers.push_back({layer.sky, layer.clouds, layer.direct});
    }
    const MetaballCloud cloud{balls, scene.density.extinction_per_m, metaball_normalisation(radius)};
    return painter.draw(renderer, cloud, layers, scene.render, frame.time_s, all,
                        frame.ground ? std::optional(view_of(*frame.ground)) : std::nullopt,
                        weather_of(scene, frame.layers, frame.time_s));
}

// The largest difference, of what is brighter than 1 relative to it; not a number if any is not.
inline float apart_by(const std::vector<float>& expected, const std::vector<float>& other) {
    float apart = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
        const float difference = std::abs(other[i] - expected[i]) / std::max(1.0f, expected[i]);
        if (std::isnan(difference)) return difference;
        apart = std::max(apart, difference);
    }
    return apart;
}

}  // namespace nephos::test
