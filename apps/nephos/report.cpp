// SPDX-License-Identifier: Apache-2.0

// nephos report: a sweep as one page.

#include "study/report.h"

#include <filesystem>
#include <memory>
#include <system_error>

#include "study/folder_contents.h"
#include "study/sweep.h"
#include <fmt/format.h>

#include "apps/nephos/arguments.h"
#include "apps/nephos/study_commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "core/paths.h"
#include "simulation/layer_simulation.h"

namespace nephos {
namespace {

struct ReportArguments {
    std::vector<std::string> folders;
    std::string out;
    WorkArguments work;
};

// Returns whether a file is there and holds nothing, as mktemp leaves it. Throws nothing.
bool is_empty_file(const std::filesystem::path& path) {
    std::error_code error;
    return std::filesystem::is_regular_file(path, error) && std::filesystem::file_size(path, error) == 0 &&
           !error;
}

// Throws Error(usage) for a file of the sweep itself, of which some are empty for a while.
void require_none_of_sweep(const std::filesystem::path& folder, const std::filesystem::path& out) {
    std::vector<std::filesystem::path> files{folder / "timing.csv"};
    for (const std::string& name : names_in_folder(folder / "shards"))
        files.push_back(folder / "shards" / name);
    for (const std::filesystem::path& file : files)
        if (is_same_place(file, out)) require_absent(out, "`nephos report`");
}

int report(const ReportArguments& a) {
    start_threads(1);
    const SweepPlan plan = plan_of_folder(a.folders.front());
    const Records records =
        records_of_folders(plan, std::vector<std::filesystem::path>(a.folders.begin(), a.folders.end()));
    if (records.size() == 0 && !records.problems().empty())
        throw Error(ErrorCode::io, records.problems().front());
    if (records.size() == 0)
        throw Error(ErrorCode::usage,
                    a.folders.front() +
                        ": no run of this sweep is done yet, or its records are elsewhere: tables that `nephos "
                        "merge` made are shown by `nephos report` of the folders that were merged");
    const std::filesystem::path out = a.out.empty() ? std::filesystem::path(a.folders.front()) / "report.html"
                                                    : std::filesystem::path(a.out);
    for (const std::string& folder : a.folders) require_none_of_sweep(folder, out);
    if (!is_empty_file(out)) require_own(out, kReportBeginning, "`nephos report`");
    write_report(plan, records, out);
    print_problems(records.problems());
    std::uint64_t missing = 0;
    for (std::uint64_t n = 0; n < plan.runs(); ++n) missing += records.find(plan.run(n).id) == nullptr;
    if (missing > 0 && !a.work.quiet)
        print_note(fmt::format("{} of {} runs are missing in the page", missing, plan.runs()));
    if (!a.work.quiet)
        Output().line(fmt::format("{}  one page, without network: open it in a browser", out.string()));
    return records.problems().empty() ? 0 : int(ErrorCode::io);
}

}  // namespace

void add_report_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("report", "Show a sweep as one HTML page");
    const auto a = std::make_shared<ReportArguments>();
    command
        ->add_option("DIR", a->folders, "Folders of the sweep or its shards; the plan is that of the first")
        ->required()
        ->type_name("DIR");
    command->add_option("-o,--out", a->out, "File to write (default: report.html in the first folder)")
        ->type_name("FILE");
    add_quiet(*command, a->work);
    command->footer(
        "What went wrong comes first, then regimes, statistics along each axis with 95 % intervals, "
        "profiles,\n"
        "sizes of clouds, cover over time, pictures, and the command that repeats each run. The page loads\n"
        "nothing and works without scripts; with them the curves over time zoom. Runs that are missing or "
        "not\n"
        "steady are no obstacle: a sweep can be looked at while it goes on.\n"
        "\n"
        "Examples:\n"
        "  nephos report sweep\n"
        "  nephos report host-a/sweep host-b/sweep -o both.html");
    command->callback([a, &action] { action = [a] { return report(*a); }; });
}

}  // namespace nephos
