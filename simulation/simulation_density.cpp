// SPDX-License-Identifier: Apache-2.0

// The part of Simulation that makes density and moisture: at steps, and at the moments of frames between them.

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "density/carry.h"
#include "density/combine.h"
#include "density/sharpen.h"
#include "density/smoothing.h"
#include "simulation/motion.h"
#include "simulation/simulation.h"

namespace nephos {

DensityGrid Simulation::density_of(std::size_t layer, std::uint64_t step) const {
    if (layers_[layer].is_veil()) return layers_[layer].veil_at(time_s({step, 0}));
    const Automaton* automaton = layers_[layer].automaton();
    if (automaton == nullptr) return {};
    const std::uint64_t reach = window();
    std::vector<TimedPlane> planes;
    for (std::uint64_t at = step > reach ? step - reach : 0; at <= step + reach; ++at) {
        planes.push_back(
            {past(at).layers[layer].planes->cld.view(), int(std::int64_t(at) - std::int64_t(step))});
    }
    const AutomatonOptions& lattice = automaton->options();
    return scaled(smooth(planes, scene_.density.smoothing, lattice.placement, lattice.boundaries),
                  layers_[layer].opacity());
}

const std::vector<DensityGrid>& Simulation::densities_at_step(std::uint64_t step) {
    for (const Densities& known : densities_) {
        if (known.step == step) return known.layers;
    }
    Densities made{step, {}, {}, {}};
    for (std::size_t n = 0; n < layers_.size(); ++n)
        made.layers.push_back(makes_density(n) ? density_of(n, step) : DensityGrid());
    made.moisture.resize(layers_.size());
    made.gradients.resize(layers_.size());
    densities_.push_back(std::move(made));
    return densities_.back().layers;
}

DensityGrid Simulation::density_at(std::size_t layer, const Moment& moment) {
    if (moment.fraction != 0 && layers_[layer].is_veil()) return layers_[layer].veil_at(time_s(moment));
    const DensityGrid before = densities_at_step(moment.step)[layer];
    if (!layers_[layer].automaton()) return before;
    if (moment.fraction == 0) return carried_to(layer, moment, before, before);
    const DensityGrid mixed = carried_to(layer, moment, before, densities_at_step(moment.step + 1)[layer]);
    // As sharp as the frames on the two steps.
    std::vector<Vec2> gradients = gradients_at_step(layer, moment.step);
    const std::vector<Vec2>& later = gradients_at_step(layer, moment.step + 1);
    for (std::size_t k = 0; k < gradients.size(); ++k)
        gradients[k] = gradients[k] + (later[k] - gradients[k]) * moment.fraction;
    return sharpened(mixed, gradients, layers_[layer].boundaries());
}

// The sums of gradients of the frame on a step, which the wind has carried by less than a cell. The step must have been
// taken, and is named as the end of that before it, as nothing is known of the wind after the last.
const std::vector<Vec2>& Simulation::gradients_at_step(std::size_t layer, std::uint64_t step) {
    densities_at_step(step);
    const auto known = std::ranges::find(densities_, step, &Densities::step);
    std::optional<std::vector<Vec2>>& gradients = known->gradients[layer];
    if (!gradients) {
        const Moment end = step > 0 ? Moment{step - 1, 1} : Moment{0, 0};
        const std::vector<Vec2> shift =
            displacement_of_density(*layers_[layer].automaton(), scene_.density.smoothing, step, end);
        const Boundaries boundaries = layers_[layer].boundaries();
        gradients = gradients_of(carried({&known->layers[layer], shift}, boundaries), boundaries);
    }
    return *gradients;
}

// A grid of the step at or before a moment and that of the step after it, both carried by the wind to the moment.
DensityGrid Simulation::carried_to(std::size_t layer, const Moment& moment, const DensityGrid& before,
                                   const DensityGrid& after) const {
    const Automaton& automaton = *layers_[layer].automaton();
    const SmoothingOptions& smoothing = scene_.density.smoothing;
    const Boundaries boundaries = layers_[layer].boundaries();
    const std::vector<Vec2> from = displacement_of_density(automaton, smoothing, moment.step, moment);
    if (moment.fraction == 0) return carried({&before, from}, boundaries);
    const std::vector<Vec2> to = displacement_of_density(automaton, smoothing, moment.step + 1, moment);
    return carried_mix({&before, from}, {&after, to}, moment.fraction, boundaries);
}

// The same window in time as the density, and a wider one in space: growth belongs to parts of a cloud, not to cells.
DensityGrid Simulation::moisture_of(std::size_t layer, std::uint64_t step) {
    densities_at_step(step);
    const auto known = std::ranges::find(densities_, step, &Densities::step);
    std::optional<DensityGrid>& moisture = known->moisture[layer];
    if (moisture) return *moisture;
    const std::uint64_t reach = window();
    std::vector<BitPlane> moist;
    std::vector<int> offsets;
    for (std::uint64_t at = step > reach ? step - reach : 0; at <= step + reach; ++at) {
        const Lattice& planes = *past(at).layers[layer].planes;
        BitPlane& to = moist.emplace_back(planes.hum.extent());
        for (std::size_t n = 0; n < to.words().size(); ++n)
            to.words()[n] = planes.hum.words()[n] | planes.act.words()[n];
        offsets.push_back(int(std::int64_t(at) - std::int64_t(step)));
    }
    std::vector<TimedPlane> planes;
    for (std::size_t n = 0; n < moist.size(); ++n) planes.push_back({moist[n].view(), offsets[n]});
    SmoothingOptions wider = scene_.density.smoothing;
    wider.i0 = std::max(wider.i0, 3);
    wider.j0 = std::max(wider.j0, 3);
    wider.k0 = std::max(wider.k0, 2);
    const AutomatonOptions& lattice = layers_[layer].automaton()->options();
    moisture = smooth(planes, wider, lattice.placement, lattice.boundaries);
    return *moisture;
}

std::optional<DensityGrid> Simulation::moisture_at(std::size_t layer, const Moment& moment) {
    const bool detailed =
        scene_.layers.empty() ? scene_.density.detail.enabled : layer_detail(scene_, layer).enabled;
    if (!detailed || !remembers_planes(layer)) return std::nullopt;
    const DensityGrid before = moisture_of(layer, moment.step);
    return carried_to(layer, moment, before,
                      moment.fraction == 0 ? before : moisture_of(layer, moment.step + 1));
}

}  // namespace nephos
