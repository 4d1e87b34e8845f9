// SPDX-License-Identifier: Apache-2.0
#include "seeds/light_absorption.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "seeds/checks.h"

namespace nephos {
namespace {

// Rays of one cloud, one array a quantity; n of each behind one another.
struct Rays {
    explicit Rays(std::size_t count) : n(count), storage(8 * count) {}
    double* origin(int axis) { return storage.data() + std::size_t(axis) * n; }
    double* inverse(int axis) { return storage.data() + std::size_t(3 + axis) * n; }
    double* limit() { return storage.data() + 6 * n; }   // nothing beyond it counts
    double* length() { return storage.data() + 7 * n; }  // result

    std::size_t n;
    std::vector<double> storage;
};

// 1 / d, with a huge finite number for d = 0: an infinite one would make 0 * inf = NaN for a ray that starts
// in the plane of a face. The sign is of no matter, the slab test orders its two planes itself.
double safe_inverse(double d) { return std::abs(d) < 1e-290 ? 1e290 : 1 / d; }

// Aims ray r from `origin` along `way`, to its end or to infinity.
void aim(Rays& rays, std::size_t r, const Vec3& origin, const Vec3& way, bool to_infinity) {
    const double largest = std::max({std::abs(way.x), std::abs(way.y), std::abs(way.z)});
    const double shrink = largest > 0 ? largest : 1;  // squares of any finite way stay finite and above 0
    const Vec3 w{way.x / shrink, way.y / shrink, way.z / shrink};
    const double norm = std::sqrt(w.x * w.x + w.y * w.y + w.z * w.z);
    const double scale = norm > 0 ? 1 / norm : 0;
    rays.origin(0)[r] = origin.x;
    rays.origin(1)[r] = origin.y;
    rays.origin(2)[r] = origin.z;
    rays.inverse(0)[r] = safe_inverse(w.x * scale);
    rays.inverse(1)[r] = safe_inverse(w.y * scale);
    rays.inverse(2)[r] = safe_inverse(w.z * scale);
    rays.limit()[r] = to_infinity ? std::numeric_limits<double>::max() : norm * shrink;
}

inline double least(double a, double b) { return a < b ? a : b; }
inline double most(double a, double b) { return a > b ? a : b; }

// Adds the length of every ray inside one box.
void add_box(Rays& rays, const SeedBox& box, double weight) {
    const double low_x = box.centre_m.x - box.size_m.x / 2, high_x = box.centre_m.x + box.size_m.x / 2;
    const double low_y = box.centre_m.y - box.size_m.y / 2, high_y = box.centre_m.y + box.size_m.y / 2;
    const double low_z = box.centre_m.z - box.size_m.z / 2, high_z = box.centre_m.z + box.size_m.z / 2;
    const double* __restrict ox = rays.origin(0), * __restrict oy = rays.origin(1), * __restrict oz = rays.origin(2);
    const double* __restrict ix = rays.inverse(0), * __restrict iy = rays.inverse(1), * __restrict iz = rays.inverse(2);
    const double* __restrict limit = rays.limit();
    double* __restrict length = rays.length();
    for (std::size_t r = 0; r < rays.n; ++r) {
        const double x0 = (low_x - ox[r]) * ix[r], x1 = (high_x - ox[r]) * ix[r];
        const double y0 = (low_y - oy[r]) * iy[r], y1 = (high_y - oy[r]) * iy[r];
        const double z0 = (low_z - oz[r]) * iz[r], z1 = (high_z - oz[r]) * iz[r];
        const double enter = most(most(least(x0, x1), least(y0, y1)), most(least(z0, z1), 0.0));
        const double leave = least(least(most(x0, x1), most(y0, y1)), least(most(z0, z1), limit[r]));
        length[r] += weight * most(leave - enter, 0.0);
    }
}

void check_light(const Light& light) {
    const Vec3& v = light.towards;
    if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z)) {
        usage_error("the light's place is not finite; a light at infinity is given by its direction");
    }
    if (light.at_infinity && !(v.x != 0 || v.y != 0 || v.z != 0)) {
        usage_error("the direction to the light is (0, 0, 0), expected any other");
    }
}

// Returns the light relative to the cloud, on which the absorption depends.
Light relative(const Light& light, const Vec3& position_m) {
    if (light.at_infinity) return light;
    const Vec3& v = light.towards;
    return {{v.x - position_m.x, v.y - position_m.y, v.z - position_m.z}, false};
}

// Returns the weights of a cloud's boxes; none when all are whole.
std::vector<double> weights_of(const CloudToLight& lit) {
    std::vector<double> weights;
    if (lit.phase >= 1) return weights;
    for (const SeedBox& box : lit.cloud->boxes)
        weights.push_back(phase_weight(box.distance, lit.phase, lit.softness));
    return weights;
}

}  // namespace

void absorb_light(const Cloud& cloud, const Vec3& position_m, const Light& light, std::span<double> out,
                  std::span<const double> weights) {
    const std::size_t n = cloud.boxes.size();
    if (out.size() != n || (!weights.empty() && weights.size() != n)) {
        usage_error("light absorption of a cloud of " + std::to_string(n) + " seeds: given room for " +
                    std::to_string(out.size()) + " results and " + std::to_string(weights.size()) +
                    " weights");
    }
    check_light(light);
    const Vec3 seen = relative(light, position_m).towards;
    Rays rays(n);
    for (std::size_t r = 0; r < n; ++r) {
        const Vec3& c = cloud.boxes[r].centre_m;
        const Vec3 way = light.at_infinity ? seen : Vec3{seen.x - c.x, seen.y - c.y, seen.z - c.z};
        aim(rays, r, c, way, light.at_infinity);
    }
    for (std::size_t b = 0; b < n; ++b) add_box(rays, cloud.boxes[b], weights.empty() ? 1.0 : weights[b]);
    const double* length = rays.length();
    for (std::size_t r = 0; r < n; ++r) out[r] = most(0.0, least(length[r] / cloud.light_distance_m, 1.0));
}

std::vector<double> absorbed_light(const Cloud& cloud, const Vec3& position_m, const Light& light) {
    std::vector<double> result(cloud.boxes.size());
    absorb_light(cloud, position_m, light, result);
    return result;
}

std::size_t LightAbsorption::update(std::span<const CloudToLight> clouds) {
    for (const CloudToLight& lit : clouds) check_light(lit.light);
    ++calls_;
    std::size_t computed = 0;
    for (const CloudToLight& lit : clouds) {
        Entry& entry = entries_[lit.id];
        if (entry.listed == calls_) continue;  // named twice
        const bool known = entry.listed != 0;
        entry.listed = calls_;
        const Light seen = relative(lit.light, lit.position_m);
        if (known && entry.seen == seen && entry.phase == lit.phase) continue;
        entry.absorbed.resize(lit.cloud->boxes.size());
        absorb_light(*lit.cloud, lit.position_m, lit.light, entry.absorbed, weights_of(lit));
        entry.seen = seen;
        entry.phase = lit.phase;
        ++computed;
    }
    std::erase_if(entries_, [&](const auto& item) { return item.second.listed != calls_; });
    return computed;
}

std::span<const double> LightAbsorption::absorbed(std::uint64_t id) const {
    const auto found = entries_.find(id);
    return found == entries_.end() ? std::span<const double>{}
                                   : std::span<const double>(found->second.absorbed);
}

}  // namespace nephos
