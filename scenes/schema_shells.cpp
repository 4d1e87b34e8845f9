// SPDX-License-Identifier: Apache-2.0
// The sections of the air between the clouds: shells around the eye and what is drawn with them.

#include <cmath>

#include "scenes/schema_build.h"
#include "scenes/schema_sections.h"
#include "scenes/text.h"

namespace nephos {

using namespace schema_build;

namespace {

template <auto... Members>
Key render_key(std::string name, std::string unit, Limits limits, std::string effect,
               std::string source = {}) {
    return key<&Scene::render, Members...>(std::move(name), std::move(unit), limits, std::move(effect),
                                           std::move(source));
}

void finish_shells(const SectionReader& reader, void* owner) {
    if (!reader.sound({"count", "spacing_m", "growth"})) return;
    constexpr double kFarthest_m = 1e6;
    const double reach = reach_m(static_cast<const Scene*>(owner)->render.shells);
    if (reach <= kFarthest_m) return;
    const char* name = reader.find("growth") != nullptr      ? "growth"
                       : reader.find("spacing_m") != nullptr ? "spacing_m"
                                                             : "count";
    reader.report(name, "the last shell ends at " + number_text(std::floor(reach)) + " m",
                  "expected fewer, thinner or more slowly growing shells, which end within 1000 km");
}

}  // namespace

const Section& shells_section() {
    static const Section section{
        "Shells of air",
        "Layers around the eye that light shafts are drawn with, between the clouds; without them there are "
        "none.",
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
        "last shell.",
        {render_key<&RenderOptions::light_shafts, &LightShafts::strength>(
             "strength", "", between(0, 1),
             "Share of the light that shaded air loses; 0: no shafts, 1: all of its direct sunlight.",
             "D, light shafts (I_s)"),
         render_key<&RenderOptions::light_shafts, &LightShafts::sun_share>(
             "sun_share", "", between(0, 1),
             "Share of the air's light that is direct sunlight, scattered once, in a direction of mean "
             "brightness; the rest comes from sky and ground and is not shaded. The physical sky knows it.",
             "D, light shafts (I_s)"),
         render_key<&RenderOptions::light_shafts, &LightShafts::g>(
             "g", "", between(-0.99, 0.99),
             "Asymmetry of the haze's phase function: above 0, shafts are strongest towards the sun. The "
             "physical "
             "sky takes `atmosphere.haze_g` instead.",
             "S (Cornette and Shanks)")},
        nullptr};
    return section;
}

}  // namespace nephos
