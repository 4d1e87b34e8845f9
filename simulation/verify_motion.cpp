// SPDX-License-Identifier: Apache-2.0
#include "simulation/verify_motion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "simulation/scene_place.h"

namespace nephos {
namespace {

// Voxels that are compared one by one: as floats they take 1 GiB. Boxes between layers that lie far apart have many, and
// hardly any with cloud.
constexpr std::size_t kMostCompared = std::size_t(1) << 28;

// Sums and maxima in so many lanes that the compiler makes vectors of them, as their order is fixed.
constexpr std::size_t kLanes = 16;

// The sum of the differences between neighbours along x.
double sum_of_gradients(const std::vector<float>& values, std::size_t nx) {
    double total = 0;
    for (std::size_t row = 0; row < values.size(); row += nx) {
        const float* v = values.data() + row;
        float lanes[kLanes] = {};
        std::size_t n = 0;
        for (; n + kLanes < nx; n += kLanes)
            for (std::size_t lane = 0; lane < kLanes; ++lane)
                lanes[lane] += std::abs(v[n + lane + 1] - v[n + lane]);
        for (; n + 1 < nx; ++n) lanes[0] += std::abs(v[n + 1] - v[n]);
        for (const float lane : lanes) total += double(lane);
    }
    return total;
}

float largest_change(const std::vector<float>& before, const std::vector<float>& now) {
    float lanes[kLanes] = {};
    std::size_t n = 0;
    for (; n + kLanes <= now.size(); n += kLanes) {
        for (std::size_t lane = 0; lane < kLanes; ++lane) {
            const float change = std::abs(now[n + lane] - before[n + lane]);
            lanes[lane] = lanes[lane] < change ? change : lanes[lane];
        }
    }
    for (; n < now.size(); ++n) lanes[0] = std::max(lanes[0], std::abs(now[n] - before[n]));
    return *std::ranges::max_element(lanes);
}

// Returns how far a seam stands out: above 1 it shows.
double prominence(const Seam& seam) { return seam.limit > 0 ? seam.at_seam / seam.limit : 0; }

bool shows_more(const Seam& one, const Seam& other) {
    return std::pair(one.shows(), prominence(one)) > std::pair(other.shows(), prominence(other));
}

void add(std::vector<double>& sums, const std::vector<double>& values) {
    sums.resize(values.size());
    for (std::size_t n = 0; n < values.size(); ++n) sums[n] += values[n];
}

void measure_seams(DensitySequence& sequence, int frame, Extent e, const std::vector<float>& density) {
    ++sequence.seam_frames;
    sequence.seam_frame = frame;
    for (int axis = 0; axis < 2; ++axis) {
        if (!sequence.every_seam && sequence.period_m[axis] == 0) continue;
        const PlaneSteps planes = plane_steps(density, e.x, e.y, e.z, axis);
        PlaneSteps& sums = sequence.planes[std::size_t(axis)];
        add(sums.steps, planes.steps);
        add(sums.breaks, planes.breaks);
    }
}

// Returns the seam of a sequence along an axis, of the mean of all frames that were measured; none: there is none.
std::optional<Seam> mean_seam(const DensitySequence& sequence, std::size_t axis) {
    PlaneSteps planes = sequence.planes[axis];
    if (planes.steps.empty()) return {};
    for (double& step : planes.steps) step /= sequence.seam_frames;
    for (double& part : planes.breaks) part /= sequence.seam_frames;
    return seam_of(planes);
}

std::string of_layer(const DensitySequence& sequence) {
    return sequence.layer.empty() ? "" : " of layer " + sequence.layer;
}

// Returns why no seam of a sequence was measured; empty: all were.
std::string why_no_seam(const DensitySequence& sequence) {
    if (sequence.frames == 0) return "there is no density";
    if (sequence.files == 0) return "no density file could be read";
    return sequence.too_large;
}

// Returns why no frames of a sequence were compared; empty: some were.
std::string why_no_motion(const DensitySequence& sequence) {
    if (std::string why = why_no_seam(sequence); !why.empty()) return why;
    if (sequence.pairs > 0) return {};
    return sequence.frames == 1 ? "not compared: there is a single frame"
                                : "not compared: no two frames that follow each other could be read";
}

// Returns what `why` says of all sequences.
template <class Why>
std::string reasons(std::span<const DensitySequence> sequences, const Why& why) {
    std::string text;
    for (const DensitySequence& sequence : sequences) {
        const std::string reason = why(sequence);
        if (reason.empty()) continue;
        text += (text.empty() ? "" : "; ") +
                (sequence.layer.empty() ? reason : "layer " + sequence.layer + ": " + reason);
    }
    return text;
}

// Returns a check with what it leaves out. Demanded, it passes with nothing left out alone.
Check with_reasons(Check check, const std::string& why, bool is_demanded) {
    if (why.empty()) return check;
    if (is_demanded && check.passed) return {check.name, false, why, {}, false};
    check.detail += (check.detail.empty() ? "" : "; ") + why;
    return check;
}

}  // namespace

std::string why_too_large(const DensityGrid& grid) {
    const std::size_t voxels = grid.extent().cells();
    if (voxels <= kMostCompared) return {};
    return fmt::format("not done: the box has {} voxels, of which at most {} are compared", voxels,
                       kMostCompared);
}

std::vector<DensitySequence> sequences_of(const RunListing& run, bool every_seam) {
    const Scene& scene = run.scene;
    const auto sequence = [&](const std::string& name, std::optional<std::size_t> layer) {
        DensitySequence result;
        result.layer = name;
        result.period_m = period_m(scene, layer);
        result.every_seam = every_seam;
        return result;
    };
    if (scene.layers.empty() || scene.density_files.combined || !has_density(scene))
        return {sequence({}, std::nullopt)};
    std::vector<DensitySequence> sequences;
    for (std::size_t n = 0; n < scene.layers.size(); ++n)
        if (has_density(scene.layers[n])) sequences.push_back(sequence(scene.layers[n].name, n));
    return sequences;
}

void add_frame(DensitySequence& sequence, int frame, const DensityGrid* grid) {
    ++sequence.frames;
    if (grid == nullptr) return;
    ++sequence.files;
    std::optional<DensitySequence::Last>& last = sequence.last;
    double gradients = 0;
    if (const std::string why = why_too_large(*grid); !why.empty()) {
        sequence.too_large = why;
    } else {
        const Extent e = grid->extent();
        const std::vector<float> now = grid->to_dense();
        if (sequence.every_seam) measure_seams(sequence, frame, e, now);
        gradients = sum_of_gradients(now, std::size_t(e.x));
        if (last && last->frame + 1 == frame && last->grid.extent() == e) {
            ++sequence.pairs;
            // Kept sparse in between, as there may be many layers.
            const double change = double(largest_change(last->grid.to_dense(), now));
            sequence.change = std::max(sequence.change, change);
            if (last->gradients > 0)
                sequence.sharpness_change =
                    std::max(sequence.sharpness_change, std::abs(gradients / last->gradients - 1));
        }
    }
    last = {frame, *grid, gradients};
}

void finish(DensitySequence& sequence) {
    const std::optional<DensitySequence::Last>& last = sequence.last;
    const bool repeats = sequence.period_m.x != 0 || sequence.period_m.y != 0;
    if (sequence.every_seam || !repeats || !last || !why_too_large(last->grid).empty()) return;
    measure_seams(sequence, last->frame, last->grid.extent(), last->grid.to_dense());
}

Check check_seams(std::span<const DensitySequence> sequences, bool is_demanded) {
    constexpr std::array kNames{"x", "y"};
    Check check{"seam", true, {}};
    int files = 0, frame = 0;
    for (const DensitySequence& sequence : sequences) files += sequence.seam_frames;
    for (std::size_t axis = 0; axis < kNames.size(); ++axis) {
        const DensitySequence* worst = nullptr;
        Seam seam;
        for (const DensitySequence& sequence : sequences) {
            const std::optional<Seam> found = mean_seam(sequence, axis);
            if (!found || (worst != nullptr && !shows_more(*found, seam))) continue;
            worst = &sequence;
            seam = *found;
        }
        if (worst == nullptr) continue;
        check.passed = check.passed && !(is_demanded && seam.shows());
        check.detail +=
            fmt::format("{}{}: break of {:.3g} at the seam{}, at most {:.3g} inside, shows above {:.3g}{}",
                        check.detail.empty() ? "" : "; ", kNames[axis], seam.at_seam, of_layer(*worst),
                        seam.inside, seam.limit, seam.shows() ? " (the seam shows)" : "");
        frame = worst->seam_frame;
        check.figures.emplace_back(fmt::format("{}_seam", kNames[axis]), seam.at_seam);
        check.figures.emplace_back(fmt::format("{}_inside", kNames[axis]), seam.inside);
        check.figures.emplace_back(fmt::format("{}_limit", kNames[axis]), seam.limit);
    }
    if (is_demanded && !check.detail.empty())
        check.detail += fmt::format("; the mean of {} density files", files);
    else if (!check.detail.empty())
        check.detail += fmt::format("; of frame {}", frame);
    check = with_reasons(std::move(check), reasons(sequences, why_no_seam), is_demanded);
    if (check.detail.empty()) check.detail = "no axis repeats";
    return check;
}

Check check_motion(std::span<const DensitySequence> sequences, const std::optional<double>& most) {
    const DensitySequence* changed = nullptr;
    const DensitySequence* sharpened = nullptr;
    for (const DensitySequence& sequence : sequences) {
        if (sequence.pairs == 0) continue;
        if (changed == nullptr || sequence.change > changed->change) changed = &sequence;
        if (sharpened == nullptr || sequence.sharpness_change > sharpened->sharpness_change)
            sharpened = &sequence;
    }
    Check check{"motion", true, {}};
    if (changed != nullptr) {
        check.passed = !most || changed->change <= *most;
        check.detail = fmt::format(
            "largest change of a voxel{} {:.3g}, of the sum of gradients{} {:.2g} %, from frame to frame",
            of_layer(*changed), changed->change, of_layer(*sharpened), 100 * sharpened->sharpness_change);
        if (!check.passed) check.detail += fmt::format("; at most {:g} is allowed", *most);
        check.figures = {{"largest_change", changed->change},
                         {"sharpness_change", sharpened->sharpness_change}};
    }
    return with_reasons(std::move(check), reasons(sequences, why_no_motion), most.has_value());
}

PlaneSteps plane_steps(const std::vector<float>& density, int nx, int ny, int nz, int axis) {
    constexpr float kContinued = 1.5f;
    const std::size_t n = std::size_t(axis == 0 ? nx : axis == 1 ? ny : nz);
    const std::size_t stride = axis == 0   ? 1
                               : axis == 1 ? std::size_t(nx)
                                           : std::size_t(nx) * std::size_t(ny);
    PlaneSteps planes{std::vector<double>(n), std::vector<double>(n)};
    for (std::size_t slab = 0; slab < density.size(); slab += stride * n) {
        const auto plane = [&](std::size_t k) {
            return density.data() + slab + stride * (k < n ? k : k % n);
        };
        for (std::size_t k = 0; k < n; ++k) {
            const float* before = plane(k + n - 1);
            const float* at = plane(k);
            const float* next = plane(k + 1);
            const float* behind = plane(k + 2);
            for (std::size_t m = 0; m < stride; ++m) {
                const float step = std::abs(next[m] - at[m]);
                const float beside = std::max(std::abs(at[m] - before[m]), std::abs(behind[m] - next[m]));
                planes.steps[k] += double(step);
                planes.breaks[k] += double(std::max(0.0f, step - kContinued * beside));
            }
        }
    }
    const double count = double(density.size()) / double(n);
    for (double& step : planes.steps) step /= count;
    for (double& part : planes.breaks) part /= count;
    return planes;
}

Seam seam_of(const PlaneSteps& planes) {
    constexpr double kLeastPart = 0.25, kPartsInside = 2, kBreaksInside = 1.5, kStepsInside = 1.25;
    const std::size_t last = planes.steps.size() - 1;
    Seam seam;
    double steps = 0, breaks = 0, largest = 0;
    for (std::size_t k = 0; k < last; ++k) {
        steps += planes.steps[k];
        breaks += planes.breaks[k];
        largest = std::max(largest, planes.steps[k]);
        seam.inside = std::max(seam.inside, planes.breaks[k]);
    }
    seam.at_seam = planes.breaks[last];
    const bool is_steep = planes.steps[last] > kStepsInside * largest;
    const double part =
        is_steep || steps == 0 ? kLeastPart : std::max(kLeastPart, kPartsInside * breaks / steps);
    seam.limit = std::max(kBreaksInside * seam.inside, part * planes.steps[last]);
    return seam;
}

}  // namespace nephos
