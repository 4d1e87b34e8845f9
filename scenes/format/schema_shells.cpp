// SPDX-License-Identifier: Apache-2.0
// The sections of the air between the clouds: shells around the eye and what is drawn with them.

#include <cmath>

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"
#include "scenes/format/text.h"

namespace nephos {

using namespace schema_build;

namespace {

void finish_shells(const SectionReader& reader, void* owner) {
    if (!reader.sound({"count", "spacing_m", "growth"})) return;
    constexpr double kFarthest_m = 1e6;
    const double reach = reach_m(static_cast<const Scene*>(owner)->render.shells);
    if (reach <= kFarthest_m) return;
    const char* name = reader.find("growth") != nullptr      ? "growth"
                       : reader.find("spacing_m") != nullptr ? "spacing_m"
                                                             : "count";
    // Rounded up: never 1000 km.
    const double unit = std::pow(10.0, std::floor(std::log10(reach)) - 3);
    reader.report(name, "the last shell ends at " + number_text(std::ceil(reach / unit) * unit) + " m",
                  "expected fewer, thinner or more slowly growing shells, which end within 1000 km");
}

}  // namespace

const Section& shells_section() {
    static const Section section{
        "Shells of air",
        "Layers around the eye that light shafts and fog are drawn with, between the clouds; without either "
        "there are none.",
        {render_key<&RenderOptions::shells, &Shells::count>(
             "count", "", between(1, 128),
             "Their number; more reach farther or sample more finely, and cost time in proportion.",
             "D, light shafts (n_s)"),
         render_key<&RenderOptions::shells, &Shells::spacing_m>(
             "spacing_m", "m", between(0.1, 1e5), "Thickness of the first shell, which begins at the eye.",
             "D, light shafts (ds)"),
         render_key<&RenderOptions::shells, &Shells::growth>(
             "growth", "", between(1, 2),
             "Thickness of each shell in those of the one before it; 1: all the same. Above 1, near air is "
             "sampled more finely than far air.",
             "D, light shafts")},
        &finish_shells};
    return section;
}

const Section& light_shafts_section() {
    static const Section section{
        "Light shafts",
        "Air in the shadow of clouds scatters less light: what stays lit stands out as shafts, up to the "
        "last shell. Clouds of voxels, clouds drawn as billboards and veils shade the air.",
        {render_key<&RenderOptions::light_shafts, &LightShafts::strength>(
             "strength", "", between(0, 1),
             "Fraction of the light that shaded air loses; 0: no shafts, 1: all of its direct sunlight.",
             "D, light shafts (I_s)"),
         render_key<&RenderOptions::light_shafts, &LightShafts::sun_share>(
             "sun_share", "", between(0, 1),
             "Fraction of the air's light that is direct sunlight, scattered once, in a direction of mean "
             "brightness; the rest comes from sky and ground and is not shaded. The physical sky knows it.",
             "D, light shafts (I_s)"),
         render_key<&RenderOptions::light_shafts, &LightShafts::g>(
             "g", "", between(-0.99, 0.99),
             "Asymmetry of the haze's phase function: above 0, shafts are strongest towards the sun. With a "
             "`sun_share` of 1 it hardly acts: all of the air's light is then sunlight, in every direction. "
             "The "
             "physical sky takes `atmosphere.haze_g` instead.",
             "S (Cornette and Shanks)")},
        nullptr};
    return section;
}

const Section& fog_section() {
    static const Section section{
        "Fog",
        "Droplets near the ground, drawn in the shells of air and lit as the clouds are, with their shadows "
        "in "
        "it. Beyond the last shell it goes on without patches.",
        {render_key<&RenderOptions::fog, &Fog::extinction_per_m>(
             "extinction_per_m", "1/m", between(0, 10),
             "Extinction at `base_m`; 0: no fog. One sees about 3.9 / extinction far: 0.004 is fog of 1 km, "
             "0.02 thick fog, 0.0008 mist.",
             "S, fog; Koschmieder 1924"),
         render_key<&RenderOptions::fog, &Fog::base_m>("base_m", "m", between(-1e5, 1e5),
                                                       "World z where it has that extinction. It is no "
                                                       "floor: below, fog thickens by the same law, and it "
                                                       "reaches down to the ground.",
                                                       "S, fog"),
         render_key<&RenderOptions::fog, &Fog::height_m>(
             "height_m", "m", between(0.1, 1e5), "Height over which it thins out to 1 / e.", "S, fog"),
         render_key<&RenderOptions::fog, &Fog::patchiness>(
             "patchiness", "", between(0, 1),
             "How much thicker and thinner than its mean it is from place to place; 0: even.",
             "S, inhomogeneous fog"),
         render_key<&RenderOptions::fog, &Fog::patch_m>(
             "patch_m", "m", between(1, 1e6),
             "Size of a patch. Where shells are thicker than half of it, patches blur.",
             "S, inhomogeneous fog"),
         render_key<&RenderOptions::fog, &Fog::velocity_m_per_s>(
             "velocity_m_per_s", "m/s", between(-1000, 1000), "Velocity at which patches drift.",
             "S, inhomogeneous fog"),
         seed_key<&Scene::render, &RenderOptions::fog, &Fog::seed>("seed", "Of the patches.")},
        nullptr};
    return section;
}

}  // namespace nephos
