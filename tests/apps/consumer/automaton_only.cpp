// SPDX-License-Identifier: Apache-2.0

// Prints the state hash after some steps.

#include <cstdio>

#include "automaton/automaton.h"

int main() {
    nephos::AutomatonOptions options;
    options.extent = {64, 64, 32};
    options.seed = 7;
    options.field.background = {0.1, 0.001, 0.02};
    nephos::Automaton automaton(options);
    for (int n = 0; n < 20; ++n) automaton.step();
    std::printf("%s\n", automaton.hash().hex().c_str());
}
