// SPDX-License-Identifier: Apache-2.0
#include "study/run_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "statistics/cloud_statistics.h"
#include "statistics/tracks.h"
#include "study/measured_lattice.h"
#include "study/snapshot.h"
#include "study/thumbnail.h"
#include <fmt/format.h>

#include "core/error.h"
#include "core/wind_field.h"
#include "scenes/format/errors.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr SeriesMean kNone{kNaN, kNaN, kNaN, kNaN, kNaN};

bool has_wind(const Wind& wind) {
    for (const WindKeyframe& keyframe : wind.keyframes)
        for (const WindLevel& level : keyframe.levels)
            if (!(level.velocity == Velocity{})) return true;
    return !wind.fields.empty();
}

// Cells, columns, edges and sums of levels over columns are whole numbers. In the order of kSeries.
std::array<SeriesScale, kSeries.size()> series_scales(const Extent& extent, const Placement& placement) {
    const double cell_m = placement.cell_size_m, floor_m = placement.origin_m.z;
    const double cells = double(extent.cells()), columns = double(extent.x) * extent.y;
    constexpr int kCover = 0;
    return {{{.divisor = columns},
             {.divisor = cells},
             {.divisor = cells},
             {.divisor = cells},
             {.offset = floor_m, .scale = cell_m, .by = kCover},
             {.offset = floor_m + cell_m, .scale = cell_m, .by = kCover},
             {.scale = edge_per_km(cell_m, extent, cell_m)}}};
}

// The sizes of clouds at a step.
struct StepSizes {
    std::uint64_t step;
    CloudSizes sizes;
};

// The lattice that is measured, while all layers are stepped.
class Measurement {
  public:
    Measurement(const Scene& scene, const SweepOptions& options)
        : options_(options),
          layers_(make_layers(scene, initial_state(scene))),
          measured_(measured_lattice(scene, options.layer)),
          lattice_(automaton_options(scene, measured_)),
          activation_(largest_activation(scene)) {
        const Wind& wind = scene.layers.empty() ? scene.automaton.wind : layer_wind(scene, measured_);
        // Cells that the wind carries away, or in across an open side, would count as deaths and births.
        counts_deaths_ = !has_wind(wind);
        tracker_ = Tracker(lattice_.boundaries);
        if (options.tracks && !is_profile(automaton().options().wind.fields))
            throw Error(ErrorCode::usage, "clouds cannot be followed in a wind that differs within a level");
        size_range_ = default_size_range(lattice_.extent);
        observe();
    }

    void step() {
        if (options_.tracks) note_shifts();
        for (LayerSimulation& layer : layers_) layer.step();
        observe();
    }

    std::uint64_t steps() const { return series_[0].size() - 1; }
    Judgement judged() const { return judge(series_[0], activation_ > 0 || series_[2].back() > 0); }
    SeriesMean mean(std::size_t statistic, const Judgement& judgement) const;
    RunResult result(const Judgement& judgement) const;  // without its thumbnail
    std::string thumbnail() const { return thumbnail_of(automaton().cld()); }

  private:
    // How far the step that follows moves the bits of each level: they lie at the floor of the way of the air.
    void note_shifts() {
        const std::span<const Displacement> rest = automaton().beyond_whole_cells();
        shifts_.clear();
        for (int k = 0; k < lattice_.extent.z; ++k) {
            const Displacement by = automaton().displacement_of_layer(k, steps());
            const Displacement way{rest[std::size_t(k)].x + by.x, rest[std::size_t(k)].y + by.y};
            shifts_.push_back({way.whole_x(), way.whole_y()});
        }
    }
    std::vector<double> tracks(const Judgement& judgement) const;
    const Automaton& automaton() const { return *layers_[measured_].automaton(); }
    void observe();
    void observe_clouds(const BitPlaneView& cld, std::uint64_t step);
    SeriesMean lifetime(const Judgement& judgement) const;
    CloudSizes sizes_used(const Judgement& judgement) const;
    static bool is_used(std::uint64_t step, const Judgement& j) {
        return step >= j.warm_up && step < j.warm_up + j.used;
    }

