// SPDX-License-Identifier: Apache-2.0
#pragma once

// A statistic over time: is it steady, what is its mean, and how far may that be off?
//
// The steps of a run are not independent. With rho(n) the autocorrelation at lag n, the mean over m steps varies as that
// over m / tau independent ones, tau = 1 + 2 sum of rho(n), the integrated autocorrelation time (Sokal 1997):
//
//     standard error = sd sqrt(tau / m)
//
// A mean is given only of a series that is judged to be steady or to pulse, judge() below:
//
//     1. warm-up     the cut that minimises the standard error of what is left, in batches of five
//                    (MSER-5: White, Simulation 69, 1997), at most half the series
//     2. pulsing     rho has, after its first minimum, a maximum above 0.3 (and 0.2 above that minimum): its lag is the
//                    period. All the humid air of a lattice may fire together, and all replicates in phase from their
//                    common start: they agree, and are wrong together. Cells fall out of step over many periods, and
//                    meanwhile the mean drifts with the strength of the pulses, the variance within a period. Then
//                    whole periods only, each one batch; the warm-up is two periods and twice the tau of the strengths
//                    instead, at most half the series; what is left is at least 20 periods, and 7 times the tau of
//                    the means and of the strengths of periods; the halves of both must agree
//     3. otherwise   at least 20 tau
//     4. two halves  of what is left must agree within 3 standard errors of their difference
//
// tau of a finite series is estimated too small: it is corrected (Wolff, Comput. Phys. Commun. 156, 2004). And a series that is
// prolonged until it is 20 tau long ends where tau seems small: lengths and errors take tau raised by its own standard
// error (Madras and Sokal, J. Stat. Phys. 50, 1988), those of pulses the larger of the tau of means and of strengths.
//
// What fails is not steady and has no mean: it must be prolonged.

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace nephos {

enum class Regime {
    dead,        // no cloud at the end, and none can come, or none came in the last half
    sparse,      // steady, mean below 0.01
    steady,      // steady
    pulsing,     // oscillates with a period; the mean is over whole periods
    overcast,    // steady, mean above 0.95
    not_steady,  // drifts, or is too short to tell: no mean
};

std::string_view regime_name(Regime regime);

// Returns rho(0 .. lags), rho(0) = 1; the deviations are from the mean of the series, sums over all pairs divided by the
// length of the series (the biased estimate, which is always a correlation function). All 0 but rho(0) for a constant.
std::vector<double> autocorrelation(std::span<const double> series, std::size_t lags);

// Returns tau >= 1 in steps from rho: the sum of the pairs rho(2 n) + rho(2 n + 1), which decrease and are positive for a
// reversible process, up to the first that is not positive (initial positive sequence: Geyer, Stat. Sci. 7, 1992).
double integrated_time(std::span<const double> rho);

// Returns the length of the warm-up by MSER-5, a multiple of 5, at most half the series.
std::size_t mser_5(std::span<const double> series);

struct Judgement {
    Regime regime = Regime::not_steady;
    std::size_t warm_up = 0;  // steps that were cut off
    std::size_t used = 0;     // steps that the mean is over, those right after the warm-up
    std::size_t period = 0;   // of pulsing, in steps; 0 otherwise
    double pulse = 0;         // height of the second maximum of rho; 0 without one
};

// Judges cloud cover over time, one value a step, 0..1. `can_revive` = false when the state at the end has no act and the
// field makes none. Pure.
Judgement judge(std::span<const double> cover, bool can_revive);

// A mean over time with its standard error.
struct SeriesMean {
    double mean, error;  // NaN where nothing was judged to be steady, or a value is missing
    double deviation;    // sd over time
    double
        tau;  // integrated autocorrelation time, steps; of pulsing: period over the gain in independent batches
    double effective;  // number of independent values, used / tau
};

// Returns the mean of a statistic over the part of its series that was judged. `stride` is the number of steps between its
// values, the first of them at step 0. Pure.
SeriesMean mean_over(std::span<const double> series, const Judgement& judgement, std::size_t stride = 1);

}  // namespace nephos
