// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion_solver.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "render/cloud/octet_vectors.h"

namespace nephos {
namespace {

constexpr float kLeastThickness = 0.1f;  // reduced optical, of cells in the weights of their light

// Holds the vectors of conjugate gradients; `inverse`: of the diagonal of the equations.
struct Iteration {
    std::vector<Octet> inverse, diagonal, fluence, residual, direction, image;
};

// Cells without cloud have a fluence of 0.
void set_diagonal(const DiffusionCells& cells, float absorbed, Octets some, Iteration& it) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const Cells thickness = load(cells.thickness[octet]), outside = load(cells.to_outside[octet]);
        Cells sum = times(absorbed, thickness);
        for (const Octet& to : cells.to_neighbours[octet]) {
            const auto lanes = [](Quad conducted, Quad open) { return pick(conducted, conducted, open); };
            sum = plus(sum, each(lanes, load(to), outside));
        }
        const auto inverse = [](Quad of) { return 1 / of; };
        store(where_positive(thickness, sum), it.diagonal[octet]);
        store(where_positive(thickness, each(inverse, sum)), it.inverse[octet]);
    }
}

double sum_of(Quad lanes) {
    return (double(lanes[0]) + double(lanes[1])) + (double(lanes[2]) + double(lanes[3]));
}
void add_product(const Cells& a, const Cells& b, Quad& sum) { sum += a.low * b.low + a.high * b.high; }

double residual_product(Octets some, const Iteration& it) {
    Quad sum = number(0);
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const Cells residual = load(it.residual[octet]);
        add_product(times(residual, load(it.inverse[octet])), residual, sum);
    }
    return sum_of(sum);
}

// The product of residual and direction.
double residual_along(Octets some, const Iteration& it) {
    Quad sum = number(0);
    for (const std::int32_t one : some)
        add_product(load(it.residual[std::size_t(one)]), load(it.direction[std::size_t(one)]), sum);
    return sum_of(sum);
}

void turn(float keep, Octets some, Iteration& it) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        store(plus(times(load(it.inverse[octet]), load(it.residual[octet])),
                   times(keep, load(it.direction[octet]))),
              it.direction[octet]);
    }
}

// Applies the equations to the direction: net light that leaves each cell, were that its fluence. Returns the product of
// both.
double set_image(const DiffusionCells& cells, Octets some, Iteration& it) {
    Quad product = number(0);
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const auto of_octet = [&](std::size_t n) { return load(it.direction[n]); };
        const auto& to = cells.to_neighbours[octet];
        const Cells own = of_octet(octet);
        Cells sum = times(load(it.diagonal[octet]), own);
        for_neighbours(cells, octet, of_octet, [&](auto axis, const Cells& inner, const Cells& beyond) {
            sum = minus(sum, plus(times(load(to[2 * axis]), inner), times(load(to[2 * axis + 1]), beyond)));
        });
        store(sum, it.image[octet]);
        add_product(own, sum, product);
    }
    return sum_of(product);
}

// Returns residual_product().
double step(float length, Octets some, Iteration& it) {
    Quad product = number(0);
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        store(plus(load(it.fluence[octet]), times(length, load(it.direction[octet]))), it.fluence[octet]);
        const Cells residual = minus(load(it.residual[octet]), times(length, load(it.image[octet])));
        store(residual, it.residual[octet]);
        add_product(times(residual, load(it.inverse[octet])), residual, product);
    }
    return sum_of(product);
}

// Return the fluence beyond the inner and the outer faces on an axis: the inner face of an upper cell is its lower one.
template <int kAxis>
Cells beyond_inner(const FluenceOutside& outside) {
    return halves<kAxis>(same(outside[2 * kAxis]), same(outside[2 * kAxis + 1]));
}
template <int kAxis>
Cells beyond_outer(const FluenceOutside& outside) {
    return halves<kAxis>(same(outside[2 * kAxis + 1]), same(outside[2 * kAxis]));
}

void take_light(const DiffusionCells& cells, const FluenceOutside& outside, Octets some,
                std::vector<Octet>& source) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const auto& to = cells.to_neighbours[octet];
        Cells sum = same(0);
        const auto add = [&](const Octet& conducted, const Cells& light) {
            sum = plus(sum, where_not_positive(load(conducted), light));
        };
        add(to[0], beyond_inner<0>(outside));
        add(to[1], beyond_outer<0>(outside));
        add(to[2], beyond_inner<1>(outside));
        add(to[3], beyond_outer<1>(outside));
        add(to[4], beyond_inner<2>(outside));
        add(to[5], beyond_outer<2>(outside));
        store(times(load(cells.to_outside[octet]), sum), source[octet]);
    }
}

