// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion_cells.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include <tbb/parallel_for.h>

#include "density/detail_kernels.h"
#include "render/cloud/brick_vectors.h"

namespace nephos {
namespace {

// Conductance between cells that hold next to nothing: of more the iterations would only take longer.
constexpr float kMostConductance = 10;
constexpr float kFold = 1e-6f;           // reduced optical thickness of an empty cell in a fold
constexpr float kLeastThickness = 0.1f;  // reduced optical, of cells in the weights of their light

// Numbers of some bricks.
using Bricks = std::span<const std::int32_t>;

// What conjugate gradients keep of each cell; `inverse`: of the diagonal of the equations.
struct Iteration {
    std::vector<BrickOfCells> inverse, diagonal, fluence, residual, direction, image;
};

Quad loss(Quad thickness) {
    return 1 / (2 + 1.5f * thickness);
}

// Light that leaves a cloud in a fold meets it again: empty cells between two or more of cloud exchange it.
void fill_folds(const DiffusionCells& cells, Bricks some, std::vector<BrickOfCells>& filled) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        Cells count = same(0);
        const auto of_brick = [&](std::size_t n) { return load(cells.thickness[n]); };
        for_neighbours(cells, brick, of_brick, [&](auto, const Cells& inner, const Cells& beyond) {
            count = plus(count, plus(where_positive(inner, same(1)), where_positive(beyond, same(1))));
        });
        const Cells own = of_brick(brick);
        const auto lanes = [](Quad thickness, Quad number_of_them) {
            return pick(thickness, thickness, pick(number_of_them - 1.5f, number(kFold), number(0)));
        };
        store(each(lanes, own, count), filled[brick]);
    }
}

// Flux per difference of fluence between two cells of reduced optical thickness a and b; 0 if one is no cloud.
Quad conductance(Quad a, Quad b) {
    const Quad least = a < b ? a : b, most = a < b ? b : a;
    const Quad whole = 1 / (1.5f * (a + b)), between = whole < kMostConductance ? whole : number(kMostConductance);
    return pick(least, least <= kFold ? loss(most) : between, number(0));
}

// The area of a slanting surface is less than that of the faces that stand for it as stairs.
void set_conductances(Bricks some, DiffusionCells& cells) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const auto of_brick = [&](std::size_t n) { return load(cells.thickness[n]); };
        const Cells own = of_brick(brick);
        Cells open_faces = same(0), squares = same(0);
        for_neighbours(cells, brick, of_brick, [&](auto axis, const Cells& inner, const Cells& beyond) {
            const auto to = [](Quad a, Quad b) { return conductance(a, b); };
            store(each(to, own, inner), cells.to_neighbours[brick][2 * axis]);
            store(each(to, own, beyond), cells.to_neighbours[brick][2 * axis + 1]);
            const Cells open = plus(where_not_positive(inner, same(1)), where_not_positive(beyond, same(1)));
            open_faces = plus(open_faces, open);
            squares = plus(squares, times(open, open));
        });
        const auto area = [](Quad sum, Quad sum_of_squares) {
            const Quad root{std::sqrt(sum_of_squares[0]), std::sqrt(sum_of_squares[1]), std::sqrt(sum_of_squares[2]),
                            std::sqrt(sum_of_squares[3])};
            return root / (sum > 1 ? sum : number(1));
        };
        const auto through = [](Quad thickness) { return loss(thickness); };
        store(where_positive(own, times(each(area, open_faces, squares), each(through, own))), cells.to_outside[brick]);
    }
}

// Cells without cloud have a fluence of 0.
void set_diagonal(const DiffusionCells& cells, float absorbed, Bricks some, Iteration& it) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const Cells thickness = load(cells.thickness[brick]), outside = load(cells.to_outside[brick]);
        Cells sum = times(absorbed, thickness);
        for (const BrickOfCells& to : cells.to_neighbours[brick]) {
            const auto lanes = [](Quad conducted, Quad open) { return pick(conducted, conducted, open); };
            sum = plus(sum, each(lanes, load(to), outside));
        }
        const auto inverse = [](Quad of) { return 1 / of; };
        store(where_positive(thickness, sum), it.diagonal[brick]);
        store(where_positive(thickness, each(inverse, sum)), it.inverse[brick]);
    }
}

