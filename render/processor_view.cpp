// SPDX-License-Identifier: Apache-2.0
#include "render/processor_view.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <vector>

#include <tbb/parallel_for.h>

#include "render/screen_box.h"
#include "render/tile_bins.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/processor_view.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come first
#include <hwy/cache_control.h>
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "render/background-inl.h"
#include "render/column-inl.h"

#ifndef NEPHOS_PROCESSOR_VIEW_TYPES_
#define NEPHOS_PROCESSOR_VIEW_TYPES_
namespace nephos {

// A metaball on the screen, ready to be drawn; one cache line. With d the direction of a pixel's ray and d0
// that of the centre c, the squared distance of the ray from the centre is |c x d|^2 / |d|^2, and c x d =
// c x (d - d0): a quadratic form of the pixel's offset from the centre, exact for any field of view.
struct ScreenBall {
    float x, y;        // of the centre, pixels; where `distance` is 0, x has the bits of ExactBall's number
    float xx, xy, yy;  // squared distance in radii, times |d|^2: xx dx^2 + xy dx dy + yy dy^2
    float fit[6];      // c0..c5 of the opacity (shaders/shared.h)
    float red, green, blue;   // radiance at opacity 1
    float distance;           // metres; 0: not fitted
    std::int16_t first, end;  // rows of pixels
};
static_assert(sizeof(ScreenBall) == 64);

// A metaball whose integral is evaluated along each ray.
struct ExactBall {
    float x, y, z;  // centre in radii
    float per_radius, depth_scale, distance;
    float diffuse[3];  // radiance that does not depend on the ray
    float direct[3];   // radiance per phase function
};

// Sums over the metaballs in front, for the pixels of a tile row by row.
struct TileSums {
    static constexpr std::size_t kPixels = shader::kTileWidth * shader::kTileHeight;
    alignas(64) float red[kPixels] = {}, green[kPixels] = {}, blue[kPixels] = {}, distance[kPixels] = {};
    alignas(64) float transmittance[kPixels];
    TileSums() { std::fill_n(transmittance, kPixels, 1.0f); }
};

// What all tiles of a part of the picture share.
struct ViewScene {
    const shader::Frame* frame = nullptr;
    std::span<const ScreenBall> balls;  // nearest first
    std::span<const ExactBall> exact;
    const float* shadow = nullptr;
    int shadow_size = 0;
};

struct ViewTile {
    int x = 0, y = 0;                     // first pixel
    std::span<const std::uint32_t> list;  // of balls, nearest first
};

}  // namespace nephos
#endif

HWY_BEFORE_NAMESPACE();
namespace nephos::HWY_NAMESPACE {

constexpr std::size_t kMaxLanes = 2 * shader::kTileWidth;

// Henyey-Greenstein (phase_function() of shaders/shared.h).
HWY_INLINE Floats phase_function(Floats cosine, float g) {
    const Floats base = hn::NegMulAdd(set(2.0f * g), cosine, set(1.0f + g * g));
    return hn::Div(set((1.0f - g * g) / (4.0f * shader::kPi)), hn::Mul(base, hn::Sqrt(base)));
}

// Balls of one vector, turned from rows into columns.
struct BallColumns {
    HWY_ALIGN float x[kMaxLanes], y[kMaxLanes], z[kMaxLanes], radius[kMaxLanes], least_radius[kMaxLanes],
        depth_scale[kMaxLanes], light[kMaxLanes], height[kMaxLanes], flash[kMaxLanes];

    BallColumns(std::span<const shader::ViewBall> balls, const shader::Frame& frame) {
        const std::size_t lanes = hn::Lanes(Lanes());
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const shader::ViewBall& ball = balls[std::min(lane, balls.size() - 1)];
            x[lane] = ball.x;
            y[lane] = ball.y;
            z[lane] = ball.z;
            radius[lane] = ball.radius;
            const bool widens = (ball.flags & shader::kAround) == 0;
            least_radius[lane] = widens ? shader::kMinRadiusPixels / frame.up.w : 0.0f;
            depth_scale[lane] = ball.depth_scale;
            light[lane] = ball.light;
            height[lane] = ball.height;
            flash[lane] = float(ball.flags >> 16) * (1.0f / 65535.0f);
        }
    }
};

