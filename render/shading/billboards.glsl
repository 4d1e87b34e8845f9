// SPDX-License-Identifier: Apache-2.0
// T's billboards: their light and their texture coordinates; needs frame.glsl, air.glsl and shells.glsl.

// T: clamp(dot(towards the light, outwards from the cloud) * colour - absorbed, 0, 1).
vec3 billboard_diffuse(vec3 to_light, vec3 outwards, vec3 colour, float absorbed) {
    return clamp(dot(to_light, outwards) * colour - absorbed, 0.0, 1.0);
}

// Returns the radiance of the cloud at a corner.
vec3 billboard_light_at(vec3 position, ViewBillboard billboard, ViewCloud cloud) {
    vec3 offset = position - vec3(cloud.x, cloud.y, cloud.z);
    vec3 outwards = offset / max(length(offset), 1.0e-6);
    vec2 absorbed = unpackUnorm2x16(billboard.absorbed);
    float height = clamp((position.z - cloud.base) * cloud.inverse_height, 0.0, 1.0);
    float arrives = float(billboard.texture_bits >> 16) / 65535.0;
    vec3 light = arrives * billboard_diffuse(frame.to_sun.xyz, outwards, sunlight_at(position.z), absorbed.x) +
                 mix(frame.ambient_base.rgb, frame.ambient_top.rgb, height);
    vec3 way = frame.flash.xyz - position;  // adds nothing in the dark; no branch, see lighting.glsl
    float squared = dot(way, way);
    vec3 to_flash = way * inversesqrt(max(squared, 1.0e-6));
    light += frame.flash.w * flash_falloff(squared) *
             billboard_diffuse(to_flash, outwards, frame.flash_colour.rgb, absorbed.y);
    return frame.ambient_top.w * light;
}

// Transmittance and in-scattered light of the air between the eye and a billboard, times the billboard's opacity.
struct BillboardAir {
    vec3 transmitted;  // fraction of the cloud's light that arrives
    vec3 veil;   // radiance of the air
};

BillboardAir billboard_air(ViewBillboard billboard, vec3 centre, float distance) {
    vec3 ray = centre / max(distance, 1.0e-6);
    vec3 beta = air_transmittance(ray, distance);
    AirLayer air = layer_in_front(centre, distance);
    return BillboardAir(billboard.opacity * air.transmittance * beta,
                   billboard.opacity * (air.transmittance * air_light(ray, distance, beta) + air.light));
}

// Unit vectors to the right and up across all billboards, and the size of each unit in the picture at distance 1, in
// halves of the picture.
struct BillboardAxes {
    vec3 right, up;
    vec2 per_metre;
};

BillboardAxes billboard_axes() {
    vec2 per_metre = inversesqrt(vec2(dot(frame.right.xyz, frame.right.xyz), dot(frame.up.xyz, frame.up.xyz)));
    return BillboardAxes(per_metre.x * frame.right.xyz, per_metre.y * frame.up.xyz, per_metre);
}

// Returns the texture coordinates of a point of a billboard, -1..1: mirrored, and with axes exchanged, by the bits of
// `turn`.
vec2 billboard_coordinate(vec2 point, uint turn) {
    vec2 mirrored = vec2((turn & 1u) != 0u ? -point.x : point.x, (turn & 2u) != 0u ? point.y : -point.y);
    return 0.5 + 0.5 * ((turn & 4u) != 0u ? mirrored.yx : mirrored);
}
