// SPDX-License-Identifier: Apache-2.0
#pragma once

// Particles that fall, as arrays. Where a particle is at a time is a function of seed, index and time alone:
// nothing is carried from picture to picture, so that frames can be made in any order and by any number of
// threads, and a run that is resumed rains the same drops. It also makes the update one pass over the
// arrays, without the record of positions that P's needs.
//
// Particle i has its place in a lattice of boxes that fills the world and drifts with the wind; the box that
// holds it next to the container's centre counts. Its box is as wide as the particle reaches: i is drawn
// within e_i = depth cbrt(u_i) of the centre, u_i even in 0..1, so that the number of particles per volume
// at a distance d depth is
//
//     sum of 1 / (4 e^2 height) over e > d depth  ~  integral from d to 1 of 3 e^2 / e^2 de  ~  1 - d
//
// which is P's level of detail, with the total fixed: no particle is tried and thrown away, and none moves
// when the eye or the container does.

#include <cstdint>
#include <vector>

#include "render/options/precipitation_options.h"

namespace nephos {

struct Particles {
    PrecipitationKind kind = PrecipitationKind::rain;
    std::vector<float> x, y, z;      // phases in the box, 0..1
    std::vector<float> reach;        // cbrt(u), 0..1
    std::vector<float> speed;        // of fall, m/s
    std::vector<float> diameter_mm;  // of the water in it
    std::size_t size() const { return x.size(); }
};

// Reproducible: a function of kind, seed and count; with more particles the first ones stay the same.
Particles make_particles(PrecipitationKind kind, std::uint64_t seed, std::size_t count);

// The boxes of one picture. World metres.
struct ParticleBoxes {
    double centre_x_m = 0, centre_y_m = 0, centre_z_m = 0;  // of the container
    double carried_x_m = 0, carried_y_m = 0;                // the way of the air since time 0
    double time_s = 0;
    double depth_m = 16;   // > 0
    double margin_m = 1;   // boxes are wider by this
    double height_m = 16;  // > 0
};

// Where particles begin .. end are relative to the centre: |x|, |y| <= e_i + margin / 2, |z| <= height / 2.
// Vectors; the same bits on every processor. Thread-safe on ranges that do not overlap.
void place_particles(const Particles& particles, const ParticleBoxes& boxes, std::size_t begin,
                     std::size_t end, float* x_m, float* y_m, float* z_m);

}  // namespace nephos