// The share of a face: the resistance from the middle of the cell to where light starts, over that to beyond the face.
void find_shares(const DiffusionCells& cells, const std::vector<StartingLight>& starting, Octets some,
                 std::vector<NumbersOfFaces>& shares) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const auto& to = cells.to_neighbours[octet];
        const Cells resistance = times(1.5f, load(cells.thickness[octet])), open = load(cells.to_outside[octet]);
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
            const Cells up = load(starting[octet].place[kAxis]), down = minus(same(0), up);
            add(2 * kAxis, halves<kAxis>(down, up));
            add(2 * kAxis + 1, halves<kAxis>(up, down));
        });
        const auto part = [](Quad light, Quad all) { return light / (all > 1 ? all : number(1)); };
        const Cells light = each(part, load(starting[octet].light), sum);
        for (std::size_t face = 0; face < 6; ++face) store(times(light, shared[face]), shares[octet][face]);
    }
}

void take_shares(const DiffusionCells& cells, const std::vector<StartingLight>& starting,
                 const std::vector<NumbersOfFaces>& shares, Octets some, std::vector<Octet>& source) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        Cells sum = load(starting[octet].light);
        for_axes([&](auto axis) {
            constexpr int kAxis = decltype(axis)::value;
            const Cells inner = load(shares[octet][2 * kAxis]), beyond = load(shares[octet][2 * kAxis + 1]);
            const auto of_neighbour = [&](std::size_t n) { return load(shares[n][2 * kAxis + 1]); };
            sum = plus(minus(sum, plus(inner, beyond)),
                       plus(exchanged<kAxis>(inner), outer<kAxis>(cells.beside[octet], of_neighbour)));
        });
        store(where_positive(load(cells.thickness[octet]), sum), source[octet]);
    }
}

void keep_leaving(const DiffusionCells& cells, Octets some, std::vector<NumbersOfFaces>& shares) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        for (std::size_t face = 0; face < 6; ++face) {
            Octet& share = shares[octet][face];
            store(where_not_positive(load(cells.to_neighbours[octet][face]), load(share)), share);
        }
    }
}

using Fluxes = std::array<Octet, 3>;

// Net flux through the middle of cells, half of that through both faces. `leaving`: through faces without cloud besides,
// or none.
void find_fluxes(const DiffusionCells& cells, const std::vector<Octet>& fluence, const FluenceOutside& outside,
                 const std::vector<NumbersOfFaces>& leaving, Octets some, std::vector<Fluxes>& fluxes) {
    constexpr NumbersOfFaces kNone{};
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const auto of_octet = [&](std::size_t n) { return load(fluence[n]); };
        const Cells own = of_octet(octet), open = load(cells.to_outside[octet]);
        for_neighbours(cells, octet, of_octet, [&](auto axis, const Cells& inner, const Cells& beyond) {
            constexpr int kAxis = decltype(axis)::value;
            const NumbersOfFaces& besides = leaving.empty() ? kNone : leaving[octet];
            const auto towards = [&](std::size_t face, const Cells& other, const Cells& light) {
                const Cells by = load(cells.to_neighbours[octet][face]);
                return each(pick, by, times(by, minus(own, other)),
                            plus(times(open, minus(own, light)), load(besides[face])));
            };
            const Cells in = towards(2 * kAxis, inner, beyond_inner<kAxis>(outside)),
                        out = towards(2 * kAxis + 1, beyond, beyond_outer<kAxis>(outside));
            const Cells upwards = times(0.5f, minus(out, in));
            store(halves<kAxis>(upwards, minus(same(0), upwards)), fluxes[octet][std::size_t(kAxis)]);
        });
    }
}

