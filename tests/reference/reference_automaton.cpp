// SPDX-License-Identifier: Apache-2.0
#include "tests/reference/reference_automaton.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include <Random123/philox.h>

#include "automaton/block_field.h"
#include "automaton/kernels.h"
#include "automaton/poisson.h"

namespace nephos::reference {
namespace {

// Value of a cell that may lie outside: the boundary decides.
std::uint8_t at(const std::vector<std::uint8_t>& plane, const Extent& e, const Boundaries& b, int i, int j,
                int k) {
    const auto fold = [](int& n, int size, Boundary boundary) {
        if (n >= 0 && n < size) return true;
        n = ((n % size) + size) % size;
        return boundary == Boundary::periodic;
    };
    if (!fold(i, e.x, b.x) || !fold(j, e.y, b.y) || !fold(k, e.z, b.z)) return 0;
    return plane[linear_index(e, i, j, k)];
}

// The random 32-bit word `word` of counter (draw, domain, step, block, sub): docs/adr/0002 in one line.
std::uint32_t random_word(std::uint64_t seed, std::uint32_t draw, std::uint32_t domain, std::uint32_t step, int bx,
                          int by, int bz, std::uint32_t sub, std::uint32_t word) {
    const r123::Philox4x32::ctr_type counter = {{sub + draw * 65536u + 2u * 16777216u, step,
                                                 std::uint32_t(bx + by * 65536), std::uint32_t(bz) + domain * 65536u}};
    const r123::Philox4x32::key_type key = {{std::uint32_t(seed & 0xFFFFFFFFu), std::uint32_t(seed >> 32)}};
    return r123::Philox4x32{}(counter, key).v[word];
}

// Everything about one block in one step.
struct BlockDraws {
    const AutomatonOptions& options;
    const BlockField& field;
    std::uint32_t domain, step;
    int bx, by, bz;
    BlockPlan plan;

    std::uint32_t word(std::uint32_t draw_id, std::uint32_t sub, std::uint32_t n) const {
        return random_word(options.seed, draw_id, domain, step, bx, by, bz, sub, n);
    }
    float p(int draw, int cell) const {
        const float value = probability_at(plan, draw, cell % 8, cell / 8 % 8, cell / 64);
        if (value > plan.draws[std::size_t(draw)].p_max)
            throw std::logic_error("a cell exceeds the bound of its block");
        return value;
    }
};

using Events = std::array<std::vector<bool>, 3>;  // per draw, which of the 512 cells have one

std::uint32_t poisson(const PoissonTable& level, std::uint32_t uniform) {
    std::uint32_t count = 0;
    for (std::uint32_t threshold : level.thresholds) count += threshold <= uniform ? 1 : 0;
    return count;
}

// The sparse births of the block: Poisson events, each of hum, act or none by the rates of its cell.
void sparse_births(const BlockDraws& b, unsigned draws, const PoissonLadder& ladder, Events& events) {
    float bound = 0;
    for (int draw = 0; draw < 2; ++draw)
        if ((draws >> draw & 1) != 0) bound += sparse_rate(std::min(b.plan.draws[std::size_t(draw)].p_max, 0.25f)) * 1.00001f;
    const PoissonTable& level = ladder.level(bound);
    const std::uint32_t count = poisson(level, b.word(0, 0, 0));
    for (std::uint32_t e = 0; e < count; ++e) {
        const std::uint32_t first = b.word(4, e / 2, e % 2 * 2), second = b.word(4, e / 2, e % 2 * 2 + 1);
        const int cell = int(first % 512);
        const double v = (double(second / 2) + double(first / 1024) / 4194304) / 2147483648 * level.rate;
        double sum = 0;
        for (int draw = 0; draw < 2; ++draw) {
            if ((draws >> draw & 1) == 0) continue;
            sum += double(sparse_rate(b.p(draw, cell)));
            if (v < sum) {
                events[std::size_t(draw)][std::size_t(cell)] = true;
                break;
            }
        }
    }
}

// The sparse extinctions of the block: Poisson events on the cells of cloud alone where they are few, else on all.
void sparse_extinctions(const BlockDraws& b, const std::vector<int>& cloud, const PoissonLadder& ladder, Events& events) {
    const bool thick = cloud.size() >= 128;
    const float n = thick ? 512 : float(cloud.size());
    const PoissonTable& level = ladder.level(sparse_rate(b.plan.draws[kExt].p_max) * 1.00001f * (n / 512));
    const float unit = float(level.rate) * (512.0f / 2147483648.0f) / n;
    const std::uint32_t count = poisson(level, b.word(0, 0, 1));
    for (std::uint32_t e = 0; e < count; ++e) {
        const std::uint64_t first = b.word(5, e / 2, e % 2 * 2), second = b.word(5, e / 2, e % 2 * 2 + 1);
        const int cell = thick ? int(first % 512) : cloud[std::size_t(first * cloud.size() / 4294967296u)];
        const std::uint64_t left = thick ? first / 512 * 512 : first * cloud.size() % 4294967296u;
        const float v = float(second / 2) * unit + float(left / 2) * (unit / 2147483648.0f);
        if (v < sparse_rate(b.p(kExt, cell))) events[kExt][std::size_t(cell)] = true;
    }
}

void dense_events(const BlockDraws& b, int draw, Events& events) {
    for (std::uint32_t cell = 0; cell < 512; ++cell) {
        const std::uint32_t t = probability_threshold(b.p(draw, int(cell)));
        const std::uint32_t byte =
            (b.word(std::uint32_t(draw) + 1, cell / 16, cell / 4 % 4) >> (cell % 4 * 8)) & 255u;
        const std::uint32_t more = b.word(std::uint32_t(draw) + 1, 32 + cell / 4, cell % 4) >> 8;
        events[std::size_t(draw)][cell] =
            byte < t >> 24 || (byte == t >> 24 && (t == kCertain || more < (t & 0xFFFFFFu)));
    }
}

// `cloud` has the cells of the block that are cld, rising.
Events events_of(const BlockDraws& b, const PoissonLadder& ladder, const std::vector<int>& cloud) {
    Events events;
    events.fill(std::vector<bool>(512, false));
    unsigned sparse = 0;
    for (int draw = 0; draw < 2; ++draw) {
        const DrawPlan& plan = b.plan.draws[std::size_t(draw)];
        if (plan.kind == DrawPlan::Kind::none) continue;
        if (is_sparse(plan)) {
            sparse |= 1u << draw;
        } else {
            dense_events(b, draw, events);
        }
    }
    if (sparse != 0) sparse_births(b, sparse, ladder, events);
    if (b.plan.draws[kExt].kind == DrawPlan::Kind::none || cloud.empty()) return events;
    if (is_sparse_extinction(b.plan.draws[kExt], int(cloud.size()))) {
        sparse_extinctions(b, cloud, ladder, events);
    } else {
        dense_events(b, kExt, events);
    }
    return events;
}

}  // namespace

Cells to_cells(BitPlaneView hum, BitPlaneView act, BitPlaneView cld) {
    const Extent e = hum.extent;
    Cells cells{e, {}, {}, {}};
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                cells.hum.push_back(hum.get(i, j, k));
                cells.act.push_back(act.get(i, j, k));
                cells.cld.push_back(cld.get(i, j, k));
            }
        }
    }
    return cells;
}

