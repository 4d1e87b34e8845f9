// SPDX-License-Identifier: Apache-2.0
#pragma once

// T's clouds drawn directly: from a layer's simulation to what the renderer draws. The boxes' billboards are
// scattered once for each shape; each cloud that the camera can see lists them at its place, thinned where it
// forms or dissolves, and lit by the absorption factors that seeds/light_absorption.h keeps up to date.
//
//     SkyPainter painter;  // for as long as the layers live
//     const SkyLayer layer{&sky, sky.clouds()};
//     const Picture picture = painter.draw(renderer, {}, {&layer, 1}, options, sky.time_s());

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "render/cloud/splats.h"
#include "render/image/overlay.h"
#include "render/options/options.h"
#include "render/rain/precipitation.h"
#include "render/renderer.h"
#include "scenes/format/scene.h"
#include "seeds/ground_cover.h"
#include "seeds/light_absorption.h"
#include "seeds/model.h"
#include "seeds/sky_simulation.h"
#include "simulation/billboard_files.h"

namespace nephos {

// Clouds of all layers of a picture; what Splats points to.
struct DrawnClouds {
    std::vector<BillboardCloud> clouds;
    std::vector<CloudBillboard> billboards;
    std::vector<CloudBillboard> unseen;  // of clouds that the camera does not see: they cast shadows
    std::shared_ptr<const ModelTextures> textures;  // of the base models; null: none comes from a file
};

// A frame of a film. With options.light.cfa_clouds_per_frame, clouds keep the sun of earlier frames in turn
// (seeds/light_schedule.h), and these are the frames. Refers to the scene, which must outlive the call.
struct FilmFrame {
    int index = 0;                         // from 0
    const FrameOptions* frames = nullptr;  // not null
    const Sun* sun = nullptr;              // not null; before turned_sun_at()
    double heading_deg = 0;                // true bearing of the world's y axis
    std::span<const SunKey> sun_path{};    // of Scene::sun_path
};

class SkyBillboards {
  public:
    // Lists what the camera can see of `clouds`, which have shapes of `sky`. Light first: the sun's
    // absorption of all clouds of the layer, with options.sun or, in a film with a bound on the clouds that
    // are computed in a frame, the sun of the frame whose turn it was; and the lightning's of those that it
    // reaches. What is listed never depends on earlier calls. What the camera cannot see is listed apart; `cull` false
    // lists it with the rest: the picture is the same. `mirrored`: another camera whose clouds are listed as well. Returns of
    // how many clouds the sun's absorption was computed anew. `time_s`: decides the forms of clouds that change, and their
    // lean; none: the time of `sky`.
    std::size_t append(const SkySimulation& sky, std::span<const SkyCloud> clouds,
                       const RenderOptions& options, const std::optional<Flash>& flash, DrawnClouds& out,
                       bool cull = true, const std::optional<Camera>& mirrored = {},
                       const std::optional<FilmFrame>& film = {}, std::optional<double> time_s = {});

    // Returns the absorbed sunlight of the boxes of a cloud's own shape as it was used last; empty before the first
    // append(), and where the cloud has become another.
    std::span<const double> sun_absorbed(const SkyCloud& cloud) const {
        return sun_.absorbed(light_id(cloud, {cloud.shape, cloud.phase}));
    }

  private:
    // What does not change with a cloud's place.
    struct ScatteredBillboards {
        std::vector<Billboard> billboards;
        double reach_m = 0;            // how far billboards reach beyond their boxes, at most
        double low_m = 0, high_m = 1;  // of all billboards, model space
    };
    // A cloud in one of its forms.
    struct FormedCloud {
        const SkyCloud* cloud = nullptr;  // not null
        CloudForm form;
    };
    // The light of a form is kept by the cloud and the shape.
    static std::uint64_t light_id(const SkyCloud& cloud, const CloudForm& form) {
        return std::uint64_t{form.shape} << 32 | cloud.serial;
    }
    const ScatteredBillboards& scattered(const SkySimulation& sky, const CloudForm& form);
    std::size_t light_by_sun(const SkySimulation& sky, std::span<const FormedCloud> clouds,
                             const RenderOptions& options, const std::optional<FilmFrame>& film);
    void light_by_flash(const SkySimulation& sky, const Flash& flash, const std::vector<FormedCloud>& seen);
    void list(const SkySimulation& sky, const FormedCloud& formed, bool flash, double time_s,
              DrawnClouds& out);
    void list_unseen(const SkySimulation& sky, const FormedCloud& formed, double time_s, DrawnClouds& out);
    // Appends the billboards of a cloud as far as they are there, without their light; calls work(billboard, what it
    // became) for each.
    template <class Work>
    void each_billboard(const SkySimulation& sky, const FormedCloud& formed, double time_s,
                        const DrawnClouds& out, std::vector<CloudBillboard>& to, const Work& work);

