// SPDX-License-Identifier: Apache-2.0
#include "render/frame/air_shells.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include "core/vec.h"
#include "render/frame/frame_data.h"

namespace nephos {
namespace {

float distance_of(const shader::ViewBall& ball) {
    return std::sqrt(ball.x * ball.x + ball.y * ball.y + ball.z * ball.z);
}
float distance_of(const shader::ViewBillboard& billboard) {
    return std::sqrt(billboard.x * billboard.x + billboard.y * billboard.y + billboard.z * billboard.z);
}

constexpr double kLeastSunSine = 0.02;  // as in veil_shade.cpp

// Texels of the shadow map along an edge of one of the shade map. A shaft is a mean over many shadows; single
// texels would only be noise. The shade map has 512 texels on a side at most.
int texels_in_one(int shadow_size) {
    return std::max(std::clamp(shadow_size / 256, 1, 4), (shadow_size + 511) / 512);
}

// The distribution of cloud along the light above a texel of the shade map: 0..1 from the first to the last
// metaball.
struct Span {
    double weight = 0, sum = 0, sum_squares = 0;
    float first = 1, last = 0;  // ends of what is there

    void add(const Span& other) {
        weight += other.weight;
        sum += other.sum;
        sum_squares += other.sum_squares;
        first = std::min(first, other.first);
        last = std::max(last, other.last);
    }
};

// A level of a pyramid of spans, each of up to four of the level below.
struct SpanLevel {
    std::vector<Span> spans;
    std::size_t side = 0;
};

SpanLevel coarser(const SpanLevel& level) {
    SpanLevel half{{}, (level.side + 1) / 2};
    half.spans.resize(half.side * half.side);
    for (std::size_t row = 0; row < level.side; ++row)
        for (std::size_t column = 0; column < level.side; ++column)
            half.spans[row / 2 * half.side + column / 2].add(level.spans[row * level.side + column]);
    return half;
}

// Texels between metaballs that are larger than what blur() reaches over take the span of the least part of
// the map around them that has one.
void fill_holes(std::vector<Span>& spans, std::size_t side) {
    std::vector<SpanLevel> levels{{spans, side}};
    while (levels.back().side > 1) levels.push_back(coarser(levels.back()));
    if (!(levels.back().spans[0].weight > 0)) return;
    for (std::size_t row = 0; row < side; ++row) {
        for (std::size_t column = 0; column < side; ++column) {
            Span& span = spans[row * side + column];
            for (std::size_t n = 1; !(span.weight > 0); ++n)
                span = levels[n].spans[(row >> n) * levels[n].side + (column >> n)];
        }
    }
}

// A unit of `along` in metres, and where it is 0.
struct Along {
    Vec3 row{};  // metres^-1
    double offset = 0;
    double operator()(const Vec3& p) const { return dot(row, p) + offset; }
};

// Returns the axis along which shade begins and is complete: height, by which all air below the clouds is
// known to be in full shade without a look-up; the direction of light where the sun is so low that clouds
// shade each other at one height.
Vec3 shade_axis(const Vec3& light) { return light.z < -0.25 ? Vec3{0, 0, -1} : light; }

Along along_axis(const PreparedCloud& cloud, std::span<const ShadowCaster> others, const Vec3& direction) {
    using Ends = std::pair<double, double>;
    auto [first, last] = tbb::parallel_reduce(
        tbb::blocked_range<std::size_t>(0, cloud.visible.size(), 8192), Ends{1e300, -1e300},
        [&](const auto& range, Ends ends) {
            for (std::size_t i = range.begin(); i != range.end(); ++i) {
                const Metaball& ball = cloud.metaballs[cloud.visible[i]];
                const double at = dot(direction, Vec3{ball.x, ball.y, ball.z});
                ends = {std::min(ends.first, at - double(ball.radius)),
                        std::max(ends.second, at + double(ball.radius))};
            }
            return ends;
        },
        [](const Ends& a, const Ends& b) {
            return Ends{std::min(a.first, b.first), std::max(a.second, b.second)};
        });
    for (const ShadowCaster& other : others) {
        const double at = dot(direction, other.centre_m);
        first = std::min(first, at - other.radius_m);
        last = std::max(last, at + other.radius_m);
    }
    return {(1 / (last - first)) * direction, -first / (last - first)};
}

class ShadeMap {
  public:
    // `low_m`: a height below all veils.
    ShadeMap(const AirLight& light, double low_m)
        : shadow_(light.shadow),
          shadow_size_(light.shadow_size),
          frame_(light.frame),
          veils_(light.veils),
          low_m_(low_m),
          step_(texels_in_one(light.shadow_size)),
          inner_((shadow_size_ + step_ - 1) / step_),
          columns_(inner_ + 2) {}

