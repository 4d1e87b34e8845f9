// SPDX-License-Identifier: Apache-2.0
#pragma once

// The container of a rain area's particles (P): half a cylinder of elliptic base, around an eye inside the
// area, or at the area's perimeter for an eye outside.
//
// All functions are pure functions of the camera's pose. P re-orients its container when the view has turned
// by more than 90 degrees, which depends on the camera's history; here the container has the nearest of four
// directions, a quarter turn apart. As particles have positions in the world, not in the container
// (particles.h), a turn of the container moves no visible particle.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "core/vec.h"
#include "density/cloud_bases.h"
#include "render/options/camera.h"

namespace nephos {

// The curtain of rain of one area, as long as the ellipse on the ground and up to the cloud.
struct RainCurtain {
    std::uint64_t id = 0;           // of the area in every frame
    double x_m = 0, y_m = 0;        // centre of the ellipse on the ground, world
    double semi_a_m = 1000;         // > 0, along the axis
    double semi_b_m = 1000;         // > 0, across it
    double axis_x = 1, axis_y = 0;  // unit vector of the axis a
    double ground_m = 0,
           base_m = 0;         // world z of the ground and of the cloud's base; nothing if base <= ground
    double rate_mm_per_h = 0;  // in the middle, >= 0
    // Inclination: metres east and north per metre of height.
    double lean_x = 0, lean_y = 0;
    // The cloud that it falls from: in each column of air, along the lean, rain begins at that column's base and has its
    // part of the rate. `base_m` is then the highest of these bases. Null: a level cloud at base_m that is everywhere.
    std::shared_ptr<const CloudBases> cloud{};
};

// Returns whether rain falls in a curtain.
inline bool falls(const RainCurtain& curtain) {
    return curtain.base_m > curtain.ground_m && curtain.rate_mm_per_h > 0;
}

// Returns the cloud from which the rain at a place fell: its water (0..1) and its base. Without RainCurtain::cloud all the
// water at base_m.
CloudBases::Column cloud_above(const RainCurtain& curtain, const Vec3& place_m);

// The cross-section of a curtain at one height.
struct Ellipse {
    double x_m = 0, y_m = 0, semi_a_m = 1, semi_b_m = 1, axis_x = 1, axis_y = 0;
};
Ellipse ellipse_at(const RainCurtain& curtain, double z_m);

// Returns the left side of the ellipse's equation: 0 at the centre, 1 on the perimeter.
double ellipse_value(const Ellipse& ellipse, double x_m, double y_m);
// Returns the point of the perimeter nearest to a point, to 1e-9 of the larger axis (Eberly's bisection).
Vec2 nearest_on_perimeter(const Ellipse& ellipse, double x_m, double y_m);
// Returns the rain at a point relative to that in the middle: 1, falling as 3 s^2 - 2 s^3 to 0 at the
// perimeter over the outer fraction `edge` (0..1) of the radius.
double rain_fraction(const Ellipse& ellipse, double x_m, double y_m, double edge);

// The traces of the frustum's side planes on the ground: unit vectors left and right of the view. Where the
// camera looks so steeply that all directions are in view, `all` is true.
struct SideLines {
    Vec2 left{}, right{};
    bool all = false;
};
SideLines side_lines(const CameraFrame& frame);

// Returns true when an upright cylinder may intersect the frustum: P's test of the perimeter point, extended
// to the whole container, so that no visible part is culled.
bool between_sides(const CameraFrame& frame, const SideLines& lines, const Vec2& centre, double radius_m);

// The intersection of a ray with an ellipse, as distances; first > last when there is none.
struct Crossing {
    double first = 1, last = 0;
};
Crossing crossing(const Ellipse& ellipse, const Vec2& from, const Vec2& direction);

// The visible width of an area, across the line from the eye to its nearest point, down to `depth_m` behind
// that point: to the points where the frustum's sides leave the ellipse or that depth, or where its end is in view to that.
// It decreases as the eye approaches and is continuous in the camera's pose.
struct VisibleWidth {
    double left_m = 0, right_m = 0;  // from the nearest point, both >= 0
};
VisibleWidth visible_width(const Ellipse& ellipse, const CameraFrame& frame, const Vec2& nearest,
                           double depth_m);

// The container of one area in one frame.
struct RainContainer {
    bool near = true;      // the eye is in the area
    double outside_m = 0;  // distance of the eye from the perimeter, 0 inside
    Vec2 nearest{};        // the eye, or the perimeter point nearest to it
    Vec2 centre;           // of the particles' boxes: `nearest` on a grid of the margin
    Vec2 axis{1, 0};       // the container's direction, one of four
    bool whole = false;    // the view is so steep that the rear half is visible, too
    bool seen = true;      // far: the container passes the frustum test
    VisibleWidth width;    // far
};
RainContainer rain_container(const RainCurtain& curtain, const CameraFrame& frame, double margin_m,
                             double radius_m);

// Returns the level of detail (P, equation 3): growth of a particle's size at d = distance / depth of the
// container, 0..1.
inline double lod_size(double d) { return d * d; }

}  // namespace nephos