double sum_of(Quad lanes) {
    return (double(lanes[0]) + double(lanes[1])) + (double(lanes[2]) + double(lanes[3]));
}
void add_product(const Cells& a, const Cells& b, Quad& sum) { sum += a.low * b.low + a.high * b.high; }

double residual_product(Bricks some, const Iteration& it) {
    Quad sum = number(0);
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const Cells residual = load(it.residual[brick]);
        add_product(times(residual, load(it.inverse[brick])), residual, sum);
    }
    return sum_of(sum);
}

void turn(float keep, Bricks some, Iteration& it) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        store(plus(times(load(it.inverse[brick]), load(it.residual[brick])),
                   times(keep, load(it.direction[brick]))),
              it.direction[brick]);
    }
}

// What leaves a cell whose fluence is the direction, less what comes from its neighbours. Returns its product with the
// direction.
double set_image(const DiffusionCells& cells, Bricks some, Iteration& it) {
    Quad product = number(0);
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const auto of_brick = [&](std::size_t n) { return load(it.direction[n]); };
        const auto& to = cells.to_neighbours[brick];
        const Cells own = of_brick(brick);
        Cells sum = times(load(it.diagonal[brick]), own);
        for_neighbours(cells, brick, of_brick, [&](auto axis, const Cells& inner, const Cells& beyond) {
            sum = minus(sum, plus(times(load(to[2 * axis]), inner), times(load(to[2 * axis + 1]), beyond)));
        });
        store(sum, it.image[brick]);
        add_product(own, sum, product);
    }
    return sum_of(product);
}

// Returns residual_product().
double step(float length, Bricks some, Iteration& it) {
    Quad product = number(0);
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        store(plus(load(it.fluence[brick]), times(length, load(it.direction[brick]))), it.fluence[brick]);
        const Cells residual = minus(load(it.residual[brick]), times(length, load(it.image[brick])));
        store(residual, it.residual[brick]);
        add_product(times(residual, load(it.inverse[brick])), residual, product);
    }
    return sum_of(product);
}

// What lies beyond the inner and the outer faces on an axis: the inner face of an upper cell is its lower one.
template <int kAxis>
Cells beyond_inner(const FluenceOutside& outside) {
    return halves<kAxis>(same(outside[2 * kAxis]), same(outside[2 * kAxis + 1]));
}
template <int kAxis>
Cells beyond_outer(const FluenceOutside& outside) {
    return halves<kAxis>(same(outside[2 * kAxis + 1]), same(outside[2 * kAxis]));
}

void take_light(const DiffusionCells& cells, const FluenceOutside& outside, Bricks some,
                std::vector<BrickOfCells>& source) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const auto& to = cells.to_neighbours[brick];
        Cells sum = same(0);
        const auto add = [&](const BrickOfCells& conducted, const Cells& light) {
            sum = plus(sum, where_not_positive(load(conducted), light));
        };
        add(to[0], beyond_inner<0>(outside));
        add(to[1], beyond_outer<0>(outside));
        add(to[2], beyond_inner<1>(outside));
        add(to[3], beyond_outer<1>(outside));
        add(to[4], beyond_inner<2>(outside));
        add(to[5], beyond_outer<2>(outside));
        store(times(load(cells.to_outside[brick]), sum), source[brick]);
    }
}

