// SPDX-License-Identifier: Apache-2.0
#pragma once

// The rain of a picture as the shaders read it (render/shared/rain.h). Private to the module.

#include <cstdint>
#include <optional>
#include <vector>

#include "render/rain/particles.h"
#include "render/rain/rain_frame.h"
#include "render/shared/rain.h"

namespace nephos {

struct RainData {
    shader::RainUniforms uniforms;
    std::vector<float> bases;  // of the curtains' clouds
    std::vector<shader::RainPass> passes;
    // Streaks that the processor has made, of splashes, as rain_streaks.comp makes them; and how many there are in each
    // segment of kStreakSegment.
    std::vector<shader::vec4> splashes;
    std::vector<shader::uint> splash_counts;
    bool shafts = false;
};

// Returns the data of a picture's rain; none with more curtains than shaders know (shader::kMostCurtains).
std::optional<RainData> rain_data(const RainFrame& rain, const Weather& weather, const Picture& picture);

// Returns the particles as shaders read them.
std::vector<shader::RainParticle> rain_particles(const Particles& particles);

// Returns the colours of the bows: rainbow(), red, green, blue and 0 of each node.
std::vector<shader::vec4> bow_nodes();

}  // namespace nephos