// The light that a metaball scatters towards the eye (shaders/lighting.glsl).
struct Scattered {
    Floats3 diffuse;  // radiance that does not depend on the ray
    Floats3 direct;   // radiance per phase function
};

HWY_INLINE Scattered scattered_light(const BallColumns& ball, const Floats3& centre, Floats distance,
                                     const shader::Frame& frame) {
    const Lanes d;
    const Floats light = hn::Load(d, ball.light), one = set(1.0f);
    Floats multiple = light;  // T: light falls off in proportion to the way, to nothing
    if (!(frame.air_extinction.w > 0)) {
        const Floats depth = hn::Neg(hn::Log(d, hn::Max(light, set(1.0e-30f))));
        multiple = hn::Div(one, hn::MulAdd(set(frame.ambient_base.w), depth, one));
    }
    multiple = hn::Mul(set(frame.sunlight.w), multiple);
    const Floats height = hn::Load(d, ball.height), albedo = set(frame.ambient_top.w);
    const Floats3 sunlight = set3(frame.sunlight);
    Floats3 arriving = times_add(
        multiple, sunlight, mix(set3(frame.ambient_base), set3(frame.ambient_top), {height, height, height}));
    if (frame.flash.w > 0) {
        const Floats3 way = subtract(set3(frame.flash), centre);
        const Floats share = hn::Mul(set(frame.flash.w), hn::Load(d, ball.flash));
        arriving =
            times_add(hn::Mul(share, flash_falloff(dot(way, way))), set3(frame.flash_colour), arriving);
    }
    const Floats3 beta = decay(frame.air_extinction, distance);
    return {mix(set3(frame.horizon), times(albedo, arriving), beta),
            each_times(times(hn::Mul(hn::Mul(albedo, set(shader::kPi)), light), beta), sunlight)};
}

HWY_INLINE Floats phase_along(const shader::Frame& frame, const Floats3& ray) {
    return phase_function(dot(set3(frame.to_sun), ray), frame.to_sun.w);
}