// The share of a face: the resistance from the middle of the cell to where light starts, over that to beyond the face.
void find_shares(const DiffusionCells& cells, const std::vector<StartingLight>& starting, Bricks some,
                 std::vector<NumbersOfFaces>& shares) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const auto& to = cells.to_neighbours[brick];
        const Cells resistance = times(1.5f, load(cells.thickness[brick])), open = load(cells.to_outside[brick]);
        Cells shared[6], sum = same(0);
        const auto add = [&](std::size_t face, const Cells& towards) {
            const auto share = [](Quad conducted, Quad outside, Quad of, Quad place) {
                return pick(place, of * place * pick(conducted, conducted, outside), number(0));
            };
            shared[face] = each(share, load(to[face]), open, resistance, towards);
            sum = plus(sum, shared[face]);
        };
        for_axes([&](auto axis) {
            constexpr int kAxis = decltype(axis)::value;
            const Cells up = load(starting[brick].place[kAxis]), down = minus(same(0), up);
            add(2 * kAxis, halves<kAxis>(down, up));
            add(2 * kAxis + 1, halves<kAxis>(up, down));
        });
        const auto part = [](Quad light, Quad all) { return light / (all > 1 ? all : number(1)); };
        const Cells light = each(part, load(starting[brick].light), sum);
        for (std::size_t face = 0; face < 6; ++face) store(times(light, shared[face]), shares[brick][face]);
    }
}

void take_shares(const DiffusionCells& cells, const std::vector<StartingLight>& starting,
                 const std::vector<NumbersOfFaces>& shares, Bricks some, std::vector<BrickOfCells>& source) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        Cells sum = load(starting[brick].light);
        for_axes([&](auto axis) {
            constexpr int kAxis = decltype(axis)::value;
            const Cells inner = load(shares[brick][2 * kAxis]), beyond = load(shares[brick][2 * kAxis + 1]);
            const auto of_neighbour = [&](std::size_t n) { return load(shares[n][2 * kAxis + 1]); };
            sum = plus(minus(sum, plus(inner, beyond)),
                       plus(exchanged<kAxis>(inner), outer<kAxis>(cells.beside[brick], of_neighbour)));
        });
        store(where_positive(load(cells.thickness[brick]), sum), source[brick]);
    }
}

void keep_leaving(const DiffusionCells& cells, Bricks some, std::vector<NumbersOfFaces>& shares) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        for (std::size_t face = 0; face < 6; ++face) {
            BrickOfCells& share = shares[brick][face];
            store(where_not_positive(load(cells.to_neighbours[brick][face]), load(share)), share);
        }
    }
}

using Fluxes = std::array<BrickOfCells, 3>;

// Net flux through the middle of cells, half of that through both faces. `leaving`: through faces without cloud besides,
// or none.
void find_fluxes(const DiffusionCells& cells, const std::vector<BrickOfCells>& fluence, const FluenceOutside& outside,
                 const std::vector<NumbersOfFaces>& leaving, Bricks some, std::vector<Fluxes>& fluxes) {
    constexpr NumbersOfFaces kNone{};
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        const auto of_brick = [&](std::size_t n) { return load(fluence[n]); };
        const Cells own = of_brick(brick), open = load(cells.to_outside[brick]);
        for_neighbours(cells, brick, of_brick, [&](auto axis, const Cells& inner, const Cells& beyond) {
            constexpr int kAxis = decltype(axis)::value;
            const NumbersOfFaces& besides = leaving.empty() ? kNone : leaving[brick];
            const auto towards = [&](std::size_t face, const Cells& other, const Cells& light) {
                const Cells by = load(cells.to_neighbours[brick][face]);
                return each(pick, by, times(by, minus(own, other)),
                            plus(times(open, minus(own, light)), load(besides[face])));
            };
            const Cells in = towards(2 * kAxis, inner, beyond_inner<kAxis>(outside)),
                        out = towards(2 * kAxis + 1, beyond, beyond_outer<kAxis>(outside));
            const Cells upwards = times(0.5f, minus(out, in));
            store(halves<kAxis>(upwards, minus(same(0), upwards)), fluxes[brick][std::size_t(kAxis)]);
        });
    }
}

