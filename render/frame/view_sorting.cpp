// SPDX-License-Identifier: Apache-2.0
#include "render/frame/view_sorting.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include <hwy/base.h>
#include <hwy/cache_control.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/keyed_order.h"
#include "core/vec.h"
#include "render/frame/billboard_textures.h"
#include "render/shared/half_floats.h"
#include "render/shared/march.h"

namespace nephos {
namespace {

constexpr float kLargestBillboard_m = 60000;  // half of it is a 16-bit float

[[noreturn]] void fail(const std::string& what, std::size_t index, const char* expected) {
    throw Error(ErrorCode::usage, what + " " + std::to_string(index) + ": expected " + expected);
}

bool finite(const Vec3& v) { return std::isfinite(v.x + v.y + v.z); }
bool within(float value, float min, float max) { return value >= min && value <= max; }

// Returns the first field of a billboard that is out of the range in splats.h, with that range; null if none
// is.
const char* expected(const CloudBillboard& billboard, std::size_t clouds, int pictures) {
    if (!finite(billboard.centre_m)) return "a finite centre";
    if (!(billboard.width_m > 0 && billboard.height_m > 0 && billboard.width_m <= kLargestBillboard_m &&
          billboard.height_m <= kLargestBillboard_m))
        return "sizes above 0 and at most 60000 m";
    if (!within(billboard.sun_absorbed, 0, 1) || !within(billboard.flash_absorbed, 0, 1))
        return "absorbed light from 0 to 1";
    if (!within(billboard.opacity, 0, 1)) return "an opacity from 0 to 1";
    if (std::size_t(billboard.texture) >= kBillboardKinds) return "a texture of BillboardTexture";
    if (billboard.picture < -1 || billboard.picture >= pictures) return "the index of a picture, or -1";
    return billboard.cloud < clouds ? nullptr : "the index of a cloud";
}

shader::ViewCloud billboard_cloud(const BillboardCloud& cloud, std::size_t index, const Vec3& eye) {
    if (!finite(cloud.centre_m) || !(cloud.base_m < cloud.top_m) ||
        !std::isfinite(cloud.top_m - cloud.base_m))
        fail("cloud of billboards", index, "a finite centre and a base below its top");
    const Vec3 offset = cloud.centre_m - eye;
    return {float(offset.x),
            float(offset.y),
            float(offset.z),
            float(cloud.base_m - eye.z),
            float(1 / (cloud.top_m - cloud.base_m)),
            0,
            0,
            0};
}

// Collects what the camera sees and puts it in order.
class Collector {
  public:
    Collector(const PreparedCloud& cloud, const Splats& splats, const CameraFrame& camera,
              double pixels_per_unit, const Ground& ground, double footprint_scale, std::span<const float> sunlight)
        : cloud_(cloud),
          footprint_scale_(footprint_scale),
          sunlight_(sunlight),
          splats_(splats),
          camera_(camera),
          eye_(camera.position_m),
          pyramid_(camera),
          pixels_per_unit_(pixels_per_unit),
          ground_m_(ground.height_m),
          above_ground_(camera.position_m.z > ground.height_m),
          by_distance_(cloud.visible.size() + splats.billboards.size()) {}

    void add_metaballs() {
        by_distance_.add_all(0, cloud_.visible.size(), [this](std::uint32_t i, float& distance) {
            const Metaball& ball = cloud_.metaballs[cloud_.visible[i]];
            if (above_ground_ && ball.z + ball.radius < ground_m_) return false;
            // Metaballs reach up to 1.35 radii (view_splat.vert), and never less than part of a pixel.
            return sees({ball.x, ball.y, ball.z}, ball.radius, 1.5, double(shader::kMinRadiusPixels),
                        distance) &&
                   weight_of(i, double(distance)) > 0;
        });
    }

