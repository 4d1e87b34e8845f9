// SPDX-License-Identifier: Apache-2.0
// Offsets and distances from the eye in sums of two floats, some 45 bits: the host's doubles and these give the same
// float but for one of some 10^6, and so the same order. Sums and products without loss: T. J. Dekker, "A floating-point
// technique for extending the available precision", 1971; D. E. Knuth, The Art of Computer Programming 2, 4.2.2.
#include "render/vulkan/pairs.glsl"

Pair exact_square(float a) {
    Pair half_ = halves(a);
    precise float square = a * a;
    precise float rest = ((half_.high * half_.high - square) + 2.0 * half_.high * half_.low) + half_.low * half_.low;
    return Pair(square, rest);
}

Pair add_pairs(Pair a, Pair b) {
    Pair sum = exact_sum(a.high, b.high);
    precise float rest = sum.low + (a.low + b.low);
    return exact_sum(sum.high, rest);
}

Pair offset_from(float place, float high, float low) {
    Pair offset = exact_sum(place, -high);
    precise float rest = offset.low - low;
    return exact_sum(offset.high, rest);
}

Pair square_of(Pair a) {
    Pair square = exact_square(a.high);
    precise float rest = square.low + 2.0 * a.high * a.low;
    return exact_sum(square.high, rest);
}

// Newton's method; the last sum rounds.
float root_of(Pair square) {
    if (!(square.high > 1.0e-30)) return 0.0;
    precise float root = sqrt(square.high);
    for (int n = 0; n < 2; ++n) {
        Pair own = exact_square(root);
        precise float rest = ((square.high - own.high) - own.low) + square.low;
        root = root + rest / (2.0 * root);
    }
    return root;
}

struct FromEye {
    vec3 offset;
    float distance;
    float above_ground;  // the centre's height
};

FromEye from_eye(CloudBall ball) {
    Pair x = offset_from(ball.x, frame.eye_high.x, frame.eye_low.x);
    Pair y = offset_from(ball.y, frame.eye_high.y, frame.eye_low.y);
    Pair z = offset_from(ball.z, frame.eye_high.z, frame.eye_low.z);
    float distance = root_of(add_pairs(add_pairs(square_of(x), square_of(y)), square_of(z)));
    return FromEye(vec3(x.high, y.high, z.high), distance, offset_from(ball.z, frame.eye_high.w, frame.eye_low.w).high);
}

// The radius that is drawn: widened to a part of a pixel.
float widened_radius(float radius, float distance) {
    return max(radius, kMinRadiusPixels * distance / frame.forward.w);
}
