// SPDX-License-Identifier: Apache-2.0
#include "simulation/simulation.h"

#include <fmt/format.h>

#include "core/error.h"
#include "core/text.h"
#include "density/vdb/vdb_file.h"
#include "simulation/memory.h"

namespace nephos {

void require_memory(std::size_t bytes, const std::string& what) {
    const AvailableMemory available = available_memory();
    if (bytes <= available.bytes) return;
    throw Error(ErrorCode::usage,
                fmt::format("{} takes about {}, but {} ({}) are all there is", what, bytes_text(bytes),
                            bytes_text(available.bytes), available.limit));
}

std::optional<Lattice> initial_state(const Scene& scene, const std::string& from) {
    const AutomatonOptions& lattice = scene.automaton;
    if (!from.empty()) return read_state(from, lattice.extent, lattice.placement);
    if (scene.initial_state_file) {
        return read_state(*scene.initial_state_file, lattice.extent, lattice.placement);
    }
    return {};
}

std::vector<LayerSimulation> start_layers(const Scene& scene, const std::string& scene_file,
                                          const std::string& from) {
    if (!from.empty() && !scene.layers.empty()) {
        throw Error(ErrorCode::usage,
                    fmt::format("{}: has layers, but --from gives the state of one lattice", scene_file));
    }
    std::size_t bytes = 0;
    for (std::size_t n = 0; n < lattice_count(scene); ++n) {
        if (!scene.layers.empty() && scene.layers[n].is_veil) continue;  // holds nothing
        bytes += Automaton::memory_bytes(automaton_options(scene, n));
    }
    const Extent& extent = scene.automaton.extent;
    require_memory(bytes, scene.layers.empty()
                              ? fmt::format("{}: a lattice of {} x {} x {} cells", scene_file, extent.x,
                                            extent.y, extent.z)
                              : fmt::format("{}: {} layers", scene_file, scene.layers.size()));
    return make_layers(scene, initial_state(scene, from));
}

}  // namespace nephos
