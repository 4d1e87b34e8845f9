// SPDX-License-Identifier: Apache-2.0
#include "render/cloud/light_below.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

namespace nephos {
namespace {

constexpr int kCells = CoverageField::kBrickCells, kTexels = GroundLight::kTexels;

constexpr double kLeastSine = 0.02;

struct Fractions {
    float sun = 0, sky = 1;
};

// Vertical optical depths of a volume's columns of cells.
class Columns {
  public:
    explicit Columns(const CloudVolume& volume)
        : field_(volume.field),
          width_(field_.bricks()[0] * kCells),
          height_(field_.bricks()[1] * kCells),
          depths_(std::size_t(width_) * std::size_t(height_), 0.0f) {
        const auto& bricks = field_.bricks();
        const auto cell_m = float(2 * field_.node_m());
        for (std::size_t n = 0; n < field_.places().size(); ++n) {
            const std::int32_t at = field_.places()[n];
            const int x = at % bricks[0] * kCells, y = at / bricks[0] % bricks[1] * kCells;
            const float* const from = &volume.extinction[n * kCells * kCells * kCells];
            for (int cell = 0; cell < kCells * kCells * kCells; ++cell)
                depths_[std::size_t(y + cell / kCells % kCells) * std::size_t(width_) +
                        std::size_t(x + cell % kCells)] += cell_m * from[cell];
            lowest_ = std::min(lowest_, at / bricks[0] / bricks[1]);
        }
    }

    bool repeats() const { return field_.period_m().x > 0; }
    double base_m() const { return field_.corner_m().z + 2 * field_.node_m() * kCells * lowest_; }
    // What it covers, of a field that repeats its first period.
    Vec2 begin_m() const { return Vec2(field_.corner_m()) + Vec2(field_.home_m()) * double(repeats()); }
    Vec2 end_m() const {
        return begin_m() + (repeats() ? field_.period_m() : 2 * field_.node_m() * Vec2(width_, height_));
    }
    float depth_at(const Vec2& place_m) const {
        const Vec3 local = field_.at_home(Vec3(place_m, 0) - field_.corner_m());
        const double x = std::floor(local.x / (2 * field_.node_m())),
                     y = std::floor(local.y / (2 * field_.node_m()));
        if (!(x >= 0 && y >= 0 && x < width_ && y < height_)) return 0;
        return depths_[std::size_t(y) * std::size_t(width_) + std::size_t(x)];
    }

