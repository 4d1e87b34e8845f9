// SPDX-License-Identifier: Apache-2.0
// Rays through clouds with detail (density/detail.h); needs ray.glsl, air.glsl, scattering.glsl, shells.glsl and
// detail.glsl. The twin of render/cpu/march-inl.h.
//
// A ray crosses empty space in one step, bricks or cells at once; near cloud it steps by the coverage that is missing,
// in cloud by about a pixel. What it sees is shaded whenever kEventOpacity has come together. The loops are nested so
// that invocations that run together sample together, and shade together.

#extension GL_EXT_control_flow_attributes : require

// Interpolates numbers at the corners of cells between rows along x: of the light.
struct LightCorner {
    uint first;  // word
    vec3 share;
};

LightCorner light_place(BrickPlace place) {
    vec3 cells = 0.5 * place.local, below = min(floor(cells), vec3(3.0));
    uvec3 at = uvec3(below);
    return LightCorner(uint(max(place.number, 0)) * kMarchLightWords + (at.z * kMarchLightNodes + at.y) * kMarchLightNodes + at.x,
                       cells - below);
}

float between_rows(vec4 rows, vec3 share) {
    return between(between(rows.x, rows.y, share.y), between(rows.z, rows.w, share.y), share.z);
}

uvec4 light_rows(uint first) {
    return uvec4(march_light[first], march_light[first + kMarchLightNodes], march_light[first + kMarchLightNodes * kMarchLightNodes],
                 march_light[first + kMarchLightNodes * kMarchLightNodes + kMarchLightNodes]);
}

float volume_sun_depth(uint v, BrickPlace place) {
    LightCorner at = light_place(place);
    uvec4 words = light_rows(march.volumes[v].first_light + at.first);
    vec4 low = vec4(words & 0xffffu), high = vec4(words >> 16);
    float root = between_rows(low + at.share.x * (high - low), at.share) * (1.0 / 65535.0);
    return root * root * kMostMarchedDepth;
}

// Returns the lower and the upper bytes, 0..255, of the numbers of a plane of the light's words: 1 of the sky and the
// ground that are seen, 2 and 3 of diffuse light.
vec2 volume_bytes(uint v, uint plane, BrickPlace place) {
    LightCorner at = light_place(place);
    uvec4 words = light_rows(march.volumes[v].first_light + plane * march.volumes[v].light_words + at.first);
    vec4 low0 = vec4(words & 255u), low1 = vec4((words >> 16) & 255u);
    vec4 high0 = vec4((words >> 8) & 255u), high1 = vec4(words >> 24);
    return vec2(between_rows(low0 + at.share.x * (low1 - low0), at.share),
                between_rows(high0 + at.share.x * (high1 - high0), at.share));
}

// Returns the sunlight that is scattered more than once towards the eye, of colour 1: by light that still travels nearly
// along the sun's, and by light that diffuses (render/cloud/diffusion.h). That is known at the lattice's scale; bumps and
// folds have more and less of it as their own depth differs from the lattice's.
float scattered_in_volume(uint v, vec3 ray, float sun_depth, BrickPlace here) {
    vec2 up = volume_bytes(v, 2u, here), side = volume_bytes(v, 3u, here);
    float root = up.x * (1.0 / 255.0);
    vec3 flux = vec3(side, up.y) * (1.0 / 127.0) - 128.0 / 127.0;
    float directed = max(kDiffuseBase - diffuse_flux(march.mean_cosine) * dot(flux, ray), 0.0);
    float decay = kDiffuseDecay * (1.0 - march.mean_cosine);
    float relief = (1.0 + decay * volume_sun_depth(v, here)) / (1.0 + decay * sun_depth);
    float diffuse = root * root * min(relief, kMostRelief) * directed * (0.25 * kMostFluence);
    if (!holds_cloud(here)) diffuse = 0.0;
    float forwards = scattering_at(1u + kScatterDepths, scatter_column(dot(frame.to_sun.xyz, ray)));
    float near = max(exp((march.mean_cosine - 1.0) * sun_depth) - exp(-sun_depth), 0.0);
    float often = scattered_often(ray, sun_depth);
    return march.diffuse > 0.0 ? march.diffuse * (forwards * near + diffuse) : often;
}

