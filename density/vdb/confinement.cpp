// SPDX-License-Identifier: Apache-2.0
#include "density/vdb/confinement.h"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <limits>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include <fcntl.h>
#include <sched.h>
#include <seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "density/vdb/sanitized.h"

namespace nephos {
namespace {

std::size_t sum_or_most(std::size_t a, std::size_t b) {
    constexpr std::size_t kMost = std::numeric_limits<std::size_t>::max();
    return a > kMost - b ? kMost : a + b;
}

[[noreturn]] void fail(const std::string& step, int number) {
    throw std::runtime_error("cannot read: the process that does it cannot be confined: " + step + ": " +
                             std::strerror(number));
}

// Opens a file of this process in /proc, which a bare chroot or container may be without.
std::ifstream open_own(const std::string& name) {
    std::ifstream file("/proc/self/" + name);
    const int number = errno;
    if (!file)
        fail((number == ENOENT ? "it takes a mounted /proc: /proc/self/" : "/proc/self/") + name, number);
    return file;
}

// Addresses that this process uses now.
std::size_t address_space() {
    std::ifstream statm = open_own("statm");
    std::size_t pages = 0;
    statm >> pages;
    return pages * std::size_t(::sysconf(_SC_PAGESIZE));
}

// The soft limit is `value`, the hard one `grace` above it.
void set_limit(__rlimit_resource resource, std::size_t value, std::size_t grace = 0) {
    rlimit limit{};
    if (::getrlimit(resource, &limit) != 0) fail("getrlimit", errno);
    limit.rlim_max = std::min(rlim_t(value) + grace, limit.rlim_max);
    limit.rlim_cur = std::min(rlim_t(value), limit.rlim_max);
    if (::setrlimit(resource, &limit) != 0) fail("setrlimit", errno);
}

// Has the standard streams that are not kept end in nothing.
void silence(std::initializer_list<int> streams, std::span<const int> kept) {
    const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    for (const int fd : streams) {
        if (std::ranges::find(kept, fd) != kept.end()) continue;
        if (nowhere < 0 || ::dup2(nowhere, fd) < 0) ::close(fd);
    }
}

// Closes what is not kept, but for the standard streams.
void close_others(std::vector<int> kept) {
    std::ranges::sort(kept);
    unsigned first = STDERR_FILENO + 1;
    const auto close_until = [&first](unsigned last) {
        if (first <= last && ::syscall(SYS_close_range, first, last, 0) != 0) fail("close_range", errno);
    };
    for (const int fd : kept) {
        if (unsigned(fd) < first) continue;
        close_until(unsigned(fd) - 1);
        first = unsigned(fd) + 1;
    }
    close_until(~0u);
}

struct Mapping {
    std::uintptr_t begin = 0, end = 0;
    std::string rights, file;
};

std::vector<Mapping> mappings() {
    std::vector<Mapping> all;
    std::ifstream maps = open_own("maps");
    for (std::string line; std::getline(maps, line);) {
        std::istringstream fields(line);
        Mapping each;
        char dash = 0;
        std::string offset, device, inode;
        fields >> std::hex >> each.begin >> dash >> each.end >> each.rights >> offset >> device >> inode;
        std::getline(fields >> std::ws, each.file);
        if (each.rights.size() == 4) all.push_back(each);
    }
    return all;
}

// fork() copies private memory only: what is shared, such as a buffer of a device, is still that of the parent. Empty memory
// takes its place, whatever its rights are: mprotect() could change them. glibc converts texts by its table, which is opened
// for reading alone, so that nothing can make it writable.
void stop_sharing() {
    for (const Mapping& each : mappings()) {
        void* const begin = reinterpret_cast<void*>(each.begin);
        const std::size_t size = each.end - each.begin;
        if (each.rights[3] == 's') {
            if (each.rights[1] != 'w' && each.file.ends_with("/gconv-modules.cache")) continue;
            constexpr int kFlags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED | MAP_NORESERVE;
            if (::mmap(begin, size, PROT_READ, kFlags, -1, 0) == MAP_FAILED) fail("mmap", errno);
        } else if (each.rights[1] == 'w' && each.rights[2] == 'x') {
            if (::mprotect(begin, size, PROT_READ | PROT_WRITE) != 0) fail("mprotect", errno);
        }
    }
}

void check(int result) {
    if (result < 0) fail("seccomp", -result);
}

// Allows what parsers of an open file need; every other system call fails with EPERM. So does fstat(): glibc makes it
// newfstatat() or statx() with AT_EMPTY_PATH, and with that flag both examine whatever path they are given, which no filter
// can read. Parsers find a size by lseek().
void filter_system_calls() {
    const std::unique_ptr<void, void (*)(scmp_filter_ctx)> filter(::seccomp_init(SCMP_ACT_ERRNO(EPERM)), ::seccomp_release);
    if (filter == nullptr) fail("seccomp", ENOMEM);
    for (const int call :
         {// files that are open
          SCMP_SYS(read), SCMP_SYS(readv), SCMP_SYS(pread64), SCMP_SYS(write), SCMP_SYS(writev),
          SCMP_SYS(lseek), SCMP_SYS(close), SCMP_SYS(poll), SCMP_SYS(ppoll),
          // memory
          SCMP_SYS(munmap), SCMP_SYS(mremap), SCMP_SYS(brk),
          // threads and locks, of TBB in OpenVDB
          SCMP_SYS(futex), SCMP_SYS(set_robust_list), SCMP_SYS(rseq), SCMP_SYS(set_tid_address),
          SCMP_SYS(sched_yield), SCMP_SYS(sched_getaffinity), SCMP_SYS(getpid), SCMP_SYS(gettid),
          // signals of its own, abort()
          SCMP_SYS(rt_sigaction), SCMP_SYS(rt_sigprocmask), SCMP_SYS(rt_sigreturn), SCMP_SYS(sigaltstack),
          // time and the end
          SCMP_SYS(getrandom), SCMP_SYS(clock_gettime), SCMP_SYS(clock_nanosleep), SCMP_SYS(nanosleep),
          SCMP_SYS(pause), SCMP_SYS(restart_syscall), SCMP_SYS(exit), SCMP_SYS(exit_group)})
        check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 0));
    // No memory that is executed, and none that is shared.
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(mmap), 2,
                             SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0), SCMP_A3(SCMP_CMP_MASKED_EQ, MAP_SHARED, 0)));
    // A stack of a thread becomes writable so. Private memory alone is mapped now, but for what nobody can write.
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(mprotect), 1,
                             SCMP_A2(SCMP_CMP_MASKED_EQ, PROT_EXEC, 0)));
    // Allows the advice of allocators, and none that reaches the file behind a mapping, as MADV_REMOVE does.
    for (const int advice : {MADV_DONTNEED, MADV_FREE, MADV_HUGEPAGE, MADV_NOHUGEPAGE})
        check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(madvise), 1,
                                 SCMP_A2(SCMP_CMP_EQ, scmp_datum_t(advice))));
    // Threads, and neither processes nor namespaces; signals to itself, as abort() sends; the flags of an open file.
    constexpr scmp_datum_t kNamespaces = CLONE_NEWNS | CLONE_NEWCGROUP | CLONE_NEWUTS | CLONE_NEWIPC | CLONE_NEWUSER |
                                         CLONE_NEWPID | CLONE_NEWNET;
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(clone), 1,
                             SCMP_A0(SCMP_CMP_MASKED_EQ, CLONE_THREAD | kNamespaces, CLONE_THREAD)));
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ERRNO(ENOSYS), SCMP_SYS(clone3), 0));  // glibc then takes clone()
    for (const int call : {SCMP_SYS(tgkill), SCMP_SYS(kill)})
        check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, call, 1, SCMP_A0(SCMP_CMP_EQ, scmp_datum_t(::getpid()))));
    check(::seccomp_rule_add(filter.get(), SCMP_ACT_ALLOW, SCMP_SYS(fcntl), 1, SCMP_A1(SCMP_CMP_EQ, F_GETFL)));
    check(::seccomp_load(filter.get()));
}

}  // namespace

void confine(pid_t parent, std::span<const int> kept, std::size_t memory_bytes, double seconds) {
    if (::prctl(PR_SET_PDEATHSIG, SIGKILL) != 0) fail("prctl", errno);
    if (::getppid() != parent) ::_exit(1);  // it ended before that
    for (const int signal : {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGPIPE, SIGXCPU})
        ::signal(signal, SIG_DFL);
    set_limit(RLIMIT_CORE, 0);
    set_limit(RLIMIT_CPU, std::size_t(seconds) + 1, 5);  // the soft limit sends SIGXCPU, the hard one SIGKILL
    silence({STDIN_FILENO, STDOUT_FILENO}, kept);
    if (NEPHOS_SANITIZED) return;
    silence({STDERR_FILENO}, kept);
    close_others({kept.begin(), kept.end()});
    set_limit(RLIMIT_AS, sum_or_most(address_space(), memory_bytes));
    stop_sharing();
    set_limit(RLIMIT_FSIZE, 0);
    set_limit(RLIMIT_NOFILE, 0);
    if (::prctl(PR_SET_DUMPABLE, 0) != 0) fail("prctl", errno);
    filter_system_calls();  // which sets no_new_privs
}

}  // namespace nephos
