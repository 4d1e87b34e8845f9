// SPDX-License-Identifier: Apache-2.0
#pragma once

// What is checked of probabilities when they have been read from a file, before there is an automaton.

#include "automaton/field.h"

namespace nephos {

// Throws Error(usage) naming the file when one of its values is no probability.
void check(const ProbabilityGrid& grid);

}  // namespace nephos
