// SPDX-License-Identifier: Apache-2.0
#pragma once

// Sweep files: the plan of a sweep as TOML. docs/research.md lists the keys.

#include <filesystem>
#include <string>

#include "study/sweep_plan.h"

namespace nephos {

// Reads a sweep file; the scene in it, and files that are values of an axis, are relative to its
// folder; the latter to the `folder` that it names. Throws SceneErrors with every problem, Error(io).
SweepOptions read_sweep_file(const std::filesystem::path& path);

// Reads a sweep file as above, or a scene: then what it holds is the `source` of the options, which have no axes yet. A file
// with a key `scene` is a sweep file. The file is read once, so it may be an unnamed pipe. Throws SceneErrors with every
// problem of a sweep file, Error(io).
SweepOptions read_sweep_file_or_scene(const std::filesystem::path& path);

// Reads an axis of the command line: "KEY=0.1,0.2,0.3" values, "KEY=0.1..0.4:7" seven values evenly apart,
// "KEY=log:1e-6..1e-2:5" with even ratios, "KEY=0.1..0.4" and "KEY=log:..", "KEY=integer:3..9" a range for a sampled design;
// "KEY+KEY=..." moves several keys together. Throws Error(usage) that quotes the text and says what was expected.
Axis parse_axis(const std::string& text);

// Reads "STATISTIC.se=X" of the command line. Throws Error(usage) that says what was expected.
StopAt parse_stop(const std::string& text);

// Returns `count` values from `from` to `to`, both included, evenly apart or with even ratios, as TOML. Precondition:
// count >= 2.
std::vector<std::string> spread_values(double from, double to, std::uint64_t count, Scale scale);

}  // namespace nephos
