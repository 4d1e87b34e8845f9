// SPDX-License-Identifier: Apache-2.0
// The splats of a tile over the pixels of an invocation; needs tiles.glsl, ray.glsl, integral.glsl and lighting.glsl.

layout(set = 0, binding = 1, std430) readonly buffer Balls {
    ViewBall balls[];
};
// ViewSplat as one vector: it is fetched at once.
layout(set = 0, binding = 2, std430) readonly buffer Splats {
    uvec4 splats[];
};
layout(set = 0, binding = 7, std430) readonly buffer Tails {
    SplatTail tails[];
};
layout(set = 0, binding = 8, std430) buffer Radiance {
    vec4 radiance[];  // w: transmittance
};
layout(set = 0, binding = 9, std430) buffer Depth {
    float depth[];
};

layout(constant_id = 4) const bool kDistances = true;

float red[kRows], green[kRows], blue[kRows], mean_distance[kRows], transmittance[kRows];
float per_square[kRows];  // 1 / |direction|^2 of each pixel
float opaque[kRows];      // opaque_along() each pixel's ray
float ends[kRows];        // terrain_at() each pixel

void add(uint row, float opacity, vec3 colour, float distance) {
    float part = transmittance[row] * opacity;
    if (kTerrain && distance > ends[row]) part = 0.0;
    red[row] += part * colour.r;
    green[row] += part * colour.g;
    blue[row] += part * colour.b;
    if (kDistances) mean_distance[row] += part * distance;
    transmittance[row] -= part;
}

// A splat ready to be drawn. With d the direction of a pixel's ray and d0 that of the centre c, the squared distance of
// the ray from the centre is |c x d|^2 / |d|^2, and c x d = c x (d - d0): a quadratic form of the pixel's offset from the
// centre, exact for any field of view.
struct Splat {
    vec2 pixel;
    vec3 form;         // squared distance in radii, times |d|^2: form.x dx^2 + form.y dx dy + form.z dy^2
    vec3 low, high;    // c0..c5 of the opacity (shared.h)
    vec3 colour;
    float distance;    // 0: not fitted
};

Splat unpack(uvec4 words, SplatTail tail) {
    Splat splat;
    splat.pixel = uintBitsToFloat(words.xy);
    vec2 size_and_depth = unpackHalf2x16(words.z), blue_and_distance = unpackHalf2x16(tail);
    vec3 direction = pixel_direction(splat.pixel) * (frame.up.w / size_and_depth.x);  // to the centre, in radii
    vec3 along_x = cross(direction, frame.right.xyz * (2.0 / frame.picture.x));
    vec3 along_y = cross(direction, frame.up.xyz * (-2.0 / frame.picture.y));
    splat.form = vec3(dot(along_x, along_x), 2.0 * dot(along_x, along_y), dot(along_y, along_y));
    float s = fit_parameter(size_and_depth.y * size_and_depth.y);
    splat.low = vec3(opacity_c0(s), opacity_c1(s), opacity_c2(s));
    splat.high = vec3(opacity_c3(s), opacity_c4(s), opacity_c5(s));
    splat.colour = vec3(unpackHalf2x16(words.w), blue_and_distance.x);
    splat.distance = blue_and_distance.y * kDistanceUnit;
    return splat;
}

// Down a column of pixels the form is stepped by differences.
void add_fitted(Splat splat, vec2 pixel) {
    float dx = pixel.x - splat.pixel.x, dy = pixel.y - splat.pixel.y;
    float square = dx * (splat.form.x * dx + splat.form.y * dy) + splat.form.z * dy * dy;
    float step = splat.form.y * dx + splat.form.z * (2.0 * dy + 1.0), bend = 2.0 * splat.form.z;
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        float w = max(1.0 - square * per_square[row], 0.0);
        float opacity = w * w * (splat.low.x + w * (splat.low.y + w * (splat.low.z +
                                 w * (splat.high.x + w * (splat.high.y + w * splat.high.z)))));
        add(row, opacity, splat.colour, splat.distance);
        square += step;
        step += bend;
    }
}

void add_exact(uint index, vec2 pixel) {
    ViewBall ball = balls[index];
    vec3 centre = vec3(ball.x, ball.y, ball.z);
    float distance = length(centre);
    float radius = (ball.flags & kAround) != 0u ? ball.radius : drawn_radius(ball, distance);
    float thinning = ball.radius / radius;
    Scattered light = seen_through_shell(scattered_light(ball, distance), centre, distance);
    if ((ball.flags & kIntegrate) == 0u) {
        light.diffuse = radiance_of_disc(light, centre / distance, radius / distance);
        light.direct = vec3(0.0);
    }
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        vec3 ray = pixel_ray(pixel + vec2(0.0, float(row)));
        if (kTerrain) terrain_end = ends[row];
        float opacity = integrated_opacity(centre, radius, ray, ball.depth_scale * thinning * thinning);
        add(row, opacity, radiance_along(light, ray), distance);
    }
}

void add_splat(uint index, vec2 pixel) {
    Splat splat = unpack(splats[index], tails[index]);
    if (splat.distance > 0.0) {
        add_fitted(splat, pixel);
    } else {
        add_exact(index, pixel);
    }
}

// The first entry from `begin` on whose splat is not nearer than the one with this number.
uint entry_of(uint splat, TileRange range) {
    uint begin = range.begin, end = range.end;
    while (begin < end) {
        uint middle = (begin + end) / 2u;
        if (list[middle] < splat) {
            begin = middle + 1u;
        } else {
            end = middle;
        }
    }
    return begin;
}

// `first`: of the pixels, see first_pixel().
void load_sums(uvec2 first) {
    vec2 pixel = vec2(first) + 0.5;
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        uint y = first.y + row;
        vec4 sum = vec4(0.0, 0.0, 0.0, 1.0);
        float sum_distance = 0.0;
        if (step.first_batch == 0u && first.x < step.width && y < step.height) {
            sum = radiance[y * step.width + first.x];
            if (kDistances) sum_distance = depth[y * step.width + first.x];
        }
        red[row] = sum.r;
        green[row] = sum.g;
        blue[row] = sum.b;
        transmittance[row] = sum.a;
        mean_distance[row] = sum_distance;
        vec3 direction = pixel_direction(pixel + vec2(0.0, float(row)));
        per_square[row] = 1.0 / dot(direction, direction);
        opaque[row] = opaque_along(direction * sqrt(per_square[row]));
        if (kTerrain) ends[row] = terrain_at(pixel + vec2(0.0, float(row)));
    }
}

void store_sums(uvec2 first) {
    [[unroll]] for (uint row = 0u; row < kRows; ++row) {
        uint y = first.y + row;
        if (first.x < step.width && y < step.height) {
            vec4 sum = vec4(red[row], green[row], blue[row], min(transmittance[row], 1.0));
            if (sum.a < opaque[row]) sum.a = 0.0;
            radiance[y * step.width + first.x] = sum;
            if (kDistances) depth[y * step.width + first.x] = mean_distance[row];
        }
    }
}
