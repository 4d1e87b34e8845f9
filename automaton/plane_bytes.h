// SPDX-License-Identifier: Apache-2.0
#pragma once

// Bit planes as bytes of saved states (not installed).

#include <cstddef>
#include <span>

#include "automaton/lattice.h"

namespace nephos {

// Throws Error(io) when a bit of the padding is set in the words of planes of this extent, one plane after the other:
// no saved plane has one, and no reader of planes expects it.
void require_clear_padding(std::span<const std::byte> planes, const Extent& extent);

}  // namespace nephos
