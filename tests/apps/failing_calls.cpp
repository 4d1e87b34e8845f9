// SPDX-License-Identifier: Apache-2.0
// Preloaded into a command, this lets calls of the system fail as a bad disk, a network file system or a kill would.
//
//     FAIL_CALL="NAME HOW FIRST COUNT"  of the calls NAME (lseek, fsync, read, write, pwrite, stat), numbered from 1 among
//                                       those that FAIL_PATH allows, COUNT fail from FIRST on; HOW: EIO, EINTR, ENOSPC or
//                                       KILL
//     FAIL_PATH=TEXT                    only on files in whose path TEXT occurs
//     FAIL_PROGRAM=NAME                 only in this program

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#include <dlfcn.h>
#include <sys/stat.h>
#include <unistd.h>

namespace {

struct Plan {
    char name[16] = "", how[16] = "";
    long first = 0, count = 0;
    const char* path = nullptr;
};

const Plan& plan() {
    static const Plan plan = [] {
        Plan p;
        const char* text = std::getenv("FAIL_CALL");
        const char* program = std::getenv("FAIL_PROGRAM");
        if (text == nullptr ||
            (program != nullptr && std::strcmp(program, program_invocation_short_name) != 0))
            return p;
        if (std::sscanf(text, "%15s %15s %ld %ld", p.name, p.how, &p.first, &p.count) != 4) std::abort();
        p.path = std::getenv("FAIL_PATH");
        return p;
    }();
    return plan;
}

std::string path_of(int fd) {
    char path[4096];
    const ssize_t size = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path);
    return std::string(path, size > 0 ? std::size_t(size) : 0);
}

// Returns true when this call is to fail; errno is then set.
bool fails(const char* name, const std::string& path) {
    static std::atomic<long> calls = 0;
    const Plan& p = plan();
    if (std::strcmp(name, p.name) != 0) return false;
    if (p.path != nullptr && path.find(p.path) == path.npos) return false;
    const long number = ++calls;
    if (number < p.first || number >= p.first + p.count) return false;
    if (std::strcmp(p.how, "KILL") == 0) ::raise(SIGKILL);
    errno = std::strcmp(p.how, "EINTR") == 0 ? EINTR : std::strcmp(p.how, "ENOSPC") == 0 ? ENOSPC : EIO;
    return true;
}

bool fails(const char* name, int fd) {
    return std::strcmp(name, plan().name) == 0 && fails(name, path_of(fd));
}

template <class Function>
Function next(Function, const char* name) {
    return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

off_t lseek(int fd, off_t offset, int whence) noexcept {
    return fails("lseek", fd) ? -1 : next(&lseek, "lseek")(fd, offset, whence);
}
off64_t lseek64(int fd, off64_t offset, int whence) noexcept {
    return fails("lseek", fd) ? -1 : next(&lseek64, "lseek64")(fd, offset, whence);
}
int fsync(int fd) { return fails("fsync", fd) ? -1 : next(&fsync, "fsync")(fd); }
ssize_t read(int fd, void* to, size_t size) {
    return fails("read", fd) ? -1 : next(&read, "read")(fd, to, size);
}
ssize_t write(int fd, const void* from, size_t size) {
    return fails("write", fd) ? -1 : next(&write, "write")(fd, from, size);
}
ssize_t pwrite(int fd, const void* from, size_t size, off_t at) {
    return fails("write", fd) ? -1 : next(&pwrite, "pwrite")(fd, from, size, at);
}
int stat(const char* path, struct stat* status) noexcept {
    return fails("stat", std::string(path)) ? -1 : next(&stat, "stat")(path, status);
}
int lstat(const char* path, struct stat* status) noexcept {
    return fails("stat", std::string(path)) ? -1 : next(&lstat, "lstat")(path, status);
}

}  // extern "C"
