// SPDX-License-Identifier: Apache-2.0
#include "simulation/export/export.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <memory>
#include <span>

#include <fmt/format.h>

#include "core/atomic_file.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/export/export_list.h"
#include "simulation/export/export_plan.h"
#include "simulation/export/frame_export.h"
#include "simulation/export/sequence.h"
#include "simulation/export/weather.h"
#include "simulation/folder_lock.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

// The winds of files, each of which has its own. It is linear between moments, so that one which stays needs its first and
// last alone, and one that never changes a single one.
class WindOfFiles {
  public:
    void add(double time_s, std::vector<WindLevel> levels) {
        if (levels.empty()) levels.push_back({});  // calm
        const std::size_t n = tables_.size();
        if (n > 0 && time_s <= tables_.back().time_s) return;
        if (n > 1 && tables_[n - 1].levels == levels && tables_[n - 2].levels == levels)
            tables_.back().time_s = time_s;
        else
            tables_.push_back({time_s, std::move(levels)});
    }
    std::vector<WindTable> take() {
        const bool stays = std::ranges::all_of(
            tables_, [&](const WindTable& table) { return table.levels == tables_.front().levels; });
        if (stays && tables_.size() > 1) tables_.resize(1);
        if (stays && !tables_.empty() && tables_.front().levels == std::vector<WindLevel>{{}})
            tables_.clear();
        return std::move(tables_);
    }

  private:
    std::vector<WindTable> tables_;
};

// Reads the files of sequences, and keeps grids that were read once, as long as they are small.
class GridReader {
  public:
    explicit GridReader(const ExportOptions& options) { reading_.grid = options.grid; }

    using Read = std::shared_ptr<const LoadedDensity>;
    using Each = std::function<bool(std::size_t frame, Read loaded)>;  // false: stop

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
                const auto read = std::make_shared<const LoadedDensity>(std::move(loaded));
                const std::size_t bytes = read->density.memory_bytes();
                if (keep && bytes_ + bytes < most_kept()) {
                    bytes_ += bytes;
                    kept_.emplace(files[index], read);
                }
                goes_on = each(n + index, read);
                return goes_on;
            });
            if (!goes_on) return;
            n += files.size();
        }
    }

  private:
    // Leaves nearly all of a short memory to what the frames take.
    std::size_t most_kept() const {
        return std::min(std::size_t(256) << 20, (available_memory().bytes + bytes_) / 16);
    }

    VdbReadOptions reading_;
    std::map<std::filesystem::path, Read> kept_;
    std::size_t bytes_ = 0;  // of them
};

// Writes and lists a file that is made of no density.
void write_text_file(ExportList& list, const std::string& name, std::span<const std::byte> content,
                     std::vector<std::string>& notes) {
    if (std::string note = list.note_on_change(name); !note.empty()) notes.push_back(std::move(note));
    list.add_written(list.write_file(name, {}, {}, [&](const std::filesystem::path& path) {
        write_atomically(path, content);
        return false;  // nothing is lost
    }));
}

// Throws Error(io) unless a folder still holds the run that was read of it, of which more frames may be there by now.
void require_same_run(const RunListing& run, const std::filesystem::path& source) {
    const RunListing now = read_run(source);
    const auto is_same_frame = [](const ListedFrame& a, const ListedFrame& b) {
        return a.number == b.number && a.state_hash == b.state_hash;
    };
    if (now.scene_hash == run.scene_hash && now.frames_hash == run.frames_hash &&
        now.frames.size() >= run.frames.size() &&
        std::equal(run.frames.begin(), run.frames.end(), now.frames.begin(), is_same_frame))
        return;
    throw Error(ErrorCode::io, source.string() + ": was changed while it was exported: export it again");
}

// Returns the frames of a run that summaries of weather are made of.
std::vector<ListedFrame> frames_of_weather(const ExportOptions& options, const RunListing& run) {
    std::vector<ListedFrame> frames;
    std::ranges::copy_if(run.frames, std::back_inserter(frames),
                         [&](const ListedFrame& frame) { return is_wanted(options, frame.number, 1); });
    return frames;
}

// Returns the summary of a frame; notes what of it is damaged, unless it was noted of a volume.
WeatherSummary summarise_once(const RunListing& run, const ListedFrame& frame,
                              std::vector<std::string>& notes) {
    std::vector<std::string> damages;
    WeatherSummary summary = summarise(run, frame, damages);
    for (std::string& damage : damages)
        if (std::ranges::count(notes, damage) == 0) notes.push_back(std::move(damage));
    return summary;
}

