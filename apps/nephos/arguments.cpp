// SPDX-License-Identifier: Apache-2.0
#include "apps/nephos/arguments.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <limits>
#include <mutex>

#include "study/folder_contents.h"
#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include "apps/nephos/terminal.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "core/paths.h"
#include "scenes/format/named_files.h"
#include "scenes/format/reader.h"
#include "scenes/format/warnings.h"

namespace nephos {
namespace {

constexpr int kMaxThreads = 1024;

[[noreturn]] void refuse(const std::string& text, const std::string& expected) {
    throw Error(ErrorCode::usage, fmt::format("'{}' is not {}", shortened(text), expected));
}

template <class Number>
bool convert(std::string_view text, Number& number) {
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

std::vector<std::string> split(const std::string& text, char separator) {
    std::vector<std::string> parts{""};
    for (const char c : text) {
        if (c == separator) {
            parts.emplace_back();
        } else {
            parts.back() += c;
        }
    }
    return parts;
}

Splatting parse_splatting(const std::string& text) {
    constexpr std::pair<std::string_view, Splatting> kNames[] = {{"auto", Splatting::automatic},
                                                                 {"cpu", Splatting::cpu},
                                                                 {"vulkan", Splatting::vulkan},
                                                                 {"blended", Splatting::blended}};
    for (const auto& [name, splatting] : kNames)
        if (text == name) return splatting;
    refuse(text, "one of auto, cpu, vulkan and blended");
}

}  // namespace

std::int64_t parse_integer(const std::string& text, std::int64_t min, std::int64_t max) {
    std::int64_t number = 0;
    if (!convert(text, number) || number < min || number > max) {
        refuse(text, fmt::format("a whole number from {} to {}", min, max));
    }
    return number;
}

std::uint64_t parse_unsigned(const std::string& text, std::uint64_t min, std::uint64_t max) {
    std::uint64_t number = 0;
    if (!convert(text, number) || number < min || number > max) {
        refuse(text, fmt::format("a whole number from {} to {}", min, max));
    }
    return number;
}

double parse_real(const std::string& text, double min, double max) {
    double number = 0;
    if (!convert(text, number) || !std::isfinite(number) || number < min || number > max) {
        constexpr double kLargest = std::numeric_limits<double>::max();
        refuse(text, max < kLargest    ? fmt::format("a number from {:g} to {:g}", min, max)
                     : min > -kLargest ? fmt::format("a number from {:g} upwards", min)
                                       : "a number");
    }
    return number;
}

std::vector<double> parse_reals(const std::string& text, std::size_t count, double min, double max) {
    const std::vector<std::string> parts = split(text, ',');
    std::vector<double> numbers(parts.size());
    bool good = parts.size() == count;
    for (std::size_t n = 0; good && n < count; ++n) {
        good = convert(parts[n], numbers[n]) && std::isfinite(numbers[n]) && numbers[n] >= min &&
               numbers[n] <= max;
    }
    if (!good)
        refuse(text, fmt::format("{} numbers from {:g} to {:g} with commas between them", count, min, max));
    return numbers;
}

Vec3 parse_point(const std::string& text, double min, double max) {
    const std::vector<double> numbers = parse_reals(text, 3, min, max);
    return {numbers[0], numbers[1], numbers[2]};
}

FrameRange parse_frames(const std::string& text) {
    FrameRange range;
    const std::size_t dots = text.find("..");
    const std::string first = text.substr(0, dots);
    const std::string last = dots == text.npos ? first : text.substr(dots + 2);
    const bool good = (first.empty() || convert(first, range.first)) &&
                      (last.empty() || convert(last, range.last)) && !(first.empty() && last.empty()) &&
                      range.first >= 1 && range.last >= range.first;
    if (!good) refuse(text, "a range of frames: A..B (from A to B, counted from 1), A.., ..B or A");
    return range;
}

std::pair<int, int> parse_size(const std::string& text) {
    int width = 0, height = 0;
    const std::vector<std::string> parts = split(text, 'x');
    const bool good = parts.size() == 2 && convert(parts[0], width) && convert(parts[1], height) &&
                      width >= 1 && height >= 1 && width <= 16384 && height <= 16384;
    if (!good) refuse(text, "a size like 1280x720 (width x height in pixels, each from 1 to 16384)");
    return {width, height};
}

CLI::Option* add_value(CLI::App& command, const std::string& name, const std::string& type,
                       const std::string& description, std::function<void(const std::string&)> use) {
    const std::string long_name = name.substr(name.rfind("--") == name.npos ? 0 : name.rfind("--"));
    const auto checked = [long_name, use = std::move(use)](const std::string& text) {
        try {
            use(text);
        } catch (const Error& error) {
            throw Error(error.code(), long_name + " " + error.what());
        }
    };
    return command.add_option_function<std::string>(name, checked, description)->type_name(type);
}

void add_scene_arguments(CLI::App& command, SceneArguments& arguments) {
    command.add_option("SCENE", arguments.file, "Scene file (TOML)")->required()->type_name("SCENE");
    add_scene_changes(command, arguments);
}

void add_scene_changes(CLI::App& command, SceneArguments& arguments) {
    command.add_option("--set", arguments.overrides, "Change a key of the scene; may be repeated")
        ->type_name("KEY=VALUE")
        ->expected(1)
        ->allow_extra_args(false)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
    add_value(command, "--seed", "N", "Seed of all randomness, instead of the scene's",
              [&](const std::string& text) {
                  arguments.seed = parse_unsigned(text, 0, std::numeric_limits<std::uint64_t>::max());
              });
}

void add_out_folder(CLI::App& command, std::string& out, const std::string& description) {
    add_value(command, "-o,--out", "DIR", description, [&out](const std::string& text) {
        if (text.empty()) throw Error(ErrorCode::usage, "'': expected the path of a folder");
        out = text;
    });
}

void add_device(CLI::App& command, DeviceArguments& arguments) {
    add_value(
        command, "--splatting", "BACK-END",
        "What draws: auto, cpu (takes no Vulkan driver), vulkan (compute shaders), blended (billboards)",
        [&](const std::string& text) { arguments.splatting = parse_splatting(text); });
    command.add_option("--device", arguments.device, "Vulkan device: a part of its name, or its number")
        ->type_name("NAME");
}

DeviceOptions device_options(const DeviceArguments& arguments, const FrameOptions& frames) {
    // The scene's device is that of its own back-end.
    const bool own_device = arguments.splatting == Splatting::cpu && !arguments.device;
    return {.device = own_device ? std::string() : arguments.device.value_or(frames.device),
            .splatting = arguments.splatting.value_or(frames.splatting)};
}

void add_threads(CLI::App& command, WorkArguments& arguments) {
    add_value(command, "-j,--threads", "N",
              "Threads to use, no more than there are cores; the results are the same whatever it is "
              "(default: all cores)",
              [&](const std::string& text) { arguments.threads = int(parse_integer(text, 1, kMaxThreads)); });
}

void add_json(CLI::App& command, WorkArguments& arguments) {
    command.add_flag("--json", arguments.json, "Print the result as JSON");
}

void add_quiet(CLI::App& command, WorkArguments& arguments) {
    command.add_flag("-q,--quiet", arguments.quiet, "No progress bar, notes or summary");
}

Scene load_scene(const SceneArguments& arguments, SceneUse use) {
    Scene scene = read_scene(arguments.file, arguments.overrides, use);
    if (arguments.seed) scene.automaton.seed = *arguments.seed;
    return scene;
}

void refuse_to_replace(const std::string& from, const std::string& to) {
    if (is_same_place(from, to))
        throw Error(ErrorCode::usage,
                    to + ": is the file that is read: expected the name of another one to write");
}

void refuse_to_replace_files_of(Scene scene, const std::string& to) {
    for_each_file(scene, [&](const std::string&, FileKind, const std::filesystem::path& file) {
        refuse_to_replace(file.string(), to);
        return file;
    });
}

void refuse_to_replace_listed_file(const std::string& to) {
    require_file_name(to);
    if (const auto owner = owner_of_file(to))
        throw Error(ErrorCode::usage, to + ": is " + *owner + ": expected the name of another one to write");
}

void print_scene_errors(const SceneErrors& errors) {
    const std::string plain = "error:";
    const std::string coloured = styled(plain, Style::red, colours_on(stderr));
    std::string text = escaped_lines(errors.what());
    // The label stands after the place, once a problem, before any text of the scene itself.
    for (std::size_t line = 0; line < text.size();) {
        const std::size_t end = std::min(text.find('\n', line), text.size());
        const std::size_t at = text.find(plain, line);
        const bool is_message = at < end && (at == line || text[line] != ' ');
        if (is_message) text.replace(at, plain.size(), coloured);
        line = text.find('\n', line) == text.npos ? text.size() : text.find('\n', line) + 1;
    }
    print_sequences(text);
    if (!text.ends_with('\n')) print_message("\n");
}

void print_warnings(const Scene& scene) {
    for (const std::string& warning : warnings(scene)) print_note(warning);
}

void start_threads(int threads) {
    using Control = tbb::global_control;
    const int processors = tbb::info::default_concurrency();
    const int all = threads > 0 ? std::min(threads, processors) : processors;
    // Never deleted; volatile, else the compiler leaves the pointer out, and the sanitizer finds a leak.
    [[maybe_unused]] static const Control* volatile limit = nullptr;
    limit = new Control(Control::max_allowed_parallelism, std::size_t(all));
    if (all <= 1) return;
    // So many parts, each of which waits for the others, that all threads take one. They sleep, as a machine that is slow to start
    // them needs its time for that; should oneTBB keep one back, it is started when it is needed.
    constexpr auto kLongest = std::chrono::seconds(10);
    const auto end = std::chrono::steady_clock::now() + kLongest;
    std::mutex mutex;
    std::condition_variable all_are_there;
    int arrived = 0;
    const auto part = [&] {
        std::unique_lock lock(mutex);
        if (++arrived == all) all_are_there.notify_all();
        all_are_there.wait_until(lock, end, [&] { return arrived == all; });
    };
    tbb::task_arena arena(all);
    arena.execute([&]() noexcept {  // what is thrown ends the program (program.cpp)
        tbb::task_group group;
        for (int n = 1; n < all; ++n) group.run(part);
        part();
        group.wait();
    });
}

}  // namespace nephos
