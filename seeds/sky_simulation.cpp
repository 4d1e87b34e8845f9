// SPDX-License-Identifier: Apache-2.0
#include "seeds/sky_simulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_set>

#include "core/bytes.h"
#include "core/math.h"
#include "seeds/checks.h"
#include "seeds/climate.h"
#include "seeds/draw.h"

namespace nephos {
namespace {

constexpr std::uint64_t kStateMark = 0x3130594b5348504e;  // "NPHSKY01"

// Fastest wind: places, which lie within the world (1e8 m) and a few such steps, then never leave 64 bits.
constexpr double kMaxStep = 5e8;
constexpr double kMaxPlace = 1.5e9;

double metres(std::int64_t fixed) { return double(fixed) * 0x1p-32; }
std::int64_t fixed(double value_m) { return std::llround(value_m * 0x1p32); }

double advanced(double phase, double time_step_s, double duration_s) {
    return duration_s > 0 ? std::min(1.0, phase + time_step_s / duration_s) : 1;
}
double receded(double phase, double time_step_s, double duration_s) {
    return duration_s > 0 ? std::max(0.0, phase - time_step_s / duration_s) : 0;
}

}  // namespace

SkySimulation::SkySimulation(const SkyOptions& options) : options_(options) {
    check(options_);
    make_shapes();
    const std::size_t sky = nearest_sky(options_.skies, state());
    for (int i = 0; i < options_.skies[sky].clouds; ++i) {
        SkyCloud cloud = new_cloud(sky);
        cloud.phase = 1;
        place_inside(cloud);
        clouds_.push_back(cloud);
    }
    assign_slots(0);
}

void SkySimulation::make_shapes() {
    const WorldRectangle& w = options_.world;
    // The number of shapes of each model over all skies; skies that share a model share its shapes.
    std::vector<int> generated(options_.models.size(), 0);
    for (const Sky& sky : options_.skies) {
        for (const SkyModel& m : sky.models) generated[m.model] = std::max(generated[m.model], m.generated);
    }
    // What clouds change into has as many shapes; chains are at most as long as there are changes.
    for (std::size_t round = 0; round < options_.metamorphoses.size(); ++round)
        for (const Metamorphosis& m : options_.metamorphoses)
            generated[m.to] = std::max(generated[m.to], generated[m.from]);
    std::vector<std::uint32_t> first(options_.models.size(), 0);
    for (std::size_t m = 0; m < options_.models.size(); ++m) {
        first[m] = std::uint32_t(shapes_.size());
        for (std::uint32_t number = 0; number < std::uint32_t(generated[m]); ++number) {
            Cloud cloud = reproduce(options_.models[m], options_.seed, std::uint32_t(m), number);
            const double width = cloud.high_m.x - cloud.low_m.x, depth = cloud.high_m.y - cloud.low_m.y;
            if (width > w.max_x_m - w.min_x_m || depth > w.max_y_m - w.min_y_m) {
                usage_error("layer \"" + options_.name + "\": cloud " + std::to_string(number) +
                            " of base model \"" + options_.models[m].name + "\" is " + text_of(width) +
                            " x " + text_of(depth) + " m, larger than the world of " +
                            text_of(w.max_x_m - w.min_x_m) + " x " + text_of(w.max_y_m - w.min_y_m) + " m");
            }
            shapes_.push_back({m, number, std::move(cloud)});
        }
    }
    first_of_model_ = first;
    generated_.assign(generated.begin(), generated.end());
    for (const Sky& sky : options_.skies) {
        auto& entry = first_shape_.emplace_back();
        for (const SkyModel& m : sky.models) entry.push_back(first[m.model]);
    }
}

double SkySimulation::state() const { return state_at(time_s()); }

double SkySimulation::state_at(double time_s) const { return nephos::state_at(options_.schedule, time_s); }

CloudForms SkySimulation::forms(const SkyCloud& cloud, double state) const {
    CloudForms forms{{{cloud.shape, cloud.phase}, {}}, 1};
    if (options_.metamorphoses.empty()) return forms;
    const double own =
        unit_interval(draw_for_sky(options_.seed, options_.layer, SkyDraw::change, cloud.serial)[0]);
    const std::uint32_t number = shapes_[cloud.shape].number;
    for (std::size_t model = shapes_[cloud.shape].model;;) {
        const auto change = std::ranges::find(options_.metamorphoses, model, &Metamorphosis::from);
        if (change == options_.metamorphoses.end()) return forms;
        const double half = 0.5 * (change->state.max - change->state.min);
        const double changed = smoothstep<double>(0, 1, (state - change->state.min) / half - own);
        if (changed <= 0) return forms;
        model = change->to;
        const std::uint32_t shape = first_of_model_[model] + number % generated_[model];
        if (changed < 1) {
            forms.of[0].phase = cloud.phase * (1 - changed);
            forms.of[1] = {shape, cloud.phase * changed};
            forms.count = 2;
            return forms;
        }
        forms.of[0].shape = shape;
    }
}

Vec3 SkySimulation::lean_m(const SkyCloud& cloud, const CloudForm& form, double height_m, double time_s) const {
    if (options_.shear_s == 0) return {};
    const Vec3 centre_m = position_m(cloud) + shapes_[form.shape].cloud.centre_m;
    const Vec3 there = wind_at(options_.wind, Vec3(centre_m.x, centre_m.y, height_m), time_s),
               middle = wind_at(options_.wind, centre_m, time_s);
    return {options_.shear_s * (there.x - middle.x), options_.shear_s * (there.y - middle.y), 0};
}

std::size_t SkySimulation::count() const {
    return std::size_t(std::ranges::count_if(clouds_, [](const SkyCloud& c) { return !c.dissolving; }));
}

Vec3 SkySimulation::position_m(const SkyCloud& cloud) const {
    return {metres(cloud.place.x), metres(cloud.place.y), cloud.base_m};
}

Sphere SkySimulation::sphere(const SkyCloud& cloud) const {
    const Vec3 p = position_m(cloud);
    const Cloud& c = shape(cloud);
    return {{p.x + c.centre_m.x, p.y + c.centre_m.y, p.z + c.centre_m.z}, c.radius_m};
}

Displacement SkySimulation::wind_step(const SkyCloud& cloud, double time_s) const {
    const Vec3 v = mean_wind(options_.wind, position_m(cloud) + shape(cloud).centre_m, time_s, options_.time_step_s);
    return checked_step(v);
}

Displacement SkySimulation::checked_step(const Vec3& velocity) const {
    const Displacement d = displacement_of_step({velocity.x, velocity.y}, options_.time_step_s, 1);
    if (std::abs(metres(d.x)) > kMaxStep || std::abs(metres(d.y)) > kMaxStep) {
        usage_error("layer \"" + options_.name + "\": the wind moves clouds by " + text_of(metres(d.x)) +
                    ", " + text_of(metres(d.y)) + " m in one step, at most " + text_of(kMaxStep) +
                    " m are possible");
    }
    return d;
}

Displacement SkySimulation::inflow_step(const SkyCloud& cloud) const {
    const Velocity v = wind_at(options_.wind, cloud.base_m + shape(cloud).centre_m.z, time_s());
    return checked_step({v.east_m_per_s, v.north_m_per_s, 0});
}

SkyCloud SkySimulation::ahead(const SkyCloud& cloud, double at_s, double after_s) const {
    const Displacement d = wind_step(cloud, at_s);
    const double fraction = after_s / options_.time_step_s;
    SkyCloud later = cloud;
    later.place = {cloud.place.x + fixed(metres(d.x) * fraction),
                   cloud.place.y + fixed(metres(d.y) * fraction)};
    later.phase = cloud.dissolving ? receded(cloud.phase, after_s, options_.dissolution_s)
                                   : advanced(cloud.phase, after_s, options_.formation_s);
    return later;
}

void SkySimulation::step() {
    move_clouds();
    const std::size_t before = count();
    retire_clouds();
    ++steps_;
    if (options_.entering == Entering::horizon && !options_.periodic) {
        let_enter();
    } else {
        adjust_number(before - count());
    }
}

void SkySimulation::move_clouds() {
    const double now = time_s();
    const double middle_m = (options_.base_height_m.min + options_.base_height_m.max) / 2;
    const Displacement air =
        displacement_of_step(wind_at(options_.wind, middle_m, now), options_.time_step_s, 1);
    // Unsigned: the sum of a very long simulation wraps around instead of overflowing.
    carried_ = {std::int64_t(std::uint64_t(carried_.x) + std::uint64_t(air.x)),
                std::int64_t(std::uint64_t(carried_.y) + std::uint64_t(air.y))};
    for (SkyCloud& c : clouds_) {
        const Displacement d = wind_step(c, now);
        c.place = {c.place.x + d.x, c.place.y + d.y};
        c.phase = c.dissolving ? receded(c.phase, options_.time_step_s, options_.dissolution_s)
                               : advanced(c.phase, options_.time_step_s, options_.formation_s);
        if (options_.periodic) re_enter(c);
    }
}

// Takes the cloud's centre back into the world by whole periods.
void SkySimulation::re_enter(SkyCloud& cloud) const {
    const WorldRectangle& w = options_.world;
    const Vec3& centre = shape(cloud).centre_m;
    const auto inside = [](std::int64_t place, double centre_m, double min_m, double max_m) {
        const std::int64_t period = fixed(max_m - min_m), low = fixed(min_m) - fixed(centre_m);
        const std::int64_t from_low = (place - low) % period;
        return low + (from_low < 0 ? from_low + period : from_low);
    };
    cloud.place = {inside(cloud.place.x, centre.x, w.min_x_m, w.max_x_m),
                   inside(cloud.place.y, centre.y, w.min_y_m, w.max_y_m)};
}

// Returns true when the whole cloud is beyond a side through which the wind does not bring it back.
bool SkySimulation::outside(const SkyCloud& cloud, const Displacement& wind) const {
    const Cloud& c = shape(cloud);
    const Vec3 p = position_m(cloud);
    const WorldRectangle& w = options_.world;
    return (p.x + c.low_m.x >= w.max_x_m && wind.x >= 0) || (p.x + c.high_m.x <= w.min_x_m && wind.x <= 0) ||
           (p.y + c.low_m.y >= w.max_y_m && wind.y >= 0) || (p.y + c.high_m.y <= w.min_y_m && wind.y <= 0);
}

void SkySimulation::retire_clouds() {
    const double now = time_s();
    const WorldRectangle& w = options_.world;
    const double reach = std::max(w.max_x_m - w.min_x_m, w.max_y_m - w.min_y_m);
    std::erase_if(clouds_, [&](SkyCloud& c) {
        if (c.dissolving && c.phase <= 0) return true;
        if (options_.periodic || !outside(c, wind_step(c, now))) return false;
        if (options_.cross_edges_whole || options_.dissolution_s <= 0) return true;
        c.dissolving = true;
        const Vec3 p =
            position_m(c);  // far away it goes at once: its place must stay in the range of numbers
        return p.x < w.min_x_m - 2 * reach || p.x > w.max_x_m + 2 * reach || p.y < w.min_y_m - 2 * reach ||
               p.y > w.max_y_m + 2 * reach;
    });
}

// Brings the number of clouds to that of the present state; `left` have left in this step.
void SkySimulation::adjust_number(std::size_t left) {
    const std::size_t target = std::size_t(clouds_at(options_.skies, state()));
    std::size_t present = count();
    if (present > target) return dissolve(present - target);
    const std::size_t first_new = clouds_.size();
    for (; present < target; ++present) {
        const auto words = draw_for_sky(options_.seed, options_.layer, SkyDraw::cloud, born_);
        SkyCloud cloud = new_cloud(draw_sky(words[0]));
        if (left > 0 && place_upwind(cloud)) {
            --left;
            if (options_.cross_edges_whole) cloud.phase = 1;
        } else {
            place_inside(cloud);
        }
        clouds_.push_back(cloud);
    }
    assign_slots(first_new);
}

// Returns the number of clouds of each shape that the wind brings in a step, at the middle of the base heights.
std::vector<SkySimulation::Inflow> SkySimulation::inflow() const {
    const SkyShares proportions = shares_at(options_.skies, state());
    const double clouds = clouds_at(options_.skies, state());
    const WorldRectangle& w = options_.world;
    std::vector<Inflow> result;
    double sum = 0;
    const auto add = [&](std::size_t sky, double fraction) {
        const std::vector<SkyModel>& models = options_.skies[sky].models;
        for (std::size_t entry = 0; fraction > 0 && entry < models.size(); ++entry) {
            const double share = fraction / double(models.size()) / models[entry].generated;
            for (int number = 0; number < models[entry].generated; ++number) {
                SkyCloud cloud;
                cloud.shape = first_shape_[sky][entry] + std::uint32_t(number);
                cloud.base_m = (options_.base_height_m.min + options_.base_height_m.max) / 2;
                const Displacement wind = inflow_step(cloud);
                const Cloud& c = shape(cloud);
                const double width = w.max_x_m - w.min_x_m + c.high_m.x - c.low_m.x,
                             depth = w.max_y_m - w.min_y_m + c.high_m.y - c.low_m.y;
                const double exchanged = std::abs(metres(wind.x)) / width + std::abs(metres(wind.y)) / depth;
                sum += clouds * share * std::min(exchanged, 1.0);
                result.push_back({std::uint32_t(sky), cloud.shape, sum});
            }
        }
    };
    const bool lower_empty = options_.skies[proportions.lower].models.empty(),
               upper_empty = options_.skies[proportions.upper].models.empty();
    const double lower = upper_empty ? 1 : lower_empty ? 0 : proportions.lower_fraction;
    add(proportions.lower, lower);
    if (proportions.upper != proportions.lower) add(proportions.upper, 1 - lower);
    return result;
}

void SkySimulation::let_enter() {
    constexpr std::int64_t kOne = std::int64_t{1} << 32;
    const std::vector<Inflow> kinds = inflow();
    if (kinds.empty()) return;
    const double all = kinds.back().up_to;
    due_ += fixed(all);
    const std::size_t first_new = clouds_.size();
    for (; due_ >= kOne; due_ -= kOne) {
        const auto words = draw_for_sky(options_.seed, options_.layer, SkyDraw::cloud, born_);
        const double drawn = unit_interval(words[0]) * all;
        const auto kind = std::ranges::find_if(kinds, [&](const Inflow& k) { return drawn < k.up_to; });
        if (kind == kinds.end()) continue;  // rounding
        SkyCloud cloud;
        cloud.serial = born_++;
        cloud.sky = kind->sky;
        cloud.shape = kind->shape;
        cloud.base_m = draw_in(words[3], options_.base_height_m);
        cloud.phase = options_.cross_edges_whole || options_.formation_s <= 0 ? 1 : 0;
        // The wind at its own height may be calm although it is not in the middle.
        if (place_upwind(cloud)) clouds_.push_back(cloud);
    }
    assign_slots(first_new);
}

// Assigns free slots to the clouds from index `first_new` on, in their order.
void SkySimulation::assign_slots(std::size_t first_new) {
    if (first_new == clouds_.size()) return;
    std::vector<bool> taken(clouds_.size());  // a lower slot is always free
    for (std::size_t i = 0; i < first_new; ++i) {
        if (clouds_[i].slot < taken.size()) taken[clouds_[i].slot] = true;
    }
    std::uint32_t free = 0;
    for (std::size_t i = first_new; i < clouds_.size(); ++i, ++free) {
        while (taken[free]) ++free;
        clouds_[i].slot = free;
    }
}

void SkySimulation::dissolve(std::size_t number) {
    std::vector<std::size_t> candidates;
    for (std::size_t i = 0; i < clouds_.size(); ++i) {
        if (!clouds_[i].dissolving) candidates.push_back(i);
    }
    for (; number > 0; --number) {
        const auto words = draw_for_sky(options_.seed, options_.layer, SkyDraw::dissolve, dissolved_++);
        const std::uint32_t chosen = draw_below(words[0], std::uint32_t(candidates.size()));
        clouds_[candidates[chosen]].dissolving = true;
        candidates[chosen] = candidates.back();
        candidates.pop_back();
    }
    if (options_.dissolution_s <= 0) std::erase_if(clouds_, [](const SkyCloud& c) { return c.dissolving; });
}

std::size_t SkySimulation::draw_sky(std::uint32_t word) const {
    const SkyShares proportions = shares_at(options_.skies, state());
    const bool lower = unit_interval(word) < proportions.lower_fraction;
    const std::size_t drawn = lower ? proportions.lower : proportions.upper,
                      other = lower ? proportions.upper : proportions.lower;
    return options_.skies[drawn].models.empty() ? other : drawn;
}

// Draws a cloud of a sky that has models, not yet placed; its phase is 0 unless formation_s is 0.
SkyCloud SkySimulation::new_cloud(std::size_t sky) {
    const auto words = draw_for_sky(options_.seed, options_.layer, SkyDraw::cloud, born_);
    const std::vector<SkyModel>& models = options_.skies[sky].models;
    const std::uint32_t entry = draw_below(words[1], std::uint32_t(models.size()));
    SkyCloud cloud;
    cloud.serial = born_++;
    cloud.sky = std::uint32_t(sky);
    cloud.shape = first_shape_[sky][entry] + draw_below(words[2], std::uint32_t(models[entry].generated));
    cloud.base_m = draw_in(words[3], options_.base_height_m);
    cloud.phase = options_.formation_s > 0 ? 0 : 1;
    return cloud;
}

void SkySimulation::place_inside(SkyCloud& cloud) const {
    const auto words = draw_for_sky(options_.seed, options_.layer, SkyDraw::place, cloud.serial);
    const Vec3& centre = shape(cloud).centre_m;
    const WorldRectangle& w = options_.world;
    cloud.place = {fixed(draw_in(words[0], {w.min_x_m, w.max_x_m}) - centre.x),
                   fixed(draw_in(words[1], {w.min_y_m, w.max_y_m}) - centre.y)};
}

// Places a cloud outside an upwind side, so that it gets inside during the next step; false in calm air.
bool SkySimulation::place_upwind(SkyCloud& cloud) const {
    const Displacement wind = inflow_step(cloud);
    if (wind.x == 0 && wind.y == 0) return false;
    const auto words = draw_for_sky(options_.seed, options_.layer, SkyDraw::place, cloud.serial);
    const Cloud& c = shape(cloud);
    const WorldRectangle& w = options_.world;
    // Places of the origin at which the cloud touches the world's sides from outside.
    const double west = w.min_x_m - c.high_m.x, east = w.max_x_m - c.low_m.x;
    const double south = w.min_y_m - c.high_m.y, north = w.max_y_m - c.low_m.y;
    const double dx = metres(wind.x), dy = metres(wind.y);
    const double inflow_x = std::abs(dx) * (north - south), inflow_y = std::abs(dy) * (east - west);
    double x, y;
    if (unit_interval(words[0]) * (inflow_x + inflow_y) < inflow_x) {
        x = dx > 0 ? west : east;
        y = draw_in(words[1], {south, north});
    } else {
        x = draw_in(words[1], {west, east});
        y = dy > 0 ? south : north;
    }
    // It crosses the side at some time of the next step; faster wind than the world is wide must not carry it
    // past.
    double way = 1;
    if (std::abs(dx) > east - west) way = (east - west) / std::abs(dx);
    if (std::abs(dy) > north - south) way = std::min(way, (north - south) / std::abs(dy));
    const double back = unit_interval(words[2]) * way - 1;
    cloud.place = {fixed(x + back * dx), fixed(y + back * dy)};
    return true;
}

StateHash SkySimulation::hash() const { return hash_of_bytes(bytes_without_slots()); }

std::vector<std::byte> SkySimulation::save() const {
    ByteWriter out;
    out.put_bytes(bytes_without_slots());
    for (const SkyCloud& c : clouds_) out.put(c.slot);
    return out.take();
}

std::vector<std::byte> SkySimulation::bytes_without_slots() const {
    ByteWriter out;
    const std::uint64_t drawn = std::uint64_t{dissolved_} << 32 | born_;
    out.put(std::array<std::uint64_t, 7>{kStateMark, shapes_.size(), steps_, drawn, std::uint64_t(carried_.x),
                                         std::uint64_t(carried_.y), clouds_.size()});
    for (const SkyCloud& c : clouds_) {
        out.put(c.serial);
        out.put(c.shape);
        out.put(c.sky);
        out.put(c.place.x);
        out.put(c.place.y);
        out.put(c.base_m);
        out.put(c.phase);
        out.put(std::uint8_t(c.dissolving));
    }
    if (options_.entering == Entering::horizon) out.put(due_);
    return out.take();
}

bool SkySimulation::is_possible(const SkyCloud& c) const {
    return c.shape < shapes_.size() && c.sky < options_.skies.size() &&
           std::abs(metres(c.place.x)) < kMaxPlace && std::abs(metres(c.place.y)) < kMaxPlace &&
           std::isfinite(c.base_m) && c.phase >= 0 && c.phase <= 1;
}

void SkySimulation::restore(std::span<const std::byte> bytes) {
    const auto bad = [](const char* what) { throw Error(ErrorCode::io, std::string("saved sky: ") + what); };
    ByteReader in(bytes);
    const auto [mark, shapes, steps, drawn, carried_x, carried_y, count] =
        in.get<std::array<std::uint64_t, 7>>();
    if (mark != kStateMark) bad("not the state of a sky");
    if (shapes != shapes_.size()) bad("from a scene with another number of clouds");
    const auto born = std::uint32_t(drawn), dissolved = std::uint32_t(drawn >> 32);
    std::vector<SkyCloud> clouds;
    for (std::uint64_t left = count; left > 0; --left) {
        SkyCloud c;
        c.serial = in.get<std::uint32_t>();
        c.shape = in.get<std::uint32_t>();
        c.sky = in.get<std::uint32_t>();
        c.place.x = in.get<std::int64_t>();
        c.place.y = in.get<std::int64_t>();
        c.base_m = in.get<double>();
        c.phase = in.get<double>();
        const auto dissolving = in.get<std::uint8_t>();
        if (c.serial >= born || !is_possible(c) || dissolving > 1) bad("a cloud of it is impossible");
        c.dissolving = dissolving != 0;
        clouds.push_back(c);
    }
    std::int64_t due = 0;
    if (options_.entering == Entering::horizon) due = in.get<std::int64_t>();
    if (due < 0 || due >= std::int64_t{1} << 32) bad("part of a cloud is impossible");
    std::unordered_set<std::uint32_t> slots;
    for (SkyCloud& c : clouds) {
        c.slot = in.get<std::uint32_t>();
        if (c.slot >= born || !slots.insert(c.slot).second) bad("a cloud of it is impossible");
    }
    if (!in.rest().empty()) bad("more bytes than expected");
    clouds_ = std::move(clouds);
    steps_ = steps;
    born_ = born;
    dissolved_ = dissolved;
    due_ = due;
    carried_ = {std::int64_t(carried_x), std::int64_t(carried_y)};
}

}  // namespace nephos
