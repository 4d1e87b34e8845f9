// SPDX-License-Identifier: Apache-2.0
// The section on light in clouds.

#include "scenes/format/schema_build.h"
#include "scenes/format/schema_sections.h"

namespace nephos {

using namespace schema_build;

namespace {

constexpr Limits kLight = between(0, 1000);

const Section& octaves_section() {
    const std::string source = "Wrenninge, Kulla and Lundqvist 2013";
    static const Section section{
        "Octaves of scattered light",
        "Octave o has the strength `scattering`^o, is attenuated as by `extinction`^o of the cloud, and has "
        "the phase function made blunter by `asymmetry`^o; octave 0 is the light that was scattered once.",
        {key<&ScatteringOctaves::count>("count", "", between(1, 8),
                                        "Number of octaves; 1 is single scattering.", source),
         key<&ScatteringOctaves::scattering>("scattering", "", between(0, 1), "Larger is brighter.", source),
         key<&ScatteringOctaves::extinction>("extinction", "", between(0, 1),
                                             "Smaller: light reaches deeper.", source),
         key<&ScatteringOctaves::asymmetry>(
             "asymmetry", "", between(0, 1),
             "Smaller: light that was scattered often looks more alike from all sides.", source)},
        nullptr};
    return section;
}

}  // namespace

const Section& light_section() {
    static const Section section{
        "Light in clouds",
        "How clouds scatter light.",
        {render_key<&RenderOptions::light, &CloudLight::albedo>(
             "albedo", "", between(0, 1),
             "Fraction of the light that is scattered and not absorbed; below 1 the whole cloud is darker.",
             "D, step 1"),
         word<&Scene::render, &RenderOptions::light, &CloudLight::phase, &PhaseFunction::kind>(
             "phase", {"isotropic", "rayleigh", "henyey_greenstein", "cornette_shanks", "hg_draine"},
             "Phase function: which way light goes on. `hg_draine` is that of droplets of "
             "`droplet_diameter_um`, with a bright rim against the sun and a faint glory opposite.",
             "Henyey and Greenstein 1941; S; Jendersie and d'Eon 2023"),
         render_key<&RenderOptions::light, &CloudLight::phase, &PhaseFunction::g>(
             "g", "", between(-0.99, 0.99),
             "Asymmetry of `henyey_greenstein` and `cornette_shanks`: above 0 light goes forward, so the "
             "rims "
             "of clouds before the sun shine.",
             "Henyey and Greenstein 1941"),
         render_key<&RenderOptions::light, &CloudLight::phase, &PhaseFunction::droplet_diameter_um>(
             "droplet_diameter_um", "um", between(kMinDroplet_um, kMaxDroplet_um),
             "Diameter of the droplets of `hg_draine`: larger scatters more straight on. Of `bows`: twice their effective "
             "radius.",
             "Jendersie and d'Eon 2023"),
         render_key<&RenderOptions::light, &CloudLight::bows>(
             "bows", "", between(0, 1),
             "Fogbow and glory: how much of Mie's solution for droplets of `droplet_diameter_um` is in the sunlight that "
             "clouds and fog scatter once, opposite to the sun; 1 is all, 0 none. What `phase` scatters there is kept in "
             "sum.",
             "Mie 1908, after Bohren and Huffman 1983"),
         render_key<&RenderOptions::light, &CloudLight::droplet_variance>(
             "droplet_variance", "", between(kMinDropletVariance, kMaxDropletVariance),
             "Of `bows`: effective variance of the droplets' radii, a gamma distribution. Smaller: more rings, in "
             "clearer colours.",
             "Hansen and Travis 1974"),
         word<&Scene::render, &RenderOptions::light, &CloudLight::multiple>(
             "multiple", {"diffusion", "octaves"},
             "Sunlight that arrives after many scatterings. `diffusion`: in clouds with detail the diffusion equation on "
             "the lattice, elsewhere a term without direction that decays like diffusion through a slab. `octaves`: "
             "of the direct light. See docs/lighting.md.",
             "Wrenninge, Kulla and Lundqvist 2013"),
         table<&Scene::render, &RenderOptions::light, &CloudLight::octaves>("octaves", octaves_section(),
                                                                            octaves_section().effect),
         render_key<&RenderOptions::light, &CloudLight::multiple_scattering>(
             "multiple_scattering", "", between(0, 10),
             "Strength of the sunlight that arrives after many scatterings and reaches deep into a cloud; 0 "
             "is single "
             "scattering alone, with grey tops and dark bases."),
         render_key<&RenderOptions::light, &CloudLight::ambient_top>(
             "ambient_top", "", kLight, "Light of the sky that the top of a cloud scatters, linear colour."),
         render_key<&RenderOptions::light, &CloudLight::ambient_base>(
             "ambient_base", "", kLight, "The same at its base; between them by height."),
         word<&Scene::render, &RenderOptions::light, &CloudLight::lighting>(
             "lighting", {"light_pass", "cfa"},
             "How sunlight finds its way into clouds of the automaton: attenuated exponentially, or absorbed "
             "in "
             "proportion to the way through them (light absorption factor).",
             "D, step 1; T, CFA"),
         render_key<&RenderOptions::light, &CloudLight::light_distance_m>(
             "light_distance_m", "m", or_infinite(above(0, 0)),
             "Way of light in a cloud of density 1 after which it is absorbed, for `cfa` and for lightning; "
             "clouds "
             "drawn as billboards have that of their base model.",
             "T, CFA"),
         render_key<&RenderOptions::light, &CloudLight::cfa_clouds_per_frame>(
             "cfa_clouds_per_frame", "", between(0, 1e6),
             "Clouds of a layer drawn as billboards whose absorption follows a moving sun in a frame, in "
             "turn by the "
             "frame's number, so that any frame can be drawn alone; a cloud that enters has the sun of the "
             "last turn "
             "before it. 0: all.",
             "T, CFA")},
        nullptr};
    return section;
}

}  // namespace nephos
