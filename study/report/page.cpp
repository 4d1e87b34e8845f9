// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "study/report.h"
#include "study/report/assets.h"
#include "study/report/curves.h"
#include "study/report/maps.h"
#include <fmt/format.h>

#include "core/atomic_file.h"
#include "core/random.h"
#include "core/text.h"
#include "simulation/simulation.h"

namespace nephos {
namespace report {
namespace {

constexpr std::size_t kMaxProblems = 100, kMaxRows = 2000;

std::string section(std::string_view title, std::string_view content) {
    return content.empty() ? std::string() : fmt::format("<h2>{}</h2>\n{}", title, content);
}

std::string link_to(const ReportData& data, const ReportPoint& point) {
    return fmt::format("<a href=\"#p{}\">{}</a>", point.summary.point, html(point.name(data.plan)));
}

// What the reader must know before any mean: failed and missing runs, points without means, errors that disagree.
std::string problems(const ReportData& data) {
    std::string text, failed, unsteady, differ, wide;
    std::size_t failed_runs = 0, missing_runs = 0, unsteady_points = 0, differing_points = 0, wide_points = 0;
    for (const ReportPoint& point : data.points) {
        missing_runs += point.summary.missing;
        for (std::size_t n = 0; n < point.runs.size(); ++n) {
            if (point.records[n] == nullptr || !point.records[n]->failed) continue;
            if (failed_runs++ < kMaxProblems)
                failed += fmt::format("<li>{}, replicate {}: <b>{}</b></li>\n", link_to(data, point), n,
                                      html(point.records[n]->message));
        }
        const std::uint32_t runs = point.summary.regimes[std::size_t(Regime::not_steady)];
        if (runs > 0 && unsteady_points++ < kMaxProblems)
            unsteady +=
                fmt::format("<li>{}: {} of {} runs</li>\n", link_to(data, point), runs, point.summary.runs);
        if (point.mean("cover").errors_differ && differing_points++ < kMaxProblems) {
            const PointMean& cover = point.mean("cover");
            differ += fmt::format("<li>{}: cover {}, between seeds {}, within runs {}</li>\n",
                                  link_to(data, point), number_text(cover.mean, 4),
                                  number_text(cover.error, 2), number_text(cover.error_within, 2));
        }
        if (has_wide_interval(point.summary) && wide_points++ < kMaxProblems) {
            const PointMean& cover = point.mean("cover");
            wide += fmt::format("<li>{}: cover {}, 95 % interval {} to {}</li>\n", link_to(data, point),
                                number_text(cover.mean, 3), number_text(cover.low, 3),
                                number_text(cover.high, 3));
        }
    }
    const auto list = [](const std::string& items, std::size_t all) {
        return fmt::format(
            "<ul>\n{}{}</ul></div>\n", items,
            all > kMaxProblems ? fmt::format("<li>and {} more</li>\n", all - kMaxProblems) : "");
    };
    if (failed_runs > 0)
        text += fmt::format(
                    "<div class=\"problem\"><p>{} runs failed; <code>nephos sweep sweep.toml --retry-failed "
                    "--out .</code> "
                    "runs them again.</p>",
                    failed_runs) +
                list(failed, failed_runs);
    if (missing_runs > 0)
        text += fmt::format(
            "<div class=\"problem\"><p>{} runs are missing; <code>nephos sweep sweep.toml --out .</code> "
            "runs "
            "them.</p></div>\n",
            missing_runs);
    if (unsteady_points > 0)
        text +=
            fmt::format(
                "<div class=\"problem\"><p>{} points have runs that are not steady, and therefore no mean; "
                "more steps may help.</p>",
                unsteady_points) +
            list(unsteady, unsteady_points);
    if (differ.size() > 0)
        text += fmt::format(
                    "<div class=\"problem\"><p>At {} points the standard errors of cover between seeds and "
                    "within "
                    "runs differ 3-fold: the replicates are in phase, or there are too few of them.</p>",
                    differing_points) +
                list(differ, differing_points);
    if (wide_points > 0)
        text += fmt::format(
                    "<div class=\"problem\"><p>At {} points cover is uncertain by more than a tenth of its "
                    "mean (hatched in "
                    "the maps): more replicates or steps make the interval narrower.</p>",
                    wide_points) +
                list(wide, wide_points);
    if (text.empty())
        text =
            "<p class=\"good\">Every run was done, every point has a mean that is certain to a tenth of it, "
            "and its two errors agree.</p>\n";
    return text;
}

std::string what_was_run(const ReportData& data) {
    const SweepPlan& plan = data.plan;
    const SweepOptions& options = plan.options();
    std::size_t done = 0, failed = 0;
    std::array<std::uint64_t, 6> regimes{};
    std::uint64_t steps = 0;
    for (const ReportPoint& point : data.points) {
        done += point.summary.runs;
        failed += point.summary.failed;
        for (std::size_t n = 0; n < regimes.size(); ++n) regimes[n] += point.summary.regimes[n];
        for (const RunRecord* record : point.records)
            if (record != nullptr && !record->failed) steps += record->result.steps;
    }
    const auto& [x, y, z] = data.lattice.extent;
    std::string text = fmt::format(
        "<table>\n<tr><th>Runs</th><td>{} points ({}) x {} replicates = {} runs: {} done, {} failed, {} "
        "missing</td></tr>\n"
        "<tr><th>Steps</th><td>{} to {} a run, {} in all</td></tr>\n"
        "<tr><th>Lattice</th><td>{} x {} x {} cells of {} m{}</td></tr>\n",
        plan.points(), design_name(options.design), options.replicates, plan.runs(), done, failed,
        plan.runs() - done - failed, options.steps.min, options.steps.max, steps, x, y, z,
        number_text(data.lattice.placement.cell_size_m),
        options.layer.empty() ? "" : fmt::format(", layer <code>{}</code>", html(options.layer)));
    for (const Axis& axis : options.axes)
        text += fmt::format("<tr><th>Axis</th><td><code>{}</code>: {}</td></tr>\n",
                            html(fmt::format("{}", fmt::join(axis.keys, "+"))),
                            axis.values.empty()
                                ? fmt::format("{} to {}", number_text(axis.from), number_text(axis.to))
                                : html(fmt::format("{}", fmt::join(axis.values, ", "))));
    text += "<tr><th>Regimes</th><td>";
    for (std::size_t n = 0; n < regimes.size(); ++n)
        if (regimes[n] > 0) text += fmt::format("{} {} &nbsp; ", regimes[n], regime_name(Regime(n)));
    text += "</td></tr>\n</table>\n";
    return text +
           fmt::format(
               "<details><summary>The plan, <code>sweep.toml</code></summary><pre>{}</pre></details>\n"
               "<details><summary>The scene, <code>scene.toml</code></summary><pre>{}</pre></details>\n",
               html(plan.to_toml_in(options.scene_file.parent_path())),
               html(plan.scene_text_in(options.scene_file.parent_path())));
}

std::string regimes(const ReportData& data) {
    const std::string map = regime_map(data);
    if (map.empty()) return {};
    return regime_legend() + map +
           "<p>A cell or dot is a point, its number the mean cover; each leads to the point's row "
           "below.</p>\n";
}

std::string axes(const ReportData& data) {
    std::string text;
    for (std::size_t n = 0; n < data.plan.options().axes.size(); ++n)
        text += fmt::format("<h3>{}</h3>\n",
                            html(fmt::format("{}", fmt::join(data.plan.options().axes[n].keys, "+")))) +
                along_axis(data, n);
    if (text.empty()) return {};
    return text +
           "<p>Bars are 95 % intervals of the mean by Student's t over the replicates. In a grid a line "
           "joins points "
           "that differ in this axis alone, dark blue to yellow in the order of the other axes.</p>\n";
}

std::string row(const ReportData& data, const ReportPoint& point) {
    std::string text = fmt::format("<tr id=\"p{}\"><td>{}</td>", point.summary.point, point.summary.point);
    for (const std::string& value : point.summary.values) text += fmt::format("<td>{}</td>", html(value));
    text += "<td>";
    for (std::size_t n = 0; n < point.summary.regimes.size(); ++n)
        if (point.summary.regimes[n] > 0)
            text += fmt::format("{} {}<br>", point.summary.regimes[n], regime_name(Regime(n)));
    if (point.summary.failed > 0) text += fmt::format("{} failed<br>", point.summary.failed);
    if (point.summary.missing > 0) text += fmt::format("{} missing", point.summary.missing);
    text += "</td>";
    for (const std::string_view name : {"cover", "cloud_fraction", "lifetime_s"})
        text += fmt::format("<td>{}</td>", value_text(point.mean(name)));
    text += "<td><details><summary>commands</summary><pre>";
    for (std::size_t n = 0; n < point.runs.size(); ++n) {
        const RunRecord* record = point.records[n];
        const bool done = record != nullptr && !record->failed;
        text += html(data.plan.command_of(point.runs[n],
                                          done ? record->result.steps : data.plan.options().steps.max)) +
                '\n';
    }
    return text + "</pre></details></td></tr>\n";
}

std::string table(const ReportData& data) {
    std::string text =
        "<p>A command repeats its run in this folder: it takes the same steps to the same state hash, the "
        "last one of its "
        "<code>statistics.csv</code>.</p>\n<div class=\"wide\"><table>\n<tr><th>point</th>";
    for (const Axis& axis : data.plan.options().axes)
        text += fmt::format("<th>{}</th>", html(fmt::format("{}", fmt::join(axis.keys, "+"))));
    text += "<th>regimes</th><th>cover</th><th>cloud_fraction</th><th>lifetime_s</th><th>repeat</th></tr>\n";
    for (std::size_t n = 0; n < std::min(data.points.size(), kMaxRows); ++n)
        text += row(data, data.points[n]);
    text += "</table></div>\n";
    if (data.points.size() > kMaxRows)
        text += fmt::format(
            "<p>The first {} of {} points; <code>points.csv</code> and <code>runs.csv</code> have all.</p>\n",
            kMaxRows, data.points.size());
    return text;
}

}  // namespace
}  // namespace report

std::string report_page(const SweepPlan& plan, const Records& records) {
    using namespace report;
    const ReportData data = gather(plan, records);
    const std::string title =
        html("Sweep of " + (plan.scene().name.empty() ? std::string("a scene") : plan.scene().name));
    std::string page(kReportBeginning);
    page += fmt::format("<title>{}</title>\n<style>\n{}\n{}</style>\n</head>\n<body>\n", title, kPlotCss,
                        kPageCss);
    page +=
        "<svg width=\"0\" height=\"0\" style=\"position:absolute\"><defs><pattern id=\"hatch\" width=\"6\" "
        "height=\"6\" "
        "patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\"><path d=\"M0 0V6\" stroke=\"#fffb\" "
        "stroke-width=\"3\"/></pattern></defs></svg>\n";
    page += fmt::format(
        "<h1>{}</h1>\n<p>nephos {}, random stream {}. Words and columns are explained in docs/research.md of "
        "nephos.</p>\n",
        title, html(version()), kRandomStreamVersion);
    page += section("What needs care", problems(data));
    page += section("What was run", what_was_run(data));
    page += section("Regimes", regimes(data));
    page += section("Along the axes", axes(data));
    page += section("Profiles and sizes", profiles(data) + sizes(data));
    page += section("All at once", parallel_coordinates(data));
    page += section("Over time", series(data));
    page += section("Last states", thumbnails(data));
    page += section("Points, and how to repeat each run", table(data));
    page += fmt::format("<script>\n/* uPlot\n{}*/\n{}\n{}</script>\n</body>\n</html>\n", kPlotLicence,
                        kPlotJs, kPageJs);
    return page;
}

void write_report(const SweepPlan& plan, const Records& records, const std::filesystem::path& path) {
    write_atomically(path, report_page(plan, records));
}

}  // namespace nephos
