// SPDX-License-Identifier: Apache-2.0
// The attenuation textures: layer l holds the opacity of a metaball of depth scale kMaxDepthScale (l / 63)^3, for the
// quarter x, y >= 0 of the billboard. Cubic steps keep the relative error of the optical depth even from the thinnest
// to the thickest ball when two layers are mixed linearly.

layout(set = 0, binding = 3) uniform sampler2DArray attenuation_textures;

float level_of(float depth_scale) {
    return float(kAttenuationLevels - 1u) * pow(min(depth_scale / kMaxDepthScale, 1.0), 1.0 / 3.0);
}

// Opacity at a point of the billboard, in units of the radius from its middle.
float billboard_opacity(vec2 point, float depth_scale, float level) {
    if (depth_scale > kMaxDepthScale) {
        // Denser than the last texture: the rim would be narrower than a texel.
        return 1.0 - exp(-depth_scale * column(max(1.0 - dot(point, point), 0.0)));
    }
    const float texels = float(kAttenuationTexels);
    vec2 coordinate = (abs(point) * (texels - 1.0) + 0.5) / texels;
    float layer = min(floor(level), float(kAttenuationLevels - 2u));
    float below = textureLod(attenuation_textures, vec3(coordinate, layer), 0.0).r;
    float above = textureLod(attenuation_textures, vec3(coordinate, layer + 1.0), 0.0).r;
    return mix(below, above, level - layer);
}
