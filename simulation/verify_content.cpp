// SPDX-License-Identifier: Apache-2.0
#include "simulation/verify_content.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "density/combine.h"
#include "density/vdb/vdb_file.h"
#include "density/voxel_digest.h"
#include "simulation/verify_motion.h"
#include "simulation/verify_problems.h"

namespace nephos {
namespace {

constexpr double kLayersTolerance = 1e-3;

// Returns the largest density that a file may hold: 1, and of refined files with detail what its thermals, a noise of mean 1, make
// of it.
double largest_density(const Scene& scene) {
    if (scene.density.refine == 1) return 1;
    const auto of = [](const DetailOptions& detail) { return detail.enabled ? 1 + detail.thermals : 1; };
    double most = scene.layers.empty() ? of(scene.density.detail) : 1;
    for (std::size_t n = 0; n < scene.layers.size(); ++n) most = std::max(most, of(layer_detail(scene, n)));
    constexpr double kRounding = 1e-6;
    return most + (most > 1 ? kRounding : 0);
}

// Judges the density of each file as a reader sees it.
class Decoder {
  public:
    explicit Decoder(const RunListing& run)
        : run_(run), whole_{run.folder, run.scene.name}, most_of_scene_(largest_density(run.scene)) {}

    void unreadable(const Error& error) { voxels_.add(error.what()); }

    void add(const ListedFrame& frame, const FileRecord& file, const LoadedDensity& loaded) {
        ++count_;
        for (const std::string& note : loaded.notes) values_.add(file.path + ": " + note);
        const float most = loaded.density.max_value();
        largest_ = std::max(largest_, double(most));
        if (most > most_of_scene_)
            values_.add(fmt::format("{}: a value of {:g} is above {:g}", file.path, most, most_of_scene_));
        if (!file.voxels.empty() && voxel_digest(loaded.density) != file.voxels)
            voxels_.add(file.path + ": its voxels are not those of the manifest");
        check_metadata(frame, file, loaded);
        check_geometry(file, loaded.info);
    }

    // Returns the checks of so many files. Where none of them could be decoded, only what is wrong with them is told.
    std::vector<Check> checks(std::size_t files) const {
        if (files > 0 && count_ == 0) {
            if (voxels_.none()) return {};
            return {voxels_.check("voxels", {})};
        }
        return {voxels_.check("voxels",
                              fmt::format("{} density files decode to the voxels of the manifest", count_)),
                values_.check("values", fmt::format("finite, 0 to {:.4g}", largest_)),
                geometry_.check("geometry", "same transform, bounds and class in every file of a kind"),
                metadata_.check("metadata", "time, extinction, scene and state as in the manifest")};
    }

  private:
    void check_metadata(const ListedFrame& frame, const FileRecord& file, const LoadedDensity& loaded) {
        if (!loaded.metadata) return metadata_.add(file.path + ": has no metadata of nephos");
        const VdbMetadata& m = *loaded.metadata;
        if (m.time_s != frame.time_s)
            metadata_.add(
                fmt::format("{}: time {} s, {} in the manifest", file.path, m.time_s, frame.time_s));
        if (m.extinction_per_m != run_.scene.density.extinction_per_m)
            metadata_.add(fmt::format("{}: extinction {} per m", file.path, m.extinction_per_m));
        if (m.scene_hash != run_.frames_hash) metadata_.add(file.path + ": is of another scene");
        // A layer's file has the state of that layer, which the manifest does not list.
        if (run_.folder / file.path == whole_.density(frame.number) && m.state_hash != frame.state_hash)
            metadata_.add(file.path + ": is of another state");
        if (!(m.georeference == run_.scene.georeference))
            metadata_.add(file.path + ": lies at another place");
    }

    // Grids that hold only a part of the box (hum, act, cld, the wind) have its transform, not its bounds.
    void check_geometry(const FileRecord& file, const VdbInfo& info) {
        const std::string kind = std::filesystem::path(file.path).parent_path().generic_string();
        for (const VdbGridInfo& grid : info.grids) {
            VdbGridInfo expected = grid;
            const auto [first, added] = first_.try_emplace(kind + ":" + grid.name, grid);
            if (grid.name == "density" && grid.grid_class != "fog volume")
                geometry_.add(file.path + ": `density` is of class " + grid.grid_class);
            if (added) continue;
            const VdbGridInfo& other = first->second;
            if (other.world_from_index != grid.world_from_index)
                geometry_.add(file.path + ": `" + grid.name + "` has another transform");
            if (grid.name == "density" && !(other.active_box == grid.active_box))
                geometry_.add(file.path + ": has other bounds");
            if (other.grid_class != grid.grid_class || other.type != grid.type)
                geometry_.add(file.path + ": `" + grid.name + "` is of another class or type");
        }
    }

