// SPDX-License-Identifier: Apache-2.0
// Tiling of a picture for the compute passes: kTileWidth x kTileHeight pixels, one work group each. An
// invocation has one column of pixels, kRows of them below each other; further invocations share the tile's rows. Where
// a work group is one subgroup, its lanes fetch splats together and hand them round (kShared): on a processor without
// graphics hardware that is far cheaper than fetching each splat in every lane.
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#extension GL_KHR_shader_subgroup_vote : require

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint kRows = 16u;
layout(constant_id = 2) const bool kShared = true;

layout(set = 0, binding = 5, std430) readonly buffer Ranges {
    TileRange ranges[];
};
layout(set = 0, binding = 6, std430) readonly buffer List {
    uint list[];
};
layout(push_constant) uniform Step {
    TileStep step;
};

uint work_group() { return gl_WorkGroupID.y * kGroupRow + gl_WorkGroupID.x; }

// First of this invocation's pixels; the others lie below it.
uvec2 first_pixel(uint tile) {
    uvec2 corner = uvec2(tile % step.tiles_x, tile / step.tiles_x) * uvec2(kTileWidth, kTileHeight);
    uint lane = gl_LocalInvocationID.x;
    return corner + uvec2(lane % kTileWidth, lane / kTileWidth * kRows);
}

// A LightSplat's centre and 1 / radius^2 along both axes, texels.
vec4 light_splat(uvec4 words) {
    vec2 radii = unpackHalf2x16(words.z);
    return vec4(uintBitsToFloat(words.xy), 1.0 / (radii * radii));
}
