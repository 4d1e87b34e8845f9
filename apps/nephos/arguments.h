// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the subcommands have in common: options that several of them take, and the checked conversion of
// values, so that a bad one is an Error(usage) that says what was given and what was expected.

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/vec.h"
#include "scenes/format/errors.h"
#include "scenes/format/reader.h"
#include "scenes/format/scene.h"

namespace nephos {

// A scene file and what the command line changes in it.
struct SceneArguments {
    std::string file;
    std::vector<std::string> overrides;  // "key.path=value"
    std::optional<std::uint64_t> seed;
};

// How a command works and reports.
struct WorkArguments {
    int threads = 0;     // 0 = all cores
    bool json = false;   // results as one JSON value on stdout
    bool quiet = false;  // no progress bar, no notes
};

// Selects what draws, instead of the keys of the scene.
struct DeviceArguments {
    std::optional<Splatting> splatting;
    std::optional<std::string> device;
};

// Frames by their number as in file names, counted from 1; both ends belong to the range.
struct FrameRange {
    int first = 1;
    int last = std::numeric_limits<int>::max();  // or the last that there is
    bool operator==(const FrameRange&) const = default;
};

// Adds options to `command`; the struct must outlive the parse.
void add_scene_arguments(CLI::App& command, SceneArguments& arguments);  // SCENE --set --seed
void add_scene_changes(CLI::App& command, SceneArguments& arguments);    // --set --seed
void add_device(CLI::App& command, DeviceArguments& arguments);          // --splatting --device
void add_threads(CLI::App& command, WorkArguments& arguments);
void add_json(CLI::App& command, WorkArguments& arguments);
void add_quiet(CLI::App& command, WorkArguments& arguments);

// Adds an option `--name VALUE` whose value `use` takes; `use` throws Error(usage) with a message that starts with
// the value ("'abc' is not ..."), which add_value completes with the option's name.
CLI::Option* add_value(CLI::App& command, const std::string& name, const std::string& type,
                       const std::string& description, std::function<void(const std::string&)> use);

// Adds -o,--out for a folder, whose name may not be empty as that of a variable without a value is.
void add_out_folder(CLI::App& command, std::string& out, const std::string& description);

// Conversions for add_value; throw Error(usage) unless the whole text is a number in min..max.
std::int64_t parse_integer(const std::string& text, std::int64_t min, std::int64_t max);
std::uint64_t parse_unsigned(const std::string& text, std::uint64_t min, std::uint64_t max);
double parse_real(const std::string& text, double min, double max);
Vec3 parse_point(const std::string& text, double min, double max);  // "X,Y,Z"
std::vector<double> parse_reals(const std::string& text, std::size_t count, double min, double max);
FrameRange parse_frames(const std::string& text);         // "A..B", "A..", "..B" or "A"
std::pair<int, int> parse_size(const std::string& text);  // "WIDTHxHEIGHT"

// Returns the back-end and device of a scene, unless the command line names others.
DeviceOptions device_options(const DeviceArguments& arguments, const FrameOptions& frames);

// Returns the scene with its changes applied. Throws as read_scene().
Scene load_scene(const SceneArguments& arguments, SceneUse use = SceneUse::everything);

// Throws Error(usage) when the file to write is one that is read; either may be empty.
void refuse_to_replace(const std::string& from, const std::string& to);
// The same for each file that a scene names.
void refuse_to_replace_files_of(Scene scene, const std::string& to);
// The same when it is of a run, an export, a sweep or a fit, or named as a folder.
void refuse_to_replace_listed_file(const std::string& to);

// Prints every problem on standard error, "error:" in colour on a terminal.
void print_scene_errors(const SceneErrors& errors);

// Prints what a scene may not mean (scenes/format/warnings.h) on standard error.
void print_warnings(const Scene& scene);

// Limits the threads of oneTBB until the program ends, to the number of processors where that is less (or 0 is given), and starts
// them; 1 starts none. Where one cannot be started the program ends here, status 3, before there is anything to free.
// Later oneTBB would throw, and its next function, as in the destructor of a volume, could wait for ever (2021.8: the epoch of
// market::adjust_demand() stays behind). The limit is never taken back, as that would start threads at the program's end.
void start_threads(int threads);

}  // namespace nephos
