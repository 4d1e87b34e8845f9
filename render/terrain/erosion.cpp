// SPDX-License-Identifier: Apache-2.0
#include "render/terrain/erosion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>

namespace nephos {
namespace {

constexpr int kRounds = 14;
constexpr double kAreaPower = 0.45;
// Of a step, per cell: erosion of a node through which one cell drains, relative to its slope.
constexpr double kErodibility = 0.11;
constexpr float kCreep = 0.06f;  // part of the way to the mean of the four around it, a step
constexpr float kUplift = 0.45f;  // of what is worn in the mean

struct Neighbour {
    int i, j;
    double distance;
};
constexpr double kDiagonal = std::numbers::sqrt2;
constexpr Neighbour kNeighbours[] = {{1, 0, 1},          {-1, 0, 1},         {0, 1, 1},          {0, -1, 1},
                                     {1, 1, kDiagonal}, {-1, 1, kDiagonal}, {1, -1, kDiagonal}, {-1, -1, kDiagonal}};

struct Entry {
    float z;
    std::uint32_t node;
    // The lowest first; of equals the one with the smaller number, so that the order is one.
    bool operator<(const Entry& other) const { return z != other.z ? z > other.z : node > other.node; }
};

void creep(std::vector<float>& z, int columns, int rows) {
    const std::vector<float> before = z;
    for (int j = 1; j + 1 < rows; ++j) {
        for (int i = 1; i + 1 < columns; ++i) {
            const std::size_t n = std::size_t(j) * std::size_t(columns) + std::size_t(i);
            const float mean = 0.25f * (before[n - 1] + before[n + 1] + before[n - std::size_t(columns)] +
                                        before[n + std::size_t(columns)]);
            z[n] += kCreep * (mean - before[n]);
        }
    }
}

}  // namespace

Drainage drainage_of(const std::vector<float>& z_m, int columns, int rows) {
    Drainage out;
    out.order.reserve(z_m.size());
    out.receiver.resize(z_m.size());
    out.filled_m = z_m;
    std::vector<std::uint8_t> known(z_m.size(), 0);
    std::priority_queue<Entry> open;
    const auto begin = [&](int i, int j) {
        const auto node = std::uint32_t(j * columns + i);
        if (known[node] != 0) return;
        known[node] = 1;
        out.receiver[node] = node;
        open.push({z_m[node], node});
    };
    for (int i = 0; i < columns; ++i) {
        begin(i, 0);
        begin(i, rows - 1);
    }
    for (int j = 0; j < rows; ++j) {
        begin(0, j);
        begin(columns - 1, j);
    }
    while (!open.empty()) {
        const Entry entry = open.top();
        open.pop();
        out.order.push_back(entry.node);
        const int i = int(entry.node) % columns, j = int(entry.node) / columns;
        for (const Neighbour& to : kNeighbours) {
            const int x = i + to.i, y = j + to.j;
            if (x < 0 || x >= columns || y < 0 || y >= rows) continue;
            const auto node = std::uint32_t(y * columns + x);
            if (known[node] != 0) continue;
            known[node] = 1;
            out.receiver[node] = entry.node;
            out.filled_m[node] = std::max(z_m[node], entry.z);
            open.push({out.filled_m[node], node});
        }
    }
    // Out of hollows water goes where the flood came from, elsewhere down the steepest slope. Floods rise, so that what is
    // lower stands before in the order.
    for (int j = 1; j + 1 < rows; ++j) {
        for (int i = 1; i + 1 < columns; ++i) {
            const auto node = std::uint32_t(j * columns + i);
            double steepest = 0;
            for (const Neighbour& to : kNeighbours) {
                const auto other = std::uint32_t((j + to.j) * columns + i + to.i);
                const double slope = (double(out.filled_m[node]) - double(out.filled_m[other])) / to.distance;
                if (slope > steepest) {
                    steepest = slope;
                    out.receiver[node] = other;
                }
            }
        }
    }
    return out;
}

std::vector<float> drained_cells(const Drainage& drainage) {
    std::vector<float> area(drainage.receiver.size(), 1.0f);
    for (std::size_t n = drainage.order.size(); n-- > 0;) {
        const std::uint32_t node = drainage.order[n], to = drainage.receiver[node];
        if (to != node) area[to] += area[node];
    }
    return area;
}

void erode(HeightImage& image) {
    std::vector<float>& z = image.heights;
    const std::vector<float> uplift = z;
    for (int round = 0; round < kRounds; ++round) {
        const Drainage drainage = drainage_of(z, image.columns, image.rows);
        const std::vector<float> area = drained_cells(drainage);
        for (const std::uint32_t node : drainage.order) {
            const std::uint32_t to = drainage.receiver[node];
            if (to == node) continue;
            const bool straight = int(node) % image.columns == int(to) % image.columns ||
                                  int(node) / image.columns == int(to) / image.columns;
            const double power = kErodibility * std::pow(double(area[node]), kAreaPower) / (straight ? 1 : kDiagonal);
            // z' = z + uplift - power (z' - receiver')
            const double lifted = double(z[node]) + double(kUplift) * double(uplift[node]) / kRounds;
            if (lifted > double(z[to])) z[node] = float((lifted + power * double(z[to])) / (1 + power));
        }
        creep(z, image.columns, image.rows);
    }
}

}  // namespace nephos