Lattice to_lattice(const Cells& cells) {
    const Extent e = cells.extent;
    Lattice lattice{BitPlane(e), BitPlane(e), BitPlane(e)};
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const std::size_t n = linear_index(e, i, j, k);
                lattice.hum.set(i, j, k, cells.hum[n] != 0);
                lattice.act.set(i, j, k, cells.act[n] != 0);
                lattice.cld.set(i, j, k, cells.cld[n] != 0);
            }
        }
    }
    return lattice;
}

Cells grow(const Cells& now, const Boundaries& b) {
    Cells next = now;
    const Extent e = now.extent;
    for (int k = 0; k < e.z; ++k) {
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                const auto act = [&](int di, int dj, int dk) {
                    return at(now.act, e, b, i + di, j + dj, k + dk);
                };
                const std::uint8_t f_act = act(1, 0, 0) | act(-1, 0, 0) | act(0, 1, 0) | act(0, -1, 0) |
                                           act(0, 0, 1) | act(0, 0, -1) | act(2, 0, 0) | act(-2, 0, 0) |
                                           act(0, 2, 0) | act(0, -2, 0) | act(0, 0, -2);
                const std::size_t n = linear_index(e, i, j, k);
                next.hum[n] = now.hum[n] & (now.act[n] == 0 ? 1 : 0);
                next.cld[n] = now.cld[n] | now.act[n];
                next.act[n] = (now.act[n] == 0 ? 1 : 0) & now.hum[n] & f_act;
            }
        }
    }
    return next;
}

