// SPDX-License-Identifier: Apache-2.0
#pragma once

// The ellipsoids of the probability field over time: placed by hand or drawn at random, advected by the wind,
// faded in and out, and replaced when they left the box or died, if the scene says so.

#include <cstdint>
#include <vector>

#include "automaton/automaton.h"
#include "automaton/options.h"
#include "core/bytes.h"
#include "core/math.h"

namespace nephos {

// One ellipsoid with its origin and its displacement.
struct AirParcel {
    Ellipsoid ellipsoid;           // as born
    int scatter = -1;              // index in FieldOptions::scatters, -1 when placed by hand
    std::uint32_t index = 0;       // number within the scatter
    std::uint32_t generation = 0;  // how often it has been drawn anew
    Displacement carried;          // by the wind since birth
    std::int64_t carried_up = 0;   // cells * 2^32; only where the wind has fields
    bool operator==(const AirParcel&) const = default;
};

class AirParcels {
  public:
    // Creates the parcels at time 0. `options` must have passed check().
    explicit AirParcels(const AutomatonOptions& options);

    // Returns the ellipsoids with weight > 0 at `time_s`, at their present centres, in the order of the
    // options.
    std::vector<ActiveEllipsoid> active(const AutomatonOptions& options, double time_s) const;

    // Advects every parcel over step number `step` (the first is 0), then replaces those that left or died by its end.
    void advance(const AutomatonOptions& options, std::uint64_t step);

    void save(ByteWriter& out, const AutomatonOptions& options) const;
    void restore(ByteReader& in, const AutomatonOptions& options);

  private:
    std::vector<AirParcel> parcels_;
};

// Returns the fade weight of an ellipsoid at a time: 0 outside its life, 1 in its middle, linear in between.
double fade_weight(const Ellipsoid& ellipsoid, double time_s);

// Returns half the edges of the axis-aligned bounding box of an ellipsoid that is turned about the z axis, in
// the unit of its semi-axes.
Vec3 reach_of(const Vec3& semi_axes, const Rotation& turn);

}  // namespace nephos
