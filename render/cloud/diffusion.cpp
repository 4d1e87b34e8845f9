// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <tbb/parallel_for.h>

#include "render/cloud/light_sweep.h"
#include "render/shared/march.h"

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells, kSide = kCells / 2;  // cells of the equation on a brick's edge
constexpr std::size_t kOfBrick = std::size_t(kSide) * kSide * kSide;
constexpr double kSmallResidual = 1e-3;  // relative, which ends the iterations
constexpr int kMostRounds = 200;
// Conductance between cells that hold next to nothing: of more the iterations would only take longer.
constexpr float kMostConductance = 10;

constexpr float kFold = 1e-6f;           // reduced optical thickness of an empty cell in a fold
constexpr float kLeastThickness = 0.1f;  // reduced optical, of cells in the weights of their light

// The cells around one: below and above it on each axis.
struct Neighbours {
    std::int32_t cell[6];  // -1: no cloud
};

struct CellLight {
    std::array<float, 4> values{};  // fluence, and flux to the east, north and up
    float weight = 0;
};

class DiffusionCells {
  public:
    DiffusionCells(const CoverageField& field, std::span<const float> extinction, double albedo, double mean_cosine)
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
        fill_folds();
        find_neighbours(field);
        set_coefficients(float(albedo));
    }

    // The light that the sun loses: what enters a cell through faces and does not leave it. Exact, as neighbours share
    // faces.
    void light_by_sun(std::span<const float> sun_depths, const Vec3& to_sun, double albedo) {
        const float towards[3] = {float(to_sun.x), float(to_sun.y), float(to_sun.z)};
        std::ranges::fill(outside_, 0.0f);
        source_.assign(thickness_.size(), 0.0f);
        tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
            const float* const depths = &sun_depths[brick * kLightNodesOfBrick];
            for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
                if (!(thickness_[brick * kOfBrick + cell] > 0)) continue;
                float lost = 0;
                for (std::size_t n = 0; n < 8; ++n) {
                    const std::size_t o[3] = {n % 2, n / 2 % 2, n / 4}, x = 2 * (cell % kSide + o[0]),
                                      y = 2 * (cell / kSide % kSide + o[1]), z = 2 * (cell / kSide / kSide + o[2]);
                    const float light =
                        std::exp((mean_cosine_ - 1) * depths[(z * kLightNodes + y) * kLightNodes + x]);
                    for (std::size_t axis = 0; axis < 3; ++axis)
                        lost += 0.25f * light * (o[axis] == 1 ? towards[axis] : -towards[axis]);
                }
                source_[brick * kOfBrick + cell] = float(albedo) * std::max(lost, 0.0f);
            }
        });
    }

    // A sky of fluence 1 above the horizon: faces at the side see half of it.
    void light_by_sky() {
        outside_ = {0.5f, 0.5f, 0.5f, 0.5f, 0.0f, 1.0f};
        source_.assign(thickness_.size(), 0.0f);
        for_cells([&](std::size_t at) {
            for (std::size_t n = 0; thickness_[at] > 0 && n < 6; ++n)
                if (neighbours_[at].cell[n] < 0) source_[at] += outside_[n] * area_of_faces(at) * loss(thickness_[at]);
        });
    }

    // Conjugate gradients, with the diagonal as preconditioner (M. R. Hestenes and E. Stiefel 1952). Sums are those of
    // bricks in their order, whatever the number of threads.
    void solve() {
        fluence_.assign(thickness_.size(), 0.0f);
        std::vector<float> residual = source_, direction(source_.size()), image(source_.size());
        double before = 0, first = 0;
        for (int round = 0; round < kMostRounds; ++round) {
            const double product = sum_over_bricks([&](std::size_t at) {
                return double(residual[at]) * double(residual[at]) * double(inverse_[at]);
            });
            if (round == 0) first = product;
            if (!(product > kSmallResidual * kSmallResidual * first)) break;
            const auto keep = float(round > 0 ? product / before : 0);
            before = product;
            for_cells([&](std::size_t at) { direction[at] = inverse_[at] * residual[at] + keep * direction[at]; });
            const double curvature = sum_over_bricks([&](std::size_t at) {
                image[at] = balance(direction, at);
                return double(direction[at]) * double(image[at]);
            });
            const auto step = float(product / curvature);
            for_cells([&](std::size_t at) {
                fluence_[at] += step * direction[at];
                residual[at] -= step * image[at];
            });
        }
    }

    // Fluence in the middle of a cell, flux through it to the east, north and up, and the weight of these in places
    // between cells: there the fluence is nearest to that of the thinner one. A cell without cloud has the fluence of
    // the faces of those beside it.
    CellLight light_of(std::size_t at) const {
        CellLight result;
        if (!(thickness_[at] > 0)) {
            result.weight = 1 / kLeastThickness;
            float count = 0;
            for (std::size_t n = 0; n < 6; ++n) {
                const std::int32_t other = neighbours_[at].cell[n];
                if (other < 0) continue;
                const CellLight beside = light_of(std::size_t(other));
                const float arriving = outside_[n ^ 1], through = 2 * loss(thickness_[std::size_t(other)]);
                result.values[0] += arriving + through * (beside.values[0] - arriving);
                for (std::size_t axis = 1; axis < 4; ++axis) result.values[axis] += beside.values[axis];
                ++count;
            }
            for (float& number : result.values) number /= std::max(count, 1.0f);
            return result;
        }
        result.weight = 1 / (thickness_[at] + kLeastThickness);
        result.values[0] = fluence_[at];
        const float area = area_of_faces(at);
        for (std::size_t n = 0; n < 6; ++n) {
            const std::int32_t other = neighbours_[at].cell[n];
            const float towards = other < 0 ? (fluence_[at] - outside_[n]) * area * loss(thickness_[at])
                                            : (fluence_[at] - fluence_[std::size_t(other)]) *
                                                  conductance(thickness_[at], thickness_[std::size_t(other)]);
            result.values[1 + n / 2] += (n % 2 == 0 ? -0.5f : 0.5f) * towards;
        }
        return result;
    }

    bool is_beside_cloud(std::size_t at) const {
        return std::ranges::any_of(neighbours_[at].cell, [](std::int32_t other) { return other >= 0; });
    }
    bool holds_cloud(std::size_t at) const { return thickness_[at] > 0; }

  private:
    // Flux per difference of fluence between two cells of reduced optical thickness a and b, and through a face beyond
    // which there is no cloud.
    static float conductance(float a, float b) {
        const bool folded = std::min(a, b) <= kFold;
        return folded ? loss(std::max(a, b)) : std::min(1 / (1.5f * (a + b)), kMostConductance);
    }
    static float loss(float thickness) { return 1 / (2 + 1.5f * thickness); }
    // The area of a slanting surface over that of the faces that stand for it as stairs.
    float area_of_faces(std::size_t at) const {
        float open[3] = {};
        for (std::size_t n = 0; n < 6; ++n) open[n / 2] += neighbours_[at].cell[n] < 0 ? 1.0f : 0.0f;
        const float sum = open[0] + open[1] + open[2];
        return sum > 0 ? std::sqrt(open[0] * open[0] + open[1] * open[1] + open[2] * open[2]) / sum : 1.0f;
    }

    // Light that leaves a cloud in a fold meets it again: empty cells between two or more of cloud exchange it.
    void fill_folds() {
        std::vector<float> filled = thickness_;
        for_cells([&](std::size_t at) {
            if (thickness_[at] > 0) return;
            if (std::ranges::count_if(neighbours_[at].cell, [](std::int32_t other) { return other >= 0; }) > 1)
                filled[at] = kFold;
        });
        thickness_ = std::move(filled);
    }

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

    template <class What>
    void for_cells(const What& what) const {
        tbb::parallel_for(tbb::blocked_range<std::size_t>(0, thickness_.size(), 1024), [&](const auto& range) {
            for (std::size_t at = range.begin(); at != range.end(); ++at) what(at);
        });
    }

    template <class Number>
    double sum_over_bricks(const Number& number) const {
        std::vector<double> sums(bricks_);
        tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
            double sum = 0;
            for (std::size_t at = brick * kOfBrick; at < (brick + 1) * kOfBrick; ++at) sum += number(at);
            sums[brick] = sum;
        });
        return std::accumulate(sums.begin(), sums.end(), 0.0);
    }

    // What leaves a cell of this fluence, less what comes from its neighbours.
    float balance(const std::vector<float>& fluence, std::size_t at) const {
        float sum = diagonal_[at] * fluence[at];
        const Neighbours& near = neighbours_[at];
        for (std::size_t n = 0; n < 6; ++n)
            if (near.cell[n] >= 0) sum -= weights_[at][n] * fluence[std::size_t(near.cell[n])];
        return sum;
    }

    // Cells without cloud have no weights: their fluence stays 0.
    void set_coefficients(float albedo) {
        weights_.assign(thickness_.size(), {});
        diagonal_.assign(thickness_.size(), 0.0f);
        inverse_.assign(thickness_.size(), 0.0f);
        tbb::parallel_for(std::size_t{0}, bricks_, [&](std::size_t brick) {
            for (std::size_t cell = 0; cell < kOfBrick; ++cell) {
                const std::size_t at = brick * kOfBrick + cell;
                const float thickness = thickness_[at];
                if (!(thickness > 0)) continue;
                float sum = (1 - albedo) * thickness / (1 - mean_cosine_);
                for (std::size_t n = 0; n < 6; ++n) {
                    const std::int32_t other = neighbours_[at].cell[n];
                    const float through =
                        other < 0 ? area_of_faces(at) * loss(thickness) : conductance(thickness, thickness_[std::size_t(other)]);
                    sum += through;
                    if (other >= 0) weights_[at][n] = through;
                }
                diagonal_[at] = sum;
                inverse_[at] = 1 / sum;
            }
        });
    }

    std::size_t bricks_;
    float mean_cosine_;
    std::array<float, 6> outside_{};  // fluence beyond faces without cloud, by direction
    std::vector<float> thickness_;  // reduced optical, along an edge
    std::vector<float> source_, diagonal_, inverse_, fluence_;
    std::vector<std::array<float, 6>> weights_;
    std::vector<Neighbours> neighbours_;
};