// The light of cells without cloud.
void add_light_of_faces(const DiffusionCells& cells, const std::vector<BrickOfCells>& fluence,
                        const FluenceOutside& outside, const std::vector<NumbersOfFaces>& leaving,
                        const std::vector<Fluxes>& fluxes, std::size_t brick, const Cells& empty, LightOfCells& light) {
    Cells count = same(0), values[4] = {count, count, count, count};
    const auto load_flux = [&](std::size_t axis) {
        return [&fluxes, axis](std::size_t n) { return load(fluxes[n][axis]); };
    };
    // The fluence at a face is what arrives there and twice what leaves.
    const auto add = [&](const Cells& thickness, const Cells& there, const Cells (&flux)[3], const Cells& arriving,
                         const Cells& besides) {
        const auto through = [](Quad of) { return 2 * loss(of); };
        const Cells fluence_there = plus(plus(arriving, times(each(through, thickness), minus(there, arriving))),
                                         times(2, besides));
        values[0] = plus(values[0], where_positive(thickness, fluence_there));
        for (int axis = 0; axis < 3; ++axis)
            values[axis + 1] = plus(values[axis + 1], where_positive(thickness, flux[axis]));
        count = plus(count, where_positive(thickness, same(1)));
    };
    const auto& beside = cells.beside[brick];
    const auto thickness_of = [&](std::size_t n) { return load(cells.thickness[n]); };
    const auto fluence_of = [&](std::size_t n) { return load(fluence[n]); };
    for_neighbours(cells, brick, thickness_of, [&](auto axis, const Cells& inner, const Cells& beyond) {
        constexpr int kAxis = decltype(axis)::value;
        const auto inner_of = [&](std::size_t n) { return exchanged<kAxis>(load_flux(n)(brick)); };
        const auto outer_of = [&](std::size_t n) { return outer<kAxis>(beside, load_flux(n)); };
        const auto leaving_of = [&](std::size_t face) {
            return [&leaving, face](std::size_t n) { return leaving.empty() ? same(0) : load(leaving[n][face]); };
        };
        // What arrives at the neighbour's face comes from where the cell itself looks away from.
        if (any_positive(inner))
            add(inner, exchanged<kAxis>(fluence_of(brick)), {inner_of(0), inner_of(1), inner_of(2)},
                beyond_outer<kAxis>(outside), exchanged<kAxis>(leaving_of(2 * kAxis)(brick)));
        if (any_positive(beyond))
            add(beyond, outer<kAxis>(beside, fluence_of), {outer_of(0), outer_of(1), outer_of(2)},
                beyond_inner<kAxis>(outside), outer<kAxis>(beside, leaving_of(2 * kAxis + 1)));
    });
    constexpr float kWeight = 1 / kLeastThickness;
    const auto mean = [](Quad sum, Quad number_of) { return kWeight * sum / (number_of > 1 ? number_of : number(1)); };
    const auto replace = [&](BrickOfCells& to, const Cells& by) {
        store(plus(load(to), where_positive(empty, by)), to);
    };
    replace(light[0], where_positive(count, same(kWeight)));
    for (std::size_t n = 0; n < 4; ++n)
        replace(light[n + 1], each(mean, values[n], count));
}

void collect_light(const DiffusionCells& cells, const std::vector<BrickOfCells>& fluence, const FluenceOutside& outside,
                   const std::vector<NumbersOfFaces>& leaving, const std::vector<Fluxes>& fluxes, Bricks some,
                   std::vector<LightOfCells>& light) {
    for (const std::int32_t one : some) {
        const auto brick = std::size_t(one);
        LightOfCells& to = light[brick];
        const Cells thickness = load(cells.thickness[brick]);
        const auto weight_of = [](Quad of) { return 1 / (of + kLeastThickness); };
        const Cells weight = where_positive(thickness, each(weight_of, thickness));
        store(weight, to[0]);
        store(times(weight, load(fluence[brick])), to[1]);
        for (std::size_t axis = 0; axis < 3; ++axis) store(times(weight, load(fluxes[brick][axis])), to[axis + 2]);
        const Cells empty = where_not_positive(thickness, same(1));
        if (any_positive(empty)) add_light_of_faces(cells, fluence, outside, leaving, fluxes, brick, empty, to);
    }
}

constexpr std::size_t kCells = std::size_t(CoverageField::kBrickCells);
constexpr std::size_t kPart = 256;          // bricks that one thread works on, whose products are added up first
constexpr double kSmallResidual = 1e-3;  // relative, which ends the iterations
constexpr int kMostRounds = 200;

