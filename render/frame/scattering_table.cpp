// SPDX-License-Identifier: Apache-2.0
#include "render/frame/scattering_table.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

#include <glm/gtc/packing.hpp>

#include "render/options/droplet_phase.h"
#include "render/shared/march.h"
#include "render/shared/shared.h"

namespace nephos {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::size_t kAngles = shader::kScatterAngles, kDepths = shader::kScatterDepths;

// Inverts shader::scatter_column().
double cosine_of_column(std::size_t column) {
    const double place = double(column) / double(kAngles - 1);
    const double v = 2 * std::min(place, 1 - place);
    return (place <= 0.5 ? 1 : -1) * (1 - v * v * v * v);
}

// Inverts shader::scatter_row().
double depth_of_row(std::size_t row) {
    return std::exp2(double(row) / double(shader::kScatterRowsPerDoubling)) - 1;
}

// Diffusion through a slab of optical depth tau lets 1 / (1 + 3/4 (1 - g) tau) through when nothing is
// absorbed. A cloud is no slab and loses light through its sides as well: twice the decay shows its relief.
// T's absorption has light fall off in proportion to the way, to nothing: light that was scattered often does
// the same.
double diffuse_light(const CloudLight& light, double depth) {
    if (light.lighting == Lighting::cfa) return std::exp(-depth);
    return 1 / (1 + 1.5 * (1 - mean_cosine(light.phase)) * depth);
}

// Of light that was scattered forwards a few times, pi times what is scattered into an angle.
double scattered_forwards(const PhaseFunction& function, double cos_theta) {
    const double directed = std::max(mean_cosine(function), 0.0), back = 0.5 * (1 - cos_theta);
    const auto g = float(directed);
    return double(shader::forward_light(g)) * kPi * phase(function, cos_theta, directed) +
           0.25 * double(shader::turned_back(g)) * (1 - directed) * back * back;
}

void add_diffusion(const CloudLight& light, std::vector<float>& table) {
    for (std::size_t row = 0; row < kDepths; ++row) {
        const double value = light.multiple_scattering * diffuse_light(light, depth_of_row(row));
        std::fill_n(table.begin() + std::ptrdiff_t((1 + row) * kAngles), kAngles, float(value));
    }
}

void add_octaves(const CloudLight& light, std::vector<float>& table) {
    const ScatteringOctaves& octaves = light.octaves;
    double weight = light.multiple_scattering, reach = 1, directed = 1;
    for (int octave = 1; octave < octaves.count; ++octave) {
        weight *= octaves.scattering * light.albedo;
        reach *= octaves.extinction;
        directed *= octaves.asymmetry;
        std::array<double, kAngles> phases;
        for (std::size_t column = 0; column < kAngles; ++column)
            phases[column] = weight * kPi * phase(light.phase, cosine_of_column(column), directed);
        for (std::size_t row = 0; row < kDepths; ++row) {
            const double arriving = std::exp(-reach * depth_of_row(row));
            float* const to = &table[(1 + row) * kAngles];
            for (std::size_t column = 0; column < kAngles; ++column)
                to[column] += float(arriving * phases[column]);
        }
    }
}

void append_colours(const CloudLight& light, std::vector<float>& table) {
    std::vector<double> cosines;
    for (std::size_t column = 0; column < kAngles; ++column) cosines.push_back(cosine_of_column(column));
    const auto factors = bow_factors(
        light.phase, {.effective_diameter_um = light.phase.droplet_diameter_um, .effective_variance = light.droplet_variance},
        light.bows, cosines);
    for (std::size_t colour = 0; colour < 3; ++colour)
        for (std::size_t column = 0; column < kAngles; ++column)
            table.push_back(float(kPi * phase(light.phase, cosines[column]) * factors[column][colour]));
}

struct Between {
    std::size_t below;
    float fraction;  // of the node above
};

Between between(float place, std::size_t nodes) {
    const std::size_t below = std::min(std::size_t(place), nodes - 2);
    return {below, place - float(below)};
}

float mix(float a, float b, float fraction) { return a + fraction * (b - a); }

float at(const std::vector<float>& table, std::size_t row, const Between& angle) {
    const float* const nodes = &table[row * kAngles + angle.below];
    return mix(nodes[0], nodes[1], angle.fraction);
}

}  // namespace

std::vector<float> scattering_table(const CloudLight& light) {
    std::vector<float> table((2 + kDepths) * kAngles);
    for (std::size_t column = 0; column < kAngles; ++column)
        table[column] = float(kPi * phase(light.phase, cosine_of_column(column)));
    for (std::size_t column = 0; column < kAngles; ++column)
        table[(1 + kDepths) * kAngles + column] = float(scattered_forwards(light.phase, cosine_of_column(column)));
    if (light.multiple == MultipleScattering::diffusion)
        add_diffusion(light, table);
    else
        add_octaves(light, table);
    if (light.bows > 0) append_colours(light, table);
    return table;
}

float scattered_once(const std::vector<float>& table, float cos_theta) {
    return at(table, 0, between(shader::scatter_column(cos_theta), kAngles));
}

float scattered_often(const std::vector<float>& table, float cos_theta, float depth) {
    const Between angle = between(shader::scatter_column(cos_theta), kAngles),
                  row = between(shader::scatter_row(depth), kDepths);
    return mix(at(table, 1 + row.below, angle), at(table, 2 + row.below, angle), row.fraction);
}

// Bit 30 keeps the float that these bits make from being denormal, which processors may take for 0; as a half of a depth
// is finite it is no NaN either.
float two_depths(const SunDepths& depths) {
    const auto bits = [](float depth) { return std::uint32_t(glm::packHalf1x16(std::min(depth, shader::kMaxSunDepth))); };
    return std::bit_cast<float>(0xc0000000u | bits(depths.once) << 15 | bits(depths.often));
}

SunDepths depths_of(float sun_depth) {
    if (!(sun_depth < 0)) return {sun_depth, sun_depth};
    const auto both = std::bit_cast<std::uint32_t>(sun_depth);
    return {glm::unpackHalf1x16(std::uint16_t(both >> 15 & 0x7fffu)), glm::unpackHalf1x16(std::uint16_t(both & 0x7fffu))};
}

void to_sun_depths(std::vector<float>& light) {
    for (float& value : light)
        value = value > 0 ? std::min(-std::log(value), shader::kMaxSunDepth) : shader::kMaxSunDepth;
}

}  // namespace nephos
