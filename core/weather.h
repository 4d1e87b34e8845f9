// SPDX-License-Identifier: Apache-2.0
#pragma once

// Plain types that several modules share.

namespace nephos {

// Texture of a billboard, generated when the renderer starts (render/frame/billboard_textures.h).
enum class BillboardTexture {
    soft,   // a hazy ball
    wispy,  // elongated fibres, as of cirrus
    dense,  // cauliflower-like knobs, as of cumulus congestus
};

// The precipitation of a rain area, which accumulates on the ground (seeds/ground_cover.h) and is drawn as
// particles and shafts (render/rain/precipitation.h).
enum class PrecipitationKind { rain, snow };

// Water and snow on the ground at one point.
struct GroundFilm {
    double water_mm = 0;
    double snow_mm = 0;
    bool operator==(const GroundFilm&) const = default;
};

// The texels of a map of water and snow on the ground, and the ground beyond them. Texel (column, row) is the
// rectangle of texel_x_m by texel_y_m whose south-western corner is at (x_m + column texel_x_m, y_m + row
// texel_y_m); rows from south to north, x fastest.
struct GroundTexels {
    double x_m = 0, y_m = 0;              // south-western corner, world
    double texel_x_m = 1, texel_y_m = 1;  // > 0
    int columns = 0, rows = 0;            // both 0: the values outside everywhere
    GroundFilm outside;
    double outside_rain_mm_per_h = 0;  // mean over the outermost texels
    bool operator==(const GroundTexels&) const = default;
};

}  // namespace nephos
