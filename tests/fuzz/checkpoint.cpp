// SPDX-License-Identifier: Apache-2.0
// Checkpoints: as they are, and with the hash at their end made right, so that what lies behind it is reached, too. A
// state that an automaton accepts is one with which it can go on.

#include <cstring>

#include "automaton/automaton.h"
#include "automaton/checkpoint.h"
#include "tests/fuzz/target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    std::string bytes(fuzz::as_text(data, size));
    fuzz::accepts([&] { read_checkpoint(fuzz::InputFile(bytes).path()); });
    if (size < 16) return 0;
    const auto hashed = std::as_bytes(std::span(bytes)).first(size - 16);
    const StateHash hash = hash_of_bytes(hashed);
    std::memcpy(bytes.data() + size - 16, &hash.high, 8);
    std::memcpy(bytes.data() + size - 8, &hash.low, 8);
    fuzz::accepts([&] {
        const Checkpoint checkpoint = read_checkpoint(fuzz::InputFile(bytes).path());
        AutomatonOptions options;
        options.extent = {16, 12, 5};
        Automaton automaton(options);
        automaton.restore(checkpoint.automaton);
        automaton.step();
    });
    return 0;
}
