// SPDX-License-Identifier: Apache-2.0
// The data of the picture.

layout(set = 0, binding = 0) uniform FrameBlock {
    Frame frame;
};
