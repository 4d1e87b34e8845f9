// SPDX-License-Identifier: Apache-2.0
#pragma once

// A polynomial that stands for the simulation: least squares through noisy values at points of the unit cube, with the
// variance of its own mean. Its degree, 1 to 5, is that which foretells each value best from all others (leave one out),
// among those that leave at least twice as many values as terms.

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
    Prediction at(std::span<const double> point) const;
    double noise()
        const;  // standard deviation of a value about the polynomial: of runs, and what the polynomial misses
    int degree() const;

  private:
    struct Fit;
    std::unique_ptr<Fit> fit_;
};

}  // namespace nephos
