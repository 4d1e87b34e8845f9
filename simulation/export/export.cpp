// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <system_error>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/text.h"
#include "density/combine.h"
#include "density/export/bricks.h"
#include "density/export/containers.h"
#include "simulation/export/export_list.h"
#include "simulation/export/sequence.h"
#include "simulation/export/weather.h"
#include "simulation/folder_lock.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

constexpr std::size_t kListEvery = 16;  // frames

std::string_view name_of(ExportFormat format) {
    for (const NamedFormat& named : export_formats())
        if (named.format == format) return named.name;
    return {};
}

void check_options(const ExportOptions& o) {
    if (o.formats.empty() && o.weather.empty())
        throw Error(ErrorCode::usage, "neither --to nor --for says which files to write");
    if (o.voxel_m && (o.largest_side || o.budget_bytes))
        throw Error(ErrorCode::usage, "--voxel excludes --size and --budget");
    if (o.largest_side && o.budget_bytes)
        throw Error(ErrorCode::usage, "--size and --budget exclude each other");
    for (const ExportFormat format : all_formats(o)) {
        const VoxelType type = type_of(o, format);
        const bool whole = type == VoxelType::r8 || type == VoxelType::r16;
        if (format == ExportFormat::vti && (type == VoxelType::bc4 || type == VoxelType::r16f))
            throw Error(ErrorCode::usage,
                        "--type " + std::string(type_name(type)) + ": VTK has r8, r16 and r32f");
        if (format == ExportFormat::bricks && type == VoxelType::bc4)
            throw Error(ErrorCode::usage, "--type bc4: bricks with a border have r8, r16, r16f or r32f");
        if (format == ExportFormat::slices && !whole)
            throw Error(ErrorCode::usage,
                        "--type " + std::string(type_name(type)) + ": slices are r8 or r16");
        if (format == ExportFormat::dds && o.legacy_dds && type != VoxelType::r8 && type != VoxelType::bc4)
            throw Error(ErrorCode::usage, "--legacy-dds: the old header has r8 and bc4");
        if (format == ExportFormat::vti && o.layout.axes != AxisOrder::enu)
            throw Error(ErrorCode::usage,
                        "--axes: VTK's space is right-handed and named x y z: leave it at enu for vti");
    }
}

PlannedSequence planned(const ExportOptions& options, const ExportSequence& s) {
    PlannedSequence plan;
    plan.name = s.name;
    plan.layer = s.layer;
    plan.box = box_of(s.extent, s.placement, s.layout);
    plan.factor = s.layout.factor;
    plan.levels = s.levels;
    plan.frames = s.frames.size();
    std::error_code error;
    const std::uintmax_t source = std::filesystem::file_size(s.frames.front().file, error);
    for (const ExportFormat format : all_formats(options)) {
        if (format == ExportFormat::usd) continue;
        if (!is_dense(format)) {
            // Uncompressed NanoVDB has some five times the bytes of a compressed VDB file.
            plan.estimated_bytes += error ? 0 : source * (format == ExportFormat::nvdb ? 5 : 2);
            continue;
        }
        plan.bytes_a_frame += dense_bytes(options, s, format);
    }
    return plan;
}

ExportReport report_of(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    ExportReport report;
    for (const ExportSequence& s : sequences) {
        report.sequences.push_back(planned(options, s));
        const PlannedSequence& plan = report.sequences.back();
        report.needed_bytes += plan.frames * (plan.bytes_a_frame + plan.estimated_bytes);
    }
    return report;
}

// The disk that holds the folder, or will; of an export that goes on, what it has written already is not counted again.
void require_space(const std::filesystem::path& folder, std::uint64_t bytes) {
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(folder, none)) {
        const std::uintmax_t size = entry.is_regular_file(none) ? entry.file_size(none) : 0;
        if (size != std::uintmax_t(-1)) bytes -= std::min<std::uint64_t>(bytes, size);
    }
    std::filesystem::path at = std::filesystem::absolute(folder);
    while (!std::filesystem::exists(at) && at.has_parent_path() && at != at.parent_path())
        at = at.parent_path();
    std::error_code error;
    const auto space = std::filesystem::space(at, error);
    if (error || space.available >= bytes) return;
    throw Error(ErrorCode::io,
                fmt::format("{}: the export takes {}, but only {} are free", folder.string(),
                            bytes_text(std::size_t(bytes)), bytes_text(std::size_t(space.available))));
}

