// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/vdb_metadata.h"

#include <charconv>

namespace nephos {

openvdb::MetaMap to_meta_map(const VdbMetadata& metadata, Extent voxels, int refine) {
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
    map.insertMeta(kMetaRefine, openvdb::Int32Metadata(refine));
    map.insertMeta(kMetaBoxMin, openvdb::Vec3IMetadata({0, 0, 0}));
    map.insertMeta(kMetaBoxMax, openvdb::Vec3IMetadata({voxels.x - 1, voxels.y - 1, voxels.z - 1}));
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
    return metadata;
}

}  // namespace nephos
