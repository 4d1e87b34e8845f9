// SPDX-License-Identifier: Apache-2.0
#pragma once

// Where to stand and what to assume when a volume is drawn without a scene: a camera that shows all of it, a
// ground below it, and an extinction that makes it visible whatever its units are.

#include <string>

#include "density/density_grid.h"
#include "render/options/options.h"

namespace nephos {

// A box in the world, metres.
struct WorldBox {
    Vec3 min_m{}, max_m{};
};

// Returns the box around the voxels above 0; the whole grid when there is none.
WorldBox cloud_box(const DensityGrid& grid);

enum class View {
    side,   // from the south, a little above the middle
    below,  // from the ground south of it, looking up
    above,  // straight from above, north up
};

// Sets position and target of `camera` so that the box just fits into the picture (View::below: stands close
// and looks at its middle); keeps its field of view and size. The eye stays at least 2 m above `ground_m`.
void frame(Camera& camera, const WorldBox& box, View view, double ground_m);

// 0, or below the box when the box reaches below 0 (volumes that are centred at the origin).
double ground_below(const WorldBox& box);

// Extinction per metre at density 1 with which a straight way through the middle of the box, as long as its
// mean edge and at the mean density of its cloudy voxels, has the optical depth 12: opaque in the core, soft
// at the rim.
double visible_extinction_per_m(const DensityGrid& grid);

}  // namespace nephos
