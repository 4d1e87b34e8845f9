// SPDX-License-Identifier: Apache-2.0
#include "render/cloud_preparation.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "automaton/error.h"
#include "render/vector_math.h"

namespace nephos {
namespace {

// Optical depths below this change no bit of a picture, however many of them lie behind each other.
constexpr double kNoDepth = 1e-9;

Vec3 centre_of(const Metaball& ball) { return {ball.x, ball.y, ball.z}; }

void check(const Metaball& ball, std::size_t index) {
    const bool finite = std::isfinite(ball.x) && std::isfinite(ball.y) && std::isfinite(ball.z) &&
                        std::isfinite(ball.radius) && std::isfinite(ball.density);
    if (!finite || !(ball.radius > 0))
        throw Error(ErrorCode::usage, "metaball " + std::to_string(index) +
                                          ": expected finite numbers and a radius above 0, got radius " +
                                          std::to_string(ball.radius) + ", density " +
                                          std::to_string(ball.density));
}

// Sorts by a key that is not negative, then by index: as one integer, because the bits of floats >= 0 rise
// with them.
class KeyedOrder {
  public:
    explicit KeyedOrder(std::size_t count) { entries_.reserve(count); }
    void add(float key, std::uint32_t index) {
        entries_.push_back(std::uint64_t(std::bit_cast<std::uint32_t>(key)) << 32 | index);
    }
    void sort() { std::sort(entries_.begin(), entries_.end()); }
    std::size_t size() const { return entries_.size(); }
    std::uint32_t operator[](std::size_t i) const { return std::uint32_t(entries_[i]); }

  private:
    std::vector<std::uint64_t> entries_;
};

struct Interval {
    double min = std::numeric_limits<double>::infinity(), max = -min;
    void add(double low, double high) {
        min = std::min(min, low);
        max = std::max(max, high);
    }
    double size() const { return max - min; }
    double middle() const { return 0.5 * (min + max); }
};

// Outside of one of the four planes through the eye and the sides of the picture, or behind the eye.
class Frustum {
  public:
    explicit Frustum(const CameraFrame& camera) : camera_(camera) {
        const Vec3 sides[4] = {camera.half_width * camera.forward + camera.right,
                               camera.half_width * camera.forward - camera.right,
                               camera.half_height * camera.forward + camera.up,
                               camera.half_height * camera.forward - camera.up};
        for (int i = 0; i < 4; ++i) inward_[i] = normalised(sides[i]);
    }
    bool may_see(const Vec3& offset, double radius) const {
        if (dot(offset, camera_.forward) < -radius) return false;
        for (const Vec3& inward : inward_)
            if (dot(offset, inward) < -radius) return false;
        return true;
    }

  private:
    CameraFrame camera_;
    Vec3 inward_[4];
};

}  // namespace

PreparedCloud prepare(const MetaballCloud& cloud) {
    if (!(cloud.extinction_per_m >= 0) || !std::isfinite(cloud.extinction_per_m))
        throw Error(ErrorCode::usage, "cloud: extinction_per_m must be finite and at least 0");
    if (!(cloud.normalisation >= 0) || !std::isfinite(cloud.normalisation))
        throw Error(ErrorCode::usage, "cloud: normalisation must be finite and at least 0");
    if (cloud.metaballs.size() > std::size_t(std::numeric_limits<std::int32_t>::max()))
        throw Error(ErrorCode::usage, "cloud: more than 2^31 metaballs");

    PreparedCloud prepared;
    prepared.metaballs = cloud.metaballs;
    Interval height;
    for (std::size_t i = 0; i < cloud.metaballs.size(); ++i) {
        const Metaball& ball = cloud.metaballs[i];
        check(ball, i);
        const double depth_scale = cloud.extinction_per_m * cloud.normalisation * ball.density * ball.radius;
        if (!(depth_scale > kNoDepth)) continue;
        prepared.visible.push_back(std::uint32_t(i));
        prepared.depth_scale.push_back(float(std::min(depth_scale, 1e30)));
        height.add(ball.z, ball.z);
    }
    if (!prepared.visible.empty()) {
        prepared.base_m = height.min;
        prepared.top_m = height.max;
    }
    return prepared;
}

Vec3 direction_to_sun(const Sun& sun) {
    constexpr double kRadians = std::numbers::pi / 180.0;
    const double elevation = sun.elevation_deg * kRadians, azimuth = sun.azimuth_deg * kRadians;
    return {std::sin(azimuth) * std::cos(elevation), std::cos(azimuth) * std::cos(elevation),
            std::sin(elevation)};
}

ShadowFrame shadow_frame(const PreparedCloud& cloud, const Vec3& to_sun, int shadow_size) {
    // u is horizontal; with the sun in the zenith it is east.
    const bool zenith = std::hypot(to_sun.x, to_sun.y) < 1e-6;
    const Vec3 u = zenith ? Vec3{1, 0, 0} : normalised(cross(Vec3{0, 0, 1}, to_sun));
    const Vec3 v = normalised(cross(to_sun, u));
    Interval along_u, along_v, along_sun;
    for (const std::uint32_t index : cloud.visible) {
        const Metaball& ball = cloud.metaballs[index];
        const Vec3 centre = centre_of(ball);
        along_u.add(dot(u, centre) - ball.radius, dot(u, centre) + ball.radius);
        along_v.add(dot(v, centre) - ball.radius, dot(v, centre) + ball.radius);
        along_sun.add(dot(to_sun, centre) - ball.radius, dot(to_sun, centre) + ball.radius);
    }
    if (cloud.visible.empty()) {
        along_u.add(-0.5, 0.5);
        along_v.add(-0.5, 0.5);
        along_sun.add(-0.5, 0.5);
    }
    // Two texels of full light on every side: filtering at the edge then finds nothing but light beyond it.
    const double grow = double(shadow_size) / (shadow_size - 4);
    const double width = along_u.size() * grow, height = along_v.size() * grow;
    ShadowFrame frame;
    frame.origin_m =
        (along_u.middle() - 0.5 * width) * u + (along_v.middle() - 0.5 * height) * v + along_sun.max * to_sun;
    frame.u_axis_m = width * u;
    frame.v_axis_m = height * v;
    frame.direction = -to_sun;
    return frame;
}

SunOrder order_from_sun(const PreparedCloud& cloud, const ShadowFrame& frame, int max_slabs) {
    SunOrder order;
    const std::size_t count = cloud.visible.size();
    if (count == 0) return order;
    const Vec3 middle = frame.origin_m + 0.5 * frame.u_axis_m + 0.5 * frame.v_axis_m;
    const Vec3 u = normalised(frame.u_axis_m), v = normalised(frame.v_axis_m);

    KeyedOrder by_distance(count);
    std::vector<float> distance(count);
    Interval range;
    double radii = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        distance[i] = float(std::max(0.0, dot(frame.direction, centre_of(ball) - middle)));
        by_distance.add(distance[i], std::uint32_t(i));
        range.add(distance[i], distance[i]);
        radii += ball.radius;
    }
    by_distance.sort();

