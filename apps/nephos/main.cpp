// SPDX-License-Identifier: Apache-2.0

// The `nephos` command.

#include "apps/nephos/commands.h"

int main(int argc, char** argv) { return nephos::run_program(argc, argv, &nephos::start_editor_program); }
