// SPDX-License-Identifier: Apache-2.0
// The shells of air around the eye (air_shells.h, docs/air.md); needs ray.glsl, air.glsl and
// scattering.glsl.

// Specialisation constants: without shells or fog their code is compiled out.
layout(constant_id = 6) const bool kShells = false;
layout(constant_id = 7) const bool kFog = false;

layout(set = 0, binding = 13) uniform ShellsBlock {
    Shells shells;
};
layout(set = 0, binding = 14, std430) readonly buffer Shade {
    uint shade[];
};

// The effect of a layer of air on the light behind it: light = light * transmittance + light of the layer.
struct AirLayer {
    vec3 light;
    float transmittance;
    float distance;  // metres from the eye where half of what the layer hides is hidden
};

float shell_end(uint k) { return shells.ends[k / 4u][k % 4u]; }
float shell_begin(uint k) { return k == 0u ? 0.0 : shell_end(k - 1u); }

// Interpolates between four texels: of a row in the lower half of the word, of the next row in the upper half.
float between_texels(uint word, vec2 share) {
    vec4 texels = unpackUnorm4x8(word);
    vec2 column = mix(texels.xy, texels.zw, share.y);
    return mix(column.x, column.y, share.x);
}

// Returns the fraction of sunlight that passes the clouds to a point relative to the eye: D's gamma. The shade of a
// cloud begins at its top and is complete at its base.
float sunlight_left(vec3 point) {
    vec2 place = vec2(dot(shells.shade_u.xyz, point) + shells.shade_u.w, dot(shells.shade_v.xyz, point) + shells.shade_v.w);
#ifdef NEPHOS_ENDLESS
    bool known = !endless() || (all(greaterThan(place, vec2(2.0))) && all(lessThan(place, shells.shade.xy - 2.0)) &&
                                sees_first_period(point));
    if (!known) return sunlight_beyond(point);
#endif
    place = clamp(place, vec2(0.0), shells.shade.xy);
    uvec2 texel = uvec2(place);
    vec2 share = place - vec2(texel);
    uint index = texel.y * uint(shells.settings.z) + texel.x, plane = uint(shells.settings.w);
    float gamma = between_texels(shade[index], share);
    float begin = between_texels(shade[index + plane], share), end = between_texels(shade[index + 2u * plane], share);
    float along = dot(shells.shade_along.xyz, point) + shells.shade_along.w;
    float part = clamp((along - begin) / max(end - begin, 1.0 / 255.0), 0.0, 1.0);
    return 1.0 - part * (1.0 - gamma);
}

// Returns the noise of fog at a point relative to the eye, 0..1.
float fog_noise(vec3 point, vec4 eye) {
    vec3 voxel = fract(eye.xyz + eye.w * point) * float(kFogVoxels);
    vec3 below = floor(voxel), share = voxel - below;
    uvec3 at = uvec3(below) & (kFogVoxels - 1u);
    uint row = 3u * uint(shells.settings.w) + at.y * kFogVoxels + at.x;
    uint level = kFogVoxels * kFogVoxels, above = (at.z + 1u) & (kFogVoxels - 1u);
    vec4 four = mix(unpackUnorm4x8(shade[row + at.z * level]), unpackUnorm4x8(shade[row + above * level]), share.z);
    vec2 two = mix(four.xy, four.zw, share.y);
    return mix(two.x, two.y, share.x);
}

// Returns the fog of a ray between two distances, without patches.
struct FogPart {
    float depth;  // optical
    float low;    // extinction at the lower end
};

FogPart fog_part(vec3 ray, float begin, float end) {
    float height = shells.fog.z + ray.z * begin, low = shells.fog.z + ray.z * (ray.z < 0.0 ? end : begin);
    return FogPart(shells.fog.x * fog_column(height, ray.z, end - begin, shells.fog.y),
                   shells.fog.x * exp(min(-low * shells.fog.y, 60.0)));
}

