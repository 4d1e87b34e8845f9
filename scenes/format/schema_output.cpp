// SPDX-License-Identifier: Apache-2.0
// The sections of the output: density, frames and pictures.

#include "render/options/sun_position.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

namespace {

constexpr Limits kLight = between(0, 1000);

template <auto... Members>
Key density_key(std::string name, std::string unit, Limits limits, std::string effect,
                std::string source = {}) {
    return key<&Scene::density, Members...>(std::move(name), std::move(unit), limits, std::move(effect),
                                            std::move(source));
}

const Section& smoothing_section() {
    constexpr Limits kReach = between(0, 16);
    static const Section section{
        "Smoothing",
        "The window in space and time over which cloud cells are averaged to a density.",
        {word<&SmoothingOptions::kernel>(
             "kernel", {"box", "tent", "gaussian"},
             "Weights in the window: all the same, falling to the edge, or bell-shaped.", "D, density"),
         key<&SmoothingOptions::i0>("i0", "cells", kReach, "Reach towards east and west; larger is softer.",
                                    "D, density"),
         key<&SmoothingOptions::j0>("j0", "cells", kReach, "Reach towards north and south.", "D, density"),
         key<&SmoothingOptions::k0>("k0", "cells", kReach, "Reach up and down.", "D, density"),
         key<&SmoothingOptions::t0>("t0", "steps", kReach,
                                    "Reach in time; larger makes clouds change more calmly.", "D, density")},
        nullptr};
    return section;
}

void finish_camera(const SectionReader& reader, void* owner) {
    const Camera& camera = static_cast<const Scene*>(owner)->render.camera;
    if (camera.position_m == camera.target_m) {
        reader.report(reader.find("target_m") != nullptr ? "target_m" : "position_m",
                      "the camera looks at the point where it stands",
                      "expected `position_m` and `target_m` to differ");
    }
    check_camera_path(reader, camera);
}

// Keys without a colour have that of the sun.
void finish_sun_path(const SectionReader& reader, const Sun& sun, std::vector<SunKey>& path) {
    if (path.empty()) return;
    if (!sun.date.empty()) {
        reader.report("path", "the sun has key frames and a date",
                      "expected either `path` or `date` and `time`");
        return;
    }
    for (std::size_t n = 0; n < path.size(); ++n) {
        const SectionReader key = reader.item("path", n);
        if (key.find("colour") == nullptr) path[n].colour = sun.colour;
        if (n == 0 || path[n].time_s > path[n - 1].time_s) continue;
        key.report("time_s",
                   key.quoted("time_s") + " is " + number_text(path[n].time_s) +
                       ", not after the key before it at " + number_text(path[n - 1].time_s),
                   "expected times that rise from key to key, in seconds");
    }
}

void finish_sun(const SectionReader& reader, void* owner) {
    auto& scene = *static_cast<Scene*>(owner);
    const Sun& sun = scene.render.sun;
    finish_sun_path(reader, sun, scene.sun_path);
    const bool with_date = !sun.date.empty(), with_time = !sun.time.empty();
    if (with_date != with_time) {
        const char* given = with_date ? "date" : "time";
        reader.report(given, reader.quoted(given) + " stands alone", "expected `date` and `time` together");
    } else if (with_date && !days_since_2000(sun.date, "00:00")) {
        reader.report("date", reader.quoted("date") + " is \"" + shortened(sun.date) + "\"",
                      "expected a day from 1900 to 2100 such as \"2026-06-21\"");
    } else if (with_date && !days_since_2000(sun.date, sun.time)) {
        reader.report("time", reader.quoted("time") + " is \"" + shortened(sun.time) + "\"",
                      "expected a universal time such as \"18:30\" or \"18:30:15\"");
    } else if (sun.moves && !with_date) {
        reader.report("moves", "the sun moves, but nothing says from where", "expected `date` and `time`");
    }
}

void finish_frames(const SectionReader& reader, void* owner) {
    const FrameOptions& frames = static_cast<const Scene*>(owner)->frames;
    if (frames.splatting == Splatting::cpu && !frames.device.empty())
        reader.report("device",
                      reader.quoted("device") + " is \"" + shortened(frames.device) +
                          "\", but the back-end cpu uses no Vulkan device",
                      "expected no `device`, or another `splatting` than \"cpu\"");
}

}  // namespace

