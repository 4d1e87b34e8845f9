// SPDX-License-Identifier: Apache-2.0
#pragma once

// Makes small pictures of a cloud from above, for reports.

#include <string>

#include "automaton/lattice.h"

namespace nephos {

// Returns a grey PNG as base64: north up, at most 96 pixels a side, each the mean over a square of columns of
// 1 - exp(-n / 3), n the number of cloud cells in the column, in 16 levels. Equal bits give equal text with one version of
// libpng.
std::string thumbnail_of(const BitPlaneView& cld);

}  // namespace nephos
