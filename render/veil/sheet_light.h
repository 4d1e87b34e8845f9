// SPDX-License-Identifier: Apache-2.0
#pragma once

// Diffuse light in a level sheet that scatters and does not absorb, in closed form: Eddington's approximation between
// Marshak's boundaries. t is the optical depth from the top, reduced by the asymmetry of the phase function, T that of
// the whole sheet, m the cosine of the sun's distance from the zenith, A the ground's albedo below. Light is counted as
// the radiance of a white surface: S of one that faces the sun, B of one below the open sky. From
//
//     dF/dt = pi S exp(-t/m)            what leaves the beam is diffuse: the net flux N = F + m pi S exp(-t/m) is constant
//     F     = -(4 pi / 3) dJ/dt         diffusion
//     pi J(0) + F(0) / 2 = pi B         the sky above
//     pi J(T) - F(T) / 2 = A (pi J(T) + F(T) / 2 + m pi S exp(-T/m))     the ground below
//
// follows with e = exp(-T/m)
//
//     N    = (1 - A) pi (B + S m (1 + e) / 2 + 3/4 S m^2 (1 - e)) / (1 + (1 - A) 3/4 T)
//     J(t) = B - (N - m pi S) / (2 pi) - 3 / (4 pi) N t + 3/4 m^2 S (1 - exp(-t/m))

namespace nephos {

class SheetLight {
  public:
    // `depth` = T >= 0; `sun_cosine` = m, 0.01..1; `ground_albedo` = A, 0..1.
    SheetLight(double depth, double sun_cosine, double ground_albedo);

    // Return the mean radiance J at a depth of 0..T, for S = 1 and B = 0, and for S = 0 and B = 1.
    double by_sun(double t) const;
    double by_sky(double t) const;
    // Return the light on the ground as the radiance of a white level surface, direct sunlight included, likewise. Without
    // a sheet m and 1.
    double below_by_sun() const { return below_sun_; }
    double below_by_sky() const { return below_sky_; }

  private:
    double m_ = 1, flux_sun_ = 0, flux_sky_ = 0;  // m, N / pi
    double below_sun_ = 0, below_sky_ = 0;
};

}  // namespace nephos
