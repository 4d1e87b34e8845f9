// SPDX-License-Identifier: Apache-2.0
// Rain and snow, and the camera's way.

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

namespace {

void finish_camera_key(const SectionReader& reader, void* owner) {
    const auto& key = *static_cast<const CameraKey*>(owner);
    if (key.position_m != key.target_m) return;
    reader.report("target_m", "the camera looks at the point where it stands",
                  "expected `position_m` and `target_m` to differ");
}

}  // namespace

const Section& precipitation_section() {
    static const Section section{
        "Precipitation",
        "Rain and snow below the rain areas of the layers: particles near the eye, shafts from afar.",
        {render_key<&RenderOptions::precipitation, &PrecipitationOptions::enabled>(
             "enabled", "", kAny, "Draw rain or snow in the rain areas.", "P"),
         word<&Scene::render, &RenderOptions::precipitation, &PrecipitationOptions::kind>(
             "kind", {"rain", "snow"},
             "What falls from rain areas: drops, which are drawn as streaks and wet the ground, or flakes "
             "that sway and lie. Also the ground's, with or without precipitation drawn.",
             "P; S"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::particles>(
             "particles", "", between(0, 2e6),
             "Drops or flakes in the container before the eye, always the same number; 0: shafts alone.",
             "P, level of detail"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::exposure_s>(
             "exposure_s", "s", between(0, 1),
             "Exposure of a picture: a streak is as long as a drop falls, and the camera moves, in this "
             "time.",
             "P, persistence"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::visibility>(
             "visibility", "", between(0, 1000),
             "Opacity of drops and flakes as a multiple of the true one; 1 is hard to see in a small "
             "picture."),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::intensity_scale>(
             "intensity_scale", "", between(0, 100), "Multiplies the rain of all areas."),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::wind_drift>(
             "wind_drift", "", between(0, 10),
             "Fraction of the wind that carries drops, flakes and the lower end of shafts."),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::depth_m>(
             "depth_m", "m", between(1, 1000),
             "Depth of the container of particles around the eye; deeper has fewer in the same space.",
             "P, container"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::margin_m>(
             "margin_m", "m", between(0, 100), "How far the eye moves before the container follows.",
             "P, near rain"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::reach_m>(
             "reach_m", "m", between(1, 1e5),
             "Distance from an area beyond which it is drawn without particles, by its shaft alone.",
             "P, far rain"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::edge>(
             "edge", "", between(0, 1),
             "Outer share of an area in which the rain falls off smoothly; 0 is a wall of rain.", "P"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::shafts>(
             "shafts", "", between(0, 100), "Opacity of rain shafts as a multiple of the true one; 0: none.",
             "Marshall and Palmer 1948, van de Hulst 1957"),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::shaft_texture>(
             "shaft_texture", "", between(0, 1), "Contrast of the streaks in rain shafts."),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::evaporation>(
             "evaporation", "", between(0, 1),
             "Virga: 0 lets rain reach the ground; above 0 it thins out and is gone at this share of the way "
             "up to the cloud."),
         render_key<&RenderOptions::precipitation, &PrecipitationOptions::splashes>(
             "splashes", "", between(0, 10),
             "Crowns and droplets where drops of more than 2 mm meet ground or water within 30 m of the eye, as a "
             "multiple of their true number; 0: none.",
             "S, rain; Marshall and Palmer 1948")},
        nullptr};
    return section;
}

const Section& camera_path_section() {
    constexpr Limits kWorld = between(-1e7, 1e7);
    static const Section section{
        "Camera path",
        "Where the camera is at which simulated time, in the place of `position_m` and `target_m`: it moves "
        "smoothly from key to key and stands still before the first and after the last.",
        {required(key<&CameraKey::time_s>("time_s", "s", between(0, 1e15), "Simulated time; rises.")),
         required(key<&CameraKey::position_m>("position_m", "m", kWorld, "Where it is then.")),
         required(key<&CameraKey::target_m>("target_m", "m", kWorld, "What it looks at then."))},
        &finish_camera_key};
    return section;
}

void check_camera_path(const SectionReader& reader, const Camera& camera) {
    for (std::size_t n = 1; n < camera.path.size(); ++n) {
        const double before_s = camera.path[n - 1].time_s, time_s = camera.path[n].time_s;
        if (time_s > before_s) continue;
        const Node& item = reader.find("path")->value.items[n];
        const SectionReader at{reader.document, item, indexed(reader.path + ".path", n), {}};
        at.report("time_s",
                  at.quoted("time_s") + " is " + number_text(time_s) + ", not after the key before it at " +
                      number_text(before_s),
                  "expected times that rise from key to key, in seconds");
    }
}

}  // namespace nephos