    void add_billboards() {
        const auto first = std::uint32_t(cloud_.visible.size());
        std::atomic<std::size_t> first_bad = splats_.billboards.size();
        by_distance_.add_all(
            first, splats_.billboards.size(), [this, first, &first_bad](std::uint32_t i, float& distance) {
                const CloudBillboard& billboard = splats_.billboards[i - first];
                if (expected(billboard, splats_.clouds.size(), pictures()) != nullptr) {
                    std::size_t known = first_bad;
                    while (i - first < known && !first_bad.compare_exchange_weak(known, i - first)) {
                    }
                    return false;
                }
                if (above_ground_ && billboard.centre_m.z < ground_m_) return false;
                if (!(drawn(billboard).opacity > 0)) return false;
                return sees(billboard.centre_m, 0.5 * std::max(billboard.width_m, billboard.height_m), 1.4143,
                            double(shader::kMinBillboardPixels), distance);
            });
        if (first_bad < splats_.billboards.size())
            fail("billboard", first_bad, expected(splats_.billboards[first_bad], splats_.clouds.size(), pictures()));
    }

    ViewSortedSplats order() {
        by_distance_.sort();
        ViewSortedSplats order;
        order.depth = splats_.depth;
        order.pictures = splats_.pictures.get();
        place_splats(order);
        const std::size_t parts = first_ball_.size() - 1;
        std::vector<std::uint8_t> kinds(by_distance_.size()), fitted(parts, 1);
        tbb::parallel_for(std::size_t{0}, parts,
                          [&](std::size_t p) { fitted[p] = fill_part(order, p, kinds) ? 1 : 0; });
        order.all_fitted = std::ranges::count(fitted, 0) == 0;
        for (const std::uint8_t kind : kinds) extend(order, SplatKind(kind));
        for (std::size_t i = 0; i < splats_.clouds.size(); ++i)
            order.clouds.push_back(billboard_cloud(splats_.clouds[i], i, eye_));
        return order;
    }

  private:
    static constexpr std::size_t kPart = 4096;  // splats that one thread looks at
    static constexpr std::size_t kAhead = 12;   // from a splat to that which is fetched meanwhile

    // Computes the positions of each part's balls and billboards in the sorted arrays, from the farthest on.
    void place_splats(ViewSortedSplats& order) {
        const std::size_t count = by_distance_.size(), parts = (count + kPart - 1) / kPart;
        first_ball_.assign(parts + 1, 0);
        tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t p) {
            for (std::size_t i = p * kPart; i < std::min(count, (p + 1) * kPart); ++i)
                if (is_ball(from_far(i))) ++first_ball_[p + 1];
        });
        for (std::size_t p = 0; p < parts; ++p) first_ball_[p + 1] += first_ball_[p];
        order.balls.resize(first_ball_[parts]);
        order.source.resize(first_ball_[parts]);
        order.billboards.resize(count - first_ball_[parts]);
    }

    // Weight of the ball with an index in `visible`, beside what is marched in its place.
    float weight_of(std::uint32_t index, double distance) const {
        if (!(footprint_scale_ > 0) || !cloud_.is_detailed(index)) return 1;
        if (cloud_.detailed[index] == kNeverSplatted) return 0;
        return shader::splatted_weight(float(distance / (pixels_per_unit_ * footprint_scale_)));
    }

    bool is_ball(std::uint32_t index) const { return index < cloud_.visible.size(); }
    std::uint32_t from_far(std::size_t i) const { return by_distance_[by_distance_.size() - 1 - i]; }

    // Splats of an order lie anywhere in memory. Inline: GCC drops calls of functions that only prefetch.
    HWY_INLINE void prefetch(std::uint32_t source) const {
        if (is_ball(source)) {
            hwy::Prefetch(&cloud_.metaballs[cloud_.visible[source]]);
            hwy::Prefetch(&cloud_.depth_scale[source]);
        } else {
            const CloudBillboard& billboard = splats_.billboards[source - cloud_.visible.size()];
            hwy::Prefetch(&billboard);
            hwy::Prefetch(&billboard.cloud);
        }
    }