// The light of a point in a volume towards the eye. The sunlight that arrives is attenuated by three samples towards
// the sun, which see the detail, and beyond them by the volume's depths.
vec3 marched_radiance(uint v, vec3 ray, float distance) {
    float footprint = distance * march.per_unit, extinction_per_m = march.volumes[v].extinction_per_m;
    vec3 point = distance * ray, offset = offset_in(v, point), to_sun = frame.to_sun.xyz;
    const float taps_m[3] = float[3](kTap0_m, kTap1_m, kTap2_m);
    const float lengths_m[3] = float[3](kTap0Length_m, kTap1Length_m, kTap2Length_m);
    float own = 0.0, patches = patches_of(v, point);
    [[dont_unroll]] for (uint tap = 0u; tap < 3u; ++tap)
        own += lengths_m[tap] * extinction_per_m * density_at(v, offset + taps_m[tap] * to_sun, patches, footprint);
    BrickPlace here = brick_place(v, offset), beyond = brick_place(v, offset + kTapsEnd_m * to_sun);
    // Bricks without cloud have no depths: what is beyond them shows in those of the point itself.
    float sun_depth = holds_cloud(beyond) ? own + patches * volume_sun_depth(v, beyond)
                                          : max(own, holds_cloud(here) ? patches * volume_sun_depth(v, here) : 0.0);
    vec2 seen = holds_cloud(here) ? volume_bytes(v, 1u, here) * (1.0 / 255.0) : vec2(1.0);
    vec3 sunlight = sunlight_at(above_plane(point, march.volumes[v].bend).z);
    vec3 arriving = seen.x * frame.ambient_top.rgb + seen.y * frame.ambient_base.rgb;
    arriving += scattered_in_volume(v, ray, sun_depth, here) * sunlight;
    arriving += scattered_once(dot(to_sun, ray)) * exp(-sun_depth) * sunlight;
    vec3 way = frame.flash.xyz - point;  // lightning; adds nothing in the dark
    arriving += frame.flash.w * flash_falloff(dot(way, way)) * frame.flash_colour.rgb;
    vec3 beta = air_transmittance(ray, distance);
    vec3 radiance = beta * (frame.ambient_top.w * arriving) + air_light(ray, distance, beta);
    AirLayer air = layer_in_front(point, distance);
    return air.transmittance * radiance + air.light;
}

// Where a ray is between two parts of the march.
struct MarchState {
    float distance;    // of the next sample
    float extinction;  // of the last
    float way;         // from the last to the next
    float margin;      // of the last; below 0: no sample, empty space was skipped
};

// One over a direction, never infinite.
vec3 inverse_of(vec3 direction) {
    return 1.0 / mix(direction, vec3(1.0e-6), lessThan(abs(direction), vec3(1.0e-6)));
}

// Returns the part of a ray in a slab that goes on to the horizon, between two heights above the eye: it rises above the
// ground by ray_z t + bend t^2.
vec2 part_in_slab(float base, float top, float ray_z, float bend) {
    if (top == 0.0) top = kLeastHeight_m;
    float root = sqrt(max(4.0 * top * bend + ray_z * ray_z, 0.0)), sum = ray_z + root;
    vec2 part = vec2(0.0, min(2.0 * top / (top > 0.0 ? max(sum, 1.0e-9) : min(sum, -1.0e-9)), kHorizon_m));
    float base_root = sqrt(max(4.0 * base * bend + ray_z * ray_z, 0.0));
    if (base > 0.0) part.x = 2.0 * base / max(ray_z + base_root, 1.0e-9);
    if (top < 0.0) part.x = ray_z < 0.0 && root > 0.0 ? 2.0 * top / min(ray_z - root, -1.0e-9) : kFarAway_m;
    return part;
}

// Returns the part of a ray in the box of a volume's bricks.
vec2 part_in_box(uint v, vec3 ray, vec3 per_ray) {
    vec4 corner = march.volumes[v].corner;
    if (march.volumes[v].repeats > 0.0)
        return part_in_slab(corner.z, corner.z + 8.0 * corner.w * float(march.volumes[v].bricks_z), ray.z,
                            march.volumes[v].bend * (1.0 - ray.z * ray.z));
    vec3 bricks = vec3(march.volumes[v].bricks_x, march.volumes[v].bricks_y, march.volumes[v].bricks_z);
    vec3 a = corner.xyz * per_ray, b = (corner.xyz + 8.0 * corner.w * bricks) * per_ray;
    vec3 low = min(a, b), high = max(a, b);
    return vec2(max(max(low.x, low.y), max(low.z, 0.0)), min(min(high.x, high.y), min(high.z, march.fade_ends)));
}

MarchState begin_march(vec3 ray) {
    vec3 per_ray = inverse_of(ray);
    float first = 3.0e38;
    for (uint v = 0u; v < march.count; ++v) {
        vec2 part = part_in_box(v, ray, per_ray);
        if (part.x < part.y) first = min(first, part.x);
    }
    return MarchState(first, 0.0, 0.0, -1.0);
}

// What a sample of a ray found in all volumes.
struct MarchSample {
    float extinction, margin, step;
    uint which;
    uint near;  // bits of volumes that are to be sampled: cloud is near
};

