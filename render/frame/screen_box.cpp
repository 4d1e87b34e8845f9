// SPDX-License-Identifier: Apache-2.0
#include "render/frame/screen_box.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "core/vec.h"
#include "render/frame/billboard_textures.h"
#include "render/frame/tile_bins.h"
#include "render/shared/half_floats.h"

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

// The projection shared by all boxes.
struct Screen {
    const CameraFrame& camera;
    const PicturePart& part;
    double half_width, half_height;  // of the picture, pixels
    double per_x, per_y;             // pixels per unit of a tangent
    double least_radius;             // of a splat at distance 1

    Screen(const CameraFrame& frame, const Camera& options, const PicturePart& area)
        : camera(frame),
          part(area),
          half_width(0.5 * options.width),
          half_height(0.5 * options.height),
          per_x(half_width / frame.half_width),
          per_y(half_height / frame.half_height),
          least_radius(double(shader::kMinRadiusPixels) / pixels_per_unit(options, frame)) {}
};

PixelBox screen_box(const shader::ViewBall& ball, const Screen& screen) {
    const Vec3 centre{ball.x, ball.y, ball.z};
    const double depth = dot(centre, screen.camera.forward);
    const double radius = 1.0001 * std::max(double(ball.radius), screen.least_radius * length(centre));
    if ((ball.flags & shader::kAround) != 0 || depth <= 1.001 * radius)
        return {0, 0, screen.part.width, screen.part.height};
    const Tangents x = tangents(dot(centre, screen.camera.right), depth, radius);
    const Tangents y = tangents(dot(centre, screen.camera.up), depth, radius);
    return {floor_to_pixel(screen.half_width + x.least * screen.per_x) - screen.part.x,
            floor_to_pixel(screen.half_height - y.largest * screen.per_y) - screen.part.y,
            ceil_to_pixel(screen.half_width + x.largest * screen.per_x) - screen.part.x,
            ceil_to_pixel(screen.half_height - y.least * screen.per_y) - screen.part.y};
}

// Middles of pixels within a rectangle whose half sizes are given. The outermost texels are clear, so nothing
// is seen beyond the middles of the texels.
PixelBox screen_box(const shader::ViewBillboard& billboard, const Screen& screen) {
    const Vec3 centre{billboard.x, billboard.y, billboard.z};
    const auto [reach_x, reach_y] = unpack_halves(billboard.half_size);
    const double per_depth = 1 / dot(centre, screen.camera.forward);
    const double per_x = screen.per_x * per_depth, per_y = screen.per_y * per_depth;
    const double seen = 1.0001 * (1 - 1.0 / (kBillboardTexels >> (billboard.texture_bits >> 12 & 15u)));
    const double x = screen.half_width + dot(centre, screen.camera.right) * per_x - screen.part.x,
                 y = screen.half_height - dot(centre, screen.camera.up) * per_y - screen.part.y;
    const double across = seen * double(reach_x) * per_x + 0.001,
                 down = seen * double(reach_y) * per_y + 0.001;
    return {ceil_to_pixel(x - across - 0.5), ceil_to_pixel(y - down - 0.5), floor_to_pixel(x + across + 0.5),
            floor_to_pixel(y + down + 0.5)};
}

}  // namespace

std::vector<std::uint32_t> splats_near_to_far(const ViewSortedSplats& order) {
    std::vector<std::uint32_t> splats(order.balls.size() + order.billboards.size());
    std::size_t next = 0;
    for (auto run = order.runs.rbegin(); run != order.runs.rend(); ++run) {
        const std::uint32_t kind = run->kind == SplatKind::billboard ? kBillboardSplat : 0;
        for (std::uint32_t i = run->end; i-- > run->begin;) splats[next++] = i | kind;
    }
    return splats;
}

std::vector<PixelBox> screen_boxes(const ViewSortedSplats& order, const CameraFrame& camera,
                                   const Camera& options, const PicturePart& part,
                                   std::span<const std::uint32_t> splats) {
    const std::size_t count = order.balls.size() + order.billboards.size();
    const Screen screen(camera, options, part);
    std::vector<PixelBox> boxes(count);
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 4096), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            const std::uint32_t splat = splats.empty() ? std::uint32_t(count - 1 - i) : splats[i];
            boxes[i] = (splat & kBillboardSplat) != 0
                           ? screen_box(order.billboards[splat & ~kBillboardSplat], screen)
                           : screen_box(order.balls[splat], screen);
        }
    });
    return boxes;
}

}  // namespace nephos
