// SPDX-License-Identifier: Apache-2.0
#include "apps/signals.h"

#include <atomic>

#include <signal.h>
#include <unistd.h>

namespace nephos {
namespace {

// A signal handler can reach nothing but statics; these two are the only ones of the command.
std::atomic<int> pending{0};
std::atomic<bool> deferred{false};
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<bool>::is_always_lock_free);

void on_stop(int signal) {
    int none = 0;
    if (deferred.load() && pending.compare_exchange_strong(none, signal)) return;
    // Nothing half-written can carry a final name (automaton/atomic_file.h), so ending here is safe.
    ::_exit(128 + signal);
}

}  // namespace

void install_signal_handlers() {
    struct sigaction action {};
    action.sa_handler = on_stop;
    ::sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    for (const int signal : {SIGINT, SIGTERM}) {
        struct sigaction old {};
        // A parent that ignores the signal (nohup, a background job of a shell) goes on ignoring it.
        if (::sigaction(signal, nullptr, &old) == 0 && old.sa_handler == SIG_IGN) continue;
        ::sigaction(signal, &action, nullptr);
    }
    ::signal(SIGPIPE, SIG_IGN);
    ::signal(SIGXFSZ, SIG_IGN);
}

void defer_signals() { deferred.store(true); }

int pending_signal() { return pending.load(); }

}  // namespace nephos
