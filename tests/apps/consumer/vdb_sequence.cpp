// SPDX-License-Identifier: Apache-2.0

// Simulates a scene and writes the density of each frame: vdb_sequence SCENE.toml FOLDER

#include <cstdio>

#include "core/error.h"
#include "scenes/format/reader.h"
#include "simulation/frame_writer.h"
#include "simulation/simulation.h"

struct DensityFiles : nephos::SimulationSink {
    explicit DensityFiles(const nephos::FrameWriter& to) : writer(to) {}
    void step(const nephos::StepResult&) override {}
    void frame(const nephos::FrameResult& frame) override { writer.write_density(frame); }
    const nephos::FrameWriter& writer;
};

int main(int argc, char** argv) try {
    if (argc != 3) return 2;
    const nephos::Scene scene = nephos::read_scene(argv[1]);
    const nephos::FrameWriter writer(scene, {argv[2], scene.name});
    DensityFiles files(writer);
    nephos::Simulation simulation(scene);
    while (!simulation.finished()) simulation.advance(files);
} catch (const nephos::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return int(error.code());
}