    int columns() const { return columns_; }
    std::size_t texels() const { return std::size_t(columns_) * std::size_t(columns_); }
    // Scale from a shadow map coordinate 0..1 to columns or rows, whose integers are the centres of texels.
    double scale() const { return double(shadow_size_) / step_; }
    static double shift() { return 0.5; }

    std::vector<std::uint32_t> words(const PreparedCloud& cloud, std::span<const ShadowCaster> others,
                                     const Along& along, float& first_shade) const {
        const std::vector<std::uint32_t> light = means(), range = ranges(cloud, others, along, first_shade);
        std::vector<std::uint32_t> words(3 * texels());
        const auto columns = std::size_t(columns_), last = texels() - 1;
        tbb::parallel_for(std::size_t{0}, columns, [&](std::size_t row) {
            for (std::size_t i = row * columns; i < (row + 1) * columns; ++i) {
                // The last column and row are never sampled.
                const std::size_t four[] = {i, std::min(i + 1, last), std::min(i + columns, last),
                                            std::min(i + columns + 1, last)};
                for (int n = 0; n < 4; ++n) {
                    words[i] |= light[four[n]] << 8 * n;
                    words[texels() + i] |= (range[four[n]] & 255u) << 8 * n;
                    words[2 * texels() + i] |= (range[four[n]] >> 8) << 8 * n;
                }
            }
        });
        return words;
    }

  private:
    static std::uint32_t byte_of(double value) {
        return std::uint32_t(std::clamp(value, 0.0, 1.0) * 255.0 + 0.5);
    }

    // Sunlight that veils leave to air below them on the line of light through a texel of the shade map.
    double left_by_veils(int row, int column) const {
        if (veils_ == nullptr || !veils_->any()) return 1;
        const Vec3 start = frame_.origin_m + ((column - 0.5) / scale()) * frame_.u_axis_m +
                           ((row - 0.5) / scale()) * frame_.v_axis_m;
        const double down = std::min(frame_.direction.z, -kLeastSunSine);
        return std::exp(-double(veils_->at(start + ((low_m_ - start.z) / down) * frame_.direction)));
    }

    // Means of the shadow map, 0..255, with a border of what veils leave.
    std::vector<std::uint32_t> means() const {
        if (shadow_.empty()) return std::vector<std::uint32_t>(texels(), 0);
        std::vector<std::uint32_t> light(texels());
        tbb::parallel_for(0, columns_, [&](int y) {
            for (int x = 0; x < columns_; ++x)
                light[std::size_t(y) * std::size_t(columns_) + std::size_t(x)] =
                    byte_of(mean(y - 1, x - 1) * left_by_veils(y, x));
        });
        return light;
    }

    // Mean of the shadow map over one of the inner texels; 1 beyond them.
    double mean(int row, int column) const {
        if (row < 0 || column < 0 || row >= inner_ || column >= inner_) return 1;
        float sum = 0;
        int count = 0;
        for (int y = row * step_; y < std::min(shadow_size_, (row + 1) * step_); ++y)
            for (int x = column * step_; x < std::min(shadow_size_, (column + 1) * step_); ++x, ++count)
                sum += shadow_[std::size_t(y) * std::size_t(shadow_size_) + std::size_t(x)];
        return double(sum) / count;
    }

