// SPDX-License-Identifier: Apache-2.0

// The child process that reads untrusted files: whatever it does, this process gets a result or a clear
// error.

#include "density/vdb/sandbox.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <numeric>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <tbb/parallel_for.h>
#include <tbb/tbb_allocator.h>
#include <unistd.h>

#include "core/descriptor.h"
#include "core/error.h"
#include "core/threads.h"
#include "density/vdb/sanitized.h"

namespace nephos {
namespace {

// The message of the error that such a child leads to; "" when there is none.
std::string error_of(const std::function<void(SandboxWriter&)>& child, SandboxLimits limits = {}) {
    try {
        run_sandboxed("subject.vdb", "OpenVDB", limits, {}, child, [](SandboxReader& reader) { reader.value<int>(); });
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
        "subject", "OpenVDB", {}, {},
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
    SandboxLimits limits;
    limits.seconds = 0.3;
    const auto busy = [](SandboxWriter&) {
        volatile bool forever = true;
        while (forever) {
        }
    };
    EXPECT_EQ(error_of(busy, limits), "subject.vdb: cannot read: it takes longer than allowed");
    const auto asleep = [](SandboxWriter&) { ::pause(); };
    EXPECT_EQ(error_of(asleep, limits), "subject.vdb: cannot read: it takes longer than allowed");
}

// A child that spins for a lock that nobody holds: once it has been silent for as long as it may, the next one is asked.
TEST(Sandbox, StartsAnewWhereNothingComes) {
    SandboxLimits limits;
    limits.seconds = 60;
    limits.quiet_seconds = 0.3;
    int readings = 0, value = 0;
    run_sandboxed(
        "s", "a parser", limits, {},
        [&](SandboxWriter& writer) {
            volatile bool forever = readings < 2;
            while (forever) {
            }
            writer.value(7);
        },
        [&](SandboxReader& reader) {
            ++readings;
            value = reader.value<int>();
        });
    EXPECT_EQ(readings, 3);
    EXPECT_EQ(value, 7);

    // Not where something has come: whoever was told of it would be told twice.
    int told = 0;
    const auto silent = [](SandboxWriter& writer) {
        writer.value(1);
        writer.flush();
        for (;;) ::pause();
    };
    std::string message;
    try {
        run_sandboxed("s", "a parser", limits, {}, silent, [&](SandboxReader& reader) {
            told += reader.value<int>();
            reader.value<int>();
        });
    } catch (const Error& error) {
        message = error.what();
    }
    EXPECT_EQ(message, "s: cannot read: it takes longer than allowed");
    EXPECT_EQ(told, 1);
}

// Checks that a child which lacks memory for its last word ends where it is: else it would go back through this test.
TEST(Sandbox, ChildWithoutAnyMemoryEnds) {
    if (NEPHOS_SANITIZED) GTEST_SKIP() << "a sanitizer's allocator ends the process";
    const auto greedy = [](SandboxWriter&) {
        void* volatile kept = nullptr;
        for (std::size_t size = 1 << 20; size >= 8; size /= 2) {
            do kept = std::malloc(size);
            while (kept != nullptr);
        }
        throw std::bad_alloc();
    };
    EXPECT_EQ(error_of(greedy, {.memory_bytes = std::size_t(64) << 20}),
              "subject.vdb: cannot read: OpenVDB ended: the file is damaged, or memory is short");
}

// Checks that a thread which this process cannot start, while it takes what was read, is not told as a fault of the file.
TEST(Sandbox, LackOfThreadsIsNotToldOfTheFile) {
    for (const bool of_tbb : {false, true}) {
        const auto without_thread = [&](SandboxReader&) {
            if (of_tbb)
                throw std::runtime_error("pthread_create has failed: Resource temporarily unavailable");
            throw std::system_error(std::make_error_code(std::errc::resource_unavailable_try_again));
        };
        try {
            run_sandboxed(
                "subject.vdb", "OpenVDB", {}, {}, [](SandboxWriter&) {}, without_thread);
            ADD_FAILURE() << "it was read";
        } catch (const std::exception& error) {
            EXPECT_TRUE(is_lack_of_threads(error)) << error.what();
        }
    }
}

// Expects the end of this process, by what faults.ForkedReaders preloads, where a child calls oneTBB.
TEST(Sandbox, ForkedReadersThatCallOneTbbAreNoticed) {
    if (std::getenv("FORKED_CALLS") == nullptr) GTEST_SKIP() << "nothing is preloaded";
    const auto parallel = [](SandboxWriter& writer) {
        std::vector<int> numbers(1000);
        tbb::parallel_for(0, 1000, [&](int n) { numbers[std::size_t(n)] = n; });
        writer.value(numbers[999]);
    };
    const auto allocating = [](SandboxWriter& writer) {
        const std::vector<int, tbb::tbb_allocator<int>> numbers(1000, 4);
        writer.value(numbers[999]);
    };
    EXPECT_DEATH(error_of(parallel), "called oneTBB");
    EXPECT_DEATH(error_of(allocating), "called oneTBB");
    EXPECT_EQ(error_of([](SandboxWriter& writer) { writer.value(1); }), "");
}

// A child that has told its result, or why there is none, need not end by itself.
TEST(Sandbox, EndsWhatStaysAfterItsResult) {
    SandboxLimits limits;
    limits.seconds = 100'000;  // longer than a test may last
    const auto finished = [](SandboxWriter& writer) {
        writer.value(1);
        writer.finish();
        for (;;) ::pause();
    };
    EXPECT_EQ(error_of(finished, limits), "");
    const auto failed = [](SandboxWriter& writer) {
        writer.fail("no such grid");
        for (;;) ::pause();
    };
    EXPECT_EQ(error_of(failed, limits), "subject.vdb: no such grid");
    limits.seconds = 0.3;
    const auto closed = [](SandboxWriter&) {
        for (int fd = STDERR_FILENO + 1; fd < 1024; ++fd) ::close(fd);
        for (;;) ::pause();
    };
    EXPECT_EQ(error_of(closed, limits), "subject.vdb: cannot read: it takes longer than allowed");
}

// A child that waits for a lock that a thread of its parent held is ended after 8 s. The next one shares the descriptor,
// whose position the first has moved.
TEST(Sandbox, StartsAgainAtTheBeginningOfItsFile) {
    const Descriptor file(::memfd_create("cumulus", MFD_CLOEXEC));
    ASSERT_EQ(::write(file.get(), "cumulus", 7), 7);
    const int kept[] = {file.get()};
    int children = 0;  // that have ended; a child has what it was at the fork
    std::string text;
    run_sandboxed(
        "subject.vdb", "OpenVDB", {}, kept,
        [&](SandboxWriter& writer) {
            std::string read(16, ' ');
            const ssize_t size = ::read(file.get(), read.data(), read.size());
            if (children == 0) ::pause();
            writer.text(read.substr(0, std::size_t(std::max<ssize_t>(size, 0))));
        },
        [&](SandboxReader& reader) {
            try {
                text = reader.text();
            } catch (...) {
                ++children;
                throw;
            }
        });
    EXPECT_EQ(children, 1);
    EXPECT_EQ(text, "cumulus");
}

// Ctrl-Z, or a batch system that suspends a job: what passes then is nobody's time.
TEST(Sandbox, TimeStandsStillWhileItsReaderIsStopped) {
    const pid_t reader = ::fork();
    ASSERT_GE(reader, 0);
    if (reader == 0) {
        SandboxLimits limits;
        limits.seconds = 4;
        const std::string error = error_of(
            [](SandboxWriter& writer) {
                ::usleep(5'500'000);  // past the time, had it not stood still
                writer.value(1);
            },
            limits);
        ::_exit(error.empty() ? 0 : 1);
    }
    ::usleep(200'000);
    ::kill(reader, SIGSTOP);
    ::usleep(4'800'000);
    ::kill(reader, SIGCONT);
    int status = -1;
    ASSERT_EQ(::waitpid(reader, &status, 0), reader);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

#if !NEPHOS_SANITIZED
// The limit of processor time comes before that of the clock where threads work side by side: its signal tells so, and a
// process that the system kills would be one that is short of memory.
TEST(Sandbox, EndsWhatComputesTooLong) {
    SandboxLimits limits;
    limits.seconds = 0.99;
    const auto busy = [](SandboxWriter&) {
        const auto compute = [] {
            volatile bool forever = true;
            while (forever) {
            }
        };
        for (int n = 0; n < 4; ++n) std::thread(compute).detach();
        compute();
    };
    EXPECT_EQ(error_of(busy, limits), "subject.vdb: cannot read: it takes longer than allowed");
}

TEST(Sandbox, EndsWhatTakesTooMuchMemory) {
    SandboxLimits limits;
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

#if !NEPHOS_SANITIZED
// What code of a stranger would do first is refused; what reading takes is not.
TEST(Sandbox, ForbidsEverythingButReading) {
    const int kept = ::open("/proc/self/exe", O_RDONLY | O_CLOEXEC), other = ::open("/proc/self/exe", O_RDONLY | O_CLOEXEC);
    ASSERT_GE(kept, 0);
    constexpr int kAttempts = 34;
    std::string refused;
    char magic[4] = {};
    const auto child = [&](SandboxWriter& writer) {
        const auto tell = [&](bool failed) { writer.value(std::uint8_t(failed && errno == EPERM)); };
        tell(::open("/etc/passwd", O_RDONLY) < 0);
        tell(::open("made-by-a-stranger", O_CREAT | O_WRONLY, 0600) < 0);
        tell(::unlink("made-by-a-stranger") < 0);
        tell(::socket(AF_UNIX, SOCK_STREAM, 0) < 0);
        tell(::fork() < 0);
        char* const arguments[] = {nullptr};
        tell(::execv("/bin/true", arguments) < 0);
        tell(::kill(::getppid(), 0) < 0);
        tell(::mmap(nullptr, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0) == MAP_FAILED);
        tell(::kill(0, 0) < 0);
        tell(::kill(-1, 0) < 0);
        tell(::mmap(nullptr, 4096, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0) == MAP_FAILED);
        tell(::mprotect(magic, 1, PROT_READ | PROT_EXEC) < 0);
        tell(::fcntl(kept, F_SETFL, 0) < 0);
        tell(::prctl(PR_SET_NAME, "stranger") < 0);
        tell(::syscall(SYS_io_uring_setup, 1, nullptr) < 0);
        tell(::syscall(SYS_process_vm_writev, ::getpid(), nullptr, 0, nullptr, 0, 0) < 0);
        tell(::syscall(SYS_pidfd_open, ::getpid(), 0) < 0);
        tell(::syscall(SYS_ptrace, 0, 0, nullptr, nullptr) < 0);
        // With AT_EMPTY_PATH a call examines its descriptor or a path, as the text says that no filter sees.
        struct stat facts {};
        struct statx more {};
        const auto examine = [&](const char* path, int flags) {
            tell(::fstatat(AT_FDCWD, path, &facts, flags) < 0);
            tell(::syscall(SYS_newfstatat, AT_FDCWD, path, &facts, flags) < 0);
            tell(::statx(AT_FDCWD, path, flags, STATX_BASIC_STATS, &more) < 0);
            tell(::syscall(SYS_faccessat2, AT_FDCWD, path, R_OK, flags) < 0);
        };
        examine("/etc/passwd", 0);
        examine("/etc/passwd", AT_EMPTY_PATH);
        examine("/etc/passwd", AT_EMPTY_PATH | AT_SYMLINK_NOFOLLOW);
        tell(::fstat(kept, &facts) < 0);
        tell(::access("/etc/passwd", R_OK) < 0);
        tell(::readlink("/proc/self/exe", magic, sizeof magic) < 0);
        tell(::syscall(SYS_name_to_handle_at, AT_FDCWD, "/etc/passwd", nullptr, nullptr, 0) < 0);
        if (::read(other, magic, 4) >= 0 || errno != EBADF) throw std::runtime_error("another descriptor is open");
        if (::pread(kept, magic, 4, 0) != 4) throw std::runtime_error("what is kept cannot be read");
        int sum = 0;
        std::thread([&sum] { sum = 42; }).join();
        if (sum != 42) throw std::runtime_error("no thread");
        writer.bytes(magic, sizeof magic);
    };
    run_sandboxed("s", "a parser", {}, {&kept, 1}, child, [&](SandboxReader& reader) {
        refused.clear();
        for (int n = 0; n < kAttempts; ++n) refused += reader.value<std::uint8_t>() != 0 ? 'x' : '-';
        reader.bytes(magic, sizeof magic);
    });
    EXPECT_EQ(refused, std::string(kAttempts, 'x'));
    EXPECT_EQ(std::string(magic, 4), "\x7f" "ELF");
    // The parent is not confined.
    EXPECT_GE(::open("/etc/passwd", O_RDONLY | O_CLOEXEC), 0);
    ::close(kept);
    ::close(other);
}
#endif

#if !NEPHOS_SANITIZED
// fork() copies private memory alone. Neither other rights nor advice may lead the child back to what is shared.
TEST(Sandbox, CannotWriteWhatIsShared) {
    constexpr std::size_t kSize = 4096;
    for (const int rights : {PROT_READ | PROT_WRITE, PROT_READ, PROT_NONE}) {
        auto* const page = static_cast<char*>(
            ::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0));
        ASSERT_NE(page, MAP_FAILED);
        *page = 'a';
        ASSERT_EQ(::mprotect(page, kSize, rights), 0);
        const std::string plain = error_of([page](SandboxWriter& writer) {
            *static_cast<volatile char*>(page) = 'b';
            writer.value(1);
        });
        EXPECT_NE(plain.find("signal 11"), std::string::npos) << plain;
        const std::string cunning = error_of([page](SandboxWriter& writer) {
            const bool refused = ::madvise(page, kSize, MADV_REMOVE) != 0 && errno == EPERM;
            ::mprotect(page, kSize, PROT_READ | PROT_WRITE);
            if (*static_cast<volatile char*>(page) == 'a')
                throw std::runtime_error("what is shared can be read");
            *static_cast<volatile char*>(page) = 'b';
            ::madvise(page, kSize, MADV_REMOVE);
            ::madvise(page, kSize, MADV_DONTNEED);
            if (!refused) throw std::runtime_error("memory can be removed");
            writer.value(1);
        });
        EXPECT_EQ(cunning, "");
        ASSERT_EQ(::mprotect(page, kSize, PROT_READ | PROT_WRITE), 0);
        EXPECT_EQ(*page, 'a');
        *page = 'c';
        ::munmap(page, kSize);
    }
}
#endif

TEST(Sandbox, LimitsWhatIsSent) {
    SandboxLimits limits;
    limits.most_bytes = 1000;
    std::string message;
    try {
        run_sandboxed(
            "s", "a parser", limits, {},
            [](SandboxWriter& writer) {
                for (int n = 0; n < 1'000'000; ++n) writer.value(n);
            },
            [](SandboxReader& reader) {
                for (int n = 0; n < 1'000'000; ++n) reader.value<int>();
            });
    } catch (const Error& error) {
        message = error.what();
    }
    EXPECT_NE(message.find("more than is allowed"), std::string::npos) << message;
}

TEST(Sandbox, RejectsMeaninglessLimits) {
    SandboxLimits limits;
    limits.seconds = 0;
    const auto child = [](SandboxWriter& writer) { writer.value(1); };
    EXPECT_THROW(run_sandboxed("s", "OpenVDB", limits, {}, child, [](SandboxReader&) {}), Error);
}

}  // namespace
}  // namespace nephos