std::uint16_t packed(float low, float high) {
    return std::uint16_t(unsigned(low + 0.5f) | unsigned(high + 0.5f) << 8);
}

// Fluence and flux of the cells of a brick and of those around it, kAround on an edge, x fastest; null where there is
// neither cloud nor cloud beside.
constexpr int kAround = kSide + 2;
using Surroundings = std::array<const CellLight*, std::size_t(kAround) * kAround * kAround>;

Surroundings around_brick(const CoverageField& field, std::size_t brick, const DiffusionCells& cells,
                          std::span<const CellLight> values) {
    const std::array<int, 3>& size = field.bricks();
    const std::int32_t place = field.places()[brick];
    const int at[3] = {place % size[0], place / size[0] % size[1], place / size[0] / size[1]};
    Surroundings result;
    for (std::size_t n = 0; n < result.size(); ++n) {
        result[n] = nullptr;
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
        if (cells.holds_cloud(index) || cells.is_beside_cloud(index)) result[n] = &values[index];
    }
    return result;
}

// A node lies in the middle of a cell or between two on each axis. Returns the mean of those that there are; a fluence
// of -1 if there is none.
std::array<float, 4> at_node(const Surroundings& cells, const int (&node)[3]) {
    std::array<float, 4> sum{};
    float weights = 0;
    for (int n = 0; n < 8; ++n) {
        std::size_t index = 0, stride = 1;
        bool is_one = true;
        for (int axis = 0; axis < 3; ++axis, stride *= kAround) {
            const int above = n >> axis & 1;
            is_one = is_one && (above == 0 || node[axis] % 2 == 0);
            index += stride * std::size_t((node[axis] + 1) / 2 + above);
        }
        if (!is_one || cells[index] == nullptr) continue;
        for (std::size_t i = 0; i < 4; ++i) sum[i] += cells[index]->weight * cells[index]->values[i];
        weights += cells[index]->weight;
    }
    if (!(weights > 0)) return {-1, 0, 0, 0};
    for (float& number : sum) number /= weights;
    return sum;
}

}  // namespace