    // Adds each metaball to the texel of its centre, then to each texel those around it within the radius of
    // metaballs; other casters likewise.
    std::vector<Span> spans(const PreparedCloud& cloud, std::span<const ShadowCaster> others,
                            const Along& along, int& reach) const {
        std::vector<Span> spans(texels());
        const Vec3& u = frame_.u_axis_m;
        const Vec3& v = frame_.v_axis_m;
        const Vec3 across = (scale() / dot(u, u)) * u, down = (scale() / dot(v, v)) * v;
        double radius_sum = 0;
        const auto add = [&](const Vec3& centre, double radius, double weight) {
            const Vec3 offset = centre - frame_.origin_m;
            const int column = std::clamp(int(dot(across, offset)) + 1, 0, columns_ - 1),
                      row = std::clamp(int(dot(down, offset)) + 1, 0, columns_ - 1);
            Span& span = spans[std::size_t(row) * std::size_t(columns_) + std::size_t(column)];
            const double at = along(centre), half = radius * length(along.row);
            span.add({weight, weight * at, weight * (at * at + 0.15 * half * half), float(at - half),
                      float(at + half)});
            radius_sum += radius;
        };
        for (std::size_t n = 0; n < cloud.visible.size(); ++n) {
            const Metaball& ball = cloud.metaballs[cloud.visible[n]];
            const double radius = ball.radius;
            add({ball.x, ball.y, ball.z}, radius, double(cloud.depth_scale[n]) * radius * radius);
        }
        for (const ShadowCaster& other : others) add(other.centre_m, other.radius_m, other.weight);
        const double texel_m = std::max(length(u), length(v)) / scale();
        const std::size_t casters = cloud.visible.size() + others.size();
        const double mean_radius_m = casters == 0 ? 0 : radius_sum / double(casters);
        reach = std::clamp(int(std::ceil(mean_radius_m / texel_m)), 1, 8);
        return spans;
    }

    // Sums over 2 reach + 1 texels of a row, from every `stride`-th.
    static void blur(std::vector<Span>& spans, std::size_t begin, std::size_t stride, int count, int reach) {
        std::vector<Span> from(static_cast<std::size_t>(count));
        for (int i = 0; i < count; ++i) from[std::size_t(i)] = spans[begin + std::size_t(i) * stride];
        for (int i = 0; i < count; ++i) {
            Span sum;
            for (int j = std::max(0, i - reach); j <= std::min(count - 1, i + reach); ++j)
                sum.add(from[std::size_t(j)]);
            spans[begin + std::size_t(i) * stride] = sum;
        }
    }

    // Shade increases linearly over the length of a uniform cloud with the same mean and variance.
    std::vector<std::uint32_t> ranges(const PreparedCloud& cloud, std::span<const ShadowCaster> others,
                                      const Along& along, float& first_shade) const {
        int reach = 0;
        std::vector<Span> all = spans(cloud, others, along, reach);
        const auto columns = std::size_t(columns_);
        tbb::parallel_for(std::size_t{0}, columns,
                          [&](std::size_t row) { blur(all, row * columns, 1, columns_, reach); });
        tbb::parallel_for(std::size_t{0}, columns,
                          [&](std::size_t column) { blur(all, column, columns, columns_, reach); });
        fill_holes(all, columns);
        std::vector<std::uint32_t> range(texels(), 255u << 8);
        std::uint32_t first = 255;
        for (std::size_t i = 0; i < texels(); ++i) {
            if (!(all[i].weight > 0)) continue;
            const double mean = all[i].sum / all[i].weight;
            const double variance = std::max(0.0, all[i].sum_squares / all[i].weight - mean * mean);
            const double half = std::sqrt(3 * variance);
            // With several layers the range of a uniform cloud of that variance would exceed all of them.
            range[i] = byte_of(std::max(mean - half, double(all[i].first))) |
                       byte_of(std::min(mean + half, double(all[i].last))) << 8;
            first = std::min(first, range[i] & 255u);
        }
        first_shade = float(first) / 255.0f;
        return range;
    }

