// SPDX-License-Identifier: Apache-2.0
#pragma once

// Culls metaballs and billboards to the view and sorts both into one order, farthest from the eye first: the
// input of the back-ends. Private to the module.
//
// The order is total: equal distances are ordered by index, billboards before metaballs, so images do not
// depend on the sort algorithm.

#include <cstdint>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/cloud/splats.h"
#include "render/options/camera.h"
#include "render/shared/shared.h"

namespace nephos {

enum class SplatKind {
    metaball,             // shader::ViewBall; `blended` draws it with an attenuation texture
    integrated_metaball,  // shader::ViewBall with shader::kIntegrate: opacity is integrated per pixel
    billboard,            // shader::ViewBillboard
    shell,                // a shell of air (air_shells.h), not a splat; never in ViewSortedSplats::runs
};

// Consecutive splats of one kind in the order, which one pipeline draws: a range of ViewSortedSplats::balls
// or ViewSortedSplats::billboards.
struct Run {
    std::uint32_t begin = 0, end = 0;
    SplatKind kind = SplatKind::metaball;
};

struct ViewSortedSplats {
    std::vector<shader::ViewBall> balls;            // farthest first
    std::vector<std::uint32_t> source;              // of each ball: index into PreparedCloud::visible
    std::vector<shader::ViewBillboard> billboards;  // farthest first
    std::vector<Run> runs;                  // non-empty, farthest first; together all of balls and billboards
    std::vector<shader::ViewCloud> clouds;  // one for each of Splats::clouds
    const BillboardPictures* pictures = nullptr;  // as Splats::pictures, which keeps them
    bool depth = true;                      // as Splats::depth
    bool all_fitted = true;                 // no ball has shader::kNotFitted
};

// The light at each of cloud.visible.
struct MetaballLight {
    std::span<const float> sun;    // optical depth, as shader::ViewBall::sun_depth
    std::span<const float> flash;  // transmitted fraction of the lightning, 0..1; empty without
};

// Culls splats to the view and sorts them; metaballs are without light. `pixels_per_unit` is the size in
// pixels of a unit at distance 1. If clouds with detail are marched (footprint_scale() above 0), metaballs that stand for them are only where
// they take over (shader::splatted_weight()). Throws Error(usage) naming the first billboard or cloud with a field out of
// the range in splats.h. `sunlight`: the fraction that arrives at each of the billboards, 0..1; empty: all of it.
ViewSortedSplats sort_for_view(const PreparedCloud& cloud, const Splats& splats, const CameraFrame& camera,
                               double pixels_per_unit, const Ground& ground, double footprint_scale = 0,
                               std::span<const float> sunlight = {});

// Sets the light of the metaballs of an order.
void set_light(ViewSortedSplats& order, const MetaballLight& light);

}  // namespace nephos
