// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_output.h"

#include <cstddef>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "core/random.h"
#include "density/combine.h"
#include "render/image/image_file.h"
#include "simulation/simulation.h"
#include "simulation/version.h"
#include "simulation/weather.h"

namespace nephos {
namespace {

// Frames in each stage at most (simulation/memory.cpp).
constexpr std::size_t kDrawing = 1, kWriting = 2;

bool several_threads() {
    return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) > 1;
}

}  // namespace

bool wants_png(const Scene& scene) { return scene.frames.png || scene.frames.video; }

FrameOutput::FrameOutput(const RunSettings& settings, std::function<void(const FrameResult&)> done)
    : settings_(settings),
      folder_{settings.folder, settings.scene.name},
      done_(std::move(done)),
      renderer_(settings.render ? std::make_unique<Renderer>(settings.device) : nullptr),
      writing_(kWriting, several_threads(), [this](Drawn& drawn) { write(drawn); }),
      drawing_(kDrawing, several_threads() && settings.render,
               [this](FrameResult& frame) { draw_next(frame); }) {}

std::string FrameOutput::backend_name() const { return renderer_ ? renderer_->backend_name() : ""; }

std::string FrameOutput::device_name() const { return renderer_ ? renderer_->device_name() : ""; }

void FrameOutput::add(const FrameResult& frame) {
    if (renderer_) {
        drawing_.add(frame);
    } else {
        writing_.add({frame, {}});
    }
}

void FrameOutput::check() {
    drawing_.check();
    writing_.check();
}

void FrameOutput::finish() {
    drawing_.finish();
    writing_.finish();
}

void FrameOutput::finish_quietly() noexcept {
    try {
        drawing_.finish();
    } catch (...) {  // whoever gave the frames has it already, or has a failure of its own
    }
    try {
        writing_.finish();
    } catch (...) {
    }
}

void FrameOutput::write(const Drawn& drawn) const {
    write_density(drawn.frame);
    if (renderer_) write_picture(drawn);
    done_(drawn.frame);
}

DensityGrid FrameOutput::refined(const DensityGrid& density, const Boundaries& boundaries) const {
    const DensityOptions& options = settings_.scene.density;
    if (options.refine == 1) return density;
    return resample(density, options.refine, options.metaball_radius_cells, boundaries);
}

VdbMetadata FrameOutput::metadata_of(const FrameResult& frame, const StateHash& hash) const {
    const Scene& scene = settings_.scene;
    VdbMetadata metadata;
    metadata.extinction_per_m = scene.density.extinction_per_m;
    metadata.time_s = frame.time_s;
    metadata.time_step_s = scene.automaton.time_step_s;
    metadata.frames_per_second = scene.frames.per_second;
    metadata.time_scale = scene.frames.time_scale;
    metadata.seed = scene.automaton.seed;
    metadata.scene_hash = settings_.scene_hash;
    metadata.state_hash = hash.hex();
    metadata.nephos_version = version();
    metadata.random_stream_version = int(kRandomStreamVersion);
    return metadata;
}

void FrameOutput::write_density(const FrameResult& frame) const {
    if (!settings_.scene.layers.empty()) {
        write_layers(frame);
        return;
    }
    const Scene& scene = settings_.scene;
    const DensityGrid written = refined(frame.density, scene.automaton.boundaries);
    VdbContent content;
    content.density = &written;
    content.half = scene.density.half;
    content.hum = frame.hum;
    content.act = frame.act;
    content.cld = frame.cld;
    content.cells = scene.automaton.placement;
    if (scene.density.write_velocity) content.wind = &scene.automaton.wind;
    write_vdb(folder_.density(frame.number), content, metadata_of(frame, frame.hash));
}

// A file for each layer, with its own voxels, bits and wind, and one of their densities together.
void FrameOutput::write_layers(const FrameResult& frame) const {
    const Scene& scene = settings_.scene;
    std::vector<DensityGrid> grids;
    std::vector<Boundaries> boundaries;
    for (std::size_t n = 0; n < frame.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (layer.direct) continue;
        grids.push_back(refined(layer.density, layer.boundaries));
        boundaries.push_back(layer.boundaries);
        VdbContent content;
        content.density = &grids.back();
        content.half = scene.density.half;
        content.hum = layer.hum;
        content.act = layer.act;
        content.cld = layer.cld;
        content.cells = scene.layers[n].placement;
        if (scene.density.write_velocity) content.wind = &layer_wind(scene, n);
        write_vdb(folder_.density(frame.number, layer.name), content, metadata_of(frame, layer.hash));
    }
    if (grids.empty()) return;
    const DensityGrid whole = scene.density.refine > 1 ? combine(grids, boundaries) : frame.density;
    VdbContent content;
    content.density = &whole;
    content.half = scene.density.half;
    content.cells = whole.placement();
    write_vdb(folder_.density(frame.number), content, metadata_of(frame, frame.hash));
}

