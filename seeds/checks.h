// SPDX-License-Identifier: Apache-2.0
#pragma once

// Checks of user input in this module; every message names the value and the expected range.

#include <cmath>
#include <string>

#include "automaton/field.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {

[[noreturn]] inline void usage_error(const std::string& message) { throw Error(ErrorCode::usage, message); }

inline std::string text_of(double value) { return number_text(value, 6); }

// Throws Error(usage) unless min <= value <= max; also for NaN.
inline void require_in(const std::string& what, double value, double min, double max) {
    if (value >= min && value <= max) return;
    usage_error(what + " is " + text_of(value) + ", expected " + text_of(min) + ".." + text_of(max));
}

// Throws Error(usage) unless each of the probabilities is in 0..1.
inline void require_probabilities(const std::string& what, const Probabilities& p) {
    require_in(what + ": p_hum", p.hum, 0, 1);
    require_in(what + ": p_act", p.act, 0, 1);
    require_in(what + ": p_ext", p.ext, 0, 1);
}

inline void require_positive(const std::string& what, double value) {
    if (value > 0 && std::isfinite(value)) return;
    usage_error(what + " is " + text_of(value) + ", expected a number above 0");
}

// Throws Error(usage) unless lowest <= min <= max <= highest.
inline void require_range(const std::string& what, double min, double max, double lowest, double highest) {
    if (min > max)
        usage_error(what + ": the minimum " + text_of(min) + " is above the maximum " + text_of(max));
    require_in(what + ": the minimum", min, lowest, highest);
    require_in(what + ": the maximum", max, lowest, highest);
}

}  // namespace nephos
