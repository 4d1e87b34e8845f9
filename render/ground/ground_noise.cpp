// SPDX-License-Identifier: Apache-2.0
#include "render/ground/ground_noise.h"

#include <cmath>

#include "core/noise_hash.h"

namespace nephos {

std::vector<NoiseOctave> noise_octaves(const NoiseSpectrum& spectrum, const Vec3& eye_m) {
    std::vector<NoiseOctave> octaves;
    double size_m = spectrum.largest_m, weight = 1, squares = 0;
    for (int n = 0; n < spectrum.count; ++n) {
        constexpr double kTurn = 2.39996;  // the golden angle: no two octaves share an axis
        const double angle = 0.4 + kTurn * n, c = std::cos(angle) / size_m, s = std::sin(angle) / size_m;
        const double x = c * eye_m.x - s * eye_m.y, y = s * eye_m.x + c * eye_m.y;
        NoiseOctave& octave = octaves.emplace_back();
        octave.x_x = octave.y_y = float(c);
        octave.x_y = float(-s);
        octave.y_x = float(s);
        octave.from_x = float(x - std::floor(x));
        octave.from_y = float(y - std::floor(y));
        const std::uint32_t own = mix_bits(spectrum.seed + std::uint32_t(n) * kAxisStep);
        octave.cell_x = std::uint32_t(std::int64_t(std::floor(x))) + own;
        octave.cell_y = std::uint32_t(std::int64_t(std::floor(y))) + mix_bits(own);
        octave.wavelength_m = float(size_m);
        octave.weight = float(weight);
        squares += weight * weight;
        size_m *= spectrum.ratio;
        weight *= spectrum.falloff;
    }
    for (NoiseOctave& octave : octaves) octave.weight /= float(std::sqrt(squares));
    return octaves;
}

}  // namespace nephos
