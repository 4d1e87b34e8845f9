// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <tbb/parallel_for.h>

#include "render/cloud/light_sweep.h"
#include "render/shared/march.h"

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells, kSide = kCells / 2;  // cells of the equation on a brick's edge
constexpr std::size_t kOfBrick = std::size_t(kSide) * kSide * kSide;
constexpr float kRelaxation = 1.6f;    // of successive over-relaxation, about the best for clouds of 12 cells
constexpr float kSmallChange = 1e-3f;  // of the largest fluence, which ends the iterations
constexpr int kMostRounds = 200;
// Conductance between cells that hold next to nothing: of more the iterations would only take longer.
constexpr float kMostConductance = 2;

// The cells around one: below and above it on each axis.
struct Neighbours {
    std::int32_t cell[6];  // -1: no cloud
};

class DiffusionCells {
  public:
    DiffusionCells(const CoverageField& field, std::span<const float> extinction, std::span<const float> sun_depths,
                   double albedo, double mean_cosine)
        : bricks_(field.places().size()), mean_cosine_(float(mean_cosine)) {
        const auto cell_m = float(4 * field.node_m());
        const std::size_t count = bricks_ * kOfBrick;
        thickness_.resize(count);
        tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
            for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
                float sum = 0;
                for (std::size_t n = 0; n < 8; ++n) {
                    const std::size_t x = 2 * (cell % kSide) + n % 2, y = 2 * (cell / kSide % kSide) + n / 2 % 2,
                                      z = 2 * (cell / kSide / kSide) + n / 4;
                    sum += extinction[brick * kCells * kCells * kCells + (z * kCells + y) * kCells + x];
                }
                thickness_[brick * kOfBrick + cell] = (1 - mean_cosine_) * 0.125f * sum * cell_m;
            }
        });
        find_neighbours(field);
        set_coefficients(sun_depths, float(albedo));
    }

    void solve() {
        fluence_.assign(thickness_.size(), 0.0f);
        std::vector<float> changes(bricks_), largest(bricks_);
        for (int round = 0; round < kMostRounds; ++round) {
            for (int colour = 0; colour < 2; ++colour) {
                // Neighbours have the other colour: cells of one do not wait for each other.
                tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
                    float change = colour == 0 ? 0.0f : changes[brick], most = colour == 0 ? 0.0f : largest[brick];
                    for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
                        if (int((cell & 1) ^ (cell >> 1 & 1) ^ (cell >> 2)) != colour) continue;
                        const std::size_t at = brick * kOfBrick + cell;
                        if (!(thickness_[at] > 0)) continue;
                        const float more = kRelaxation * (balance(at) - fluence_[at]);
                        fluence_[at] += more;
                        change = std::max(change, std::abs(more));
                        most = std::max(most, fluence_[at]);
                    }
                    changes[brick] = change;
                    largest[brick] = most;
                });
            }
            const float change = *std::ranges::max_element(changes), most = *std::ranges::max_element(largest);
            if (!(change > kSmallChange * most)) break;
        }
    }

    std::array<float, 4> fluence_and_flux(std::size_t at) const {
        std::array<float, 4> result{fluence_[at], 0, 0, 0};
        for (std::size_t n = 0; n < 6; ++n) {
            const std::int32_t other = neighbours_[at].cell[n];
            const float towards = other < 0 ? fluence_[at] * loss(thickness_[at])
                                            : (fluence_[at] - fluence_[std::size_t(other)]) *
                                                  conductance(thickness_[at], thickness_[std::size_t(other)]);
            result[1 + n / 2] += (n % 2 == 0 ? -0.5f : 0.5f) * towards;
        }
        return result;
    }

    bool holds_cloud(std::size_t at) const { return thickness_[at] > 0; }

  private:
    // Flux per difference of fluence between two cells of reduced optical thickness a and b, and through a face beyond
    // which there is no cloud.
    static float conductance(float a, float b) { return std::min(1 / (1.5f * (a + b)), kMostConductance); }
    static float loss(float thickness) { return 1 / (2 + 1.5f * thickness); }

    void find_neighbours(const CoverageField& field) {
        neighbours_.resize(thickness_.size());
        const auto& size = field.bricks();
        const int stride[3] = {1, size[0], size[0] * size[1]};
        tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
            const std::int32_t place = field.places()[brick];
            const int at[3] = {place % size[0], place / size[0] % size[1], place / size[0] / size[1]};
            for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
                for (std::size_t n = 0; n < 6; ++n) {
                    const std::size_t axis = n / 2, bit = std::size_t{1} << axis;
                    const bool above = n % 2 == 1, inside = ((cell & bit) != 0) != above;
                    std::int32_t of = std::int32_t(brick);
                    if (!inside) {
                        const int next = at[axis] + (above ? 1 : -1);
                        of = next < 0 || next >= size[axis]
                                 ? -1
                                 : field.table()[std::size_t(place + (above ? stride[axis] : -stride[axis]))];
                    }
                    const std::size_t other = std::size_t(std::max(of, 0)) * kOfBrick + (cell ^ bit);
                    neighbours_[brick * kOfBrick + cell].cell[n] =
                        of >= 0 && thickness_[other] > 0 ? std::int32_t(other) : -1;
                }
            }
        });
    }

    // The balance of a cell: fluence = source + sum over neighbours of weight * theirs.
    void set_coefficients(std::span<const float> sun_depths, float albedo) {
        source_.assign(thickness_.size(), 0.0f);
        weights_.assign(thickness_.size(), {});
        tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
            const float* const depths = &sun_depths[brick * kLightNodesOfBrick];
            for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
                const std::size_t at = brick * kOfBrick + cell;
                const float thickness = thickness_[at];
                if (!(thickness > 0)) continue;
                float arriving = 0;  // of the corners
                for (std::size_t n = 0; n < 8; ++n) {
                    const std::size_t x = 2 * (cell % kSide + n % 2), y = 2 * (cell / kSide % kSide + n / 2 % 2),
                                      z = 2 * (cell / kSide / kSide + n / 4);
                    arriving += 0.125f * std::exp((mean_cosine_ - 1) *
                                                  depths[(z * kLightNodes + y) * kLightNodes + x]);
                }
                // The mean over the cell of an exponential is less than that of its ends.
                const float half = 0.5f * thickness, bend = half > 1e-3f ? std::tanh(half) / half : 1.0f;
                float sum = (1 - albedo) * thickness / (1 - mean_cosine_);
                for (std::size_t n = 0; n < 6; ++n) {
                    const std::int32_t other = neighbours_[at].cell[n];
                    const float through =
                        other < 0 ? loss(thickness) : conductance(thickness, thickness_[std::size_t(other)]);
                    sum += through;
                    if (other >= 0) weights_[at][n] = through;
                }
                for (float& weight : weights_[at]) weight /= sum;
                source_[at] = albedo * thickness * bend * arriving / sum;
            }
        });
    }

    float balance(std::size_t at) const {
        float sum = source_[at];
        const Neighbours& near = neighbours_[at];
        for (std::size_t n = 0; n < 6; ++n)
            if (near.cell[n] >= 0) sum += weights_[at][n] * fluence_[std::size_t(near.cell[n])];
        return sum;
    }

    std::size_t bricks_;
    float mean_cosine_;
    std::vector<float> thickness_, source_, fluence_;  // thickness: reduced optical, along an edge
    std::vector<std::array<float, 6>> weights_;
    std::vector<Neighbours> neighbours_;
};

