// SPDX-License-Identifier: Apache-2.0
#pragma once

// Falling particles as a structure of arrays. The position of a particle is a function of seed, index and
// time alone: there is no state between frames, so that frames can be computed in any order and by any number
// of threads, and a resumed run has the same drops. The update is one pass over the arrays, without P's
// record of positions.
//
// Particle i repeats in a lattice of boxes that fills the world and drifts with the wind; its image nearest
// to the container's centre is drawn. The boxes are as wide as the particle's reach: i is drawn within e_i =
// depth cbrt(u_i) of the centre, u_i uniform in 0..1, so that the number of particles per volume at a
// distance d depth is
//
//     sum of 1 / (4 e^2 height) over e > d depth  ~  integral from d to 1 of 3 e^2 / e^2 de  ~  1 - d
//
// which is P's level of detail with a fixed total: no particle is computed and rejected, and none moves when
// the eye or the container does.

#include <cstdint>
#include <vector>

#include "render/options/precipitation_options.h"

namespace nephos {

struct Particles {
    PrecipitationKind kind = PrecipitationKind::rain;
    std::vector<float> x, y, z;      // phases in the box, 0..1
    std::vector<float> reach;        // cbrt(u), 0..1
    std::vector<float> speed;        // of fall, m/s
    std::vector<float> diameter_mm;  // of its water
    std::size_t size() const { return x.size(); }
};

// Generates particles as a function of kind, seed and count; with a larger count the first ones are the same.
Particles make_particles(PrecipitationKind kind, std::uint64_t seed, std::size_t count);

// The boxes of one frame, in world metres.
struct ParticleBoxes {
    double centre_x_m = 0, centre_y_m = 0, centre_z_m = 0;  // of the container
    double carried_x_m = 0, carried_y_m = 0;                // displacement of the air since time 0
    double time_s = 0;
    double depth_m = 16;   // > 0
    double margin_m = 1;   // boxes are wider by this
    double height_m = 16;  // > 0
};

// Computes the positions of particles begin .. end - 1 relative to the centre: |x|, |y| <= e_i + margin / 2,
// |z| <= height / 2. SIMD; the same bits on every processor. Thread-safe on ranges that do not overlap.
void place_particles(const Particles& particles, const ParticleBoxes& boxes, std::size_t begin,
                     std::size_t end, float* x_m, float* y_m, float* z_m);

}  // namespace nephos
