// SPDX-License-Identifier: Apache-2.0
#pragma once

// Optical depth towards a directional light, by a sweep over the lattice of a CoverageField, slice by slice away
// from the light. It is accumulated along lines parallel to the light, one for each cell of a slice, that are
// sheared against the lattice. The sum of a line is never interpolated onto another, as it is where each slice is
// resampled from the one before: no numerical diffusion widens shadows with the distance. Extinction that enters a
// line, and depths that are read out at nodes, are interpolated, once.
//
// Serves sunlight; the light of sky and ground diffuses (diffusion.h). Private to the module.

#include <array>
#include <span>
#include <vector>

#include "core/vec.h"
#include "density/detail.h"

namespace nephos {

// Light is stored at the corners of cells, not at the nodes of CoverageField, which are half a cell apart.
inline constexpr int kLightNodes = 5;  // on an edge of a brick
inline constexpr std::size_t kLightNodesOfBrick = std::size_t(kLightNodes) * kLightNodes * kLightNodes;

// The accumulated depth behind the lattice: a two-dimensional shadow, extruded along the light.
class LightFront {
  public:
    // A front that repeats (CoverageField::period_m()): its depths, x fastest, on the plane where light enters, at
    // places that are multiples of a cell from the grid's first corner.
    bool is_periodic() const { return periodic_; }
    std::span<const float> depths() const { return depth_; }
    int columns() const { return lines_[0]; }
    int rows() const { return lines_[1]; }
    // ... the place in it of the line through a point, in cells: not wrapped.
    Vec2 place_of(const Vec3& point_m) const;

    // Returns the optical depth of the whole line through a point, wherever on it the point lies, also between the
    // light and the cloud; 0 beside the cloud's shadow.
    float depth_at(const Vec3& point_m) const;
    // Adds the depths at the points first_m + n step_m.
    void add_depths(const Vec3& first_m, const Vec3& step_m, std::span<float> depths) const;

  private:
    friend LightFront sweep(const CoverageField&, std::span<const float>, const Vec3&, std::span<float>,
                            std::span<float>);
    friend LightFront periodic_sweep(const CoverageField&, std::span<const float>, const Vec3&, std::span<float>,
                                     std::span<float>);
    float at(double u, double v) const;
    // Interpolates depths at the width x height points (u, v), (u + 1, v) ..., x fastest.
    void resample(double u, double v, int width, int height, std::vector<float>& to) const;

    Vec3 corner_m_{};
    double cell_m_ = 1, plane_ = 0;  // plane_: number of cells along the sweep axis
    int axes_[3] = {0, 1, 2};        // two transverse axes, and the sweep axis
    double shift_[2] = {};           // shear: cells across for each cell along the sweep
    double first_[2] = {};           // number of the first line on each transverse axis
    int lines_[2] = {};              // number of lines on each of these
    bool periodic_ = false;
    bool downwards_ = true;          // the light travels towards negative coordinates of the sweep axis
    std::vector<float> depth_;       // of each line, the first transverse axis fastest
};

// Integrates extinction from the light on. With n = field.places().size(), the bricks that hold cloud:
//   extinction  per metre, 64 n numbers: one for each cell of each such brick, x fastest
//   to_light    unit vector towards the light
//   depths      gets kLightNodesOfBrick n optical depths: at the corners of cells of each such brick, x fastest
//   corners     empty, or gets those at the corners of all bricks: (bricks + 1) on each axis, x fastest
// These sizes and the length of `to_light` are preconditions. A field that repeats (CoverageField::period_m()) is
// swept downwards, lines that leave it through a side come back through the opposite one, and light comes from at least
// 1.15 degrees above the horizon. Otherwise there is no cloud beyond the padding of the field (CoverageField::corner_m()).
// Serial; sweeps may run in parallel.
LightFront sweep(const CoverageField& field, std::span<const float> extinction, const Vec3& to_light,
                 std::span<float> depths, std::span<float> corners = {});

}  // namespace nephos
