// SPDX-License-Identifier: Apache-2.0
#include "render/frame/billboard_shade.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

#include <tbb/parallel_for.h>

#include "render/frame/billboard_row.h"
#include "render/frame/billboard_textures.h"

namespace nephos {
namespace {

constexpr unsigned kQueryLevel = 2;  // of the textures, for single places: 32 texels across
constexpr int kMostCells = 256;
constexpr int kRowsAtOnce = 16;  // of a shadow map

// Opacity times area of a texture, as a fraction of the rectangle: about that of a soft one.
constexpr double kMeanOpacity = 0.35;

bool is_good(const CloudBillboard& of, int pictures) {
    return std::isfinite(of.centre_m.x + of.centre_m.y + of.centre_m.z) && of.width_m > 0 &&
           of.height_m > 0 && std::isfinite(of.width_m) && std::isfinite(of.height_m) && of.opacity > 0 &&
           of.opacity <= 1 && std::size_t(of.texture) < std::size_t(kBillboardKinds) && of.picture < pictures;
}

// Spheres that fill an ellipsoid with the level semi-axes a and the upright one b about: none reaches above or below it.
void add_spheres(const Vec3& centre_m, double a, double b, double weight, std::vector<ShadowCaster>& to) {
    const double r = std::min(a, b);
    if (a > b) {
        for (const Vec3& side : {Vec3{1, 0, 0}, Vec3{-1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, -1, 0}, Vec3{0, 0, 0}})
            to.push_back({centre_m + (a - r) * side, r, weight / 5});
    } else {
        for (const double side : {-1, 0, 1})
            to.push_back({centre_m + Vec3{0, 0, side * (b - r)}, r, weight / 3});
    }
}

}  // namespace

struct BillboardShade::Footprint {
    double x = 0, y = 0;            // of the middle, texels
    double half_x = 1, half_y = 1;  // texels
    float opacity = 1;              // of the billboard, thinned where it was widened
    int first_row = 0, end_row = 0;
    int first_column = 0, end_column = 0;
    unsigned level = 0;  // of the textures
};

BillboardShade::BillboardShade(std::span<const CloudBillboard> seen, std::span<const CloudBillboard> unseen,
                               std::shared_ptr<const BillboardPictures> pictures, const Vec3& to_sun)
    : to_sun_(to_sun), pictures_(std::move(pictures)) {
    const ShadowAxes axes = shadow_axes(to_sun);
    right_ = axes.right;
    up_ = axes.up;
    casters_.reserve(seen.size() + unseen.size());
    add(seen);
    add(unseen);
    const auto key = [](const Caster& c) {
        return std::tie(c.s, c.u, c.v, c.half_u, c.half_v, c.half_chord, c.opacity, c.layer, c.turn, c.cloud);
    };
    std::sort(casters_.begin(), casters_.end(),
              [&](const Caster& a, const Caster& b) { return key(a) < key(b); });
    for (const Caster& caster : casters_)
        longest_half_chord_ = std::max(longest_half_chord_, caster.half_chord);
    for (const Caster& c : casters_) {
        add_spheres(c.u * right_ + c.v * up_ - c.s * to_sun_, double(c.half_u), double(c.half_height),
                    kMeanOpacity * double(c.opacity) * std::numbers::pi * double(c.half_u) * double(c.half_v), spheres_);
    }
    bin();
}

void BillboardShade::add(std::span<const CloudBillboard> billboards) {
    const double sine = to_sun_.z, cosine = std::sqrt(std::max(0.0, 1 - sine * sine));
    const int pictures = pictures_ ? pictures_->count : 0;
    for (const CloudBillboard& of : billboards) {
        if (!is_good(of, pictures)) continue;
        const double a = 0.5 * double(of.width_m), b = 0.5 * double(of.height_m);
        const BillboardPicture picture =
            of.picture >= 0 ? own_picture(of.picture) : billboard_picture(of.texture, of.variant);
        Caster& caster = casters_.emplace_back();
        caster.u = dot(right_, of.centre_m);
        caster.v = dot(up_, of.centre_m);
        caster.s = -dot(to_sun_, of.centre_m);
        caster.half_u = float(a);
        caster.half_v = float(std::hypot(b * cosine, a * sine));
        caster.half_chord = float(1 / std::hypot(cosine / a, sine / b));
        caster.half_height = float(b);
        caster.opacity = of.opacity;
        caster.layer = std::uint16_t(picture.layer);
        caster.turn = std::uint16_t(picture.turn);
        caster.cloud = of.cloud;
    }
}

// Cells about as large as billboards: each is listed in a few of them.
void BillboardShade::bin() {
    if (casters_.empty()) return;
    double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300}, sum = 0;
    for (const Caster& c : casters_) {
        const double at[2] = {c.u, c.v}, half[2] = {double(c.half_u), double(c.half_v)};
        for (int axis = 0; axis < 2; ++axis) {
            low[axis] = std::min(low[axis], at[axis] - half[axis]);
            high[axis] = std::max(high[axis], at[axis] + half[axis]);
            sum += half[axis];
        }
    }
    const double mean_m = sum / double(casters_.size());
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const double length = high[axis] - low[axis];
        cells_[axis] = std::clamp(int(length / mean_m), 1, kMostCells);
        low_[axis] = low[axis];
        per_m_[axis] = cells_[axis] / length;
    }
    const auto cell = [&](std::size_t axis, double at) {
        return std::clamp(int((at - low_[axis]) * per_m_[axis]), 0, cells_[axis] - 1);
    };
    const auto each_cell = [&](const Caster& c, auto&& work) {
        const int last_u = cell(0, c.u + double(c.half_u)), last_v = cell(1, c.v + double(c.half_v));
        for (int j = cell(1, c.v - double(c.half_v)); j <= last_v; ++j)
            for (int i = cell(0, c.u - double(c.half_u)); i <= last_u; ++i)
                work(std::size_t(j) * std::size_t(cells_[0]) + std::size_t(i));
    };
    first_.assign(std::size_t(cells_[0]) * std::size_t(cells_[1]) + 1, 0);
    for (const Caster& c : casters_) each_cell(c, [&](std::size_t n) { ++first_[n + 1]; });
    for (std::size_t n = 1; n < first_.size(); ++n) first_[n] += first_[n - 1];
    listed_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t i = 0; i < casters_.size(); ++i)
        each_cell(casters_[i], [&](std::size_t n) { listed_[next[n]++] = std::uint32_t(i); });
}

