// SPDX-License-Identifier: Apache-2.0
#version 460
// One triangle that covers the tile, for the shell whose number is that of the instance.

layout(location = 0) flat out uint shell;

void main() {
    vec2 corner = vec2((gl_VertexIndex << 1) & 2, gl_VertexIndex & 2);
    gl_Position = vec4(2.0 * corner - 1.0, 0.5, 1.0);
    shell = gl_InstanceIndex;
}
