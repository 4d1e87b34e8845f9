// SPDX-License-Identifier: Apache-2.0
#pragma once

// Noise over the whole world for the small hollows of the ground, which puddles fill, and the tufts that snow
// covers last: octaves of smooth noise, each rotated against the others. Octaves too fine for a pixel are
// omitted and count as a variance (ground_noise-inl.h). Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace nephos {

// One octave. A point p, relative to the eye, has the coordinates in the octave's lattice
//     (cell_x, cell_y) + (from_x + x_x p.x + x_y p.y, from_y + y_x p.x + y_y p.y)
struct NoiseOctave {
    float x_x = 1, x_y = 0, y_x = 0, y_y = 1;
    float from_x = 0, from_y = 0;          // 0..1
    std::uint32_t cell_x = 0, cell_y = 0;  // modulo 2^32
    float wavelength_m = 1;
    float weight = 1;  // of noise with variance 1
};

// A sum of `count` octaves of wavelengths largest_m * ratio^n, with weights such that the sum has variance 1.
struct NoiseSpectrum {
    double largest_m = 40, ratio = 0.4;
    int count = 6;
    double falloff = 0.9;  // ratio of the weights of successive octaves
    std::uint32_t seed = 0;
};
std::vector<NoiseOctave> noise_octaves(const NoiseSpectrum& spectrum, const Vec3& eye_m);

}  // namespace nephos
