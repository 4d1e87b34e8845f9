// SPDX-License-Identifier: Apache-2.0
#include "apps/pipeline.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <malloc.h>

#include "automaton/bytes.h"
#include "automaton/error.h"
#include "density/smoothing.h"

namespace nephos {
namespace {

constexpr std::uint32_t kHistoryVersion = 1;

Automaton make_automaton(const Scene& scene, std::optional<Lattice> initial) {
    if (initial) return Automaton(scene.automaton, std::move(*initial));
    return Automaton(scene.automaton);
}

BitPlane copy_of(const BitPlaneView& view) {
    BitPlane plane(view.extent);
    std::copy_n(view.words, view.word_count(), plane.words().begin());
    return plane;
}

std::uint64_t steps_up_to(const Moment& moment) { return moment.step + (moment.fraction > 0 ? 1 : 0); }

// What decides whether a saved history fits: the range, and what the history holds of each state.
void put_settings(ByteWriter& writer, const Scene& scene, const PipelineRange& range) {
    writer.put(range.last_step);
    writer.put(std::int32_t(range.first_frame));
    writer.put(std::int32_t(range.last_frame));
    writer.put(std::int32_t(scene.density.smoothing.t0));
    writer.put(std::uint8_t(scene.density.write_state));
}

void append_plane(std::vector<std::byte>& bytes, const BitPlane& plane) {
    const std::span<const std::byte> words = std::as_bytes(plane.words());
    bytes.insert(bytes.end(), words.begin(), words.end());
}

BitPlane get_plane(ByteReader& reader, Extent extent) {
    BitPlane plane(extent);
    reader.get_bytes(std::as_writable_bytes(plane.words()));
    return plane;
}

}  // namespace

Moment moment_of(double time_s, double time_step_s) {
    const double steps = time_s / time_step_s;
    const double nearest = std::round(steps);
    constexpr double kTolerance = 4 * std::numeric_limits<double>::epsilon();
    if (std::abs(steps - nearest) <= kTolerance * nearest) return {std::uint64_t(nearest), 0};
    const double whole = std::floor(steps);
    return {std::uint64_t(whole), steps - whole};
}

PipelineRange full_range(const Scene& scene) { return {scene.steps, 1, frame_count(scene)}; }

PipelineRange range_of_frames(const Scene& scene, int first, int last) {
    const int count = frame_count(scene);
    last = std::min(last, count);
    if (first < 1 || last < first) {
        throw Error(ErrorCode::usage,
                    count == 0
                        ? fmt::format("the scene '{}' has no frames", scene.name)
                        : fmt::format("no such frame: the scene '{}' has frames 1 to {}", scene.name, count));
    }
    const double end_s = frame_time_s(scene.frames, last - 1);
    return {steps_up_to(moment_of(end_s, scene.automaton.time_step_s)), first, last};
}

Pipeline::Pipeline(const Scene& scene, const PipelineRange& range, std::string simulation_hash,
                   std::optional<Lattice> initial)
    : scene_(scene),
      range_(range),
      simulation_hash_(std::move(simulation_hash)),
      automaton_(make_automaton(scene, std::move(initial))),
      next_frame_(range.first_frame) {
    if (range_.last_frame >= range_.first_frame &&
        steps_up_to(moment_of_frame(range_.last_frame)) > range_.last_step) {
        throw Error(ErrorCode::usage,
                    fmt::format("frame {} shows {:g} s, but the simulation ends at {:g} s", range_.last_frame,
                                frame_time_s(scene_.frames, range_.last_frame - 1),
                                double(range_.last_step) * scene_.automaton.time_step_s));
    }
    remember();
}

Pipeline::Pipeline(const Scene& scene, const PipelineRange& range, std::string simulation_hash,
                   const Checkpoint& checkpoint)
    : scene_(scene),
      range_(range),
      simulation_hash_(std::move(simulation_hash)),
      // The lattice is about to be replaced; an empty one is the cheapest to make.
      automaton_(scene.automaton, Lattice{BitPlane(scene.automaton.extent), BitPlane(scene.automaton.extent),
                                          BitPlane(scene.automaton.extent)}) {
    if (checkpoint.simulation_hash != simulation_hash_) {
        throw Error(ErrorCode::usage, "the checkpoint belongs to another simulation");
    }
    automaton_.restore(checkpoint.automaton);
    if (automaton_.steps() != checkpoint.steps || automaton_.hash() != checkpoint.state) {
        throw Error(ErrorCode::io, "the checkpoint's state does not have the hash that it names");
    }
    restore_history(checkpoint);
}

std::uint64_t Pipeline::steps_in_all() const {
    return range_.last_step + std::uint64_t(scene_.density.smoothing.t0);
}

bool Pipeline::finished() const { return next_step_ > range_.last_step && next_frame_ > range_.last_frame; }

Moment Pipeline::moment_of_frame(int number) const {
    return moment_of(frame_time_s(scene_.frames, number - 1), scene_.automaton.time_step_s);
}

bool Pipeline::density_is_due(std::uint64_t step) const {
    return automaton_.steps() >= step + std::uint64_t(scene_.density.smoothing.t0);
}

// The lowest step whose density a result still needs.
std::uint64_t Pipeline::lowest_needed() const {
    std::uint64_t lowest = next_step_ <= range_.last_step ? next_step_ : automaton_.steps();
    if (next_frame_ <= range_.last_frame) lowest = std::min(lowest, moment_of_frame(next_frame_).step);
    return lowest;
}

void Pipeline::advance(PipelineSink& sink) {
    assert(!finished());
    const bool frames_left = next_frame_ <= range_.last_frame;
    const std::uint64_t frame_needs = frames_left ? steps_up_to(moment_of_frame(next_frame_)) : 0;
    if (frames_left && frame_needs < next_step_ && density_is_due(frame_needs)) {
        report_frame(sink);
    } else if (next_step_ <= range_.last_step && density_is_due(next_step_)) {
        report_step(sink);
    } else {
        automaton_.step();
        remember();
    }
}

void Pipeline::report_step(PipelineSink& sink) {
    const Past& state = past(next_step_);
    StepResult result;
    result.step = state.step;
    result.time_s = double(state.step) * scene_.automaton.time_step_s;
    result.statistics = state.statistics;
    result.hash = state.hash;
    result.statistics.mean_density =
        density_at_step(state.step).sum() / double(scene_.automaton.extent.cells());
    sink.step(result);
    ++next_step_;
    forget();
}

void Pipeline::report_frame(PipelineSink& sink) {
    const Moment moment = moment_of_frame(next_frame_);
    FrameResult result;
    result.number = next_frame_;
    result.time_s = frame_time_s(scene_.frames, next_frame_ - 1);
    result.density = density_at_step(moment.step);
    if (moment.fraction > 0) {
        result.density = mix(result.density, density_at_step(moment.step + 1), moment.fraction);
    }
    const Past& state = past(moment.step);
    result.step = state.step;
    result.hash = state.hash;
    if (scene_.density.write_state) {
        result.hum = state.hum.view();
        result.act = state.act.view();
        result.cld = state.cld.view();
    }
    sink.frame(result);
    ++next_frame_;
    forget();
}

void Pipeline::remember() {
    Past state;
    state.step = automaton_.steps();
    state.statistics =
        cloud_statistics(automaton_.hum(), automaton_.act(), automaton_.cld(), scene_.automaton.placement);
    state.hash = automaton_.hash();
    state.cld = copy_of(automaton_.cld());
    if (scene_.density.write_state) {
        state.hum = copy_of(automaton_.hum());
        state.act = copy_of(automaton_.act());
    }
    history_.push_back(std::move(state));
    forget();
}

void Pipeline::forget() {
    const std::uint64_t lowest = lowest_needed();
    const auto reach = std::uint64_t(scene_.density.smoothing.t0);
    while (history_.size() > 1 && history_.front().step + reach < lowest) history_.pop_front();
    std::erase_if(densities_, [&](const auto& entry) { return entry.first < lowest; });
}

const Pipeline::Past& Pipeline::past(std::uint64_t step) const {
    assert(!history_.empty() && step >= history_.front().step && step <= history_.back().step);
    return history_[std::size_t(step - history_.front().step)];
}

DensityGrid Pipeline::density_at_step(std::uint64_t step) {
    for (const auto& [at, density] : densities_) {
        if (at == step) return density;
    }
    const auto reach = std::uint64_t(scene_.density.smoothing.t0);
    std::vector<TimedPlane> planes;
    for (std::uint64_t at = step > reach ? step - reach : 0; at <= step + reach; ++at) {
        planes.push_back({past(at).cld.view(), int(std::int64_t(at) - std::int64_t(step))});
    }
    const DensityGrid density =
        smooth(planes, scene_.density.smoothing, scene_.automaton.placement, scene_.automaton.boundaries);
    densities_.emplace_back(step, density);
    return density;
}

Checkpoint Pipeline::save() {
    densities_.clear();
    // Hands the small blocks that the densities lay in back to the system; the planes below need large ones.
    ::malloc_trim(0);
    ByteWriter writer;
    writer.put(kHistoryVersion);
    put_settings(writer, scene_, range_);
    writer.put(next_step_);
    writer.put(std::int32_t(next_frame_));
    writer.put(std::uint32_t(history_.size()));
    for (const Past& state : history_) {
        writer.put(state.step);
        writer.put(state.statistics);
        writer.put(state.hash);
    }
    std::vector<std::byte> bytes = writer.take();
    // The planes at their exact size: a growing vector would hold them twice.
    const std::size_t planes = history_.size() * (scene_.density.write_state ? 3 : 1);
    bytes.reserve(bytes.size() + planes * automaton_.cld().word_count() * sizeof(std::uint64_t));
    for (const Past& state : history_) {
        append_plane(bytes, state.cld);
        if (!scene_.density.write_state) continue;
        append_plane(bytes, state.hum);
        append_plane(bytes, state.act);
    }
    return {simulation_hash_, automaton_.steps(), automaton_.hash(), automaton_.save(), std::move(bytes)};
}

void Pipeline::restore_history(const Checkpoint& checkpoint) {
    ByteReader reader(checkpoint.history);
    if (reader.get<std::uint32_t>() != kHistoryVersion) {
        throw Error(ErrorCode::io, "the checkpoint was written by another version of nephos");
    }
    ByteWriter expected;
    put_settings(expected, scene_, range_);
    const std::vector<std::byte> settings = expected.take();
    std::vector<std::byte> found(settings.size());
    reader.get_bytes(found);
    if (found != settings) {
        throw Error(ErrorCode::usage,
                    "the checkpoint belongs to a run with other frames or another smoothing window");
    }
    next_step_ = reader.get<std::uint64_t>();
    next_frame_ = reader.get<std::int32_t>();
    const auto size = reader.get<std::uint32_t>();
    for (std::uint32_t n = 0; n < size; ++n) {
        Past state;
        state.step = reader.get<std::uint64_t>();
        state.statistics = reader.get<CloudStatistics>();
        state.hash = reader.get<StateHash>();
        history_.push_back(std::move(state));
    }
    for (Past& state : history_) {
        state.cld = get_plane(reader, scene_.automaton.extent);
        if (!scene_.density.write_state) continue;
        state.hum = get_plane(reader, scene_.automaton.extent);
        state.act = get_plane(reader, scene_.automaton.extent);
    }
    // past() relies on these.
    const auto reach = std::uint64_t(scene_.density.smoothing.t0);
    const std::uint64_t lowest = lowest_needed();
    bool good = reader.rest().empty() && !history_.empty() && next_step_ <= range_.last_step + 1 &&
                next_frame_ >= range_.first_frame &&
                next_frame_ <= std::max(range_.last_frame, range_.first_frame - 1) + 1 &&
                history_.back().step == automaton_.steps() && history_.back().hash == automaton_.hash() &&
                (finished() || history_.front().step <= (lowest > reach ? lowest - reach : 0));
    for (std::size_t n = 1; good && n < history_.size(); ++n)
        good = history_[n].step == history_[n - 1].step + 1;
    if (!good) throw Error(ErrorCode::io, "the checkpoint's history is damaged");
}

}  // namespace nephos
