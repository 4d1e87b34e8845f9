// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/diffusion_cells.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <tbb/parallel_for.h>

#include "density/detail_kernels.h"
#include "render/cloud/octet_vectors.h"

namespace nephos {
namespace {

// Limits the conductance between cells that hold next to nothing, as light does not get from one to the other faster than it
// travels. Between wide cells more would only lengthen the iterations; between cells of the lattice the value is fitted to thin
// edges of clouds (docs/lighting.md).
constexpr float kMostOfWideCells = 10, kMostOfCells = 7;
constexpr float kFold = 1e-6f;  // reduced optical thickness of an empty cell in a fold

// Light that leaves a cloud in a fold meets it again: empty cells between two or more of cloud exchange it.
void fill_folds(const DiffusionCells& cells, Octets some, std::vector<Octet>& filled) {
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        Cells count = same(0);
        const auto of_octet = [&](std::size_t n) { return load(cells.thickness[n]); };
        for_neighbours(cells, octet, of_octet, [&](auto, const Cells& inner, const Cells& beyond) {
            count = plus(count, plus(where_positive(inner, same(1)), where_positive(beyond, same(1))));
        });
        const Cells own = of_octet(octet);
        const auto lanes = [](Quad thickness, Quad number_of_them) {
            return pick(thickness, thickness, pick(number_of_them - 1.5f, number(kFold), number(0)));
        };
        store(each(lanes, own, count), filled[octet]);
    }
}

// Flux per difference of fluence between two cells of reduced optical thickness a and b; 0 if one is no cloud.
Quad conductance(Quad a, Quad b, Quad at_most) {
    const Quad least = a < b ? a : b, most = a < b ? b : a;
    const Quad whole = 1 / (1.5f * (a + b)), between = whole < at_most ? whole : at_most;
    return pick(least, least <= kFold ? loss(most) : between, number(0));
}

// The area of a slanting surface is less than that of the faces that stand for it as stairs.
void set_conductances(Octets some, DiffusionCells& cells) {
    const Quad at_most = number(cells.octets_of_brick == 1 ? kMostOfWideCells : kMostOfCells);
    for (const std::int32_t one : some) {
        const auto octet = std::size_t(one);
        const auto of_octet = [&](std::size_t n) { return load(cells.thickness[n]); };
        const Cells own = of_octet(octet);
        Cells open_faces = same(0), squares = same(0);
        for_neighbours(cells, octet, of_octet, [&](auto axis, const Cells& inner, const Cells& beyond) {
            const auto to = [&](Quad a, Quad b) { return conductance(a, b, at_most); };
            store(each(to, own, inner), cells.to_neighbours[octet][2 * axis]);
            store(each(to, own, beyond), cells.to_neighbours[octet][2 * axis + 1]);
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
        store(where_positive(own, times(each(area, open_faces, squares), each(through, own))), cells.to_outside[octet]);
    }
}

constexpr std::size_t kCells = std::size_t(CoverageField::kBrickCells);
constexpr std::size_t kOwn = 13;  // of the bricks around one

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

// The brick and the number in it of the octet beside one.
struct OctetBeside {
    std::int32_t brick;
    std::size_t within;
};

OctetBeside octet_beside(const DiffusionCells& cells, std::size_t place, std::size_t axis, bool above) {
    constexpr std::size_t kStep[] = {1, 3, 9};
    const auto& around = cells.around[place / cells.octets_of_brick];
    const std::int32_t next = around[above ? kOwn + kStep[axis] : kOwn - kStep[axis]];
    if (cells.octets_of_brick == 1) return {next, 0};
    const std::size_t within = place % cells.octets_of_brick, bit = std::size_t{1} << axis;
    return {((within & bit) != 0) == above ? next : around[kOwn], within ^ bit};
}

// The light of images is that of the bricks of the first period, which are their own neighbours.
bool is_image(const DiffusionCells& cells, std::size_t brick) {
    return cells.around[brick][kOwn] != std::int32_t(brick);
}

// Sets what follows from the places and the thickness, which has no folds yet.
void connect(DiffusionCells& cells) {
    cells.beside.resize(cells.octets);
    std::vector<Octet> filled(cells.octets + 1);
    const std::vector<std::int32_t> all = first_octets(cells.octets);
    for_parts(all, [&](std::size_t, Octets some) {
        for (const std::int32_t one : some) {
            for (std::size_t n = 0; n < 6; ++n) {
                const auto [brick, within] = octet_beside(cells, std::size_t(cells.places[std::size_t(one)]), n / 2, n % 2 != 0);
                cells.beside[std::size_t(one)][n] = std::int32_t(cells.octet_of(brick, within));
            }
        }
        fill_folds(cells, some, filled);
    });
    for (std::size_t octet = 0; octet < cells.octets; ++octet)
        if (is_image(cells, cells.brick_of(octet))) filled[octet] = {};
    cells.thickness = std::move(filled);
    std::ranges::copy_if(all, std::back_inserter(cells.active),
                         [&](std::int32_t n) { return any_positive(load(cells.thickness[std::size_t(n)])); });
    cells.to_neighbours.resize(cells.octets + 1);
    cells.to_outside.resize(cells.octets + 1);
    for_parts(cells.active, [&](std::size_t, Octets some) { set_conductances(some, cells); });
}

// Wide cells with cloud, not in folds, are octets, and so are those beside them, in which all folds are.
void number_octets(const DiffusionCells& wide, DiffusionCells& cells) {
    std::vector<std::uint8_t> near(kDiffusionCells * wide.octets);
    for (const std::int32_t brick : wide.active) {
        for (std::size_t within = 0; within < kDiffusionCells; ++within) {
            if (wide.thickness[std::size_t(brick)].of[within] <= kFold) continue;
            const std::size_t place = kDiffusionCells * std::size_t(brick) + within;
            near[place] = 1;
            for (std::size_t n = 0; n < 6; ++n) {
                const OctetBeside beside = octet_beside(cells, place, n / 2, n % 2 != 0);
                if (std::size_t(beside.brick) < wide.octets)
                    near[kDiffusionCells * std::size_t(beside.brick) + beside.within] = 1;
            }
        }
    }
    for (std::size_t place = 0; place < near.size(); ++place)
        if (near[place] != 0) cells.places.push_back(std::int32_t(place));
    cells.octets = cells.places.size();
    cells.numbers.assign(near.size(), std::int32_t(cells.octets));
    for (std::size_t octet = 0; octet < cells.octets; ++octet)
        cells.numbers[std::size_t(cells.places[octet])] = std::int32_t(octet);
}

// The lattice cell that is number `number` of an octet, of the eight of a brick.
std::size_t lattice_cell(std::size_t octet, std::size_t number) {
    const auto at = [&](std::size_t axis) { return 2 * (octet >> axis & 1) + (number >> axis & 1); };
    return (at(2) * kCells + at(1)) * kCells + at(0);
}

}  // namespace

DiffusionCells wide_cells(const CoverageField& field, std::span<const float> extinction, double mean_cosine) {
    DiffusionCells cells;
    cells.octets = field.places().size();
    cells.octets_of_brick = 1;
    cells.mean_cosine = float(mean_cosine);
    cells.edge_m = float(4 * field.node_m());
    cells.places = cells.numbers = first_octets(cells.octets);
    cells.thickness.resize(cells.octets + 1);
    cells.around.resize(cells.octets);
    const HomeBricks home(field);
    const float scale = (1 - cells.mean_cosine) * cells.edge_m / kDiffusionCells;
    tbb::parallel_for(std::size_t{0}, cells.octets, [&](std::size_t brick) {
        const float* const of_brick = &extinction[brick * kCells * kCells * kCells];
        for (std::size_t cell = 0; cell < kDiffusionCells; ++cell) {
            float sum = 0;
            for (std::size_t n = 0; n < kDiffusionCells; ++n) sum += of_brick[lattice_cell(cell, n)];
            cells.thickness[brick].of[cell] = scale * sum;
        }
        cells.around[brick] = bricks_around(field, home, brick);
    });
    connect(cells);
    return cells;
}

bool is_thick(const DiffusionCells& wide, double extinction_per_m) {
    constexpr double kThick = 2;  // reduced optical
    return (1 - double(wide.mean_cosine)) * double(wide.edge_m) * extinction_per_m > kThick;
}

DiffusionCells halved(const DiffusionCells& wide, std::span<const float> extinction) {
    DiffusionCells cells;
    cells.octets_of_brick = kDiffusionCells;
    cells.mean_cosine = wide.mean_cosine;
    cells.edge_m = wide.edge_m / 2;
    cells.around = wide.around;
    number_octets(wide, cells);
    cells.thickness.resize(cells.octets + 1);
    const float scale = (1 - cells.mean_cosine) * cells.edge_m;
    tbb::parallel_for(std::size_t{0}, cells.octets, [&](std::size_t octet) {
        const float* const of_brick = &extinction[cells.brick_of(octet) * kCells * kCells * kCells];
        for (std::size_t n = 0; n < kDiffusionCells; ++n)
            cells.thickness[octet].of[n] = scale * of_brick[lattice_cell(cells.within_brick(octet), n)];
    });
    connect(cells);
    return cells;
}

}  // namespace nephos
