// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/veil_bench.h"

#include <cmath>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "automaton/automaton.h"
#include "core/noise.h"
#include "density/smoothing.h"
#include "density/veil.h"

namespace nephos::bench {
namespace {

constexpr Extent kExtent{256, 256, 24};
const Placement kPlacement{{0, 0, 7400}, 80};
const Wind kWind{{{0, {{0, {27, 9}}}}}};

// Five octaves of displaced ridges, as the cirrus of scenes/cirrus.toml.
VeilOptions cirrus() {
    VeilOptions o;
    o.octave_count = 5;
    o.wavelength_m = 6000;
    o.stretch = 2;
    o.stretch_up = 3;
    o.displacement = 0.2;
    o.coverage = 0.4;
    o.base_m = 7400;
    o.top_m = 7400 + 24 * 80;
    o.fallstreak_m = 7500;
    return o;
}

// Cirrus of an automaton: births in ellipsoids would be dearer; here they are everywhere and few.
AutomatonOptions cirrus_of_automaton() {
    AutomatonOptions o;
    o.extent = kExtent;
    o.placement = kPlacement;
    o.field.background = {0.02, 0.001, 0.2};
    o.wind = kWind;
    return o;
}

BenchRow copy_row() {
    const std::vector<float> from(kExtent.cells(), 0.5f);
    std::vector<float> to(from.size());
    double sum = 0;
    const auto [ours, other] = interleave(
        5, [&] { sum += veil_density(cirrus(), kWind, kExtent, kPlacement, 600).sum(); },
        [&] { std::memcpy(to.data(), from.data(), from.size() * sizeof(float)); });
    if (!(sum > 0)) throw std::runtime_error("the veil is empty");
    return {"veil, 5 octaves, 256 x 256 x 24 -> FloatGrid, against memcpy of the floats", ours, other, "",
            fmt::format("one core, {:.1f} Mvoxel/s", double(kExtent.cells()) / ours / 1e3)};
}

BenchRow automaton_row() {
    Automaton automaton(cirrus_of_automaton());
    for (int n = 0; n < 20; ++n) automaton.step();
    double sum = 0;
    const SmoothingOptions window{SmoothingKernel::gaussian, 5, 1, 1, 0};
    const auto [ours, other] = interleave(
        5, [&] { sum += veil_density(cirrus(), kWind, kExtent, kPlacement, 600).sum(); },
        [&] {
            automaton.step();
            const TimedPlane now[] = {{automaton.cld(), 0}};
            sum += smooth(now, window, kPlacement, {}).sum();
        });
    if (!(sum > 0)) throw std::runtime_error("the sky is empty");
    return {"the same, against a step of an automaton of as many cells and its smoothing", ours, other, "",
            "one core; of any moment alone, without the steps before it"};
}

// S's virtual third dimension: two bilinear look-ups in a periodic 2-D texture, mixed.
class TextureNoise {
  public:
    TextureNoise() : texels_(std::size_t(kEdge) * kEdge) {
        std::uint32_t state = 1;
        for (float& t : texels_) {
            state = state * 1664525u + 1013904223u;
            t = float(state >> 8) * 0x1p-24f;
        }
    }
    float at(float x, float y, float z) const {
        const float level = std::floor(z), part = z - level;
        const float a = layer(x + level * 37, y + level * 17),
                    b = layer(x + level * 37 + 37, y + level * 17 + 17);
        return a + (b - a) * part;
    }

  private:
    static constexpr int kEdge = 1024;
    float texel(int x, int y) const {
        return texels_[std::size_t((y & (kEdge - 1)) * kEdge + (x & (kEdge - 1)))];
    }
    float layer(float x, float y) const {
        const float fx = std::floor(x), fy = std::floor(y), u = x - fx, v = y - fy;
        const int i = int(fx), j = int(fy);
        const float low = texel(i, j) + (texel(i + 1, j) - texel(i, j)) * u;
        const float high = texel(i, j + 1) + (texel(i + 1, j + 1) - texel(i, j + 1)) * u;
        return low + (high - low) * v;
    }
    std::vector<float> texels_;
};

BenchRow texture_row() {
    constexpr std::size_t kPoints = 1 << 20;
    std::vector<float> x(kPoints), y(kPoints), z(kPoints), out(kPoints);
    for (std::size_t n = 0; n < kPoints; ++n) {
        x[n] = float(n % 1024) * 0.13f;
        y[n] = float(n / 1024) * 0.13f;
        z[n] = float(n % 7) * 0.31f;
    }
    const TextureNoise texture;
    const auto [ours, other] = interleave(
        5, [&] { gradient_noise(x, y, z, {}, out); },
        [&] {
            for (std::size_t n = 0; n < kPoints; ++n) out[n] = texture.at(x[n], y[n], z[n]);
        });
    return {"noise at 2^20 points, against two look-ups in a 2-D texture of 4 MiB, mixed", ours, other, "",
            "one core"};
}

}  // namespace

std::vector<BenchRow> veil_bench_rows() {
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    return {copy_row(), automaton_row(), texture_row()};
}

}  // namespace nephos::bench