// c0..c5 of the opacity. Plain loops of a fixed length: the compiler makes vectors of them.
void fit_opacity(const float* depth_scale, float (*fit)[kMaxLanes]) {
    float s[kMaxLanes];
    for (std::size_t i = 0; i < kMaxLanes; ++i) s[i] = shader::fit_parameter(depth_scale[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[0][i] = shader::opacity_c0(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[1][i] = shader::opacity_c1(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[2][i] = shader::opacity_c2(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[3][i] = shader::opacity_c3(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[4][i] = shader::opacity_c4(s[i]);
    for (std::size_t i = 0; i < kMaxLanes; ++i) fit[5][i] = shader::opacity_c5(s[i]);
}

// A vector of balls: `screen` gets up to one a lane, `exact` those that are not fitted, whose numbers begin
// with `number`.
void prepare_vector(std::span<const shader::ViewBall> balls, const shader::Frame& frame, ScreenBall* screen,
                    ExactBall* exact, std::uint32_t number) {
    const Lanes d;
    const BallColumns ball(balls, frame);
    const Floats3 centre{hn::Load(d, ball.x), hn::Load(d, ball.y), hn::Load(d, ball.z)};
    const Floats distance = hn::Sqrt(dot(centre, centre)), radius = hn::Load(d, ball.radius);
    const Floats drawn = hn::Max(radius, hn::Mul(hn::Load(d, ball.least_radius), distance));
    const Floats thinning = hn::Div(radius, drawn), per_radius = hn::Div(set(1.0f), drawn);
    const Scattered light = scattered_light(ball, centre, distance, frame);
    const Floats3 ray = times(hn::Div(set(1.0f), distance), centre);
    const Floats3 radiance = times_add(phase_along(frame, ray), light.direct, light.diffuse);

    const Floats3 in_radii = times(per_radius, centre), right = set3(frame.right), up = set3(frame.up);
    const Floats3 along_x = cross(in_radii, times(set(2.0f / frame.picture.x), right)),
                  along_y = cross(in_radii, times(set(-2.0f / frame.picture.y), up));
    const Floats depth = dot(set3(frame.forward), centre);
    const Floats across = hn::Div(dot(right, centre), hn::Mul(dot(right, right), depth)),
                 upward = hn::Div(dot(up, centre), hn::Mul(dot(up, up), depth));
    const Floats half_width = set(0.5f * frame.picture.x), half_height = set(0.5f * frame.picture.y);

    HWY_ALIGN float depth_scale[kMaxLanes] = {}, fit[6][kMaxLanes];
    hn::Store(hn::Mul(hn::Load(d, ball.depth_scale), hn::Mul(thinning, thinning)), d, depth_scale);
    fit_opacity(depth_scale, fit);
    HWY_ALIGN float field[18][kMaxLanes];
    const Floats fields[] = {hn::Sub(hn::MulAdd(across, half_width, half_width), set(frame.picture.z)),
                             hn::Sub(hn::NegMulAdd(upward, half_height, half_height), set(frame.picture.w)),
                             dot(along_x, along_x),
                             hn::Mul(set(2.0f), dot(along_x, along_y)),
                             dot(along_y, along_y),
                             radiance.x,
                             radiance.y,
                             radiance.z,
                             distance,
                             per_radius};
    for (std::size_t n = 0; n < std::size(fields); ++n) hn::Store(fields[n], d, field[n]);
    const bool some_exact = std::ranges::any_of(
        balls, [](const shader::ViewBall& each) { return (each.flags & shader::kNotFitted) != 0; });
    HWY_ALIGN float scattered[6][kMaxLanes];
    if (some_exact) {
        const Floats parts[] = {light.diffuse.x, light.diffuse.y, light.diffuse.z,
                                light.direct.x,  light.direct.y,  light.direct.z};
        for (std::size_t n = 0; n < std::size(parts); ++n) hn::Store(parts[n], d, scattered[n]);
    }
    for (std::size_t i = 0; i < balls.size(); ++i) {
        ScreenBall& to = screen[i];
        to.x = field[0][i];
        to.y = field[1][i];
        to.xx = field[2][i];
        to.xy = field[3][i];
        to.yy = field[4][i];
        for (std::size_t n = 0; n < 6; ++n) to.fit[n] = fit[n][i];
        to.red = field[5][i];
        to.green = field[6][i];
        to.blue = field[7][i];
        to.distance = field[8][i];
        if ((balls[i].flags & shader::kNotFitted) == 0) continue;
        const float scale = field[9][i];
        exact[number] = {.x = scale * balls[i].x,
                         .y = scale * balls[i].y,
                         .z = scale * balls[i].z,
                         .per_radius = scale,
                         .depth_scale = depth_scale[i],
                         .distance = to.distance,
                         .diffuse = {scattered[0][i], scattered[1][i], scattered[2][i]},
                         .direct = {scattered[3][i], scattered[4][i], scattered[5][i]}};
        to.x = std::bit_cast<float>(number++);
        to.distance = 0.0f;
    }
}

// `number`: of the first of these balls that is not fitted.
void prepare_balls(std::span<const shader::ViewBall> balls, const shader::Frame& frame, ScreenBall* screen,
                   ExactBall* exact, std::uint32_t number) {
    const std::size_t lanes = hn::Lanes(Lanes());
    for (std::size_t begin = 0; begin < balls.size(); begin += lanes) {
        const auto some = balls.subspan(begin, std::min(lanes, balls.size() - begin));
        prepare_vector(some, frame, screen + begin, exact, number);
        for (const shader::ViewBall& ball : some) number += (ball.flags & shader::kNotFitted) != 0 ? 1 : 0;
    }
}

// The pixels of a tile as the kernels need them.
struct TileRays {
    HWY_ALIGN float per_square[kTilePixels];  // 1 / |direction|^2
    HWY_ALIGN float x[kTilePixels], y[kTilePixels], z[kTilePixels], ground[kTilePixels];

    TileRays(const shader::Frame& frame, const ViewTile& tile, bool whole) {
        const Lanes d;
        const Layout layout;
        for (std::size_t block = 0; block < layout.blocks; ++block) {
            const FirstPixels first(layout, block);
            for (std::size_t row = 0; row < shader::kTileHeight; row += layout.rows) {
                const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
                const Floats3 direction =
                    pixel_direction(frame, hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                                    hn::Add(hn::Load(d, first.y), set(float(tile.y) + float(row))));
                const Floats per = hn::Div(set(1.0f), dot(direction, direction));
                hn::Store(per, d, per_square + at);
                if (!whole) continue;
                const Floats3 ray = times(hn::Sqrt(per), direction);
                hn::Store(ray.x, d, x + at);
                hn::Store(ray.y, d, y + at);
                hn::Store(ray.z, d, z + at);
                hn::Store(ground_distance(frame, ray.z), d, ground + at);
            }
        }
    }
};

// sum += transmittance * opacity * radiance; transmittance *= 1 - opacity
HWY_INLINE void add_to_sums(TileSums& sums, std::size_t at, Floats opacity, const Floats3& radiance,
                            Floats distance) {
    const Lanes d;
    const Floats before = hn::Load(d, sums.transmittance + at), part = hn::Mul(before, opacity);
    hn::Store(hn::Sub(before, part), d, sums.transmittance + at);
    hn::Store(hn::MulAdd(part, radiance.x, hn::Load(d, sums.red + at)), d, sums.red + at);
    hn::Store(hn::MulAdd(part, radiance.y, hn::Load(d, sums.green + at)), d, sums.green + at);
    hn::Store(hn::MulAdd(part, radiance.z, hn::Load(d, sums.blue + at)), d, sums.blue + at);
    hn::Store(hn::MulAdd(part, distance, hn::Load(d, sums.distance + at)), d, sums.distance + at);
}

struct Rows {
    std::size_t begin, end;  // of the tile
};

HWY_INLINE Rows rows_of(const ScreenBall& ball, const ViewTile& tile, const Layout& layout) {
    const int begin = std::clamp(ball.first - tile.y, 0, int(shader::kTileHeight)),
              end = std::clamp(ball.end - tile.y, 0, int(shader::kTileHeight));
    return {std::size_t(begin) / layout.rows * layout.rows, std::size_t(end)};
}

HWY_INLINE void add_fitted(const ScreenBall& ball, const ViewTile& tile, const Layout& layout,
                           const FirstPixels* first, const TileRays& rays, TileSums& sums) {
    const Lanes d;
    const Rows rows = rows_of(ball, tile, layout);
    const Floats3 radiance{set(ball.red), set(ball.green), set(ball.blue)};
    const Floats distance = set(ball.distance), one = set(1.0f), yy = set(ball.yy);
    const Floats c0 = set(ball.fit[0]), c1 = set(ball.fit[1]), c2 = set(ball.fit[2]), c3 = set(ball.fit[3]),
                 c4 = set(ball.fit[4]), c5 = set(ball.fit[5]);
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const Floats dx = hn::Add(hn::Load(d, first[block].x), set(float(tile.x) - ball.x)),
                     down = hn::Add(hn::Load(d, first[block].y), set(float(tile.y) - ball.y));
        const Floats across = hn::Mul(hn::Mul(set(ball.xx), dx), dx), slope = hn::Mul(set(ball.xy), dx);
        for (std::size_t row = rows.begin; row < rows.end; row += layout.rows) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats dy = hn::Add(down, set(float(row)));
            const Floats square = hn::MulAdd(dy, hn::MulAdd(yy, dy, slope), across);
            const Floats w =
                hn::Max(hn::NegMulAdd(square, hn::Load(d, rays.per_square + at), one), hn::Zero(d));
            const Floats w2 = hn::Mul(w, w);
            const Floats low = hn::MulAdd(w2, c2, hn::MulAdd(w, c1, c0)),
                         high = hn::MulAdd(w2, c5, hn::MulAdd(w, c4, c3));
            add_to_sums(sums, at, hn::Mul(w2, hn::MulAdd(hn::Mul(w2, w), high, low)), radiance, distance);
        }
    }
}

// shaders/integral.glsl: the part of the ball between the eye and the ground.
HWY_INLINE Floats integrated_opacity(const ExactBall& ball, const Floats3& ray, Floats ground_m) {
    const Lanes d;
    const Floats3 centre{set(ball.x), set(ball.y), set(ball.z)}, offset = cross(centre, ray);
    const Floats zero = hn::Zero(d);
    const Floats w = hn::Max(hn::Sub(set(1.0f), dot(offset, offset)), zero);
    const Floats half_chord = hn::Sqrt(w), middle = dot(centre, ray);
    const Floats start = hn::Max(hn::Neg(half_chord), hn::Neg(middle));
    const Floats end = hn::Min(half_chord, hn::MulSub(ground_m, set(ball.per_radius), middle));
    const Floats part = hn::Sub(column_part(w, end), column_part(w, start));
    const Floats depth = hn::IfThenElseZero(hn::Lt(start, end), hn::Mul(set(ball.depth_scale), part));
    return hn::Sub(set(1.0f), hn::Exp(d, hn::Neg(hn::Max(depth, zero))));
}

void add_exact(const ScreenBall& screen, const ExactBall& ball, const ViewTile& tile, const Layout& layout,
               const shader::Frame& frame, const TileRays& rays, TileSums& sums) {
    const Lanes d;
    const Rows rows = rows_of(screen, tile, layout);
    const Floats3 diffuse{set(ball.diffuse[0]), set(ball.diffuse[1]), set(ball.diffuse[2])},
        direct{set(ball.direct[0]), set(ball.direct[1]), set(ball.direct[2])};
    for (std::size_t at = rows.begin * shader::kTileWidth; at < rows.end * shader::kTileWidth;
         at += layout.lanes) {
        const Floats3 ray{hn::Load(d, rays.x + at), hn::Load(d, rays.y + at), hn::Load(d, rays.z + at)};
        const Floats opacity = integrated_opacity(ball, ray, hn::Load(d, rays.ground + at));
        if (hn::AllFalse(d, hn::Gt(opacity, hn::Zero(d)))) continue;
        add_to_sums(sums, at, opacity, times_add(phase_along(frame, ray), direct, diffuse),
                    set(ball.distance));
    }
}

bool is_opaque(const TileSums& sums, std::size_t lanes) {
    const Lanes d;
    Floats most = hn::Zero(d);
    for (std::size_t at = 0; at < kTilePixels; at += lanes)
        most = hn::Max(most, hn::Load(d, sums.transmittance + at));
    return hn::AllTrue(d, hn::Lt(most, set(shader::kOpaque)));
}

// Front to back, until the tile is opaque.
void add_balls(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    constexpr std::size_t kAtOnce = 8;  // between two looks at the sums
    const Layout layout;
    if (tile.list.empty() || is_opaque(sums, layout.lanes)) return;
    const TileRays rays(*scene.frame, tile, !scene.exact.empty());
    FirstPixels first[shader::kTileWidth] = {{layout, 0}, {layout, 1}, {layout, 2}, {layout, 3},
                                             {layout, 4}, {layout, 5}, {layout, 6}, {layout, 7}};
    for (std::size_t begin = 0; begin < tile.list.size(); begin += kAtOnce) {
        const std::size_t end = std::min(begin + kAtOnce, tile.list.size());
        for (std::size_t i = begin; i < end; ++i) {
            if (i + kAtOnce < tile.list.size()) hwy::Prefetch(&scene.balls[tile.list[i + kAtOnce]]);
            const ScreenBall& ball = scene.balls[tile.list[i]];
            if (ball.distance > 0) {
                add_fitted(ball, tile, layout, first, rays, sums);
            } else {
                const ExactBall& exact = scene.exact[std::bit_cast<std::uint32_t>(ball.x)];
                add_exact(ball, exact, tile, layout, *scene.frame, rays, sums);
            }
        }
        if (is_opaque(sums, layout.lanes)) break;
    }
}

// Adds what is seen of the background behind the clouds; distances become means.
void finish_tile(const ViewScene& scene, const ViewTile& tile, TileSums& sums) {
    const Lanes d;
    const Layout layout;
    const ShadowTexels map{scene.shadow, scene.shadow_size};
    for (std::size_t block = 0; block < layout.blocks; ++block) {
        const FirstPixels first(layout, block);
        for (std::size_t row = 0; row < shader::kTileHeight; row += layout.rows) {
            const std::size_t at = row * shader::kTileWidth + block * layout.lanes;
            const Floats left = hn::Min(hn::Load(d, sums.transmittance + at), set(1.0f));
            const Floats seen = hn::IfThenElseZero(hn::Ge(left, set(shader::kOpaque)), left);
            hn::Store(seen, d, sums.transmittance + at);
            const Floats opacity = hn::Sub(set(1.0f), seen);
            const auto has_depth = hn::Ge(opacity, set(kLeastOpacity));
            const Floats mean = hn::Div(hn::Load(d, sums.distance + at), opacity);
            const Floats infinity = set(std::numeric_limits<float>::infinity());
            hn::Store(hn::IfThenElse(has_depth, mean, infinity), d, sums.distance + at);
            if (hn::AllFalse(d, hn::Gt(seen, hn::Zero(d)))) continue;
            const Floats3 direction =
                pixel_direction(*scene.frame, hn::Add(hn::Load(d, first.x), set(float(tile.x))),
                                hn::Add(hn::Load(d, first.y), set(float(tile.y) + float(row))));
            const Floats3 ray = times(hn::Div(set(1.0f), hn::Sqrt(dot(direction, direction))), direction);
            const Floats3 behind = background(*scene.frame, map, ray);
            hn::Store(hn::MulAdd(seen, behind.x, hn::Load(d, sums.red + at)), d, sums.red + at);
            hn::Store(hn::MulAdd(seen, behind.y, hn::Load(d, sums.green + at)), d, sums.green + at);
            hn::Store(hn::MulAdd(seen, behind.z, hn::Load(d, sums.blue + at)), d, sums.blue + at);
        }
    }
}

}  // namespace nephos::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace nephos {

HWY_EXPORT(prepare_balls);
HWY_EXPORT(add_balls);
HWY_EXPORT(finish_tile);

namespace {

std::int16_t to_row(int y) { return std::int16_t(std::clamp(y, -32768, 32767)); }

struct PreparedBalls {
    std::vector<ScreenBall> screen;  // nearest first
    std::vector<ExactBall> exact;
};

// `balls`: farthest first.
PreparedBalls prepare(std::span<const shader::ViewBall> balls, std::span<const PixelBox> boxes,
                      const shader::Frame& frame) {
    constexpr std::size_t kPart = 2048;
    const std::size_t count = balls.size(), parts = (count + kPart - 1) / kPart;
    std::vector<std::uint32_t> numbers(parts + 1, 0);
    for (std::size_t i = 0; i < count; ++i)
        numbers[i / kPart + 1] += (balls[count - 1 - i].flags & shader::kNotFitted) != 0 ? 1 : 0;
    for (std::size_t p = 0; p < parts; ++p) numbers[p + 1] += numbers[p];
    PreparedBalls prepared;
    prepared.screen.resize(count);
    prepared.exact.resize(numbers[parts]);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
        const std::size_t begin = p * kPart, end = std::min(count, begin + kPart);
        const std::vector<shader::ViewBall> near_first(balls.rbegin() + std::ptrdiff_t(begin),
                                                       balls.rbegin() + std::ptrdiff_t(end));
        HWY_DYNAMIC_DISPATCH(prepare_balls)
        (near_first, frame, &prepared.screen[begin], prepared.exact.data(), numbers[p]);
        for (std::size_t i = begin; i < end; ++i) {
            prepared.screen[i].first = to_row(boxes[i].y0);
            prepared.screen[i].end = to_row(boxes[i].y1);
        }
    });
    return prepared;
}

void store(const TileSums& sums, const ViewTile& tile, const Tile& part, bool depth, Picture& picture) {
    const int columns = std::min(int(shader::kTileWidth), part.width - tile.x),
              rows = std::min(int(shader::kTileHeight), part.height - tile.y);
    for (int y = 0; y < rows; ++y) {
        std::size_t from = std::size_t(y) * shader::kTileWidth;
        std::size_t to =
            std::size_t(part.y + tile.y + y) * std::size_t(picture.width) + std::size_t(part.x + tile.x);
        for (int x = 0; x < columns; ++x, ++from, ++to) {
            picture.beauty[3 * to] = sums.red[from];
            picture.beauty[3 * to + 1] = sums.green[from];
            picture.beauty[3 * to + 2] = sums.blue[from];
            picture.transmittance[to] = sums.transmittance[from];
            picture.depth_m[to] = depth ? sums.distance[from] : std::numeric_limits<float>::infinity();
        }
    }
}

}  // namespace

void view_by_processor(const RenderOptions& options, const CameraFrame& camera, const shader::Frame& frame,
                       const Tile& part, const EyeOrder& order, Picture& picture, const BatchLimits& limits) {
    const TileGrid grid{part.width, part.height};
    const std::vector<PixelBox> boxes = screen_boxes(order, camera, options.camera, part);
    std::vector<TileSums> kept;  // between batches
    std::size_t begin = 0;
    do {  // once even without any ball, for the background
        const std::size_t end = end_of_batch(boxes, begin, grid, limits.boxes, limits.entries);
        const std::span some = std::span(boxes).subspan(begin, end - begin);
        const PreparedBalls balls =
            prepare(std::span(order.balls).subspan(boxes.size() - end, end - begin), some, frame);
        const TileBins bins = bin_into_tiles(some, grid);
        const ViewScene scene{&frame, balls.screen, balls.exact, picture.shadow.data(), picture.shadow_size};
        const bool last = end == boxes.size();
        if (begin == 0 && !last) kept.resize(grid.tiles());
        tbb::parallel_for(std::size_t{0}, grid.tiles(), [&](std::size_t t) {
            const auto columns = std::size_t(grid.columns());
            const shader::TileRange range = bins.ranges[t];
            const ViewTile tile{int(t % columns) * int(shader::kTileWidth),
                                int(t / columns) * int(shader::kTileHeight),
                                std::span(bins.list).subspan(range.begin, range.end - range.begin)};
            TileSums own;
            TileSums& sums = kept.empty() ? own : kept[t];
            HWY_DYNAMIC_DISPATCH(add_balls)(scene, tile, sums);
            if (!last) return;
            HWY_DYNAMIC_DISPATCH(finish_tile)(scene, tile, sums);
            store(sums, tile, part, order.depth, picture);
        });
        begin = end;
    } while (begin < boxes.size());
}

}  // namespace nephos
#endif