    // False if a metaball of the part is not fitted.
    bool fill_part(ViewSortedSplats& order, std::size_t part, std::vector<std::uint8_t>& kinds) const {
        bool fitted = true;
        std::size_t ball = first_ball_[part], billboard = part * kPart - ball;
        const std::size_t end = std::min(by_distance_.size(), (part + 1) * kPart);
        for (std::size_t i = part * kPart; i < end; ++i) {
            prefetch(from_far(std::min(i + kAhead, end - 1)));
            const std::uint32_t source = from_far(i);
            SplatKind kind = SplatKind::billboard;
            if (is_ball(source)) {
                const shader::ViewBall& seen = order.balls[ball] = view_ball(source);
                order.source[ball++] = source;
                fitted = fitted && (seen.flags & shader::kNotFitted) == 0;
                kind = (seen.flags & (shader::kAround | shader::kIntegrate)) != 0
                           ? SplatKind::integrated_metaball
                           : SplatKind::metaball;
            } else {
                order.billboards[billboard++] =
                    view_billboard(source - cloud_.visible.size());
            }
            kinds[i] = std::uint8_t(kind);
        }
        return fitted;
    }

    // Tests the visibility of a splat of `reach` times the radius, at least `least_pixels`.
    bool sees(const Vec3& centre, double radius, double reach, double least_pixels, float& distance_m) const {
        const Vec3 offset = centre - eye_;
        const double distance = std::sqrt(dot(offset, offset));
        const double least = least_pixels * distance / pixels_per_unit_;
        distance_m = float(distance);
        return pyramid_.may_see(offset, reach * std::max(radius, least));
    }

    // A billboard as it is drawn.
    struct Drawn {
        double depth_m = 0;                          // distance from the eye's plane
        double half_width_m = 0, half_height_m = 0;  // at least part of a pixel
        double opacity = 0;
    };

    Drawn drawn(const CloudBillboard& billboard) const {
        Drawn result;
        result.depth_m = dot(billboard.centre_m - eye_, camera_.forward);
        if (!(result.depth_m > 0)) return result;
        const double least = double(shader::kMinBillboardPixels) * result.depth_m / pixels_per_unit_;
        const double half_width = 0.5 * billboard.width_m, half_height = 0.5 * billboard.height_m;
        result.half_width_m = std::max(half_width, least);
        result.half_height_m = std::max(half_height, least);
        // One that the eye flies through fades before it is cut.
        const double fade = std::clamp(
            2 * result.depth_m / std::max(result.half_width_m, result.half_height_m) - 1, 0.0, 1.0);
        result.opacity = billboard.opacity * fade * half_width * half_height /
                         (result.half_width_m * result.half_height_m);
        return result;
    }

    // Returns the mip level with about one texel per pixel.
    int level_of(const Drawn& drawn) const {
        const double pixels =
            2 * std::max(drawn.half_width_m, drawn.half_height_m) * pixels_per_unit_ / drawn.depth_m;
        const double texels_per_pixel = kBillboardTexels / pixels;
        int level = 0;
        while (level + 1 < kBillboardLevels && texels_per_pixel > double(1 << level) * 1.4142) ++level;
        return level;
    }

    // Extends the runs by the next splat of a kind, from far to near.
    void extend(ViewSortedSplats& order, SplatKind kind) {
        std::uint32_t& next = kind == SplatKind::billboard ? runs_billboards_ : runs_balls_;
        if (order.runs.empty() || order.runs.back().kind != kind) order.runs.push_back({next, next, kind});
        order.runs.back().end = ++next;
    }

    // Returns true when tiles can draw it as an ellipse with a polynomial. Beside or behind the eye the
    // outline is no ellipse; the half floats of the radius in pixels end at 65504.
    bool is_fitted(const Vec3& offset, double distance, double ball_radius, float depth_scale) const {
        const double least = double(shader::kMinRadiusPixels) * distance / pixels_per_unit_;
        const double radius = std::max(ball_radius, least), depth = dot(offset, camera_.forward);
        return depth_scale <= shader::kMaxFittedDepth && depth >= 1.01 * radius &&
               radius * pixels_per_unit_ <= 60000.0 * depth;
    }