const Section& density_section() {
    static const Section section{
        "Density",
        "How bits become density between 0 and 1, and what is written to VDB files.",
        {table<&Scene::density, &DensityOptions::smoothing>("smoothing", smoothing_section(),
                                                            smoothing_section().effect),
         density_key<&DensityOptions::extinction_per_m>(
             "extinction_per_m", "1/m", above(0, 100),
             "Extinction coefficient where the density is 1: larger makes clouds more opaque. Also in every "
             "file."),
         density_key<&DensityOptions::metaball_radius_cells>(
             "metaball_radius_cells", "cells", between(1, 8),
             "Effective radius of a metaball; larger is softer.", "D, density"),
         density_key<&DensityOptions::refine>(
             "refine", "voxels per cell", between(1, 8),
             "Voxels written per cell and axis; above 1 the field of metaballs is sampled on a finer grid.",
             "D, density"),
         density_key<&DensityOptions::half>("half", "", kAny,
                                            "Write 16-bit floats: 3 digits, half the memory in programs that "
                                            "keep them so; compressed files are about as large."),
         density_key<&DensityOptions::write_state>("write_state", "", kAny,
                                                   "Write also the bool grids `hum`, `act` and `cld`."),
         density_key<&DensityOptions::write_velocity>(
             "write_velocity", "", kAny,
             "Write also the wind as the grid `vel`, in m/s, over the whole box: in voxels twice, four "
             "times, .. as large where those would be more than 2^24."),
         written_if(
             key<&Scene::density_files, &DensityFileOptions::velocity_name>(
                 "velocity_name", "", kAny,
                 "Name of that grid: Houdini looks for `vel`, Blender for `velocity`, others for `v`."),
             [](const void* owner) {
                 return static_cast<const Scene*>(owner)->density_files.velocity_name != "vel";
             }),
         written_if(
             key<&Scene::density_files, &DensityFileOptions::per_layer>(
                 "per_layer", "", kAny, "Write a file of each layer with its own voxels."),
             [](const void* owner) { return !static_cast<const Scene*>(owner)->density_files.per_layer; }),
         written_if(
             key<&Scene::density_files, &DensityFileOptions::combined>(
                 "combined", "", kAny,
                 "Write a file of all layers together. Off: layers alone; a scene without layers has it "
                 "always."),
             [](const void* owner) { return !static_cast<const Scene*>(owner)->density_files.combined; })},
        nullptr};
    return section;
}

