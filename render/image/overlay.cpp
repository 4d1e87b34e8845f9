// SPDX-License-Identifier: Apache-2.0
#include "render/image/overlay.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/vec.h"
#include "render/image/exposure.h"
#include "render/options/camera.h"

namespace nephos {
namespace {

constexpr double kNear_m = 0.1;

// In pixels.
struct Segment {
    Vec2 from{}, to{};
};

// Shortens the part of a segment whose `value` goes from a to b to where the value is >= 0; false if nothing
// is left.
bool clip(double a, double b, double& begin, double& end) {
    if (a < 0 && b < 0) return false;
    if (a < 0) begin = std::max(begin, a / (a - b));
    if (b < 0) end = std::min(end, a / (a - b));
    return begin < end;
}

// Projects a line and clips it at the eye's plane and at the picture's sides with a margin.
std::optional<Segment> projected(const WorldLine& line, const CameraFrame& frame, const Camera& camera) {
    Vec3 from = line.from_m, to = line.to_m;
    double begin = 0, end = 1;
    const auto depth = [&](const Vec3& point) {
        return dot(point - frame.position_m, frame.forward) - kNear_m;
    };
    if (!clip(depth(from), depth(to), begin, end)) return {};
    const Vec3 way = to - from;
    to = from + end * way;
    from = from + begin * way;
    const PixelPosition a = project(frame, camera, from), b = project(frame, camera, to);
    begin = 0;
    end = 1;
    const double margin = line.width_pixels + 1;
    if (!clip(a.x + margin, b.x + margin, begin, end) || !clip(a.y + margin, b.y + margin, begin, end) ||
        !clip(camera.width + margin - a.x, camera.width + margin - b.x, begin, end) ||
        !clip(camera.height + margin - a.y, camera.height + margin - b.y, begin, end))
        return {};
    const auto at = [&](double t) { return Vec2{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)}; };
    return Segment{at(begin), at(end)};
}

double distance(const Vec2& point, const Segment& segment) {
    const double dx = segment.to.x - segment.from.x, dy = segment.to.y - segment.from.y;
    const double px = point.x - segment.from.x, py = point.y - segment.from.y;
    const double squared = dx * dx + dy * dy;
    const double t = squared > 0 ? std::clamp((px * dx + py * dy) / squared, 0.0, 1.0) : 0.0;
    return std::hypot(px - t * dx, py - t * dy);
}

// Draws along the longer axis: in each row or column the pixels near the line.
void draw(Picture& picture, const Segment& segment, const Rgb& colour, double width) {
    const bool steep = std::abs(segment.to.y - segment.from.y) > std::abs(segment.to.x - segment.from.x);
    const auto along = [&](const Vec2& p) { return steep ? p.y : p.x; };
    const auto across = [&](const Vec2& p) { return steep ? p.x : p.y; };
    Vec2 from = segment.from, to = segment.to;
    if (along(from) > along(to)) std::swap(from, to);
    const double reach = 0.5 * width + 1;
    const int first = std::max(0, int(std::floor(along(from) - reach)));
    const int last =
        std::min((steep ? picture.height : picture.width) - 1, int(std::ceil(along(to) + reach)));
    const double slope = (across(to) - across(from)) / std::max(along(to) - along(from), 1e-9);
    for (int i = first; i <= last; ++i) {
        const double middle =
            across(from) + std::clamp(i + 0.5 - along(from), 0.0, along(to) - along(from)) * slope;
        const int low = std::max(0, int(std::floor(middle - 1.5 * reach)));
        const int high =
            std::min((steep ? picture.width : picture.height) - 1, int(std::ceil(middle + 1.5 * reach)));
        for (int j = low; j <= high; ++j) {
            const int x = steep ? j : i, y = steep ? i : j;
            const double cover = std::clamp(0.5 * width + 0.5 - distance({x + 0.5, y + 0.5}, segment), 0.0,
                                            std::min(width, 1.0));
            if (cover <= 0) continue;
            float* pixel =
                &picture.beauty[3 * (std::size_t(y) * std::size_t(picture.width) + std::size_t(x))];
            for (std::size_t c = 0; c < 3; ++c)
                pixel[c] = float(pixel[c] + cover * (colour[c] - double(pixel[c])));
        }
    }
}

}  // namespace

void draw_lines(Picture& picture, const Camera& camera, std::span<const WorldLine> lines) {
    const CameraFrame frame = camera_frame(camera);
    const double scale = std::exp2(-exposure_ev(picture, camera));
    for (const WorldLine& line : lines) {
        const std::optional<Segment> segment = projected(line, frame, camera);
        if (!segment) continue;
        draw(picture, *segment, {scale * line.colour[0], scale * line.colour[1], scale * line.colour[2]},
             line.width_pixels);
    }
}

