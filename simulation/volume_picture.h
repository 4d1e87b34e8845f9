// SPDX-License-Identifier: Apache-2.0
#pragma once

// A picture of a density file, of nephos or of another program, with a scene or without.

#include <cstddef>
#include <optional>
#include <string>
#include <utility>

#include "density/vdb/vdb_file.h"
#include "render/image/picture.h"
#include "render/options/device_options.h"
#include "render/options/options.h"
#include "scenes/format/scene.h"
#include "simulation/framing.h"

namespace nephos {

// Replaces values of the scene; without one, of defaults that fit the cloud: 1280 x 720 pixels, all of it
// seen from the side (framing.h), over ground that lies below it.
struct VolumePictureOptions {
    std::optional<View> view;                // where to stand; looks at the middle of the cloud
    std::optional<Vec3> camera_m, target_m;  // world, instead of the view's
    std::optional<double> fov_deg;           // vertical, 1..170
    std::optional<double> exposure_ev;       // stops, -20..20
    std::optional<double>
        extinction_per_m;             // at density 1, >= 0; else the scene's, the file's, or a visible one
    std::optional<double> albedo, g;  // of a single scattering, 0..1 and -0.99..0.99
    std::optional<std::pair<double, double>> sun_deg;  // elevation -18..90, azimuth clockwise from north
    std::optional<std::pair<int, int>> size;           // width and height, pixels
    bool depth = false;                                // with the layers that an EXR file holds
};

struct VolumePicture {
    Picture picture;
    RenderOptions options;     // it was drawn with; camera as at the file's time, with world heights
    PictureMetadata metadata;  // as picture files hold it
    std::size_t metaballs = 0;
    double metaball_radius_voxels = 0;
    double extinction_per_m = 0;          // at density 1
    bool extinction_was_guessed = false;  // neither options nor scene nor file named one
    std::string backend, device;          // that drew
};

// Voxels of at least 20 m of a file that was not refined are drawn with detail (density/detail.h), the scene's or its
// defaults. Draws the density of a file named `file` through FramePainter: with a scene as a frame of that scene at the
// file's time (at 0 s when it names none), with its rain, ground cover, lightning and clouds that have no
// density. Those are simulated to that time (scene_moment.h). Throws as FramePainter and SceneMoment, and
// Error(usage) when camera and target are one point.
VolumePicture draw_volume(const std::string& file, const LoadedDensity& loaded,
                          const std::optional<Scene>& scene, const VolumePictureOptions& options,
                          const DeviceOptions& device = {});

}  // namespace nephos
