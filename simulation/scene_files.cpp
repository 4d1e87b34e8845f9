// SPDX-License-Identifier: Apache-2.0
#include "simulation/scene_files.h"

#include <memory>
#include <span>
#include <utility>

#include "core/digest.h"
#include "density/vdb/vdb_file.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

constexpr int kVector = 3;

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

}  // namespace

Scene with_files(Scene scene) {
    SampleReader reader;
    for (WindField& field : scene.automaton.wind.fields) {
        for (std::size_t n = field.samples.size(); n < field.files.size(); ++n)
            field.samples.push_back({field.start_s + double(n) * field.interval_s,
                                     reader.read(field.files[n], field.grid, kVector)});
    }
    for (ProbabilityGrid& grid : scene.automaton.field.grids)
        if (!grid.samples && grid.file) grid.samples = reader.read(grid.file->string(), grid.grid, 1);
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

}  // namespace nephos
