// SPDX-License-Identifier: Apache-2.0
#pragma once

// What the command says: results on standard output, messages and the progress bar on standard error. Colours
// and the bar appear only on a terminal; colours not when NO_COLOR is set or TERM is "dumb" (no-color.org).
//
// Names of files, of what is in them, and pieces of scenes come from strangers: everything here but print_sequences()
// escapes control characters (core/text.h), newlines and tabs excepted, so that no file steers the terminal.

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/error.h"

namespace nephos {

// Thrown by Output::require_reader().
struct OutputClosed {};

// Standard output, checked: a full disk is not silent. Once its reader has gone (`nephos verify ... | head`) there is nobody to
// say anything to: the rest is dropped, while the work goes on to its end and its status.
class Output {
  public:
    // Writes text, escaped. Throws Error(io) with the reason.
    void write(std::string_view text);
    // Writes text made of styled() and of escaped() pieces, as it is; throws as write().
    void write_styled(std::string_view text);
    // Writes text and a newline; throws as write().
    void line(std::string_view text);
    // Flushes before the end of the program, so that a late failure is seen; throws as write().
    void flush();
    // For what is done to be printed alone (`nephos hash ... | head`): throws OutputClosed, which ends the program with
    // status 0, when the reader was found to have gone.
    void require_reader() const;
};

// Returns true when colours may be used on stdout or stderr.
bool colours_on(std::FILE* stream);

// Returns escaped text between escape sequences (ECMA-48) when colours are on.
enum class Style { bold, dim, red, cyan };
std::string styled(std::string_view text, Style style, bool colours);

// Messages on standard error, one line each or more: "error: ...", "note: ..."; the label in colour.
void print_error(std::string_view message);
void print_problems(
    const std::vector<std::string>& problems);  // each as an error, of what went on all the same
void print_error(const Error& error);  // with its place, when it has one
void print_note(std::string_view message);
// Prints text on standard error; failures to write are ignored, there is nowhere left to say so.
void print_message(std::string_view text);
// The same for text made of styled() and of escaped() pieces, or of sequences that move the cursor, as it is.
void print_sequences(std::string_view text);
// Returns escaped(text) with its newlines and tabs.
std::string escaped_lines(std::string_view text);

// Columns of the terminal at `stream`, or `otherwise` when it is none.
int terminal_width(std::FILE* stream, int otherwise);

// Returns the text of a result for --json: indented; bytes that are no UTF-8 are replaced, and
// all control characters escaped.
std::string json_text(const nlohmann::ordered_json& json);

// Seconds as "0:07", "12:34" or "1:02:03"; a count as "1,234,567".
std::string human_duration(double seconds);
std::string human_count(std::uint64_t count);

// One line on standard error that shows how far the work is:
//
//     step 108/240  ━━━━━━━━━━━━━━━━━━━━━━━━━━━━━━  45%  35.2 steps/s  0:04 left
//
// Draws nothing unless standard error is a terminal. Not thread-safe.
class ProgressBar {
  public:
    // `unit` in the singular ("step"). `enabled` = false draws nothing in any case. The rate counts from
    // `start`.
    ProgressBar(std::string unit, std::uint64_t start, std::uint64_t total, bool enabled);
    ~ProgressBar();  // clears the line
    ProgressBar(const ProgressBar&) = delete;
    ProgressBar& operator=(const ProgressBar&) = delete;

    // Redraws at most ten times a second. `detail` stands at the end of the line ("frame 12/40").
    void update(std::uint64_t done, std::string_view detail = {});
    // Removes the line, before other messages; the next update() draws it again.
    void clear();

    // Returns the line as it would be drawn, without colours, at most `width` columns.
    static std::string text(std::string_view unit, std::uint64_t start, std::uint64_t done,
                            std::uint64_t total, double elapsed_s, std::string_view detail, int width,
                            bool unicode);

  private:
    using Clock = std::chrono::steady_clock;

    std::string unit_;
    std::uint64_t start_, total_;
    bool enabled_, unicode_;
    bool drawn_ = false;
    Clock::time_point begin_, last_;
};

}  // namespace nephos
