// SPDX-License-Identifier: Apache-2.0
// Which splats and shells of air a dispatch draws: what the host says, or what the device has found itself.

layout(set = 0, binding = 15, std430) readonly buffer Parts {
    ViewPart parts[];
};

// First and end.
uvec2 drawn_splats() {
    return step.listed != 0u ? uvec2(parts[step.first].first, parts[step.first].end) : uvec2(step.first, step.end);
}
uvec2 drawn_shells() {
    return step.listed != 0u ? uvec2(parts[step.first].first_shell, parts[step.first].end_shell)
                             : uvec2(step.first, step.end);
}
