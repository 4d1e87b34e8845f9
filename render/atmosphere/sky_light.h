// SPDX-License-Identifier: Apache-2.0
#pragma once

// The physical sky of a frame: sky tables, cached and interpolated along the sun's path, and the resulting
// light on clouds and ground. Private to the module.

#include <array>
#include <cstdint>
#include <list>
#include <optional>
#include <vector>

#include "render/atmosphere/air_colours.h"
#include "render/image/picture.h"

namespace nephos {

// Radiances for the frame's sun.
struct SkyLight {
    // Layers of kSkyRows x kSkyColumns texels of four numbers (render/shading/air.glsl).
    std::vector<float> texels;
    std::uint64_t serial = 0;  // changes with the texels
    AtmosphereModel model;
    double eye_altitude_m = 0;          // above the ground, at least 0
    Rgb ground_sun{}, ground_sky{};     // of a white surface on the ground: sunlit; in sky light
    Rgb ambient_top{}, ambient_base{};  // ambient light at a cloud's top and base
    std::array<Rgb, PictureAir::kHorizons> horizon{};  // PictureAir::horizon
    Rgb disc{}, disc_fade{};            // shader::FrameUniforms::sun_disc, sun_fade
    bool has_disc = false;
};

// World heights of the lowest base and the highest top of the clouds in a frame.
struct CloudHeights {
    double base_m = 0, top_m = 0;
};

// Maps the sun's elevation to a rising coordinate and back: tables are computed at integers and interpolated
// linearly, so that the sky changes continuously with the sun. Nodes are 1/5 degree apart in twilight, where
// light changes tenfold in 2.4 degrees, 1/16 while the sun sets, up to 2 degrees by day.
double sun_node(double elevation_deg);
double elevation_of_node(double node);

// Caches sky tables over the frames of a film. Not thread-safe.
class SkyLights {
  public:
    // Returns the light of a frame; valid until the next call. The least recently used tables are dropped.
    const SkyLight& at(const RenderOptions& options, const CloudHeights& clouds);

  private:
    struct Kept {
        int node = 0;
        double eye_altitude_m = 0;
        SkyTable table;
        AirTable air;
    };
    const Kept& table(int node, double eye_altitude_m);
    void mix_tables(const RenderOptions& options, double elevation_deg);
    void mix_air(const AirTable& a, const AirTable& b, float fraction, const Rgb& sun, const Rgb& night);
    Rgb adapted_sun(const RenderOptions& options, double elevation_deg) const;

    std::optional<AirColours> atmosphere_;
    AtmosphereModel made_of_;             // `atmosphere_`
    std::list<Kept> kept_;  // most recently used first
    RenderOptions last_;    // of `light_.texels`
    SkyLight light_;
};

}  // namespace nephos
