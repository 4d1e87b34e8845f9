// SPDX-License-Identifier: Apache-2.0
#pragma once

// A polynomial that stands for the simulation: least squares through noisy values at points, with the variance of its own
// mean. Its terms are all products up to a degree, 1 to 5, of the coordinates that explain most, and the other coordinates
// themselves: of many parameters few matter to a target, and of all products there are more than runs. Degree and number of
// those coordinates are the ones that foretell each value best from all others (leave one out), among those that have at
// least twice as many values as terms. The terms are of coordinates that go from -1 to 1 over the box of the points: in a
// small box those of the whole cube would be all but equal, and their normal equations could not be solved.
//
// Values are off the polynomial by their own errors, which many values average out, and by what it misses, which they do not:
// the scatter that the errors do not explain (misfit) is part of the variance everywhere.

#include <memory>
#include <span>
#include <vector>

namespace nephos {

class Emulator {
  public:
    // `points` hold `dimensions` numbers each, one point a value; `errors` are the standard errors of the values, as many or
    // none: one that is not known counts as 0, so that all scatter is misfit. Throws Error(usage) with fewer than
    // dimensions + 3 values.
    Emulator(std::span<const double> points, std::span<const double> values, std::span<const double> errors,
             std::size_t dimensions);
    ~Emulator();
    Emulator(Emulator&&) noexcept;
    Emulator& operator=(Emulator&&) noexcept;

    struct Prediction {
        double mean, variance;  // of the mean with the misfit, not of a run
    };
    // Outside the box of the points the prediction is an extrapolation.
    Prediction at(std::span<const double> point) const;
    // Returns the variance of the mean at a point over that of a value: small among the points, large in gaps and beyond them.
    double leverage(std::span<const double> point) const;
    // Returns the standard deviation of a value about the polynomial: of runs, and what the polynomial misses.
    double noise() const;
    // Returns the standard deviation of what the polynomial misses; 0 where chance may have made it.
    double misfit() const;
    // Returns what each value is off a polynomial of the same terms through all the others.
    const std::vector<double>& left_out() const;
    int degree() const;

  private:
    struct Fit;
    std::unique_ptr<Fit> fit_;
};

}  // namespace nephos
