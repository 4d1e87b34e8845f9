// SPDX-License-Identifier: Apache-2.0
// The section of the sky and its light.

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"

namespace nephos {

using namespace schema_build;

const Section& atmosphere_section() {
    static const Section section{
        "Atmosphere",
        "The sky: two colours, or the light that molecules, haze and ozone of the Earth's air scatter for "
        "the sun where it stands; then also the light of sun and sky on clouds and ground, and the veil "
        "before what is far away.",
        {word<&Scene::render, &RenderOptions::atmosphere, &AtmosphereOptions::model>(
             "model", {"gradient", "physical"},
             "`gradient`: the colours of `air`. `physical`: `air`, `light.ambient_top` and "
             "`light.ambient_base` have no effect, and `sun.colour` is the sun's above the air.",
             "S, atmosphere; Hillaire 2020"),
         word<&Scene::render, &RenderOptions::atmosphere, &AtmosphereOptions::colours>(
             "colours", {"primaries", "spectral"},
             "`primaries`: light of 680, 550 and 440 nm is taken as red, green and blue. `spectral`: six "
             "wavelengths are integrated to sRGB, and white is the sun at 60 degrees through clear air.",
             "CIE 1931; ASTM G-173; Bruneton 2017"),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::haze>(
             "haze", "", between(0, 100),
             "Particles in the air as a multiple of clear air: whitens the horizon, widens the sun's glow, "
             "reddens a low sun. The visibility is 217 km at 1, 58 km at 12, 27 km at 30.",
             "Koschmieder 1924"),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::haze_g>(
             "haze_g", "", between(0, 0.95),
             "Asymmetry of their phase function; larger: a smaller and brighter glow around the sun.",
             "S, phase function; Cornette and Shanks 1992"),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::ozone>(
             "ozone", "", between(0, 10),
             "Ozone as a multiple of the Earth's: keeps the sky blue in twilight."),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::ambient>(
             "ambient", "", between(0, 10),
             "Light of sky and ground in clouds, as a multiple of what arrives."),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::adaptation>(
             "adaptation", "", between(0, 1),
             "How far the eye adapts to a low sun and to twilight: light is multiplied by (1 + 0.1 / "
             "illuminance of the ground)^`adaptation`, a noon sun's being 1. 0: not at all."),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::sun_disc>("sun_disc", "", kAny,
                                                                              "Draw the sun."),
         render_key<&RenderOptions::atmosphere, &AtmosphereOptions::night>(
             "night", "", between(0, 1000), "Radiance of the sky without any sun, linear colour.")},
        nullptr};
    return section;
}

}  // namespace nephos
