// SPDX-License-Identifier: Apache-2.0
#pragma once

// The errors of a scene file, collected in one exception, each with its position, source line and expected
// value.

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace nephos {

// One error in a scene.
struct Problem {
    // The file, or the whole option "--set key=value" with line 0; columns count characters.
    SourcePosition where;
    std::string message;      // one sentence without a full stop, naming the key by its path
    std::string expected;     // valid values with unit and range, or a "did you mean"; may be empty
    std::string source_line;  // its line, shortened around the position when long; printable UTF-8
    int caret = 0;            // position of the marked character in source_line, counted from 1; 0: none
};

// Formats a problem as text that ends with a newline:
//
//     scenes/cumulus.toml:12:17: error: `sun.elevation_deg` is 95, too large
//      12 | elevation_deg = 95
//         |                 ^
//         = expected a number from -18 to 90, in degrees
//
// A tab in the source line is repeated in the caret line, so that both align in any terminal.
std::string format(const Problem& problem);

// Formats all problems, each followed by an empty line, and at the end their number.
std::string format(std::span<const Problem> problems);

// All errors of a scene, in the order of the file and then of the options; never empty. what() is
// format(problems()) without the last newline, where() the position of the first; the code is
// ErrorCode::usage, or what is given: of a file that the scene names and nobody can read, ErrorCode::io.
class SceneErrors : public Error {
  public:
    explicit SceneErrors(std::vector<Problem> problems, ErrorCode code = ErrorCode::usage);
    const std::vector<Problem>& problems() const noexcept { return problems_; }

  private:
    std::vector<Problem> problems_;
};

// That are listed: a file of garbage keys would otherwise fill the memory with messages.
constexpr std::size_t kMostProblems = 1000;

// Throws SceneErrors with the problems of the scene's own file first, then those of other files, then those of options; the
// last says that there are too many, from kMostProblems on.
[[noreturn]] void throw_problems(std::vector<Problem> problems, const std::string& scene_file,
                                 ErrorCode code = ErrorCode::usage);

// Returns the candidate with the smallest edit distance to `word` (insertion, deletion, replacement, swap of
// neighbours; case counts half) if that is small for the word's length, preferring one that only adds a unit
// ("elevation_deg" for "elevation"); "" if none is close. For "did you mean" messages. Pure.
std::string_view closest_word(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace nephos