    const RunListing& run_;
    const RunFolder whole_;
    double most_of_scene_;
    Problems voxels_, values_, geometry_, metadata_;
    std::map<std::string, VdbGridInfo> first_;
    std::size_t count_ = 0;
    double largest_ = 0;
};

// The density of layers must be that of the file of all together.
void compare_layers(const ListedFrame& frame, const DensityGrid& whole,
                    const std::vector<DensityGrid>& layers, const std::vector<Boundaries>& boundaries,
                    double& largest, Problems& problems) {
    const DensityGrid sum = combine(layers, boundaries);
    if (!(sum.extent() == whole.extent())) {
        problems.add(fmt::format("frame {}: the layers' box is another", frame.number));
        return;
    }
    const std::vector<float> a = sum.to_dense(), b = whole.to_dense();
    double difference = 0;
    for (std::size_t n = 0; n < a.size(); ++n)
        difference = std::max(difference, double(std::abs(a[n] - b[n])));
    largest = std::max(largest, difference);
    if (difference > kLayersTolerance)
        problems.add(fmt::format("frame {}: the layers differ from the common grid by {:.3g}", frame.number,
                                 difference));
}

// Compares the files of each frame with each other and with those of the frame before.
class Frames {
  public:
    Frames(const RunListing& run, const VerifyOptions& options)
        : run_(run), options_(options), sequences_(sequences_of(run, options.seam)) {}

    // `grids`: by their path in the folder, all that could be read of one frame; frames come in order.
    void add(const ListedFrame& frame, const std::map<std::string, DensityGrid>& grids) {
        const RunFolder folder{run_.folder, run_.scene.name};
        const auto find = [&](const std::filesystem::path& path) -> const DensityGrid* {
            const auto found = grids.find(path.lexically_relative(run_.folder).generic_string());
            return found == grids.end() ? nullptr : &found->second;
        };
        std::vector<DensityGrid> layers;
        std::vector<Boundaries> boundaries;
        for (const LayerOptions& layer : run_.scene.layers) {
            const DensityGrid* grid = find(folder.density(frame.number, layer.name));
            if (grid == nullptr) continue;
            layers.push_back(*grid);
            boundaries.push_back(layer.boundaries);
        }
        const DensityGrid* whole = find(folder.density(frame.number));
        const auto expected =
            std::ranges::count_if(run_.scene.layers, [](const auto& layer) { return has_density(layer); });
        if (whole != nullptr && !layers.empty() && std::ssize(layers) == expected) {
            if (const std::string why = why_too_large(*whole); !why.empty()) {
                too_large_ = why;
            } else {
                compare_layers(frame, *whole, layers, boundaries, largest_, sums_);
                ++compared_;
            }
        }
        for (DensitySequence& sequence : sequences_)
            add_frame(sequence, frame.number,
                      sequence.layer.empty() ? whole : find(folder.density(frame.number, sequence.layer)));
    }

    // Appends the checks, after the last frame.
    void finish_checks(std::vector<Check>& checks) {
        if (compared_ > 0) {
            checks.push_back(sums_.check(
                "layers",
                fmt::format("add up to the common grid within {:.2g} in {} frames", largest_, compared_)));
        } else if (!too_large_.empty()) {
            checks.push_back({"layers", true, too_large_});
        }
        for (DensitySequence& sequence : sequences_) finish(sequence);
        const bool is_read =
            std::ranges::any_of(sequences_, [](const DensitySequence& s) { return s.files > 0; });
        if (is_read || options_.seam) checks.push_back(check_seams(sequences_, options_.seam));
        if (is_read || options_.max_change) checks.push_back(check_motion(sequences_, options_.max_change));
    }

  private:
    const RunListing& run_;
    const VerifyOptions& options_;
    std::vector<DensitySequence> sequences_;
    Problems sums_;
    double largest_ = 0;
    std::size_t compared_ = 0;
    std::string too_large_;  // why frames were not compared
};

}  // namespace

void check_content(const RunListing& run, const VerifyOptions& options, std::vector<Check>& checks) {
    struct Source {
        const ListedFrame* frame;
        const FileRecord* file;
    };
    std::vector<Source> sources;
    std::vector<std::filesystem::path> paths;
    for (const ListedFrame& frame : run.frames) {
        for (const FileRecord& file : frame.files) {
            if (!file.path.ends_with(".vdb")) continue;
            sources.push_back({&frame, &file});
            paths.push_back(run.folder / file.path);
        }
    }
    VdbReadOptions reading;
    reading.list_grids = true;
    Decoder decoder(run);
    Frames frames(run, options);
    Problems unread;
    std::map<std::string, DensityGrid> grids;
    std::size_t next = 0;
    const auto finish_file = [&] {
        const ListedFrame* frame = sources[next].frame;
        if (++next < sources.size() && sources[next].frame == frame) return;
        frames.add(*frame, std::exchange(grids, {}));
    };
    const auto take = [&](LoadedDensity&& loaded) {
        const auto& [frame, file] = sources[next];
        decoder.add(*frame, *file, loaded);
        grids.emplace(file->path, std::move(loaded.density));
        finish_file();
    };
    while (next < paths.size()) {
        const std::size_t before = next;
        try {
            load_densities(std::span(paths).subspan(next), reading, [&](std::size_t, LoadedDensity&& loaded) {
                take(std::move(loaded));
                return true;
            });
        } catch (const Error& error) {
            if (next > before) continue;
            try {
                take(load_density(paths[next], reading));
            } catch (const ReadFailure& failure) {  // which says nothing of its content
                if (!std::string_view(failure.what()).starts_with(paths[next].string()))
                    throw;  // of all files
                unread.add(failure.what());
                finish_file();
            } catch (const Error& alone) {
                if (!std::string_view(alone.what()).starts_with(paths[next].string())) throw;  // nor this
                decoder.unreadable(alone);
                finish_file();
            }
        }
    }
    for (Check& check : decoder.checks(sources.size())) checks.push_back(std::move(check));
    frames.finish_checks(checks);
    if (!unread.none()) checks.push_back(unread.not_done("decoding"));
}

}  // namespace nephos
