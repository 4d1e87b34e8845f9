// SPDX-License-Identifier: Apache-2.0
#pragma once

// The cellular automaton of D (docs/sources.md): growth, then extinction and birth, then advection by the
// wind, in bitwise operations on whole words of cells. Equal options give equal bits, whatever the thread
// count, SIMD width or interruption.
//
//     Automaton automaton(options);
//     automaton.step();
//     automaton.cld().get(i, j, k);
//
// One object is one simulation; different objects may run in different threads. A step uses the threads of
// the oneTBB arena that it is called in (tbb::global_control or tbb::task_arena limit them).

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "automaton/lattice.h"
#include "automaton/options.h"

namespace nephos {

// XXH3-128 of the extent and the three planes in memory order (docs/adr/0003).
struct StateHash {
    std::uint64_t high = 0, low = 0;
    std::string hex() const;  // 32 lower-case digits
    bool operator==(const StateHash&) const = default;
};

// Returns the hash of a state; its three planes have one extent.
StateHash hash_of(const Lattice& lattice);

// An ellipsoid of the field at one time, with its position and fade weight.
struct ActiveEllipsoid {
    Ellipsoid ellipsoid;  // centre_m is the present centre
    double weight = 1.0;  // fade weight, 0..1
};

class Automaton {
  public:
    // Starts from options.initial and sets `external` as by set_external_ellipsoids(); InitialState::field
    // includes them. Throws Error(usage) on bad options (see check()) or ellipsoids.
    explicit Automaton(const AutomatonOptions& options, std::vector<ActiveEllipsoid> external = {});
    // Starts from a given state; throws Error(usage) when its extent is not options.extent.
    Automaton(const AutomatonOptions& options, Lattice initial);
    ~Automaton();
    Automaton(Automaton&&) noexcept;
    Automaton& operator=(Automaton&&) noexcept;

    // Advances the state by one step of options().time_step_s. Not thread-safe on one object.
    void step();

    const AutomatonOptions& options() const;
    std::uint64_t steps() const;  // steps taken so far
    double time_s() const;        // steps() * time_step_s
    // Return the planes of the current state; the views are valid until the next non-const call.
    BitPlaneView hum() const;
    BitPlaneView act() const;
    BitPlaneView cld() const;
    StateHash hash() const;
    std::vector<ActiveEllipsoid> ellipsoids() const;  // of options().field, with weight > 0 now

    // Returns the displacement by the wind of layer k, 0..extent.z - 1, in the step that begins at `step`, in cells. The sum
    // over all steps is the way of the air; bits lie at its floor, and beyond_whole_cells() is the rest of each layer now.
    Displacement displacement_of_layer(int k, std::uint64_t step) const;
    std::span<const Displacement> beyond_whole_cells() const;

    // Sets further ellipsoids, in addition to those of options().field, for callers that control the field
    // themselves. They act from the next step until the next call, which replaces them. Not part of a
    // checkpoint. Throws Error(usage) on an ellipsoid that check() refuses or a weight outside 0..1.
    void set_external_ellipsoids(std::vector<ActiveEllipsoid> ellipsoids);

    // Serialise and restore the complete state, for checkpoint.h; restore() throws Error(io) on bytes that
    // save() did not write.
    std::vector<std::byte> save() const;
    void restore(std::span<const std::byte> bytes);

    // Returns the bytes that a simulation with these options allocates, to check before constructing one.
    static std::size_t memory_bytes(const AutomatonOptions& options);

  private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace nephos
