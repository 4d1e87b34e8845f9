// SPDX-License-Identifier: Apache-2.0

// Simulates a scene and draws each frame: png_frames SCENE.toml FOLDER

#include <cstdio>

#include "core/error.h"
#include "scenes/format/reader.h"
#include "simulation/frame_painter.h"
#include "simulation/frame_writer.h"
#include "simulation/simulation.h"

struct Film : nephos::SimulationSink {
    Film(const nephos::Scene& scene, const char* folder)
        : painter(scene), writer(scene, {folder, scene.name}) {}
    void step(const nephos::StepResult&) override {}
    void frame(const nephos::FrameResult& frame) override {
        writer.write_picture(frame, painter.draw(frame), painter);
    }
    nephos::FramePainter painter;
    nephos::FrameWriter writer;
};

int main(int argc, char** argv) try {
    if (argc != 3) return 2;
    const nephos::Scene scene = nephos::read_scene(argv[1]);
    Film film(scene, argv[2]);
    nephos::Simulation simulation(scene);
    while (!simulation.finished()) simulation.advance(film);
} catch (const nephos::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return int(error.code());
}