// A place of a ray in a volume, and the way out of the cube of empty bricks or cells around it.
struct MarchPlace {
    bool within;  // the bricks' box
    float out_m, on_m;  // the latter from beside the box, below a cloud that repeats to its base
    bool near;          // cloud, as the cell may hold some
};

float least_of(vec3 numbers) { return min(numbers.x, min(numbers.y, numbers.z)); }

// Returns whether a cell may hold cloud, given its byte of CoverageField::cells().
bool occupied_at(uint v, int cell, vec3 point) {
    float least_patches = float(cell) * ((1.0 + kPatchSpread) / float(kOccupied + 1));
    if (march.volumes[v].repeats == 0.0) return least_patches < 1.0;
    return cell <= kOccupied && least_patches < patches_of(v, point);
}

MarchPlace march_place(uint v, vec3 ray, vec3 per_ray, float distance) {
    vec4 corner = march.volumes[v].corner;
    vec3 offset = offset_in(v, distance * ray);
    BrickPlace place = brick_place(v, offset);
    bool endless = march.volumes[v].repeats > 0.0;
    place.within = place.within && (endless || distance < march.fade_ends);
    per_ray = inverse_of(way_in(v, ray, distance));
    bool holds = holds_cloud(place);
    vec3 cell = min(floor(0.5 * place.local), vec3(3.0));
    bvec3 up = greaterThan(per_ray, vec3(0.0));
    uint octant = (up.x ? 1u : 0u) + (up.y ? 2u : 0u) + (up.z ? 4u : 0u);
    uint byte = 64u * octant + uint((cell.z * 4.0 + cell.y) * 4.0 + cell.x);
    uint word = march_cells[march.volumes[v].first_cells + kCellWords * uint(max(place.number, 0)) + byte / 4u];
    int of_cell = int((word >> (8u * (byte & 3u))) & 255u);
    int of_brick = (place.number >> (3u * octant)) & 7;
    float count = float(holds ? max(of_cell - kOccupied, 1) : of_brick + 1), size = (holds ? 2.0 : 8.0) * corner.w;
    vec3 own = holds ? place.brick * 4.0 + cell : place.brick;
    vec3 edge = mix(own + 1.0 - count, own + count, up);
    vec3 out_m = (edge * size - offset) * per_ray;
    // The next period is another place in the bricks.
    vec2 period = vec2(march.volumes[v].period_x, march.volumes[v].period_y);
    vec2 face = march.volumes[v].home + mix(vec2(0.0), period, up.xy);
    vec2 to_face = (face - offset.xy) * per_ray.xy;
    if (endless) out_m = min(out_m, vec3(to_face, kStraightWay_m));
    float on_m = max(1.0, min(-offset.z * (per_ray.z > 0.0 ? per_ray.z : kLongestLeap_m), kLongestLeap_m));
    return MarchPlace(place.within, least_of(out_m), endless ? on_m : 1.0,
                      holds && place.within && occupied_at(v, of_cell, distance * ray));
}

// Returns the way out of the half of a cell that lies between eight nodes.
float out_of_half(uint v, BrickPlace place, vec3 offset, vec3 way) {
    vec3 per_way = inverse_of(way), own = place.brick * 8.0 + min(floor(place.local), vec3(7.0));
    vec3 edge = mix(own, own + 1.0, greaterThan(per_way, vec3(0.0)));
    return max(least_of((edge * march.volumes[v].corner.w - offset) * per_way), 0.0);
}

float beyond_face(uint v) { return march.volumes[v].repeats > 0.0 ? kBeyondBentFace_m : kBeyondFace_m; }

// Sets the step to where cloud may be, as far as nothing is to be sampled.
MarchSample survey(vec3 ray, vec3 per_ray, float distance) {
    MarchSample result = MarchSample(0.0, 1.0, kFarAway_m, 0u, 0u);
    for (uint v = 0u; v < march.count; ++v) {
        MarchPlace at = march_place(v, ray, per_ray, distance);
        vec2 part = part_in_box(v, ray, per_ray);
        // At the faces of the box rounding decides what is inside: there rays go on by a metre. Below a cloud that
        // repeats they go on to its base.
        float step = distance < part.y ? at.on_m : kFarAway_m;
        if (distance < part.x) step = part.x - distance + kBeyondFace_m;
        if (at.within) step = max(at.out_m, 0.0) + beyond_face(v);
        if (at.near)
            result.near |= 1u << v;
        else
            result.step = min(result.step, step);
    }
    return result;
}

