// SPDX-License-Identifier: Apache-2.0
// Metaballs beside rays that march; needs order.glsl and render/shared/march.h.

// Weight of a metaball beside what is marched in its place.
float splatted_weight(CloudBall ball, float distance) {
    return frame.march.x > 0.0 && ball.detailed != 0u ? splatted_weight(distance * frame.march.x / frame.forward.w) : 1.0;
}
