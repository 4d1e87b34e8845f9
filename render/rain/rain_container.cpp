// SPDX-License-Identifier: Apache-2.0
#include "render/rain/rain_container.h"

#include <algorithm>
#include <cmath>

#include "core/math.h"
#include "core/vec.h"

namespace nephos {
namespace {

// Returns a point in the ellipse's own axes.
Vec2 own(const Ellipse& e, double x, double y) {
    const double dx = x - e.x_m, dy = y - e.y_m;
    return {dx * e.axis_x + dy * e.axis_y, dy * e.axis_x - dx * e.axis_y};
}

Vec2 world(const Ellipse& e, const Vec2& p) {
    return {e.x_m + p.x * e.axis_x - p.y * e.axis_y, e.y_m + p.x * e.axis_y + p.y * e.axis_x};
}

// The nearest point of x^2/a^2 + y^2/b^2 = 1 with a >= b to (x, y), both >= 0: it is (a^2 x / (t + a^2),
// b^2 y / (t + b^2)) for the largest root t of its equation, which lies between -b^2 + b y and
// -b^2 + hypot(a x, b y) and is found by bisection.
Vec2 nearest_in_quadrant(double a, double b, double x, double y) {
    const double a2 = a * a, b2 = b * b;
    if (y <= 1e-12 * b) {
        const double gap = a2 - b2;
        if (gap > 0 && a * x < gap) {
            const double fraction = a * x / gap;
            return {a * fraction, b * std::sqrt(std::max(0.0, 1 - fraction * fraction))};
        }
        if (!(gap > 0) && x <= 1e-12 * a) return {0, b};  // the centre of a circle: any point will do
        return {a, 0};
    }
    double low = -b2 + b * y, high = -b2 + std::hypot(a * x, b * y);
    for (int i = 0; i < 100 && low < high; ++i) {
        const double t = 0.5 * (low + high);
        if (t == low || t == high) break;
        const double u = a * x / (t + a2), v = b * y / (t + b2);
        (u * u + v * v > 1 ? low : high) = t;
    }
    const double t = 0.5 * (low + high);
    return {a2 * x / (t + a2), b2 * y / (t + b2)};
}

Vec2 unit(double x, double y) {
    const double length = std::hypot(x, y);
    return length > 0 ? Vec2{x / length, y / length} : Vec2{1, 0};
}

// Returns the distance from a point inside the ellipse to its perimeter in a direction.
double reach_beyond(const Ellipse& e, const Vec2& from, const Vec2& direction) {
    const double along = direction.x * e.axis_x + direction.y * e.axis_y;
    const double across = direction.y * e.axis_x - direction.x * e.axis_y;
    const double centre = (e.x_m - from.x) * direction.x + (e.y_m - from.y) * direction.y;
    return std::max(0.0, centre + std::hypot(e.semi_a_m * along, e.semi_b_m * across));
}

// Returns the point of the perimeter that lies farthest in a direction, a unit vector.
Vec2 farthest_towards(const Ellipse& e, const Vec2& direction) {
    const Vec2 d = own(e, e.x_m + direction.x, e.y_m + direction.y);
    const double a = e.semi_a_m * d.x, b = e.semi_b_m * d.y, length = std::hypot(a, b);
    return world(e, {e.semi_a_m * a / length, e.semi_b_m * b / length});
}

Vec2 quarter_turn_nearest(double x, double y) {
    if (std::abs(x) >= std::abs(y)) return {x < 0 ? -1.0 : 1.0, 0};
    return {0, y < 0 ? -1.0 : 1.0};
}

double on_grid(double value, double step) { return step > 0 ? step * std::round(value / step) : value; }

// Returns true when a ray of the image points behind the plane through the eye across `axis`.
bool sees_behind(const CameraFrame& f, const Vec2& axis) {
    for (const double right : {-1.0, 1.0}) {
        for (const double up : {-1.0, 1.0}) {
            const Vec3 ray = f.forward + right * f.half_width * f.right + up * f.half_height * f.up;
            if (ray.x * axis.x + ray.y * axis.y < 0) return true;
        }
    }
    return false;
}

}  // namespace

Ellipse ellipse_at(const RainCurtain& c, double z_m) {
    const double up = z_m - c.ground_m;
    return {c.x_m + c.lean_x * up, c.y_m + c.lean_y * up, c.semi_a_m, c.semi_b_m, c.axis_x, c.axis_y};
}

CloudBases::Column cloud_above(const RainCurtain& c, const Vec3& place_m) {
    if (!c.cloud) return {1, c.base_m};
    const double up = c.base_m - place_m.z;
    return c.cloud->at(place_m.x + c.lean_x * up, place_m.y + c.lean_y * up);
}

double ellipse_value(const Ellipse& e, double x_m, double y_m) {
    const Vec2 p = own(e, x_m, y_m);
    return p.x * p.x / (e.semi_a_m * e.semi_a_m) + p.y * p.y / (e.semi_b_m * e.semi_b_m);
}

Vec2 nearest_on_perimeter(const Ellipse& e, double x_m, double y_m) {
    const Vec2 p = own(e, x_m, y_m);
    const bool swapped = e.semi_a_m < e.semi_b_m;
    Vec2 nearest = swapped ? nearest_in_quadrant(e.semi_b_m, e.semi_a_m, std::abs(p.y), std::abs(p.x))
                           : nearest_in_quadrant(e.semi_a_m, e.semi_b_m, std::abs(p.x), std::abs(p.y));
    if (swapped) std::swap(nearest.x, nearest.y);
    return world(e, {std::copysign(nearest.x, p.x), std::copysign(nearest.y, p.y)});
}

double rain_fraction(const Ellipse& e, double x_m, double y_m, double edge) {
    const double value = ellipse_value(e, x_m, y_m);
    if (value >= 1) return 0;
    if (edge <= 0) return 1;
    return smoothstep(0, edge, 1 - std::sqrt(value));
}

SideLines side_lines(const CameraFrame& f) {
    // The outermost of the corner rays on the ground, seen from the view's own direction.
    const Vec3& forward = f.forward;
    const Vec2 ahead = unit(forward.x, forward.y);
    SideLines lines;
    double widest[2] = {0, 0};  // angles to the left and right
    for (const double right : {-1.0, 1.0}) {
        for (const double up : {-1.0, 1.0}) {
            const Vec3 ray = forward + right * f.half_width * f.right + up * f.half_height * f.up;
            const double along = ray.x * ahead.x + ray.y * ahead.y,
                         across = ray.x * ahead.y - ray.y * ahead.x;
            if (along <= 1e-3) lines.all = true;
            const double angle = std::atan2(std::abs(across), along);
            widest[right > 0] = std::max(widest[right > 0], angle);
        }
    }
    const auto turned = [&](double angle) {  // clockwise
        const double c = std::cos(angle), s = std::sin(angle);
        return Vec2{c * ahead.x + s * ahead.y, c * ahead.y - s * ahead.x};
    };
    lines.left = turned(-widest[0]);
    lines.right = turned(widest[1]);
    return lines;
}

bool between_sides(const CameraFrame& f, const SideLines& lines, const Vec2& centre, double radius_m) {
    if (lines.all) return true;
    const double x = centre.x - f.position_m.x, y = centre.y - f.position_m.y;
    if (std::hypot(x, y) <= radius_m) return true;
    const double right_of_left = x * lines.left.y - y * lines.left.x,
                 left_of_right = y * lines.right.x - x * lines.right.y;
    return right_of_left >= -radius_m && left_of_right >= -radius_m &&
           x * f.forward.x + y * f.forward.y >= -radius_m;
}

Crossing crossing(const Ellipse& e, const Vec2& from, const Vec2& direction) {
    const Vec2 p = own(e, from.x, from.y), d = own(e, from.x + direction.x, from.y + direction.y);
    const double px = p.x / e.semi_a_m, py = p.y / e.semi_b_m;
    const double dx = (d.x - p.x) / e.semi_a_m, dy = (d.y - p.y) / e.semi_b_m;
    const double a = dx * dx + dy * dy, b = px * dx + py * dy, c = px * px + py * py - 1;
    const double root = b * b - a * c;
    if (root < 0) return {};
    const double first = (-b - std::sqrt(root)) / a, last = (-b + std::sqrt(root)) / a;
    if (last < 0) return {};
    return {std::max(first, 0.0), last};
}

VisibleWidth visible_width(const Ellipse& e, const CameraFrame& frame, const Vec2& nearest, double depth_m) {
    const Vec2 eye{frame.position_m.x, frame.position_m.y};
    const double outside = std::hypot(nearest.x - eye.x, nearest.y - eye.y);
    const Vec2 ahead = unit(nearest.x - eye.x, nearest.y - eye.y);
    const Vec2 right{ahead.y, -ahead.x}, left{-ahead.y, ahead.x};
    VisibleWidth width{reach_beyond(e, nearest, left), reach_beyond(e, nearest, right)};
    const SideLines lines = side_lines(frame);
    if (lines.all) return width;
    const auto limited = [&](double most, const Vec2& line, const Vec2& side) {
        const double forward = dot(line, ahead), across = dot(line, side);
        const double at_depth = forward > 0 ? (outside + depth_m) * across / forward : most;
        double end = most;
        if (dot(farthest_towards(e, side) - eye, side - across * line) >
            0) {  // the area's end lies beyond the side
            const Crossing meets = crossing(e, eye, line);
            end = meets.first <= meets.last ? meets.last * across : 0.0;
        }
        return std::clamp(std::min(end, at_depth), 0.0, most);
    };
    width.left_m = limited(width.left_m, lines.left, left);
    width.right_m = limited(width.right_m, lines.right, right);
    return width;
}

RainContainer rain_container(const RainCurtain& curtain, const CameraFrame& frame, double margin_m,
                             double radius_m) {
    const Vec3& eye = frame.position_m;
    const Ellipse ellipse = ellipse_at(curtain, eye.z);
    RainContainer container;
    container.near = ellipse_value(ellipse, eye.x, eye.y) < 1;
    container.nearest = {eye.x, eye.y};
    if (!container.near) {
        container.nearest = nearest_on_perimeter(ellipse, eye.x, eye.y);
        container.outside_m = std::hypot(container.nearest.x - eye.x, container.nearest.y - eye.y);
        container.width = visible_width(ellipse, frame, container.nearest, radius_m);
        const double reach_m = std::max({radius_m, container.width.left_m, container.width.right_m});
        container.seen = between_sides(frame, side_lines(frame), container.nearest, reach_m);
    }
    container.centre = {on_grid(container.nearest.x, margin_m), on_grid(container.nearest.y, margin_m)};
    container.axis = quarter_turn_nearest(frame.forward.x, frame.forward.y);
    container.whole = sees_behind(frame, container.axis);
    return container;
}

}  // namespace nephos
