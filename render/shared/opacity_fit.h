// SPDX-License-Identifier: Apache-2.0

// Opacity of a metaball seen as a disc, 1 - exp(-d line_integral(w, sqrt(w))), for depth scales d up to
// kMaxFittedDepth and w = 1 - (distance from the centre / radius)^2, as
//
//     w^2 (c0 + c1 w + ... + c5 w^5)
//
// The coefficients are polynomials of s = d / (d + 4). Largest error 0.0006 min(1, d); from
// tests/reference/fit_opacity.py. C++ and GLSL compile it: shared.h includes it into the namespace of its structs.

NEPHOS_CONST float kMaxFittedDepth = 6.0f;  // denser metaballs are integrated in the tiles

NEPHOS_FUNCTION float fit_parameter(float depth_scale) { return depth_scale / (depth_scale + 4.0f); }
NEPHOS_FUNCTION float fit_row(float s, float a, float b, float c, float d, float e) {
    return s * (a + s * (b + s * (c + s * (d + s * e))));
}
NEPHOS_FUNCTION float opacity_c0(float s) {
    return fit_row(s, 0.4231499f, 1.2760525f, -11.549244f, 42.971609f, -38.80289f);
}
NEPHOS_FUNCTION float opacity_c1(float s) {
    return fit_row(s, 5.0145599f, -34.206589f, 320.55556f, -886.62836f, 752.04615f);
}
NEPHOS_FUNCTION float opacity_c2(float s) {
    return fit_row(s, -6.3734665f, 194.69115f, -1524.4345f, 4065.3462f, -3188.8959f);
}
NEPHOS_FUNCTION float opacity_c3(float s) {
    return fit_row(s, 10.831419f, -377.91478f, 2859.7263f, -7389.1236f, 5301.7407f);
}
NEPHOS_FUNCTION float opacity_c4(float s) {
    return fit_row(s, -8.3280895f, 306.77561f, -2368.4252f, 5817.7935f, -3754.5104f);
}
NEPHOS_FUNCTION float opacity_c5(float s) {
    return fit_row(s, 2.426292f, -94.490722f, 721.69415f, -1645.7595f, 927.43252f);
}
