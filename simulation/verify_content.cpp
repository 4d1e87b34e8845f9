// SPDX-License-Identifier: Apache-2.0
#include "simulation/verify_content.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "density/combine.h"
#include "density/vdb/vdb_file.h"
#include "density/voxel_digest.h"
#include "simulation/scene_place.h"
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

    std::vector<Check> checks() const {
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

// Voxels that are compared one by one: as floats they take 1 GiB. Boxes between layers that lie far apart have many, and
// hardly any with cloud.
constexpr std::size_t kMostCompared = std::size_t(1) << 28;

bool is_too_large(const DensityGrid& grid) { return grid.extent().cells() > kMostCompared; }

std::string not_compared(const DensityGrid& grid) {
    return fmt::format("not done: the box has {} voxels, of which at most {} are compared",
                       grid.extent().cells(), kMostCompared);
}

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

Check check_seams(const RunListing& run, const DensityGrid& grid, bool all) {
    if (is_too_large(grid))
        return {"seam", !all, not_compared(grid), {}, !all};  // asked for, it has not passed
    const Vec3 period = period_m(run.scene, std::nullopt);
    const std::vector<float> density = grid.to_dense();
    Check check{"seam", true, {}};
    const char* const names[] = {"x", "y"};
    for (int axis = 0; axis < 2; ++axis) {
        const Extent e = grid.extent();
        if (!all && period[axis] == 0) continue;
        const Seam seam = seam_of(density, e.x, e.y, e.z, axis);
        check.passed = check.passed && !(all && seam.shows());
        check.detail += fmt::format("{}{}: {:.3g} at the seam, at most {:.3g} inside, shows above {:.3g}{}",
                                    check.detail.empty() ? "" : "; ", names[axis], seam.at_seam, seam.inside,
                                    seam.limit, seam.shows() ? " (the seam shows)" : "");
        check.figures.emplace_back(fmt::format("{}_seam", names[axis]), seam.at_seam);
        check.figures.emplace_back(fmt::format("{}_inside", names[axis]), seam.inside);
        check.figures.emplace_back(fmt::format("{}_limit", names[axis]), seam.limit);
    }
    if (check.detail.empty()) check.detail = "no axis repeats";
    return check;
}

// Compares the files of each frame with each other and with those of the frame before.
class Frames {
  public:
    explicit Frames(const RunListing& run) : run_(run) {}

    // `grids`: by their path in the folder, all that could be read of one frame; frames come in order.
    void add(const ListedFrame& frame, std::map<std::string, DensityGrid> grids) {
        if (grids.empty()) return;
        const RunFolder folder{run_.folder, run_.scene.name};
        const auto find = [&](const std::filesystem::path& path) {
            return grids.find(path.lexically_relative(run_.folder).generic_string());
        };
        std::vector<DensityGrid> layers;
        std::vector<Boundaries> boundaries;
        for (const LayerOptions& layer : run_.scene.layers) {
            const auto found = find(folder.density(frame.number, layer.name));
            if (found == grids.end()) continue;
            layers.push_back(found->second);
            boundaries.push_back(layer.boundaries);
        }
        const auto whole = find(folder.density(frame.number));
        const auto expected =
            std::ranges::count_if(run_.scene.layers, [](const auto& layer) { return has_density(layer); });
        if (whole != grids.end() && !layers.empty() && std::ssize(layers) == expected) {
            if (is_too_large(whole->second)) {
                too_large_ = not_compared(whole->second);
            } else {
                compare_layers(frame, whole->second, layers, boundaries, largest_, sums_);
                ++compared_;
            }
        }
        last_ = whole != grids.end() ? whole->second : grids.begin()->second;
        if (!is_too_large(*last_)) motion_.add(*last_);
    }

    // A frame cannot be compared with the next one.
    void skip() { motion_.skip(); }

    void checks(const VerifyOptions& options, std::vector<Check>& checks) const {
        if (compared_ > 0) {
            checks.push_back(sums_.check(
                "layers",
                fmt::format("add up to the common grid within {:.2g} in {} frames", largest_, compared_)));
        } else if (!too_large_.empty()) {
            checks.push_back({"layers", true, too_large_});
        }
        if (!last_) {
            const std::string none = "there is no density";
            if (options.seam) checks.push_back({"seam", false, none, {}, false});
            if (options.max_change) checks.push_back({"motion", false, none, {}, false});
            return;
        }
        checks.push_back(check_seams(run_, *last_, options.seam));
        if (is_too_large(*last_)) {
            const bool is_asked = options.max_change.has_value();
            checks.push_back({"motion", !is_asked, not_compared(*last_), {}, !is_asked});
        } else {
            checks.push_back(motion_.check(options.max_change));
        }
    }

  private:
    const RunListing& run_;
    SequenceMotion motion_;
    Problems sums_;
    double largest_ = 0;
    std::size_t compared_ = 0;
    std::string too_large_;  // why frames were not compared
    std::optional<DensityGrid> last_;
};

}  // namespace

Seam seam_of(const std::vector<float>& density, int nx, int ny, int nz, int axis) {
    const int n = axis == 0 ? nx : axis == 1 ? ny : nz;
    const std::size_t stride = axis == 0   ? 1
                               : axis == 1 ? std::size_t(nx)
                                           : std::size_t(nx) * std::size_t(ny);
    std::vector<double> planes(std::size_t(n), 0.0);
    for (std::size_t at = 0; at < density.size(); ++at) {
        const int i = int(at / stride % std::size_t(n));
        const std::size_t base = at - std::size_t(i) * stride;
        const auto value = [&](int k) { return double(density[base + std::size_t((k + n) % n) * stride]); };
        planes[std::size_t(i)] += std::abs(value(i - 1) - 2 * value(i) + value(i + 1));
    }
    constexpr double kDeviations = 4;
    const double count = double(density.size()) / n;
    Seam seam;
    double sum = 0, squares = 0;
    for (int i = 0; i < n; ++i) {
        const double roughness = planes[std::size_t(i)] / count;
        const bool at_seam = i == 0 || i == n - 1;
        double& most = at_seam ? seam.at_seam : seam.inside;
        most = std::max(most, roughness);
        if (at_seam) continue;
        sum += roughness;
        squares += roughness * roughness;
    }
    const double inner = std::max(1, n - 2), mean = sum / inner;
    seam.limit =
        std::max(seam.inside, mean + kDeviations * std::sqrt(std::max(0.0, squares / inner - mean * mean)));
    return seam;
}

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
    Frames frames(run);
    Problems unread;
    std::map<std::string, DensityGrid> grids;
    std::size_t next = 0;
    bool is_whole = true;  // all files of the frame could be read
    const auto finish_file = [&] {
        const ListedFrame* frame = sources[next].frame;
        if (++next < sources.size() && sources[next].frame == frame) return;
        if (is_whole)
            frames.add(*frame, std::exchange(grids, {}));
        else
            frames.skip();
        grids.clear();
        is_whole = true;
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
                is_whole = false;
                finish_file();
            } catch (const Error& alone) {
                if (!std::string_view(alone.what()).starts_with(paths[next].string())) throw;  // nor this
                decoder.unreadable(alone);
                finish_file();
            }
        }
    }
    for (Check& check : decoder.checks()) checks.push_back(std::move(check));
    frames.checks(options, checks);
    if (!unread.none()) checks.push_back(unread.not_done("decoding"));
}

}  // namespace nephos
