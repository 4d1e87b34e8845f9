// SPDX-License-Identifier: Apache-2.0
#include "simulation/frame_writer.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/atomic_file.h"
#include "core/random.h"
#include "density/combine.h"
#include "density/metaballs.h"
#include "density/voxel_digest.h"
#include "render/image/exposure.h"
#include "scenes/format/layers.h"
#include "scenes/format/writer.h"
#include "simulation/frame_detail.h"
#include "simulation/scene_files.h"
#include "simulation/scene_place.h"
#include "simulation/simulation.h"

namespace nephos {

FrameWriter::FrameWriter(const Scene& scene, RunFolder folder, int first_frame)
    : scene_(with_files(scene)), folder_(std::move(folder)), frames_hash_(frames_hash(scene)), first_frame_(first_frame) {}

// With the exposure that the frame has; `camera`: at its time.
RenderOptions FrameWriter::exposed_options(const FrameResult& frame, const Picture& picture,
                                           const Camera& camera) {
    RenderOptions options = scene_.render;
    options.camera = camera;
    const bool follows = options.camera.exposure == Exposure::automatic && options.camera.adaptation_s > 0 &&
                         wants_png(scene_);
    options = with_exposure(options, picture);
    if (!follows) return options;
    double& ev = options.camera.exposure_ev;
    if (frame.number > first_frame_) {
        if (exposed_frame_ != frame.number - 1)
            exposed_ev_ = read_png_exposure(folder_.picture(frame.number - 1, ".png"));
        ev = adapted_ev(exposed_ev_, ev, 1 / scene_.frames.per_second, options.camera.adaptation_s);
    }
    exposed_frame_ = frame.number;
    exposed_ev_ = ev;
    return options;
}

VdbMetadata density_metadata(const Scene& scene, std::string frames_hash, double time_s,
                             const StateHash& hash) {
    VdbMetadata metadata;
    metadata.extinction_per_m = scene.density.extinction_per_m;
    metadata.time_s = time_s;
    metadata.time_step_s = scene.automaton.time_step_s;
    metadata.frames_per_second = scene.frames.per_second;
    metadata.time_scale = scene.frames.time_scale;
    metadata.seed = scene.automaton.seed;
    metadata.scene_hash = std::move(frames_hash);
    metadata.state_hash = hash.hex();
    metadata.nephos_version = version();
    metadata.random_stream_version = int(kRandomStreamVersion);
    metadata.georeference = scene.georeference;
    return metadata;
}

DensityGrid FrameWriter::refined(const DensityGrid& density, const std::optional<DensityGrid>& moisture,
                                 std::optional<std::size_t> layer, const Boundaries& boundaries,
                                 double time_s) const {
    const DensityOptions& options = scene_.density;
    if (options.refine == 1) return density;
    DetailSetting setting = detail_setting(scene_, layer, density, time_s);
    if (setting.options.enabled) {
        setting.boundaries = boundaries;
        setting.images = true;
        const CoverageField field(density, setting, moisture ? &*moisture : nullptr);
        return resample_with_detail(field, density.extent(), density.placement(), options.refine);
    }
    return resample(density, options.refine, options.metaball_radius_cells, boundaries);
}

VdbMetadata frame_metadata(const Scene& scene, std::string frames_hash, double time_s, const StateHash& hash,
                           std::optional<std::size_t> layer, const DensityGrid& density) {
    VdbMetadata metadata = density_metadata(scene, std::move(frames_hash), time_s, hash);
    metadata.period_m = period_m(scene, layer);
    metadata.wind = wind_levels(scene, layer, density.placement(), density.extent(), time_s);
    return metadata;
}

bool moves_with_fields(const Scene& scene, std::optional<std::size_t> layer) {
    const auto moves = [](const LayerOptions& of) { return !of.is_veil; };
    if (layer) return moves(scene.layers[*layer]);
    return scene.layers.empty() || std::ranges::any_of(scene.layers, moves);
}

// The digest of the file is that of its bytes as they are read back.
WrittenFile FrameWriter::write(const FrameResult& frame, VdbContent content, std::optional<std::size_t> layer) const {
    const DensityGrid& density = *content.density;
    content.half = scene_.density.half;
    if (scene_.density.write_velocity) {
        content.wind = wind_of_levels(scene_, layer, density.placement(), density.extent(), frame.time_s);
        content.wind_name = scene_.density_files.velocity_name;
        const std::vector<WindField>& fields = scene_.automaton.wind.fields;
        if (!fields.empty() && moves_with_fields(scene_, layer))
            content.wind_field = [&fields, time_s = frame.time_s](const Vec3& place_m) {
                return velocity_of(fields, place_m, time_s);
            };
    }
    const StateHash& hash = layer ? frame.layers[*layer].hash : frame.hash;
    const std::filesystem::path path =
        layer ? folder_.density(frame.number, frame.layers[*layer].name) : folder_.density(frame.number);
    content.publish_check = guard_;
    write_vdb(path, content, frame_metadata(scene_, frames_hash_, frame.time_s, hash, layer, density));
    return {path, file_digest(path), voxel_digest(density, content.half)};
}

std::vector<WrittenFile> FrameWriter::write_density(const FrameResult& frame) const {
    if (!scene_.layers.empty()) return write_layers(frame);
    const DensityGrid written =
        refined(frame.density, frame.moisture, std::nullopt, scene_.automaton.boundaries, frame.time_s);
    VdbContent content;
    content.density = &written;
    content.hum = frame.hum;
    content.act = frame.act;
    content.cld = frame.cld;
    content.cells = scene_.automaton.placement;
    return {write(frame, std::move(content), std::nullopt)};
}

// A file for each layer, with its own voxels, bits and wind, and one of their densities together.
std::vector<WrittenFile> FrameWriter::write_layers(const FrameResult& frame) const {
    std::vector<WrittenFile> files;
    std::vector<DensityGrid> grids;
    std::vector<Boundaries> boundaries;
    for (std::size_t n = 0; n < frame.layers.size(); ++n) {
        const LayerFrame& layer = frame.layers[n];
        if (layer.direct) continue;
        grids.push_back(refined(layer.density, layer.moisture, n, layer.boundaries, frame.time_s));
        boundaries.push_back(layer.boundaries);
        if (!scene_.density_files.per_layer) continue;
        VdbContent content;
        content.density = &grids.back();
        content.hum = layer.hum;
        content.act = layer.act;
        content.cld = layer.cld;
        content.cells = scene_.layers[n].placement;
        files.push_back(write(frame, std::move(content), n));
    }
    if (grids.empty() || !scene_.density_files.combined) return files;
    const DensityGrid whole = scene_.density.refine > 1 ? combine(grids, boundaries) : frame.density;
    VdbContent content;
    content.density = &whole;
    content.cells = whole.placement();
    files.insert(files.begin(), write(frame, std::move(content), std::nullopt));
    return files;
}

Rgb8Image FrameWriter::write_picture(const FrameResult& frame, const Picture& picture,
                                     const FramePainter& painter) {
    PictureMetadata metadata;
    metadata.scene = scene_.name;
    metadata.seed = scene_.automaton.seed;
    metadata.scene_hash = frames_hash_;
    metadata.state_hash = frame.hash.hex();
    metadata.version = version();
    painter.note_renderer(metadata);
    metadata.time_s = frame.time_s;
    metadata.frames_per_second = scene_.frames.per_second;
    metadata.time_scale = scene_.frames.time_scale;
    metadata.extinction_per_m = scene_.density.extinction_per_m;
    const RenderOptions options = exposed_options(frame, picture, painter.camera(frame.time_s));
    const PublishCheck check(guard_);
    if (scene_.frames.exr) write_exr(folder_.picture(frame.number, ".exr"), picture, options, metadata);
    if (!wants_png(scene_)) return {};
    Rgb8Image image = srgb8_image(picture, options);
    write_png(folder_.picture(frame.number, ".png"), image, options, metadata);
    return image;
}

}  // namespace nephos
