// SPDX-License-Identifier: Apache-2.0
// The attenuation textures: layer l holds the opacity of a metaball of depth scale kMaxDepthScale (l / 63)^3, for the
// quarter x, y >= 0 of the billboard. Cubic steps keep the relative error of the optical depth even from the thinnest
// to the thickest ball when two layers are mixed linearly. A texel holds the opacities of its own layer and of the next
// one: one look-up instead of two.

layout(set = 0, binding = 3) uniform sampler2DArray attenuation_textures;

// Layer below a depth scale, plus the share of the layer above: linear in the depth scale between the two.
float level_of(float depth_scale) {
    const float last = float(kAttenuationLevels - 1u);
    float scaled = min(depth_scale / kMaxDepthScale, 1.0) * (last * last * last);
    float layer = min(floor(pow(scaled, 1.0 / 3.0)), last - 1.0);
    float below = layer * layer * layer, step = 3.0 * layer * (layer + 1.0) + 1.0;
    return layer + clamp((scaled - below) / step, 0.0, 1.0);
}

// Opacity at a point of the billboard, in units of the radius from its middle.
float billboard_opacity(vec2 point, float level) {
    const float texels = float(kAttenuationTexels);
    vec2 coordinate = (abs(point) * (texels - 1.0) + 0.5) / texels;
    float layer = min(floor(level), float(kAttenuationLevels - 2u));
    vec2 opacity = textureLod(attenuation_textures, vec3(coordinate, layer), 0.0).rg;
    return mix(opacity.x, opacity.y, level - layer);
}