namespace {

// Calls set(number of the node, fluence, flux to the east, north and up) for all corners of cells; -1 is the fluence
// where there is no cloud near.
template <class Set>
void for_nodes(const CoverageField& field, const DiffusionCells& cells, const Set& set) {
    const std::size_t bricks = field.places().size();
    std::vector<CellLight> values(bricks * kOfBrick);
    tbb::parallel_for(std::size_t{0}, bricks, [&](std::size_t brick) {
        for (std::size_t cell = brick * kOfBrick; cell < (brick + 1) * kOfBrick; ++cell)
            values[cell] = cells.light_of(cell);
    });
    tbb::parallel_for(std::size_t{0}, bricks, [&](std::size_t brick) {
        const Surroundings around = around_brick(field, brick, cells, values);
        for (int n = 0; n < int(kLightNodesOfBrick); ++n)
            set(brick * kLightNodesOfBrick + std::size_t(n),
                at_node(around, {n % kLightNodes, n / kLightNodes % kLightNodes, n / kLightNodes / kLightNodes}));
    });
}

}  // namespace

DiffuseLight diffuse_sunlight(const CoverageField& field, std::span<const float> extinction,
                              std::span<const float> sun_depths, const Vec3& to_sun, double albedo,
                              double mean_cosine) {
    DiffusionCells cells(field, extinction, albedo, mean_cosine);
    cells.light_by_sun(sun_depths, to_sun, albedo);
    cells.solve();
    DiffuseLight light;
    light.upwards.assign(sun_depths.size() + 1, 0);
    light.sideways.assign(light.upwards.size(), 0);
    for_nodes(field, cells, [&](std::size_t node, const std::array<float, 4>& values) {
        const float fluence = std::max(values[0], 0.0f);
        const auto ratio = [&](float flux) {
            return 128 + 127 * std::clamp(flux / std::max(fluence, 1e-9f), -1.0f, 1.0f);
        };
        light.upwards[node] =
            packed(255 * std::sqrt(std::min(fluence / shader::kMostFluence, 1.0f)), ratio(values[3]));
        light.sideways[node] = packed(ratio(values[1]), ratio(values[2]));
    });
    return light;
}

// What does not come from the sky comes from the ground: where nothing is absorbed, a cloud before a sky and a ground of
// one radiance has that radiance.
std::vector<std::uint16_t> diffuse_surroundings(const CoverageField& field, std::span<const float> extinction,
                                                double mean_cosine) {
    DiffusionCells cells(field, extinction, 1, mean_cosine);
    cells.light_by_sky();
    cells.solve();
    std::vector<std::uint16_t> surroundings(field.places().size() * kLightNodesOfBrick + 1, 0);
    for_nodes(field, cells, [&](std::size_t node, const std::array<float, 4>& values) {
        const float sky = values[0] < 0 ? 0.5f : std::min(values[0], 1.0f);
        surroundings[node] = packed(255 * sky, 255 * (1 - sky));
    });
    return surroundings;
}

}  // namespace nephos