    const SweepOptions& options_;
    Tracker tracker_;
    std::vector<CellShift> shifts_;
    std::vector<LayerSimulation> layers_;
    std::size_t measured_;
    AutomatonOptions lattice_;
    double activation_;
    bool counts_deaths_ = false;
    SizeRange size_range_;
    BitPlane before_;                            // cld of the last observed state, where deaths are counted
    std::array<std::vector<double>, 7> series_;  // kSeries
    std::array<std::vector<double>, 4>
        sampled_;                         // clouds_per_km2, cloud_area_m2, correlation_length_m, overlap
    std::uint64_t cells_before_ = 0;      // of cloud, in that state
    std::vector<double> cells_, deaths_;  // of each step
    std::vector<std::uint32_t> levels_;   // cloud cells of each level, step by step
    std::vector<StepSizes> snapshots_;
};

void Measurement::observe() {
    const BitPlaneView cld = automaton().cld();
    const CloudCounts counts = count_cloud(cld, lattice_.boundaries);
    const CloudStatistics s = cloud_statistics(counts, lattice_.placement);
    const double cells = double(lattice_.extent.cells());
    series_[0].push_back(s.cover);
    series_[1].push_back(s.mean_density);
    series_[2].push_back(double(count_cells(automaton().act())) / cells);
    series_[3].push_back(double(count_cells(automaton().hum())) / cells);
    series_[4].push_back(s.base_mean_m);
    series_[5].push_back(s.top_mean_m);
    series_[6].push_back(edge_per_km(s.perimeter_m, lattice_.extent, lattice_.placement.cell_size_m));
    for (const std::uint64_t level : counts.level_cells) levels_.push_back(std::uint32_t(level));
    if (counts_deaths_ && steps() > 0) {
        cells_.push_back(double(cells_before_));
        deaths_.push_back(double(count_deaths_and_replace(before_, cld)));
    } else {
        if (counts_deaths_) {
            before_ = BitPlane(cld.extent);
            count_deaths_and_replace(before_, cld);
        }
        cells_.push_back(0);
        deaths_.push_back(0);
    }
    cells_before_ = counts.cells;
    if (options_.tracks) tracker_.add(cld, shifts_);
    if (options_.clouds_every > 0 && steps() % std::uint64_t(options_.clouds_every) == 0)
        observe_clouds(cld, steps());
}

void Measurement::observe_clouds(const BitPlaneView& cld, std::uint64_t step) {
    Snapshot snapshot = take_snapshot(cld, lattice_.boundaries, lattice_.placement.cell_size_m, size_range_);
    for (std::size_t n = 0; n < sampled_.size(); ++n) sampled_[n].push_back(snapshot.values[n]);
    snapshots_.push_back({step, std::move(snapshot.sizes)});
}

// A ratio of sums L = cells / deaths; its error from the series of cells - L deaths, whose mean is 0 (delta method).
SeriesMean Measurement::lifetime(const Judgement& judgement) const {
    const SeriesMean cells = mean_over(cells_, judgement), deaths = mean_over(deaths_, judgement);
    if (!(deaths.mean > 0)) return kNone;
    const double ratio = cells.mean / deaths.mean, step_s = lattice_.time_step_s;
    std::vector<double> residual(cells_.size());
    for (std::size_t n = 0; n < residual.size(); ++n)
        residual[n] = (cells_[n] - ratio * deaths_[n]) / deaths.mean;
    SeriesMean result = mean_over(residual, judgement);
    result.mean = ratio * step_s;
    result.error *= step_s;
    result.deviation *= step_s;
    return result;
}

CloudSizes Measurement::sizes_used(const Judgement& judgement) const {
    CloudSizes all(size_range_);
    for (const StepSizes& snapshot : snapshots_)
        if (is_used(snapshot.step, judgement)) all.add(snapshot.sizes);
    return all;
}

SeriesMean Measurement::mean(std::size_t statistic, const Judgement& judgement) const {
    if (judgement.regime == Regime::not_steady) return kNone;
    if (statistic < series_.size()) return mean_over(series_[statistic], judgement);
    if (statistic < series_.size() + sampled_.size()) {
        const std::vector<double>& sampled = sampled_[statistic - series_.size()];
        if (sampled.empty()) return kNone;
        return mean_over(sampled, judgement, std::size_t(options_.clouds_every));
    }
    const std::string_view name = kStatistics[statistic].name;
    if (name == "lifetime_s") return counts_deaths_ ? lifetime(judgement) : kNone;
    if (name == "pulse_period_s") {
        if (judgement.regime != Regime::pulsing) return kNone;
        return {double(judgement.period) * lattice_.time_step_s, kNaN, kNaN, kNaN, kNaN};
    }
    return size_statistic(name, sizes_used(judgement));
}

