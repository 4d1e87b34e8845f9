// SPDX-License-Identifier: Apache-2.0
#include "render/screen_box.h"

#include <algorithm>
#include <cmath>
#include <ranges>

#include <tbb/parallel_for.h>

#include "automaton/vector_math.h"
#include "render/half_floats.h"
#include "render/puff_textures.h"

namespace nephos {
namespace {

// Least and largest of a sphere's tangents: `across` and `depth` are its centre's coordinates across and
// along the view, with depth > radius.
struct Tangents {
    double least, largest;
};

Tangents tangents(double across, double depth, double radius) {
    const double root = radius * std::sqrt(across * across + depth * depth - radius * radius);
    const double scale = 1.0 / (depth * depth - radius * radius);
    return {(across * depth - root) * scale, (across * depth + root) * scale};
}

// Far beyond any picture, and far from the limits of int.
int to_pixel(double value) { return int(std::clamp(value, -1e6, 1e6)); }

PixelBox screen_box(const shader::ViewBall& ball, const CameraFrame& camera, const Camera& options,
                    const Tile& tile) {
    const PixelBox everything{0, 0, tile.width, tile.height};
    const Vec3 centre{ball.x, ball.y, ball.z};
    const double depth = dot(centre, camera.forward);
    const double least = double(shader::kMinRadiusPixels) * length(centre) / pixels_per_unit(options, camera);
    const double radius = 1.0001 * std::max(double(ball.radius), least);
    if ((ball.flags & shader::kAround) != 0 || depth <= 1.001 * radius) return everything;
    const Tangents x = tangents(dot(centre, camera.right), depth, radius);
    const Tangents y = tangents(dot(centre, camera.up), depth, radius);
    const double half_width = 0.5 * options.width, half_height = 0.5 * options.height;
    const double per_x = half_width / camera.half_width, per_y = half_height / camera.half_height;
    return {to_pixel(std::floor(half_width + x.least * per_x)) - tile.x,
            to_pixel(std::floor(half_height - y.largest * per_y)) - tile.y,
            to_pixel(std::ceil(half_width + x.largest * per_x)) - tile.x,
            to_pixel(std::ceil(half_height - y.least * per_y)) - tile.y};
}

// Middles of pixels within a rectangle whose half sizes are given. The outermost texels are clear, so nothing
// is seen beyond the middles of the texels.
PixelBox screen_box(const shader::Puff& puff, const CameraFrame& camera, const Camera& options,
                    const Tile& tile) {
    const Vec3 centre{puff.x, puff.y, puff.z};
    const auto [reach_x, reach_y] = unpack_halves(puff.half_size);
    const double per_depth = 1 / dot(centre, camera.forward);
    const double half_width = 0.5 * options.width, half_height = 0.5 * options.height;
    const double per_x = half_width / camera.half_width * per_depth,
                 per_y = half_height / camera.half_height * per_depth;
    const double seen = 1.0001 * (1 - 1.0 / (kPuffTexels >> (puff.texture_bits >> 12)));
    const double x = half_width + dot(centre, camera.right) * per_x - tile.x,
                 y = half_height - dot(centre, camera.up) * per_y - tile.y;
    const double across = seen * double(reach_x) * per_x + 0.001,
                 down = seen * double(reach_y) * per_y + 0.001;
    return {to_pixel(std::ceil(x - across - 0.5)), to_pixel(std::ceil(y - down - 0.5)),
            to_pixel(std::floor(x + across + 0.5)), to_pixel(std::floor(y + down + 0.5))};
}

}  // namespace

std::vector<std::uint32_t> splats_near_to_far(const EyeOrder& order) {
    std::vector<std::uint32_t> splats(order.balls.size() + order.puffs.size());
    std::size_t next = 0;
    for (const Run& run : order.runs | std::views::reverse) {
        const std::uint32_t kind = run.kind == SplatKind::billboard ? kPuffSplat : 0;
        for (std::uint32_t i = run.end; i-- > run.begin;) splats[next++] = i | kind;
    }
    return splats;
}

std::vector<PixelBox> screen_boxes(const EyeOrder& order, const CameraFrame& camera, const Camera& options,
                                   const Tile& tile, std::span<const std::uint32_t> splats) {
    const std::size_t count = order.balls.size() + order.puffs.size();
    std::vector<PixelBox> boxes(count);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 4096), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const std::uint32_t splat = splats.empty() ? std::uint32_t(count - 1 - i) : splats[i];
            boxes[i] = (splat & kPuffSplat) != 0
                           ? screen_box(order.puffs[splat & ~kPuffSplat], camera, options, tile)
                           : screen_box(order.balls[splat], camera, options, tile);
        }
    });
    return boxes;
}

}  // namespace nephos
