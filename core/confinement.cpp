// SPDX-License-Identifier: Apache-2.0
#include "core/confinement.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>
#include <linux/close_range.h>
#include <sched.h>
#include <seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define NEPHOS_SANITIZED 1  // shadow memory needs terabytes of addresses, and reports need files
#else
#define NEPHOS_SANITIZED 0
#endif

namespace nephos {
namespace {

std::size_t sum_or_most(std::size_t a, std::size_t b) {
    constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();
    return a > kMost - b ? kMost : a + b;
}

// Addresses that this process uses now.
std::size_t address_space() {
    std::ifstream statm("/proc/self/statm");
    std::size_t pages = 0;
    statm >> pages;
    return pages * std::size_t(::sysconf(_SC_PAGESIZE));
}

void set_limit(int resource, rlim_t value) {
    rlimit limit{};
    ::getrlimit(static_cast<__rlimit_resource>(resource), &limit);
    limit.rlim_cur = std::min(value, limit.rlim_max);
    ::setrlimit(static_cast<__rlimit_resource>(resource), &limit);
}

void close_others(std::span<const int> kept) {
    std::vector<int> sorted(kept.begin(), kept.end());
    std::ranges::sort(sorted);
    unsigned first = STDERR_FILENO + 1;
    for (const int fd : sorted) {
        if (unsigned(fd) < first) continue;
        if (unsigned(fd) > first) ::syscall(SYS_close_range, first, unsigned(fd) - 1, 0);
        first = unsigned(fd) + 1;
    }
    ::syscall(SYS_close_range, first, ~0u, 0);
}

void check(int result) {
    if (result < 0) throw std::runtime_error("cannot confine the process that reads it: seccomp: " + std::string(std::strerror(-result)));
}

// Memory, threads, time, and what is open.
void filter_system_calls() {
    const std::unique_ptr<void, void (*)(scmp_filter_ctx)> filter(::seccomp_init(SCMP_ACT_ERRNO(EPERM)), ::seccomp_release);
    if (filter == nullptr) throw std::runtime_error("cannot confine the process that reads it: no seccomp filter");
    for (const int call :
         {SCMP_SYS(read), SCMP_SYS(readv), SCMP_SYS(pread64), SCMP_SYS(write), SCMP_SYS(writev), SCMP_SYS(lseek),
          SCMP_SYS(close), SCMP_SYS(fstat), SCMP_SYS(poll), SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(madvise),
          SCMP_SYS(brk), SCMP_SYS(futex), SCMP_SYS(set_robust_list), SCMP_SYS(rseq), SCMP_SYS(set_tid_address),
          SCMP_SYS(sched_yield), SCMP_SYS(sched_getaffinity), SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask),
          SCMP_SYS(rt_sigreturn), SCMP_SYS(sigaltstack), SCMP_SYS(getpid), SCMP_SYS(gettid), SCMP_SYS(getrandom),
          SCMP_SYS(clock_gettime), SCMP_SYS(clock_nanosleep), SCMP_SYS(nanosleep), SCMP_SYS(pause),
          SCMP_SYS(restart_syscall), SCMP_SYS(exit), SCMP_SYS(exit_group)})
        check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 0));
    // No memory that is both written and executed, nor files as memory that can be.
    for (const int call : {SCMP_SYS(mmap), SCMP_SYS(mprotect)})
        check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 1, SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)));
    // Threads, and not processes; signals to itself, as abort() sends; the flags of an open file.
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(fcntl), 1, SCMP_A1(SCMP_CMP_EQ, F_GETFL)));
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                             SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD, CLONE_THREAD)));
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0));  // glibc then takes clone()
    for (const int call : {SCMP_SYS(tgkill), SCMP_SYS(kill)})
        check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 1,
                                 SCMP_A0(SCMP_CMP_EQ, scmp_datum_t(::getpid()))));
    check(::seccomp_load(filter.get()));
}

}  // namespace

void confine(std::span<const int> kept, std::size_t memory_bytes, double seconds) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (const int signal : {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGPIPE}) ::signal(signal, SIG_DFL);
    const int nowhere = ::open("/dev/null", O_RDWR);
    if (nowhere >= 0)
        for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, fd);
    set_limit(RLIMIT_CORE, 0);
    set_limit(RLIMIT_CPU, rlim_t(seconds) + 1);
    if (NEPHOS_SANITIZED) return;
    close_others(kept);
    set_limit(RLIMIT_AS, rlim_t(sum_or_most(address_space(), memory_bytes)));
    set_limit(RLIMIT_FSIZE, 0);
    set_limit(RLIMIT_NOFILE, 0);
    ::prctl(PR_SET_DUMPABLE, 0);
    filter_system_calls();  // which sets no_new_privs
}

}  // namespace nephos
