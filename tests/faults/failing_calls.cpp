// SPDX-License-Identifier: Apache-2.0
// Preloaded into a command, this lets calls of the system fail as a bad disk, a network file system or a kill would.
//
//     FAIL_CALL="NAME HOW FIRST COUNT"  of the calls NAME, numbered from 1 among those that FAIL_PATH allows, COUNT fail
//                                       from FIRST on. NAME: open, read, write (with pwrite, writev), lseek, fsync (with
//                                       fdatasync), rename (with renameat, renameat2), mkdir, stat (with lstat, fstat, fstatat), mmap, or
//                                       allocate (memory of 32 KiB or more). HOW: an error (EIO, EINTR, ENOSPC, EACCES,
//                                       EMFILE, ENOMEM, EXDEV, EINVAL), KILL, STOP (until SIGCONT; the call does not fail), HOLD (the call never ends; a byte goes into
//                                       the file FAIL_COUNT), SHORT (of read
//                                       and write: half of the bytes), or COUNT (a byte into the file FAIL_COUNT for each)
//     FAIL_PATH=TEXT                    only on files in whose path TEXT occurs
//     FAIL_PROGRAM=NAME                 only in this program

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <utility>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

extern "C" void* __libc_malloc(std::size_t size);

namespace {

constexpr std::size_t kLarge = std::size_t(32) << 10;

struct Plan {
    char name[16] = "", how[16] = "";
    long first = 0, count = 0;
    const char* path = nullptr;
    int error = 0;
};

int error_of(std::string_view how) {
    constexpr std::pair<std::string_view, int> kErrors[] = {
        {"EIO", EIO},       {"EINTR", EINTR},   {"ENOSPC", ENOSPC}, {"EACCES", EACCES},
        {"EMFILE", EMFILE}, {"ENOMEM", ENOMEM}, {"EXDEV", EXDEV},   {"EINVAL", EINVAL}};
    for (const auto& [name, error] : kErrors)
        if (name == how) return error;
    return 0;
}

Plan read_plan() {
    Plan p;
    const char* text = std::getenv("FAIL_CALL");
    const char* program = std::getenv("FAIL_PROGRAM");
    if (text == nullptr || (program != nullptr && std::strcmp(program, program_invocation_short_name) != 0))
        return p;
    if (std::sscanf(text, "%15s %15s %ld %ld", p.name, p.how, &p.first, &p.count) != 4) std::abort();
    p.path = std::getenv("FAIL_PATH");
    p.error = error_of(p.how);
    return p;
}

Plan the_plan;  // read by __libc_start_main(): what libraries do before the program begins does not fail

bool is(const char* how) { return std::strcmp(the_plan.how, how) == 0; }

void count_call() {
    if (const char* file = std::getenv("FAIL_COUNT")) {
        const long fd =
            ::syscall(SYS_openat, AT_FDCWD, file, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
        if (fd < 0) return;  // a confined process may open nothing
        if (::syscall(SYS_write, fd, "+", 1) != 1) std::abort();
        ::syscall(SYS_close, fd);
    }
}

// Returns true when this call is to fail; errno is then set. A call that is to be SHORT does not fail, but `shorten` says so.
bool fails(const char* name, std::string_view path, bool* shorten = nullptr) {
    static std::atomic<long> calls = 0;
    const Plan& p = the_plan;
    if (std::strcmp(name, p.name) != 0) return false;
    if (p.path != nullptr && path.find(p.path) == path.npos) return false;
    if (is("COUNT")) {
        count_call();
        return false;
    }
    const long number = ++calls;
    if (number < p.first || number >= p.first + p.count) return false;
    if (is("KILL")) ::raise(SIGKILL);
    if (is("HOLD")) {
        count_call();
        for (;;) ::pause();
    }
    if (is("STOP")) {
        ::raise(SIGSTOP);
        return false;
    }
    if (is("SHORT")) {
        if (shorten != nullptr) *shorten = true;
        return false;
    }
    errno = p.error;
    return true;
}

// A confined process can ask for no path, and open nothing either: what FAIL_PATH allows among the files that were open when
// it began. Written after fork() by its only thread.
constexpr int kFiles = 1024;
bool allowed_at_fork[kFiles];

// Returns the path of what is open; "" when it is not open or the process is confined.
std::string_view path_of(int fd, char (&path)[4096]) {
    char link[64];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t size = ::readlink(link, path, sizeof path);
    return {path, size > 0 ? std::size_t(size) : 0};
}

void remember_files() {
    if (the_plan.path == nullptr) return;
    char path[4096];
    for (int fd = 0; fd < kFiles; ++fd)
        allowed_at_fork[fd] = path_of(fd, path).find(the_plan.path) != std::string_view::npos;
}

bool fails(const char* name, int fd, bool* shorten = nullptr) {
    if (std::strcmp(name, the_plan.name) != 0) return false;
    const int before = errno;
    char text[4096];
    std::string_view path = path_of(fd, text);
    if (path.empty() && fd >= 0 && fd < kFiles && allowed_at_fork[fd]) path = the_plan.path;
    errno = before;
    return fails(name, path, shorten);
}

// Of a file by its name in a folder that is open.
bool fails_at(const char* name, int folder, const char* path) {
    if (std::strcmp(name, the_plan.name) != 0) return false;
    char whole[8192];
    std::size_t length = 0;
    if (path[0] != '/') {
        char link[64] = "/proc/self/cwd";
        if (folder != AT_FDCWD) std::snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
        const ssize_t size = ::readlink(link, whole, 4000);
        length = size > 0 ? std::size_t(size) : 0;
        whole[length++] = '/';
    }
    const std::size_t more = std::strlen(path) < 4096 ? std::strlen(path) : 4095;
    std::memcpy(whole + length, path, more);
    return fails(name, std::string_view(whole, length + more));
}

template <class Function>
Function next(Function, const char* name) {
    return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

std::size_t half(std::size_t size, bool shorten) { return shorten && size > 1 ? size / 2 : size; }

int open_at(int folder, const char* path, int flags, mode_t mode) {
    if (fails_at("open", folder, path)) return -1;
    return int(::syscall(SYS_openat, folder, path, flags, mode));
}

mode_t mode_of(int flags, std::va_list& arguments) {
    return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
}

}  // namespace

#define OPEN(NAME)                                                                \
    int NAME(const char* path, int flags, ...) {                                  \
        std::va_list arguments;                                                   \
        va_start(arguments, flags);                                               \
        const int fd = open_at(AT_FDCWD, path, flags, mode_of(flags, arguments)); \
        va_end(arguments);                                                        \
        return fd;                                                                \
    }
#define OPENAT(NAME)                                                            \
    int NAME(int folder, const char* path, int flags, ...) {                    \
        std::va_list arguments;                                                 \
        va_start(arguments, flags);                                             \
        const int fd = open_at(folder, path, flags, mode_of(flags, arguments)); \
        va_end(arguments);                                                      \
        return fd;                                                              \
    }

extern "C" {

int __libc_start_main(int (*main)(int, char**, char**), int argc, char** argv, void (*init)(), void (*fini)(),
                      void (*rtld_fini)(), void* stack_end) {
    the_plan = read_plan();
    return next(&__libc_start_main, "__libc_start_main")(main, argc, argv, init, fini, rtld_fini, stack_end);
}

pid_t fork() noexcept {
    const pid_t child = next(&fork, "fork")();
    if (child == 0) remember_files();
    return child;
}
OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)
// libstdc++ opens the files of its streams by this.
FILE* fopen(const char* path, const char* mode) {
    return fails_at("open", AT_FDCWD, path) ? nullptr : next(&fopen, "fopen")(path, mode);
}
FILE* fopen64(const char* path, const char* mode) {
    return fails_at("open", AT_FDCWD, path) ? nullptr : next(&fopen64, "fopen64")(path, mode);
}
off_t lseek(int fd, off_t offset, int whence) noexcept {
    return fails("lseek", fd) ? -1 : next(&lseek, "lseek")(fd, offset, whence);
}
off64_t lseek64(int fd, off64_t offset, int whence) noexcept {
    return fails("lseek", fd) ? -1 : next(&lseek64, "lseek64")(fd, offset, whence);
}
int fdatasync(int fd) { return fails("fsync", fd) ? -1 : next(&fdatasync, "fdatasync")(fd); }
int fsync(int fd) { return fails("fsync", fd) ? -1 : next(&fsync, "fsync")(fd); }
ssize_t read(int fd, void* to, size_t size) {
    bool shorten = false;
    return fails("read", fd, &shorten) ? -1 : next(&read, "read")(fd, to, half(size, shorten));
}
ssize_t pread(int fd, void* to, size_t size, off_t at) {
    bool shorten = false;
    return fails("read", fd, &shorten) ? -1 : next(&pread, "pread")(fd, to, half(size, shorten), at);
}
ssize_t write(int fd, const void* from, size_t size) {
    bool shorten = false;
    return fails("write", fd, &shorten) ? -1 : next(&write, "write")(fd, from, half(size, shorten));
}
ssize_t pwrite(int fd, const void* from, size_t size, off_t at) {
    bool shorten = false;
    return fails("write", fd, &shorten) ? -1 : next(&pwrite, "pwrite")(fd, from, half(size, shorten), at);
}
ssize_t writev(int fd, const struct iovec* parts, int count) {
    bool shorten = false;
    if (fails("write", fd, &shorten)) return -1;
    if (shorten && count > 0)
        return next(&write, "write")(fd, parts[0].iov_base, half(parts[0].iov_len, true));
    return next(&writev, "writev")(fd, parts, count);
}
int rename(const char* from, const char* to) noexcept {
    return fails_at("rename", AT_FDCWD, to) ? -1 : next(&rename, "rename")(from, to);
}
int renameat(int from_folder, const char* from, int to_folder, const char* to) noexcept {
    return fails_at("rename", to_folder, to) ? -1
                                             : next(&renameat, "renameat")(from_folder, from, to_folder, to);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) noexcept {
    return fails_at("rename", to_folder, to)
               ? -1
               : next(&renameat2, "renameat2")(from_folder, from, to_folder, to, flags);
}
int mkdir(const char* path, mode_t mode) noexcept {
    return fails_at("mkdir", AT_FDCWD, path) ? -1 : next(&mkdir, "mkdir")(path, mode);
}
int stat(const char* path, struct stat* status) noexcept {
    return fails("stat", std::string_view(path)) ? -1 : next(&stat, "stat")(path, status);
}
int lstat(const char* path, struct stat* status) noexcept {
    return fails("stat", std::string_view(path)) ? -1 : next(&lstat, "lstat")(path, status);
}
int fstatat(int folder, const char* path, struct stat* status, int flags) noexcept {
    return fails_at("stat", folder, path) ? -1 : next(&fstatat, "fstatat")(folder, path, status, flags);
}
int fstat(int fd, struct stat* status) noexcept {
    return fails("stat", fd) ? -1 : next(&fstat, "fstat")(fd, status);
}
void* mmap(void* at, size_t size, int protection, int flags, int fd, off_t offset) noexcept {
    return fails("mmap", "") ? MAP_FAILED : next(&mmap, "mmap")(at, size, protection, flags, fd, offset);
}
void* malloc(size_t size) noexcept {
    if (size >= kLarge && fails("allocate", "")) return nullptr;
    return __libc_malloc(size);
}

}  // extern "C"