// Reads the files of sequences, and keeps grids that were read once, as long as they are small.
class GridReader {
  public:
    explicit GridReader(const ExportOptions& options) { reading_.grid = options.grid; }

    using Each = std::function<bool(std::size_t frame, const LoadedDensity& loaded)>;  // false: stop

    void read(const std::vector<SourceFrame>& frames, bool keep, const Each& each) {
        for (std::size_t n = 0; n < frames.size();) {
            if (const auto found = kept_.find(frames[n].file); found != kept_.end()) {
                if (!each(n++, found->second)) return;
                continue;
            }
            std::vector<std::filesystem::path> files;
            for (std::size_t m = n; m < frames.size() && !kept_.contains(frames[m].file); ++m)
                files.push_back(frames[m].file);
            bool goes_on = true;
            load_densities(files, reading_, [&](std::size_t index, LoadedDensity&& loaded) {
                goes_on = each(n + index, loaded);
                const std::size_t bytes = loaded.density.memory_bytes();
                if (keep && bytes_ + bytes < kMostKept) {
                    bytes_ += bytes;
                    kept_.emplace(files[index], std::move(loaded));
                }
                return goes_on;
            });
            if (!goes_on) return;
            n += files.size();
        }
    }

  private:
    static constexpr std::size_t kMostKept = std::size_t(256) << 20;
    VdbReadOptions reading_;
    std::map<std::filesystem::path, LoadedDensity> kept_;
    std::size_t bytes_ = 0;
};

// The grid as VDB files hold it: coarser if the options want that.
DensityGrid grid_of(const DensityGrid& density, int factor) {
    if (factor == 1) return density;
    VolumeLayout layout;
    layout.factor = factor;
    const Volume volume = lay_out(density, layout);
    Placement placement = density.placement();
    placement.cell_size_m *= factor;
    return DensityGrid::from_dense(volume.values, {volume.nx, volume.ny, volume.nz}, placement);
}

void write_vdb_file(const std::filesystem::path& path, const ExportOptions& options, const ExportSequence& s,
                    const LoadedDensity& loaded) {
    DensityGrid density = grid_of(loaded.density, s.layout.factor);
    VdbContent content;
    VdbMetadata metadata = loaded.metadata.value_or(VdbMetadata{});
    if (!loaded.metadata) metadata.nephos_version = version();
    if (options.half_voxel_shift) density = shifted_by_half_a_voxel(density);
    content.density = &density;
    content.half = options.type == VoxelType::r16f;
    if (!options.velocity_name.empty() && !metadata.wind.empty()) {
        const Wind wind{{{0, metadata.wind}}};
        const Placement& at = loaded.density.placement();
        for (int k = 0; k < density.extent().z; ++k)
            content.wind.push_back(
                wind_at(wind, at.origin_m.z + (k + 0.5) * density.placement().cell_size_m, 0));
        content.wind_name = options.velocity_name;
    }
    write_vdb(path, content, metadata);
}

// Writes the files of one frame that are not there yet.
class FrameExporter {
  public:
    FrameExporter(const ExportOptions& options, ExportList& list) : options_(options), list_(list) {}

    FrameFigures write(const ExportSequence& s, const SourceFrame& frame, const LoadedDensity& loaded) {
        if (!(loaded.density.extent() == s.extent) || !(loaded.density.placement() == s.placement))
            throw Error(ErrorCode::io,
                        frame.file.string() + ": has another box than the first file of its sequence");
        const ExportSource source{frame.file, file_digest(frame.file)};
        require_unchanged(frame);
        std::map<VoxelType, EncodedVolume> encoded;
        std::vector<Volume> levels;
        for (const ExportFormat format : all_formats(options_)) {
            if (format == ExportFormat::usd) continue;
            const std::string name = frame_name(s, frame.number, format);
            if (list_.keep(name, source)) continue;
            const std::filesystem::path path = options_.folder / name;
            if (format == ExportFormat::vdb) {
                write_vdb_file(path, options_, s, loaded);
            } else if (format == ExportFormat::nvdb) {
                write_nanovdb(path, grid_of(loaded.density, s.layout.factor),
                              options_.zip ? NanoCodec::zip : NanoCodec::none, options_.quantise);
            } else {
                if (levels.empty()) levels = levels_of(loaded.density, s);
                const VoxelType type = type_of(options_, format);
                if (format == ExportFormat::bricks) {
                    write_bricks(path, levels, brick_options(s, type));
                } else {
                    auto found = encoded.find(type);
                    if (found == encoded.end())
                        found = encoded.emplace(type, encoded_levels(levels, type, s.scale)).first;
                    write_dense(path, format, s, frame, found->second);
                }
            }
            list_.add(name, source, name_of(format));
        }
        return {loaded.density.sum(), double(loaded.density.max_value())};
    }

