// SPDX-License-Identifier: Apache-2.0
#include "scenes/memory.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>

#include <sys/resource.h>
#include <unistd.h>

#include "automaton/automaton.h"
#include "automaton/error.h"

namespace nephos {
namespace {

constexpr std::size_t kUnlimited = std::numeric_limits<std::size_t>::max();

constexpr double kCheckpointCopies = 3;
constexpr double kPlannedCover = 0.5;     // share of voxels that are cloud
constexpr double kBytesPerVoxel = 4.5;    // a float, and the masks and nodes of the tree above it
constexpr double kGrids = 3;              // two steps and the frame between them
constexpr double kBytesPerMetaball = 64;  // itself, its colour, its keys while sorting, on the device too
constexpr double kBytesPerPixel = 96;     // layers of the picture on both sides, and the files being written
constexpr double kBytesPerShadowTexel = 16;

std::size_t saturated(double bytes) { return bytes < double(kUnlimited) ? std::size_t(bytes) : kUnlimited; }

std::size_t sum(std::size_t a, std::size_t b) { return a > kUnlimited - b ? kUnlimited : a + b; }

std::optional<std::string> first_line(const std::filesystem::path& path) {
    std::ifstream file(path);
    std::string line;
    if (!std::getline(file, line)) return std::nullopt;
    return line;
}

// The number at the start of a text; none for "max".
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

// The number after a key in a file of "key number" or "key: number" lines.
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

// What a group may still take; the cache of files counts as free, because the kernel drops it first.
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

std::string advice(const MemoryEstimate& estimate) {
    const std::size_t largest = std::max({estimate.automaton, estimate.density, estimate.pictures});
    if (largest == estimate.automaton) return "fewer `lattice.cells`";
    if (largest == estimate.density) return "fewer `lattice.cells` or a smaller `density.refine`";
    return "fewer `lattice.cells`, a smaller `density.refine` or smaller pictures";
}

}  // namespace

std::size_t MemoryEstimate::total() const { return sum(sum(automaton, density), pictures); }

MemoryEstimate memory_estimate(const Scene& scene, bool with_pictures) {
    const Extent& extent = scene.automaton.extent;
    const double refine = scene.density.refine;
    const double voxels = double(extent.x) * extent.y * extent.z * refine * refine * refine * kPlannedCover;
    const double window =
        2.0 * scene.density.smoothing.t0 + 2;  // the steps around both neighbours of a frame
    MemoryEstimate estimate;
    // With the state written, hum and act are remembered beside cld. A checkpoint holds the planes and that history
    // as bytes: gathered in a growing buffer, and copied once into the file's content.
    const double plane = double(BitPlane::bytes(extent));
    const double history = window * (scene.density.write_state ? 3 : 1) * plane;
    const double checkpoint = kCheckpointCopies * (3 * plane + history);
    estimate.automaton = Automaton::memory_bytes(scene.automaton);
    estimate.density = saturated(history + checkpoint + voxels * kGrids * kBytesPerVoxel);
    if (!with_pictures) return estimate;
    const double pixels = double(scene.render.camera.width) * scene.render.camera.height;
    const double texels = double(scene.render.shadow_map_size) * scene.render.shadow_map_size;
    estimate.pictures =
        saturated(voxels * kBytesPerMetaball + pixels * kBytesPerPixel + texels * kBytesPerShadowTexel);
    return estimate;
}

std::size_t memory_estimate_bytes(const Scene& scene, bool with_pictures) {
    return memory_estimate(scene, with_pictures).total();
}

AvailableMemory available_memory(const std::filesystem::path& root) {
    AvailableMemory available{kUnlimited, "no limit"};
    if (const auto kibibytes = number_after(root / "proc/meminfo", "MemAvailable:")) {
        tighten(available, *kibibytes * 1024, "free memory of the machine");
    }
    tighten_by_own_groups(available, root);
    tighten(available, left_of_address_space(root), "address space limit of the process (ulimit -v)");
    return available;
}

void check_memory(const Scene& scene, const AvailableMemory& available, bool with_pictures) {
    const MemoryEstimate estimate = memory_estimate(scene, with_pictures);
    if (estimate.total() <= available.bytes) return;
    const Extent& extent = scene.automaton.extent;
    std::ostringstream message;
    message << "the scene needs about " << bytes_text(estimate.total()) << " of memory (automaton "
            << bytes_text(estimate.automaton) << ", density " << bytes_text(estimate.density) << ", pictures "
            << bytes_text(estimate.pictures) << ") for " << extent.x << " x " << extent.y << " x " << extent.z
            << " cells, but the " << available.limit << " leaves " << bytes_text(available.bytes)
            << ": expected " << advice(estimate);
    throw Error(ErrorCode::usage, message.str());
}

void check_memory(const Scene& scene, bool with_pictures) {
    check_memory(scene, available_memory(), with_pictures);
}

std::string bytes_text(std::size_t bytes) {
    constexpr const char* kUnits[] = {"bytes", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB"};
    double amount = double(bytes);
    std::size_t unit = 0;
    while (amount >= 1024 && unit + 1 < std::size(kUnits)) {
        amount /= 1024;
        ++unit;
    }
    char buffer[32];
    const auto end =
        std::to_chars(buffer, buffer + sizeof buffer, amount, std::chars_format::fixed, unit == 0 ? 0 : 1);
    return std::string(buffer, end.ptr) + " " + kUnits[unit];
}

}  // namespace nephos
