// SPDX-License-Identifier: Apache-2.0
#pragma once

// Bilinear interpolation of a table along straight lines. Private to the module.

#include <span>

namespace nephos {

// A row-major table of numbers; beyond it they are 0.
struct NumberTable {
    std::span<const float> numbers;
    int width = 0, height = 0;
};

// Points (u + n du, v + n dv) of a table, n = 0, 1, ...
struct TableLine {
    double u = 0, v = 0, du = 0, dv = 0;
};

// Adds the numbers at the points of a line to `to`.
void add_along(const NumberTable& table, const TableLine& line, std::span<float> to);

// Multiplies numbers by exp(-depth).
void attenuate(std::span<const float> depths, std::span<float> numbers);

}  // namespace nephos
