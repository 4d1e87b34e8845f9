// SPDX-License-Identifier: Apache-2.0

// nephos metar: a scene from a report.

#include <cmath>
#include <memory>
#include <optional>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/atomic_file.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/reader.h"
#include "simulation/metar_fit.h"
#include "simulation/run_folder.h"

namespace nephos {
namespace {

struct MetarArguments {
    std::string report, scene, folder;
    MetarSceneOptions options;
    bool explain = false, lenient = false, run = false, no_render = false, resume = false, overwrite = false;
    WorkArguments work;
};

std::string report_of(const std::string& argument) {
    if (!argument.starts_with('@')) return argument;
    const std::string path = argument.substr(1);
    std::string text = read_beginning(path, 4096);
    if (text.size() == 4096) throw Error(ErrorCode::usage, path + ": is too long for a report");
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    return text.starts_with(kByteOrderMark) ? text.substr(kByteOrderMark.size()) : text;
}

nlohmann::ordered_json explanation_json(const Metar& metar) {
    nlohmann::ordered_json groups = nlohmann::ordered_json::array();
    for (const MetarGroup& group : metar.groups)
        groups.push_back({{"group", group.text}, {"meaning", group.meaning}, {"used", group.used}});
    return groups;
}

void explain(const MetarArguments& a, const Metar& metar) {
    Output output;
    std::vector<std::pair<std::string, std::string>> becomes;
    for (const MetarLayer& layer : layers_of(metar))
        becomes.emplace_back(layer.group,
                             fmt::format("layer {}: {} from {:.0f} to {:.0f} m, cover {:.2f}", layer.name,
                                         layer.genus, layer.base_m, layer.top_m, layer.cover));
    if (a.work.json) {
        nlohmann::ordered_json layers = nlohmann::ordered_json::array();
        for (const MetarLayer& l : layers_of(metar))
            layers.push_back({{"group", l.group},
                              {"name", l.name},
                              {"genus", l.genus},
                              {"base_m", l.base_m},
                              {"top_m", l.top_m},
                              {"cover", l.cover}});
        output.line(json_text({{"report", metar.text},
                               {"groups", explanation_json(metar)},
                               {"layers", layers},
                               {"notes", metar_notes(metar, a.options)}}));
        return;
    }
    for (const MetarGroup& group : metar.groups)
        output.line(
            fmt::format("  {:14} {}{}", group.text, group.meaning, group.used ? "" : " (of no effect)"));
    for (const auto& [group, text] : becomes) output.line(fmt::format("  {:14} -> {}", group, text));
    for (const std::string& note : metar_notes(metar, a.options)) print_note(note);
}

// Says what each period of a forecast is.
void explain(const MetarArguments& a, const Taf& taf) {
    Output output;
    nlohmann::ordered_json periods = nlohmann::ordered_json::array();
    const std::vector<TafLayer> all = layers_of(taf);
    for (std::size_t n = 0; n < taf.periods.size(); ++n) {
        const TafPeriod& period = taf.periods[n];
        std::string layers;
        for (const TafLayer& layer : all)
            if (layer.present[n])
                layers += (layers.empty() ? "" : ", ") + layer.layer.name + " (" + layer.layer.group + ")";
        periods.push_back({{"change", period.change},
                           {"from_s", period.from_s},
                           {"until_s", period.until_s},
                           {"weather", metar_text(period.weather)},
                           {"layers", layers}});
        if (a.work.json) continue;
        output.line(fmt::format("  {:18} {}", period.change.empty() ? "from the beginning" : period.change,
                                layers.empty() ? "no clouds" : layers));
    }
    if (a.work.json) {
        output.line(json_text({{"forecast", taf.text},
                               {"length_s", taf.length_s},
                               {"periods", periods},
                               {"notes", taf_notes(taf, a.options)}}));
        return;
    }
    for (const std::string& note : taf_notes(taf, a.options)) print_note(note);
}

void require_content(const Metar& report) {
    if (!tells_nothing(report)) return;
    throw Error(
        ErrorCode::usage,
        "the report tells nothing but place and time: expected wind, visibility, weather or clouds\n  " +
            report.text + "\n  " + std::string(report.text.size(), ' ') + "^");
}

// Throws as it would without --explain where the date or the name fit no scene.
void check_options(const MetarArguments& a, const std::optional<Taf>& taf, const Metar& report) {
    const auto whole = [](std::size_t layers) { return std::vector<double>(layers, 1.0); };
    const std::string text = taf ? taf_scene_text(*taf, a.options, whole(layers_of(*taf).size()))
                                 : metar_scene_text(report, a.options, whole(layers_of(report).size()));
    read_scene_text(text, taf ? "the scene of the forecast" : "the scene of the report");
}

// Throws Error(usage) when another text stands in the file, as a scene of the user's own or one that was tuned by hand.
void write_scene(const MetarArguments& a, std::string_view text) {
    const bool may_be_lost = !a.overwrite && type_behind(a.scene) == std::filesystem::file_type::regular;
    if (may_be_lost && read_beginning(a.scene, text.size() + 1) != text)
        throw Error(ErrorCode::usage, a.scene +
                                          ": is there, and is not the scene of this command: expected the "
                                          "name of another file, or --overwrite, which replaces it");
    write_atomically(a.scene, text);
}

int metar(const MetarArguments& a) {
    if (a.overwrite && a.scene.empty() && !a.run)
        throw Error(ErrorCode::usage, "--overwrite requires --scene or --run");
    if (a.explain && (a.run || !a.scene.empty()))
        throw Error(ErrorCode::usage, "--explain only tells: leave out --scene and --run, or it");
    if (a.resume && a.overwrite) throw Error(ErrorCode::usage, "--resume and --overwrite exclude each other");
    const std::string text = report_of(a.report);
    if (a.report.starts_with('@')) refuse_to_replace(a.report.substr(1), a.scene);
    if (!a.scene.empty()) refuse_to_replace_listed_file(a.scene);
    std::optional<Taf> taf;
    Metar report;
    try {
        if (is_taf(text)) {
            taf = parse_taf(text, a.lenient, a.options.date);
            report.text = taf->text;
            report.station = taf->station;
        } else {
            report = parse_metar(text, a.lenient);
            require_content(report);
        }
    } catch (const Error& error) {
        if (!a.report.starts_with('@')) throw;
        throw Error(error.code(), a.report.substr(1) + ": " + error.what());
    }
    if (a.explain) {
        check_options(a, taf, report);
        taf ? explain(a, *taf) : explain(a, report);
        return 0;
    }
    start_threads(a.work.threads);
    const FittedScene fitted = taf ? fit_taf(*taf, a.options) : fit_metar(report, a.options);
    Scene scene = read_scene_text(fitted.text, "the scene of the report");
    Output output;
    if (!a.work.quiet)
        for (const std::string& note : fitted.notes) print_note(note);
    if (!a.scene.empty()) write_scene(a, fitted.text);
    nlohmann::ordered_json json;
    if (a.work.json) {
        nlohmann::ordered_json layers = nlohmann::ordered_json::array();
        for (const FittedLayer& l : fitted.layers)
            layers.push_back({{"group", l.layer.group},
                              {"name", l.layer.name},
                              {"wanted", l.layer.cover},
                              {"cover", l.cover},
                              {"least_cover", l.least_cover},
                              {"most_cover", l.most_cover},
                              {"coverage", l.coverage},
                              {"tries", l.tries}});
        json = {{"report", report.text}, {"scene", a.scene}, {"layers", layers}, {"notes", fitted.notes}};
        if (a.scene.empty()) json["text"] = fitted.text;
        if (!a.run) output.line(json_text(json));
    } else if (a.scene.empty() && !a.run) {
        output.write(fitted.text);
    } else if (!a.work.quiet) {
        for (const FittedLayer& l : fitted.layers)
            output.line(fmt::format("  {:10} {}: cover {:.2f}, {:.2f} wanted", l.layer.group, l.layer.name,
                                    l.cover, l.layer.cover));
    }
    if (!a.run) return 0;
    RunSettings settings =
        run_settings(std::move(scene), a.scene.empty() ? report.station + ".toml" : a.scene);
    if (!a.folder.empty()) settings.folder = a.folder;
    settings.render = !a.no_render;
    settings.resume = a.resume;
    settings.overwrite = a.overwrite;
    defer_signals();
    std::unique_ptr<ProgressBar> bar;
    RunObserver observer;
    observer.progress = [&](const RunProgress& p) {
        if (!bar) bar = std::make_unique<ProgressBar>("step", p.steps, p.steps_in_all, !a.work.quiet);
        bar->update(p.steps, fmt::format("frame {}/{}", p.frames, p.frames_in_all));
    };
    observer.stop = [] { return pending_signal() != 0; };
    const RunReport result = run_scene(std::move(settings), observer);
    bar.reset();
    if (a.work.json) {
        json["run"] = {
            {"folder", result.folder.string()}, {"frames", result.frames}, {"complete", result.complete}};
        output.line(json_text(json));
    }
    if (!a.work.quiet && !a.work.json)
        output.line(fmt::format("{}: {} frames in {}", result.scene, result.frames, result.folder.string()));
    return result.complete ? 0 : 128 + pending_signal();
}

}  // namespace

void add_metar_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand(
        "metar", "Make the sky of an aerodrome's weather report (METAR, SPECI) or forecast (TAF)");
    const auto a = std::make_shared<MetarArguments>();
    command
        ->add_option("REPORT", a->report,
                     "The report in quotes, or @FILE with one; a forecast begins with TAF")
        ->required()
        ->type_name("REPORT");
    command->add_option("-o,--scene", a->scene, "Write the scene to this file (default: print it)")
        ->type_name("FILE");
    command->add_flag("--explain", a->explain, "Only say what each group means and becomes");
    CLI::Option* run = command->add_flag("--run", a->run, "Also simulate the scene and draw it");
    command->add_option("--out", a->folder, "Folder of the run (default: out/NAME)")
        ->type_name("DIR")
        ->needs(run);
    command->add_flag("--no-render", a->no_render, "No pictures, only density grids and statistics")
        ->needs(run);
    command->add_flag("--resume", a->resume, "Go on with the interrupted run in the folder")->needs(run);
    command->add_flag("--overwrite", a->overwrite,
                      "Replace another scene in the file, and remove the run in the folder first");
    command
        ->add_option(
            "--date", a->options.date,
            "Month in which the report was issued, such as 2024-06, as it has only the day: for the sun")
        ->type_name("YYYY-MM");
    add_value(*command, "--at", "LAT,LON,M", "Place of the aerodrome, degrees, and its elevation in metres",
              [a](const std::string& text) {
                  const std::vector<double> numbers = parse_reals(text, 3, -500, 9000);
                  if (std::abs(numbers[0]) > 90)
                      throw Error(ErrorCode::usage, "'" + text + "' has a latitude beyond 90 degrees");
                  if (std::abs(numbers[1]) > 180)
                      throw Error(ErrorCode::usage, "'" + text + "' has a longitude beyond 180 degrees");
                  a->options.place = MetarPlace{numbers[0], numbers[1], numbers[2]};
              });
    command->add_option("--name", a->options.name, "Name of the scene (default: the aerodrome's)")
        ->type_name("NAME");
    add_value(*command, "--seed", "N", "Seed of the clouds (default: 1)",
              [a](const std::string& text) { a->options.seed = int(parse_integer(text, 0, 1'000'000'000)); });
    command->add_flag("--lenient", a->lenient, "Leave out groups that cannot be read, with a note");
    add_threads(*command, a->work);
    add_json(*command, a->work);
    add_quiet(*command, a->work);
    command->footer(
        "Each cloud group becomes a layer whose optical cover is met within half an okta; wind, visibility,\n"
        "fog, rain, snow and thunderstorms become those of the scene; what is left out is listed. The clock "
        "of\n"
        "this machine is never used. A TAF becomes a climate: its periods are states, layers come and go, "
        "each with\n"
        "its cover on average over its time, and an hour is a second of film.\n"
        "\n"
        "Examples:\n"
        "  nephos metar \"EGLL 211350Z 24012KT 9999 FEW020 SCT045 BKN200 14/08 Q1017\" --explain\n"
        "  nephos metar \"EGLL 211350Z 24012KT 9999 SCT045 14/08 Q1017\" -o egll.toml --date 2024-06 \\\n"
        "               --at 51.4775,-0.4614,25\n"
        "  nephos metar @report.txt --run --out out/egll\n"
        "  nephos metar \"TAF EGLL 2112/2218 24012KT 9999 FEW020 BECMG 2115/2118 BKN030\" -o egll.toml");
    command->callback([a, &action] { action = [a] { return metar(*a); }; });
}

}  // namespace nephos
