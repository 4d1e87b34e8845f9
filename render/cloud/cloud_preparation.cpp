// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/cloud_preparation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "core/error.h"
#include "core/keyed_order.h"
#include "core/text.h"
#include "core/vec.h"
#include "render/shared/half_floats.h"

namespace nephos {
namespace {

// Optical depths below this change no bit of a picture, however many of them lie behind each other.
constexpr double kNoDepth = 1e-9;

Vec3 centre_of(const Metaball& ball) { return {ball.x, ball.y, ball.z}; }

bool is_good(const Metaball& ball) {
    return std::isfinite(ball.x) && std::isfinite(ball.y) && std::isfinite(ball.z) &&
           std::isfinite(ball.radius) && std::isfinite(ball.density) && ball.radius > 0;
}

void check(const Metaball& ball, std::size_t index) {
    if (!is_good(ball))
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

constexpr std::size_t kPart = 8192;  // metaballs that one thread looks at
constexpr std::size_t kAhead = 12;   // from a metaball of an order to that which is fetched meanwhile

// The contribution of one part of the metaballs to a PreparedCloud.
struct VisiblePart {
    std::vector<std::uint32_t> visible;
    std::vector<float> depth_scale;
    Interval height;
    std::size_t bad = std::numeric_limits<std::size_t>::max();  // the first that check() refuses
};

VisiblePart visible_part(std::span<const Metaball> balls, std::size_t begin, std::size_t end,
                         double per_density) {
    VisiblePart part;
    part.visible.reserve(end - begin);
    part.depth_scale.reserve(end - begin);
    for (std::size_t i = begin; i < end; ++i) {
        const Metaball& ball = balls[i];
        if (!is_good(ball)) {
            part.bad = i;
            break;
        }
        const double depth_scale = per_density * ball.density * ball.radius;
        if (!(depth_scale > kNoDepth)) continue;
        part.visible.push_back(std::uint32_t(i));
        part.depth_scale.push_back(float(std::min(depth_scale, 1e30)));
        part.height.add(ball.z, ball.z);
    }
    return part;
}

// The bounds of a cloud along three axes.
struct Extent {
    Interval u, v, sun;
};

Extent extent_along(const PreparedCloud& cloud, const Vec3& u, const Vec3& v, const Vec3& to_sun) {
    return tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, cloud.visible.size(), kPart), Extent{},
        [&](const auto& range, Extent extent) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                const Metaball& ball = cloud.metaballs[cloud.visible[i]];
                const Vec3 centre = centre_of(ball);
                extent.u.add(dot(u, centre) - ball.radius, dot(u, centre) + ball.radius);
                extent.v.add(dot(v, centre) - ball.radius, dot(v, centre) + ball.radius);
                extent.sun.add(dot(to_sun, centre) - ball.radius, dot(to_sun, centre) + ball.radius);
            }
            return extent;
        },
        [](Extent a, const Extent& b) {
            a.u.add(b.u.min, b.u.max);
            a.v.add(b.v.min, b.v.max);
            a.sun.add(b.sun.min, b.sun.max);
            return a;
        });
}

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
    const double per_density = cloud.extinction_per_m * cloud.normalisation;
    const std::size_t count = cloud.metaballs.size(), parts = (count + kPart - 1) / kPart;
    std::vector<VisiblePart> found(parts);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        found[p] = visible_part(cloud.metaballs, p * kPart, std::min(count, (p + 1) * kPart), per_density);
    });
    Interval height;
    for (const VisiblePart& part : found) {
        if (part.bad < count) check(cloud.metaballs[part.bad], part.bad);
        prepared.visible.insert(prepared.visible.end(), part.visible.begin(), part.visible.end());
        prepared.depth_scale.insert(prepared.depth_scale.end(), part.depth_scale.begin(),
                                    part.depth_scale.end());
        height.add(part.height.min, part.height.max);
    }
    if (!cloud.detailed.empty()) {
        prepared.detailed.resize(prepared.visible.size(), 0);
        for (std::size_t i = 0; i < prepared.visible.size(); ++i)
            for (const DetailedVoxels& part : cloud.detailed)
                if (prepared.visible[i] - part.first < part.count)
                    prepared.detailed[i] = repeats(part.setting) ? kNeverSplatted : kSplattedFarAway;
    }
    if (!prepared.visible.empty()) {
        prepared.base_m = height.min;
        prepared.top_m = height.max;
    }
    return prepared;
}

ShadowAxes shadow_axes(const Vec3& to_sun) {
    const bool zenith = std::hypot(to_sun.x, to_sun.y) < 1e-6;
    const Vec3 right = zenith ? Vec3{1, 0, 0} : glm::normalize(cross(Vec3{0, 0, 1}, to_sun));
    return {right, glm::normalize(cross(to_sun, right))};
}

ShadowFrame shadow_frame(const PreparedCloud& cloud, const Vec3& to_sun, int shadow_size,
                         std::span<const ShadowCaster> others) {
    const auto [u, v] = shadow_axes(to_sun);
    auto [along_u, along_v, along_sun] = extent_along(cloud, u, v, to_sun);
    for (const ShadowCaster& other : others) {
        const double r = other.radius_m;
        along_u.add(dot(u, other.centre_m) - r, dot(u, other.centre_m) + r);
        along_v.add(dot(v, other.centre_m) - r, dot(v, other.centre_m) + r);
        along_sun.add(dot(to_sun, other.centre_m) - r, dot(to_sun, other.centre_m) + r);
    }
    if (cloud.visible.empty() && others.empty()) {
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

LightSortedSplats sort_for_light(const PreparedCloud& cloud, const ShadowFrame& frame, int shadow_size) {
    LightSortedSplats order;
    const std::size_t count = cloud.visible.size();
    const Vec3 middle = frame.origin_m + 0.5 * frame.u_axis_m + 0.5 * frame.v_axis_m;
    std::vector<float> distance(count);
    KeyedOrder by_distance(count);
    by_distance.add_all(0, count, [&](std::uint32_t i, float& key) {
        const Metaball& ball = cloud.metaballs[cloud.visible[i]];
        key = distance[i] = float(std::max(0.0, dot(frame.direction, centre_of(ball) - middle)));
        return true;
    });
    by_distance.sort();

    const double width = length(frame.u_axis_m), height = length(frame.v_axis_m);
    const Vec3 u = (shadow_size / (width * width)) * frame.u_axis_m,
               v = (shadow_size / (height * height)) * frame.v_axis_m;  // from metres to texels
    const double texel_u = width / shadow_size, texel_v = height / shadow_size;
    order.splats.resize(count);
    order.places.resize(count);
    order.source.resize(count);
    const auto prefetch = [&](std::uint32_t source) {
        hwy::Prefetch(&cloud.metaballs[cloud.visible[source]]);
        hwy::Prefetch(&cloud.depth_scale[source]);
    };
    const auto fill = [&](std::size_t i) {
        const std::uint32_t source = by_distance[i];
        const Metaball& ball = cloud.metaballs[cloud.visible[source]];
        const Vec3 offset = centre_of(ball) - frame.origin_m;
        // A metaball smaller than a texel is widened, with the same product of optical depth and area.
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
    };
    order.largest_radius = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, count, kPart), 0.0f,
        [&](const auto& range, float largest) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                prefetch(by_distance[std::min(i + kAhead, count - 1)]);
                fill(i);
                largest = std::max(largest, cloud.metaballs[cloud.visible[order.source[i]]].radius);
            }
            return largest;
        },
        [](float a, float b) { return std::max(a, b); });
    return order;
}

}  // namespace nephos
