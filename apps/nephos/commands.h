// SPDX-License-Identifier: Apache-2.0
#pragma once

// The subcommands of `nephos`. Each function adds one to the parser, with its options; when it is chosen,
// parsing leaves in `action` what main() is to do. The action returns the exit status, or throws.

#include <functional>
#include <string>

#include <CLI/CLI.hpp>

namespace nephos {

using Action = std::function<int()>;

// What `nephos edit` was called with (apps/editor/editor.h explains it).
struct EditArguments {
    std::string scene, screenshot, script, theme, device;
    double after_s = 3, scale = 0;
    int width = 0, height = 0;
    bool report = false, validation = false;
};
// Opens the editor's window; returns the exit status.
using EditFunction = std::function<int(const EditArguments&)>;

// Becomes the program nephos-editor, which stands beside this one or in the path: the command itself needs no window and
// no Vulkan. Throws Error(usage) naming the packages to install where it was not built.
int start_editor_program(const EditArguments& arguments);

// Parses a command line and does what it says; the only place where exceptions end. Returns the exit status.
int run_program(int argc, const char* const* argv, const EditFunction& edit);

void add_run_command(CLI::App& app, Action& action);
void add_sweep_command(CLI::App& app, Action& action);
void add_fit_command(CLI::App& app, Action& action);
void add_merge_command(CLI::App& app, Action& action);
void add_render_command(CLI::App& app, Action& action);
void add_validate_command(CLI::App& app, Action& action);
void add_info_command(CLI::App& app, Action& action);
void add_hash_command(CLI::App& app, Action& action);
void add_state_command(CLI::App& app, Action& action);
void add_verify_command(CLI::App& app, Action& action);
void add_export_command(CLI::App& app, Action& action);
void add_metar_command(CLI::App& app, Action& action);
void add_completion_command(CLI::App& app, Action& action);
void add_edit_command(CLI::App& app, Action& action, const EditFunction& edit);

// Adds all of them, with --help and --version.
void add_commands(CLI::App& app, Action& action, const EditFunction& edit = &start_editor_program);

// The text of --help: one page a command, wrapped to the terminal.
class HelpPage : public CLI::FormatterBase {
  public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

// Returns "-o, --out DIR" for an option, "SCENE" for a positional.
std::string option_label(const CLI::Option& option);

// Returns "nephos run SCENE [options]", "nephos COMMAND [options]", or that of a program without commands.
std::string usage_line(const CLI::App& app);

// Completion scripts for shells, generated from the parser itself, so that they cannot drift from it.

// `shell` is "bash", "zsh" or "fish"; throws Error(usage) on any other.
std::string completion_script(const CLI::App& app, const std::string& shell);

// Ctrl-C, SIGTERM and SIGHUP: the first asks for an orderly end (finish the step, leave a checkpoint), the second,
// unless it comes within 0.3 s, ends the process at once. Also makes failed writes visible as errors where the default is a silent death.

// Installs the handlers; call once at the start of main(). SIGPIPE and SIGXFSZ are ignored, so that a closed
// pipe and a file-size limit appear as EPIPE and EFBIG at the write that met them.
void install_signal_handlers();

// Makes the first SIGINT, SIGTERM or SIGHUP from now on only be remembered; until this is called it ends the process at
// once, since there is nothing to save.
void defer_signals();

// The signal that asked for an end, or 0. Async-signal-safe and thread-safe.
int pending_signal();

}  // namespace nephos