std::uint16_t packed(float low, float high) {
    return std::uint16_t(unsigned(low + 0.5f) | unsigned(high + 0.5f) << 8);
}

// Fluence and flux of the cells of a brick and of those around it, kAround on an edge, x fastest; -1 where there is no
// cloud.
constexpr int kAround = kSide + 2;
using Surroundings = std::array<std::array<float, 4>, std::size_t(kAround) * kAround * kAround>;

Surroundings around_brick(const CoverageField& field, std::size_t brick, const DiffusionCells& cells,
                          std::span<const std::array<float, 4>> values) {
    const std::array<int, 3>& size = field.bricks();
    const std::int32_t place = field.places()[brick];
    const int at[3] = {place % size[0], place / size[0] % size[1], place / size[0] / size[1]};
    Surroundings result;
    for (std::size_t n = 0; n < result.size(); ++n) {
        result[n][0] = -1;
        const int o[3] = {int(n) % kAround - 1, int(n) / kAround % kAround - 1, int(n) / kAround / kAround - 1};
        int other[3];
        bool inside = true;
        std::size_t cell = 0;
        for (int axis = 0; axis < 3; ++axis) {
            other[axis] = at[axis] + (o[axis] < 0 ? -1 : o[axis] / kSide);
            inside = inside && other[axis] >= 0 && other[axis] < size[std::size_t(axis)];
            cell |= std::size_t((o[axis] + kSide) % kSide) << axis;
        }
        if (!inside) continue;
        const std::int32_t number = field.table()[std::size_t((other[2] * size[1] + other[1]) * size[0] + other[0])];
        if (number < 0) continue;
        const std::size_t index = std::size_t(number) * kOfBrick + cell;
        if (cells.holds_cloud(index)) result[n] = values[index];
    }
    return result;
}

