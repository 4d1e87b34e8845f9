// SPDX-License-Identifier: Apache-2.0
#pragma once

// The one exception type of nephos. Libraries throw it at their boundaries (user input, files, devices);
// every app catches it once and turns `code` into its exit status. Programmer errors are asserts instead.

#include <stdexcept>
#include <string>
#include <utility>

namespace nephos {

// The class of an error as the user sees it. The numbers are the exit codes of the `nephos` command.
enum class ErrorCode {
    check = 1,  // a check that the user asked for failed (a hash differs, a file is not what it claims)
    usage = 2,  // a bad argument or a bad scene: nothing was done
    io = 3,     // a file could not be read or written, or is damaged
    gpu = 4,    // no Vulkan device, or it failed
};

// A position in a text file; line and column count from 1, 0 = unknown.
struct SourcePosition {
    std::string file;
    int line = 0;
    int column = 0;
};

// Returns a text without bytes of 0, each of which has become the word \u0000: what() would end there.
inline std::string without_zeros(std::string text) {
    for (std::size_t at = text.find('\0'); at != text.npos; at = text.find('\0', at))
        text.replace(at, 1, "\\u0000");
    return text;
}

class Error : public std::runtime_error {
  public:
    Error(ErrorCode code, const std::string& message, SourcePosition where = {})
        : std::runtime_error(without_zeros(message)), code_(code), where_(std::move(where)) {}

    ErrorCode code() const noexcept { return code_; }
    const SourcePosition& where() const noexcept { return where_; }

  private:
    ErrorCode code_;
    SourcePosition where_;
};

}  // namespace nephos
