// SPDX-License-Identifier: Apache-2.0
#include "render/image/line_overlay.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "core/vec.h"
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
    const double scale = std::exp2(-camera.exposure_ev);
    for (const WorldLine& line : lines) {
        const std::optional<Segment> segment = projected(line, frame, camera);
        if (!segment) continue;
        draw(picture, *segment, {scale * line.colour[0], scale * line.colour[1], scale * line.colour[2]},
             line.width_pixels);
    }
}

}  // namespace nephos
