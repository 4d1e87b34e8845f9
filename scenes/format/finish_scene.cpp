// SPDX-License-Identifier: Apache-2.0
// Checks and defaults that involve several sections of a scene.

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "density/grid_names.h"
#include "render/options/height_format.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// Returns the reader of a section of the scene, or of the scene itself when the file has no such section.
SectionReader section_or_scene(const SectionReader& reader, std::string_view name) {
    const Entry* entry = reader.find(name);
    if (entry == nullptr || entry->value.kind != Node::Kind::table) return reader;
    return {reader.document, entry->value, std::string(name), {}};
}

void check_name(const SectionReader& reader, const Scene& scene) {
    if (reader.find("name") == nullptr || !reader.sound({"name"})) return;
    constexpr std::size_t kLongest = 100;
    const auto allowed = [](char c) {
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        return letter || (c >= '0' && c <= '9') || c == '-' || c == '_' || c == '.';
    };
    const std::string& name = scene.name;
    const bool starts_well = !name.empty() && name.front() != '.' && name.front() != '-';
    if (starts_well && name.size() <= kLongest && std::all_of(name.begin(), name.end(), allowed)) return;
    reader.report("name", "`name` is \"" + shortened(name) + "\", which makes no file names",
                  "expected 1 to 100 letters, digits, `-`, `_` or `.`, starting with none of `-` and `.`");
}

void check_wind_speed(const SectionReader& reader, const Scene& scene) {
    if (!reader.sound({"wind", "time", "lattice"})) return;
    double fastest = 0;
    for (const WindKeyframe& keyframe : scene.automaton.wind.keyframes) {
        for (const WindLevel& level : keyframe.levels) {
            fastest = std::max(
                {fastest, std::abs(level.velocity.east_m_per_s), std::abs(level.velocity.north_m_per_s)});
        }
    }
    const double cells = fastest * scene.automaton.time_step_s / scene.automaton.placement.cell_size_m;
    if (cells <= kMaxCellsOfStep) return;
    reader.report("wind", "the wind moves " + number_text(cells) + " cells in one step",
                  "expected at most " + number_text(kMaxCellsOfStep) +
                      " cells: a shorter `time.step_s`, a larger `lattice.cell_size_m` or less wind");
}

// Returns the key of the horizontal semi-axis that adds more to the reach of a scatter's ellipsoids along an axis of the lattice.
std::string_view longer_along(const EllipsoidScatter& scatter, int axis) {
    EllipsoidScatter of_x = scatter, of_y = scatter;
    of_x.semi_axis_y_m = of_y.semi_axis_x_m = {0, 0};
    return reach_m(of_x)[axis] >= reach_m(of_y)[axis] ? "semi_axis_x_m" : "semi_axis_y_m";
}

void check_periodic_sizes(const SectionReader& reader, const Scene& scene) {
    if (!reader.sound({"lattice", "field"})) return;
    const AutomatonOptions& o = scene.automaton;
    check_reach_of_ellipsoids(reader.below("field"), o.field.ellipsoids, o.field.scatters,
                              largest_reach_m(o.extent, o.placement.cell_size_m, o.boundaries));
}

void check_frames(const SectionReader& reader, const Scene& scene) {
    if (!reader.document.frames_checked || !reader.sound({"time", "frames"}) || !scene.frames.enabled) return;
    const SectionReader frames = section_or_scene(reader, "frames");
    const double end_s = simulated_time_s(scene);
    const std::string simulated =
        number_text(end_s) + " s that `time.steps` = " + std::to_string(scene.steps) +
        " and `time.step_s` = " + number_text(scene.automaton.time_step_s) + " simulate";
    if (steps_up_to(moment_of_frame(scene, 0)) > scene.steps) {
        frames.report(
            "start_s",
            "`frames.start_s` is " + number_text(scene.frames.start_s) + " s, after the " + simulated,
            "expected a start within the simulated time, or more steps");
        return;
    }
    if (scene.frames.count == 0) {
        if (frame_count(scene) < kMaxFrames) return;
        const bool with_scale = frames.find("time_scale") != nullptr;
        const SectionReader at = with_scale ? frames : section_or_scene(reader, "time");
        at.report(with_scale ? "time_scale" : "steps",
                  "the scene has more than " + std::to_string(kMaxFrames) + " frames",
                  "expected a larger `frames.time_scale`, fewer `time.steps`, or a `frames.count`");
        return;
    }
    const int last = scene.frames.count - 1;
    if (steps_up_to(moment_of_frame(scene, last)) <= scene.steps) return;
    Scene all = scene;
    all.frames.count = 0;
    frames.report("count",
                  "the last of the " + std::to_string(scene.frames.count) + " frames shows " +
                      number_text(frame_time_s(scene.frames, last)) + " s, after the " + simulated,
                  "expected `frames.count` up to " + std::to_string(frame_count(all)) + ", or more steps");
}

