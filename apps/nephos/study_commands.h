// SPDX-License-Identifier: Apache-2.0
#pragma once

// Commands that look at the results of studies, and at clouds of others.

#include "apps/nephos/commands.h"

namespace nephos {

void add_report_command(CLI::App& app, Action& action);
void add_stats_command(CLI::App& app, Action& action);

}  // namespace nephos
