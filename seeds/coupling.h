// SPDX-License-Identifier: Apache-2.0
#pragma once

// The forcing of the automaton by clouds: every seed box becomes an ellipsoid of the probability field
// (automaton/field.h), and every rain area a humid column (rain_area.h). Each step needs one list of both for
// Automaton::set_external_ellipsoids:
//
//     auto ellipsoids = ellipsoids_of(sky, coupling);
//     append_columns(ellipsoids, areas, column);
//     automaton.set_external_ellipsoids(std::move(ellipsoids));
//     automaton.step();
//     sky.step();             // the same wind advects both by the same displacement
//
// The automaton then grows vapour and cloud inside the boxes, merges neighbours, and extinguishes them when
// the boxes dissolve: one type of cloud changes into another, and the wind's profile shears them (both are
// future work in T).

#include <span>
#include <vector>

#include "automaton/automaton.h"
#include "seeds/sky_simulation.h"

namespace nephos {

// Probabilities of the ellipsoids of clouds of one genus.
struct GenusCoupling {
    std::optional<Genus> genus;  // none: of base models without genus
    Probabilities centre{0.1, 0.001, 0.1};
    Probabilities rim{0, 0, 0.1};
    bool operator==(const GenusCoupling&) const = default;
};

struct CouplingOptions {
    double strength = 1;  // 0..1, weight of a whole box of strength 1; 0: the automaton ignores the clouds
    // Semi-axes of the ellipsoid = half the box's edges * size_scale, > 0: 1 inscribes it in the box, 1.24
    // gives it the box's volume, 1.73 circumscribes it about the box.
    double size_scale = 1.24;
    // Lower limit of the semi-axes, >= 0: with about one cell, boxes smaller than a cell are not lost.
    double min_semi_axis_m = 0;
    // Size of the semi-axes when a box begins to form, as a fraction of their full size, 0..1; they grow
    // linearly with the weight of the box.
    double size_at_birth = 0.5;
    Probabilities centre{0.1, 0.001, 0.1};  // as in Ellipsoid
    Probabilities rim{0, 0, 0.1};
    // Instead of these two for clouds of some genera; what a base model has of its own comes first.
    std::vector<GenusCoupling> genera;
    bool operator==(const CouplingOptions&) const = default;
};

// Throws Error(usage) on values outside the ranges above.
void check(const CouplingOptions& options);

// Probabilities at the centre and the rim of an ellipsoid.
struct CentreAndRim {
    Probabilities centre, rim;
};

// Returns the probabilities of the ellipsoids of a base model: its own, else those of its genus, else those of all
// clouds. Pure.
CentreAndRim probabilities_of(const BaseModel& model, const CouplingOptions& options);

// Appends the ellipsoids of one cloud at a world position, in the order of its boxes, without those of weight
// 0; weight = strength * Seed::strength of the box * phase_weight() of the box. `softness` as
// SkyOptions::formation_softness.
void append_ellipsoids(std::vector<ActiveEllipsoid>& out, const BaseModel& model, const Cloud& cloud,
                       const Vec3& position_m, double phase, double softness, const CouplingOptions& options);

// Returns the ellipsoids of all clouds of a layer, oldest cloud first.
std::vector<ActiveEllipsoid> ellipsoids_of(const SkySimulation& sky, const CouplingOptions& options);

}  // namespace nephos