namespace {

void draw(Cells& cells, const AutomatonOptions& options, std::uint32_t domain, std::uint32_t step,
          const std::vector<ActiveEllipsoid>& ellipsoids) {
    Background background(options);
    background.set_time(options, double(step) * options.time_step_s);
    const BlockField field(options, ellipsoids, background);
    const PoissonLadder ladder;
    const Extent e = options.extent;
    for (int bz = 0; bz * 8 < e.z; ++bz) {
        for (int by = 0; by * 8 < e.y; ++by) {
            std::vector<const FieldEllipsoid*> row;
            field.collect(by, bz, row);
            for (int bx = 0; bx * 8 < e.x; ++bx) {
                BlockDraws b{options, field, domain, step, bx, by, bz, {}};
                field.plan_blocks(bx, by, bz, row, std::span(&b.plan, 1));
                std::vector<std::pair<int, std::size_t>> inside;  // cell of the block, cell of the lattice
                std::vector<int> cloud;
                for (int cell = 0; cell < 512; ++cell) {
                    const int i = bx * 8 + cell % 8, j = by * 8 + cell / 8 % 8, k = bz * 8 + cell / 64;
                    if (i >= e.x || j >= e.y || k >= e.z) continue;
                    inside.emplace_back(cell, linear_index(e, i, j, k));
                    if (cells.cld[inside.back().second] != 0) cloud.push_back(cell);
                }
                const Events events = events_of(b, ladder, cloud);
                for (const auto& [cell, n] : inside) {
                    if (events[kHum][std::size_t(cell)]) cells.hum[n] = 1;  // hum' = hum | (rnd < p_hum)
                    if (events[kAct][std::size_t(cell)]) cells.act[n] = 1;  // act' = act | (rnd < p_act)
                    if (events[kExt][std::size_t(cell)]) cells.cld[n] = 0;  // cld' = cld & (rnd >= p_ext)
                }
            }
        }
    }
}

}  // namespace

Cells first_state(const AutomatonOptions& options, const std::vector<ActiveEllipsoid>& ellipsoids) {
    const BitPlane none(options.extent);
    Cells cells = to_cells(none.view(), none.view(), none.view());
    draw(cells, options, 1, 0, ellipsoids);
    return cells;
}

void extinguish_and_bear(Cells& cells, const AutomatonOptions& options, std::uint32_t step,
                         const std::vector<ActiveEllipsoid>& ellipsoids) {
    draw(cells, options, 0, step, ellipsoids);
}

void advect_layer(Cells& cells, const Boundaries& b, int k, std::int64_t dx, std::int64_t dy) {
    const Extent e = cells.extent;
    for (auto* plane : {&cells.hum, &cells.act, &cells.cld}) {
        const std::vector<std::uint8_t> before = *plane;
        for (int j = 0; j < e.y; ++j) {
            for (int i = 0; i < e.x; ++i) {
                std::int64_t from_i = i - dx, from_j = j - dy;
                if (b.x == Boundary::periodic) from_i = ((from_i % e.x) + e.x) % e.x;
                if (b.y == Boundary::periodic) from_j = ((from_j % e.y) + e.y) % e.y;
                const bool inside = from_i >= 0 && from_i < e.x && from_j >= 0 && from_j < e.y;
                (*plane)[linear_index(e, i, j, k)] =
                    inside ? before[linear_index(e, int(from_i), int(from_j), k)] : std::uint8_t{0};
            }
        }
    }
}

double probability(const AutomatonOptions& o, const std::vector<ActiveEllipsoid>& ellipsoids, int draw, int i,
                   int j, int k) {
    const auto pick = [draw](const Probabilities& p) {
        return draw == 0 ? p.hum : draw == 1 ? p.act : p.ext;
    };
    const double cell = o.placement.cell_size_m;
    const double x = o.placement.origin_m.x + (i + 0.5) * cell, y = o.placement.origin_m.y + (j + 0.5) * cell,
                 z = o.placement.origin_m.z + (k + 0.5) * cell;
    const double background = pick(o.field.background);
    double result = background;
    const auto images = [](Boundary b) { return b == Boundary::periodic ? 4 : 0; };
    for (const ActiveEllipsoid& a : ellipsoids) {
        const Ellipsoid& e = a.ellipsoid;
        const double turn = e.yaw_deg * std::acos(-1.0) / 180;
        for (int px = -images(o.boundaries.x); px <= images(o.boundaries.x); ++px) {
            for (int py = -images(o.boundaries.y); py <= images(o.boundaries.y); ++py) {
                for (int pz = -images(o.boundaries.z); pz <= images(o.boundaries.z); ++pz) {
                    const double dx = x - e.centre_m.x - px * o.extent.x * cell;
                    const double dy = y - e.centre_m.y - py * o.extent.y * cell;
                    const double dz = z - e.centre_m.z - pz * o.extent.z * cell;
                    const double u2 =
                        std::pow((dx * std::cos(turn) + dy * std::sin(turn)) / e.semi_axes_m.x, 2) +
                        std::pow((dy * std::cos(turn) - dx * std::sin(turn)) / e.semi_axes_m.y, 2) +
                        std::pow(dz / e.semi_axes_m.z, 2);
                    if (u2 >= 1) continue;
                    const double p = pick(e.rim) + (pick(e.centre) - pick(e.rim)) * (1 - u2) * (1 - u2);
                    const double faded = background + a.weight * (p - background);
                    result = draw == 2 ? std::min(result, faded) : std::max(result, faded);
                }
            }
        }
    }
    return result;
}

}  // namespace nephos::reference
