// SPDX-License-Identifier: Apache-2.0
#pragma once

// The text of --help: one page a command, wrapped to the terminal.

#include <string>

#include <CLI/CLI.hpp>

namespace nephos {

class HelpPage : public CLI::FormatterBase {
  public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

// "-o, --out DIR" for an option, "SCENE" for a positional.
std::string option_label(const CLI::Option& option);

// "nephos run SCENE [options]"
std::string usage_line(const CLI::App& app);

}  // namespace nephos