  private:
    const CoverageField& field_;
    int width_, height_, lowest_ = std::numeric_limits<int>::max();
    std::vector<float> depths_;
};

Fractions through(float depth, double sine, double mean_cosine) {
    const double tau = depth, reduced = (1 - mean_cosine) * tau;
    // The forward peak goes on straight: delta-Eddington's depth (J. H. Joseph, W. J. Wiscombe and J. A. Weinman 1976).
    const double scaled = (1 - mean_cosine * mean_cosine) * tau;
    const double all = (2 + 3 * sine + (2 - 3 * sine) * std::exp(-scaled / sine)) / (4 + 3 * reduced);
    return {float(std::max(all - std::exp(-tau / sine), 0.0)), float(1 / (1 + 0.75 * reduced))};
}

// Means over 2 `radius` + 1 numbers along rows, which go on beyond their ends as `beyond`.
void average_rows(std::span<Fractions> map, int radius, const Fractions& beyond) {
    std::vector<Fractions> row(kTexels);
    const float scale = 1.0f / float(2 * radius + 1);
    for (int y = 0; y < kTexels; ++y) {
        const std::span<Fractions> own = map.subspan(std::size_t(y) * kTexels, kTexels);
        std::ranges::copy(own, row.begin());
        for (int x = 0; x < kTexels; ++x) {
            Fractions sum{0, 0};
            for (int other = x - radius; other <= x + radius; ++other) {
                const Fractions& of = other < 0 || other >= kTexels ? beyond : row[std::size_t(other)];
                sum.sun += of.sun;
                sum.sky += of.sky;
            }
            own[std::size_t(x)] = {scale * sum.sun, scale * sum.sky};
        }
    }
}

void transpose(std::span<Fractions> map) {
    for (std::size_t y = 0; y < kTexels; ++y)
        for (std::size_t x = y + 1; x < kTexels; ++x) std::swap(map[y * kTexels + x], map[x * kTexels + y]);
}

std::uint32_t packed(const Fractions& of) {
    const auto half = [](float share) { return std::uint32_t(65535 * std::clamp(share, 0.0f, 1.0f) + 0.5f); };
    return half(of.sun) | half(of.sky) << 16;
}

struct Region {
    Vec2 begin_m{0, 0}, end_m{0, 0};
    bool repeats = false;  // beyond it all goes on
};

// depth_at(place) is the vertical depth of the column above it, `spread_m` the height of the clouds' base above the ground.
template <class DepthAt>
GroundLight map_of(const Region& region, double spread_m, double sine, double mean_cosine,
                   const DepthAt& depth_at) {
    constexpr int kSamples = 4;  // of a texel, on an edge
    GroundLight light;
    light.corner_m = region.begin_m - 2 * spread_m;
    light.texel_m = (region.end_m - region.begin_m + 4 * spread_m) / double(kTexels);
    std::vector<Fractions> map(std::size_t(kTexels) * kTexels);
    tbb::parallel_for(0, kTexels, [&](int row) {
        for (int column = 0; column < kTexels; ++column) {
            Fractions sum{0, 0};
            for (int n = 0; n < kSamples * kSamples; ++n) {
                const Vec2 in_texel((n % kSamples + 0.5) / kSamples, (double(n / kSamples) + 0.5) / kSamples);
                const Vec2 place = light.corner_m + light.texel_m * (Vec2(column, row) + in_texel);
                const Fractions of = through(depth_at(place), sine, mean_cosine);
                sum.sun += of.sun;
                sum.sky += of.sky;
            }
            map[std::size_t(row) * kTexels + std::size_t(column)] = {sum.sun / (kSamples * kSamples),
                                                                     sum.sky / (kSamples * kSamples)};
        }
    });
    Fractions beyond;
    if (region.repeats) {
        double sun = 0, sky = 0;
        for (const Fractions& of : map) {
            sun += double(of.sun);
            sky += double(of.sky);
        }
        beyond = {float(sun / double(map.size())), float(sky / double(map.size()))};
    }
    for (int axis = 0; axis < 2;
         ++axis) {  // twice a box along each axis: half of the light within `spread_m`
        const int radius = std::clamp(int(std::lround(0.5 * spread_m / light.texel_m[axis])), 1, kTexels / 4);
        for (int pass = 0; pass < 2; ++pass) average_rows(map, radius, beyond);
        transpose(map);
    }
    light.words.resize(map.size());
    for (std::size_t n = 0; n < map.size(); ++n) {
        const std::size_t x = n % kTexels, y = n / kTexels;
        const bool outermost = std::min(x, y) == 0 || std::max(x, y) == kTexels - 1;
        light.words[n] = packed(outermost ? beyond : map[n]);
    }
    return light;
}

}  // namespace

GroundLight light_below(std::span<const CloudVolume> volumes, const Vec3& to_sun, double ground_height_m) {
    std::vector<Columns> clouds;
    for (const CloudVolume& volume : volumes)
        if (!volume.field.places().empty()) clouds.emplace_back(volume);
    if (clouds.empty()) return {};
    double base_m = std::numeric_limits<double>::infinity();
    Region region{Vec2(base_m), Vec2(-base_m), false};
    for (const Columns& cloud : clouds) {
        base_m = std::min(base_m, cloud.base_m());
        region.begin_m = glm::min(region.begin_m, cloud.begin_m());
        region.end_m = glm::max(region.end_m, cloud.end_m());
        region.repeats = region.repeats || cloud.repeats();
    }
    return map_of(region, std::max(base_m - ground_height_m, 0.0), std::max(to_sun.z, kLeastSine),
                  volumes.front().mean_cosine, [&](const Vec2& place_m) {
                      float depth = 0;
                      for (const Columns& cloud : clouds) depth += cloud.depth_at(place_m);
                      return depth;
                  });
}

GroundLight light_below(const Picture& shaded, double base_m, double mean_cosine, double ground_height_m) {
    const ShadowFrame& frame = shaded.shadow_frame;
    const double sine = -frame.direction.z;
    if (shaded.shadow.empty() || !(sine > kLeastSine)) return {};
    Region region{Vec2(std::numeric_limits<double>::infinity()),
                  Vec2(-std::numeric_limits<double>::infinity()), false};
    for (int corner = 0; corner < 4; ++corner) {
        const Vec3 at =
            frame.origin_m + double(corner & 1) * frame.u_axis_m + double(corner >> 1) * frame.v_axis_m;
        const Vec2 below = Vec2(at + (at.z - ground_height_m) / sine * frame.direction);
        region.begin_m = glm::min(region.begin_m, below);
        region.end_m = glm::max(region.end_m, below);
    }
    // Clouds stand where their columns are, not where their shadows fall.
    const Vec2 from_shadow = (base_m - ground_height_m) / sine * Vec2(-frame.direction);
    region.begin_m += from_shadow;
    region.end_m += from_shadow;
    const int size = shaded.shadow_size;
    const auto depth_at = [&](const Vec2& place_m) {
        const Vec3 from = Vec3(place_m, base_m) - frame.origin_m;
        const auto texel = [&](const Vec3& axis) {
            return std::floor(dot(from, axis) / dot(axis, axis) * size);
        };
        const double u = texel(frame.u_axis_m), v = texel(frame.v_axis_m);
        if (!(u >= 0 && v >= 0 && u < size && v < size)) return 0.0f;
        const float left = shaded.shadow[std::size_t(v) * std::size_t(size) + std::size_t(u)];
        return float(-sine * std::log(std::max(double(left), 1e-30)));
    };
    return map_of(region, std::max(base_m - ground_height_m, 0.0), sine, mean_cosine, depth_at);
}

}  // namespace nephos