// Sets a range that was not given to the lattice, as far as the keys go: the scene's text has it.
void replace_infinite(Range& range, double low, double size) {
    if (std::isinf(range.min))
        range = {std::clamp(low, -kFarthestPlace_m, kFarthestPlace_m),
                 std::clamp(low + size, -kFarthestPlace_m, kFarthestPlace_m)};
}

}  // namespace

void fill_in_centres(std::vector<EllipsoidScatter>& scatters, const Extent& extent,
                     const Placement& placement) {
    for (EllipsoidScatter& scatter : scatters) {
        replace_infinite(scatter.x_m, placement.origin_m.x, extent.x * placement.cell_size_m);
        replace_infinite(scatter.y_m, placement.origin_m.y, extent.y * placement.cell_size_m);
        replace_infinite(scatter.z_m, placement.origin_m.z, extent.z * placement.cell_size_m);
    }
}

void check_periodic_reach(const SectionReader& reader, const std::string& what, const Vec3& largest_m,
                          const Vec3& reach_m, std::string_view horizontal, std::string_view vertical) {
    constexpr const char* kAxes[] = {"x (east)", "y (north)", "z (up)"};
    const auto exceeds = [&](int axis) { return reach_m[axis] > largest_m[axis]; };
    const auto report = [&](std::string_view key, int axis) {
        reader.report(key,
                      (what.empty() ? reader.quoted(key) : what) + " reaches " + number_text(reach_m[axis]) +
                          " m from the centre along the periodic axis " + kAxes[axis],
                      "expected at most " + number_text(largest_m[axis]) + " m, " +
                          number_text(kMaxPeriodicReach) +
                          " times the lattice along that axis, or an open boundary there");
    };
    const bool across = exceeds(0) || exceeds(1);
    if (across) report(horizontal, exceeds(0) ? 0 : 1);
    if (exceeds(2) && (vertical != horizontal || !across)) report(vertical, 2);
}

void check_reach_of_ellipsoids(const SectionReader& owner, std::span<const Ellipsoid> ellipsoids,
                               std::span<const EllipsoidScatter> scatters, const Vec3& largest_m) {
    const auto check_items = [&](const char* name, const auto& check_item) {
        const Entry* items = owner.find(name);
        for (std::size_t n = 0; items != nullptr && n < items->value.items.size(); ++n)
            check_item(n, owner.item(name, n));
    };
    check_items("ellipsoids", [&](std::size_t n, const SectionReader& item) {
        check_periodic_reach(item, {}, largest_m, reach_m(ellipsoids[n]), "semi_axes_m", "semi_axes_m");
    });
    check_items("scatters", [&](std::size_t n, const SectionReader& item) {
        EllipsoidScatter as_drawn = scatters[n];
        as_drawn.thermals.spread = 0;
        const Vec3 reach = reach_m(as_drawn);
        const auto exceeds = [&](int axis) { return reach[axis] > largest_m[axis]; };
        if (exceeds(0) || exceeds(1) || exceeds(2)) {
            check_periodic_reach(item, {}, largest_m, reach, longer_along(as_drawn, exceeds(0) ? 0 : 1),
                                 "semi_axis_z_m");
        } else {
            check_periodic_reach(item, "a thermal, grown by " + item.quoted("thermals") + ",", largest_m,
                                 reach_m(scatters[n]), "thermals", "thermals");
        }
    });
}

void check_wind_times(const SectionReader& owner, const Wind& wind) {
    const std::string path = owner.path.empty() ? "wind" : owner.path + ".wind";
    for (std::size_t n = 1; n < wind.keyframes.size(); ++n) {
        const double before_s = wind.keyframes[n - 1].time_s, time_s = wind.keyframes[n].time_s;
        if (time_s > before_s) continue;
        const Node& item = owner.find("wind")->value.items[n];
        const SectionReader profile{owner.document, item, indexed(path, n), {}};
        profile.report("time_s",
                       profile.quoted("time_s") + " is " + number_text(time_s) +
                           ", not after the profile before it at " + number_text(before_s),
                       "expected times that rise from profile to profile, in seconds");
    }
}

// Fields without heights fill the lattice. Layers with a wind of their own have them, too.
void finish_wind_fields(const SectionReader& reader, Scene& scene) {
    const Placement& placement = scene.automaton.placement;
    const double top_m = placement.origin_m.z + scene.automaton.extent.z * placement.cell_size_m;
    std::vector<WindField>& fields = scene.automaton.wind.fields;
    for (std::size_t n = 0; n < fields.size(); ++n) {
        WindField& field = fields[n];
        if (std::isinf(field.bottom_m)) field.bottom_m = placement.origin_m.z;
        if (std::isinf(field.top_m)) field.top_m = top_m;
        if (field.kind == WindFieldKind::grid || field.bottom_m < field.top_m) continue;
        const SectionReader item = reader.item("wind_field", n);
        item.report("kind",
                    "the field ends at " + number_text(field.top_m) + " m and begins at " +
                        number_text(field.bottom_m) + " m",
                    "expected `bottom_m` below `top_m`; what is missing is that of `[lattice]`");
    }
    for (LayerOptions& layer : scene.layers)
        if (!layer.wind.keyframes.empty()) layer.wind.fields = fields;
}

