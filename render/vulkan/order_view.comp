// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
#include "render/shared/march.h"
// Order from the eye, last: splats as the eye sees them, nearest first (view_sorting.cpp).
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/ball_weight.glsl"

layout(local_size_x = kSortGroup) in;

// Returns true when the tiles can draw it as an ellipse with a polynomial.
bool is_fitted(CloudBall ball, FromEye place) {
    float radius = widened_radius(ball.radius, place.distance), depth = dot(place.offset, frame.forward.xyz);
    return ball.depth_scale <= kMaxFittedDepth && depth >= 1.01 * radius && radius * frame.forward.w <= 60000.0 * depth;
}

uint flags_of(CloudBall ball, FromEye place) {
    uint flags = 0u;
    if (place.distance < kNearDistance * ball.radius) flags |= kAround | kIntegrate;
    if (frame.middle.z > 0.0 && place.above_ground - ball.radius < 0.0) flags |= kIntegrate;
    if (ball.depth_scale > kMaxDepthScale) flags |= kIntegrate;
    if (flags != 0u || !is_fitted(ball, place)) flags |= kNotFitted;
    return flags;
}

void main() {
    uint k = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (k >= counts.visible) {  // passes with other work groups look a little beyond the end
        if (k < groups_of(counts.visible, kSortGroup) * kSortGroup) balls[k] = ViewBall(0.0, 0.0, 1.0, 0.1, 0.0, 0.0, 0.0, 0u);
        return;
    }
    uint i = values_from[k];
    if (i >= step.count) {
        uint index = i - step.count;
        ViewBillboard billboard = billboards[index].billboard;
        balls[k] = ViewBall(billboard.x, billboard.y, billboard.z, 0.0, 0.0, 0.0, 0.0, kBillboardFlag | index << 4);
        return;
    }
    CloudBall ball = cloud[i];
    FromEye place = from_eye(ball);
    ball.depth_scale *= splatted_weight(ball, place.distance);
    uint flags = flags_of(ball, place);
    if ((flags & kNotFitted) != 0u) atomicMax(counts.not_fitted, 1u);
    if (frame.middle.w > 0.0) flags |= flash_fraction[i] << 16;
    balls[k] = ViewBall(place.offset.x, place.offset.y, place.offset.z, ball.radius, ball.depth_scale, ball.sun_depth,
                        ball.height, flags);
}
