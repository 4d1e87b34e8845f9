// SPDX-License-Identifier: Apache-2.0

// The child process that reads untrusted files: whatever it does, this process gets a result or a clear
// error.

#include "density/vdb/sandbox.h"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/error.h"

namespace nephos {
namespace {

// The message of the error that such a child leads to; "" when there is none.
std::string error_of(const std::function<void(SandboxWriter&)>& child, VdbReadLimits limits = {}) {
    try {
        run_sandboxed("subject.vdb", limits, child, [](SandboxReader& reader) { reader.value<int>(); });
    } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::io);
        return error.what();
    }
    return "";
}

TEST(Sandbox, PassesValuesTextsAndLargeData) {
    std::vector<int> sent(3'000'000), got(sent.size());
    std::iota(sent.begin(), sent.end(), 5);
    std::string text;
    run_sandboxed(
        "subject", {},
        [&](SandboxWriter& writer) {
            writer.value(42);
            writer.text("cumulus");
            writer.bytes(sent.data(), sent.size() * sizeof(int));
        },
        [&](SandboxReader& reader) {
            EXPECT_EQ(reader.value<int>(), 42);
            text = reader.text();
            reader.bytes(got.data(), got.size() * sizeof(int));
        });
    EXPECT_EQ(text, "cumulus");
    EXPECT_EQ(got, sent);
}

TEST(Sandbox, ReportsWhatTheChildThrows) {
    EXPECT_EQ(error_of([](SandboxWriter&) { throw std::runtime_error("no such grid"); }),
              "subject.vdb: no such grid");
    // Also after part of the result was sent.
    const auto late = [](SandboxWriter& writer) {
        writer.value(1);
        writer.value(2);
        throw std::runtime_error("late");
    };
    EXPECT_EQ(error_of(late), "subject.vdb: late");
}

TEST(Sandbox, ClampsMessages) {
    const std::string message =
        error_of([](SandboxWriter&) { throw std::runtime_error("\033[31m" + std::string(1'000'000, 'x')); });
    EXPECT_LT(message.size(), 400u);
    EXPECT_EQ(message.find('\033'), std::string::npos);
}

TEST(Sandbox, SurvivesCrashes) {
    const auto crash = error_of([](SandboxWriter&) { std::raise(SIGSEGV); });
    EXPECT_NE(crash.find("signal 11"), std::string::npos) << crash;
    const auto abort = error_of([](SandboxWriter&) { std::abort(); });
    EXPECT_NE(abort.find("signal 6"), std::string::npos) << abort;
    // Neither tells of a damaged file for certain: so does the system end a process when memory is short.
    const auto killed = error_of([](SandboxWriter&) { std::raise(SIGKILL); });
    EXPECT_NE(killed.find("memory is short"), std::string::npos) << killed;
    EXPECT_EQ(killed.find("damaged"), std::string::npos) << killed;
    EXPECT_NE(abort.find("or memory is short"), std::string::npos) << abort;
    EXPECT_NE(error_of([](SandboxWriter&) { ::_exit(3); }), "");
    EXPECT_NE(error_of([](SandboxWriter&) { ::_exit(0); }), "");
}

TEST(Sandbox, EndsWhatRunsTooLong) {
    const auto start = std::chrono::steady_clock::now();
    VdbReadLimits limits;
    limits.seconds = 0.3;
    const auto busy = [](SandboxWriter&) {
        volatile bool forever = true;
        while (forever) {
        }
    };
    EXPECT_EQ(error_of(busy, limits), "subject.vdb: reading it takes longer than allowed");
    const auto asleep = [](SandboxWriter&) { ::pause(); };
    EXPECT_EQ(error_of(asleep, limits), "subject.vdb: reading it takes longer than allowed");
    const auto elapsed = std::chrono::steady_clock::now() - start;
    EXPECT_LT(std::chrono::duration<double>(elapsed).count(), 5.0);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(Sandbox, EndsWhatTakesTooMuchMemory) {
    VdbReadLimits limits;
    limits.memory_bytes = std::size_t{256} << 20;
    const auto greedy = [](SandboxWriter& writer) {
        const std::vector<char> memory(std::size_t{2} << 30, 1);
        writer.value(int(memory.back()));
    };
    const std::string message = error_of(greedy, limits);
    EXPECT_NE(message.find("256 MiB"), std::string::npos) << message;
    const auto modest = [](SandboxWriter& writer) {
        const std::vector<char> memory(std::size_t{64} << 20, 1);
        writer.value(int(memory.back()));
    };
    EXPECT_EQ(error_of(modest, limits), "");
}
#endif

TEST(Sandbox, NoticesAnIncompleteOrOverlongResult) {
    EXPECT_NE(error_of([](SandboxWriter&) {}), "");
    EXPECT_NE(error_of([](SandboxWriter& writer) {
                  writer.value(1);
                  writer.value(2);
              }),
              "");
}

TEST(Sandbox, RejectsMeaninglessLimits) {
    VdbReadLimits limits;
    limits.seconds = 0;
    const auto child = [](SandboxWriter& writer) { writer.value(1); };
    EXPECT_THROW(run_sandboxed("s", limits, child, [](SandboxReader&) {}), Error);
}

}  // namespace
}  // namespace nephos
