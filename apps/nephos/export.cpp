// SPDX-License-Identifier: Apache-2.0

// nephos export: density for other programs.

#include "simulation/export/export.h"

#include <memory>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

struct ExportArguments {
    std::vector<std::string> sources;
    std::vector<std::string> formats;
    std::string target, out = "export";
    ExportOptions options;
    bool plan = false;
    WorkArguments work;
};

[[noreturn]] void refuse(const std::string& text, const std::string& expected) {
    throw Error(ErrorCode::usage, fmt::format("'{}' is not {}", text, expected));
}

// The value of a word; `words` in the order of the enum.
template <class Enum>
Enum word_of(const std::string& text, std::initializer_list<std::string_view> words) {
    int n = 0;
    std::string all;
    for (const std::string_view word : words) {
        if (text == word) return Enum(n);
        all += (n == 0 ? "" : n + 1 == int(words.size()) ? " or " : ", ") + std::string(word);
        ++n;
    }
    refuse(text, "one of " + all);
}

// "64MiB", "1.5GB", "200000".
std::uint64_t parse_bytes(const std::string& text) {
    const std::size_t at = text.find_first_not_of("0123456789.");
    const std::string unit = at == text.npos ? "" : text.substr(at);
    const std::pair<std::string_view, double> units[] = {
        {"", 1},     {"KiB", 1024.0}, {"MiB", 1048576.0}, {"GiB", 1073741824.0},
        {"kB", 1e3}, {"MB", 1e6},     {"GB", 1e9}};
    for (const auto& [name, factor] : units)
        if (unit == name && at != 0)
            return std::uint64_t(parse_real(text.substr(0, at), 1e-6, 1e15) * factor);
    refuse(text, "an amount such as 64MiB or 2GB");
}

ExportOptions options_of(const ExportArguments& a) {
    ExportOptions options = a.options;
    if (a.sources.size() == 1) {
        options.source = a.sources.front();
    } else {
        for (const std::string& file : a.sources) options.files.emplace_back(file);
        options.source = a.sources.front();
    }
    for (const std::string& name : a.formats) {
        bool found = false;
        std::string names;
        for (const NamedFormat& format : export_formats()) {
            names += (names.empty() ? "" : ", ") + std::string(format.name);
            if (name == format.name) {
                options.formats.push_back(format.format);
                found = true;
            }
        }
        for (const NamedWeather& format : weather_formats()) {
            names += ", " + std::string(format.name);
            if (name != format.name) continue;
            options.weather.push_back(format.format);
            found = true;
        }
        if (!found) throw Error(ErrorCode::usage, "--to '" + name + "' is none of " + names);
    }
    const ExportOptions given = options;
    if (!a.target.empty()) {
        const ExportPreset* preset = nullptr;
        std::string names;
        for (const ExportPreset& one : export_presets()) {
            names += (names.empty() ? "" : ", ") + one.name;
            if (one.name == a.target) preset = &one;
        }
        if (preset == nullptr) throw Error(ErrorCode::usage, "--for '" + a.target + "' is none of " + names);
        options.target = preset->name;
        preset->apply(options);
    }
    refuse_unused(given, options);
    if (a.out.empty()) throw Error(ErrorCode::usage, "--out is empty: expected a folder to write to");
    options.folder = a.out;
    return options;
}

nlohmann::ordered_json json_of(const ExportReport& report) {
    nlohmann::ordered_json sequences = nlohmann::ordered_json::array();
    for (const PlannedSequence& s : report.sequences) {
        sequences.push_back({{"name", s.name},
                             {"frames", s.frames},
                             {"size", s.box.size},
                             {"voxel_size_m", s.box.voxel_m},
                             {"min_m", s.box.min_m},
                             {"max_m", s.box.max_m},
                             {"border", s.box.border},
                             {"padding", s.box.padding},
                             {"levels", s.levels},
                             {"bytes_a_frame", s.bytes_a_frame},
                             {"estimated_bytes_a_frame", s.estimated_bytes}});
    }
    return {{"sequences", sequences},       {"needed_bytes", report.needed_bytes}, {"notes", report.notes},
            {"files", report.files.size()}, {"written", report.written},           {"kept", report.kept}};
}

