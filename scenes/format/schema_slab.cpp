// SPDX-License-Identifier: Apache-2.0
// The section of veils that are drawn per pixel (render/options/veil_view.h).

#include "render/options/veil_view.h"
#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"

namespace nephos {

using namespace schema_build;

namespace {

const char* const kLightSource = "S, 2.1, light";

const Section& two_samples_section() {
    constexpr Limits kFactor = between(-100, 100), kPower = between(0, 100);
    static const Section section{
        "Light by two samples",
        "Constants of `light = \"two_samples\"`: S's light of a point from the densities there and towards "
        "the sun.",
        {key<&TwoSampleLight::sun_step_m>("sun_step_m", "m", between(0.1, 1e5),
                                          "How far towards the sun the second sample lies.", kLightSource),
         key<&TwoSampleLight::shade_gain>(
             "shade_gain", "", kFactor,
             "Weight of the sun's light by the fall of density towards the sun: more, "
             "and sunlit sides stand out from shaded ones.",
             kLightSource),
         key<&TwoSampleLight::shade_offset>("shade_offset", "", kFactor,
                                            "That weight where density does not fall.", kLightSource),
         key<&TwoSampleLight::shade_power>("shade_power", "", kPower, "Exponent of it.", kLightSource),
         key<&TwoSampleLight::glow_gain>("glow_gain", "", kPower, "Brightness towards the sun.",
                                         kLightSource),
         key<&TwoSampleLight::glow_power>(
             "glow_power", "", kPower,
             "How closely that brightness is gathered about the sun; 0: everywhere the "
             "same.",
             kLightSource),
         key<&TwoSampleLight::bounce_power>("bounce_power", "", kPower,
                                            "How soon the light of the ground fades with height in the veil.",
                                            kLightSource)},
        nullptr};
    return section;
}

}  // namespace

const Section& slab_section() {
    static const Section section{
        "Veil per pixel",
        "Draws the veil of this layer as a slab over the round Earth: each pixel's ray is cut with it, and "
        "the octaves "
        "are evaluated there, down to what the pixel resolves. The layer's lattice is what files contain. "
        "Without this "
        "table the lattice is drawn, with `detail`.",
        {word<&VeilView::light>(
             "light", {"physical", "two_samples"},
             "`physical`: scattered once, and often as in a level sheet. `two_samples`: S's light, "
             "with constants of taste.",
             kLightSource),
         key<&VeilView::samples>("samples", "", between(4, 256),
                                "Steps of a ray, at most; those where the veil is dense are divided."),
         key<&VeilView::finer_octaves>(
             "finer_octaves", "", between(0, 12),
             "Octaves after those of the veil, by its `lacunarity` and `persistence`, or as the last two of a list "
             "go on, each direction by itself, where the last is finer, in none coarser, and weighs less. They "
             "may be finer than cells. In a tile those with more than 1048576 cells of noise in it are left out.",
             "S, eq. 4"),
         key<&VeilView::to_horizon>(
             "to_horizon", "", kAny,
             "Whether the veil goes on beyond its lattice, to the horizon; otherwise it fades "
             "over `margin_m` at the sides."),
         key<&VeilView::height_slope>(
             "height_slope", "", between(-100, 100),
             "The density is multiplied by `height_slope` x + `height_offset`, at least 0, "
             "with x = -1/2 at the base and 1/2 at the top.",
             "S, 2.1, g(x)"),
         key<&VeilView::height_offset>("height_offset", "", between(-100, 100), "See `height_slope`.",
                                       "S, 2.1, g(x)"),
         key<&VeilView::g>(
             "g", "", between(-0.99, 0.99),
             "Asymmetry of the phase function of `physical` (Henyey-Greenstein); above 0: forward."),
         key<&VeilView::halo>(
             "halo", "", between(0, 1),
             "Of `physical`: fraction of the ice that is hexagonal prisms. Light that they refract makes "
             "the ring of 22 degrees about the sun."),
         table<&VeilView::two_samples>("two_samples", two_samples_section(), two_samples_section().effect)},
        nullptr};
    return section;
}

}  // namespace nephos
