// SPDX-License-Identifier: Apache-2.0
#include "core/memory.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>
#include <system_error>

#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <cstdlib>

#include <sys/resource.h>
#include <unistd.h>

namespace nephos {
namespace {

constexpr std::size_t kUnlimited = std::numeric_limits<std::size_t>::max();

std::optional<std::string> first_line(const std::filesystem::path& path) {
    std::ifstream file(path);
    std::string line;
    if (!std::getline(file, line)) return std::nullopt;
    return line;
}

// Parses the number at the start of a text; nullopt for "max".
std::optional<std::size_t> number_in(std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end == text.data()) return std::nullopt;
    return number;
}

std::optional<std::size_t> number_of_file(const std::filesystem::path& path) {
    const auto line = first_line(path);
    return line ? number_in(*line) : std::nullopt;
}

// Returns the number after a key in a file of "key number" or "key: number" lines.
std::optional<std::size_t> number_after(const std::filesystem::path& path, std::string_view key) {
    std::ifstream file(path);
    for (std::string line; std::getline(file, line);) {
        if (!line.starts_with(key)) continue;
        return number_in(std::string_view(line).substr(key.size()));
    }
    return std::nullopt;
}

void tighten(AvailableMemory& available, std::optional<std::size_t> bytes, const char* limit) {
    if (bytes && *bytes < available.bytes) available = {*bytes, limit};
}

// Returns the memory left in a control group; its page cache counts as free, because the kernel drops it
// first.
std::optional<std::size_t> left_in_group(const std::filesystem::path& group, const char* limit_file,
                                         const char* usage_file, std::string_view cache_key) {
    const auto limit = number_of_file(group / limit_file);
    const auto usage = number_of_file(group / usage_file);
    if (!limit || !usage) return std::nullopt;
    const std::size_t cache = number_after(group / "memory.stat", cache_key).value_or(0);
    const std::size_t taken = *usage - std::min(cache, *usage);
    return *limit - std::min(taken, *limit);
}

// A limit may be set on any group from the process's own up to the root.
void tighten_by_groups(AvailableMemory& available, const std::filesystem::path& mount, std::string_view own,
                       bool version_2) {
    const char* const name = "memory limit of the control group";
    std::filesystem::path relative = std::filesystem::path(own).relative_path();
    while (true) {
        const std::filesystem::path group = mount / relative;
        tighten(available,
                version_2 ? left_in_group(group, "memory.max", "memory.current", "inactive_file ")
                          : left_in_group(group, "memory.limit_in_bytes", "memory.usage_in_bytes",
                                          "total_inactive_file "),
                name);
        if (relative.empty()) return;
        relative = relative.parent_path();
    }
}

// Lines "0::/path" (version 2) and "4:memory:/path" (version 1).
void tighten_by_own_groups(AvailableMemory& available, const std::filesystem::path& root) {
    std::ifstream file(root / "proc/self/cgroup");
    for (std::string line; std::getline(file, line);) {
        const std::size_t first = line.find(':');
        const std::size_t second = first == std::string::npos ? first : line.find(':', first + 1);
        if (second == std::string::npos) continue;
        const std::string controllers = line.substr(first + 1, second - first - 1);
        const std::string own = line.substr(second + 1);
        if (controllers.empty()) tighten_by_groups(available, root / "sys/fs/cgroup", own, true);
        if (controllers == "memory") tighten_by_groups(available, root / "sys/fs/cgroup/memory", own, false);
    }
}

std::optional<std::size_t> left_of_address_space(const std::filesystem::path& root) {
    rlimit limit{};
    if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return std::nullopt;
    const auto pages = number_of_file(root / "proc/self/statm");
    const std::size_t taken = pages.value_or(0) * std::size_t(std::max(sysconf(_SC_PAGESIZE), 1L));
    return std::size_t(limit.rlim_cur) - std::min(taken, std::size_t(limit.rlim_cur));
}

// Returns the bytes that malloc holds after free() and will hand out again.
std::size_t kept_by_malloc() {
#ifdef __GLIBC__
    return mallinfo2().fordblks;
#else
    return 0;
#endif
}

}  // namespace

AvailableMemory available_memory(const std::filesystem::path& root) {
    AvailableMemory available{kUnlimited, "no limit"};
    if (const auto kibibytes = number_after(root / "proc/meminfo", "MemAvailable:")) {
        tighten(available, *kibibytes * 1024, "free memory of the machine");
    }
    tighten_by_own_groups(available, root);
    tighten(available, left_of_address_space(root), "address space limit of the process (ulimit -v)");
    if (root == "/" && available.bytes != kUnlimited) available.bytes += kept_by_malloc();
    return available;
}

void keep_freed_memory() {
#ifdef __GLIBC__
    mallopt(M_MMAP_THRESHOLD, 32 << 20);  // the largest that it takes: larger blocks are mapped, and go back
    mallopt(M_TRIM_THRESHOLD, 256 << 20);
#endif
}

}  // namespace nephos