template <class What>
void for_parts(Bricks bricks, const What& what) {
    tbb::parallel_for(std::size_t{0}, (bricks.size() + kPart - 1) / kPart, [&](std::size_t part) {
        what(part, bricks.subspan(part * kPart, std::min(kPart, bricks.size() - part * kPart)));
    });
}

// Sums are those of parts in their order, whatever the number of threads.
template <class Number>
double sum_over_parts(Bricks bricks, const Number& number) {
    std::vector<double> sums((bricks.size() + kPart - 1) / kPart);
    for_parts(bricks, [&](std::size_t part, Bricks some) { sums[part] = number(some); });
    return std::accumulate(sums.begin(), sums.end(), 0.0);
}

std::vector<std::int32_t> first_numbers(std::size_t count) {
    std::vector<std::int32_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 0);
    return numbers;
}

// Bricks of the first period of a field that repeats, in x and y: as many as its edges are long; 0 where they are not
// whole bricks, or it does not repeat.
struct HomeBricks {
    int first = 0, count[2] = {};

    explicit HomeBricks(const CoverageField& field) {
        const double edge_m = 2 * CoverageField::kBrickCells * field.node_m();
        int cells[2];
        for (int axis = 0; axis < 2; ++axis)
            cells[axis] = int(std::lround(CoverageField::kBrickCells * field.period_m()[axis] / edge_m));
        if (cells[0] % CoverageField::kBrickCells != 0 || cells[1] % CoverageField::kBrickCells != 0) return;
        first = int(std::lround(field.home_m() / edge_m));
        for (int axis = 0; axis < 2; ++axis) count[axis] = cells[axis] / CoverageField::kBrickCells;
    }
    bool any() const { return count[0] > 0; }
    // Returns the coordinate of the brick with the same cloud in the first period.
    int at_home(int at, int axis) const {
        const int rest = (at - first) % count[axis];
        return first + (rest < 0 ? rest + count[axis] : rest);
    }
};

std::array<std::int32_t, 27> bricks_around(const CoverageField& field, const HomeBricks& home, std::size_t brick) {
    const std::array<int, 3>& size = field.bricks();
    const auto at = brick_at(field.places()[brick], size);
    std::array<std::int32_t, 27> around;
    around.fill(std::int32_t(field.places().size()));
    for (int n = 0; n < 27; ++n) {
        int x = at[0] + n % 3 - 1, y = at[1] + n / 3 % 3 - 1;
        const int z = at[2] + n / 9 - 1;
        if (home.any()) {
            x = home.at_home(x, 0);
            y = home.at_home(y, 1);
        }
        if (x < 0 || y < 0 || z < 0 || x >= size[0] || y >= size[1] || z >= size[2]) continue;
        const std::int32_t number = field.table()[std::size_t((z * size[1] + y) * size[0] + x)];
        if (number >= 0) around[std::size_t(n)] = number;
    }
    return around;
}

// Means of 2 x 2 x 2 lattice cells, times `scale`.
BrickOfCells coarser(const float* extinction, float scale) {
    BrickOfCells result;
    for (std::size_t cell = 0; cell < kDiffusionCells; ++cell) {
        float sum = 0;
        for (std::size_t n = 0; n < 8; ++n) {
            const std::size_t x = 2 * (cell % 2) + n % 2, y = 2 * (cell / 2 % 2) + n / 2 % 2, z = 2 * (cell / 4) + n / 4;
            sum += extinction[(z * kCells + y) * kCells + x];
        }
        result.of[cell] = scale * 0.125f * sum;
    }
    return result;
}

}  // namespace

