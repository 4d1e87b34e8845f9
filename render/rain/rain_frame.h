// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the rain of a picture is drawn from, on the processor (precipitation.h) and on a device
// (render/vulkan/device_rain.h). Private to the module.

#include <cstddef>
#include <optional>
#include <vector>

#include "render/image/overlay.h"
#include "render/image/picture.h"
#include "render/options/camera.h"
#include "render/options/options.h"
#include "render/rain/particle_streaks.h"
#include "render/rain/precipitation.h"
#include "render/rain/precipitation_light.h"

namespace nephos {

struct RainFrame {
    RenderOptions options;                 // with the camera at the frame's time
    CameraFrame camera, opening, closing;  // in the middle, at the begin and at the end of the exposure
    PrecipitationLight light;              // refers to the picture
    double time_s = 0;
    std::size_t particles = 0;         // in each container; 0: only shafts are drawn
    std::vector<ParticlePass> passes;  // refer to the weather's curtains
    std::vector<Streak> splashes;      // of drops on the ground (splashes.h), drawn before the particles
};

// Returns the rain of a picture and its weather, or none. Throws as check(PrecipitationOptions).
std::optional<RainFrame> rain_frame(const Picture& picture, const RenderOptions& options,
                                    const Weather& weather, double time_s);

}  // namespace nephos