void print_volumes(const std::vector<PlannedSequence>& sequences, Output& output) {
    for (const PlannedSequence& s : sequences) {
        const auto& box = s.box;
        output.line(fmt::format(
            "{}: {} frame{}, {} x {} x {} voxels of {:g} m{}{}", s.name, s.frames, s.frames == 1 ? "" : "s",
            box.size[0], box.size[1], box.size[2], box.voxel_m[0],
            s.levels > 1 ? fmt::format(", {} levels", s.levels) : "",
            s.bytes_a_frame > 0 ? ", " + bytes_text(std::size_t(s.bytes_a_frame)) + " a frame" : ""));
    }
}

std::string planned_size(const ExportReport& report, bool has_volumes) {
    if (!has_volumes) return "summaries of weather alone, of which each frame takes some kilobytes at most";
    return bytes_text(std::size_t(report.needed_bytes)) + " in all" +
           (report.sequences.front().estimated_bytes > 0 ? " (estimated)" : "");
}

void print_plan(const ExportOptions& options, const ExportReport& report, bool plan) {
    Output output;
    const bool has_volumes = !options.formats.empty();
    if (has_volumes) print_volumes(report.sequences, output);
    output.line(
        plan ? planned_size(report, has_volumes) + "; nothing was written"
             : fmt::format("{}: {} files written{}; README.txt has the steps", options.folder.string(),
                           report.written,
                           report.kept > 0 ? fmt::format(", {} were there already", report.kept) : ""));
}

int run_command(const ExportArguments& a) {
    start_threads(a.work.threads);
    const ExportOptions options = options_of(a);
    ExportReport report;
    bool stopped = false;
    if (a.plan) {
        report = plan_export(options);
    } else {
        std::unique_ptr<ProgressBar> bar;
        defer_signals();
        report = run_export(options, [&](std::size_t done, std::size_t frames) {
            if (!bar) bar = std::make_unique<ProgressBar>("frame", 0, frames, !a.work.quiet);
            bar->update(done);
            stopped = pending_signal() != 0 && done < frames;
            return !stopped;
        });
    }
    if (!a.work.quiet) {
        for (const std::string& note : report.notes) print_note(note);
    }
    if (stopped) {
        print_note("stopped; the same command goes on");
        return 128 + pending_signal();
    }
    if (a.work.json) {
        Output().line(json_text(json_of(report)));
    } else if (!a.work.quiet) {
        print_plan(options, report, a.plan);
    }
    return 0;
}

void add_shape_options(CLI::App& command, const std::shared_ptr<ExportArguments>& a) {
    ExportOptions& o = a->options;
    add_value(command, "--type", "TYPE",
              "Voxels of raw, bricks, dds, ktx2, vti and slices: r8, r16, r16f, r32f or bc4 (r16f: VDB of "
              "16-bit floats)",
              [&o](const std::string& text) {
                  o.type = word_of<VoxelType>(text, {"r8", "r16", "r16f", "r32f", "bc4"});
              });
    add_value(command, "--range", "RANGE",
              "0..1, or auto: divide by the largest value of the sequence; the sidecar has the factor",
              [&o](const std::string& text) {
                  o.range_auto = word_of<int>(text, {"0..1", "auto"}) == 1;
              });
    add_value(command, "--voxel", "M",
              "Coarser voxels, a multiple of the grid's; means, so that the mass stays",
              [&o](const std::string& text) { o.voxel_m = parse_real(text, 1e-6, 1e9); });
    add_value(command, "--size", "N",
              "Coarser voxels, so that the longest side has at most N, border and padding included",
              [&o](const std::string& text) { o.largest_side = int(parse_integer(text, 1, 1 << 20)); });
    add_value(command, "--budget", "BYTES",
              "Coarser voxels, so that those of a frame take at most this: 64MiB",
              [&o](const std::string& text) { o.budget_bytes = parse_bytes(text); });
    command.add_flag(
        "--mips", o.mips,
        "Levels of detail down to 32 voxels in dds, ktx2, raw and bricks; each has the mass of the first");
    add_value(command, "--bricks", "N",
              "Edge of the bricks of `bricks`, without their border of 1 (default: 32)",
              [&o](const std::string& text) { o.brick_edge = int(parse_integer(text, 8, 256)); });
    add_value(command, "--border", "KIND",
              "One voxel around the box: none, zero, or wrap (of the opposite side where it repeats)",
              [&o](const std::string& text) {
                  o.layout.border = word_of<Border>(text, {"none", "zero", "wrap"});
              });
    add_value(command, "--pad", "N", "Pad sizes with 0 to multiples of N, or pow2: to powers of two",
              [&o](const std::string& text) {
                  if (text == "pow2")
                      o.layout.power_of_two = true;
                  else
                      o.layout.multiple = int(parse_integer(text, 1, 256));
              });
    add_value(command, "--axes", "ORDER",
              "Order of the file's axes: enu (east, north, up), unity (x z y) or unreal (y x z); permuted, "
              "never mirrored",
              [&o](const std::string& text) {
                  o.layout.axes = word_of<AxisOrder>(text, {"enu", "unity", "unreal"});
              });
}

