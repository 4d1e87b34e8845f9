// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checks what a plan asks for, before its scene is read. Private to study/.

#include <cstdint>
#include <string>

#include "study/sweep_plan.h"

namespace nephos {

// Throws Error(usage), or SceneErrors with a place, where the options contradict each other, or axes overlap.
// Keys and values are canonical (axis_text.h).
void check_options(const SweepOptions& options);

// Returns the number of points, at least one too many where that is above the limit.
std::uint64_t point_count(const SweepOptions& options);

// Returns whether a design takes its points from ranges.
inline bool is_sampled(Design design) { return design != Design::grid && design != Design::list; }

// Returns the keys of an axis for messages: "a.b+a.c".
std::string joined_keys(const Axis& axis);

}  // namespace nephos