// Returns the distance at which half of the opacity of this fog is reached. Computed from the lower end, without loss
// of precision where the eye is far above.
float fog_middle(FogPart fog, vec3 ray, float begin, float end) {
    float taken = -log(0.5 + 0.5 * exp(-fog.depth));
    float rest = ray.z < 0.0 ? fog.depth - taken : taken, per_low = rest / max(fog.low, 1.0e-30);
    float falls = abs(ray.z) * shells.fog.y, x = falls * per_low;
    float way = x < 1.0e-2 ? per_low * (1.0 + x * (0.5 + x * (1.0 / 3.0))) : -log(max(1.0 - x, 1.0e-7)) / max(falls, 1.0e-30);
    way = clamp(way, 0.0, end - begin);
    return ray.z < 0.0 ? end - way : begin + way;
}

// Returns the density of fog at a point of a shell relative to its mean. In shells thicker than a patch and far away it
// fades to 1, as beyond the last shell but one.
float fog_patches(vec3 point, float begin, float end) {
    float reach = shells.shade.w, per_m = shells.fog_coarse.w;
    float varies = shells.fog.w * min(1.0, 0.125 / max(per_m * (end - begin), 1.0e-6)) *
                   clamp(4.0 - 4.0 * begin / reach, 0.0, 1.0);
    float noise = fog_noise(point, shells.fog_coarse) + fog_noise(point.yzx, shells.fog_fine);
    return max(1.0 + varies * (noise - 1.0), 0.0);
}

// Returns the radiance that fog of opacity 1 at a point scatters towards the eye; lit as clouds are. `lit`: fraction of
// the sunlight that passes the clouds.
vec3 fog_radiance(vec3 ray, float at, vec3 sunlight, float lit) {
    float dense = exp(min(-(shells.fog.z + ray.z * at) * shells.fog.y, 60.0));
    float above = shells.fog.x * dense / shells.fog.y;  // optical depth upwards
    float sun_depth = above / max(frame.to_sun.z, 0.05), cosine = dot(frame.to_sun.xyz, ray);
    vec3 sun = lit * (scattered_often(ray, sun_depth) + exp(-sun_depth) * scattered_once(cosine));
    vec3 arriving = sun * sunlight + mix(frame.ambient_base.rgb, frame.ambient_top.rgb, exp(-0.5 * above));
    vec3 way = frame.flash.xyz - at * ray;  // lightning; adds nothing in the dark
    arriving += frame.flash.w * flash_falloff(dot(way, way)) * exp(-above) * frame.flash_colour.rgb;
    return frame.ambient_top.w * arriving;
}

// Returns the layer of air between two distances of a ray. The light of clear air is in the image already
// (air_light()); the shaded part of it is subtracted: the radiance is negative. Shade and patches are sampled at the
// fraction `share`, 0..1, of the interval; light in its middle, because it varies so fast with height that an offset
// would be visible as grain. In dense fog both are sampled where half of its opacity is reached.
AirLayer air_layer(SunlitAir sunlit, vec3 ray, float begin, float end, float share) {
    float at = mix(begin, end, share), middle = mix(begin, end, 0.5);
    bool last = begin >= shells.shade.w;  // it has no end
    FogPart fog = FogPart(0.0, 0.0);
    if (kFog) {
        fog = fog_part(ray, begin, end);
        float much = clamp((0.99 - exp(-fog.depth)) / 0.09, 0.0, 1.0);
        float seen = fog_middle(fog, ray, begin, end);
        at = last ? seen : mix(at, seen, much);
        middle = last ? seen : mix(middle, seen, much);
    }
    float height = ray.z * middle, strength = last ? 0.0 : shells.settings.y;
    vec3 sunlight = sunlight_at(height);
    float lit = sunlight_left(at * ray);
#ifdef NEPHOS_ENDLESS
    if (last && endless()) lit = mean_sunlight();  // a place does not stand for tens of kilometres
#endif
    vec3 lost = clear_air(ray, begin) - clear_air(ray, end);
    vec3 light = (strength * (lit - 1.0)) * sunlit_at(sunlit, height, sunlight) * lost;
    if (!kFog) return AirLayer(light, 1.0, middle);
    float transmittance = exp(-fog.depth * fog_patches(at * ray, begin, end));
    vec3 beta = clear_air(ray, middle), source = sunlit.source;
    if (kPhysicalSky && last) {  // far away
        beta = air_transmittance(ray, middle);
        source = air_source(ray, middle);
    }
    vec3 of_fog = beta * fog_radiance(ray, middle, sunlight, lit) + (1.0 - beta) * source;
    light *= 0.5 + 0.5 * transmittance;  // half of the fog is in front
    return AirLayer(light + (1.0 - transmittance) * of_fog, transmittance, middle);
}

