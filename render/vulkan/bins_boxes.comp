// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
// Boxes of the splats, in tiles of the picture (screen_box.cpp, tile_bins.cpp).
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"

layout(local_size_x = kSortGroup) in;

// Least and largest tangent of a sphere across the view; depth > radius. In factors that lose nothing to rounding near
// the eye.
vec2 tangents(float across, float depth, float radius) {
    float square = (depth - radius) * (depth + radius);
    float root = radius * sqrt(across * across + square);
    return (vec2(across * depth) + vec2(-root, root)) / square;
}

// Pixels of the picture, x0 y0 x1 y1, half-open.
ivec4 screen_box(CloudBall ball, FromEye place) {
    float depth = dot(place.offset, frame.forward.xyz);
    float radius = 1.0001 * widened_radius(ball.radius, place.distance);
    ivec4 everything = ivec4(-1000000, -1000000, 1000000, 1000000);
    if (place.distance < kNearDistance * ball.radius || depth <= 1.001 * radius) return everything;
    vec2 x = tangents(dot(place.offset, frame.right.xyz), depth, radius) * frame.right.w;
    vec2 y = tangents(dot(place.offset, frame.up.xyz), depth, radius) * frame.up.w;
    vec4 box = vec4(floor(frame.middle.x + x.x), floor(frame.middle.y - y.y), ceil(frame.middle.x + x.y),
                    ceil(frame.middle.y - y.x));
    return ivec4(clamp(box, vec4(-1.0e6), vec4(1.0e6)));
}

// Middles of pixels within the rectangle between the middles of the outermost texels, which are clear.
ivec4 screen_box(ViewBillboard billboard) {
    vec3 centre = vec3(billboard.x, billboard.y, billboard.z);
    vec2 per_m = vec2(frame.right.w, frame.up.w) / dot(centre, frame.forward.xyz);
    float visible = 1.0001 * (1.0 - 1.0 / float(kBillboardTexels >> (billboard.texture_bits >> 12 & 15u)));
    vec2 middle = frame.middle.xy + vec2(dot(centre, frame.right.xyz), -dot(centre, frame.up.xyz)) * per_m;
    vec2 extent = visible * unpackHalf2x16(billboard.half_size) * per_m + 0.001;
    vec4 box = vec4(ceil(middle - extent - 0.5), floor(middle + extent + 0.5));
    return ivec4(clamp(box, vec4(-1.0e6), vec4(1.0e6)));
}

void main() {
    uint k = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (k >= counts.visible) return;
    uint i = values_from[k];
    ivec4 box;
    if (i < step.count) {
        CloudBall ball = cloud[i];
        box = screen_box(ball, from_eye(ball));
    } else {
        box = screen_box(billboards[i - step.count].billboard);
    }
    box -= ivec4(step.x, step.y, step.x, step.y);
    ivec2 first = max(box.xy, ivec2(0)), end = min(box.zw, ivec2(step.width, step.height));
    uvec2 low = uvec2(0u), high = uvec2(0u), tile = uvec2(kTileWidth, kTileHeight);
    if (first.x < end.x && first.y < end.y) {
        low = uvec2(first) / tile;
        high = (uvec2(end) + tile - 1u) / tile;
    }
    boxes[k] = uvec2(low.x | low.y << 16, high.x | high.y << 16);
}