  private:
    static std::vector<Volume> levels_of(const DensityGrid& density, const ExportSequence& s) {
        std::vector<Volume> levels{lay_out(density, s.layout)};
        for (int n = 1; n < s.levels; ++n) levels.push_back(halved(levels.back()));
        return levels;
    }

    static EncodedVolume encoded_levels(const std::vector<Volume>& levels, VoxelType type, float scale) {
        EncodedVolume encoded{type, {}};
        for (const Volume& v : levels) encoded.levels.push_back({v.nx, v.ny, v.nz, encode(v, type, scale)});
        return encoded;
    }

    // Bricks wrap around where the box repeats and nothing stands between its sides.
    BrickOptions brick_options(const ExportSequence& s, VoxelType type) const {
        const VolumeBox box = box_of(s.extent, s.placement, s.layout);
        BrickOptions bricks{options_.brick_edge, type, s.scale, {}};
        for (std::size_t a = 0; a < 3; ++a)
            bricks.periodic[a] =
                s.layout.periodic[std::size_t(box.axis[a])] && box.border == 0 && box.padding[a] == 0;
        return bricks;
    }

    void write_dense(const std::filesystem::path& path, ExportFormat format, const ExportSequence& s,
                     const SourceFrame& frame, const EncodedVolume& encoded) const {
        const VolumeBox box = box_of(s.extent, s.placement, s.layout);
        switch (format) {
            case ExportFormat::raw:
                return write_raw(path, encoded);
            case ExportFormat::dds:
                return write_dds(path, encoded, options_.legacy_dds);
            case ExportFormat::ktx2:
                return write_ktx2(path, encoded, sidecar_text(options_, s, {}));
            case ExportFormat::slices:
                return write_slices(path, encoded, slice_columns(box.size[0], box.size[1], box.size[2]));
            default: {
                VtiPlace place;
                place.time_s = frame.time_s;
                place.voxel_m = box.voxel_m;
                for (std::size_t a = 0; a < 3; ++a) place.first_m[a] = box.min_m[a] + box.voxel_m[a] / 2;
                return write_vti(path, encoded, place, options_.zip);
            }
        }
    }

    const ExportOptions& options_;
    ExportList& list_;
};

// The summaries of a run's layers, in all forms that are wanted.
void write_weather(const ExportOptions& options, ExportList& list) {
    const RunListing run = read_run(options.source);
    std::vector<WeatherSummary> frames;
    for (const ListedFrame& frame : run.frames) {
        if (is_wanted(options, frame.number, 1)) frames.push_back(summarise(run, frame));
    }
    const auto write = [&](WeatherFormat format, std::span<const std::byte> content) {
        for (const NamedWeather& named : weather_formats()) {
            if (named.format != format) continue;
            const std::string name = run.scene.name + std::string(named.extension);
            write_atomically(options.folder / name, content);
            list.add(name, {}, {});
        }
    };
    const auto write_text = [&](WeatherFormat format, const std::string& text) {
        write(format, std::as_bytes(std::span(text.data(), text.size())));
    };
    for (const WeatherFormat format : options.weather) {
        switch (format) {
            case WeatherFormat::layers:
                write_text(format, layers_json_text(run, frames));
                break;
            case WeatherFormat::metar: {
                std::string text;
                for (const WeatherSummary& frame : frames) text += metar_of(run, frame) + "\n";
                write_text(format, text);
                break;
            }
            case WeatherFormat::xplane:
                write_text(format, xplane_text(run, frames));
                break;
            case WeatherFormat::wpr:
                write_text(format, wpr_text(run, frames.front()));
                break;
            case WeatherFormat::cigi:
                write(format, cigi_capture(frames));
                break;
        }
    }
}

