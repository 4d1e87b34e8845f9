// SPDX-License-Identifier: Apache-2.0
// Metaballs beside rays that march; needs order.glsl and render/shared/march.h.

// Weight of a metaball beside what is marched in its place.
float splatted_weight(CloudBall ball, float distance) {
    if (!(frame.march.x > 0.0) || ball.detailed == 0u) return 1.0;
    return ball.detailed == kNeverSplattedBall ? 0.0 : splatted_weight(distance * frame.march.x / frame.forward.w);
}