// The light of cells without cloud.
void add_light_of_faces(const DiffusionCells& cells, const std::vector<Octet>& fluence,
                        const FluenceOutside& outside, const std::vector<NumbersOfFaces>& leaving,
                        const std::vector<Fluxes>& fluxes, std::size_t octet, const Cells& empty, LightOfCells& light) {
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
    const auto& beside = cells.beside[octet];
    const auto thickness_of = [&](std::size_t n) { return load(cells.thickness[n]); };
    const auto fluence_of = [&](std::size_t n) { return load(fluence[n]); };
    for_neighbours(cells, octet, thickness_of, [&](auto axis, const Cells& inner, const Cells& beyond) {
        constexpr int kAxis = decltype(axis)::value;
        const auto inner_of = [&](std::size_t n) { return exchanged<kAxis>(load_flux(n)(octet)); };
        const auto outer_of = [&](std::size_t n) { return outer<kAxis>(beside, load_flux(n)); };
        const auto leaving_of = [&](std::size_t face) {
            return [&leaving, face](std::size_t n) { return leaving.empty() ? same(0) : load(leaving[n][face]); };
        };
        // Take the light that arrives at the neighbour's face from the side opposite to it.
        if (any_positive(inner))
            add(inner, exchanged<kAxis>(fluence_of(octet)), {inner_of(0), inner_of(1), inner_of(2)},
                beyond_outer<kAxis>(outside), exchanged<kAxis>(leaving_of(2 * kAxis)(octet)));
        if (any_positive(beyond))
            add(beyond, outer<kAxis>(beside, fluence_of), {outer_of(0), outer_of(1), outer_of(2)},
                beyond_inner<kAxis>(outside), outer<kAxis>(beside, leaving_of(2 * kAxis + 1)));
    });
    constexpr float kWeight = 1 / kLeastThickness;
    const auto mean = [](Quad sum, Quad number_of) { return kWeight * sum / (number_of > 1 ? number_of : number(1)); };
    const auto replace = [&](Octet& to, const Cells& by) {
        store(plus(load(to), where_positive(empty, by)), to);
    };
    replace(light[0], where_positive(count, same(kWeight)));
    for (std::size_t n = 0; n < 4; ++n)
        replace(light[n + 1], each(mean, values[n], count));
}

void collect_light(const DiffusionCells& cells, const std::vector<Octet>& fluence, const FluenceOutside& outside,
                   const std::vector<NumbersOfFaces>& leaving, const std::vector<Fluxes>& fluxes, Octets some,
                   std::vector<LightOfCells>& light) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        LightOfCells& to = light[octet];
        const Cells thickness = load(cells.thickness[octet]);
        const auto weight_of = [](Quad of) { return 1 / (of + kLeastThickness); };
        const Cells weight = where_positive(thickness, each(weight_of, thickness));
        store(weight, to[0]);
        store(times(weight, load(fluence[octet])), to[1]);
        for (std::size_t axis = 0; axis < 3; ++axis) store(times(weight, load(fluxes[octet][axis])), to[axis + 2]);
        const Cells empty = where_not_positive(thickness, same(1));
        if (any_positive(empty)) add_light_of_faces(cells, fluence, outside, leaving, fluxes, octet, empty, to);
    }
}

constexpr double kSmallResidual = 1e-3;  // relative, which ends the iterations
constexpr int kMostRounds = 200;
// End the solution in two levels, and in each of its turns that on wide cells and the steps on fine ones.
constexpr double kSmallResidualOfTwo = 5e-3, kSmallResidualOfWide = 0.1;
constexpr int kRoundsOfTurn = 4;
constexpr double kNoLight = 1e-24;  // square of a fluence that no byte of a node shows

// Sums are those of parts in their order, whatever the number of threads.
template <class Number>
double sum_over_parts(Octets octets, const Number& number) {
    std::vector<double> sums((octets.size() + kOctetsOfPart - 1) / kOctetsOfPart);
    for_parts(octets, [&](std::size_t part, Octets some) { sums[part] = number(some); });
    return std::accumulate(sums.begin(), sums.end(), 0.0);
}

// Less than a residual that counts, or than one of hardly any light: numbers next to 0 have no digits to go on with.
double small_product(double relative, double product) { return std::max(relative * relative * product, kNoLight); }

double residual_product(const DiffusionCells& cells, const Iteration& it) {
    return sum_over_parts(cells.active, [&](Octets some) { return residual_product(some, it); });
}

Iteration begin(const DiffusionCells& cells, const std::vector<Octet>& source, double albedo) {
    Iteration it;
    for (auto* each : {&it.inverse, &it.diagonal, &it.fluence, &it.direction, &it.image}) each->resize(cells.octets + 1);
    it.residual = source;
    it.residual.resize(cells.octets + 1);
    const float absorbed = (1 - float(albedo)) / (1 - cells.mean_cosine);
    for_parts(cells.active, [&](std::size_t, Octets some) { set_diagonal(cells, absorbed, some, it); });
    return it;
}

// Conjugate gradients, with the diagonal as preconditioner (M. R. Hestenes and E. Stiefel 1952), until residual_product()
// is `small`. `product`: that at first. Returns that at last.
double improve(const DiffusionCells& cells, int rounds, double small, double product, Iteration& it) {
    float keep = 0;
    for (int round = 0; round < rounds && product > small; ++round) {
        for_parts(cells.active, [&](std::size_t, Octets some) { turn(keep, some, it); });
        const double curvature =
            sum_over_parts(cells.active, [&](Octets some) { return set_image(cells, some, it); });
        if (!(curvature > 0)) break;
        const auto length = float(product / curvature);
        const double next = sum_over_parts(cells.active, [&](Octets some) { return step(length, some, it); });
        keep = float(next / product);
        product = next;
    }
    return product;
}

