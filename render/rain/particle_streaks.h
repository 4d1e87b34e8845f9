// SPDX-License-Identifier: Apache-2.0
#pragma once

// From particles to streaks: which of them the camera sees, how large and how dense. Private to the module.
//
// A drawn particle stands for W real ones: real per m^3 by drawn per m^3, which falls with the distance as
// 1 - d. Its streak is as opaque as the W shadows spread over it,
//
//     opacity = visibility W shadow / (width length),    at most 0.85
//
// so that a container takes as much light as the rain in it, whatever the number of particles. Size is P's
// law: width = s0 (1 + 8 d^2) times the true one (flakes 1 + 2 d^2), with s0 >= 1 such that the opacity at
// the eye is at most about one half; a far container's particles stand for whole swarms and are larger for
// that, but at most two pixels wide.

#include <span>
#include <vector>

#include "render/image/picture.h"
#include "render/image/streak_overlay.h"
#include "render/options/camera.h"
#include "render/options/options.h"
#include "render/rain/drop_sizes.h"
#include "render/rain/particles.h"
#include "render/rain/precipitation.h"
#include "render/rain/precipitation_light.h"
#include "render/rain/rain_container.h"

namespace nephos {

// The rain of one area.
struct CurtainTerm {
    const RainCurtain* curtain = nullptr;
    SizeLaw law;
};

// How much near and far rain of an area there is before an eye at a distance from its perimeter. At distance
// 0 it is all near: both transitions are continuous.
struct RainShares {
    double near = 1, far = 0;  // sum 1
    double far_number = 1;     // share of the far particles, falling to 0 at PrecipitationOptions::reach_m
};
RainShares rain_shares(const PrecipitationOptions& precipitation, double outside_m);

// One container of particles in one picture.
struct ParticlePass {
    RainContainer container;
    ParticleBoxes boxes;
    bool far = false;
    double share = 1;                     // of their opacity
    double number = 1;                    // share of the particles that are there
    std::vector<CurtainTerm> rain, less;  // what rains in it; what another pass draws already
};

// Near rain of the areas that the eye is in, in one container; near and far rain of each area before it.
std::vector<ParticlePass> particle_passes(const RenderOptions& options, const CameraFrame& camera,
                                          const Weather& weather, double time_s);

// Particles per m^3 at d = 0 .. 1 of `count` in boxes of a depth and height; the drawn ones, which fade in
// over the last fifth of their reach.
double drawn_per_m3(std::size_t count, const ParticleBoxes& boxes, double d);

struct StreakView {
    const RenderOptions& options;          // with the camera of the moment
    CameraFrame camera, opening, closing;  // in the middle, at the begin and at the end of the exposure
    const PrecipitationLight& light;
    double wind_x_m_per_s = 0, wind_y_m_per_s = 0;
    double time_s = 0;
};

// The streaks of a pass that fall into the picture, in the order of the particles, for any number of threads.
std::vector<Streak> streaks_of(const Particles& particles, const ParticlePass& pass, const StreakView& view,
                               const Picture& picture);

}  // namespace nephos
