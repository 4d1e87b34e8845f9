// SPDX-License-Identifier: Apache-2.0
#include "seeds/model.h"

#include <algorithm>
#include <cmath>

#include "core/math.h"
#include "seeds/checks.h"
#include "seeds/draw.h"

namespace nephos {
namespace {

constexpr int kMaxCount = 10000;
constexpr double kMaxLength = 1e6;

void check_root(const std::string& where, const Root& root) {
    require_in(where + ": pitch (degrees)", root.pitch_deg, -360, 360);
    require_in(where + ": yaw (degrees)", root.yaw_deg, -360, 360);
    require_in(where + ": open pitch (degrees)", root.open_pitch_deg, 0, 360);
    require_in(where + ": open yaw (degrees)", root.open_yaw_deg, 0, 360);
    require_in(where + ": seeds start", root.seeds_start, 0, kMaxCount);
    require_in(where + ": seeds end", root.seeds_end, 0, kMaxCount);
    require_range(where + ": reproductions", root.reproductions.min, root.reproductions.max, 0, kMaxCount);
}

void check_seed(const std::string& where, const Seed& seed) {
    for (auto [name, value] :
         {std::pair{"width", seed.size_m.x}, {"depth", seed.size_m.y}, {"height", seed.size_m.z}}) {
        require_in(where + ": " + name + " (m)", value, kSmallestSize_m, kMaxLength);
    }
    for (double value : {seed.position_m.x, seed.position_m.y, seed.position_m.z}) {
        require_in(where + ": position (m)", value, -kMaxLength, kMaxLength);
    }
    require_range(where + ": billboards", seed.billboards.min, seed.billboards.max, 0, kMaxCount);
    for (auto [name, size] : {std::pair{"billboard width (m)", seed.billboard_width_m},
                              {"billboard height (m)", seed.billboard_height_m}}) {
        require_range(where + ": " + name, size.min, size.max, kSmallestSize_m, kLargestBillboard_m);
    }
    require_in(where + ": strength", seed.strength, 0, 1);
    for (std::size_t r = 0; r < seed.roots.size(); ++r)
        check_root(where + ", root " + std::to_string(r), seed.roots[r]);
}

// The axes of a root and its opening: where children may go.
struct Cone {
    RootAxes axes;
    double half_yaw_deg, half_pitch_deg;
};

Cone cone_of(const Root& root) { return {axes_of(root), root.open_yaw_deg / 2, root.open_pitch_deg / 2}; }

// A direction in the elliptic cone: at a uniform place of the ellipse of the two half angles, with the angle
// from the axis chosen by 1 - cos, which makes a circular cone (and the whole sphere) uniform per solid
// angle.
Vec3 direction_in(const Cone& cone, double azimuth_fraction, double area_fraction) {
    const Rotation turn = rotation_of_degrees(360 * azimuth_fraction);
    const double a = cone.half_yaw_deg * turn.cos, b = cone.half_pitch_deg * turn.sin;
    const double rim_deg = std::sqrt(a * a + b * b);
    if (!(rim_deg > 0)) return cone.axes.ahead;
    const double c = 1 - area_fraction * (1 - rotation_of_degrees(rim_deg).cos);
    const double s = std::sqrt(std::max(0.0, 1 - c * c)) / rim_deg;
    const double fs = s * a, fu = s * b;
    const auto& [ahead, side, up] = cone.axes;
    return {c * ahead.x + fs * side.x + fu * up.x, c * ahead.y + fs * side.y + fu * up.y,
            c * ahead.z + fs * side.z + fu * up.z};
}

double sphere_radius(const Vec3& size) {
    return std::sqrt(size.x * size.x + size.y * size.y + size.z * size.z) / 2;
}

double box_radius(const Vec3& size, const Vec3& direction) {
    const auto reach = [](double edge, double d) { return d == 0 ? kForever : edge / 2 / std::abs(d); };
    return std::min({reach(size.x, direction.x), reach(size.y, direction.y), reach(size.z, direction.z)});
}

// The identity of a cloud in the random stream.
struct CloudName {
    std::uint64_t scene_seed;
    std::uint32_t model_index, number;
};

void add_children(std::vector<SeedBox>& boxes, const CloudName& name, const Seed& seed,
                  std::uint32_t seed_index, const Root& root, int levels) {
    const Cone cone = cone_of(root);
    const double sphere = sphere_radius(seed.size_m);
    for (int level = 1; level <= levels; ++level) {
        const int children = children_of_level(root, level, levels);
        for (int child = 0; child < children; ++child) {
            const auto index = std::uint32_t(boxes.size());
            const auto words =
                draw_for_cloud(name.scene_seed, name.model_index, name.number, SeedDraw::child, index);
            const Vec3 d = direction_in(cone, unit_interval(words[0]), unit_interval(words[1]));
            const double radius = root.radius == RootRadius::sphere ? sphere : box_radius(seed.size_m, d);
            const double way = radius * level;
            boxes.push_back({{seed.position_m.x + way * d.x, seed.position_m.y + way * d.y,
                              seed.position_m.z + way * d.z},
                             seed.size_m,
                             seed_index,
                             level,
                             draw_count(words[2], seed.billboards.min, seed.billboards.max),
                             0});
        }
    }
}

}  // namespace

// At most kMaxCount^2 a root, so it cannot overflow.
std::int64_t largest_cloud(const BaseModel& model) {
    std::int64_t boxes = 0;
    for (const Seed& seed : model.seeds) {
        ++boxes;
        for (const Root& root : seed.roots) {
            boxes += std::int64_t(root.reproductions.max) * std::max(root.seeds_start, root.seeds_end);
        }
    }
    return boxes;
}

void check(const BaseModel& model) {
    const std::string where = "base model \"" + model.name + "\"";
    if (model.seeds.empty()) usage_error(where + " has no seed, expected at least one");
    if (model.seeds.size() > std::size_t(kMaxCount))
        usage_error(where + " has more than " + std::to_string(kMaxCount) + " seeds");
    if (!(model.light_distance_m > 0)) {
        usage_error(where + ": light distance (m) is " + text_of(model.light_distance_m) +
                    ", expected a number above 0 or infinity");
    }
    require_probabilities(where + ", centre", model.centre);
    require_probabilities(where + ", rim", model.rim);
    for (std::size_t s = 0; s < model.seeds.size(); ++s) {
        check_seed(where + ", seed " + std::to_string(s), model.seeds[s]);
    }
    if (const std::int64_t boxes = largest_cloud(model); boxes > kMaxBoxes) {
        usage_error(where + " can make a cloud of " + std::to_string(boxes) + " seeds, at most " +
                    std::to_string(kMaxBoxes) + " are possible");
    }
}

RootAxes axes_of(const Root& root) {
    const Rotation pitch = rotation_of_degrees(root.pitch_deg), yaw = rotation_of_degrees(root.yaw_deg);
    return {{pitch.cos * yaw.cos, pitch.cos * yaw.sin, pitch.sin},
            {-yaw.sin, yaw.cos, 0},
            {-pitch.sin * yaw.cos, -pitch.sin * yaw.sin, pitch.cos}};
}

int children_of_level(const Root& root, int level, int levels) {
    if (levels <= 1) return root.seeds_start;
    // floor((2 x + 1) / 2) in integers, x the exact fraction; counts are never negative.
    const std::int64_t n = levels - 1;
    const std::int64_t scaled =
        std::int64_t(root.seeds_start) * n + std::int64_t(root.seeds_end - root.seeds_start) * (level - 1);
    return int((2 * scaled + n) / (2 * n));
}

Cloud reproduce(const BaseModel& model, std::uint64_t scene_seed, std::uint32_t model_index,
                std::uint32_t number) {
    const CloudName name{scene_seed, model_index, number};
    Cloud cloud;
    cloud.light_distance_m = model.light_distance_m;
    cloud.boxes.reserve(std::size_t(largest_cloud(model)));
    std::uint32_t root_index = 0;
    for (std::uint32_t s = 0; s < model.seeds.size(); ++s) {
        const Seed& seed = model.seeds[s];
        const auto index = std::uint32_t(cloud.boxes.size());
        const auto words = draw_for_cloud(scene_seed, model_index, number, SeedDraw::box, index);
        cloud.boxes.push_back({seed.position_m, seed.size_m, s, 0,
                               draw_count(words[0], seed.billboards.min, seed.billboards.max), 0});
        for (const Root& root : seed.roots) {
            const auto levels = draw_for_cloud(scene_seed, model_index, number, SeedDraw::root, root_index++);
            add_children(cloud.boxes, name, seed, s, root,
                         draw_count(levels[0], root.reproductions.min, root.reproductions.max));
        }
    }
    enclose(cloud);
    return cloud;
}

std::vector<Billboard> scatter_billboards(const BaseModel& model, const Cloud& cloud,
                                          std::uint64_t scene_seed, std::uint32_t model_index,
                                          std::uint32_t number) {
    std::size_t total = 0;
    for (const SeedBox& box : cloud.boxes) total += std::size_t(box.billboards);
    std::vector<Billboard> result;
    result.reserve(total);
    for (std::uint32_t b = 0; b < cloud.boxes.size(); ++b) {
        const SeedBox& box = cloud.boxes[b];
        const Seed& seed = model.seeds[box.seed];
        for (std::uint32_t i = 0; i < std::uint32_t(box.billboards); ++i) {
            // Two counters a billboard; at most 10000 of them, so the 16-bit sub-index is enough.
            const auto place = draw_for_cloud(scene_seed, model_index, number, SeedDraw::billboard, b, 2 * i);
            const auto form =
                draw_for_cloud(scene_seed, model_index, number, SeedDraw::billboard, b, 2 * i + 1);
            const auto within = [](std::uint32_t word, double centre, double edge) {
                return centre + (unit_interval(word) - 0.5) * edge;
            };
            result.push_back({{within(place[0], box.centre_m.x, box.size_m.x),
                               within(place[1], box.centre_m.y, box.size_m.y),
                               within(place[2], box.centre_m.z, box.size_m.z)},
                              draw_in(form[0], seed.billboard_width_m),
                              draw_in(form[1], seed.billboard_height_m),
                              b,
                              seed.texture,
                              form[2]});
        }
    }
    return result;
}

}  // namespace nephos
