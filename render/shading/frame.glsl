// SPDX-License-Identifier: Apache-2.0
// The uniforms of the frame.

layout(set = 0, binding = 0) uniform FrameBlock {
    FrameUniforms frame;
};
