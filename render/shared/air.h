// SPDX-License-Identifier: Apache-2.0

// Clear air between the eye and what it sees, and the sky behind it. One source for all back-ends, compiled twice:
//
//     as GLSL                      Real = float, Real3 = vec3          (included by shading/air.glsl)
//     as C++, per instruction set  Real and Real3 = vectors, one ray a lane, in a struct whose member is the frame
//                                                                      (included by shading/air-inl.h)
//
// and therefore has no include guard. Beside what formulas.h needs, the including file has `frame` (shared.h) and
// kPhysicalSky; sky_layer(across, upwards, layer), a texel of the tables of atmosphere.h, whose layers are: light
// scattered by molecules and many times; by particles, without their phase function; sunlight by altitude; and from
// kAirLayer on the table of air; light_of_air(), which sums its layers; and the operators of Real3 with
// rgb() and xyz() of a vec4. Rays are unit vectors, distances and heights metres, heights above the eye's.
//
// Without kPhysicalSky the air has two colours. With it the tables have it over a round Earth.

// Returns the cosine of the azimuth between a ray and the sun.
NEPHOS_FUNCTION Real beside_sun(Real3 ray) {
    float sun_level = frame.to_sun.x * frame.to_sun.x + frame.to_sun.y * frame.to_sun.y;
    Real level = mul_add(ray.x, ray.x, ray.y * ray.y);
    Real beside = mul_add(ray.x, Real(frame.to_sun.x), ray.y * frame.to_sun.y) /
                  sqrt(max(level * sun_level, Real(1.0e-12f)));
    return max(min(beside, Real(1.0f)), Real(-1.0f));
}

// Returns the radiance of the sky along a ray; below the horizon that of the horizon.
NEPHOS_FUNCTION Real3 sky_scattered(Real3 ray) {
    Real across = sky_across(beside_sun(ray));
    Real upwards = air_row(max(ray.z, Real(frame.earth.x)), frame.earth.x);
    Real phase = particle_phase(dot(xyz(frame.to_sun), ray), frame.air.y);
    return mul_add(phase, sky_layer(across, upwards, 1u), sky_layer(across, upwards, 0u));
}

// Returns the place of a ray and a distance in the table of air: column, and row of those below the horizon or, behind
// them, above it; 0..1 over all columns and rows.
NEPHOS_FUNCTION Real air_column(Real3 ray, Real distance) {
    return air_distance(distance, ray.z, frame.earth.x, frame.earth.y);
}
NEPHOS_FUNCTION Real air_upwards(Real3 ray) {
    Real first = select(ray.z < Real(frame.earth.x), Real(0.0f), Real(float(kAirRows)));
    return (float(kAirRows - 1u) * air_row(ray.z, frame.earth.x) + first) * (1.0f / float(kSkyRows - 1u));
}

// Returns the transmittance of the air over a distance: D's beta.
NEPHOS_FUNCTION Real3 air_transmittance(Real3 ray, Real distance) {
    if (!kPhysicalSky) return exp(-(distance * rgb(frame.air_extinction)));
    return exp(-(distance * sky_layer(air_column(ray, distance), air_upwards(ray), kAirLayer)));
}

// Returns the optical depth of what lies within some tens of kilometres, in closed form: two exponential layers, and a
// ray whose altitude is as that over a round Earth at both ends and changes steadily between.
NEPHOS_FUNCTION Real3 air_depth(Real3 ray, Real distance) {
    if (!kPhysicalSky) return distance * rgb(frame.air_extinction);
    Real slope = mul_add(frame.earth.z * (1.0f - ray.z * ray.z), distance, ray.z);
    return mul_add(layer_column(frame.air.x, slope, distance, frame.rayleigh.w), rgb(frame.rayleigh),
                   layer_column(frame.air.x, slope, distance, frame.haze.w) * rgb(frame.haze));
}
NEPHOS_FUNCTION Real3 clear_air(Real3 ray, Real distance) { return exp(-air_depth(ray, distance)); }

// Returns the source of the light of sunlit air along a ray, up to a distance: light / (1 - transmittance).
NEPHOS_FUNCTION Real3 air_source(Real3 ray, Real distance) {
    if (!kPhysicalSky) return rgb(frame.horizon);
    Real cosine = (1.0f / kAirAzimuth) * beside_sun(ray), square = cosine * cosine;
    Real3 around;
    around.x = 0.5f * (square + cosine);
    around.y = 1.0f - square;
    around.z = 0.5f * (square - cosine);
    Real3 light = light_of_air(air_column(ray, distance), air_upwards(ray), around,
                               particle_phase(dot(xyz(frame.to_sun), ray), frame.air.y));
    return max(light, Real(0.0f));
}

// Returns the radiance of sunlit air over a distance; `beta` is its transmittance.
NEPHOS_FUNCTION Real3 air_light(Real3 ray, Real distance, Real3 beta) {
    return (1.0f - beta) * air_source(ray, distance);
}

// Gradient: the air is thickest at the horizon; its colour falls off exponentially with height, and reaches zero at the
// zenith. `height`: sine of the elevation.
NEPHOS_FUNCTION Real3 gradient_sky(Real height) {
    float least = exp(-4.0f);
    Real haze = (exp(-4.0f * height) - Real(least)) * (1.0f / (1.0f - least));
    return mix(rgb(frame.zenith), rgb(frame.horizon), haze);
}

// The radiance of the air along a ray: in total, and the part that clouds can shade, single scattering of sunlight.
struct SunlitAir {
    Real3 source;
    Real3 most;                 // no more than the air and the sky have, so that none is negative
    Real molecules, particles;  // with tables: pi times the phase functions, and the albedo
};

NEPHOS_FUNCTION SunlitAir sunlit_air(Real3 ray) {
    SunlitAir air;
    air.source = air_source(ray, Real(kShaftsReach));
    Real cosine = dot(xyz(frame.to_sun), ray);
    if (kPhysicalSky) {
        air.most = Real(0.94f) * air.source;  // clear_air() may take up to 6 % more away than the tables have
        air.molecules = kPi * molecule_phase(cosine);
        air.particles = kPi * frame.air.z * particle_phase(cosine, frame.air.y);
        return air;
    }
    Real direct = frame.horizon.w * 4.0f * kPi * particle_phase(cosine, frame.zenith.w);
    Real fraction = direct / (direct + Real(1.0f - frame.horizon.w + 1.0e-6f));
    air.most = fraction * min(air.source, gradient_sky(max(ray.z, Real(0.0f))));
    air.molecules = Real(0.0f);
    air.particles = Real(0.0f);
    return air;
}

// Returns the single-scattering radiance of infinitely much air as at a height; `sunlight`: the radiance of a white
// surface there that faces the unshaded sun.
NEPHOS_FUNCTION Real3 sunlit_at(SunlitAir air, Real height, Real3 sunlight) {
    if (!kPhysicalSky) return air.most;
    Real altitude = max(frame.air.x + height, Real(0.0f));
    Real3 molecules = fast_exp(-frame.rayleigh.w * altitude) * rgb(frame.rayleigh);
    Real3 particles = fast_exp(-frame.haze.w * altitude) * rgb(frame.haze);
    Real3 scattered = mul_add(air.molecules, molecules, air.particles * particles);
    return min(sunlight * scattered / max(molecules + particles, Real(1.0e-12f)), air.most);
}
