// SPDX-License-Identifier: Apache-2.0
// Checkpoints: as they are, and with the version of the random stream and the hash at their end made right, so that what lies
// behind them is reached, too, and inputs outlive a version. A state that an automaton accepts is one with which it can go on.

#include <cstring>

#include "automaton/automaton.h"
#include "automaton/checkpoint.h"
#include "core/random.h"
#include "tests/fuzz/target.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace nephos;
    std::string bytes(fuzz::as_text(data, size));
    fuzz::accepts([&] { read_checkpoint(fuzz::InputFile(bytes).path()); });
    constexpr std::size_t kVersionAt = 12;  // behind the magic number and the format's version
    if (size < kVersionAt + 4 + 16) return 0;
    const std::uint32_t version = kRandomStreamVersion;
    std::memcpy(bytes.data() + kVersionAt, &version, sizeof version);
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