void write_texts(const ExportOptions& options, const std::vector<ExportSequence>& sequences,
                 const std::vector<std::vector<FrameFigures>>& figures, ExportList& list) {
    if (!options.weather.empty()) write_weather(options, list);
    const auto write = [&](const std::string& name, const std::string& text) {
        write_atomically(options.folder / name, std::string_view(text));
        list.add(name, {}, {});
    };
    const std::vector<ExportFormat> formats = all_formats(options);
    for (std::size_t n = 0; n < sequences.size(); ++n) {
        const ExportSequence& s = sequences[n];
        if (formats.empty()) break;
        write(s.name + ".volume.json", sidecar_text(options, s, figures[n]));
        if (std::ranges::count(formats, ExportFormat::vti) == 0) continue;
        std::vector<PvdEntry> entries;
        for (const SourceFrame& frame : s.frames)
            entries.push_back({frame.time_s, frame_name(s, frame.number, ExportFormat::vti)});
        write(s.name + ".pvd", pvd_text(entries));
    }
    if (std::ranges::count(formats, ExportFormat::usd) > 0) {
        const std::string& name = sequences.front().name;
        const std::string& layer = sequences.front().layer;
        write((layer.empty() ? name : name.substr(0, name.size() - layer.size() - 1)) + ".usda",
              usd_text(options, sequences));
    }
    write("README.txt", readme_text(options, sequences));
}

}  // namespace

DensityGrid shifted_by_half_a_voxel(const DensityGrid& density) {
    Placement placement = density.placement();
    for (int a = 0; a < 3; ++a) placement.origin_m[a] -= placement.cell_size_m / 2;
    return placed_at(density, placement);
}

ExportReport plan_export(const ExportOptions& options) {
    check_options(options);
    std::vector<std::string> notes;
    ExportReport report = report_of(options, list_sequences(options, notes));
    report.notes = std::move(notes);
    return report;
}

ExportReport run_export(const ExportOptions& options, const ExportProgress& progress) {
    check_options(options);
    std::vector<std::string> notes;
    std::vector<ExportSequence> sequences = list_sequences(options, notes);
    ExportReport report = report_of(options, sequences);
    require_space(options.folder, report.needed_bytes);
    GridReader reader(options);
    std::size_t frames = 0, done = 0;
    for (ExportSequence& s : sequences) {
        frames += s.frames.size();
        if (!options.range_auto) continue;
        float most = 0;
        reader.read(s.frames, true, [&](std::size_t, const LoadedDensity& loaded) {
            most = std::max(most, loaded.density.max_value());
            return true;
        });
        if (most > 0) s.scale = most;
    }
    const FolderLock lock(options.folder, "export");
    ExportList list(options, sequences);
    FrameExporter exporter(options, list);
    std::vector<std::vector<FrameFigures>> figures(sequences.size());
    try {
        list.write(false);  // the folder is known as that of an export, whenever this one is killed
        for (std::size_t n = 0; n < sequences.size(); ++n) {
            ExportSequence& s = sequences[n];
            if (all_formats(options).empty()) break;
            bool stopped = false;
            reader.read(s.frames, false, [&](std::size_t index, const LoadedDensity& loaded) {
                lock.require_in_place();
                SourceFrame& frame = s.frames[index];
                if (loaded.metadata) {
                    frame.time_s = loaded.metadata->time_s;
                    frame.utc = utc_at(loaded.metadata->georeference, frame.time_s);
                }
                for (const std::string& note : loaded.notes)
                    notes.push_back(frame.file.string() + ": " + note);
                figures[n].push_back(exporter.write(s, frame, loaded));
                if (figures[n].back().max > s.scale && options.type != VoxelType::r32f)
                    notes.push_back(
                        fmt::format("{}: values up to {:g} are above {:g}, and are cut in r8, r16 and bc4 "
                                    "(--range auto keeps them)",
                                    frame.file.string(), figures[n].back().max, s.scale));
                if (++done % kListEvery == 0) list.write(false);
                stopped = progress && !progress(done, frames);
                return !stopped;
            });
            lock.require_in_place();
            if (stopped) {
                list.write(false);
                report.notes = std::move(notes);
                return report;
            }
        }
        write_texts(options, sequences, figures, list);
        lock.require_in_place();
        std::ranges::move(list.remove_left_over(), std::back_inserter(notes));
        list.write(true);
    } catch (...) {
        // What failed in a folder that is gone failed for that; and nothing may be listed in a new one of its name.
        lock.require_in_place();
        list.write_quietly();
        throw;
    }
    report.notes = std::move(notes);
    report.files = list.files();
    report.written = list.written();
    report.kept = list.kept();
    return report;
}

}  // namespace nephos
