// SPDX-License-Identifier: Apache-2.0
#pragma once

// The problems of a scene: all of them in one exception, each with its place, its source line and what was
// expected.

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"

namespace nephos {

// One thing that is wrong with a scene.
struct Problem {
    SourcePosition
        where;  // the file, or the whole option "--set key=value" with line 0; columns count characters
    std::string message;      // one sentence without a full stop, naming the key by its path
    std::string expected;     // what would be right, with unit and range, or the "did you mean"; may be empty
    std::string source_line;  // the line it stands in, shortened around the place when long; printable UTF-8
    int caret = 0;            // the character of source_line that is meant, counted from 1; 0: none
};

// The problem as text that ends with a newline:
//
//     scenes/cumulus.toml:12:17: error: `sun.elevation_deg` is 95, too large
//      12 | elevation_deg = 95
//         |                 ^
//         = expected a number from -18 to 90, in degrees
//
// A tab in the source line stays a tab in the caret line, so that both line up in any terminal.
std::string format(const Problem& problem);

// The same for all of them, each followed by an empty line, and at the end how many there are.
std::string format(std::span<const Problem> problems);

// Everything that is wrong with a scene, in the order of the file and then of the options; never empty.
// what() is format(problems()) without the last newline, where() the place of the first; the code is
// ErrorCode::usage.
class SceneErrors : public Error {
  public:
    explicit SceneErrors(std::vector<Problem> problems);
    const std::vector<Problem>& problems() const noexcept { return problems_; }

  private:
    std::vector<Problem> problems_;
};

// The candidate that was probably meant by `word`: the one with the smallest edit distance (insertion,
// deletion, replacement, swap of neighbours; case counts half), if that is small for the word's length;
// before all others one that only adds a unit ("elevation_deg" for "elevation"). Otherwise empty.
std::string_view closest_word(std::string_view word, std::span<const std::string_view> candidates);

}  // namespace nephos
