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
#include "density/vdb/vdb_file.h"
#include "render/image/image_file.h"
#include "simulation/volume_picture.h"

namespace nephos {
namespace {

constexpr double kFar_m = 1e9;

struct RenderArguments {
    std::string file;
    std::vector<std::string> out;
    VdbReadOptions read;
    SceneArguments scene;
    VolumePictureOptions picture;
    DeviceArguments device;
    WorkArguments work;
};

std::string extension_of(const std::string& path) {
    std::string extension = std::filesystem::path(path).extension().string();
    for (char& c : extension) c = char(std::tolower(static_cast<unsigned char>(c)));
    return extension;
}

// An option of one number in min..max.
struct RealOption {
    const char *name, *type, *text;
    double min, max;
};
void add_real(CLI::App& command, const char* group, std::optional<double>& target, const RealOption& option) {
    add_value(command, option.name, option.type, option.text,
              [&target, min = option.min, max = option.max](const std::string& value) {
                  target = parse_real(value, min, max);
              })
        ->group(group);
}

void add_picture_options(CLI::App& command, RenderArguments& a) {
    const char* group = "Picture";
    command
        .add_option("--scene", a.scene.file,
                    "Draw as a frame of a scene at the file's time: its camera, sun, air, ground, rain and "
                    "extinction")
        ->type_name("SCENE")
        ->group(group);
    command.add_option("--set", a.scene.overrides, "Change a key of that scene; may be repeated")
        ->type_name("KEY=VALUE")
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->needs(command.get_option("--scene"))
        ->group(group);
    add_value(command, "--size", "WxH", "Width and height in pixels (default: 1280x720)",
              [&](const std::string& text) { a.picture.size = parse_size(text); })
        ->group(group);
    add_value(command, "--view", "VIEW",
              "Where to look from: side, below or above (default: side, or the scene's camera)",
              [&](const std::string& text) {
                  if (text != "side" && text != "below" && text != "above") {
                      throw Error(ErrorCode::usage,
                                  fmt::format("'{}' is not one of side, below and above", text));
                  }
                  a.picture.view = text == "side" ? View::side : text == "below" ? View::below : View::above;
              })
        ->group(group);
    add_value(command, "--camera", "X,Y,Z", "Position of the eye in metres, instead of that of --view",
              [&](const std::string& text) { a.picture.camera_m = parse_point(text, -kFar_m, kFar_m); })
        ->group(group);
    add_value(command, "--target", "X,Y,Z", "Point to look at in metres (default: middle of the cloud)",
              [&](const std::string& text) { a.picture.target_m = parse_point(text, -kFar_m, kFar_m); })
        ->group(group);
    add_real(command, group, a.picture.fov_deg,
             {"--fov", "DEG", "Vertical field of view, 1 to 170 degrees (default: 50)", 1, 170});
    add_real(command, group, a.picture.exposure_ev,
             {"--exposure", "EV", "Stops by which the PNG is brighter, -20 to 20 (default: 0)", -20, 20});
    add_value(command, "--sun", "ELEV,AZIM",
              "Where the sun stands: degrees above the horizon (-18 to 90), and clockwise from north "
              "(default: 40,135)",
              [&](const std::string& text) {
                  const std::vector<double> sun = parse_reals(text, 2, -360, 360);
                  if (sun[0] < -18 || sun[0] > 90) {
                      throw Error(ErrorCode::usage,
                                  fmt::format("'{}': the elevation is not from -18 to 90", text));
                  }
                  a.picture.sun_deg = {sun[0], sun[1]};
              })
        ->group(group);
}

void add_cloud_options(CLI::App& command, RenderArguments& a) {
    const char* group = "Cloud";
    command.add_option("--grid", a.read.grid, "Grid to draw (default: density, else the first float grid)")
        ->type_name("NAME")
        ->group(group);
    add_real(
        command, group, a.picture.extinction_per_m,
        {"--extinction", "PER_M",
         "Extinction per metre at density 1 (default: what the file says, else chosen so that the cloud is "
         "visible)",
         0, 1e9});
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
    add_real(
        command, group, a.picture.albedo,
        {"--albedo", "A", "Part of the light that is scattered and not absorbed, 0 to 1 (default: 1)", 0, 1});
    add_real(command, group, a.picture.g,
             {"--g", "G", "Forward scattering of light, -0.99 to 0.99 (default: 0.5)", -0.99, 0.99});
}

void check_outputs(const RenderArguments& a) {
    for (const std::string& out : a.out) {
        refuse_to_replace(a.file, out);
        if (extension_of(out) == ".png" || extension_of(out) == ".exr") continue;
        throw Error(ErrorCode::usage, fmt::format("--out '{}' does not end with .png or .exr", out));
    }
}

void write_pictures(const RenderArguments& a, const VolumePicture& drawn) {
    for (const std::string& out : a.out) {
        if (extension_of(out) == ".exr") {
            write_exr(out, drawn.picture, drawn.options, drawn.metadata);
        } else {
            write_png(out, drawn.picture, drawn.options, drawn.metadata);
        }
    }
}

void report(const RenderArguments& a, const LoadedDensity& loaded, const VolumePicture& drawn) {
    if (drawn.extinction_was_guessed && !a.work.quiet) {
        print_note(
            fmt::format("{}: names no extinction; {:.4g} per metre at density 1 is taken, so that the "
                        "cloud is visible (--extinction changes it)",
                        a.file, drawn.extinction_per_m));
    }
    Output output;
    if (!a.work.json) {
        for (const std::string& out : a.out) output.line(out);
        return;
    }
    const Camera& camera = drawn.options.camera;
    const Vec3 &eye = camera.position_m, &target = camera.target_m;
    const nlohmann::ordered_json json = {{"files", a.out},
                                         {"width", camera.width},
                                         {"height", camera.height},
                                         {"camera_m", {eye.x, eye.y, eye.z}},
                                         {"target_m", {target.x, target.y, target.z}},
                                         {"grid", loaded.grid_name},
                                         {"metaballs", drawn.metaballs},
                                         {"metaball_radius_voxels", drawn.metaball_radius_voxels},
                                         {"extinction_per_m", drawn.extinction_per_m},
                                         {"backend", drawn.backend},
                                         {"device", drawn.device}};
    output.line(json_text(json));
}

int render(const RenderArguments& a) {
    check_outputs(a);
    start_threads(a.work.threads);
    std::optional<Scene> scene;
    if (!a.scene.file.empty()) scene = load_scene(a.scene);
    for (const std::string& out : a.out) {
        refuse_to_replace(a.scene.file, out);
        if (scene) refuse_to_replace_files_of(*scene, out);
        refuse_to_replace_listed_file(out);
    }
    const LoadedDensity loaded = load_density(a.file, a.read);
    constexpr double kLargestCell_m = 1e9;  // as of --scale; rays take a time that grows with it
    if (const double cell_m = loaded.density.placement().cell_size_m; cell_m > kLargestCell_m)
        throw Error(ErrorCode::usage,
                    fmt::format("{}: its voxels have an edge of {:g} m: expected at most {:g} m, as with "
                                "a smaller --scale",
                                a.file, cell_m, kLargestCell_m));
    if (!a.work.quiet) {
        for (const std::string& note : loaded.notes) print_note(a.file + ": " + note);
    }
    VolumePictureOptions options = a.picture;
    options.depth =
        std::ranges::any_of(a.out, [](const std::string& out) { return extension_of(out) == ".exr"; });
    const VolumePicture drawn = draw_volume(a.file, loaded, scene, options,
                                            device_options(a.device, scene ? scene->frames : FrameOptions{}));
    write_pictures(a, drawn);
    report(a, loaded, drawn);
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
