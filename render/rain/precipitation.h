// SPDX-License-Identifier: Apache-2.0
#pragma once

// Rain and snow in a finished picture (P, S): shafts below distant clouds (rain_shafts.h), and particles near
// the eye as streaks or flakes (particles.h, overlay.h). What is drawn is a function of options,
// weather and time alone, and lies over the picture by its depth and transmittance, far rain behind nearer clouds. The
// back-end `vulkan` draws it on the device (render/vulkan/device_rain.h), the others with PrecipitationPainter.
//
// An area that contains the eye has its particles around the eye. When the eye leaves it they stay at the
// perimeter and fade with the distance, while the larger particles of far rain appear between ground and
// cloud; their number falls with the distance until the shaft alone remains. All of that is continuous in the
// position of the eye, and particles are fixed in the air: nothing pops.

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "render/image/picture.h"
#include "render/options/options.h"
#include "render/rain/particles.h"
#include "render/rain/rain_container.h"

namespace nephos {

// The surface of the ground at a place of the world.
struct GroundSurface {
    double z_m = 0;
    double slope_x = 0, slope_y = 0;  // dz/dx and dz/dy
};

// The rain at the time of a frame.
struct Weather {
    std::uint64_t seed = 0;
    std::vector<RainCurtain> curtains;
    double wind_x_m_per_s = 0, wind_y_m_per_s = 0;  // near the ground, times PrecipitationOptions::wind_drift
    double carried_x_m = 0, carried_y_m = 0;        // displacement of the air since time 0, likewise
    // Ground that is not level, at x and y of the world; thread-safe. Null: it is level, or not known.
    std::function<GroundSurface(double, double)> relief{};
};

// The rain of one picture.
struct Rainfall {
    RenderOptions options;  // know the camera's path
    Weather weather;
    double time_s = 0;
};

// Draws precipitation; caches the particles from frame to frame. Not thread-safe.
class PrecipitationPainter {
  public:
    // Composites into the beauty layer if options.precipitation.enabled, else does nothing. The picture must
    // be that of options.camera at the time (camera_at()), with its depth. Throws as check(RenderOptions).
    void draw(Picture& picture, const RenderOptions& options, const Weather& weather, double time_s);

    // Returns the number of streaks of the last draw().
    std::size_t streaks() const { return streaks_; }

  private:
    const Particles& particles(PrecipitationKind kind, std::uint64_t seed, std::size_t count);

    // Cached from frame to frame.
    std::optional<Particles> particles_;
    std::uint64_t seed_ = 0;
    std::size_t streaks_ = 0;
};

}  // namespace nephos
