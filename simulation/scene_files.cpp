// SPDX-License-Identifier: Apache-2.0
#include "simulation/scene_files.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "automaton/grid_values.h"
#include "core/digest.h"
#include "core/text.h"
#include "density/vdb/vdb_file.h"
#include "render/image/alpha_image.h"
#include "render/terrain/height_map.h"
#include "scenes/format/errors.h"
#include "scenes/format/text.h"
#include "simulation/billboard_files.h"
#include "simulation/layer_simulation.h"
#include "simulation/memory.h"
#include "simulation/run_folder.h"

namespace nephos {
namespace {

constexpr int kVector = 3;

std::string wind_file_key(const Scene& scene, std::size_t field, std::size_t n) {
    return key_of_file(scene, indexed("wind_field", field) + ".files", n);
}

std::string grid_file_key(std::size_t n) { return indexed("field.grids", n) + ".file"; }

// Collects the problems of many readers.
class Collector {
  public:
    template <class Read>
    void add(const Read& read) {
        try {
            read();
        } catch (const SceneErrors& errors) {
            if (problems_.empty()) code_ = errors.code();
            problems_.insert(problems_.end(), errors.problems().begin(), errors.problems().end());
        }
    }
    void throw_if_any(const Scene& scene) {
        if (!problems_.empty()) throw_problems(std::move(problems_), scene.file_places.scene_file, code_);
    }

  private:
    std::vector<Problem> problems_;
    ErrorCode code_ = ErrorCode::io;
};

// Reads one file after the other, as long as there is memory for their values.
class SampleReader {
  public:
    std::shared_ptr<const SampleGrid> read(const std::string& file, const std::string& grid, int parts) {
        auto samples = std::make_shared<const SampleGrid>(read_samples(file, grid, parts));
        bytes_ += samples->values.size() * sizeof(float);
        require_memory(bytes_, file + ": its values and those of the files before it");
        return samples;
    }

