// SPDX-License-Identifier: Apache-2.0
#pragma once

// Sunlight that is scattered many times in a cloud with detail, by the diffusion equation on the cells of the
// lattice, or on cells twice as large. It conserves energy: a thick cloud is white from above and grey from below, and what
// leaves through the sides is missing inside. Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"
#include "render/cloud/diffusion_cells.h"

namespace nephos {

// What diffuses at the corners of cells, kLightNodesOfBrick pairs of bytes for each brick and one pair more. Fluence is
// that per irradiance of the sun on a plane that faces it.
struct DiffuseLight {
    // Lower byte: 255 sqrt(fluence / kMostFluence); upper byte: upward flux / fluence, 1..255 for -1..1.
    std::vector<std::uint16_t> upwards;
    // Flux to the east and to the north, likewise.
    std::vector<std::uint16_t> sideways;
};

// Solves div(D grad fluence) = absorption fluence - source, D = 1 / (3 (1 - g) extinction): the first-order spherical
// harmonics of the equation of radiative transfer (A. Ishimaru 1978, "Wave Propagation and Scattering in Random Media",
// chapter 9; J. Stam 1995, "Multiple Scattering as a Diffusion Process"), with Marshak's condition of no incoming light
// at faces of cells without cloud. The source is what the sunlight loses, attenuated by (1 - g) times its depth.
// `wide`: null, or those of which `cells` are halved(), which then takes less time. `sun_depths`: at the corners of lattice
// cells. `to_sun`: a unit direction. `albedo`: of single scattering. Results do not depend on the number of threads.
DiffuseLight diffuse_sunlight(const DiffusionCells& cells, const DiffusionCells* wide, std::span<const float> sun_depths,
                              const Vec3& to_sun, double albedo);

// Solves the same for a sky that shines through all faces without cloud, of radiance 1 above the horizon: none of its light
// starts within a cell, and wide ones do. Returns pairs of bytes at the corners of lattice cells, like DiffuseLight: the
// fractions of light from the sky (lower byte) and from the ground (upper byte) that are scattered there, 0..255.
std::vector<std::uint16_t> diffuse_surroundings(const DiffusionCells& wide);

}  // namespace nephos