void sample_near(inout MarchSample result, vec3 ray, float distance, float transmittance) {
    float footprint = distance * march.per_unit, finest = min(max(march.least_step, kStepPixels * footprint), march.most_step);
    float least_step = finest * ((1.0 - transmittance) * kStepGrowth + 1.0);
    float share = clamp((distance - march.fade_begins) / (march.fade_ends - march.fade_begins), 0.0, 1.0);
    float kept = 1.0 - share * share * (3.0 - 2.0 * share);
    for (uint v = 0u; v < march.count; ++v) {
        if ((result.near >> v & 1u) != 0u) {
            vec3 offset = offset_in(v, distance * ray);
            BrickPlace place = brick_place(v, offset);
            Node node = node_at(v, place);
            float patches = patches_of(v, distance * ray);
            if (!may_hold_cloud(node.most_t, patches, march.volumes[v].cloud_odds)) {  // no cloud within half of the cell
                result.near &= ~(1u << v);
                result.step = min(result.step, out_of_half(v, place, offset, way_in(v, ray, distance)) + beyond_face(v));
                continue;
            }
            node.t = scaled_share(node.t, patches);
            Eroded found = eroded(v, node, offset, max(footprint, kLeastFootprint_m), true);
            float extinction = found.density * march.volumes[v].extinction_per_m;
            if (march.volumes[v].repeats == 0.0) extinction *= kept;
            result.extinction += extinction;
            if (extinction > 0.0) result.which = v;
            result.margin = min(result.margin, found.margin);
            result.step = min(result.step, min(max(found.margin * march.volumes[v].reach, least_step),
                                               max(kLongestStep_m, least_step)));
        }
    }
}

// What has been seen since the last point that was shaded.
struct MarchEvent {
    float weight, weighted;  // opacity; times distance
    uint which;
    bool full;  // to be shaded
};

// Takes a sample into account and goes on to the next place.
void advance(MarchSample now, float opaque, inout MarchState state, inout MarchEvent event, inout float left) {
    float found = now.extinction;
    // The step before counts as cloud; where it came from outside, only from the surface on: where the margin of the
    // two samples passes zero, or about one fine step where empty space was skipped.
    float finest = min(max(march.least_step, kStepPixels * march.per_unit * state.distance), march.most_step);
    float inside = -now.margin / max(state.margin - now.margin, kLeastMargin);
    float behind = state.margin < 0.0 ? kSkippedSteps * finest
                                      : state.way * clamp(inside, 0.0, 1.0) + kSurfaceSteps * finest;
    float way = state.extinction > 0.0 ? state.way : min(state.way, behind);
    float seen = left * (1.0 - exp(-0.5 * (found + state.extinction) * way));
    left -= seen;
    bool ends = left <= opaque;  // what little is left is seen here, too
    if (ends) {
        seen += left;
        left = 0.0;
    }
    event.weight += seen;
    event.weighted += seen * (state.distance - 0.5 * way);
    if (found > 0.0) event.which = now.which;
    bool leaves = event.weight > kLeavingOpacity && found <= 0.0;
    event.full = event.weight > kEventOpacity || leaves || ends;
    state.extinction = found;
    state.margin = now.near != 0u ? now.margin : -1.0;
    state.way = now.step;
    state.distance = max(state.distance + now.step, state.distance * kLeastAdvance);
}

// Returns the distance at which a ray ends.
float march_end(vec3 ray) {
    vec3 per_ray = inverse_of(ray);
    float end = 0.0;
    for (uint v = 0u; v < march.count; ++v) {
        vec2 part = part_in_box(v, ray, per_ray);
        if (part.x < part.y) end = max(end, part.y);
    }
    return min(end, ground_distance(ray));
}

// Marches a ray up to a distance. `least`: opaque_along() it. `sum`: radiance and transmittance. Where there is nothing to
// march, do not call it: lavapipe goes through the body of a loop once, even if no invocation does.
void march_to(float stop, vec3 ray, float least, inout MarchState state, inout vec4 sum, inout float sum_distance) {
    vec3 per_ray = inverse_of(ray);
    float opaque = kMarchOpaqueFactor * least;  // the same for all that look whether the ray goes on
    MarchEvent event = MarchEvent(0.0, 0.0, 0u, false);
    while (state.distance < stop && sum.a > opaque) {
        event.full = false;
        while (!event.full && state.distance < stop && sum.a > opaque) {
            MarchSample now;
            bool near = false;
            while (!near && !event.full && state.distance < stop && sum.a > opaque) {
                now = survey(ray, per_ray, state.distance);
                near = now.near != 0u;
                if (!near) advance(now, opaque, state, event, sum.a);
            }
            if (near) {
                sample_near(now, ray, state.distance, sum.a);
                advance(now, opaque, state, event, sum.a);
            }
        }
        if (event.weight > 0.0) {
            float distance = event.weighted / max(event.weight, 1.0e-9);
            sum.rgb += event.weight * marched_radiance(event.which, ray, distance);
            sum_distance += event.weighted;
            event.weight = 0.0;
            event.weighted = 0.0;
        }
    }
}