// The summaries of a run's layers, in all forms that are wanted.
void write_weather(const ExportOptions& options, const RunListing& run,
                   const std::vector<WeatherSummary>& frames, const std::vector<ExportSequence>& sequences,
                   ExportList& list, std::vector<std::string>& notes) {
    // Its files were opened by their paths, those of volumes before: a folder or link of that name may lead to another run by now.
    require_same_run(run, options.source);
    for (const ExportSequence& s : sequences)
        for (const SourceFrame& frame : s.frames) require_unchanged(frame);
    if (frames.empty())
        throw Error(ErrorCode::io,
                    options.source.string() + ": was changed while it was exported: export it again");
    const std::vector<WeatherFormat> formats = all_weather(options);
    std::ranges::move(limit_notes(formats, frames), std::back_inserter(notes));
    const auto write_file = [&](std::string_view extension, std::span<const std::byte> content) {
        const std::string name = run.scene.name + std::string(extension);
        write_text_file(list, name, content, notes);
    };
    const auto write = [&](WeatherFormat format, std::span<const std::byte> content) {
        for (const NamedWeather& named : weather_formats())
            if (named.format == format) write_file(named.extension, content);
    };
    const auto write_text = [&](WeatherFormat format, const std::string& text) {
        write(format, std::as_bytes(std::span(text.data(), text.size())));
    };
    for (const WeatherFormat format : formats) {
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
            case WeatherFormat::cigi: {
                write(format, cigi_capture(frames));
                std::vector<std::byte> packets;
                for (const WeatherSummary& frame : frames)
                    std::ranges::copy(cigi_packets(frame), std::back_inserter(packets));
                write_file(kPackets, packets);
                break;
            }
        }
    }
}

// Throws Error(usage) where a source lies in the folder of the export: a file of its name would replace it.
void refuse_own_folder(const ExportOptions& options, const std::vector<ExportSequence>& sequences) {
    for (const ExportSequence& s : sequences) {
        for (const SourceFrame& frame : s.frames) {
            const std::filesystem::path folder =
                frame.file.has_parent_path() ? frame.file.parent_path() : ".";
            if (is_same_place(folder, options.folder))
                throw Error(ErrorCode::usage, frame.file.string() +
                                                  ": lies in the folder that is written to: expected "
                                                  "another one as --out");
        }
    }
}

void write_texts(const ExportOptions& options, const std::optional<RunListing>& run,
                 const std::vector<WeatherSummary>& weather, const std::vector<ExportSequence>& sequences,
                 const std::vector<std::vector<FrameFigures>>& figures, ExportList& list,
                 std::vector<std::string>& notes) {
    if (run) write_weather(options, *run, weather, sequences, list, notes);
    const auto write = [&](const std::string& name, const std::string& text) {
        write_text_file(list, name, std::as_bytes(std::span(text)), notes);
    };
    const std::vector<ExportFormat> formats = all_formats(options);
    for (std::size_t n = 0; n < sequences.size(); ++n) {
        const ExportSequence& s = sequences[n];
        if (formats.empty()) break;
        write(sidecar_name(s), sidecar_text(options, s, figures[n]));
        if (std::ranges::count(formats, ExportFormat::vti) == 0) continue;
        std::vector<PvdEntry> entries;
        for (const SourceFrame& frame : s.frames)
            entries.push_back({frame.time_s, frame_name(s, frame.number, ExportFormat::vti)});
        write(pvd_name(s), pvd_text(entries));
    }
    if (std::ranges::count(formats, ExportFormat::usd) > 0)
        write(usd_name(sequences), usd_text(options, sequences));
    write(kReadme, readme_text(options, sequences));
}

}  // namespace

ExportReport plan_export(const ExportOptions& options) {
    check_options(options);
    std::vector<std::string> notes;
    const std::vector<ExportSequence> sequences = list_sequences(options, run_of(options), notes);
    try {
        require_room(options, sequences);
    } catch (const Error& error) {  // here and now: the plan may be for another machine
        notes.push_back(std::string(error.what()) + ": an export would be refused");
    }
    ExportReport report = report_of(options, sequences);
    report.notes = std::move(notes);
    return report;
}

