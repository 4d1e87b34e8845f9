// SPDX-License-Identifier: Apache-2.0
#pragma once

// Manual pages, generated from the parser itself, so that they cannot drift from it.

#include <string>

#include "apps/nephos/commands.h"

namespace nephos {

// Returns the manual page (section 1, in troff's language with the macros of man(7)) of the whole command, or of one of its
// subcommands, for which `app` is that subcommand.
std::string man_page(const CLI::App& app);

// Adds the command that prints a page, or writes all of them into a folder.
void add_man_command(CLI::App& app, Action& action);

}  // namespace nephos