float BillboardShade::sunlight_at(const Vec3& place_m, std::uint32_t but_for_cloud) const {
    if (casters_.empty()) return 1;
    const double at[2] = {dot(right_, place_m), dot(up_, place_m)}, s = -dot(to_sun_, place_m);
    int cell[2];
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const double c = (at[axis] - low_[axis]) * per_m_[axis];
        if (!(c >= 0 && c < cells_[axis])) return 1;
        cell[axis] = int(c);
    }
    const std::size_t n = std::size_t(cell[1]) * std::size_t(cells_[0]) + std::size_t(cell[0]);
    const BillboardTexels& texels = billboard_texels(pictures_.get());
    float left = 1;
    for (std::uint32_t i = first_[n]; i < first_[n + 1]; ++i) {
        const Caster& c = casters_[listed_[i]];
        if (c.s - double(longest_half_chord_) > s) break;
        if (c.cloud == but_for_cloud) continue;
        const float right = float(at[0] - c.u) / c.half_u, up = float(at[1] - c.v) / c.half_v;
        if (std::abs(right) >= 1 || std::abs(up) >= 1) continue;
        const float behind = std::clamp(0.5f + 0.5f * float(s - c.s) / c.half_chord, 0.0f, 1.0f);
        if (behind <= 0) continue;
        left *= 1 - behind * c.opacity * TurnedTexture(texels, kQueryLevel, c.layer, c.turn).opacity(right, up);
    }
    return left;
}

BillboardShade::Footprint BillboardShade::footprint(const Caster& caster, const ShadowFrame& frame,
                                                    int size) const {
    const Vec3 offset = caster.u * right_ + caster.v * up_ - caster.s * to_sun_ - frame.origin_m;
    const Vec3& u = frame.u_axis_m;
    const Vec3& v = frame.v_axis_m;
    const double per_u = size / length(u), per_v = size / length(v), least = double(shader::kMinRadiusPixels);
    Footprint on;
    on.x = size * dot(u, offset) / dot(u, u);
    on.y = size * dot(v, offset) / dot(v, v);
    const double half_x = double(caster.half_u) * per_u, half_y = double(caster.half_v) * per_v;
    on.half_x = std::max(half_x, least);
    on.half_y = std::max(half_y, least);
    on.opacity = float(double(caster.opacity) * half_x * half_y / (on.half_x * on.half_y));
    const auto texel = [&](double at) { return int(std::clamp(std::ceil(at - 0.5), 0.0, double(size))); };
    on.first_row = texel(on.y - on.half_y);
    on.end_row = texel(on.y + on.half_y);
    on.first_column = texel(on.x - on.half_x);
    on.end_column = texel(on.x + on.half_x);
    const double texels_per_texel = kBillboardTexels / (2 * std::max(on.half_x, on.half_y));
    while (on.level + 1 < unsigned{kBillboardLevels} && texels_per_texel > double(1u << on.level) * 1.4142) ++on.level;
    return on;
}

void BillboardShade::cast(const ShadowFrame& frame, int size, std::span<float> shadow) const {
    if (casters_.empty()) return;
    const int blocks = (size + kRowsAtOnce - 1) / kRowsAtOnce;
    std::vector<Footprint> footprints(casters_.size());
    std::vector<std::vector<std::uint32_t>> of_block(static_cast<std::size_t>(blocks));
    for (std::size_t i = 0; i < casters_.size(); ++i) {
        const Footprint& on = footprints[i] = footprint(casters_[i], frame, size);
        for (int b = on.first_row / kRowsAtOnce; b * kRowsAtOnce < on.end_row; ++b)
            of_block[std::size_t(b)].push_back(std::uint32_t(i));
    }
    const BillboardTexels& textures = billboard_texels(pictures_.get());
    tbb::parallel_for(0, blocks, [&](int b) {
        for (const std::uint32_t i : of_block[std::size_t(b)]) {
            const Footprint& on = footprints[i];
            if (on.first_column >= on.end_column) continue;
            const TurnedTexture texture(textures, on.level, casters_[i].layer, casters_[i].turn);
            const PlacesInRow places{.first = float((on.first_column + 0.5 - on.x) / on.half_x),
                                     .step = float(1 / on.half_x)};
            const int end = std::min(on.end_row, (b + 1) * kRowsAtOnce);
            for (int row = std::max(on.first_row, b * kRowsAtOnce); row < end; ++row)
                shade_row(texture, places, float((row + 0.5 - on.y) / on.half_y), on.opacity,
                          shadow.subspan(std::size_t(row) * std::size_t(size) + std::size_t(on.first_column),
                                         std::size_t(on.end_column - on.first_column)));
        }
    });
}

}  // namespace nephos
