// SPDX-License-Identifier: Apache-2.0
#pragma once

// A scene that is stepped and looked at: what the Python module's Simulation stands for, without Python. The engine is
// Simulation (simulation/simulation.h), nothing is computed here.

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "statistics/clouds.h"

#include "density/density_grid.h"
#include "render/image/image_file.h"
#include "simulation/frame_painter.h"
#include "simulation/simulation.h"

namespace nephos {

// A layer by its number or name.
using LayerKey = std::variant<std::int64_t, std::string>;

// The planes of a layer, and where they lie.
struct LayerPlanes {
    std::shared_ptr<const Lattice> planes;  // never null
    Placement placement;
    Boundaries boundaries;
};

// Thread-safe: calls of several threads take turns.
class LiveSimulation {
  public:
    // Starts at step 0. Throws as Simulation, and Error(usage) when the scene does not fit into memory.
    explicit LiveSimulation(Scene scene);

    // Takes steps until `count` are done or `seconds` have passed, at least one; returns how many. Throws Error(usage)
    // beyond kMaxSteps.
    std::uint64_t step(std::uint64_t count, double seconds);
    std::uint64_t step_number() const;
    double time_s() const;
    std::vector<std::string> layers() const;  // names; one empty name for a scene without layers

    // Of the present state. Throw Error(usage) when there is no such layer, or it has no automaton.
    std::string hash();
    StepResult statistics(bool density);
    LayerPlanes planes(const LayerKey& layer);
    // Without a layer of all together. Throws Error(usage) when there is none.
    DensityGrid density(const std::optional<LayerKey>& layer);
    // Opens the back-end of the scene's `frames.splatting` on the first call. Throws as FramePainter.
    Rgb8Image picture();
    std::size_t layer_number(const LayerKey& layer) const;

  private:
    // Who waits comes before one that just had its turn: a mutex alone may go to the same thread again and again.
    std::unique_lock<std::mutex> turn() const;

    mutable std::mutex mutex_, next_;  // next_: of the one that is next
    Scene scene_;
    std::optional<Simulation> simulation_;
    std::optional<FramePainter> painter_;
};

}  // namespace nephos
