// SPDX-License-Identifier: Apache-2.0
#include "render/vulkan/device_ground.h"

#include <algorithm>
#include <cstddef>
#include <span>

#include "render/ground/wet_ground.h"

namespace nephos {
namespace {

static_assert(sizeof(NoiseOctave) == sizeof(shader::GroundOctave) &&
              offsetof(NoiseOctave, from_x) == offsetof(shader::GroundOctave, from_x) &&
              offsetof(NoiseOctave, cell_x) == offsetof(shader::GroundOctave, cell_x) &&
              offsetof(NoiseOctave, weight) == offsetof(shader::GroundOctave, weight));
static_assert(sizeof(WaterWave) == sizeof(shader::GroundWave) &&
              offsetof(WaterWave, slope_x) == offsetof(shader::GroundWave, slope_x) &&
              offsetof(WaterWave, variance) == offsetof(shader::GroundWave, variance));
static_assert(kCrops == shader::kCropKinds);

shader::vec4 rgb_of(const std::array<float, 3>& colour) { return {colour[0], colour[1], colour[2], 0}; }

// The noises of a pass in the order of their octaves.
struct NoiseOf {
    const std::vector<NoiseOctave>& octaves;
    shader::GroundNoise shader::GroundData::*place;
};
std::array<NoiseOf, 8> noises_of(const GroundPass& pass) {
    using Data = shader::GroundData;
    return {{{pass.hollows, &Data::hollows},
             {pass.tufts, &Data::tufts},
             {pass.country.bends, &Data::bends},
             {pass.country.woods, &Data::woods},
             {pass.country.tones, &Data::tones},
             {pass.country.tussocks, &Data::tussocks},
             {pass.water.gusts, &Data::gusts},
             {pass.water.foam, &Data::foam}}};
}

void set_mirror(const MirrorView& view, shader::GroundData& data) {
    data.mirror_forward = to_vec4(view.frame.forward, view.pixels_per_unit);
    data.mirror_right = to_vec4(view.frame.right, 0.5 / view.frame.half_width);
    data.mirror_up = to_vec4(view.frame.up, -0.5 / view.frame.half_height);
    data.mirror_levels = shader::uint(view.levels.size());
    for (std::size_t n = 0; n < view.levels.size(); ++n)
        data.levels[n] = {shader::uint(view.levels[n].first), shader::uint(view.levels[n].width),
                          shader::uint(view.levels[n].height)};
}

void set_country(const Country& country, shader::GroundData& data) {
    for (std::size_t n = 0; n < kCrops; ++n)
        data.crops[n] = {country.crops[0][n], country.crops[1][n], country.crops[2][n], 0};
    std::array<float, 3> mean{};
    for (std::size_t c = 0; c < 3; ++c) {
        for (const float crop : country.crops[c]) mean[c] += crop;
        mean[c] /= float(kCrops);
    }
    data.mean_crop = rgb_of(mean);
    data.wood = rgb_of(country.wood);
    data.hedge = rgb_of(country.hedge);
    const NoiseOctave& o = country.fields;
    data.fields = {o.x_x, o.x_y, o.y_x, o.y_y, o.from_x, o.from_y, o.cell_x, o.cell_y, o.wavelength_m, o.weight};
    data.hedge_cells = country.hedge_cells;
    data.bend_m = country.bend_m;
}

void set_ripples(const RippleGrid& grid, shader::GroundData& data) {
    data.ripple_corner_x = grid.corner_x;
    data.ripple_corner_y = grid.corner_y;
    data.ripple_from_x = grid.from_x;
    data.ripple_from_y = grid.from_y;
    data.ripple_texel_x = grid.texel_x;
    data.ripple_texel_y = grid.texel_y;
    data.ripple_strength = grid.slopes.x.empty() ? 0.0f : grid.strength;
    data.ripple_per_mm = 1 / grid.most_mm_per_h;
    data.ripple_variance = float(grid.slopes.variance);
}

// Water, snow and rain of all texels.
std::vector<float> cover_words(const GroundCoverView& map) {
    std::vector<float> words;
    words.reserve(3 * map.water_mm.size());
    for (const std::span<const float> values : {map.water_mm, map.snow_mm, map.rain_mm_per_h})
        words.insert(words.end(), values.begin(), values.end());
    return words;
}

template <class T>
void upload_all(const GpuDevice& gpu, GpuBuffer& buffer, const std::vector<T>& values) {
    upload(gpu, buffer, std::as_bytes(std::span(values)));
}

}  // namespace

shader::GroundData ground_data(const GroundPass& pass, const MirrorView* mirror) {
    const WetGroundOptions& look = *pass.look;
    const GroundCoverView& map = *pass.cover.map;
    shader::GroundData data{};
    data.dry = {pass.dry.x, pass.dry.y, pass.dry.z, float(soaked_back_reflectance())};
    data.soaked = {float(soaked_albedo(double(pass.dry.x))), float(soaked_albedo(double(pass.dry.y))),
                   float(soaked_albedo(double(pass.dry.z))), 0};
    data.snow = {float(look.snow_albedo[0]), float(look.snow_albedo[1]), float(look.snow_albedo[2]), 0};
    data.film = {float(1 / look.soaking_mm), float(look.puddle_film_mm), float(look.snow_cover_mm), float(look.sheen)};
    data.cover_place = {pass.cover.from_x, pass.cover.from_y, pass.cover.per_x, pass.cover.per_y};
    data.outside = {float(map.outside.water_mm), float(map.outside.snow_mm), float(map.outside_rain_mm_per_h), 0};
    data.columns = shader::uint(map.columns);
    data.rows = shader::uint(map.rows);
    data.reflection = pass.reflection;
    if (mirror != nullptr) set_mirror(*mirror, data);
    set_country(pass.country, data);
    set_ripples(pass.ripples, data);
    data.slope_variance = pass.water.slope_variance;
    data.foam_level = pass.water.foam_level;
    data.foam_albedo = pass.water.foam_albedo;
    data.waves = shader::uint(pass.water.waves.size());
    std::size_t first = 0;
    for (const NoiseOf& noise : noises_of(pass)) {
        data.*noise.place = {shader::uint(first), shader::uint(noise.octaves.size())};
        first += noise.octaves.size();
    }
    return data;
}

GroundBuffers::GroundBuffers(const GpuDevice& gpu)
    : frame_(create_buffer(gpu, sizeof(shader::FrameUniforms), vk::BufferUsageFlagBits::eUniformBuffer,
                           HostAccess::write)) {}

void GroundBuffers::use(const GpuDevice& gpu, const GroundPass& pass, const MirrorView* mirror,
                        const shader::FrameUniforms& part) {
    shader::FrameUniforms white = pass.white;
    white.picture = part.picture;
    white.part = part.part;
    write(gpu, frame_, white);
    const shader::GroundData data = ground_data(pass, mirror);
    upload(gpu, data_, std::as_bytes(std::span(&data, 1)));
    std::vector<NoiseOctave> octaves;
    for (const NoiseOf& noise : noises_of(pass))
        octaves.insert(octaves.end(), noise.octaves.begin(), noise.octaves.end());
    upload_all(gpu, octaves_, octaves);
    upload_all(gpu, cover_, cover_words(*pass.cover.map));
    const RippleSlopes& ripples = pass.ripples.slopes;
    std::vector<float> slopes(2 * ripples.x.size());
    for (std::size_t i = 0; i < ripples.x.size(); ++i) {
        slopes[2 * i] = ripples.x[i];
        slopes[2 * i + 1] = ripples.y[i];
    }
    upload_all(gpu, ripples_, slopes);
    upload_all(gpu, waves_, pass.water.waves);
}

void GroundBuffers::add_to(Resources& resources, const GpuBuffer& mirror_texels) const {
    resources.set({{0, frame_},
                   {24, data_},
                   {25, octaves_},
                   {26, cover_},
                   {27, mirror_texels},
                   {28, ripples_},
                   {29, waves_}});
}

const Pipeline& GroundPipelines::of(const GroundKinds& kinds) {
    for (const std::unique_ptr<Made>& each : made_)
        if (each->kinds == kinds) return each->pipeline;
    std::vector<ShaderConstant> constants =
        constants_of({.physical_sky = kinds.physical_sky, .march = kinds.march});
    const bool all[] = {kinds.sea, kinds.country, kinds.lying, kinds.mirror};
    for (std::uint32_t n = 0; n < std::size(all); ++n) constants.push_back({11 + n, all[n]});
    const ShaderCode code = kinds.march ? shaders().march_ground_comp : shaders().view_ground_comp;
    auto made = std::make_unique<Made>(Made{kinds, create_compute_pipeline(gpu_, code, constants)});
    return made_.emplace_back(std::move(made))->pipeline;
}

}  // namespace nephos
