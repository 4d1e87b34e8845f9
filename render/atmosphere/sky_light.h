// SPDX-License-Identifier: Apache-2.0
#pragma once

// The physical sky of one picture: tables, kept and mixed along the sun's path, and what follows from them
// for clouds and ground. Private to the module.

#include <cstdint>
#include <list>
#include <optional>
#include <vector>

#include "render/atmosphere/atmosphere.h"

namespace nephos {

// Everything in units of radiance for the picture's sun.
struct SkyLight {
    // Layers of kSkyRows x kSkyColumns texels of four numbers (render/shading/air.glsl).
    std::vector<float> texels;
    std::uint64_t serial = 0;  // changes when they do
    AtmosphereModel model;
    double eye_altitude_m = 0;          // above the ground, at least 0
    Rgb ground_sun{}, ground_sky{};     // of a white surface on the ground that faces the sun; in sky light
    Rgb ambient_top{}, ambient_base{};  // light that arrives at a cloud's top and base
    Rgb horizon{};                      // mean around the horizon
    Rgb disc{}, disc_fade{};            // shader::Frame::sun_disc, sun_fade
    bool has_disc = false;
};

// World heights of the lowest base and the highest top of the clouds in a picture.
struct CloudHeights {
    double base_m = 0, top_m = 0;
};

// Sun heights with tables of their own, as a rising number: tables are made at whole numbers and mixed
// linearly between them, so that the sky changes steadily with the sun. 1/5 degree apart in twilight, where
// light changes tenfold in 2.4 degrees, 1/16 while the sun sets, up to 2 degrees apart by day.
double sun_node(double elevation_deg);
double elevation_of_node(double node);

class SkyLights {
  public:
    // The light of a picture; valid until the next call. Tables that were used lately are kept.
    const SkyLight& at(const RenderOptions& options, const CloudHeights& clouds);

  private:
    struct Kept {
        int node = 0;
        double eye_altitude_m = 0;
        SkyTable table;
    };
    const SkyTable& table(int node, double eye_altitude_m);
    void mix_tables(const RenderOptions& options, double elevation_deg);
    Rgb adapted_sun(const RenderOptions& options, double elevation_deg) const;

    std::optional<Atmosphere> atmosphere_;
    std::list<Kept> kept_;  // the last used first
    RenderOptions last_;    // what `light_.texels` are for
    SkyLight light_;
};

}  // namespace nephos
