// SPDX-License-Identifier: Apache-2.0
#pragma once

// One run of a study: its steps, its series, and of each statistic the mean with its standard error.

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "statistics/cloud_sizes.h"
#include "statistics/series.h"
#include "study/sweep_plan.h"

#include "scenes/format/scene.h"

namespace nephos {

// A statistic of a run; units stand in the names.
struct StatisticInfo {
    std::string_view name, unit, definition;
};

// In the order of the tables. Those of clouds, correlation and overlap are taken of a snapshot every `clouds_every` steps.
inline constexpr std::array<StatisticInfo, 16> kStatistics{{
    {"cover", "1", "fraction of the columns with a cloud cell, seen from above"},
    {"cloud_fraction", "1", "fraction of the cells that are cloud"},
    {"act_fraction", "1", "fraction of the cells that are active"},
    {"hum_fraction", "1", "fraction of the cells that are humid"},
    {"base_mean_m", "m", "mean cloud base of the columns with cloud"},
    {"top_mean_m", "m", "mean cloud top of the columns with cloud"},
    {"edge_per_km", "km-1", "length of the cloud edge seen from above, per area: km per km2"},
    {"clouds_per_km2", "km-2", "clouds seen from above (4 neighbours), per area"},
    {"cloud_area_m2", "m2", "mean area of a cloud seen from above"},
    {"correlation_length_m", "m", "distance at which the correlation of the shadow falls to 1/e"},
    {"overlap", "1", "overlap of neighbouring levels: 1 maximum, 0 random"},
    {"lifetime_s", "s", "mean lifetime of a cloud cell, cells over deaths; without wind only"},
    {"size_exponent", "1", "t of n(a) ~ a^-t by maximum likelihood"},
    {"size_exponent_line", "1", "t of n(a) ~ a^-t by a line through half-octave bins"},
    {"fractal_dimension", "1", "D of edge ~ area^(D/2)"},
    {"pulse_period_s", "s", "period of a pulsing run"},
}};

// The name of `cover` in statistics.csv and in Python: users may give either.
inline constexpr std::string_view kCoverInFiles = "cloud_cover";

// Returns the place of a statistic in kStatistics. Throws Error(usage) that lists the names and says which was meant.
std::size_t statistic_index(std::string_view name);

// Returns whether a statistic is of snapshots, which `clouds_every` = 0 takes none of.
bool is_of_snapshots(std::string_view statistic);

// Values of every step that a run keeps, as 32-bit floats; NaN without value.
struct SeriesInfo {
    std::string_view name, standard_name, unit, definition;
};
inline constexpr std::array<SeriesInfo, 7> kSeries{{
    {"cloud_area_fraction", "cloud_area_fraction", "1", "cover"},
    {"cloud_fraction", "", "1", "fraction of the cells that are cloud"},
    {"act_fraction", "", "1", "fraction of the cells that are active"},
    {"hum_fraction", "", "1", "fraction of the cells that are humid"},
    {"cloud_base_altitude", "cloud_base_altitude", "m", "mean over the columns with cloud"},
    {"cloud_top_altitude", "cloud_top_altitude", "m", "mean over the columns with cloud"},
    {"edge_per_km", "", "km-1", "length of the cloud edge per area"},
}};

// How the values of a series come from whole numbers n = 0, 1, 2 .., by which its record stores them:
// offset + n / divisor * scale; NaN where the divisor is 0.
struct SeriesScale {
    double offset = 0, divisor = 1, scale = 1;
    int by = -1;  // not -1: the divisor of each value is n of this series, one that comes before
};

// What is known of the tracks of a run, in the order of tracks.csv; NaN without value. Of the steps that the means are over.
inline constexpr std::array<StatisticInfo, 12> kTrackColumns{{
    {"births", "1", "clouds that share no column with those of the step before"},
    {"splits", "1", "clouds that share some, and go on from none"},
    {"deaths", "1", "clouds that share no column with those of the next step"},
    {"mergers", "1", "clouds that share some, and do not go on"},
    {"entered", "1", "clouds that come in at an open side"},
    {"tracks", "1", "births and splits whose lifetimes are taken"},
    {"censored", "1", "those of them that were not seen to die"},
    {"track_lifetime_mean_s", "s", "mean lifetime (Kaplan and Meier 1958)"},
    {"track_lifetime_mean_s_se", "s", "its standard error (Greenwood), of two deaths or more"},
    {"track_lifetime_median_s", "s", "median lifetime"},
    {"track_age_longest_s", "s", "greatest age that was seen"},
    {"track_lifetime_is_restricted", "1",
     "1: a track of that age was not seen to die, and the mean is too small"},
}};

// What a finished run leaves.
struct RunResult {
    Regime regime = Regime::not_steady;
    std::uint64_t steps = 0, warm_up = 0, used = 0, period = 0;
    std::array<SeriesMean, kStatistics.size()> statistics;
    std::vector<double> profile;       // mean cloud fraction of each level; empty where not steady
    std::vector<std::uint64_t> sizes;  // clouds of each size bin over the snapshots that were used
    std::uint64_t snapshots = 0;
    std::vector<double> tracks;  // kTrackColumns; empty where clouds were not followed
    std::string state_hash;      // after the last step
    std::vector<float> series;   // kSeries one after the other, steps + 1 values each
    std::array<SeriesScale, kSeries.size()> scales;
    std::string thumbnail;       // of the last state, thumbnail.h; a sweep keeps that of the first replicate
};

// Runs the scene from its start by the rules of `options`. Throws as LayerSimulation and measured_lattice(). Calls `files_are_read` when it has read all that the scene names. The result does not depend on the number
// of threads.
RunResult run_for_statistics(const Scene& scene, const SweepOptions& options, bool with_thumbnail = true,
                             const std::function<void()>& files_are_read = {});

}  // namespace nephos
