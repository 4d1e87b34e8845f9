// SPDX-License-Identifier: Apache-2.0
// Six vertices make the two triangles of a square; vertex 6 n is the first of ball n. One long draw instead of
// instances: software devices spend more on an instance of six vertices than on the vertices.

vec2 square_corner(uint vertex) {
    const vec2 corners[6] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(1, 1), vec2(-1, -1), vec2(1, 1), vec2(-1, 1));
    return corners[vertex % 6u];
}
