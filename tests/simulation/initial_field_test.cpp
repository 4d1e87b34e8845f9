// SPDX-License-Identifier: Apache-2.0
// The state at step 0 of layers whose lattice is drawn from the field.

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/format/reader.h"
#include "seeds/coupling.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

Scene climate(const std::vector<std::string>& overrides) {
    return read_scene(std::filesystem::path(NEPHOS_SOURCE_DIR) / "tests/golden/climate.toml", overrides);
}

// A state that is drawn from the field is drawn from that of the clouds: vapour at step 0 where their
// ellipsoids are, and nowhere else in a dry background.
TEST(InitialField, IsThatOfTheCloudsInLayers) {
    const Scene scene = climate({"lattice.initial=field"});
    const std::vector<LayerSimulation> layers = make_layers(scene);
    for (std::size_t n = 0; n < layers.size(); ++n) {
        const Automaton& automaton = *layers[n].automaton();
        const Placement& placement = automaton.options().placement;
        const std::vector<ActiveEllipsoid> ellipsoids =
            ellipsoids_of(*layers[n].sky(), scene.layers[n].coupling);
        const Extent e = automaton.options().extent;
        std::size_t humid = 0, inside = 0;
        for (int k = 0; k < e.z; ++k) {
            for (int j = 0; j < e.y; ++j) {
                for (int i = 0; i < e.x; ++i) {
                    if (!automaton.hum().get(i, j, k)) continue;
                    ++humid;
                    inside += std::ranges::any_of(ellipsoids, [&](const ActiveEllipsoid& a) {
                        const auto along = [&](int cell, double origin_m, double centre_m, double half_m) {
                            return (origin_m + (cell + 0.5) * placement.cell_size_m - centre_m) / half_m;
                        };
                        const Vec3 &o = placement.origin_m, &c = a.ellipsoid.centre_m,
                                   &half = a.ellipsoid.semi_axes_m;
                        const double x = along(i, o.x, c.x, half.x), y = along(j, o.y, c.y, half.y),
                                     z = along(k, o.z, c.z, half.z);
                        return x * x + y * y + z * z < 1.0001;
                    });
                }
            }
        }
        EXPECT_EQ(humid == 0, ellipsoids.empty()) << layers[n].name();
        EXPECT_EQ(inside, humid) << layers[n].name();
    }
    EXPECT_GT(ellipsoids_of(*layers[0].sky(), scene.layers[0].coupling).size(), 10u);
    for (const LayerSimulation& layer : make_layers(climate({"lattice.initial=empty"}))) {
        EXPECT_EQ(layer.hash(), Automaton(layer.automaton()->options()).hash()) << layer.name();
    }
}

}  // namespace
}  // namespace nephos