// A node lies in the middle of a cell or between two on each axis. Returns the mean of those that hold cloud.
std::array<float, 4> at_node(const Surroundings& cells, const int (&node)[3]) {
    std::array<float, 4> sum{};
    float count = 0;
    for (int n = 0; n < 8; ++n) {
        std::size_t index = 0, stride = 1;
        bool is_one = true;
        for (int axis = 0; axis < 3; ++axis, stride *= kAround) {
            const int above = n >> axis & 1;
            is_one = is_one && (above == 0 || node[axis] % 2 == 0);
            index += stride * std::size_t((node[axis] + 1) / 2 + above);
        }
        if (!is_one || cells[index][0] < 0) continue;
        for (std::size_t i = 0; i < 4; ++i) sum[i] += cells[index][i];
        ++count;
    }
    for (float& number : sum) number /= std::max(count, 1.0f);
    return sum;
}

}  // namespace

DiffuseLight diffuse_sunlight(const CoverageField& field, std::span<const float> extinction,
                              std::span<const float> sun_depths, double albedo, double mean_cosine) {
    DiffusionCells cells(field, extinction, sun_depths, albedo, mean_cosine);
    cells.solve();
    const std::size_t bricks = field.places().size();
    std::vector<std::array<float, 4>> values(bricks * kOfBrick);
    tbb::parallel_for(std::size_t{0}, bricks, [&](std::size_t brick) {
        for (std::size_t cell = brick * kOfBrick; cell < (brick + 1) * kOfBrick; ++cell)
            values[cell] = cells.fluence_and_flux(cell);
    });
    DiffuseLight light;
    light.upwards.assign(bricks * kLightNodesOfBrick + 1, 0);
    light.sideways.assign(light.upwards.size(), 0);
    tbb::parallel_for(std::size_t{0}, bricks, [&](std::size_t brick) {
        const Surroundings around = around_brick(field, brick, cells, values);
        for (int n = 0; n < int(kLightNodesOfBrick); ++n) {
            const auto [fluence, east, north, up] =
                at_node(around, {n % kLightNodes, n / kLightNodes % kLightNodes, n / kLightNodes / kLightNodes});
            const auto ratio = [&, of = fluence](float flux) {
                return 128 + 127 * std::clamp(flux / std::max(of, 1e-9f), -1.0f, 1.0f);
            };
            const std::size_t at = brick * kLightNodesOfBrick + std::size_t(n);
            light.upwards[at] =
                packed(255 * std::sqrt(std::clamp(fluence / shader::kMostFluence, 0.0f, 1.0f)), ratio(up));
            light.sideways[at] = packed(ratio(east), ratio(north));
        }
    });
    return light;
}

float diffuse_radiance(const DiffuseLight& light, std::size_t node, double mean_cosine, const Vec3& direction) {
    const auto ratio = [](unsigned byte) { return (double(byte) - 128) / 127; };
    const double root = double(light.upwards[node] & 255u) / 255;
    const Vec3 flux(ratio(light.sideways[node] & 255u), ratio(light.sideways[node] >> 8u),
                    ratio(light.upwards[node] >> 8u));
    const double directed = double(shader::kDiffuseBase) +
                            double(shader::kDiffuseFlux) * mean_cosine * glm::dot(flux, direction);
    return float(0.25 * double(shader::kMostFluence) * root * root * std::max(directed, 0.0));
}

}  // namespace nephos