std::vector<double> Measurement::tracks(const Judgement& judgement) const {
    if (judgement.regime == Regime::not_steady || judgement.used == 0)
        return std::vector<double>(kTrackColumns.size(), kNaN);
    const TrackStatistics s =
        track_statistics(tracker_.tracks(), judgement.warm_up, judgement.warm_up + judgement.used - 1);
    const double step_s = lattice_.time_step_s;
    return {double(s.births),
            double(s.splits),
            double(s.deaths),
            double(s.mergers),
            double(s.entered),
            double(s.tracks),
            double(s.censored),
            s.mean * step_s,
            s.mean_error * step_s,
            s.median * step_s,
            s.tracks > 0 ? double(s.longest) * step_s : kNaN,
            s.tracks > 0 ? double(s.restricted) : kNaN};
}

RunResult Measurement::result(const Judgement& judgement) const {
    RunResult result;
    result.regime = judgement.regime;
    result.steps = steps();
    result.warm_up = judgement.warm_up;
    result.used = judgement.used;
    result.period = judgement.period;
    for (std::size_t n = 0; n < kStatistics.size(); ++n) result.statistics[n] = mean(n, judgement);
    const std::size_t nz = std::size_t(lattice_.extent.z);
    if (judgement.regime != Regime::not_steady && judgement.used > 0) {
        const double columns = double(lattice_.extent.x) * lattice_.extent.y;
        result.profile.assign(nz, 0.0);
        for (std::size_t step = judgement.warm_up; step < judgement.warm_up + judgement.used; ++step)
            for (std::size_t k = 0; k < nz; ++k) result.profile[k] += levels_[step * nz + k];
        for (double& level : result.profile) level /= columns * double(judgement.used);
    }
    const CloudSizes sizes = sizes_used(judgement);
    int last = kSizeBins;
    while (last > 0 && sizes.count(last - 1) == 0) --last;
    for (int bin = 0; bin < last; ++bin) result.sizes.push_back(sizes.count(bin));
    for (const StepSizes& snapshot : snapshots_) result.snapshots += is_used(snapshot.step, judgement);
    if (options_.tracks) result.tracks = tracks(judgement);
    result.state_hash = combined_hash(layers_).hex();
    for (const std::vector<double>& series : series_)
        for (const double value : series) result.series.push_back(float(value));
    result.scales = series_scales(lattice_.extent, lattice_.placement);
    return result;
}

}  // namespace

std::size_t statistic_index(std::string_view name) {
    std::vector<std::string_view> names;
    if (name == kCoverInFiles) name = "cover";
    for (std::size_t n = 0; n < kStatistics.size(); ++n) {
        if (kStatistics[n].name == name) return n;
        names.push_back(kStatistics[n].name);
    }
    const std::string_view closest = closest_word(name, names);
    throw Error(ErrorCode::usage,
                fmt::format("'{}' is not a statistic{}: expected one of {}", name,
                            closest.empty() ? "" : fmt::format(" (did you mean `{}`?)", closest),
                            fmt::join(names, ", ")));
}

bool is_of_snapshots(std::string_view statistic) {
    constexpr std::string_view kNames[] = {"clouds_per_km2",   "cloud_area_m2", "correlation_length_m",
                                           "overlap",          "size_exponent", "size_exponent_line",
                                           "fractal_dimension"};
    return std::ranges::count(kNames, statistic) > 0;
}

RunResult run_for_statistics(const Scene& scene, const SweepOptions& options, bool with_thumbnail,
                             const std::function<void()>& files_are_read) {
    const StepRules& rules = options.steps;
    Measurement measurement(scene, options);
    if (files_are_read) files_are_read();
    std::uint64_t steps = rules.min;
    const auto is_exact = [&](const Judgement& judgement) {
        if (judgement.regime == Regime::not_steady) return false;
        if (!rules.until || judgement.regime == Regime::dead) return true;
        return measurement.mean(statistic_index(rules.until->statistic), judgement).error <=
               rules.until->standard_error;
    };
    while (true) {
        while (measurement.steps() < steps) measurement.step();
        const Judgement judgement = measurement.judged();
        if (steps >= rules.max || is_exact(judgement)) {
            RunResult result = measurement.result(judgement);
            if (with_thumbnail) result.thumbnail = measurement.thumbnail();
            return result;
        }
        steps = std::min(rules.max, steps + steps / 2);
    }
}

}  // namespace nephos
