// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace nephos {

// What falls from rain areas: onto the ground (seeds/ground_cover.h) and before the eye
// (render/precipitation.h).
enum class PrecipitationKind { rain, snow };

}  // namespace nephos