  private:
    std::size_t bytes_ = 0;
};

void add(Digest& digest, const SampleGrid& grid) {
    for (int axis = 0; axis < 3; ++axis) {
        const double place[2] = {grid.first_m[axis], grid.spacing_m[axis]};
        digest.add(std::as_bytes(std::span(place)));
    }
    digest.add(std::as_bytes(std::span(grid.points)));
    digest.add(std::as_bytes(std::span(grid.values)));
}

// Throws Error(usage) where the wind of a file moves the air further in a step than the automaton can follow.
void require_speed(const Scene& scene, const SampleGrid& samples) {
    double cell_m = std::numeric_limits<double>::infinity();
    for (std::size_t n = 0; n < lattice_count(scene); ++n)
        if (scene.layers.empty() || (scene.layers[n].automaton && !scene.layers[n].is_veil))
            cell_m = std::min(cell_m, automaton_options(scene, n).placement.cell_size_m);
    const double most_m_per_s = double(kMaxCellsOfStep) * cell_m / scene.automaton.time_step_s;
    for (const float value : samples.values)
        if (!(std::abs(double(value)) <= most_m_per_s))
            throw Error(
                ErrorCode::usage,
                fmt::format(
                    "a wind of {} m/s moves the air too far in one step; at most 2^24 cells are possible, "
                    "which are {} m/s",
                    number_text(value, 6), number_text(most_m_per_s, 6)));
}

}  // namespace

std::string key_of_file(const Scene& scene, const std::string& list, std::size_t n) {
    return scene.file_places.of_key.contains(list) ? list : indexed(list, n);
}

void throw_at_key(const Scene& scene, const std::string& key, const Error& error) {
    const auto place = scene.file_places.of_key.find(key);
    if (dynamic_cast<const SceneErrors*>(&error) != nullptr || place == scene.file_places.of_key.end()) throw;
    Problem problem = place->second;
    problem.message = enclosed(key, '`') + ": " + error.what();
    std::vector<Problem> problems;
    problems.push_back(std::move(problem));
    throw SceneErrors(std::move(problems), error.code());
}

Scene with_files(Scene scene) {
    SampleReader reader;
    for (std::size_t f = 0; f < scene.automaton.wind.fields.size(); ++f) {
        WindField& field = scene.automaton.wind.fields[f];
        for (std::size_t n = field.samples.size(); n < field.files.size(); ++n)
            field.samples.push_back({field.start_s + double(n) * field.interval_s,
                                     read_at_key(scene, wind_file_key(scene, f, n), [&] {
                                         auto samples = reader.read(field.files[n], field.grid, kVector);
                                         require_speed(scene, *samples);
                                         return samples;
                                     })});
    }
    for (std::size_t n = 0; n < scene.automaton.field.grids.size(); ++n) {
        ProbabilityGrid& grid = scene.automaton.field.grids[n];
        if (grid.samples || !grid.file) continue;
        read_at_key(scene, grid_file_key(n), [&] {
            grid.samples = reader.read(grid.file->string(), grid.grid, 1);
            check(grid);
        });
    }
    for (LayerOptions& layer : scene.layers)
        if (!layer.wind.keyframes.empty()) layer.wind.fields = scene.automaton.wind.fields;
    return scene;
}

std::string hash_of_files(const Scene& scene) {
    Digest digest;
    bool any = false;
    for (const WindField& field : scene.automaton.wind.fields) {
        for (const VelocitySamples& samples : field.samples) {
            any = true;
            add(digest, *samples.grid);
        }
    }
    for (const ProbabilityGrid& grid : scene.automaton.field.grids) {
        if (!grid.samples) continue;
        any = true;
        add(digest, *grid.samples);
    }
    return any ? digest.hex() : std::string();
}

FileStamps stamps_of(const Scene& scene, const std::vector<FileKind>& kinds) {
    FileStamps stamps;
    Scene named = scene;
    for_each_file(named, [&](const std::string&, FileKind kind, const std::filesystem::path& file) {
        if (std::ranges::count(kinds, kind) > 0) stamps.emplace(file, file_stamp(file));
        return file;
    });
    return stamps;
}

std::shared_ptr<const HeightMap> read_terrain(const Scene& scene) {
    return read_at_key(scene, "ground.height_map",
                       [&] { return make_terrain(scene.render.terrain, scene.render.ground); });
}

void require_cameras_above(const Scene& scene, const HeightMap* terrain, int first_frame, int last_frame) {
    const Camera& camera = scene.render.camera;
    if (!scene.render.terrain.any() || first_frame > last_frame) return;
    RenderOptions options = scene.render;
    for (int number = first_frame; number <= (camera.path.empty() ? first_frame : last_frame); ++number) {
        const double time_s = frame_time_s(scene.frames, number - 1);
        require_above_ground(camera, time_s);
        if (terrain == nullptr) continue;
        options.camera = standing_camera(camera, terrain, scene.render.ground, time_s);
        require_above_terrain(*terrain, options);
    }
}

void check_files(const Scene& scene) {
    Collector found;
    found.add([&] { initial_state(scene); });
    for (std::size_t n = 0; n < scene.layers.size(); ++n) found.add([&] { initial_state_of_layer(scene, n); });
    for (std::size_t f = 0; f < scene.automaton.wind.fields.size(); ++f) {
        const WindField& field = scene.automaton.wind.fields[f];
        for (std::size_t n = 0; n < field.files.size(); ++n)
            found.add([&] {
                read_at_key(scene, wind_file_key(scene, f, n), [&] {
                    require_speed(scene, *SampleReader().read(field.files[n], field.grid, kVector));
                });
            });
    }
    for (std::size_t n = 0; n < scene.automaton.field.grids.size(); ++n)
        found.add([&] {
            read_at_key(scene, grid_file_key(n), [&] {
                ProbabilityGrid grid = scene.automaton.field.grids[n];
                if (!grid.file) return;
                grid.samples = SampleReader().read(grid.file->string(), grid.grid, 1);
                check(grid);
            });
        });
    for (const TextureFile& texture : texture_files(scene))
        found.add([&] { read_at_key(scene, texture.key, [&] { read_alpha_image(texture.file); }); });
    std::shared_ptr<const HeightMap> terrain;
    // Generating heights takes its time, and they are not needed where the camera stands on them.
    const TerrainOptions& options = scene.render.terrain;
    const bool is_needed =
        options.relief != Relief::none && wants_pictures(scene) && !scene.render.camera.above_ground;
    if (options.height_map || is_needed) found.add([&] { terrain = read_terrain(scene); });
    found.throw_if_any(scene);
    if (!wants_pictures(scene)) return;
    try {
        require_cameras_above(scene, terrain.get(), 1, frame_count(scene));
    } catch (const Error& error) {
        Problem problem;
        problem.where.file = scene.file_places.scene_file;
        problem.message = error.what();
        throw_problems({std::move(problem)}, scene.file_places.scene_file, error.code());
    }
}

}  // namespace nephos
