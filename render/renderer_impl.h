// SPDX-License-Identifier: Apache-2.0
#pragma once

// The implementation of Renderer: a back-end, and the state common to all back-ends. Private to the module.

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/atmosphere/sky_light.h"
#include "render/backend/backend.h"
#include "render/cloud/voxel_absorption.h"
#include "render/ground/mirror_view.h"
#include "render/rain/precipitation.h"
#include "render/renderer.h"
#include "render/terrain/terrain_view.h"

namespace nephos {

// Returns the heights of all clouds of a picture.
CloudHeights heights_of(const PreparedCloud& cloud, const Splats& splats, std::span<const DrawnVeil> veils);

// A back-end holds the address of `picture` while it is in flight.
struct PendingPicture::State {
    State(const Splats& what, const RenderOptions& how) : splats(what), options(how) {}
    ~State() {
        if (backend != nullptr) backend->abandon(picture);
    }
    State(const State&) = delete;
    State& operator=(const State&) = delete;

    Splats splats;
    RenderOptions options;
    DetailView detail;  // from which the cloud's metaballs are merged
    Picture picture;
    TerrainView terrain;  // of ground that is not level
    Backend* backend = nullptr;  // that draws it; null: it is finished
    std::optional<Rainfall> rain;  // still to be drawn
    bool with_ground = false;      // the back-end draws ground that is not plain and dry, with the view that
    std::optional<MirrorView> mirror;  // ... the host has of it, or
    bool shows_kept = false;           // ... that was kept last
    bool keeps = false;                // this is that view
};

struct Renderer::Impl {
    explicit Impl(const DeviceOptions& options);

    using Drawing = PendingPicture::State;
    // Begins a picture with all that is drawn over it.
    void begin_picture(Drawing& drawing, std::optional<Rainfall> rain);
    void begin(Drawing& drawing);
    void finish(Drawing& drawing);
    // Returns whether the back-end can draw the rain of a picture with the rest, on its device.
    bool rains_with(const Drawing& drawing) const;
    // Hands it over. Precondition: the picture has its light. Returns false where it is drawn later, or none falls.
    bool prepare_rain(Drawing& drawing);
    // Draws the rain of a picture that is complete otherwise, or begins to. `known`: the light of the cloud is still that of
    // the picture.
    void begin_rain(Drawing& drawing, bool known);
    // Begins and finishes a frame, which is left dark where its rays meet terrain.
    Picture draw(Drawing& drawing);
    // Draws the terrain of `splats`, seen as `view` has it, into a picture that draw() left dark there; `mirror` may be null.
    void draw_terrain_of(const Splats& splats, const RenderOptions& options, const GroundCoverView& cover,
                         const DetailView& detail, const TerrainView& view, const MirrorView* mirror, Picture& picture);
    // Has the back-end draw the ground of a picture with it, behind a mirrored view which is drawn now. Returns false where
    // there is nothing to draw, or only draw_in_passes() can.
    bool add_ground(Drawing& drawing);
    // What the mirrored eye sees: options and splats.
    struct Mirrored {
        RenderOptions options;
        Splats splats;
    };
    Mirrored mirrored_of(const Splats& splats, const RenderOptions& options) const;
    // The view of the mirrored eye, where water shows it.
    std::optional<MirrorView> mirror_of(const Splats& splats, const RenderOptions& options, const GroundCoverView& cover,
                                        const DetailView& detail);
    // Draws a frame over which the processor draws: ground that is not plain or not level, veils per pixel.
    Picture draw_in_passes(Drawing& drawing);
    // The passes: wet, snowy or farmed ground, where the back-end does not draw it; veils. They change `picture`, which
    // was drawn with `detail`.
    void draw_ground(const Splats& splats, const RenderOptions& options, const GroundCoverView& cover,
                     const DetailView& detail, const MirrorView* mirror, Picture& picture);
    void draw_veils_of(const Splats& splats, const RenderOptions& options, const DetailView& detail,
                       Picture& picture);
    // Computes light by T's absorption factor instead of the light pass.
    void absorb_sunlight(LitCloud& cloud, const DensityBlocks& blocks, const RenderOptions& options);
    // Absorbs the sunlight where the options say so, and returns the fraction of the lightning at each
    // metaball: empty without.
    std::vector<float> absorb_light(const Splats& splats, const RenderOptions& options);
    void hand_out_light(const Splats& splats, const RenderOptions& options, Picture& picture);
    void use_scattering(const CloudLight& light);
    // Makes `veil_depth` that of the veils above clouds and rain; it is none without these.
    void shade_by_veils(const Splats& splats, const RenderOptions& options);
    const SkyLight* sky_of(const Splats& splats, const RenderOptions& options);

    std::unique_ptr<Backend> backend;
    int part_size;
    LitCloud lit;  // of the last picture
    StageTimes times;
    Versioned<std::vector<float>> scattering;  // table of `scattering_light`
    CloudLight scattering_light;
    AirCache air;
    SkyLights sky_lights;
    std::span<const DrawnVeil> veils;  // of the picture that is being drawn
    AddedDepth veil_depth;             // likewise: their shade, where something is below them
    PrecipitationPainter painter;      // of rain that the back-end leaves to the processor
};

}  // namespace nephos
