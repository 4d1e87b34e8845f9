// SPDX-License-Identifier: Apache-2.0
#pragma once

// Everything that decides the bits of a simulation; plain data, filled by a scene or by another program.

#include <cstdint>

#include "automaton/field.h"
#include "automaton/lattice.h"
#include "automaton/wind.h"

namespace nephos {

// How the lattice starts when no state is given.
enum class InitialState {
    empty,  // all bits 0
    field,  // hum and act drawn with the field's probabilities at time 0, cld empty (D)
};

struct AutomatonOptions {
    Extent extent{256, 128, 20};
    Placement placement;
    Boundaries boundaries;
    double time_step_s = 10.0;  // simulated time of one step, > 0
    std::uint64_t seed = 1;     // any value
    InitialState initial = InitialState::field;
    FieldOptions field;
    Wind wind;
    bool operator==(const AutomatonOptions&) const = default;
};

// Every problem of `options` would make the simulation meaningless: throws Error(usage) naming the first one.
void check(const AutomatonOptions& options);

}  // namespace nephos