ExportReport run_export(const ExportOptions& options, const ExportProgress& progress) {
    check_options(options);
    std::vector<std::string> notes;
    std::optional<RunListing> run = run_of(options);
    std::vector<ExportSequence> sequences = list_sequences(options, run, notes);
    const bool is_of_run = run.has_value();
    if (options.weather.empty()) run.reset();  // it is for weather alone from here on
    ExportReport report = report_of(options, sequences);
    require_room(options, sequences);
    GridReader reader(options);
    const std::vector<ListedFrame> of_weather =
        run ? frames_of_weather(options, *run) : std::vector<ListedFrame>();
    std::size_t frames = of_weather.size(), done = 0;
    if (!all_formats(options).empty())
        for (const ExportSequence& s : sequences) frames += s.frames.size();
    const auto goes_on = [&] { return !progress || progress(done, frames); };
    for (ExportSequence& s : sequences) {
        if (!options.range_auto) continue;
        float most = 0;
        bool stopped = false;
        reader.read(s.frames, true, [&](std::size_t, const GridReader::Read& loaded) {
            most = std::max(most, loaded->density.max_value());
            stopped = !goes_on();
            return !stopped;
        });
        if (stopped) {
            report.notes = std::move(notes);
            return report;
        }
        if (most > 0) s.scale = most;
        if (s.scale < kLeastScale || s.scale > kLargestScale)
            throw Error(
                ErrorCode::usage,
                fmt::format("{}: its largest value is {:g}, and --range auto takes values from {:g} to {:g}",
                            s.frames.front().file.string(), s.scale, kLeastScale, kLargestScale));
    }
    refuse_own_folder(options, sequences);
    const FolderLock lock(options.folder, "export");
    ExportList list(lock, options, sequences);
    list.require_free(file_names(options, run, sequences));
    FrameExporter exporter(options, list);
    std::vector<std::vector<FrameFigures>> figures(sequences.size());
    const auto take = [&](std::vector<FrameFigures>& of, ExportedFrame&& frame) {
        std::ranges::move(frame.notes, std::back_inserter(notes));
        for (ExportedFrame::File& file : frame.files)
            file.kept ? list.add_kept(std::move(file.listed)) : list.add_written(std::move(file.listed));
        of.push_back(frame.figures);
        ++done;
    };
    const auto stop = [&] {
        list.end(false);
        report.notes = std::move(notes);
        return report;
    };
    try {
        list.begin();
        for (std::size_t n = 0; n < sequences.size(); ++n) {
            ExportSequence& s = sequences[n];
            if (all_formats(options).empty()) break;
            bool stopped = false;
            WindOfFiles winds;  // those of a run are known
            FramesAtWork work(frames_at_once(options, s),
                              [&](ExportedFrame&& frame) { take(figures[n], std::move(frame)); });
            try {
                reader.read(s.frames, false,
                            [&](std::size_t index, std::shared_ptr<const LoadedDensity> read) {
                                const LoadedDensity& loaded = *read;
                                lock.require_in_place();
                                SourceFrame& frame = s.frames[index];
                                take_moment(loaded, frame);
                                if (loaded.metadata) winds.add(frame.time_s, loaded.metadata->wind);
                                if (s.of_nephos && !loaded.metadata)
                                    notes.push_back(
                                        fmt::format("{}: says of no moment, unlike the first file: it is "
                                                    "given {}, {:g} s",
                                                    frame.file.string(),
                                                    is_of_run ? "that of its run's manifest" : "that one's",
                                                    frame.time_s));
                                for (const std::string& note : loaded.notes)
                                    notes.push_back(frame.file.string() + ": " + note);
                                work.add([&, read] {
                                    lock.require_in_place();
                                    return exporter.write(s, frame, *read);
                                });
                                stopped = !goes_on();
                                return !stopped;
                            });
                work.finish();
            } catch (...) {
                work.finish_quietly();
                throw;
            }
            if (!is_of_run) s.wind = winds.take();
            stopped = stopped || !goes_on();
            lock.require_in_place();
            if (stopped) return stop();
        }
        std::vector<WeatherSummary> weather;
        for (const ListedFrame& frame : of_weather) {
            weather.push_back(summarise_once(*run, frame, notes));
            lock.require_in_place();
            ++done;
            if (!goes_on()) return stop();
        }
        write_texts(options, run, weather, sequences, figures, list, notes);
        lock.require_in_place();
        std::ranges::move(list.remove_left_over(), std::back_inserter(notes));
        list.end(true);
    } catch (...) {
        // What failed in a folder that is gone failed for that; and nothing may be listed in a new one of its name.
        lock.require_in_place();
        list.end_quietly();
        throw;
    }
    report.notes = std::move(notes);
    report.files = list.files();
    report.written = list.written();
    report.kept = list.kept();
    return report;
}

}  // namespace nephos
