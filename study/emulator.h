// SPDX-License-Identifier: Apache-2.0
#pragma once

// A polynomial that stands for the simulation: least squares through noisy values at points, with the variance of its own
// mean. Its degree, 1 to 5, is that which foretells each value best from all others (leave one out), among those that have
// at least twice as many values as terms. Its terms are of coordinates that go from -1 to 1 over the box of the points: in
// a small box those of the whole cube would be all but equal, and their normal equations could not be solved.

#include <memory>
#include <span>
#include <vector>

namespace nephos {

class Emulator {
  public:
    // `points` hold `dimensions` numbers each, one point a value. Throws Error(usage) with fewer than dimensions + 3 values.
    Emulator(std::span<const double> points, std::span<const double> values, std::size_t dimensions);
    ~Emulator();
    Emulator(Emulator&&) noexcept;
    Emulator& operator=(Emulator&&) noexcept;

    struct Prediction {
        double mean, variance;  // of the mean, not of a run
    };
    // Outside the box of the points the prediction is an extrapolation.
    Prediction at(std::span<const double> point) const;
    // Returns the variance of the mean at a point over that of a value: small among the points, large in gaps and beyond them.
    double leverage(std::span<const double> point) const;
    // Returns the standard deviation of a value about the polynomial: of runs, and what the polynomial misses.
    double noise() const;
    // Returns what each value is off a polynomial of the same degree through all the others.
    const std::vector<double>& left_out() const;
    int degree() const;

  private:
    struct Fit;
    std::unique_ptr<Fit> fit_;
};

}  // namespace nephos
