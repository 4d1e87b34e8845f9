// SPDX-License-Identifier: Apache-2.0
#pragma once

// All splats of a picture, metaballs and billboards, in one order from far to near of the eye: what a view
// pass draws, whatever way it draws. No Vulkan here. Private to the module.
//
// The order is total: equal distances are ordered by index, billboards before metaballs, so a picture never
// depends on how a sort is done.

#include <cstdint>
#include <span>
#include <vector>

#include "render/cloud/cloud_preparation.h"
#include "render/cloud/splats.h"
#include "render/options/camera.h"
#include "render/shared/shared.h"

namespace nephos {

enum class SplatKind {
    metaball,             // shader::ViewBall, from the textures
    integrated_metaball,  // shader::ViewBall with shader::kIntegrate
    billboard,            // shader::ViewBillboard
    shell,                // a shell of air (air_shells.h), not a splat; never in ViewSortedSplats::runs
};

// Consecutive splats in the order from the eye that one pipeline draws: of ViewSortedSplats::balls or
// ViewSortedSplats::billboards.
struct Run {
    std::uint32_t begin = 0, end = 0;
    SplatKind kind = SplatKind::metaball;
};

struct ViewSortedSplats {
    std::vector<shader::ViewBall> balls;            // farthest first
    std::vector<std::uint32_t> source;              // of each ball: index into PreparedCloud::visible
    std::vector<shader::ViewBillboard> billboards;  // farthest first
    std::vector<Run> runs;  // none is empty; together they are all of balls and billboards, farthest first
    std::vector<shader::ViewCloud> clouds;  // one for each of Splats::clouds
    bool depth = true;                      // as Splats::depth
    bool all_fitted = true;                 // no ball has shader::kNotFitted
};

// The light of each of cloud.visible.
struct MetaballLight {
    std::span<const float> sun;    // optical depth, as shader::ViewBall::sun_depth
    std::span<const float> flash;  // share of the lightning that arrives, 0..1; empty without
};

// The splats that the camera can see; metaballs without their light. `pixels_per_unit` is the size in pixels
// of a unit at distance 1. Throws Error(usage) naming the first billboard or cloud that is not as splats.h
// wants it.
ViewSortedSplats sort_for_view(const PreparedCloud& cloud, const Splats& splats, const CameraFrame& camera,
                               double pixels_per_unit, const Ground& ground);

// Gives the metaballs of an order their light.
void set_light(ViewSortedSplats& order, const MetaballLight& light);

// What the camera sees: inside of the four planes through the eye and the sides of the picture, not behind
// the eye.
class ViewPyramid {
  public:
    explicit ViewPyramid(const CameraFrame& camera);
    // False only if nothing of the sphere is inside. `offset`: of its centre from the eye.
    bool may_see(const Vec3& offset, double radius) const;
    // Normal of one of the planes, into the pyramid.
    const Vec3& inward(std::size_t plane) const { return inward_[plane]; }

  private:
    Vec3 inward_[5]{};
};

}  // namespace nephos