// The sun of the scene's place and start, unless the scene says where it stands. The moment of a sun with a date of its
// own stays; a place of its own, too.
void place_sun(const SectionReader& reader, Scene& scene) {
    const Georeference& place = scene.georeference;
    if (!place.given || !reader.sound({"sun", "georeference"})) return;
    const Entry* given = reader.find("sun");
    const auto has = [&](const char* name) { return given != nullptr && given->value.find(name) != nullptr; };
    Sun& sun = scene.render.sun;
    const bool own_height =
        sun.date.empty() && (has("elevation_deg") || has("azimuth_deg") || !scene.sun_path.empty());
    if (own_height) return;
    if (sun.date.empty()) {
        if (place.start_utc.empty()) return;
        sun.date = place.start_utc.substr(0, 10);
        sun.time = place.start_utc.substr(11, 8);
        if (!has("moves")) sun.moves = true;
    }
    if (has("latitude_deg") || has("longitude_deg")) return;
    sun.latitude_deg = place.latitude_deg;
    sun.longitude_deg = place.longitude_deg;
}

void check_velocity_name(const SectionReader& reader, const Scene& scene) {
    const std::string& name = scene.density_files.velocity_name;
    if (!reader.sound({"density"})) return;
    const SectionReader density = section_or_scene(reader, "density");
    if (!is_name_of_wind(name)) {
        density.report("velocity_name", "`density.velocity_name` is \"" + shortened(name) + "\"",
                       "expected " + std::string(kExpectedNameOfWind));
    }
    if (!scene.density_files.per_layer && !scene.density_files.combined && !scene.layers.empty()) {
        density.report("combined", "neither `density.per_layer` nor `density.combined` is true",
                       "expected one of them, or `frames.enabled` = false for no density files");
    }
}

// The lattice of a tile is periodic, unless the scene says that it is not.
void repeat_lattice(const SectionReader& reader, Scene& scene) {
    if (!scene.tile || !reader.sound({"lattice"})) return;
    const Entry* given = reader.find("lattice");
    Boundaries& boundaries = scene.automaton.boundaries;
    if (given == nullptr || given->value.find("boundaries") == nullptr) {
        boundaries.x = boundaries.y = Boundary::periodic;
    } else if (boundaries.x != Boundary::periodic || boundaries.y != Boundary::periodic) {
        section_or_scene(reader, "lattice")
            .report("boundaries", "`lattice.boundaries` is open in a tile",
                    "expected [\"periodic\", \"periodic\", \"open\"], or none");
    }
}

// What a height map's name says of its file, before anybody reads it.
void check_height_map(const SectionReader& reader, const TerrainOptions& terrain) {
    if (!terrain.height_map || !reader.sound({"ground", "terrain"})) return;
    const SectionReader ground = section_or_scene(reader, "ground"), about = section_or_scene(reader, "terrain");
    const HeightFormat format = height_format(*terrain.height_map);
    if (format == HeightFormat::none) {
        ground.report("height_map",
                      ground.quoted("height_map") + " is \"" +
                          shortened(terrain.height_map->filename().string()) +
                          "\", which is no height map by its name",
                      "expected a file that ends in .png, .exr, .raw or .r16");
    }
    if (format != HeightFormat::raw || (terrain.raw_columns >= 2 && terrain.raw_rows >= 2)) return;
    const char* const wrong = terrain.raw_columns < 2 ? "raw_columns" : "raw_rows";
    const bool given = reader.find("terrain") != nullptr && about.find(wrong) != nullptr;
    const std::string expected =
        "expected `terrain.raw_columns` and `terrain.raw_rows`, integers from 2 to 4096";
    if (given)
        about.report(wrong, about.quoted(wrong) + " is too small for a height map", expected);
    else
        ground.report("height_map",
                      ground.quoted("height_map") + " is a raw file, which does not say its size", expected);
}

void finish_scene(const SectionReader& reader, void* owner) {
    auto& scene = *static_cast<Scene*>(owner);
    repeat_lattice(reader, scene);
    check_name(reader, scene);
    if (reader.sound({"wind"})) check_wind_times(reader, scene.automaton.wind);
    check_wind_speed(reader, scene);
    if (reader.sound({"wind_field", "lattice", "layer"})) finish_wind_fields(reader, scene);
    check_periodic_sizes(reader, scene);
    check_frames(reader, scene);
    place_sun(reader, scene);
    check_velocity_name(reader, scene);
    check_height_map(reader, scene.render.terrain);
    const AutomatonOptions& automaton = scene.automaton;
    fill_in_centres(scene.automaton.field.scatters, automaton.extent, automaton.placement);
    finish_layers(reader, scene);
}

}  // namespace nephos
