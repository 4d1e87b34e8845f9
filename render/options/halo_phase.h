// SPDX-License-Identifier: Apache-2.0
#pragma once

// The halo of 22 degrees: light that hexagonal prisms of ice in random orientations refract through two of their sides.
//
// Two sides that light passes in turn form a prism of 60 degrees. In the plane across the prism's axis light that falls in
// at an angle i leaves deflected by
//
//     D = i + i' - 60 degrees,    sin i' = n sin(60 degrees - r),    sin i = n sin r
//
// with a minimum of 22 degrees, at which deflections gather: the inner rim of the ring is sharp, and red, as n is smaller for
// red. Light that is inclined to the plane by h refracts as if n were sqrt(n^2 - sin^2 h) / cos h, and is deflected by
// 2 asin(cos h sin(D / 2)). The table is a histogram over i and h, weighted by the cross-section of the side and by Fresnel's
// transmittances, smoothed over the sun's disc. (Greenler 1980, Rainbows, Halos, and Glories, gives the geometry.)

#include <array>
#include <vector>

namespace nephos {

class HaloPhase {
  public:
    HaloPhase();
    // Returns the phase function for red, green and blue (680, 550, 440 nm) per steradian: its integral over the sphere is 1.
    // cos_theta as in phase_function.h. 0 within 21 degrees and beyond 50.
    std::array<double, 3> at(double cos_theta) const;

  private:
    std::array<std::vector<double>, 3> table_;  // by angle
};

}  // namespace nephos