    const double wanted = std::floor(range.size() / (0.5 * radii / double(count))) + 1.0;
    const double slabs = std::min(wanted, double(max_slabs));
    const double per_metre = range.size() > 0 ? slabs / range.size() : 0.0;
    order.balls.reserve(count);
    double current = -1;
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t source = by_distance[i];
        const Metaball& ball = cloud.metaballs[cloud.visible[source]];
        const Vec3 offset = centre_of(ball) - middle;
        const double position = (double(distance[source]) - range.min) * per_metre;
        const double slab = std::min(std::floor(position), slabs - 1.0);
        if (slab != current) order.slabs.push_back({std::uint32_t(i), 0, std::uint32_t(i)});
        current = slab;
        ++order.slabs.back().end;
        order.balls.push_back({float(dot(u, offset)), float(dot(v, offset)), ball.radius,
                               cloud.depth_scale[source], float(position - slab), source, 0, 0});
    }
    const auto is_thin = [](const shader::LightBall& ball) {
        return ball.depth_scale <= shader::kMaxDepthScale;
    };
    for (Slab& slab : order.slabs) {
        const auto first = order.balls.begin();
        slab.dense =
            std::uint32_t(std::stable_partition(first + slab.begin, first + slab.end, is_thin) - first);
    }
    return order;
}

EyeOrder order_from_eye(const PreparedCloud& cloud, std::span<const float> light, const CameraFrame& camera,
                        double pixels_per_unit, const Ground& ground) {
    const Frustum frustum(camera);
    const bool above_ground = camera.position_m.z > ground.height_m;
    KeyedOrder by_distance(cloud.visible.size());
    for (std::size_t i = 0; i < cloud.visible.size(); ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        if (above_ground && ball.z + ball.radius < ground.height_m) continue;
        const Vec3 offset = centre_of(ball) - camera.position_m;
        const double distance = length(offset);
        // Billboards reach up to 1.35 radii (view_splat.vert), and never less than part of a pixel.
        const double least = double(shader::kMinRadiusPixels) * distance / pixels_per_unit;
        if (!frustum.may_see(offset, 1.5 * std::max(double(ball.radius), least))) continue;
        by_distance.add(float(distance), std::uint32_t(i));
    }
    by_distance.sort();

    const double height_scale = cloud.top_m > cloud.base_m ? 1.0 / (cloud.top_m - cloud.base_m) : 0.0;
    EyeOrder order;
    order.balls.reserve(by_distance.size());
    for (std::size_t i = by_distance.size(); i-- > 0;) {
        const std::uint32_t source = by_distance[i];
        const Metaball& ball = cloud.metaballs[cloud.visible[source]];
        const Vec3 offset = centre_of(ball) - camera.position_m;
        shader::uint flags = 0;
        if (length(offset) < double(shader::kNearDistance) * ball.radius)
            flags |= shader::kAround | shader::kIntegrate;
        if (above_ground && ball.z - ball.radius < ground.height_m) flags |= shader::kIntegrate;
        if (cloud.depth_scale[source] > shader::kMaxDepthScale) flags |= shader::kIntegrate;
        const bool integrate = flags != 0;
        const std::uint32_t index = std::uint32_t(order.balls.size());
        if (order.runs.empty() || order.runs.back().integrate != integrate)
            order.runs.push_back({index, index, integrate});
        ++order.runs.back().end;
        order.balls.push_back({float(offset.x), float(offset.y), float(offset.z), ball.radius,
                               cloud.depth_scale[source], light[source],
                               float((ball.z - cloud.base_m) * height_scale), flags});
    }
    return order;
}

}  // namespace nephos