const Section& frames_section() {
    static const Section section{
        "Frames",
        "Which moments become density files and pictures: frame n, counted from 0, shows the simulated time "
        "`start_s` + n * `time_scale` / `per_second`, whatever the time step is.",
        {key<&Scene::frames, &FrameOptions::per_second>("per_second", "1/s", above(0, 1000),
                                                        "Frames of one second of film.", "D, density"),
         key<&Scene::frames, &FrameOptions::time_scale>(
             "time_scale", "s/s", above(0, 1e6), "Simulated seconds in one second of film: 1 is real time."),
         key<&Scene::frames, &FrameOptions::start_s>(
             "start_s", "s", between(0, 1e15),
             "Simulated time of the first frame: skips the growing of the clouds."),
         key<&Scene::frames, &FrameOptions::count>(
             "count", "", between(0, kMaxFrames),
             "Number of frames; 0: as many as the simulated time holds (none at all: `enabled` = false)."),
         written_if(
             key<&Scene::frames, &FrameOptions::enabled>(
                 "enabled", "", kAny,
                 "Make frames; false: none, whatever the other keys say, only statistics of every step."),
             [](const void* owner) { return !static_cast<const Scene*>(owner)->frames.enabled; }),
         key<&Scene::frames, &FrameOptions::png>("png", "", kAny,
                                                 "Write a tone-mapped picture of each frame."),
         key<&Scene::frames, &FrameOptions::exr>("exr", "", kAny,
                                                 "Write a linear picture of each frame with all layers."),
         key<&Scene::frames, &FrameOptions::video>("video", "", kAny,
                                                   "Write an MP4 of all frames, by the ffmpeg command."),
         written_if(
             word<&Scene::frames, &FrameOptions::splatting>(
                 "splatting", {"auto", "cpu", "vulkan", "blended"},
                 "Back-end that draws: vectors on the processor, which take no Vulkan driver; compute "
                 "shaders; D's blended billboards; `auto` is `vulkan` on a graphics card, else `cpu`. The "
                 "pictures agree within 1/255.",
                 "D, steps 0 to 2"),
             [](const void* owner) {
                 return static_cast<const Scene*>(owner)->frames.splatting != Splatting::automatic;
             }),
         written_if(
             key<&Scene::frames, &FrameOptions::device>(
                 "device", "", kAny,
                 "Vulkan device that draws: a part of its name, or its number; empty: the best one."),
             [](const void* owner) { return !static_cast<const Scene*>(owner)->frames.device.empty(); })},
        &finish_frames};
    return section;
}

