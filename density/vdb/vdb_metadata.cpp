// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_metadata.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "core/text.h"
#include "density/metaballs.h"

namespace nephos {

namespace {

std::string wind_text(const std::vector<WindLevel>& levels) {
    std::string text = "[";
    for (const WindLevel& level : levels) {
        text += (text.size() > 1 ? ", [" : "[") + number_text(level.height_m) + ", " +
                number_text(level.velocity.east_m_per_s) + ", " + number_text(level.velocity.north_m_per_s) + "]";
    }
    return text + "]";
}

// The inverse; no levels for any other text.
std::vector<WindLevel> wind_levels(const std::string& text) {
    std::vector<double> numbers;
    const char* at = text.data();
    const char* const end = at + text.size();
    while (at < end) {
        if (std::strchr("[], ", *at) != nullptr) {
            ++at;
            continue;
        }
        double number = 0;
        const auto [next, error] = std::from_chars(at, end, number);
        if (error != std::errc() || !std::isfinite(number)) return {};
        numbers.push_back(number);
        at = next;
    }
    std::vector<WindLevel> levels;
    if (numbers.size() % 3 != 0) return levels;
    for (std::size_t n = 0; n < numbers.size(); n += 3)
        levels.push_back({numbers[n], {numbers[n + 1], numbers[n + 2]}});
    return levels;
}

}  // namespace

void insert_box(openvdb::MetaMap& map, Extent voxels, int refine) {
    map.insertMeta(kMetaRefine, openvdb::Int32Metadata(refine));
    map.insertMeta(kMetaBoxMin, openvdb::Vec3IMetadata({0, 0, 0}));
    map.insertMeta(kMetaBoxMax, openvdb::Vec3IMetadata({voxels.x - 1, voxels.y - 1, voxels.z - 1}));
}

openvdb::MetaMap to_meta_map(const VdbMetadata& metadata) {
    openvdb::MetaMap map;
    map.insertMeta(kMetaUnits, openvdb::StringMetadata("m"));
    map.insertMeta(kMetaUpAxis, openvdb::StringMetadata("z"));
    map.insertMeta(kMetaExtinction, openvdb::DoubleMetadata(metadata.extinction_per_m));
    map.insertMeta(kMetaTime, openvdb::DoubleMetadata(metadata.time_s));
    map.insertMeta(kMetaTimeStep, openvdb::DoubleMetadata(metadata.time_step_s));
    map.insertMeta(kMetaFrameRate, openvdb::DoubleMetadata(metadata.frames_per_second));
    map.insertMeta(kMetaTimeScale, openvdb::DoubleMetadata(metadata.time_scale));
    // A string, because OpenVDB's widest integer is signed.
    map.insertMeta(kMetaSeed, openvdb::StringMetadata(std::to_string(metadata.seed)));
    map.insertMeta(kMetaSceneHash, openvdb::StringMetadata(metadata.scene_hash));
    map.insertMeta(kMetaStateHash, openvdb::StringMetadata(metadata.state_hash));
    map.insertMeta(kMetaVersion, openvdb::StringMetadata(metadata.nephos_version));
    map.insertMeta(kMetaStreamVersion, openvdb::Int32Metadata(metadata.random_stream_version));
    const Vec3& period = metadata.period_m;
    map.insertMeta(kMetaPeriod, openvdb::Vec3DMetadata({period.x, period.y, period.z}));
    if (!metadata.wind.empty()) map.insertMeta(kMetaWind, openvdb::StringMetadata(wind_text(metadata.wind)));
    if (!metadata.georeference.given) return map;
    const Georeference& place = metadata.georeference;
    map.insertMeta(kMetaLatitude, openvdb::DoubleMetadata(place.latitude_deg));
    map.insertMeta(kMetaLongitude, openvdb::DoubleMetadata(place.longitude_deg));
    map.insertMeta(kMetaHeight, openvdb::DoubleMetadata(place.height_m));
    map.insertMeta(kMetaGeoidHeight, openvdb::DoubleMetadata(place.geoid_height_m));
    map.insertMeta(kMetaHeading, openvdb::DoubleMetadata(place.heading_deg));
    map.insertMeta(kMetaHeightDatum,
                   openvdb::StringMetadata(place.height_datum == HeightDatum::msl ? "msl" : "ellipsoid"));
    if (!place.start_utc.empty()) {
        map.insertMeta(kMetaStart, openvdb::StringMetadata(place.start_utc));
        map.insertMeta(kMetaUtc, openvdb::StringMetadata(utc_at(place, metadata.time_s)));
    }
    map.insertMeta(kMetaEcef, openvdb::Mat4DMetadata(openvdb::Mat4d(ecef_from_world(place).data())));
    return map;
}

std::optional<VdbMetadata> from_meta_map(const openvdb::MetaMap& map) {
    const auto version = meta_value<std::string>(map, kMetaVersion);
    if (!version) return std::nullopt;
    VdbMetadata metadata;
    metadata.nephos_version = *version;
    metadata.extinction_per_m = meta_value<double>(map, kMetaExtinction).value_or(metadata.extinction_per_m);
    metadata.time_s = meta_value<double>(map, kMetaTime).value_or(0);
    metadata.time_step_s = meta_value<double>(map, kMetaTimeStep).value_or(0);
    metadata.frames_per_second = meta_value<double>(map, kMetaFrameRate).value_or(0);
    metadata.time_scale = meta_value<double>(map, kMetaTimeScale).value_or(metadata.time_scale);
    metadata.scene_hash = meta_value<std::string>(map, kMetaSceneHash).value_or("");
    metadata.state_hash = meta_value<std::string>(map, kMetaStateHash).value_or("");
    metadata.random_stream_version = meta_value<int>(map, kMetaStreamVersion).value_or(0);
    const std::string seed = meta_value<std::string>(map, kMetaSeed).value_or("");
    std::from_chars(seed.data(), seed.data() + seed.size(), metadata.seed);
    metadata.wind = wind_levels(meta_value<std::string>(map, kMetaWind).value_or(""));
    const openvdb::Vec3d period = meta_value<openvdb::Vec3d>(map, kMetaPeriod).value_or(openvdb::Vec3d(0.0));
    metadata.period_m = {period.x(), period.y(), period.z()};
    const auto latitude = meta_value<double>(map, kMetaLatitude);
    if (!latitude) return metadata;
    Georeference& place = metadata.georeference;
    place.given = true;
    place.latitude_deg = *latitude;
    place.longitude_deg = meta_value<double>(map, kMetaLongitude).value_or(0);
    place.height_m = meta_value<double>(map, kMetaHeight).value_or(0);
    place.geoid_height_m = meta_value<double>(map, kMetaGeoidHeight).value_or(0);
    place.heading_deg = meta_value<double>(map, kMetaHeading).value_or(0);
    const std::string datum = meta_value<std::string>(map, kMetaHeightDatum).value_or("msl");
    place.height_datum = datum == "ellipsoid" ? HeightDatum::ellipsoid : HeightDatum::msl;
    place.start_utc = meta_value<std::string>(map, kMetaStart).value_or("");
    if (!place.start_utc.empty() && !utc_seconds(place.start_utc)) place.start_utc.clear();
    return metadata;
}

int refine_of(const openvdb::MetaMap& grid) {
    const int refine = meta_value<int>(grid, kMetaRefine).value_or(1);
    if (refine < 1 || refine > kMaxRefine)
        throw std::runtime_error("it is damaged: nephos_refine is out of range");
    return refine;
}

}  // namespace nephos
