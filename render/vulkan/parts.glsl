// SPDX-License-Identifier: Apache-2.0
// The splats and shells of air that a dispatch draws.

layout(set = 0, binding = 15, std430) readonly buffer Parts {
    ViewPart parts[];
};

uvec2 drawn_splats() { return uvec2(parts[step.part].first, parts[step.part].end); }
uvec2 drawn_shells() { return uvec2(parts[step.part].first_shell, parts[step.part].end_shell); }