const Section& camera_section() {
    constexpr Limits kPixels = between(1, 16'384);
    constexpr Limits kWorld = between(-kFarthestPlace_m, kFarthestPlace_m);
    static const Section section{
        "Camera",
        "A perspective camera; height is up in the picture.",
        {render_key<&RenderOptions::camera, &Camera::position_m>("position_m", "m", kWorld,
                                                                 "Where it stands."),
         render_key<&RenderOptions::camera, &Camera::target_m>("target_m", "m", kWorld, "What it looks at."),
         render_key<&RenderOptions::camera, &Camera::vertical_fov_deg>(
             "vertical_fov_deg", "deg", between(1, 170), "Angle from the picture's lower to its upper edge."),
         render_key<&RenderOptions::camera, &Camera::width>("width", "pixels", kPixels,
                                                            "Width of the picture."),
         render_key<&RenderOptions::camera, &Camera::height>("height", "pixels", kPixels,
                                                             "Height of the picture."),
         render_key<&RenderOptions::camera, &Camera::exposure_ev>(
             "exposure_ev", "stops", between(-30, 30), "Each stop doubles the brightness of the picture."),
         word<&Scene::render, &RenderOptions::camera, &Camera::exposure>(
             "exposure", {"manual", "automatic"},
             "`manual`: `exposure_ev`. `automatic`: by a histogram of each picture, to which `exposure_ev` "
             "is "
             "added. EXR files are not changed by it.",
             "Reinhard et al. 2002"),
         render_key<&RenderOptions::camera, &Camera::adaptation_s>(
             "adaptation_s", "s", between(0, 60),
             "Time constant with which an automatic exposure follows from frame to frame of a run, in "
             "seconds "
             "of film; 0: at once."),
         word<&Scene::render, &RenderOptions::camera, &Camera::tone_curve>(
             "tone_curve", {"exponential", "neutral"},
             "Curve from light to what a screen shows. `exponential`: each channel on its own. `neutral`: "
             "channels together, so that highlights keep their hue until they turn white.",
             "after Khronos PBR Neutral, 2024"),
         render_key<&RenderOptions::camera, &Camera::glare>(
             "glare", "", between(0, 1),
             "Light that lens and eye scatter around what is bright, relative to the human eye; a clean lens "
             "has about 0.1. Above 0 the sun's disc has its own brightness, else a bounded one.",
             "Spencer et al. 1995"),
         written_if(
             render_key<&RenderOptions::camera, &Camera::above_ground>(
                 "above_ground", "", kAny,
                 "Whether the heights of `position_m`, `target_m` and those of the path are counted from the "
                 "ground "
                 "below them (`ground.height_m`, `ground.height_map`); false: from world height 0."),
             [](const void* scene) { return static_cast<const Scene*>(scene)->render.camera.above_ground; }),
         tables<&Scene::render, &RenderOptions::camera, &Camera::path>("path", camera_path_section(), 0,
                                                                       10'000)},
        &finish_camera};
    return section;
}

const Section& sun_path_section() {
    static const Section section{
        "Sun path",
        "Where the sun stands at which simulated time, in the place of `elevation_deg`, `azimuth_deg` and "
        "`colour`: it "
        "goes evenly from key to key, the shorter way round, and stands still before the first and after the "
        "last. The "
        "editor writes such keys when the sun is moved while a scene runs.",
        {required(key<&SunKey::time_s>("time_s", "s", between(0, 1e15), "Simulated time; rises.")),
         required(key<&SunKey::elevation_deg>("elevation_deg", "deg", between(-18, 90),
                                              "Its height above the horizon then.",
                                              "T, 3.3: the light is moved anywhere")),
         required(key<&SunKey::azimuth_deg>("azimuth_deg", "deg", between(-360, 360),
                                            "Where it stands then, clockwise from north.")),
         default_is(key<&SunKey::colour>("colour", "", kLight, "Its linear colour and strength then."),
                    "that of `[sun]`")},
        nullptr};
    return section;
}

const Section& sun_section() {
    static const Section section{
        "Sun",
        "The light.",
        {render_key<&RenderOptions::sun, &Sun::elevation_deg>("elevation_deg", "deg", between(-18, 90),
                                                              "Height above the horizon."),
         render_key<&RenderOptions::sun, &Sun::azimuth_deg>("azimuth_deg", "deg", between(-360, 360),
                                                            "Where it stands, clockwise from north."),
         render_key<&RenderOptions::sun, &Sun::colour>("colour", "", kLight,
                                                       "Its linear colour and strength.", "D, step 1"),
         render_key<&RenderOptions::sun, &Sun::date>(
             "date", "", kAny,
             "Day such as \"2026-06-21\": the sun stands where it is seen from `latitude_deg` and "
             "`longitude_deg` at that `time`, whatever `elevation_deg` and `azimuth_deg` say.",
             "S; Michalsky 1988"),
         render_key<&RenderOptions::sun, &Sun::time>(
             "time", "", kAny, "Universal time such as \"18:30\" or \"18:30:15\", with `date`."),
         render_key<&RenderOptions::sun, &Sun::latitude_deg>("latitude_deg", "deg", between(-90, 90),
                                                             "Place for `date`; north is positive."),
         render_key<&RenderOptions::sun, &Sun::longitude_deg>("longitude_deg", "deg", between(-180, 180),
                                                              "Place for `date`; east is positive."),
         render_key<&RenderOptions::sun, &Sun::moves>(
             "moves", "", kAny, "Move the sun with simulated time, which begins at `date` and `time`."),
         tables<&Scene::sun_path>("path", sun_path_section(), 0, 100'000),
         render_key<&RenderOptions::shadow_map_size>(
             "shadow_map_size", "texels", between(16, 8192),
             "Side of the map of the clouds' shadow; larger is sharper.", "D, step 1")},
        &finish_sun};
    return section;
}

const Section& lightning_section() {
    constexpr Limits kWorld = between(-kFarthestPlace_m, kFarthestPlace_m);
    static const Section section{
        "Lightning",
        "Flashes that light clouds and ground from their place. A flash is brightest when it begins and "
        "fades as (1 - "
        "t / `duration_s`)^2; of several at one moment the brightest lights the picture.",
        {required(key<&LightningFlash::position_m>("position_m", "m", kWorld, "Its place.")),
         key<&LightningFlash::time_s>("time_s", "s", between(0, 1e15), "Simulated time at which it begins."),
         key<&LightningFlash::duration_s>("duration_s", "s", above(0, 1e9), "How long it lasts."),
         key<&LightningFlash::colour>("colour", "", between(0, 1), "Its linear colour."),
         key<&LightningFlash::intensity>("intensity", "", between(0, 1e6),
                                         "Light that arrives at a distance of 1 km, as a multiple of that of "
                                         "a sun of colour 1; falls off with "
                                         "the square of the distance.")},
        nullptr};
    return section;
}

const Section& debug_view_section() {
    static const Section section{
        "Debug view",
        "What clouds made of base models consist of, drawn over the picture.",
        {render_key<&RenderOptions::debug_view, &DebugView::boxes>(
             "boxes", "", kAny, "Edges of the seed boxes, blue.", "T, figure 28"),
         render_key<&RenderOptions::debug_view, &DebugView::axes>(
             "axes", "", kAny, "Axes through the centres of clouds: east red, north green, up blue.",
             "T, figure 28"),
         render_key<&RenderOptions::debug_view, &DebugView::roots>(
             "roots", "", kAny, "An arrow for each root of the base model, blue.", "T, figure 28"),
         render_key<&RenderOptions::debug_view, &DebugView::rays>(
             "rays", "", kAny,
             "Rays from the boxes to the sun, white, and red inside of boxes, where light is absorbed.",
             "T, figure 28")},
        nullptr};
    return section;
}

const Section& air_section() {
    static const Section section{
        "Air",
        "The air between cloud and eye, and the sky behind.",
        {render_key<&RenderOptions::air, &Air::extinction_per_m>(
             "extinction_per_m", "1/m", between(0, 1),
             "Extinction of the air for red, green and blue: larger veils what is far away.",
             "D, light shafts (beta)"),
         render_key<&RenderOptions::air, &Air::horizon>(
             "horizon", "", kLight, "Linear colour of the sky at the horizon, also of the veil."),
         render_key<&RenderOptions::air, &Air::zenith>("zenith", "", kLight,
                                                       "Linear colour of the sky overhead.")},
        nullptr};
    return section;
}

namespace {

void finish_ground(const SectionReader& reader, void* owner) {
    const TerrainOptions& terrain = static_cast<const Scene*>(owner)->render.terrain;
    if (terrain.height_map && terrain.relief != Relief::none)
        reader.report("relief", reader.quoted("relief") + " is given beside `height_map`",
                      "expected one of the two");
}

}  // namespace

const Section& ground_section() {
    static const Section section{
        "Ground",
        "What wears the clouds' shadow: a plane, and under the physical sky the sphere of the Earth below "
        "the eye.",
        {render_key<&RenderOptions::ground, &Ground::height_m>("height_m", "m", between(-1e5, 1e5),
                                                               "Its height."),
         render_key<&RenderOptions::ground, &Ground::albedo>(
             "albedo", "", between(0, 1), "Fraction of the light that it reflects: red, green, blue.",
             "D, step 2"),
         word<&Scene::render, &RenderOptions::ground, &Ground::pattern>(
             "pattern", {"plain", "country", "water"},
             "`plain`: `albedo` everywhere. `country`: fields, hedges and woods of noise, whose mean is "
             "`albedo`. "
             "`water`: a sea with waves (`water`), `albedo` being that below its surface, such as 0.02, "
             "0.05, 0.06. "
             "See docs/ground.md."),
         render_key<&RenderOptions::ground, &Ground::field_m>("field_m", "m", between(20, 5000),
                                                              "Size of a field of the country."),
         default_is(key<&Scene::render, &RenderOptions::terrain, &TerrainOptions::height_map>(
                        "height_map", "", kAny,
                        "File of heights that stand on the plane, north up: PNG of 16 bits of grey, raw "
                        "16-bit numbers "
                        "(`.raw`, `.r16`, little-endian) or EXR in metres. Relative to the scene's folder. "
                        "See `terrain`.",
                        "S, atmosphere"),
                    "level ground"),
         written_if(word<&Scene::render, &RenderOptions::terrain, &TerrainOptions::relief>(
                        "relief", {"none", "hills", "ridges"},
                        "Heights that are generated instead: rounded hills, or mountains with crests and "
                        "valleys that rivers "
                        "have cut. See `terrain`."),
                    [](const void* scene) {
                        return static_cast<const Scene*>(scene)->render.terrain.relief != Relief::none;
                    })},
        &finish_ground};
    return section;
}

// Sizes with a value of their own at 0.
void finish_detail(const SectionReader& reader, void* owner) {
    const DetailOptions& detail = *static_cast<const DetailOptions*>(owner);
    const auto check = [&](const char* name, double value, double least, const char* expected) {
        if (value <= 0 || value >= least) return;
        reader.report(name, reader.quoted(name) + " is " + number_text(value) + ", too small", expected);
    };
    check("size_m", detail.size_m, 20, "expected 0, or a number from 20 to 5000, in m");
    check("mean_free_path_m", detail.mean_free_path_m, 1, "expected 0, or a number from 1 to 10000, in m");
}

const Section& detail_section() {
    static const Section section{
        "Detail",
        "Detail below the voxel in pictures, their light, and files that are refined: noise erodes the edge "
        "of "
        "voxel clouds, from bumps of `size_m` down to half a metre, and keeps their mean density. Veils have "
        "only `layer.detail`. "
        "See docs/detail.md.",
        {key<&DetailOptions::enabled>("enabled", "", kAny,
                                      "Draw it. Off: the smooth field of metaballs, everywhere as far away."),
         key<&DetailOptions::strength>(
             "strength", "", between(0, 1.4),
             "Depth of the erosion; cumulus has 1, stratus a third. 0: a smooth surface with a crisp edge."),
         key<&DetailOptions::size_m>(
             "size_m", "m", between(0, 5000),
             "Size of the largest bumps, at least 20 m; each next kind has half of it. "
             "0: four cells."),
         key<&DetailOptions::stretch>("stretch", "", between(1, 50),
                                      "How much longer the bumps are along the wind: fibres."),
         key<&DetailOptions::wisps>("wisps", "", between(0, 1),
                                    "1: shreds hang below the base; 0: there are round bumps as above."),
         key<&DetailOptions::thermals>("thermals", "", between(0, 1),
                                       "Strength of towers and hollows of two and four times `size_m`, "
                                       "between the bumps and the clouds."),
         key<&DetailOptions::mean_free_path_m>(
             "mean_free_path_m", "m", between(0, 10'000),
             "Mean free path of light in cloud where half of the space is cloud; 0: three quarters of a "
             "cell, or in thin "
             "clouds that at 0.7 of the density that they have in the mean, lest they be torn. Smaller makes "
             "crisper, denser clouds of the same mass; in real cumulus it is 10 to 20 m. Even sheets want "
             "more."),
         key<&DetailOptions::to_horizon>("to_horizon", "", kAny,
                                         "Pictures: a lattice with periodic sides in x and y goes on to the "
                                         "horizon, with its shadows. Off: there is "
                                         "nothing beyond it."),
         key<&DetailOptions::apron_cells>(
             "apron_cells", "cells", between(0, 64),
             "How far from an open side cloud begins to thin out, so that no side cuts it straight.")},
        &finish_detail};
    return section;
}

const Section& level_of_detail_section() {
    static const Section section{
        "Level of detail",
        "Blocks of 2 x 2 x 2, 4 x 4 x 4 and 8 x 8 x 8 voxels that are drawn as one metaball with the same "
        "optical mass where that hardly shows.",
        {key<&Scene::render, &RenderOptions::level_of_detail, &LevelOfDetailOptions::pixels>(
            "pixels", "pixels", between(0, 1000),
            "Radius in the picture at which metaballs are drawn as one if their optical depths spread by "
            "less "
            "than 1; at n times that radius they must spread n^2 times less. Larger is faster and softer, 0: "
            "every voxel is drawn for itself.",
            "D, S: voxels far away larger, fewer metaballs")},
        nullptr};
    return section;
}

}  // namespace nephos
