// SPDX-License-Identifier: Apache-2.0
#pragma once

// What is wrong with a plan, said where it stands in its file; of what was given otherwise, as on the command line, without
// a place. Private to study/.

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "study/sweep_plan.h"

#include "core/error.h"

namespace nephos {

// Throws SceneErrors with the place where there is one, else Error with the same text. What follows the last ": expected "
// is what was expected.
[[noreturn]] void fail_at(const SweepOptions& options, PlanPlace place, const std::string& message,
                          ErrorCode code = ErrorCode::usage);

// Returns where the n-th key of an axis stands, or its n-th value: of a range with a count the ends have places of their
// own.
PlanPlace place_of_key(const Axis& axis, std::size_t n);
PlanPlace place_of_value(const Axis& axis, std::size_t n);

// A value of an axis with which a scene is read.
struct ValueInUse {
    std::size_t axis = 0;
    PlanPlace place;
    std::string value;
};

// Calls `read`, which reads the scene with the overrides of the plan and these values of its axes. What it throws of one of
// them, gets the place of that; not of one that messages name alike, as they shorten what is long.
void read_placed(const SweepOptions& options, const std::vector<ValueInUse>& values,
                 const std::function<void()>& read);

}  // namespace nephos
