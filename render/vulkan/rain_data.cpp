// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/rain_data.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/vec.h"
#include "render/frame/frame_data.h"
#include "render/rain/drop_sizes.h"
#include "render/rain/rain_shafts_pass.h"

namespace nephos {
namespace {

static_assert(shader::kHorizonNodes == PictureAir::kHorizons && shader::kBowCells == Rainbow::kCells);

shader::vec4 with(const glm::vec3& v, double w) { return {v.x, v.y, v.z, float(w)}; }

// A number as a sum of two floats.
struct Halves {
    float high = 0, low = 0;
    explicit Halves(double v) : high(float(v)), low(float(v - double(float(v)))) {}
};

// Adds the bases of a cloud; returns their first word.
shader::uint add_bases(const CloudBases& cloud, std::vector<float>& to) {
    const auto first = shader::uint(to.size());
    to.insert(to.end(), cloud.water.begin(), cloud.water.end());
    to.insert(to.end(), cloud.water_base_m.begin(), cloud.water_base_m.end());
    return first;
}

shader::SeenRain seen_rain(const SeenCurtain& c, float sun_profile, const SizeLaw& law) {
    shader::SeenRain to{};
    to.eye = {c.eye_x, c.eye_y, c.eye_z, c.height_m};
    to.axes = {c.ax, c.ay, c.bx, c.by};
    to.circle = {c.centre_x, c.centre_y, c.reach_m, c.per_m};
    to.lean = {c.lean_x, c.lean_y, c.own, c.fall};
    to.grain = {c.grain_x, c.grain_y, c.per_grain, c.per_fall};
    to.sun = {c.sun_x, c.sun_y, c.sun_per_m, sun_profile};
    to.cloud = {c.cloud_x, c.cloud_y, c.per_texel, c.ground_m};
    // real_per_drawn() is exponential in the diameter.
    const double at_0 = real_per_drawn(law, 0);
    to.law = {float(at_0), at_0 > 0 ? float(std::log(real_per_drawn(law, 1) / at_0)) : 0.0f, c.per_height, 0};
    return to;
}

void set_light(const ShaftPass& from, const PrecipitationLight& light, shader::RainUniforms& to) {
    to.by_sky = with(from.by_sky, 0);
    to.by_sunlit_ground = with(from.by_sunlit_ground, 0);
    to.by_scattered_sun = with(from.by_scattered_sun, 0);
    to.sun = with(from.sun, from.has_sun);
    to.to_sun = with(from.to_sun, from.forward_g);
    to.flash = with(from.flash, from.has_flash);
    to.flash_m = with(from.flash_m, from.ground != nullptr);
    to.air = with(from.air_per_m, light.kind == PrecipitationKind::rain ? rainbow().share : 0);
    to.ground_place = from.ground_place;
    to.shadow_u = with(from.to_u, from.shadow_u);
    to.shadow_v = with(from.to_v, from.shadow_v);
    for (std::size_t n = 0; n < PictureAir::kHorizons; ++n)
        to.horizon[n] = {from.horizon[0][n], from.horizon[1][n], from.horizon[2][n], 0};
}

// What projects points relative to the eye of a camera at another time.
struct Projection {
    shader::vec4 place, right, up, forward;
};
Projection projection(const CameraFrame& at, const Vec3& eye) {
    return {to_vec4(at.position_m - eye, 0), to_vec4((1 / at.half_width) * at.right, 0),
            to_vec4((1 / at.half_height) * at.up, 0), to_vec4(at.forward, 0)};
}

void set_shutter(const RainFrame& rain, shader::RainPass& to) {
    const Projection opening = projection(rain.opening, rain.camera.position_m),
                     closing = projection(rain.closing, rain.camera.position_m);
    to.opening = opening.place;
    to.opening_right = opening.right;
    to.opening_up = opening.up;
    to.opening_forward = opening.forward;
    to.closing = closing.place;
    to.closing_right = closing.right;
    to.closing_up = closing.up;
    to.closing_forward = closing.forward;
}

void set_boxes(const ParticlePass& pass, std::size_t count, shader::RainPass& to) {
    const ParticleBoxes& b = pass.boxes;
    const Halves depth2(2 * b.depth_m), margin(b.margin_m), x(b.carried_x_m - b.centre_x_m),
        y(b.carried_y_m - b.centre_y_m), z(-b.centre_z_m / b.height_m), fall(-b.time_s / b.height_m);
    to.boxes = {float(b.depth_m), float(b.height_m), float(pass.number), float(count)};
    to.box_high.x = depth2.high;
    to.box_high.y = margin.high;
    to.box_low.x = depth2.low;
    to.box_low.y = margin.low;
    to.box_low.z = float(0.75 * double(count) / (b.depth_m * b.depth_m * b.height_m));
    to.away_x = {x.high, x.low, y.high, y.low};
    to.away_z = {z.high, z.low, fall.high, fall.low};
}

void set_sway(double time_s, shader::RainPass& to) {
    const auto turned = [](double angle) { return float(std::remainder(angle, 2 * std::numbers::pi)); };
    for (std::size_t n = 0; n < shader::kSwaySpeeds; ++n) {
        const double angle = sway_per_s(n) * time_s;
        to.sway[n] = {turned(angle), turned(shader::kSwayHarmonic * angle), 0, 0};
    }
}

// Sets the bits of curtains by their indices on the device.
void set_bits(const std::vector<CurtainTerm>& terms, const std::map<const RainCurtain*, std::size_t>& index,
              std::uint32_t* words) {
    for (const CurtainTerm& term : terms) {
        const std::size_t bit = index.at(term.curtain);
        words[bit / 32] |= 1u << (bit % 32);
    }
}

void add_splashes(const std::vector<Streak>& streaks, RainData& data) {
    for (const Streak& streak : streaks) {
        data.splashes.push_back({streak.x0, streak.y0, streak.x1, streak.y1});
        data.splashes.push_back({streak.width, streak.opacity, streak.distance_m, 0});
        data.splashes.push_back({streak.red, streak.green, streak.blue, 0});
    }
    for (std::size_t first = 0; first < streaks.size(); first += shader::kStreakSegment)
        data.splash_counts.push_back(shader::uint(std::min<std::size_t>(shader::kStreakSegment, streaks.size() - first)));
}

shader::RainPass rain_pass(const RainFrame& rain, const Weather& weather, const ParticlePass& pass,
                           const Picture& picture) {
    const PrecipitationOptions& p = rain.options.precipitation;
    const Vec3& eye = rain.camera.position_m;
    const PassShape shape = pass_shape(rain.particles, pass, p, eye);
    const RainContainer& at = pass.container;
    shader::RainPass to{};
    to.centre = to_vec4(Vec3{pass.boxes.centre_x_m, pass.boxes.centre_y_m, pass.boxes.centre_z_m} - eye,
                        pass.fraction);
    to.axis = {float(at.axis.x), float(at.axis.y), float(shape.ahead.x), float(shape.ahead.y)};
    to.nearest = {float(at.nearest.x - eye.x), float(at.nearest.y - eye.y),
                  pass.far ? float(pass.ahead_m) : 0.0f, at.whole ? 1.0f : 0.0f};
    set_boxes(pass, rain.particles, to);
    to.box_high.z = float(p.exposure_s);
    to.box_high.w = float(p.visibility);
    to.box_low.w = float(shape.size);
    to.wind = {float(weather.wind_x_m_per_s), float(weather.wind_y_m_per_s),
               float(pixels_per_unit(rain.options.camera, rain.camera)),
               p.kind == PrecipitationKind::snow ? 1.0f : 0.0f};
    set_shutter(rain, to);
    // The map has the veils' shade, too, but as it is on the ground.
    const double below_veils = picture.sunlight_of_veils ? double(sunlight_at(picture, shape.lit_m)) : -1;
    to.sunlight = to_vec4(shape.lit_m - eye, below_veils);
    set_sway(rain.time_s, to);
    return to;
}

}  // namespace

std::optional<RainData> rain_data(const RainFrame& rain, const Weather& weather, const Picture& picture) {
    const PrecipitationOptions& p = rain.options.precipitation;
    const ShaftPass shafts =
        shaft_pass(picture, rain.options, rain.camera, weather.curtains, rain.light, rain.time_s);
    if (shafts.curtains.size() > shader::kMostCurtains) return {};
    RainData data{};
    data.shafts = p.shafts > 0 && !shafts.curtains.empty();
    shader::RainUniforms& to = data.uniforms;
    to.forward = with(shafts.forward, 0);
    to.right = with(shafts.right, rain.options.camera.width);
    to.up = with(shafts.up, rain.options.camera.height);
    set_light(shafts, rain.light, to);
    to.shape = {shafts.softness, shafts.fray, shafts.contrast, shafts.evaporation};
    to.extra = {shafts.clear_m, 0, float(shafts.curtains.size()), float(p.edge)};
    std::map<const RainCurtain*, std::size_t> index;
    std::map<const CloudBases*, shader::uint> bases;
    std::size_t n = 0;
    for (const RainCurtain& curtain : weather.curtains) {
        if (!falls(curtain)) continue;
        shader::SeenRain& seen = to.curtains[n] =
            seen_rain(shafts.curtains[n], shafts.sun_profile, size_law(p.kind, p.intensity_scale * curtain.rate_mm_per_h));
        if (const CloudBases* const cloud = curtain.cloud.get()) {
            if (!bases.contains(cloud)) bases[cloud] = add_bases(*cloud, data.bases);
            seen.bases[0] = bases[cloud];
            seen.bases[1] = shader::uint(cloud->columns);
            seen.bases[2] = shader::uint(cloud->rows);
            seen.bases[3] = (cloud->repeats_x ? 1u : 0u) | (cloud->repeats_y ? 2u : 0u);
        }
        index[&curtain] = n++;
    }
    for (const ParticlePass& pass : rain.passes) {
        shader::RainPass& one = data.passes.emplace_back(rain_pass(rain, weather, pass, picture));
        set_bits(pass.rain, index, one.rain);
        set_bits(pass.less, index, one.rain + 2);
    }
    add_splashes(rain.splashes, data);
    return data;
}

std::vector<shader::RainParticle> rain_particles(const Particles& particles) {
    std::vector<shader::RainParticle> all(particles.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
        const float d_mm = particles.diameter_mm[i];
        all[i] = {particles.x[i],
                  particles.y[i],
                  particles.z[i],
                  particles.reach[i],
                  particles.speed[i],
                  d_mm,
                  float(1e-3 * width_mm(particles.kind, double(d_mm))),
                  float(1e-6 * shadow_mm2(particles.kind, double(d_mm)))};
    }
    return all;
}

std::vector<shader::vec4> bow_nodes() {
    const Rainbow& bow = rainbow();
    std::vector<shader::vec4> nodes;
    for (std::size_t n = 0; n <= shader::kBowCells; ++n)
        nodes.push_back({bow.nodes[0][n], bow.nodes[1][n], bow.nodes[2][n], 0});
    return nodes;
}

}  // namespace nephos
