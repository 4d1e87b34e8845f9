// SPDX-License-Identifier: Apache-2.0
#pragma once

// Optical depth towards a distant light, through the cells of a CoverageField: one sweep over the lattice, slice by
// slice away from the light. Every line along the light is carried from slice to slice without being resampled, so
// that depth does not spread sideways. Private to the module.

#include <array>
#include <span>
#include <vector>

#include "core/vec.h"
#include "density/detail.h"

namespace nephos {

inline constexpr int kLightNodes = 5;  // on an edge of a brick: the corners of its cells
inline constexpr std::size_t kLightNodesOfBrick = std::size_t(kLightNodes) * kLightNodes * kLightNodes;

// The lines of a sweep as they leave the lattice.
class LightFront {
  public:
    // Returns the optical depth of the whole line through a point.
    float depth_at(const Vec3& point_m) const;

  private:
    friend LightFront sweep(const CoverageField&, std::span<const float>, const Vec3&, std::span<float>,
                            std::span<float>);
    float at(double u, double v) const;
    // Fills width x height numbers, x fastest, for lines (u, v), (u + 1, v) ...
    void resample(double u, double v, int width, int height, std::vector<float>& to) const;

    Vec3 corner_m_{};
    double cell_m_ = 1, plane_ = 0;  // of the face that the light leaves by, cells
    int axes_[3] = {0, 1, 2};        // across, across, along
    double shift_[2] = {};           // across by each cell along, cells
    double first_[2] = {};           // number of the first line on each axis
    int lines_[2] = {};
    bool downwards_ = true;  // along the axis
    std::vector<float> depth_;
};

// Sums extinction (per metre; one number a cell of each brick that holds cloud, x fastest) from the light on.
// `depths` gets the optical depth at the corners of cells: kLightNodesOfBrick for each such brick, x fastest.
// `corners`, unless it is empty, gets those at the corners of all bricks: (bricks + 1) on each axis, x fastest.
LightFront sweep(const CoverageField& field, std::span<const float> extinction, const Vec3& to_light,
                 std::span<float> depths, std::span<float> corners = {});

}  // namespace nephos
