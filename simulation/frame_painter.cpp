// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_painter.h"

#include <cstdint>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "simulation/memory.h"
#include "simulation/weather.h"

namespace nephos {

FramePainter::FramePainter(const Scene& scene, const DeviceOptions& device)
    : scene_(scene), renderer_(device) {}

// The metaballs of every lattice, each with the size of its own cells.
std::vector<Metaball> FramePainter::metaballs_of(const FrameResult& frame) const {
    const double radius = scene_.density.metaball_radius_cells;
    std::uint64_t count = 0;
    for (const LayerFrame& layer : frame.layers) count += layer.density.active_voxels();
    const bool of_layers = count > 0;
    if (!of_layers) count = frame.density.active_voxels();
    require_memory(count * 4 * sizeof(Metaball),
                   frame.number > 0 ? fmt::format("{}: drawing frame {}", scene_.name, frame.number)
                                    : scene_.name + ": drawing its voxels");
    if (!of_layers) return metaballs(frame.density, radius);
    std::vector<Metaball> balls;
    for (const LayerFrame& layer : frame.layers) {
        if (layer.direct) continue;
        const std::vector<Metaball> more = metaballs(layer.density, radius);
        balls.insert(balls.end(), more.begin(), more.end());
    }
    return balls;
}

PendingFrame FramePainter::begin(FrameResult frame) {
    std::vector<Metaball> balls = metaballs_of(frame);
    const double radius = scene_.density.metaball_radius_cells;
    const MetaballCloud cloud{balls, scene_.density.extinction_per_m, metaball_normalisation(radius)};
    std::vector<SkyLayer> layers;
    for (const LayerFrame& layer : frame.layers) {
        if (layer.sky != nullptr) layers.push_back({layer.sky, layer.clouds, layer.direct});
    }
    std::optional<GroundCoverView> ground;
    if (frame.ground) ground = view_of(*frame.ground);
    std::optional<FilmFrame> film;
    if (frame.number > 0) film = FilmFrame{frame.number - 1, scene_.frames, scene_.render.sun};
    PendingSkyPicture picture =
        painter_.begin(renderer_, cloud, layers, scene_.render, frame.time_s, scene_.frames.exr, ground,
                       weather_of(scene_, frame.layers, frame.time_s), film);
    return {std::move(frame), std::move(balls), std::move(picture)};
}

Picture FramePainter::finish(PendingFrame&& pending) {
    return painter_.finish(renderer_, std::move(pending.picture));
}

Picture FramePainter::draw(const FrameResult& frame) { return finish(begin(frame)); }

}  // namespace nephos
