// SPDX-License-Identifier: Apache-2.0
#pragma once

// Completion scripts for shells, generated from the parser itself, so that they cannot drift from it.

#include <string>

#include <CLI/CLI.hpp>

namespace nephos {

// `shell` is "bash", "zsh" or "fish"; throws Error(usage) on any other.
std::string completion_script(const CLI::App& app, const std::string& shell);

}  // namespace nephos