namespace {

constexpr int kBandRows = 16;
constexpr float kWide = 2.5f;  // pixels; from here on ends are round

struct Rows {
    int first = 0, end = 0;
};

// Rows or columns whose middles lie within `reach` of a..b.
Rows touched(float a, float b, float reach, int limit) {
    const float low = std::min(a, b) - reach, high = std::max(a, b) + reach;
    if (!(high > 0.0f && low < float(limit))) return {};
    return {std::max(0, int(std::floor(low))), std::min(limit, int(std::floor(high)) + 1)};
}

// Twice as far as a streak reaches on either side.
float reach_of(const Streak& s) { return s.width + 1.0f; }

void blend(Picture& picture, const Streak& s, int x, int y, float cover) {
    const std::size_t i = std::size_t(y) * std::size_t(picture.width) + std::size_t(x);
    if (!picture.terrain_m.empty() && s.distance_m > picture.terrain_m[i]) return;
    const float seen = s.distance_m <= picture.depth_m[i] ? 1.0f : picture.transmittance[i];
    const float fraction = s.opacity * cover * seen;
    float* pixel = &picture.beauty[3 * i];
    pixel[0] += fraction * (s.red - pixel[0]);
    pixel[1] += fraction * (s.green - pixel[1]);
    pixel[2] += fraction * (s.blue - pixel[2]);
}

// Along the longer axis, in each row (steep) or column the pixels near the middle line.
template <bool steep>
void draw_thin(Picture& picture, const Streak& s, const Rows& band) {
    float from = steep ? s.y0 : s.x0, to = steep ? s.y1 : s.x1;
    float across_from = steep ? s.x0 : s.y0, across_to = steep ? s.x1 : s.y1;
    if (from > to) {
        std::swap(from, to);
        std::swap(across_from, across_to);
    }
    const float length = to - from, slope = (across_to - across_from) / std::max(length, 1e-6f);
    const float half = 0.5f * s.width * std::sqrt(1.0f + slope * slope);
    Rows along = touched(from, to, 0.5f, steep ? picture.height : picture.width);
    if (steep) along = {std::max(along.first, band.first), std::min(along.end, band.end)};
    for (int i = along.first; i < along.end; ++i) {
        const float at = float(i) + 0.5f - from;
        const float end_cover = std::clamp(std::min(at, length - at) + 0.5f, 0.0f, 1.0f);
        const float middle = across_from + std::clamp(at, 0.0f, length) * slope;
        Rows across = touched(middle, middle, half + 0.5f, steep ? picture.width : picture.height);
        if (!steep) across = {std::max(across.first, band.first), std::min(across.end, band.end)};
        for (int j = across.first; j < across.end; ++j) {
            const float cover =
                end_cover * std::clamp(half + 0.5f - std::abs(float(j) + 0.5f - middle), 0.0f, 1.0f);
            if (cover > 0.0f) blend(picture, s, steep ? j : i, steep ? i : j, cover);
        }
    }
}

// Draws a streak by the distance from its axis, with round ends; the wider, the softer its edge.
void draw_wide(Picture& picture, const Streak& s, const Rows& band) {
    const float dx = s.x1 - s.x0, dy = s.y1 - s.y0, length = std::sqrt(dx * dx + dy * dy);
    const float half = 0.5f * s.width, cut = std::min(half, 0.5f * length) / std::max(length, 1e-6f);
    const float ax = s.x0 + cut * dx, ay = s.y0 + cut * dy;
    const float bx = (1.0f - 2.0f * cut) * dx, by = (1.0f - 2.0f * cut) * dy;
    const float squared = bx * bx + by * by, soft = std::max(1.0f, 0.6f * s.width);
    Rows rows = touched(s.y0, s.y1, reach_of(s), picture.height);
    rows = {std::max(rows.first, band.first), std::min(rows.end, band.end)};
    const Rows columns = touched(s.x0, s.x1, reach_of(s), picture.width);
    for (int y = rows.first; y < rows.end; ++y) {
        for (int x = columns.first; x < columns.end; ++x) {
            const float px = float(x) + 0.5f - ax, py = float(y) + 0.5f - ay;
            const float t = squared > 0 ? std::clamp((px * bx + py * by) / squared, 0.0f, 1.0f) : 0.0f;
            const float beside_x = px - t * bx, beside_y = py - t * by;
            const float distance = std::sqrt(beside_x * beside_x + beside_y * beside_y);
            const float cover = std::clamp((half + 0.5f * soft - distance) / soft, 0.0f, 1.0f);
            if (cover > 0.0f) blend(picture, s, x, y, cover);
        }
    }
}

void draw(Picture& picture, const Streak& s, const Rows& band) {
    if (s.width > kWide) {
        draw_wide(picture, s, band);
    } else if (std::abs(s.y1 - s.y0) >= std::abs(s.x1 - s.x0)) {
        draw_thin<true>(picture, s, band);
    } else {
        draw_thin<false>(picture, s, band);
    }
}

// The streaks that touch each band of rows, in their order, as one list with a begin for each band.
struct Bands {
    std::vector<std::uint32_t> begin, list;
};

Bands bands_of(std::span<const Streak> streaks, int height) {
    const auto of = [&](const Streak& s) {
        const Rows rows = touched(s.y0, s.y1, reach_of(s), height);
        return Rows{rows.first / kBandRows, (rows.end + kBandRows - 1) / kBandRows};
    };
    Bands bands;
    bands.begin.assign(std::size_t((height + kBandRows - 1) / kBandRows) + 1, 0);
    for (const Streak& s : streaks)
        for (Rows b = of(s); b.first < b.end; ++b.first) ++bands.begin[std::size_t(b.first) + 1];
    for (std::size_t b = 1; b < bands.begin.size(); ++b) bands.begin[b] += bands.begin[b - 1];
    bands.list.resize(bands.begin.back());
    std::vector<std::uint32_t> next(bands.begin.begin(), bands.begin.end() - 1);
    for (std::size_t i = 0; i < streaks.size(); ++i)
        for (Rows b = of(streaks[i]); b.first < b.end; ++b.first)
            bands.list[next[std::size_t(b.first)]++] = std::uint32_t(i);
    return bands;
}

}  // namespace

void draw_streaks(Picture& picture, std::span<const Streak> streaks) {
    const Bands bands = bands_of(streaks, picture.height);
    tbb::parallel_for(std::size_t(0), bands.begin.size() - 1, [&](std::size_t b) {
        const Rows rows{int(b) * kBandRows, std::min(picture.height, (int(b) + 1) * kBandRows)};
        for (std::uint32_t i = bands.begin[b]; i < bands.begin[b + 1]; ++i)
            draw(picture, streaks[bands.list[i]], rows);
    });
}

}  // namespace nephos
