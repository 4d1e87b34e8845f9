// SPDX-License-Identifier: Apache-2.0
// FAULT [in-child]: commits one fault of the kind that a sanitizer is there to notice, in the process that reads a foreign file if
// asked to, and ends with 0 if nobody does, with 3 if what a sanitizer reported there is taken for an error of the file. Compiled
// by sanitizers_test.py with the flags of each preset; nothing else may call it.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string_view>
#include <thread>
#include <vector>

#include "core/error.h"
#include "density/vdb/sandbox.h"

namespace {

// Numbers and places that the compiler cannot know, so that it keeps the fault.
volatile int hidden = 0;
volatile char seen = 0;

void heap_overflow() {
    std::vector<char> bytes(std::size_t(16 + hidden));
    seen = bytes.data()[16 + hidden];
}

void stack_overflow() {
    char bytes[16] = {};
    const char* volatile place = bytes;
    seen = place[16 + hidden];
}

void use_after_free() {
    char* const bytes = new char[16];
    bytes[0] = char(hidden);
    delete[] bytes;
    seen = static_cast<volatile char*>(bytes)[hidden];
}

void leak() {
    static volatile std::uintptr_t lost;
    lost = reinterpret_cast<std::uintptr_t>(std::malloc(100));
    lost = 0;
}

void uninitialised() {
    char* const bytes = static_cast<char*>(std::malloc(16));
    if (static_cast<volatile char*>(bytes)[hidden] == 7) seen = 1;
    std::free(bytes);
}

void signed_overflow() { seen = char(std::numeric_limits<int>::max() + (1 + hidden)); }

void shift() { seen = char(1 << (40 + hidden)); }

void misaligned() {
    alignas(8) char bytes[16] = {};
    seen = char(*reinterpret_cast<const int*>(bytes + 1 + hidden));  // NOLINT
}

void float_cast() {
    volatile float large = 1.0e20f;
    seen = char(int(large));
}

void race() {
    int count = 0;
    std::thread other([&] {
        for (int n = 0; n < 1000; ++n) ++count;
    });
    for (int n = 0; n < 1000; ++n) ++count;
    other.join();
    seen = char(count);
}

constexpr struct {
    std::string_view name;
    void (*commit)();
} kFaults[] = {{"heap-overflow", heap_overflow},
               {"stack-overflow", stack_overflow},
               {"use-after-free", use_after_free},
               {"leak", leak},
               {"uninitialised", uninitialised},
               {"signed-overflow", signed_overflow},
               {"shift", shift},
               {"misaligned", misaligned},
               {"float-cast", float_cast},
               {"race", race}};

}  // namespace

int main(int count, char** arguments) {
    const bool in_child = count == 3 && std::string_view(arguments[2]) == "in-child";
    for (const auto& fault : kFaults) {
        if (count < 2 || (count > 2 && !in_child) || fault.name != arguments[1]) continue;
        if (!in_child) {
            fault.commit();
            return 0;
        }
        const auto child = [&](nephos::SandboxWriter& writer) {
            fault.commit();
            writer.value(1);
        };
        try {
            nephos::run_sandboxed("a file", "a parser", {}, {}, child,
                                  [](nephos::SandboxReader& reader) { reader.value<int>(); });
        } catch (const nephos::Error& error) {
            std::fputs(error.what(), stderr);
            return 3;
        }
        return 0;
    }
    std::fputs("seeded_faults FAULT [in-child]\n", stderr);
    return 2;
}