    // Returns a metaball in camera space, without its light.
    shader::ViewBall view_ball(std::uint32_t source) const {
        const Metaball& ball = cloud_.metaballs[cloud_.visible[source]];
        const Vec3 offset = Vec3{ball.x, ball.y, ball.z} - eye_;
        const double distance = length(offset);
        const float depth_scale = cloud_.depth_scale[source] * weight_of(source, distance);
        shader::uint flags = 0;
        if (distance < double(shader::kNearDistance) * ball.radius)
            flags |= shader::kAround | shader::kIntegrate;
        if (above_ground_ && ball.z - ball.radius < ground_m_) flags |= shader::kIntegrate;
        if (depth_scale > shader::kMaxDepthScale) flags |= shader::kIntegrate;
        if (flags != 0 || !is_fitted(offset, distance, ball.radius, depth_scale))
            flags |= shader::kNotFitted;
        const double scale = cloud_.top_m > cloud_.base_m ? 1.0 / (cloud_.top_m - cloud_.base_m) : 0.0;
        return {float(offset.x),
                float(offset.y),
                float(offset.z),
                ball.radius,
                depth_scale,
                1.0f,
                float((ball.z - cloud_.base_m) * scale),
                flags};
    }

    int pictures() const { return splats_.pictures ? splats_.pictures->count : 0; }

    shader::ViewBillboard view_billboard(std::size_t index) const {
        const CloudBillboard& billboard = splats_.billboards[index];
        const Vec3 offset = billboard.centre_m - eye_;
        const Drawn what = drawn(billboard);
        const BillboardPicture picture = billboard.picture >= 0
                                             ? own_picture(billboard.picture)
                                             : billboard_picture(billboard.texture, billboard.variant);
        return {float(offset.x),
                float(offset.y),
                float(offset.z),
                pack_halves(float(what.half_width_m), float(what.half_height_m)),
                std::uint32_t(picture.layer) | std::uint32_t(picture.turn) << 8 |
                    std::uint32_t(level_of(what)) << 12 |
                    unorm16(sunlight_.empty() ? 1.0f : sunlight_[index]) << 16,
                unorm16(billboard.sun_absorbed) | unorm16(billboard.flash_absorbed) << 16,
                float(what.opacity),
                billboard.cloud};
    }

    const PreparedCloud& cloud_;
    const double footprint_scale_;
    std::span<const float> sunlight_;
    const Splats& splats_;
    const CameraFrame& camera_;
    Vec3 eye_{};
    Frustum pyramid_;
    double pixels_per_unit_, ground_m_;
    bool above_ground_;
    KeyedOrder by_distance_;               // indices: metaballs first, then billboards
    std::vector<std::size_t> first_ball_;  // of each part of the splats, and their number
    std::uint32_t runs_balls_ = 0, runs_billboards_ = 0;
};

}  // namespace

ViewSortedSplats sort_for_view(const PreparedCloud& cloud, const Splats& splats, const CameraFrame& camera,
                               double pixels_per_unit, const Ground& ground, double footprint_scale,
                               std::span<const float> sunlight) {
    if (splats.billboards.size() > std::size_t(std::numeric_limits<std::int32_t>::max()))
        throw Error(ErrorCode::usage, "more than 2^31 billboards");
    if (splats.clouds.size() >> 28 != 0)  // a shader::ViewBillboard has 28 bits for its cloud
        throw Error(ErrorCode::usage, "more than 2^28 clouds of billboards");
    Collector collector(cloud, splats, camera, pixels_per_unit, ground, footprint_scale, sunlight);
    collector.add_metaballs();
    collector.add_billboards();
    return collector.order();
}

void set_light(ViewSortedSplats& order, const MetaballLight& light) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, order.balls.size(), 8192), [&](const auto& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
            shader::ViewBall& ball = order.balls[i];
            ball.sun_depth = light.sun[order.source[i]];
            if (!light.flash.empty())
                ball.flags = (ball.flags & 0xffffu) | unorm16(light.flash[order.source[i]]) << 16;
        }
    });
}

}  // namespace nephos
