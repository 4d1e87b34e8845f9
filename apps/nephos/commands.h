// SPDX-License-Identifier: Apache-2.0
#pragma once

// The subcommands of `nephos`. Each function adds one to the parser, with its options; when it is chosen,
// parsing leaves in `action` what main() is to do. The action returns the exit status, or throws.

#include <functional>

#include <CLI/CLI.hpp>

namespace nephos {

using Action = std::function<int()>;

void add_run_command(CLI::App& app, Action& action);
void add_render_command(CLI::App& app, Action& action);
void add_validate_command(CLI::App& app, Action& action);
void add_info_command(CLI::App& app, Action& action);
void add_hash_command(CLI::App& app, Action& action);
void add_state_command(CLI::App& app, Action& action);
void add_completion_command(CLI::App& app, Action& action);

// All of them, with --help and --version.
void add_commands(CLI::App& app, Action& action);

}  // namespace nephos
