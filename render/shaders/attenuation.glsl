// SPDX-License-Identifier: Apache-2.0
// The attenuation textures: layer l holds the opacity of a metaball of depth scale kMaxDepthScale (l / 63)^3, for the
// quarter x, y >= 0 of the billboard. Cubic steps keep the relative error of the optical depth even from the thinnest
// to the thickest ball when two layers are mixed linearly. A texel holds the opacities of its own layer and of the next
// one: one look-up instead of two.

layout(set = 0, binding = 3) uniform sampler2DArray attenuation_textures;

float level_of(float depth_scale) {
    return float(kAttenuationLevels - 1u) * pow(min(depth_scale / kMaxDepthScale, 1.0), 1.0 / 3.0);
}

// Opacity at a point of the billboard, in units of the radius from its middle.
float billboard_opacity(vec2 point, float level) {
    const float texels = float(kAttenuationTexels);
    vec2 coordinate = (abs(point) * (texels - 1.0) + 0.5) / texels;
    float layer = min(floor(level), float(kAttenuationLevels - 2u));
    vec2 opacity = textureLod(attenuation_textures, vec3(coordinate, layer), 0.0).rg;
    return mix(opacity.x, opacity.y, level - layer);
}
