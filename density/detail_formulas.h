// SPDX-License-Identifier: Apache-2.0
//
// The formulas of detailed density (detail.h), one text for C++, for vectors (detail-inl.h) and for GLSL: included
// inside a namespace, after Real, min, max, sqrt, select and mul_add are defined there. No include guard.
//
// A node of the coverage field stores t = D / (D + half), D the density of the metaballs and `half` that at which
// half of the space is cloud. Coverage C = D^2 / (D^2 + half^2), 0..1, is what the erosion works on.

NEPHOS_FUNCTION Real saturate(Real x) { return min(max(x, Real(0.0f)), Real(1.0f)); }

NEPHOS_FUNCTION Real coverage_of(Real t) {
    Real rest = 1.0f - t;
    Real a = t * t, b = rest * rest;
    return a / (a + b);
}

// Whether there may be cloud where nodes store at most 255 `t`, if D is `factor` times as large; `odds`: of the least
// coverage (ErosionConstants::cloud_odds()).
NEPHOS_FUNCTION Truth may_hold_cloud(Real t, Real factor, float odds) { return t * factor > odds * (255.0f - t); }

NEPHOS_FUNCTION Real density_of(Real t, float half_density) {
    return half_density * t / max(1.0f - t, Real(1.0f / 512.0f));
}

// The widths of the noises for a footprint, the size in metres of a pixel or a voxel: the medium one fades between
// footprints of 13 and 25 m, the fine one between 1 and 2.2 m; the edge of the cloud is at least 0.012 footprints
// per metre soft.
NEPHOS_FUNCTION Real medium_width(Real footprint, float width) {
    return width * saturate((25.0f - footprint) * (1.0f / 12.0f));
}
NEPHOS_FUNCTION Real fine_width(Real footprint, float width) {
    return width * saturate((2.2f - footprint) * (1.0f / 1.2f));
}
NEPHOS_FUNCTION Real edge_softness(Real footprint) { return max(Real(0.08f), 0.012f * footprint); }

// 0 at the base of a cloud, 1 from 160 m above it on.
NEPHOS_FUNCTION Real towards_top(Real above_base_m) { return saturate((above_base_m - 40.0f) * (1.0f / 120.0f)); }

// The width of the large noise: `base` at the base, `top` above; dissolving air (growth < 0) is torn to shreds.
NEPHOS_FUNCTION Real large_width(Real top, Real growth, float at_base, float at_top, float dissolving) {
    Real width = mul_add(top, Real(at_top - at_base), Real(at_base));
    return mul_add(max(Real(0.0f) - growth, Real(0.0f)), dissolving - width, width);
}

// 1: billows, round bumps outwards; -1: wisps, their inverse. Above and where the cloud grows billows, at the base
// and where it dissolves wisps.
NEPHOS_FUNCTION Real billows(Real top, Real growth, float wisps) {
    return max(min(1.0f - 2.0f * wisps * (1.0f - top) + growth, Real(1.0f)), Real(-1.0f));
}

// The share of the upper of two neighbouring bands of noise, at a height between their middles, 0..1: they pass into each
// other in the middle third.
NEPHOS_FUNCTION Real share_of_upper(Real between) {
    Real x = saturate(3.0f * between - 1.0f);
    return x * x * (3.0f - 2.0f * x);
}

// A mean of two numbers that are uniform over 0..1, uniform again: `share` of `b`. The mean of independent numbers has a
// trapezoid for a density, whose distribution makes it uniform; `apart`, 0..1, is how independent they are.
NEPHOS_FUNCTION Real mean_of_uniform(Real a, Real b, Real share, Real apart) {
    Real x = mul_add(share, b - a, a), most = max(share, 1.0f - share), least = 1.0f - most;
    Real end = min(x, 1.0f - x);
    Real flank = end * end / max(2.0f * most * least, Real(1.0e-6f));
    Real low = select(end < least, flank, (end - 0.5f * least) / most);
    return mul_add(apart, select(x > Real(0.5f), 1.0f - low, low) - x, x);
}

// `apart` of the small noises, from that of the large one: their bumps are others sooner.
NEPHOS_FUNCTION Real apart_of_small(Real apart) { return min(8.0f * apart, Real(1.0f)); }

// Fraction of the places of coverage `c` that are cloud: the distribution at c - 1/2 of a sum of two uniform numbers,
// of widths `large` and `small` < large. Density divided by it keeps the mean over the noise.
NEPHOS_FUNCTION Real cloudy_fraction(Real c, Real large, Real small) {
    Real x = c - 0.5f;
    Real away = max(x, Real(0.0f) - x);
    Real tail = max(0.5f * (large + small) - away, Real(0.0f));
    Real outer = tail * tail / (2.0f * small * large);
    Real less = select(away > 0.5f * (large - small), outer, 0.5f - away / large);
    return select(x > Real(0.0f), 1.0f - less, less);
}
