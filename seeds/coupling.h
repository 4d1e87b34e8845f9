// SPDX-License-Identifier: Apache-2.0
#pragma once

// How clouds drive the automaton: every seed box becomes an ellipsoid of the probability field, and every
// rain area a humid column (rain_area.h). One list a step for Automaton::set_external_ellipsoids:
//
//     auto ellipsoids = ellipsoids_of(sky, coupling);
//     append_columns(ellipsoids, areas, column);
//     automaton.set_external_ellipsoids(std::move(ellipsoids));
//     automaton.step();
//     sky.step();             // both are carried by the same wind over the same way
//
// The automaton then grows vapour and cloud where the boxes are, mixes those of neighbours, and lets go of
// them when the boxes dissolve: one type of cloud changes into another, and the wind's profile shears them
// (T's open wishes).

#include <span>
#include <vector>

#include "automaton/automaton.h"
#include "seeds/sky_simulation.h"

namespace nephos {

struct CouplingOptions {
    double strength =
        1;  // 0..1, weight of a whole box of strength 1; 0: the clouds do not touch the automaton
    // Semi-axes of the ellipsoid = half the box's edges * size_scale. 1 fits it into the box, 1.24 gives it
    // the box's volume, 1.73 puts the box's corners on its rim. > 0
    double size_scale = 1.24;
    double min_semi_axis_m =
        0;  // at least this; about a cell, or boxes smaller than cells fall between them. >= 0
    // Semi-axes while a box forms grow from this fraction of the size to the whole, with the box's phase.
    // 0..1
    double size_at_birth = 0.5;
    Probabilities centre{0.1, 0.001, 0.1};  // as in Ellipsoid
    Probabilities rim{0, 0, 0.1};
    bool operator==(const CouplingOptions&) const = default;
};

// Throws Error(usage) on values outside the ranges above.
void check(const CouplingOptions& options);

// The ellipsoids of one cloud at a world position, in the order of its boxes, without those of weight 0.
// weight = strength * seed's strength * phase_weight(box). `softness` as SkyOptions::formation_softness.
void append_ellipsoids(std::vector<ActiveEllipsoid>& out, const BaseModel& model, const Cloud& cloud,
                       const Vec3& position_m, double phase, double softness, const CouplingOptions& options);

// Those of all clouds of a layer, cloud after cloud, oldest first.
std::vector<ActiveEllipsoid> ellipsoids_of(const SkySimulation& sky, const CouplingOptions& options);

}  // namespace nephos
