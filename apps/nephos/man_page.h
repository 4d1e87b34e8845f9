// SPDX-License-Identifier: Apache-2.0
#pragma once

// Manual pages, generated from the parser itself, so that they cannot drift from it.

#include <string>
#include <vector>

#include "apps/nephos/commands.h"

namespace nephos {

// Holds what a page has beside the description, the options and the footer of a parser.
struct ManPageTexts {
    std::string name;         // of the page: "nephos-run"
    std::string usage;        // one line
    std::string exit_status;  // a section of it, or ""
    std::vector<std::string> see_also;
};

// Returns a manual page (section 1, in troff's language with the macros of man(7)).
std::string man_page(const CLI::App& app, const ManPageTexts& texts);

// Returns that of the whole command, or of one of its subcommands, for which `app` is that subcommand.
std::string man_page(const CLI::App& app);

// Adds the command that prints a page, also that of nephos-editor, or writes all of its own into a folder.
void add_man_command(CLI::App& app, Action& action);

}  // namespace nephos