// The metaballs of every lattice, each with the size of its own cells.
std::vector<Metaball> FrameOutput::metaballs_of(const FrameResult& frame) const {
    const double radius = settings_.scene.density.metaball_radius_cells;
    std::uint64_t count = frame.layers.empty() ? frame.density.active_voxels() : 0;
    for (const LayerFrame& layer : frame.layers) count += layer.density.active_voxels();
    require_memory(count * 4 * sizeof(Metaball),
                   fmt::format("{}: drawing frame {}", settings_.scene.name, frame.number));
    if (frame.layers.empty()) return metaballs(frame.density, radius);
    std::vector<Metaball> balls;
    for (const LayerFrame& layer : frame.layers) {
        if (layer.direct) continue;
        const std::vector<Metaball> more = metaballs(layer.density, radius);
        balls.insert(balls.end(), more.begin(), more.end());
    }
    return balls;
}

FrameOutput::Begun FrameOutput::begin(FrameResult& frame) {
    const Scene& scene = settings_.scene;
    const double radius = scene.density.metaball_radius_cells;
    std::vector<Metaball> balls = metaballs_of(frame);
    const MetaballCloud cloud{balls, scene.density.extinction_per_m, metaball_normalisation(radius)};
    std::vector<SkyLayer> layers;
    for (const LayerFrame& layer : frame.layers) {
        if (layer.sky != nullptr) layers.push_back({layer.sky, layer.clouds, layer.direct});
    }
    std::optional<GroundCoverView> ground;
    if (frame.ground) ground = view_of(*frame.ground);
    PendingSkyPicture picture =
        painter_.begin(*renderer_, cloud, layers, scene.render, frame.time_s, scene.frames.exr, ground,
                       weather_of(scene, frame.layers, frame.time_s),
                       FilmFrame{frame.number - 1, scene.frames, scene.render.sun});
    return {std::move(frame), std::move(balls), std::move(picture)};
}

// Hands on the picture before once this one is begun, and this one, too, unless the next frame is there.
void FrameOutput::draw_next(FrameResult& frame) {
    std::optional<Begun> next;
    try {
        next.emplace(begin(frame));
    } catch (...) {
        finish_begun();
        throw;
    }
    finish_begun();
    begun_ = std::move(next);
    if (!begun_->picture.picture.is_pending() || !drawing_.is_awaited()) finish_begun();
}

void FrameOutput::finish_begun() {
    if (!begun_) return;
    Begun begun = std::move(*begun_);
    begun_.reset();
    Picture picture = painter_.finish(*renderer_, std::move(begun.picture));
    picture.light = {};  // no file has it
    writing_.add({std::move(begun.frame), std::move(picture)});
}

void FrameOutput::write_picture(const Drawn& drawn) const {
    const Scene& scene = settings_.scene;
    const FrameResult& frame = drawn.frame;
    PictureMetadata metadata;
    metadata.scene = scene.name;
    metadata.seed = scene.automaton.seed;
    metadata.scene_hash = settings_.scene_hash;
    metadata.state_hash = frame.hash.hex();
    metadata.version = version();
    note_renderer(*renderer_, metadata);
    metadata.time_s = frame.time_s;
    metadata.frames_per_second = scene.frames.per_second;
    metadata.time_scale = scene.frames.time_scale;
    metadata.extinction_per_m = scene.density.extinction_per_m;
    RenderOptions options = scene.render;
    options.camera = camera_at(options.camera, frame.time_s);
    if (scene.frames.exr) write_exr(folder_.picture(frame.number, ".exr"), drawn.picture, options, metadata);
    if (wants_png(scene)) write_png(folder_.picture(frame.number, ".png"), drawn.picture, options, metadata);
}

}  // namespace nephos
