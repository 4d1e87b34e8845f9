// SPDX-License-Identifier: Apache-2.0

// nephos render: a picture of any fog volume.

#include <algorithm>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "density/metaballs.h"
#include "density/vdb/vdb_file.h"
#include "render/image/image_file.h"
#include "render/renderer.h"
#include "simulation/framing.h"
#include "simulation/simulation.h"
#include "simulation/version.h"

namespace nephos {
namespace {

constexpr double kFar_m = 1e9;

struct RenderArguments {
    std::string file;
    std::vector<std::string> out;
    VdbReadOptions read;
    SceneArguments scene;
    std::optional<View> view;
    std::optional<Vec3> camera_m, target_m;
    std::optional<double> fov_deg, exposure_ev, extinction_per_m, albedo, g;
    std::optional<std::pair<double, double>> sun_deg;
    std::optional<std::pair<int, int>> size;
    DeviceArguments device;
    WorkArguments work;
};

std::string extension_of(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
    return extension;
}

void add_picture_options(CLI::App& command, RenderArguments& a) {
    const char* group = "Picture";
    command.add_option("--scene", a.scene.file, "Take camera, sun, air, ground and extinction from a scene")
        ->type_name("SCENE")
        ->group(group);
    command.add_option("--set", a.scene.overrides, "Change a key of that scene; may be repeated")
        ->type_name("KEY=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->needs(command.get_option("--scene"))
        ->group(group);
    const auto real = [&](const char* name, const char* type, const char* text, std::optional<double>& target,
                          double min, double max) {
        add_value(command, name, type, text, [&target, min, max](const std::string& value) {
            target = parse_real(value, min, max);
        })->group(group);
    };
    add_value(command, "--size", "WxH", "Width and height in pixels (default: 1280x720)",
              [&](const std::string& text) { a.size = parse_size(text); })
        ->group(group);
    add_value(command, "--view", "VIEW",
              "Where to look from: side, below or above (default: side, or the scene's camera)",
              [&](const std::string& text) {
                  if (text != "side" && text != "below" && text != "above") {
                      throw Error(ErrorCode::usage,
                                  fmt::format("'{}' is not one of side, below and above", text));
                  }
                  a.view = text == "side" ? View::side : text == "below" ? View::below : View::above;
              })
        ->group(group);
    add_value(command, "--camera", "X,Y,Z", "Position of the eye in metres, instead of that of --view",
              [&](const std::string& text) { a.camera_m = parse_point(text, -kFar_m, kFar_m); })
        ->group(group);
    add_value(command, "--target", "X,Y,Z", "Point to look at in metres (default: middle of the cloud)",
              [&](const std::string& text) { a.target_m = parse_point(text, -kFar_m, kFar_m); })
        ->group(group);
    real("--fov", "DEG", "Vertical field of view, 1 to 170 degrees (default: 50)", a.fov_deg, 1, 170);
    real("--exposure", "EV", "Stops by which the PNG is brighter, -20 to 20 (default: 0)", a.exposure_ev, -20,
         20);
    add_value(command, "--sun", "ELEV,AZIM",
              "Where the sun stands: degrees above the horizon (-18 to 90), and clockwise from north "
              "(default: 40,135)",
              [&](const std::string& text) {
                  const std::vector<double> sun = parse_reals(text, 2, -360, 360);
                  if (sun[0] < -18 || sun[0] > 90) {
                      throw Error(ErrorCode::usage,
                                  fmt::format("'{}': the elevation is not from -18 to 90", text));
                  }
                  a.sun_deg = {sun[0], sun[1]};
              })
        ->group(group);
}

void add_cloud_options(CLI::App& command, RenderArguments& a) {
    const char* group = "Cloud";
    command.add_option("--grid", a.read.grid, "Grid to draw (default: density, else the first float grid)")
        ->type_name("NAME")
        ->group(group);
    const auto real = [&](const char* name, const char* type, const char* text, std::optional<double>& target,
                          double min, double max) {
        add_value(command, name, type, text, [&target, min, max](const std::string& value) {
            target = parse_real(value, min, max);
        })->group(group);
    };
    real("--extinction", "PER_M",
         "Extinction per metre at density 1 (default: what the file says, else chosen so that the cloud is "
         "visible)",
         a.extinction_per_m, 0, 1e9);
    add_value(command, "--up", "AXIS",
              "Axis of the file that points up: z or y (default: what the file says, else z)",
              [&](const std::string& text) {
                  if (text != "y" && text != "z") {
                      throw Error(ErrorCode::usage, fmt::format("'{}' is not one of y and z", text));
                  }
                  a.read.up_axis = text == "y" ? UpAxis::y : UpAxis::z;
              })
        ->group(group);
    add_value(command, "--scale", "M", "Metres of one unit of the file (default: 1)",
              [&](const std::string& text) { a.read.metres_per_unit = parse_real(text, 1e-9, 1e9); })
        ->group(group);
    real("--albedo", "A", "Part of the light that is scattered and not absorbed, 0 to 1 (default: 1)",
         a.albedo, 0, 1);
    real("--g", "G", "Forward scattering of light, -0.99 to 0.99 (default: 0.5)", a.g, -0.99, 0.99);
}

// What the picture is drawn with: the scene's options, or defaults that fit the cloud, changed by the command
// line.
RenderOptions picture_options(const RenderArguments& a, const std::optional<Scene>& scene,
                              const DensityGrid& grid, double time_s) {
    RenderOptions options;
    const WorldBox box = cloud_box(grid);
    if (scene) {
        options = scene->render;
        options.camera = camera_at(options.camera, time_s);
    } else {
        options.camera.width = 1280;
        options.camera.height = 720;
        options.ground.height_m = ground_below(box);
    }
    if (a.size) std::tie(options.camera.width, options.camera.height) = *a.size;
    if (a.fov_deg) options.camera.vertical_fov_deg = *a.fov_deg;
    if (a.exposure_ev) options.camera.exposure_ev = *a.exposure_ev;
    if (a.sun_deg) {
        std::tie(options.sun.elevation_deg, options.sun.azimuth_deg) = *a.sun_deg;
        options.sun.date.clear();
        options.sun.time.clear();
    }
    if (a.albedo) options.light.albedo = *a.albedo;
    if (a.g) options.light.phase.g = *a.g;
    if (a.view || !scene) frame(options.camera, box, a.view.value_or(View::side), options.ground.height_m);
    if (a.camera_m) options.camera.position_m = *a.camera_m;
    if (a.target_m) options.camera.target_m = *a.target_m;
    if (options.camera.position_m == options.camera.target_m) {
        throw Error(ErrorCode::usage, "--camera and --target are the same point");
    }
    return options;
}

// What lies on the scene's ground at its start: a file of density knows no rain.
std::optional<GroundCoverView> initial_cover(const std::optional<Scene>& scene) {
    if (!scene || !scene->ground_cover.enabled) return {};
    GroundCoverView cover;
    cover.outside_water_mm = scene->ground_cover.initial_water_mm;
    cover.outside_snow_mm = scene->ground_cover.initial_snow_mm;
    return cover;
}

void check_outputs(const RenderArguments& a) {
    for (const std::string& out : a.out) {
        if (extension_of(out) == ".png" || extension_of(out) == ".exr") continue;
        throw Error(ErrorCode::usage, fmt::format("--out '{}' does not end with .png or .exr", out));
    }
}

// In voxels of the file: a scene's radius is in cells of the lattice, and a refined grid has several voxels a
// cell.
double radius_in_voxels(const std::optional<Scene>& scene, const LoadedDensity& loaded) {
    const double cells =
        scene ? scene->density.metaball_radius_cells : DensityOptions().metaball_radius_cells;
    return std::min(cells * loaded.refine, kMaxMetaballRadius);
}

double extinction_of(const RenderArguments& a, const std::optional<Scene>& scene,
                     const LoadedDensity& loaded) {
    if (a.extinction_per_m) return *a.extinction_per_m;
    if (scene) return scene->density.extinction_per_m;
    if (loaded.metadata) return loaded.metadata->extinction_per_m;
    const double visible = visible_extinction_per_m(loaded.density);
    if (!a.work.quiet) {
        print_note(
            fmt::format("{}: names no extinction; {:.4g} per metre at density 1 is taken, so that the "
                        "cloud is visible (--extinction changes it)",
                        a.file, visible));
    }
    return visible;
}

PictureMetadata picture_metadata(const RenderArguments& a, const LoadedDensity& loaded,
                                 double extinction_per_m) {
    PictureMetadata metadata;
    metadata.scene = std::filesystem::path(a.file).filename().string();
    metadata.version = version();
    metadata.extinction_per_m = extinction_per_m;
    if (loaded.metadata) {
        metadata.seed = loaded.metadata->seed;
        metadata.scene_hash = loaded.metadata->scene_hash;
        metadata.state_hash = loaded.metadata->state_hash;
        metadata.time_s = loaded.metadata->time_s;
        metadata.frames_per_second = loaded.metadata->frames_per_second;
        metadata.time_scale = loaded.metadata->time_scale;
    }
    return metadata;
}

void write_pictures(const RenderArguments& a, const Picture& picture, const RenderOptions& options,
                    const PictureMetadata& metadata) {
    for (const std::string& out : a.out) {
        if (extension_of(out) == ".exr") {
            write_exr(out, picture, options, metadata);
        } else {
            write_png(out, picture, options, metadata);
        }
    }
}

nlohmann::ordered_json render_json(const RenderArguments& a, const RenderOptions& options) {
    const Vec3 &eye = options.camera.position_m, &target = options.camera.target_m;
    return {{"files", a.out},
            {"width", options.camera.width},
            {"height", options.camera.height},
            {"camera_m", {eye.x, eye.y, eye.z}},
            {"target_m", {target.x, target.y, target.z}}};
}

int render(const RenderArguments& a) {
    check_outputs(a);
    const ThreadLimit limit(a.work.threads);
    std::optional<Scene> scene;
    if (!a.scene.file.empty()) scene = load_scene(a.scene);
    const LoadedDensity loaded = load_density(a.file, a.read);
    const DensityGrid& grid = loaded.density;
    if (!a.work.quiet) {
        for (const std::string& note : loaded.notes) print_note(a.file + ": " + note);
    }
    require_memory(grid.active_voxels() * 4 * sizeof(Metaball),
                   fmt::format("{}: drawing its voxels", a.file));

    const double radius = radius_in_voxels(scene, loaded);
    const double extinction_per_m = extinction_of(a, scene, loaded);
    const double time_s = loaded.metadata ? loaded.metadata->time_s : 0;
    RenderOptions options = picture_options(a, scene, grid, time_s);
    options.sun = sun_at(options.sun, time_s);
    Renderer renderer(device_options(a.device, scene ? scene->frames : FrameOptions{}));
    const std::vector<Metaball> balls = metaballs(grid, radius);
    Splats splats;
    splats.metaballs = {balls, extinction_per_m, metaball_normalisation(radius)};
    splats.ground_cover = initial_cover(scene);
    splats.time_s = time_s;
    splats.light = splats.depth =
        std::ranges::any_of(a.out, [](const std::string& out) { return extension_of(out) == ".exr"; });
    const Picture picture = renderer.draw_splats(splats, options);
    PictureMetadata metadata = picture_metadata(a, loaded, extinction_per_m);
    note_renderer(renderer, metadata);
    write_pictures(a, picture, options, metadata);

    Output output;
    if (a.work.json) {
        nlohmann::ordered_json json = render_json(a, options);
        json["grid"] = loaded.grid_name;
        json["metaballs"] = balls.size();
        json["metaball_radius_voxels"] = radius;
        json["extinction_per_m"] = extinction_per_m;
        json["backend"] = renderer.backend_name();
        json["device"] = renderer.device_name();
        output.line(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
    } else {
        for (const std::string& out : a.out) output.line(out);
    }
    return 0;
}

}  // namespace

void add_render_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("render", "Draw the fog volume of an OpenVDB file, ours or not");
    const auto a = std::make_shared<RenderArguments>();
    command->add_option("FILE.vdb", a->file, "OpenVDB file with a float fog volume")
        ->required()
        ->type_name("FILE.vdb");
    command
        ->add_option("-o,--out", a->out,
                     "Picture to write: .png (tone-mapped) or .exr (all layers); may be repeated")
        ->required()
        ->type_name("IMG")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_picture_options(*command, *a);
    add_cloud_options(*command, *a);
    add_device(*command, a->device);
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Examples:\n"
        "  nephos render cloud.vdb --out cloud.png\n"
        "  nephos render cloud.vdb --out cloud.png --view below --sun 8,250 --exposure 1\n"
        "  nephos render houdini.vdb --up y --scale 100 --extinction 0.05 --out cloud.exr\n"
        "  nephos render out/cumulus/density/cumulus_0001.vdb --scene scenes/cumulus.toml --out cloud.png");
    command->callback([a, &action] { action = [a] { return render(*a); }; });
}

}  // namespace nephos
