// SPDX-License-Identifier: Apache-2.0
#pragma once

// Draws the frames of a scene:
//
//     FramePainter painter(scene);
//     const Picture picture = painter.draw(frame);    // in a SimulationSink's frame()
//
// A picture shows the metaballs of the frame's density, the billboards of clouds that are drawn directly, rain
// or snow, what lies on the ground, lightning, and the debug view, as scene.render asks for them and as camera
// and sun stand at the frame's time.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/file_stamp.h"
#include "density/metaballs.h"
#include "render/image/picture.h"
#include "render/rain/precipitation.h"
#include "render/renderer.h"
#include "scenes/format/scene.h"
#include "simulation/simulation.h"
#include "simulation/sky_picture.h"

namespace nephos {

// A frame whose picture was begun: all that the picture refers to. Must not outlive its painter.
struct PendingFrame {
    FrameResult frame;
    std::vector<Metaball> balls;
    std::vector<DetailedVoxels> detailed;  // of these
    std::vector<DrawnVeil> veils;
    PendingSkyPicture picture;

    // Returns true while a device is drawing it, as far as is known.
    bool is_pending() const { return picture.picture.is_pending(); }
};

// Keeps what pictures have in common. Not thread-safe; different painters may work in different threads.
class FramePainter {
  public:
    // Opens the back-end and reads the textures of base models. Throws as Renderer and read_textures().
    explicit FramePainter(const Scene& scene, const DeviceOptions& device = {});

    // Draws a frame. One without a density in its layers is drawn from FrameResult::density. Pictures have depth
    // and light where scene.frames.exr asks for files that hold them, or it rains. Throws as
    // Renderer::draw_splats(), and Error(usage) when the frame does not fit into memory.
    Picture draw(const FrameResult& frame);

    // Draw in two steps, as Renderer::begin() and finish(). Pictures are finished in the order in which they
    // were begun.
    PendingFrame begin(FrameResult frame);
    Picture finish(PendingFrame&& pending);

    // Draws later frames as another scene asks for, with the same back-end and what it has cached. `same_layers`: frames
    // are still those of the simulation that drawn ones came from; false: of another one, and textures are read again.
    // Textures and height map are read again, too, when their files' times or sizes are others.
    // Throws as read_textures(), and then draws as before. Precondition: no frame is begun and not finished.
    void set_scene(const Scene& scene, bool same_layers);

    // Returns the camera with which a frame of a time is drawn: without a path, its heights those of the world. Any thread
    // may call it while another draws.
    Camera camera(double time_s) const { return painter_.camera(scene_.render, time_s); }

    // Returns the ground that is not level; null: it is.
    const HeightMap* terrain() const { return painter_.terrain().get(); }

    const Renderer& renderer() const { return renderer_; }
    // Return what Renderer's do. They never change: any thread may call these three while another draws.
    std::string backend_name() const { return renderer_.backend_name(); }
    std::string device_name() const { return renderer_.device_name(); }
    // Adds back-end and device to the metadata of a picture that this painter drew.
    void note_renderer(PictureMetadata& metadata) const { nephos::note_renderer(renderer_, metadata); }

  private:
    std::vector<Metaball> metaballs_of(const FrameResult& frame, std::vector<DetailedVoxels>& detailed) const;
    // Veils that are drawn per pixel: not those of a frame without densities of its layers, which hold them.
    std::vector<DrawnVeil> veils_of(const FrameResult& frame) const;
    // Adds the voxels of metaballs from `first` on.
    void add_detail(const DensityGrid& density, const std::optional<DensityGrid>& moisture,
                    std::optional<std::size_t> layer, double time_s, std::size_t first, std::size_t count,
                    std::vector<DetailedVoxels>& to) const;

    // What the height map and the textures of a scene are made of.
    struct Ground {
        TerrainOptions options;  // that shape it
        double height_m = 0;
        std::optional<FileStamp> file;
        bool operator==(const Ground&) const = default;
    };
    static Ground ground_of(const Scene& scene);
    static FileStamps textures_of(const Scene& scene);

    Scene scene_;
    Renderer renderer_;
    SkyPainter painter_;
    Ground ground_;                     // of the painter's height map
    FileStamps textures_;               // of its textures
};

// Returns the rain or snow of a frame as the renderer draws it: the curtains of all layers, from the ground of
// the picture to the bases of the layer's cloud, column by column; of `all` clouds in a layer whose density is empty, as
// when a file of the whole scene is drawn; of its billboards in a layer that is drawn directly. An area without cloud above
// has none; where no cloud is known rain begins in the middle of the layer's base heights. With the wind 50 m above the
// ground: the scene's, or that of the first layer when the scene has none. A curtain leans as rain of 6 m/s (snow of 1 m/s) falls through air
// that moves otherwise than its cloud, by at most 1. Pure.
Weather weather_of(const Scene& scene, std::span<const LayerFrame> layers, const DensityGrid& all,
                   double time_s);

}  // namespace nephos