// Returns the distance at which a ray of a mirrored eye, which is below the ground, leaves the ground.
float air_begin(vec3 ray) { return frame.ground.w > 0.0 ? frame.ground.w / max(ray.z, 1.0e-6) : 0.0; }

// Returns the distance at which it ends: at the ground, but no farther than where a ray meets the plane of the fog, which
// over a round Earth it may do without meeting the ground.
float air_end(vec3 ray) {
    float plane = ray.z < 0.0 ? -abs(frame.ground.w) / min(ray.z, -1.0e-9) : 1.0e30;
    return min(ground_distance(ray), plane + (1.0 - frame.ground_sun.w) * 1.0e30);
}

// Returns shell k along the ray of a pixel, cut off by the ground.
AirLayer air_shell(uint k, SunlitAir sunlit, vec3 ray, uvec2 pixel) {
    float first = air_begin(ray), last = air_end(ray);
    float begin = clamp(shell_begin(k), first, last), end = clamp(shell_end(k), first, last);
    return air_layer(sunlit, ray, begin, end, shell_offset(pixel.x, pixel.y));
}

// Returns the number of shells that end at a distance or before it.
uint shells_before(float distance) {
    uint count = uint(shells.settings.x), k = 0u;
    for (uint step = kMaxShells; step > 0u; step /= 2u) {
        if (k + step <= count && shell_end(k + step - 1u) <= distance) k += step;
    }
    return k;
}

// Returns the interval of a ray outside of which there is neither shade of clouds nor fog.
vec2 part_with_air(vec3 ray) {
    vec2 part = vec2(1.0e30, 0.0);
    if (shells.settings.y > 0.0) {
        vec3 slope = vec3(dot(shells.shade_u.xyz, ray), dot(shells.shade_v.xyz, ray), dot(shells.shade_along.xyz, ray));
        vec3 steep = mix(slope, vec3(1.0e-12), lessThan(abs(slope), vec3(1.0e-12)));
        vec3 from = vec3(shells.shade_u.w, shells.shade_v.w, shells.shade_along.w);
        vec3 a = (vec3(0.0, 0.0, shells.shade.z) - from) / steep, b = (vec3(shells.shade.xy, 1.0e12) - from) / steep;
        vec3 first = min(a, b), last = max(a, b);
        part = vec2(max(max(first.x, first.y), max(first.z, 0.0)), min(min(last.x, last.y), last.z));
        if (part.x >= part.y) part = vec2(1.0e30, 0.0);
#ifdef NEPHOS_ENDLESS
        vec2 below = part_below_endless(ray);
        if (below.x < below.y) part = vec2(min(part.x, below.x), max(part.y, below.y));
#endif
    }
    if (!kFog) return part;
    float below_top = shells.fog_limits.x - shells.fog.z, crossing = below_top / (abs(ray.z) < 1.0e-9 ? 1.0e-9 : ray.z);
    vec2 fog = below_top > 0.0 ? vec2(0.0, ray.z > 0.0 ? crossing : 1.0e30) : vec2(ray.z < 0.0 ? crossing : 1.0e30, 1.0e30);
    return fog.x < 1.0e30 ? vec2(min(part.x, fog.x), max(part.y, fog.y)) : part;
}

// Returns the layer of a splat's own shell in front of its centre.
AirLayer layer_in_front(vec3 centre, float distance) {
    if (!kShells) return AirLayer(vec3(0.0), 1.0, 0.0);
    uint k = shells_before(distance);
    if (k == uint(shells.settings.x)) return AirLayer(vec3(0.0), 1.0, 0.0);  // beyond the last
    vec3 ray = centre / max(distance, 1.0e-6);
    float begin = min(max(shell_begin(k), air_begin(ray)), distance);
    return air_layer(sunlit_air(ray), ray, begin, distance, 0.5);
}
