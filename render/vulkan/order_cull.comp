// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "render/shared/order.h"
#include "render/shared/march.h"
// Order from the eye, first: which splats may be seen, and their distances as keys.
#include "render/vulkan/order.glsl"
#include "render/vulkan/exact_distance.glsl"
#include "render/vulkan/ball_weight.glsl"

layout(local_size_x = kSortGroup) in;

bool is_seen(CloudBall ball, FromEye place) {
    if (frame.middle.z > 0.0 && place.above_ground + ball.radius < 0.0) return false;
    float reach = kCullReach * widened_radius(ball.radius, place.distance);
    for (uint n = 0u; n < 5u; ++n) {
        if (dot(place.offset, frame.inward[n].xyz) < -reach) return false;
    }
    return true;
}

void main() {
    uint i = work_group() * kSortGroup + gl_LocalInvocationID.x;
    if (i >= step.count + step.billboards) return;
    if (i >= step.count) {  // the host has culled them
        keys_to[i] = floatBitsToUint(billboards[i - step.count].distance);
        table[i] = 1u;
        return;
    }
    CloudBall ball = cloud[i];
    FromEye place = from_eye(ball);
    bool seen = is_seen(ball, place) && splatted_weight(ball, place.distance) > 0.0;
    keys_to[i] = seen ? floatBitsToUint(place.distance) : kCulled;
    table[i] = seen ? 1u : 0u;
}
