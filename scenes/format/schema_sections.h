// SPDX-License-Identifier: Apache-2.0
#pragma once

// The sections of a scene file; see schema.h (not installed).

#include <span>
#include <string>
#include <string_view>

#include "scenes/format/schema.h"

namespace nephos {

// Owner: Scene.
const Section& lattice_section();
const Section& time_section();
const Section& field_section();
const Section& density_section();
const Section& frames_section();
const Section& camera_section();
const Section& sun_section();
const Section& light_section();
const Section& lightning_section();
const Section& debug_view_section();
const Section& air_section();
const Section& atmosphere_section();
const Section& ground_section();
const Section& shells_section();
const Section& light_shafts_section();
const Section& fog_section();
const Section& water_section();
const Section& terrain_section();
const Section& wet_ground_section();
const Section& precipitation_section();
const Section& detail_section();
const Section& level_of_detail_section();
const Section& georeference_section();

// Owner: CameraKey.
const Section& camera_path_section();
// Owner: BackgroundKeyframe.
const Section& background_profile_section();
// Owner: WindKeyframe.
const Section& wind_section();
// Owner: WindField.
const Section& wind_field_section();
// Ellipsoids placed by hand and at random: of the field, or of a layer.
const Section& ellipsoid_section();
const Section& scatter_section();
// Owner: Probabilities.
const Section& probabilities_section();
// Owner: BaseModel, NamedSky, ClimateOptions, LayerOptions.
const Section& model_section();
const Section& sky_section();
const Section& climate_section();
const Section& layer_section();
// Owner: VeilOptions.
const Section& veil_section();
const Section& slab_section();

// Returns the keys of a layer that have no effect beside `veil`.
std::span<const std::string_view> keys_of_clouds();

// Returns the key `models`, the files of base models (document.h); it has no value of its own.
Key model_files_key();
inline constexpr int kMaxModels = 10'000;

// Checks conditions on several sections and sets the defaults that depend on them; owner: Scene.
void finish_scene(const SectionReader& reader, void* owner);

// Reports profiles of the key `wind` of a scene or a layer unless their times rise strictly.
void check_wind_times(const SectionReader& owner, const Wind& wind);

// Reports profiles of the key `profile` of the field or a layer unless their times rise strictly.
void check_profile_times(const SectionReader& owner, const std::vector<BackgroundKeyframe>& profile);

// Reports key frames of the camera unless their times rise strictly; the reader is that of [camera].
void check_camera_path(const SectionReader& reader, const Camera& camera);

// Reports an ellipsoid that reaches too far along a periodic axis, as every periodic image of it that meets the
// box costs time: `reach_m` is compared with `largest_m`, largest_reach_m() of the lattice. `what` names the
// ellipsoid in messages; `horizontal` and `vertical` are the keys of its size, each of which is reported once.
void check_periodic_reach(const SectionReader& reader, const std::string& what, const Vec3& largest_m,
                          const Vec3& reach_m, std::string_view horizontal, std::string_view vertical);

// The same for the tables `ellipsoids` and `scatters` of [field] or of a layer.
void check_reach_of_ellipsoids(const SectionReader& owner, std::span<const Ellipsoid> ellipsoids,
                               std::span<const EllipsoidScatter> scatters, const Vec3& largest_m);

// Performs the part of finish_scene() on models, skies, climate and layers.
void finish_layers(const SectionReader& reader, Scene& scene);
// Reports models that share a name, and names of models and skies that are not in the scene: also beside other problems, as
// long as all models, or skies, have names that could be read.
void check_models_and_references(const SectionReader& reader, const Scene& scene);
// Reports skies and layers whose name is empty, is used twice or cannot be part of a file's name; skies without models; and
// layers without a sky or with two skies of one state.
void check_skies_and_layer_names(const SectionReader& reader, const Scene& scene);

// Sets the ranges of centres that the scene leaves out to the whole lattice.
void fill_in_centres(std::vector<EllipsoidScatter>& scatters, const Extent& extent,
                     const Placement& placement);

}  // namespace nephos
