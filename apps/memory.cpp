// SPDX-License-Identifier: Apache-2.0
#include "apps/memory.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <optional>

#include "apps/terminal.h"
#include "automaton/error.h"

namespace nephos {
namespace {

constexpr std::size_t kUnknown = std::numeric_limits<std::size_t>::max();

// The number in a file that holds nothing else; nothing for "max" or a file that is not there.
std::optional<std::size_t> number_in(const std::string& path) {
    std::ifstream stream(path);
    std::size_t number = 0;
    if (stream >> number) return number;
    return {};
}

std::size_t free_on_machine() {
    std::ifstream stream("/proc/meminfo");
    for (std::string key; stream >> key;) {
        std::size_t kibibytes = 0;
        if (key == "MemAvailable:" && stream >> kibibytes) return kibibytes * 1024;
        stream.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
    }
    return kUnknown;
}

std::size_t difference(std::size_t limit, std::size_t used) { return limit > used ? limit - used : 0; }

// Left of a control group's limit, versions 2 and 1, as a container sees its own.
std::size_t free_in_group() {
    for (const auto& [limit, used] :
         {std::pair("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current"),
          std::pair("/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes")}) {
        const std::optional<std::size_t> most = number_in(limit), now = number_in(used);
        if (!most || !now) continue;
        // What the group holds in the page cache can be given back.
        std::size_t cache = 0;
        std::ifstream stream(std::string(limit).substr(0, std::string(limit).rfind('/')) + "/memory.stat");
        std::string key;
        for (std::size_t value = 0; stream >> key >> value;) {
            if (key == "inactive_file" || key == "active_file") cache += value;
        }
        return difference(*most, difference(*now, cache));
    }
    return kUnknown;
}

std::size_t free_address_space() {
    rlimit limit{};
    if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnknown;
    const std::size_t pages = number_in("/proc/self/statm").value_or(0);
    return difference(limit.rlim_cur, pages * std::size_t(::sysconf(_SC_PAGESIZE)));
}

}  // namespace

std::size_t available_memory_bytes() {
    return std::min({free_on_machine(), free_in_group(), free_address_space()});
}

void require_memory(std::size_t bytes, const std::string& what) {
    const std::size_t available = available_memory_bytes();
    if (bytes <= available) return;
    throw Error(ErrorCode::usage, fmt::format("{} takes up to {}, and {} are free", what, human_bytes(bytes),
                                              human_bytes(available)));
}

}  // namespace nephos