// The residual of wide cells is that of the eight cells in each, as their faces are four times as large. Their fluence is 0.
void take_residual(const DiffusionCells& fine, const Iteration& from, Octets some, Iteration& it) {
    for (const std::int32_t brick : some) {
        Octet& residual = it.residual[std::size_t(brick)];
        for (std::size_t cell = 0; cell < kDiffusionCells; ++cell) {
            const Cells of = load(from.residual[fine.octet_of(brick, cell)]);
            residual.of[cell] = 0.25f * float(sum_of(of.low) + sum_of(of.high));
        }
        store(where_positive(load(it.inverse[std::size_t(brick)]), load(residual)), residual);
        it.fluence[std::size_t(brick)] = {};
    }
}

// Sets the direction to the fluence of wide cells.
void turn_to(const DiffusionCells& fine, const std::vector<Octet>& fluence, Octets some, Iteration& it) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const float wide = fluence[fine.brick_of(octet)].of[fine.within_brick(octet)];
        store(where_positive(load(fine.thickness[octet]), same(wide)), it.direction[octet]);
    }
}

// Goes as far in the direction as brings the fluence nearest to the solution. Returns residual_product().
double go_on(const DiffusionCells& cells, Iteration& it) {
    const double curvature = sum_over_parts(cells.active, [&](Octets some) { return set_image(cells, some, it); });
    if (!(curvature > 0)) return residual_product(cells, it);
    const double along = sum_over_parts(cells.active, [&](Octets some) { return residual_along(some, it); });
    const auto length = float(along / curvature);
    return sum_over_parts(cells.active, [&](Octets some) { return step(length, some, it); });
}

}  // namespace

std::vector<Octet> light_from_outside(const DiffusionCells& cells, const FluenceOutside& outside) {
    std::vector<Octet> source(cells.octets + 1);
    for_parts(cells.active, [&](std::size_t, Octets some) {
        take_light(cells, outside, some, source);
    });
    return source;
}

SharedLight share_light(const DiffusionCells& cells, const std::vector<StartingLight>& starting) {
    SharedLight shared{std::vector<Octet>(cells.octets + 1), std::vector<NumbersOfFaces>(cells.octets + 1)};
    for_parts(cells.active, [&](std::size_t, Octets some) { find_shares(cells, starting, some, shared.leaving); });
    for_parts(cells.active, [&](std::size_t, Octets some) {
        take_shares(cells, starting, shared.leaving, some, shared.source);
    });
    for_parts(cells.active, [&](std::size_t, Octets some) { keep_leaving(cells, some, shared.leaving); });
    return shared;
}

std::vector<Octet> solve(const DiffusionCells& cells, const std::vector<Octet>& source, double albedo) {
    Iteration it = begin(cells, source, albedo);
    const double product = residual_product(cells, it);
    improve(cells, kMostRounds, small_product(kSmallResidual, product), product, it);
    return std::move(it.fluence);
}

std::vector<Octet> solve(const DiffusionCells& fine, const DiffusionCells& wide, const std::vector<Octet>& source,
                         double albedo, int most_turns) {
    Iteration it = begin(fine, source, albedo), rough = begin(wide, {}, albedo);
    double product = residual_product(fine, it);
    const double small = small_product(kSmallResidualOfTwo, product);
    for (int turn = 0; turn < most_turns && product > small; ++turn) {
        for_parts(wide.active, [&](std::size_t, Octets some) { take_residual(fine, it, some, rough); });
        const double rest = residual_product(wide, rough);
        improve(wide, kMostRounds, small_product(kSmallResidualOfWide, rest), rest, rough);
        for_parts(fine.active, [&](std::size_t, Octets some) { turn_to(fine, rough.fluence, some, it); });
        product = improve(fine, kRoundsOfTurn, small, go_on(fine, it), it);
    }
    return std::move(it.fluence);
}

std::vector<LightOfCells> light_of_cells(const DiffusionCells& cells, const std::vector<Octet>& fluence,
                                         const FluenceOutside& outside, const std::vector<NumbersOfFaces>& leaving) {
    std::vector<Fluxes> fluxes(cells.octets + 1);
    for_parts(cells.active, [&](std::size_t, Octets some) {
        find_fluxes(cells, fluence, outside, leaving, some, fluxes);
    });
    std::vector<LightOfCells> light(cells.octets + 1);
    for_parts(first_octets(cells.octets), [&](std::size_t, Octets some) {
        collect_light(cells, fluence, outside, leaving, fluxes, some, light);
    });
    return light;
}

}  // namespace nephos