// Frames of a run are counted from 1, those of files as they are named, often from 0.
FrameRange parse_frames_from_0(const std::string& text) {
    if (text == "0" || text == "..0" || text == "0..0") return {0, 0};
    if (text == "0..") return {0};
    const bool from_0 = text.starts_with("0..");
    FrameRange range = parse_frames(from_0 ? text.substr(1) : text);
    if (from_0 || text.starts_with("..")) range.first = 0;
    return range;
}

}  // namespace

void add_export_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("export", "Turn density into the files of other programs");
    const auto a = std::make_shared<ExportArguments>();
    command->add_option("SOURCE", a->sources, "Folder of a run; or fog volumes of any program, in order")
        ->required()
        ->type_name("FILE");
    command
        ->add_option("-o,--out", a->out, "Folder to write to: new, or of the same export (default: export)")
        ->type_name("DIR");
    std::string targets, formats;
    for (const ExportPreset& preset : export_presets())
        targets += (targets.empty() ? "" : ", ") + preset.name;
    for (const NamedFormat& format : export_formats())
        formats += (formats.empty() ? "" : ", ") + std::string(format.name);
    for (const NamedWeather& format : weather_formats()) formats += ", " + std::string(format.name);
    command->add_option("--for", a->target, "Preset: " + targets)->type_name("TARGET");
    command->add_option("--to", a->formats, "Format; may be repeated: " + formats)
        ->type_name("FORMAT")
        ->expected(1)
        ->allow_extra_args(false)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    command
        ->add_option_function<std::string>(
            "--layer", [a](const std::string& text) { a->options.layer = text; },
            "A layer by name, each, or all together (default)")
        ->type_name("NAME");
    add_value(
        *command, "--frames", "A..B[/STEP]",
        "Only these frames, by their numbers (of a run from 1, of files as they are named, else from 1)",
        [a](const std::string& text) {
            const std::size_t slash = text.find('/');
            const FrameRange range = parse_frames_from_0(text.substr(0, slash));
            a->options.first_frame = range.first;
            a->options.last_frame = range.last;
            if (slash != text.npos)
                a->options.frame_step = int(parse_integer(text.substr(slash + 1), 1, 1'000'000));
        });
    add_shape_options(*command, a);
    command
        ->add_option("--velocity", a->options.velocity_name,
                     "Write the wind into VDB files as a grid of this name (letters, digits, _)")
        ->type_name("NAME");
    command->add_flag("--zip", a->options.zip, "Compress vti and nvdb by zlib");
    add_value(*command, "--quantise", "BITS", "Values of nvdb: none, fp8 or fp16",
              [a](const std::string& text) {
                  a->options.quantise = word_of<NanoQuantise>(text, {"none", "fp8", "fp16"});
              });
    command->add_flag("--legacy-dds", a->options.legacy_dds,
                      "DDS with the header before DirectX 10 (r8, bc4), as OpenSceneGraph reads it");
    command
        ->add_option("--grid", a->options.grid,
                     "Grid of a foreign file (default: density, else its first fog volume)")
        ->type_name("NAME");
    command->add_flag("--plan", a->plan, "Only say what would be written, and how large it is");
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Writes NAME[_LAYER]_0001.EXT for each frame, NAME.volume.json (sizes, axes, place, times, wind; the "
        "schema is\n"
        "docs/volume.schema.json), README.txt with the steps for the target, and export.json with checksums. "
        "An export\n"
        "that was interrupted goes on with the same command. `nephos verify DIR` reads the files back.\n"
        "\n"
        "Examples:\n"
        "  nephos export out/cumulus --for blender -o cumulus-blender\n"
        "  nephos export out/cumulus --to ktx2 --type bc4 --mips --border zero -o textures\n"
        "  nephos export out/climate --layer each --to raw --type r8 --range auto -o climate-raw\n"
        "  nephos export cloud.vdb --to vti --voxel 50 -o cloud-vtk\n"
        "  nephos export out/cumulus --to dds --budget 64KiB --plan");
    command->callback([a, &action] { action = [a] { return run_command(*a); }; });
}

}  // namespace nephos
