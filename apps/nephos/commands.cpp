// SPDX-License-Identifier: Apache-2.0
#include "apps/nephos/commands.h"

#include <memory>

#include <fmt/format.h>

#include "apps/nephos/man_page.h"
#include "apps/nephos/study_commands.h"
#include "core/random.h"
#include "simulation/simulation.h"

namespace nephos {

void add_commands(CLI::App& app, Action& action, const EditFunction& edit) {
    app.name("nephos");
    app.description("Grows clouds in a cellular automaton, and turns them into density grids and pictures.");
    app.formatter(std::make_shared<HelpPage>());
    app.set_help_flag("-h,--help", "This page; after a command, the command's page")->group("General");
    app.set_version_flag("-V,--version",
                         fmt::format("nephos {} (random stream {})", version(), kRandomStreamVersion),
                         "Version of nephos and of its random stream")
        ->group("General");
    app.footer(
        "Examples:\n"
        "  nephos run scenes/cumulus.toml --out out/cumulus     density grids, pictures, statistics\n"
        "  nephos run scenes/cumulus.toml --no-render --seed 7  the same without pictures, another seed\n"
        "  nephos render cloud.vdb --out cloud.png              a picture of any fog volume\n"
        "  nephos sweep fair.toml --axis field.background.ext=0.05,0.1,0.2   tables of many runs\n"
        "  nephos validate my-scene.toml                        every problem of a scene at once\n"
        "  nephos edit scenes/cumulus.toml                      a window: change the scene and watch it "
        "live\n"
        "\n"
        "Exit status: 0 done, 1 a check failed, 2 usage or scene, 3 input or output, 4 GPU,\n"
        "             130 stopped by Ctrl-C, 143 by SIGTERM, 129 by SIGHUP. Results go to stdout, messages "
        "to stderr.");
    app.require_subcommand(1);
    add_run_command(app, action);
    add_render_command(app, action);
    add_sweep_command(app, action);
    add_merge_command(app, action);
    add_report_command(app, action);
    add_fit_command(app, action);
    add_stats_command(app, action);
    add_validate_command(app, action);
    add_info_command(app, action);
    add_hash_command(app, action);
    add_state_command(app, action);
    add_export_command(app, action);
    add_metar_command(app, action);
    add_verify_command(app, action);
    add_edit_command(app, action, edit);
    add_completion_command(app, action);
    add_man_command(app, action);
    for (CLI::App* sub : app.get_subcommands({})) {
        sub->formatter(std::make_shared<HelpPage>());
        sub->set_help_flag("-h,--help", "This page")->group("General");
    }
}

}  // namespace nephos
