// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <ctime>
#include <string>

#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include "apps/nephos/commands.h"

namespace nephos {
namespace {

// One key may arrive twice: from the terminal, and from a program between that passes it on (timeout, make).
constexpr std::int64_t kSameKey_ms = 300;

// A signal handler can reach nothing but statics; these are the only ones of the command.
std::atomic<int> pending{0};
std::atomic<std::int64_t> pending_since_ms{0};
std::atomic<bool> deferred{false};
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free &&
              std::atomic<std::int64_t>::is_always_lock_free);

std::int64_t now_ms() {
    timespec now{};
    ::clock_gettime(CLOCK_MONOTONIC, &now);  // async-signal-safe
    return std::int64_t(now.tv_sec) * 1000 + now.tv_nsec / 1'000'000;
}

void on_stop(int signal) {
    if (deferred.load()) {
        int none = 0;
        std::int64_t never = 0;
        pending_since_ms.compare_exchange_strong(never, now_ms());
        if (pending.compare_exchange_strong(none, signal)) return;
        if (now_ms() - pending_since_ms.load() < kSameKey_ms) return;
    }
    // Nothing half-written can carry a final name (core/atomic_file.h), so ending here is safe.
    ::_exit(128 + signal);
}

// The Python module names itself there: what it calls ends with it, as by SIGTERM, however it ends.
void end_with_caller() {
    const char* const variable = std::getenv("NEPHOS_CALLER");
    if (variable == nullptr) return;
    const std::string caller = variable;
    ::unsetenv("NEPHOS_CALLER");
    ::prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (std::to_string(::getppid()) == caller) return;
    // A program between them is its own affair; else it had ended before.
    ::prctl(PR_SET_PDEATHSIG, 0);
    if (::kill(pid_t(std::atol(caller.c_str())), 0) != 0 && errno == ESRCH) ::raise(SIGTERM);
}

}  // namespace

void install_signal_handlers() {
    struct sigaction action {};
    action.sa_handler = on_stop;
    ::sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
        struct sigaction old {};
        // A parent that ignores the signal (nohup, a background job of a shell) goes on ignoring it.
        if (::sigaction(signal, nullptr, &old) == 0 && old.sa_handler == SIG_IGN) continue;
        ::sigaction(signal, &action, nullptr);
    }
    ::signal(SIGCHLD, SIG_DFL);  // ignored, as a parent may leave it, how a process ended could not be asked
    ::signal(SIGPIPE, SIG_IGN);
    ::signal(SIGXFSZ, SIG_IGN);
    end_with_caller();
}

void defer_signals() { deferred.store(true); }

int pending_signal() { return pending.load(); }

}  // namespace nephos
