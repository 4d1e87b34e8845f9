// SPDX-License-Identifier: Apache-2.0
#pragma once

// A veil's options at one time in the form that the kernel reads, for its lattice (veil.cpp) and for its slab
// (veil_slab.h). Not installed.

#include <vector>

#include "density/veil.h"
#include "density/veil_kernel.h"

namespace nephos {

// Returns the octaves with their thresholds, which are quantiles of the noise. Pure.
VeilPlan veil_plan(const VeilOptions& options, double time_s);

// Returns 16,384 values of q at random places, wherever the veil lies. Pure.
std::vector<float> veil_samples(const VeilPlan& plan);

// Rises smoothly from 0 at an end to 1 at `width` from it; a step if `width` is 0.
double fade_in(double from_end, double width);

}  // namespace nephos