DiffusionCells::DiffusionCells(const CoverageField& field, std::span<const float> extinction, double cosine)
    : bricks(field.places().size()), mean_cosine(float(cosine)) {
    const float scale = (1 - mean_cosine) * float(4 * field.node_m());
    thickness.resize(bricks + 1);
    around.resize(bricks);
    beside.resize(bricks);
    const HomeBricks home(field);
    tbb::parallel_for(std::size_t{0}, bricks, [&](std::size_t brick) {
        thickness[brick] = coarser(&extinction[brick * kCells * kCells * kCells], scale);
        const auto& all = around[brick] = bricks_around(field, home, brick);
        beside[brick] = {all[12], all[14], all[10], all[16], all[4], all[22]};
    });
    std::vector<BrickOfCells> filled(bricks + 1);
    const std::vector<std::int32_t> all = first_numbers(bricks);
    for_parts(all, [&](std::size_t, Bricks some) { fill_folds(*this, some, filled); });
    // The light of images is that of the bricks of the first period, which are their own neighbours.
    for (std::size_t brick = 0; brick < bricks; ++brick)
        if (around[brick][13] != std::int32_t(brick)) filled[brick] = {};
    thickness = std::move(filled);
    std::ranges::copy_if(all, std::back_inserter(active),
                         [&](std::int32_t n) { return any_positive(load(thickness[std::size_t(n)])); });
    to_neighbours.resize(bricks + 1);
    to_outside.resize(bricks + 1);
    for_parts(active, [&](std::size_t, Bricks some) { set_conductances(some, *this); });
}

std::vector<BrickOfCells> light_from_outside(const DiffusionCells& cells, const FluenceOutside& outside) {
    std::vector<BrickOfCells> source(cells.bricks);
    for_parts(cells.active, [&](std::size_t, Bricks some) {
        take_light(cells, outside, some, source);
    });
    return source;
}

SharedLight share_light(const DiffusionCells& cells, const std::vector<StartingLight>& starting) {
    SharedLight shared{std::vector<BrickOfCells>(cells.bricks + 1), std::vector<NumbersOfFaces>(cells.bricks + 1)};
    for_parts(cells.active, [&](std::size_t, Bricks some) { find_shares(cells, starting, some, shared.leaving); });
    for_parts(cells.active, [&](std::size_t, Bricks some) {
        take_shares(cells, starting, shared.leaving, some, shared.source);
    });
    for_parts(cells.active, [&](std::size_t, Bricks some) { keep_leaving(cells, some, shared.leaving); });
    return shared;
}

// Conjugate gradients, with the diagonal as preconditioner (M. R. Hestenes and E. Stiefel 1952).
std::vector<BrickOfCells> solve(const DiffusionCells& cells, const std::vector<BrickOfCells>& source, double albedo) {
    const std::size_t bricks = cells.bricks;
    Iteration it;
    for (auto* each : {&it.inverse, &it.diagonal, &it.fluence, &it.direction, &it.image}) each->resize(bricks + 1);
    it.residual = source;
    const float absorbed = (1 - float(albedo)) / (1 - cells.mean_cosine);
    for_parts(cells.active, [&](std::size_t, Bricks some) {
        set_diagonal(cells, absorbed, some, it);
    });
    double product = sum_over_parts(
        cells.active, [&](Bricks some) { return residual_product(some, it); });
    const double small = kSmallResidual * kSmallResidual * product;
    float keep = 0;
    for (int round = 0; round < kMostRounds && product > small; ++round) {
        for_parts(cells.active, [&](std::size_t, Bricks some) { turn(keep, some, it); });
        const double curvature = sum_over_parts(
            cells.active, [&](Bricks some) { return set_image(cells, some, it); });
        const auto length = float(product / curvature);
        const double next = sum_over_parts(
            cells.active, [&](Bricks some) { return step(length, some, it); });
        keep = float(next / product);
        product = next;
    }
    return std::move(it.fluence);
}

std::vector<LightOfCells> light_of_cells(const DiffusionCells& cells, const std::vector<BrickOfCells>& fluence,
                                         const FluenceOutside& outside, const std::vector<NumbersOfFaces>& leaving) {
    std::vector<Fluxes> fluxes(cells.bricks + 1);
    for_parts(cells.active, [&](std::size_t, Bricks some) {
        find_fluxes(cells, fluence, outside, leaving, some, fluxes);
    });
    std::vector<LightOfCells> light(cells.bricks + 1);
    for_parts(first_numbers(cells.bricks), [&](std::size_t, Bricks some) {
        collect_light(cells, fluence, outside, leaving, fluxes, some, light);
    });
    return light;
}

}  // namespace nephos
