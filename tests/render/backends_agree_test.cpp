// SPDX-License-Identifier: Apache-2.0
// Each way of drawing metaballs against the blended reference.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "render/renderer.h"
#include "tests/render/picture_checks.h"
#include "tests/render/reference_render.h"
#include "tests/render/renderer_views.h"

namespace nephos {
namespace {

class BackendsAgree : public test::AllBackends {};

// Each way against the reference: the same picture within 1/255, from everywhere and at every thickness.
TEST_P(BackendsAgree, AgreesWithBillboards) {
    Renderer reference_renderer(test::validated(Splatting::blended));
    float beauty = 0, transmittance = 0;
    std::size_t depths = 0, pixels = 0;
    for (const test::View& each : test::views()) {
        const double radius = test::smallest_radius_m(each.options.camera);
        const std::vector<Metaball> balls =
            reference::random_metaballs(7, 400, radius, std::max(200.0, 1.5 * radius));
        for (const double extinction : {0.0005, 0.01, 0.1}) {
            const MetaballCloud cloud{balls, extinction, 0.7};
            const Picture fast = renderer_.draw(cloud, each.options);
            const Picture slow = reference_renderer.draw(cloud, each.options);
            pixels += slow.pixels();
            EXPECT_LE(test::largest_difference(fast.shadow, slow.shadow), 1e-4f) << each.name;
            EXPECT_LE(test::largest_difference(fast.light, slow.light), 1e-4f) << each.name;
            beauty = std::max(beauty, test::largest_difference(fast.beauty, slow.beauty));
            transmittance =
                std::max(transmittance, test::largest_difference(fast.transmittance, slow.transmittance));
            EXPECT_LE(beauty, 1.0f / 255.0f) << each.name << ", extinction " << extinction;
            EXPECT_LE(transmittance, 1.0f / 255.0f) << each.name << ", extinction " << extinction;
            depths += test::expect_same_depths(fast, slow, 0.01f, 0.005f);
        }
    }
    std::printf("against billboards: beauty %.5f, transmittance %.5f, %zu depths of %zu pixels\n",
                double(beauty), double(transmittance), depths, pixels);
    EXPECT_GT(depths, pixels / 4);
    test::expect_no_messages(reference_renderer);
}

struct NamedLight {
    std::string name;
    CloudLight light;
};

std::vector<NamedLight> every_light() {
    std::vector<NamedLight> all;
    for (const Phase kind : {Phase::isotropic, Phase::rayleigh, Phase::henyey_greenstein,
                             Phase::cornette_shanks, Phase::hg_draine}) {
        CloudLight light;
        light.phase = {kind, 0.8, 12};
        for (const MultipleScattering multiple :
             {MultipleScattering::diffusion, MultipleScattering::octaves}) {
            light.multiple = multiple;
            all.push_back(
                {"phase " + std::to_string(int(kind)) + ", multiple " + std::to_string(int(multiple)),
                 light});
        }
    }
    all.back().light.octaves = {8, 0.8, 0.3, 0.7};
    all.push_back({"absorbed", {}});
    all.back().light.lighting = Lighting::cfa;
    all.push_back({"fogbow", {}});
    all.back().light.phase = {Phase::hg_draine, 0, 12};
    all.back().light.bows = 1;
    return all;
}

// Each way against the reference, for every phase function and kind of multiple scattering, before the sun
// and with the sun behind, and lit by lightning. Before the sun radiances are above 1: there the difference
// is relative, and the aureole of droplets is outside of the picture: there an opacity of 0.0005 shows.
TEST_P(BackendsAgree, AgreesWithBillboardsInEveryLight) {
    Renderer reference_renderer(test::validated(Splatting::blended));
    const std::vector<Metaball> balls = reference::random_metaballs(9, 300);
    Splats splats;
    splats.metaballs = {balls, 0.01, 0.7};
    splats.flash = Flash{{300, 200, 1200}, {0.75, 0.8, 1.0}, 0.5};
    for (const auto& [name, light] : every_light()) {
        for (const double azimuth : {0.0, 160.0}) {
            RenderOptions options = test::view({0, -4000, 800}, {0, 0, 1000}, 40, 90, 60);
            options.sun.azimuth_deg = azimuth;
            options.sun.elevation_deg = 30;
            options.light = light;
            const Picture fast = renderer_.draw_splats(splats, options);
            const Picture slow = reference_renderer.draw_splats(splats, options);
            float worst = 0, brightest = 0;
            for (std::size_t i = 0; i < fast.beauty.size(); ++i) {
                const float scale = std::max(1.0f, slow.beauty[i]);
                worst = std::max(worst, std::abs(fast.beauty[i] - slow.beauty[i]) / scale);
                brightest = std::max(brightest, slow.beauty[i]);
            }
            EXPECT_LE(worst, 1.0f / 255.0f) << name << ", sun in " << azimuth;
            EXPECT_GT(brightest, 0.3f) << name;
        }
    }
    test::expect_no_messages(reference_renderer);
}

// A broken veil between two clouds, whose pixels are the same in each way: the near cloud hides the veil, the veil hides
// the far one as far as it is opaque.
TEST_P(BackendsAgree, AgreesAboutVeilsBetweenClouds) {
    Renderer reference_renderer(test::validated(Splatting::blended));
    const std::vector<Metaball> balls{{-300, 2000, 1500, 700, 1}, {700, 9000, 7600, 2500, 1}};
    Splats both, near;
    both.metaballs = {balls, 0.05, 0.7};
    near.metaballs = {std::span(balls).first(1), 0.05, 0.7};
    VeilOptions veil;
    veil.form = VeilForm::stratus;
    veil.coverage = 0.5;
    veil.wavelength_m = 900;
    veil.base_m = 3000;
    veil.top_m = 3600;
    for (const VeilLighting light : {VeilLighting::physical, VeilLighting::two_samples}) {
        VeilView view;
        view.light = light;
        const std::vector<DrawnVeil> veils{
            {std::make_shared<VeilSlab>(veil, Wind{}, 0, 2, std::nullopt), 0.02, view}};
        const RenderOptions options = test::view({0, 0, 100}, {0, 2000, 1700}, 40, 90, 60);
        const Picture ours = renderer_.draw_splats(both, options, veils),
                      other = reference_renderer.draw_splats(both, options, veils);
        EXPECT_LE(test::largest_difference(ours.beauty, other.beauty), 2.0f / 255);
        EXPECT_LE(test::largest_difference(ours.transmittance, other.transmittance), 2.0f / 255);
        const Picture clear = renderer_.draw_splats(both, options),
                      sheet = renderer_.draw_splats({}, options, veils),
                      first = renderer_.draw_splats(near, options);
        std::size_t hidden = 0, hiding = 0, between = 0;
        for (std::size_t n = 0; n < ours.pixels(); ++n) {
            const float change = std::abs(ours.beauty[3 * n + 1] - clear.beauty[3 * n + 1]);
            if (first.transmittance[n] < 0.002f) {  // the near cloud: nothing of the veil
                ++hidden;
                EXPECT_LT(change, 0.02f) << n;
            } else if (first.transmittance[n] == 1 && clear.transmittance[n] < 0.5f) {
                const float left = sheet.transmittance[n];
                EXPECT_NEAR(ours.transmittance[n], left * clear.transmittance[n], 1e-3f) << n;
                if (left < 0.01f) {
                    ++hiding;
                    EXPECT_NEAR(ours.beauty[3 * n + 1], sheet.beauty[3 * n + 1],
                                0.05f * sheet.beauty[3 * n + 1])
                        << n;
                } else if (left < 0.9f) {
                    ++between;
                }
            }
        }
        EXPECT_GT(hidden, 50u);
        EXPECT_GT(hiding, 20u);
        EXPECT_GT(between, 50u);
    }
    test::expect_no_messages(reference_renderer);
}

INSTANTIATE_TEST_SUITE_P(Backends, BackendsAgree, ::testing::Values(Splatting::cpu, Splatting::vulkan),
                         test::way_name);

}  // namespace
}  // namespace nephos
