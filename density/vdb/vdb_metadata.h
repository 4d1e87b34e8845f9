// SPDX-License-Identifier: Apache-2.0
#pragma once

// Names and conversion of the metadata of vdb_file.h, for writer and reader (not installed).

#include <optional>
#include <string>

#include <openvdb/MetaMap.h>

#include "density/density_grid.h"
#include "density/vdb/vdb_file.h"

namespace nephos {

inline constexpr const char* kMetaUnits = "nephos_units";
inline constexpr const char* kMetaUpAxis = "nephos_up_axis";
inline constexpr const char* kMetaExtinction = "nephos_extinction_per_m";
inline constexpr const char* kMetaTime = "nephos_time_s";
inline constexpr const char* kMetaTimeStep = "nephos_time_step_s";
inline constexpr const char* kMetaFrameRate = "nephos_frames_per_second";
inline constexpr const char* kMetaTimeScale = "nephos_time_scale";
inline constexpr const char* kMetaSeed = "nephos_seed";
inline constexpr const char* kMetaSceneHash = "nephos_scene_hash";
inline constexpr const char* kMetaStateHash = "nephos_state_hash";
inline constexpr const char* kMetaVersion = "nephos_version";
inline constexpr const char* kMetaStreamVersion = "nephos_random_stream_version";
inline constexpr const char* kMetaRefine = "nephos_refine";
inline constexpr const char* kMetaBoxMin = "nephos_bbox_min";
inline constexpr const char* kMetaBoxMax = "nephos_bbox_max";
inline constexpr const char* kMetaWind = "nephos_wind";
inline constexpr const char* kMetaPeriod = "nephos_period_m";
inline constexpr const char* kMetaLatitude = "nephos_latitude_deg";
inline constexpr const char* kMetaLongitude = "nephos_longitude_deg";
inline constexpr const char* kMetaHeight = "nephos_height_m";
inline constexpr const char* kMetaGeoidHeight = "nephos_geoid_height_m";
inline constexpr const char* kMetaHeading = "nephos_heading_deg";
inline constexpr const char* kMetaHeightDatum = "nephos_height_datum";
inline constexpr const char* kMetaStart = "nephos_start_utc";
inline constexpr const char* kMetaUtc = "nephos_utc";
inline constexpr const char* kMetaEcef = "nephos_ecef_from_world";

// Returns what all grids of a file have.
openvdb::MetaMap to_meta_map(const VdbMetadata& metadata);

// Inserts the bounds of a grid's voxels, and how many of them are a cell along each axis.
void insert_box(openvdb::MetaMap& map, Extent voxels, int refine);

// Returns nullopt when nephos did not write `map`; fields that are missing or of another type have their
// defaults.
std::optional<VdbMetadata> from_meta_map(const openvdb::MetaMap& map);

// Returns the value of a field, or nullopt when it is missing or not of type T.
template <class T>
std::optional<T> meta_value(const openvdb::MetaMap& map, const char* name) {
    const auto typed = map.getMetadata<openvdb::TypedMetadata<T>>(name);
    return typed ? std::optional<T>(typed->value()) : std::nullopt;
}

// Returns how many voxels of a grid are a cell along each axis: 1 unless it says more. Throws std::runtime_error where that is out of range.
int refine_of(const openvdb::MetaMap& grid);

}  // namespace nephos