    std::span<const float> shadow_;
    int shadow_size_;
    const ShadowFrame& frame_;
    const AddedDepth* veils_;
    double low_m_;
    int step_, inner_, columns_;
};

void set_ends(shader::Shells& data, const Shells& shells, bool far_shell) {
    double end = 0, thickness = shells.spacing_m;
    for (std::size_t k = 0; k <= shader::kMaxShells; ++k) {
        if (k < std::size_t(shells.count)) end += thickness;
        if (far_shell && k == std::size_t(shells.count)) end = std::max(end, double(shader::kFarShell_m));
        thickness *= shells.growth;
        shader::vec4& four = data.ends[k / 4];
        float* const values[] = {&four.x, &four.y, &four.z, &four.w};
        *values[k % 4] = float(end);
    }
}

double shafts_strength(const RenderOptions& options) {
    return options.light_shafts.strength * daylight(options.sun.elevation_deg).sun;
}

// Computes the shade map of a cloud.
void make_shade(const PreparedCloud& cloud, std::span<const ShadowCaster> others, const AirLight& light,
                double low_m, ShadeCache& cache) {
    if (cloud.visible.empty() && others.empty()) {  // full light
        cache.columns = 2;
        cache.words.assign(std::size_t{3} * 4, ~std::uint32_t{0});
    } else {
        const Along along = along_axis(cloud, others, shade_axis(light.frame.direction));
        const ShadeMap map(light, low_m);
        cache.words = map.words(cloud, others, along, cache.first_shade);
        cache.columns = map.columns();
        cache.texels_per_map = map.scale();
        cache.along = along.row;
        cache.along_offset = along.offset;
    }
    cache.shade_words = cache.words.size();
    cache.fog_seed.reset();
    cache.light = light.light;
    ++cache.serial;
}

// Appends the fog's noise to the shade map; without fog none is read.
void add_fog_noise(const Fog& fog, FogNoise& noise, ShadeCache& cache) {
    if (!(fog.extinction_per_m > 0) || cache.fog_seed == fog.seed) return;
    const std::vector<std::uint32_t>& words = noise.words(fog.seed);
    cache.words.resize(cache.shade_words);
    cache.words.insert(cache.words.end(), words.begin(), words.end());
    cache.fog_seed = fog.seed;
    ++cache.serial;
}

void use_shade(const ShadeCache& cache, bool casts_shadow, const ShadowFrame& frame, const Vec3& eye,
               AirShells& shells) {
    shader::Shells& data = shells.data;
    shells.shade = cache.words;
    shells.serial = cache.serial;
    data.settings.z = float(cache.columns);
    data.settings.w = float(cache.columns * cache.columns);
    if (!casts_shadow) return;
    const auto row = [&](const Vec3& axis) {
        const Vec3 per_m = (cache.texels_per_map / dot(axis, axis)) * axis;
        return to_vec4(per_m, dot(per_m, eye - frame.origin_m) + ShadeMap::shift());
    };
    data.shade_u = row(frame.u_axis_m);
    data.shade_v = row(frame.v_axis_m);
    data.shade_along = to_vec4(cache.along, dot(cache.along, eye) + cache.along_offset);
    const float largest = float(cache.columns) - 1.001f;
    data.shade = {largest, largest, cache.first_shade, 0};
}

// Number of splats, in falling order of distance, that are at `end` or beyond.
template <class Splat>
std::size_t count_beyond(std::span<const Splat> farthest_first, float end) {
    const auto beyond = [&](const Splat& splat) { return distance_of(splat) >= end; };
    return std::size_t(std::ranges::partition_point(farthest_first, beyond) - farthest_first.begin());
}

std::size_t count_beyond(const ViewSortedSplats& order, const Run& run, float end) {
    const std::size_t count = run.end - run.begin;
    if (run.kind == SplatKind::billboard)
        return count_beyond(std::span(order.billboards).subspan(run.begin, count), end);
    return count_beyond(std::span(order.balls).subspan(run.begin, count), end);
}

}  // namespace

std::size_t shells_before(const shader::Shells& data, float distance) {
    std::size_t first = 0, count = std::size_t(data.settings.x);
    while (count > 0) {
        const std::size_t half = count / 2;
        if (shell_end(data, first + half) <= distance) {
            first += half + 1;
            count -= half + 1;
        } else {
            count = half;
        }
    }
    return first;
}

bool has_shells(const RenderOptions& options, bool casts_shadow) {
    return options.fog.extinction_per_m > 0 || (shafts_strength(options) > 0 && casts_shadow);
}

AirShells air_shells(const RenderOptions& options, const PreparedCloud& cloud,
                     std::span<const ShadowCaster> others, const AirLight& light, double time_s,
                     FogNoise& noise, ShadeCache& cache) {
    AirShells shells;
    const bool has_fog = options.fog.extinction_per_m > 0;
    const bool casts_shadow = !cloud.visible.empty() || !others.empty();
    if (!has_shells(options, casts_shadow)) return shells;
    shader::Shells& data = shells.data;
    if (cache.light != light.light) make_shade(cloud, others, light, options.ground.height_m, cache);
    add_fog_noise(options.fog, noise, cache);
    use_shade(cache, casts_shadow, light.frame, options.camera.position_m, shells);
    set_ends(data, options.shells, has_fog);
    data.settings.x = float(options.shells.count + (has_fog ? 1 : 0));
    data.settings.y = casts_shadow ? float(shafts_strength(options)) : 0.0f;
    data.shade.w = float(reach_m(options.shells));
    for (std::size_t k = 0; k < shells.count(); ++k) {
        std::array<float, 3>& clear = shells.clear.emplace_back();
        for (std::size_t c = 0; c < 3; ++c)
            clear[c] = float(std::exp(-options.air.extinction_per_m[c] * double(shell_end(data, k))));
    }
    set_fog(options.fog, options.camera.position_m, time_s, data);
    return shells;
}

std::vector<std::uint32_t> splats_before_shells(const AirShells& shells, const ViewSortedSplats& order) {
    std::vector<std::uint32_t> before(shells.count());
    for (std::size_t k = 0; k < before.size(); ++k) {
        const float end = shell_end(shells.data, k);
        const std::size_t beyond = count_beyond<shader::ViewBall>(order.balls, end) +
                                   count_beyond<shader::ViewBillboard>(order.billboards, end);
        before[k] = std::uint32_t(order.balls.size() + order.billboards.size() - beyond);
    }
    return before;
}

std::vector<Run> runs_between_shells(const AirShells& shells, const ViewSortedSplats& order) {
    std::vector<Run> runs;
    std::size_t next = shells.count();  // shells from here on are in `runs`
    const auto add_shell = [&] {
        --next;
        runs.push_back({std::uint32_t(next), std::uint32_t(next) + 1, SplatKind::shell});
    };
    for (Run run : order.runs) {
        while (next > 0) {
            const auto split =
                run.begin + std::uint32_t(count_beyond(order, run, shell_end(shells.data, next - 1)));
            if (split == run.end) break;  // all of it lies beyond the shell
            if (split > run.begin) runs.push_back({run.begin, split, run.kind});
            run.begin = split;
            add_shell();
        }
        runs.push_back(run);
    }
    while (next > 0) add_shell();
    return runs;
}

}  // namespace nephos
