// SPDX-License-Identifier: Apache-2.0
#pragma once

// Conversion of particles to streaks: culling, size and opacity. Private to the module.
//
// A drawn particle represents W real ones, the ratio of real to drawn particles per m^3; the latter falls
// with the distance as 1 - d. Its streak has the opacity of the W cross-sections spread over it,
//
//     opacity = visibility W cross-section / (width length),    at most 0.85
//
// so that a container has the extinction of the rain in it, whatever the number of particles. Size is P's
// law: width = s0 (1 + 8 d^2) times the real one (flakes 1 + 2 d^2), with s0 >= 1 such that the opacity at
// the eye is at most about one half. Particles of a far container represent whole swarms and are larger, but
// at most two pixels wide.

#include <array>
#include <span>
#include <vector>

#include "render/image/overlay.h"
#include "render/image/picture.h"
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

// Weights of the near and the far rain of an area for an eye at a distance from its perimeter. At distance 0
// all is near: both transitions are continuous.
struct RainFractions {
    double near = 1, far = 0;  // sum 1
    double far_number = 1;     // fraction of the far particles, falling to 0 at PrecipitationOptions::reach_m
};
RainFractions rain_fractions(const PrecipitationOptions& precipitation, double outside_m);

// One container of particles in one frame.
struct ParticlePass {
    RainContainer container;
    ParticleBoxes boxes;
    bool far = false;
    double ahead_m = 0;  // far: semi-axis of its elliptic base away from the eye; across it has boxes.depth_m
    double fraction = 1;                  // factor of their opacity
    double number = 1;                    // fraction of the particles that exist
    std::vector<CurtainTerm> rain, less;  // the rain in it; the part of it that another pass draws
};

// A far container is as wide as what is seen of its area (P), rounded up and down to powers of two: boxes of particles have
// these widths, so that no particle moves, and the two fade into each other while the width changes.
struct FarWidth {
    double scale = 1;   // semi-axis across, in those away from the eye: 1, 2, 4 ...
    double weight = 1;  // of its particles; the sum over both is 1
};
// Returns the widths for a seen half width of `wide_m` and a depth; the second has no weight where the first fits.
std::array<FarWidth, 2> far_widths(double wide_m, double ahead_m);

// Returns one pass of near rain for all areas that contain the eye, and passes of near and far rain for each
// other area in view.
std::vector<ParticlePass> particle_passes(const RenderOptions& options, const CameraFrame& camera,
                                          const Weather& weather, double time_s);

// Returns the density, particles per m^3, at d = 0 .. 1 of `count` particles in boxes of a depth and height;
// particles fade in over the last fifth of their reach.
double drawn_per_m3(std::size_t count, const ParticleBoxes& boxes, double d);

// What all particles of a pass have in common.
struct PassShape {
    double size = 1;    // s0
    Vec2 ahead{1, 0};   // far: from the eye to the container, unit
    Vec3 lit_m{};       // the place whose sunlight they have
};
// Returns it for `count` particles and an eye.
PassShape pass_shape(std::size_t count, const ParticlePass& pass, const PrecipitationOptions& precipitation,
                     const Vec3& eye_m);

// Returns how fast flake i turns in its circle, rad/s.
double sway_per_s(std::size_t i);

struct StreakView {
    const RenderOptions& options;          // with the camera at the frame's time
    CameraFrame camera, opening, closing;  // in the middle, at the begin and at the end of the exposure
    const PrecipitationLight& light;
    double wind_x_m_per_s = 0, wind_y_m_per_s = 0;
    double time_s = 0;
};

// Returns the streaks of a pass inside the image, in the order of the particles for any number of threads.
std::vector<Streak> streaks_of(const Particles& particles, const ParticlePass& pass, const StreakView& view,
                               const Picture& picture);

}  // namespace nephos