    std::vector<std::optional<ScatteredBillboards>> scattered_;  // one for each of SkySimulation::shapes()
    LightAbsorption sun_, flash_;
};

// One layer of the sky in a picture.
struct SkyLayer {
    const SkySimulation* sky = nullptr;  // not null; has the shapes of `clouds`
    std::span<const SkyCloud> clouds;
    bool direct = true;  // draw them; false: only the debug view shows them
    // Of a layer with an automaton, whose voxels lose light to these clouds (absorbs_in_voxels()); null: they lose none.
    const LayerOptions* voxels = nullptr;
};

// A picture that was begun, and what is drawn over it.
struct PendingSkyPicture {
    PendingPicture picture;
    RenderOptions options;
    std::vector<std::vector<WorldLine>> lines;  // of each layer
    DrawnClouds drawn;                          // what `picture` refers to
};

// Draws pictures of skies, one after the other: keeps what they have in common. Not thread-safe.
class SkyPainter {
  public:
    // Draws voxel clouds, the billboards of layers, the lightning of options.lightning that burns at `time_s`, what
    // lies on the ground, and the debug view over it, as the camera is at that time; over all of it the rain
    // of `weather`, where options.precipitation is enabled. Every call has the same layers in the same order.
    // A picture depends on these arguments alone; one that is no frame of a `film` has all its clouds in the
    // light of its own time.
    // Throws as Renderer::draw_splats().
    Picture draw(Renderer& renderer, const MetaballCloud& voxels, std::span<const SkyLayer> layers,
                 const RenderOptions& options, double time_s, bool depth = true,
                 const std::optional<GroundCoverView>& ground_cover = {}, const Weather& weather = {},
                 const std::optional<FilmFrame>& film = {});

    // Draw in two steps, as Renderer::begin() and finish(): voxels, ground cover and veils, which are drawn per pixel,
    // must stay as they are until the second. Pictures are finished in the order in which they were begun.
    PendingSkyPicture begin(Renderer& renderer, const MetaballCloud& voxels, std::span<const SkyLayer> layers,
                            const RenderOptions& options, double time_s, bool depth = true,
                            const std::optional<GroundCoverView>& ground_cover = {},
                            const Weather& weather = {}, const std::optional<FilmFrame>& film = {},
                            std::span<const DrawnVeil> veils = {});
    Picture finish(Renderer& renderer, PendingSkyPicture&& pending);

    // Sets the textures of later pictures: those of all base models of the layers, or null when none has any.
    void use_textures(std::shared_ptr<const ModelTextures> textures) { textures_ = std::move(textures); }
    // Sets the ground of later pictures that is not level (render/terrain/terrain.h); null: it is.
    void use_terrain(std::shared_ptr<const HeightMap> terrain) { terrain_ = std::move(terrain); }
    const std::shared_ptr<const HeightMap>& terrain() const { return terrain_; }
    // Returns the camera with which a picture of these options at a time is drawn: without a path, its heights those of the
    // world.
    Camera camera(const RenderOptions& options, double time_s) const;

  private:
    std::vector<SkyBillboards> layers_;
    std::shared_ptr<const ModelTextures> textures_;
    std::shared_ptr<const HeightMap> terrain_;
};

// Return the light of the sun, or of a flash, as the absorption factor takes it.
Light light_of(const Sun& sun);
Light light_of(const Flash& flash);

// Returns a map as the renderer reads it; it must outlive the view.
GroundCoverView view_of(const GroundCoverMap& map);

}  // namespace nephos
