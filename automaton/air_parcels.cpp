// SPDX-License-Identifier: Apache-2.0
#include "automaton/air_parcels.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/error.h"
#include "core/random.h"

namespace nephos {
namespace {

// Order of the numbers drawn for one parcel; each has its own place in the counter.
enum ParcelDraw : std::uint32_t {
    kX,
    kY,
    kZ,
    kAxisX,
    kAxisY,
    kAxisZ,
    kYaw,
    kBirth,
    kLife,
    kSide,
    kAlong,
    kRise
};

constexpr std::uint32_t kFirstOfThermals = 16;  // sub-index of the numbers of thermal 0; one for each thermal

double draw(const AutomatonOptions& options, const AirParcel& parcel, ParcelDraw what, Range range) {
    if (range.min == range.max) return range.min;  // also for infinite ones
    const auto words = philox(options.seed, item_counter(Domain::field, std::uint32_t(parcel.scatter),
                                                         parcel.index, parcel.generation, what / 4u));
    return range.min + (range.max - range.min) * unit_interval(words[what % 4u]);
}

// Draws a parcel of a scatter: position, time and shape from its ranges.
AirParcel draw_parcel(const AutomatonOptions& options, int scatter, std::uint32_t index,
                      std::uint32_t generation) {
    const EllipsoidScatter& s = options.field.scatters[std::size_t(scatter)];
    AirParcel parcel{
        .ellipsoid = {}, .scatter = scatter, .index = index, .generation = generation, .carried = {}, .carried_up = 0};
    Ellipsoid& e = parcel.ellipsoid;
    e.centre_m = {draw(options, parcel, kX, s.x_m), draw(options, parcel, kY, s.y_m),
                  draw(options, parcel, kZ, s.z_m)};
    e.semi_axes_m = {draw(options, parcel, kAxisX, s.semi_axis_x_m),
                     draw(options, parcel, kAxisY, s.semi_axis_y_m),
                     draw(options, parcel, kAxisZ, s.semi_axis_z_m)};
    e.yaw_deg = draw(options, parcel, kYaw, s.yaw_deg);
    e.centre = s.centre;
    e.rim = s.rim;
    e.birth_s = draw(options, parcel, kBirth, s.birth_s);
    e.life_s = draw(options, parcel, kLife, s.life_s);
    e.fade_in_s = s.fade_in_s;
    e.fade_out_s = s.fade_out_s;
    e.carried = s.carried;
    return parcel;
}

// Adds displacements along one axis without overflow: modulo the box on a periodic axis, clamped to 2^29
// cells on an open one, beyond which there is nothing.
std::int64_t carry(std::int64_t sum, std::int64_t step, Boundary boundary, int extent) {
    constexpr std::int64_t kFarAway = std::int64_t{1} << 61;
    sum += step;
    return boundary == Boundary::periodic ? sum % (std::int64_t{extent} << 32)
                                          : std::clamp(sum, -kFarAway, kFarAway);
}

// Appends the thermals of a plume with its root at `root`, released at the plume's birth and later.
void append_thermals(const AutomatonOptions& options, const AirParcel& plume, const Vec3& root, double time_s,
                     std::vector<ActiveEllipsoid>& to) {
    const EllipsoidScatter& scatter = options.field.scatters[std::size_t(plume.scatter)];
    const ThermalPlume& o = scatter.thermals;
    const Ellipsoid& e = plume.ellipsoid;
    const double age = time_s - e.birth_s, last = std::floor((e.life_s - o.life_s) / o.interval_s);
    const double first = std::max(0.0, std::floor((age - o.life_s) / o.interval_s));
    const double rise = draw(options, plume, kRise, o.rise_m);
    const Velocity below = wind_at(options.wind, e.centre_m.z, time_s);
    // Counted from the first: of an ellipsoid that is older than 2^53 thermals the numbers no longer rise one by one.
    const double most = std::ceil(o.life_s / o.interval_s) + 1;
    for (double passed = 0; passed <= most; ++passed) {
        const double n = first + passed;
        if (n > last || n * o.interval_s > age) break;
        Ellipsoid thermal = e;
        thermal.birth_s = e.birth_s + n * o.interval_s;
        thermal.life_s = o.life_s;
        const double weight = fade_weight(thermal, time_s);
        if (weight <= 0) continue;
        const auto words = philox(
            options.seed, item_counter(Domain::field, std::uint32_t(plume.scatter), plume.index,
                                       plume.generation, kFirstOfThermals + std::uint32_t(std::fmod(n, 65520.0))));
        const double of_size = 1 - o.variety * unit_interval(words[0]);
        const double of_rise = 1 - o.variety * unit_interval(words[1]);
        const double lived = (time_s - thermal.birth_s) / o.life_s;
        const double risen = rise * of_rise * lived * (2 - lived);
        const Vec3 released = Vec3(o.width, o.width, 1) * e.semi_axes_m * of_size;
        thermal.semi_axes_m =
            released * std::max(0.2, 1 + o.spread * risen / (0.5 * (released.x + released.y)));
        // Within the ellipse of the plume, at the same angle as its semi-axes.
        const Rotation turn = rotation_of_degrees(e.yaw_deg);
        const double a = o.wander * e.semi_axes_m.x * (2 * unit_interval(words[2]) - 1),
                     b = o.wander * e.semi_axes_m.y * (2 * unit_interval(words[3]) - 1);
        const Velocity wind = e.carried ? wind_at(options.wind, e.centre_m.z + 0.5 * risen, time_s) : below;
        const double since = time_s - thermal.birth_s;
        thermal.centre_m =
            root + Vec3(a * turn.cos - b * turn.sin + (wind.east_m_per_s - below.east_m_per_s) * since,
                        a * turn.sin + b * turn.cos + (wind.north_m_per_s - below.north_m_per_s) * since,
                        risen);
        to.push_back({thermal, weight});
    }
}

Vec3 present_centre(const AirParcel& parcel, double cell_size_m) {
    const Vec3& born = parcel.ellipsoid.centre_m;
    return {born.x + double(parcel.carried.x) * 0x1p-32 * cell_size_m,
            born.y + double(parcel.carried.y) * 0x1p-32 * cell_size_m,
            born.z + double(parcel.carried_up) * 0x1p-32 * cell_size_m};
}

struct Box {
    double x0, x1, y0, y1;
};
Box box_of(const AutomatonOptions& o) {
    const Vec3& origin = o.placement.origin_m;
    return {origin.x, origin.x + o.extent.x * o.placement.cell_size_m, origin.y,
            origin.y + o.extent.y * o.placement.cell_size_m};
}

// Returns true when the whole ellipsoid has left the box downwind, through an open side.
bool has_left(const AutomatonOptions& options, const AirParcel& parcel, const Vec3& wind) {
    const Box box = box_of(options);
    const Vec3 half = reach_m(parcel.ellipsoid);
    const Vec3 centre = present_centre(parcel, options.placement.cell_size_m);
    const bool left_x =
        options.boundaries.x == Boundary::open && ((wind.x > 0 && centre.x - half.x >= box.x1) ||
                                                   (wind.x < 0 && centre.x + half.x <= box.x0));
    const bool left_y =
        options.boundaries.y == Boundary::open && ((wind.y > 0 && centre.y - half.y >= box.y1) ||
                                                   (wind.y < 0 && centre.y + half.y <= box.y0));
    return left_x || left_y;
}

// Returns true when a field of the wind has carried the whole ellipsoid out of the box through its open top or bottom.
bool has_risen_out(const AutomatonOptions& options, const AirParcel& parcel) {
    if (parcel.carried_up == 0 || options.boundaries.z == Boundary::periodic) return false;
    const double bottom = options.placement.origin_m.z,
                 top = bottom + options.extent.z * options.placement.cell_size_m;
    const double z = present_centre(parcel, options.placement.cell_size_m).z, half = parcel.ellipsoid.semi_axes_m.z;
    return z - half >= top || z + half <= bottom;
}

// Puts a parcel outside the upwind sides so that it just touches the box. Air enters a side in proportion to
// the wind across it and to its length; that decides which of two upwind sides it is.
void place_upwind(const AutomatonOptions& options, AirParcel& parcel, const Vec3& wind) {
    const Box box = box_of(options);
    const double inflow_x =
        options.boundaries.x == Boundary::open ? std::abs(wind.x) * (box.y1 - box.y0) : 0;
    const double inflow_y =
        options.boundaries.y == Boundary::open ? std::abs(wind.y) * (box.x1 - box.x0) : 0;
    Ellipsoid& e = parcel.ellipsoid;
    const Vec3 half = reach_m(e);
    if (draw(options, parcel, kSide, {0, inflow_x + inflow_y}) < inflow_x) {
        e.centre_m.x = wind.x > 0 ? box.x0 - half.x : box.x1 + half.x;
        e.centre_m.y = draw(options, parcel, kAlong, {box.y0, box.y1});
    } else {
        e.centre_m.y = wind.y > 0 ? box.y0 - half.y : box.y1 + half.y;
        e.centre_m.x = draw(options, parcel, kAlong, {box.x0, box.x1});
    }
}

}  // namespace

Vec3 reach_of(const Vec3& semi_axes, const Rotation& turn) {
    const double a = semi_axes.x, b = semi_axes.y;
    return {std::sqrt(a * a * turn.cos * turn.cos + b * b * turn.sin * turn.sin),
            std::sqrt(a * a * turn.sin * turn.sin + b * b * turn.cos * turn.cos), semi_axes.z};
}

double fade_weight(const Ellipsoid& e, double time_s) {
    const double age = time_s - e.birth_s;
    const double left = e.life_s - age;
    if (age < 0 || left <= 0) return 0;
    const double in = e.fade_in_s > 0 ? std::min(age / e.fade_in_s, 1.0) : 1.0;
    const double out = e.fade_out_s > 0 ? std::min(left / e.fade_out_s, 1.0) : 1.0;
    return std::min(in, out);
}

AirParcels::AirParcels(const AutomatonOptions& options) {
    for (const Ellipsoid& e : options.field.ellipsoids) {
        parcels_.push_back({.ellipsoid = e, .scatter = -1, .index = 0, .generation = 0, .carried = {}, .carried_up = 0});
    }
    for (int s = 0; s < int(options.field.scatters.size()); ++s) {
        for (int i = 0; i < options.field.scatters[std::size_t(s)].count; ++i) {
            parcels_.push_back(draw_parcel(options, s, std::uint32_t(i), 0));
        }
    }
}

std::vector<ActiveEllipsoid> AirParcels::active(const AutomatonOptions& options, double time_s) const {
    std::vector<ActiveEllipsoid> result;
    for (const AirParcel& parcel : parcels_) {
        const Vec3 centre = present_centre(parcel, options.placement.cell_size_m);
        const double weight = fade_weight(parcel.ellipsoid, time_s);
        if (weight > 0) {
            result.push_back({parcel.ellipsoid, weight});
            result.back().ellipsoid.centre_m = centre;
        }
        if (parcel.scatter >= 0 && is_plume(options.field.scatters[std::size_t(parcel.scatter)]))
            append_thermals(options, parcel, centre, time_s, result);
    }
    return result;
}

void AirParcels::advance(const AutomatonOptions& options, std::uint64_t step) {
    // The end is the time at which the next step begins, to the last bit: what is born then lives in that step.
    const double time_s = double(step) * options.time_step_s, end_s = double(step + 1) * options.time_step_s;
    for (AirParcel& parcel : parcels_) {
        const Ellipsoid& e = parcel.ellipsoid;
        const double cell = options.placement.cell_size_m;
        const Vec3 wind = e.carried ? mean_wind(options.wind, present_centre(parcel, cell), time_s, options.time_step_s)
                                    : Vec3{};
        if (e.carried && time_s >= e.birth_s) {
            const Displacement d = displacement_of_step({wind.x, wind.y}, options.time_step_s, cell);
            parcel.carried.x = carry(parcel.carried.x, d.x, options.boundaries.x, options.extent.x);
            parcel.carried.y = carry(parcel.carried.y, d.y, options.boundaries.y, options.extent.y);
            const Displacement up = displacement_of_step({wind.z, 0}, options.time_step_s, cell);
            parcel.carried_up = carry(parcel.carried_up, up.x, options.boundaries.z, options.extent.z);
        }
        if (parcel.scatter < 0 || !options.field.scatters[std::size_t(parcel.scatter)].replace) continue;
        const bool died = end_s >= e.birth_s + e.life_s || has_risen_out(options, parcel);
        const bool left = end_s >= e.birth_s && has_left(options, parcel, wind);
        if (!died && !left) continue;
        parcel = draw_parcel(options, parcel.scatter, parcel.index, parcel.generation + 1);
        parcel.ellipsoid.birth_s = end_s;
        if (left) {
            place_upwind(options, parcel, wind);
            parcel.ellipsoid.fade_in_s = 0;  // it enters from outside: nothing appears
        }
    }
}

void AirParcels::save(ByteWriter& out, const AutomatonOptions& options) const {
    out.put(std::uint64_t(parcels_.size()));
    for (const AirParcel& p : parcels_) {
        const Ellipsoid& e = p.ellipsoid;
        for (double value : {e.centre_m.x, e.centre_m.y, e.centre_m.z, e.semi_axes_m.x, e.semi_axes_m.y,
                             e.semi_axes_m.z, e.yaw_deg, e.birth_s, e.life_s, e.fade_in_s}) {
            out.put(value);
        }
        out.put(p.generation);
        out.put(p.carried.x);
        out.put(p.carried.y);
        if (!options.wind.fields.empty()) out.put(p.carried_up);
    }
}

void AirParcels::restore(ByteReader& in, const AutomatonOptions& options) {
    if (in.get<std::uint64_t>() != parcels_.size()) {
        throw Error(ErrorCode::io, "saved state has another number of ellipsoids than the scene");
    }
    for (AirParcel& p : parcels_) {  // what a redraw never changes stays as the options made it
        Ellipsoid& e = p.ellipsoid;
        for (double* value : {&e.centre_m.x, &e.centre_m.y, &e.centre_m.z, &e.semi_axes_m.x, &e.semi_axes_m.y,
                              &e.semi_axes_m.z, &e.yaw_deg, &e.birth_s, &e.life_s, &e.fade_in_s}) {
            *value = in.get<double>();
        }
        p.generation = in.get<std::uint32_t>();
        p.carried.x = in.get<std::int64_t>();
        p.carried.y = in.get<std::int64_t>();
        if (!options.wind.fields.empty()) p.carried_up = in.get<std::int64_t>();
        try {
            check(e, options, "an ellipsoid");
        } catch (const Error& error) {
            throw Error(ErrorCode::io, std::string("saved state: ") + error.what());
        }
    }
}

}  // namespace nephos
