// SPDX-License-Identifier: Apache-2.0
#pragma once

// The small hollows of the ground, in which puddles stand, and the tufts that snow leaves free: smooth noise
// of several wavelengths, each turned against the others, over the whole world. What is too fine for a pixel
// is left out and counts as a variance instead (ground_noise-inl.h). Private to the module.

#include <cstdint>
#include <span>
#include <vector>

#include "core/vec.h"

namespace nephos {

// One wavelength. A point p, relative to the eye, lies in the noise's own lattice at
//     (cell_x, cell_y) + (from_x + x_x p.x + x_y p.y, from_y + y_x p.x + y_y p.y)
struct NoiseOctave {
    float x_x = 1, x_y = 0, y_x = 0, y_y = 1;
    float from_x = 0, from_y = 0;          // 0..1
    std::uint32_t cell_x = 0, cell_y = 0;  // modulo 2^32
    float wavelength_m = 1;
    float weight = 1;  // of noise with variance 1
};

// Wavelengths largest_m * ratio^n, each `count`, with weights such that the sum has variance 1.
struct NoiseSpectrum {
    double largest_m = 40, ratio = 0.4;
    int count = 6;
    double falloff = 0.9;  // of the weight from octave to octave
    std::uint32_t seed = 0;
};
std::vector<NoiseOctave> noise_octaves(const NoiseSpectrum& spectrum, const Vec3& eye_m);

}  // namespace nephos
