// SPDX-License-Identifier: Apache-2.0
#include "render/cloud_preparation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "automaton/error.h"
#include "automaton/text.h"
#include "automaton/vector_math.h"
#include "render/half_floats.h"
#include "render/keyed_order.h"

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
                                          number_text(double(ball.radius), 6) + ", density " +
                                          number_text(double(ball.density), 6));
}

struct Interval {
    double min = std::numeric_limits<double>::infinity(), max = -min;
    void add(double low, double high) {
        min = std::min(min, low);
        max = std::max(max, high);
    }
    double size() const { return max - min; }
    double middle() const { return 0.5 * (min + max); }
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

SunOrder order_from_sun(const PreparedCloud& cloud, const ShadowFrame& frame, int shadow_size) {
    SunOrder order;
    const std::size_t count = cloud.visible.size();
    const Vec3 middle = frame.origin_m + 0.5 * frame.u_axis_m + 0.5 * frame.v_axis_m;
    KeyedOrder by_distance(count);
    std::vector<float> distance(count);
    for (std::size_t i = 0; i < count; ++i) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        distance[i] = float(std::max(0.0, dot(frame.direction, centre_of(ball) - middle)));
        by_distance.add(distance[i], std::uint32_t(i));
    }
    by_distance.sort();

    const double width = length(frame.u_axis_m), height = length(frame.v_axis_m);
    const Vec3 u = (shadow_size / (width * width)) * frame.u_axis_m,
               v = (shadow_size / (height * height)) * frame.v_axis_m;  // from metres to texels
    const double texel_u = width / shadow_size, texel_v = height / shadow_size;
    order.splats.resize(count);
    order.places.resize(count);
    order.source.resize(count);
    for (std::size_t i = 0; i < count; ++i) {
        const std::uint32_t source = by_distance[i];
        const Metaball& ball = cloud.metaballs[cloud.visible[source]];
        const Vec3 offset = centre_of(ball) - frame.origin_m;
        // What is smaller than a texel is widened and thinned out: its optical depth times area stays.
        const double radius = ball.radius, least = double(shader::kMinRadiusPixels);
        const double radius_u = std::max(radius / texel_u, least),
                     radius_v = std::max(radius / texel_v, least);
        const double thinning = radius / (radius_u * texel_u) * (radius / (radius_v * texel_v));
        order.source[i] = source;
        order.splats[i] = {.x = float(dot(u, offset)),
                           .y = float(dot(v, offset)),
                           .radii = pack_halves(float(radius_u), float(radius_v)),
                           .depth_scale = float(cloud.depth_scale[source] * thinning)};
        order.places[i] = {.z = distance[source], .per_radius = float(1.0 / radius)};
        order.largest_radius = std::max(order.largest_radius, ball.radius);
    }
    return order;
}

}  // namespace nephos
