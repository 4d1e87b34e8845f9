// SPDX-License-Identifier: Apache-2.0
#include "apps/nephos/terminal.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include <fmt/color.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/ioctl.h>
#include <unistd.h>

#include "core/text.h"

namespace nephos {
namespace {

bool reader_is_gone = false;  // of the one standard output

void output_failed(int error) {
    reader_is_gone = error == EPIPE;
    if (reader_is_gone) return;
    throw Error(ErrorCode::io, fmt::format("standard output: cannot write: {}", std::strerror(error)));
}

bool is_terminal(std::FILE* stream) { return ::isatty(::fileno(stream)) != 0; }

bool dumb_terminal() {
    const char* term = std::getenv("TERM");
    return term == nullptr || std::strcmp(term, "dumb") == 0;
}

// By the variables that decide the locale's character type, in their order.
bool unicode_locale() {
    for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
        const char* value = std::getenv(name);
        if (value == nullptr || *value == '\0') continue;
        const std::string_view text(value);
        return text.find("UTF-8") != text.npos || text.find("utf8") != text.npos ||
               text.find("UTF8") != text.npos;
    }
    return false;
}

void print_labelled(std::string_view label, Style style, std::string_view message) {
    print_sequences(fmt::format("{} {}{}", styled(label, style, colours_on(stderr)), escaped_lines(message),
                                message.ends_with('\n') ? "" : "\n"));
}

std::string repeat(std::string_view piece, int times) {
    std::string result;
    for (int i = 0; i < times; ++i) result += piece;
    return result;
}

}  // namespace

std::string escaped_lines(std::string_view text) { return escaped(text, "\n\t"); }

void Output::write(std::string_view text) { write_styled(escaped_lines(text)); }

void Output::write_styled(std::string_view text) {
    if (reader_is_gone) return;
    if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size()) output_failed(errno);
}

void Output::line(std::string_view text) {
    write(text);
    write("\n");
}

void Output::flush() {
    if (reader_is_gone) return;
    if (std::fflush(stdout) != 0) output_failed(errno);
}

void Output::require_reader() const {
    if (reader_is_gone) throw OutputClosed{};
}

bool colours_on(std::FILE* stream) {
    const char* no_colour = std::getenv("NO_COLOR");
    if (no_colour != nullptr && *no_colour != '\0') return false;
    return is_terminal(stream) && !dumb_terminal();
}

std::string styled(std::string_view text, Style style, bool colours) {
    static const fmt::text_style kLooks[] = {fmt::emphasis::bold, fmt::emphasis::faint,
                                             fmt::emphasis::bold | fmt::fg(fmt::terminal_color::red),
                                             fmt::fg(fmt::terminal_color::cyan)};
    const std::string shown = escaped_lines(text);
    return colours ? fmt::format(kLooks[std::size_t(style)], "{}", shown) : shown;
}

void print_message(std::string_view text) { print_sequences(escaped_lines(text)); }

void print_sequences(std::string_view text) {
    std::fwrite(text.data(), 1, text.size(), stderr);
    std::fflush(stderr);
}
void print_error(std::string_view message) { print_labelled("error:", Style::red, message); }
void print_problems(const std::vector<std::string>& problems) {
    for (const std::string& problem : problems) print_error(problem);
}
void print_error(const Error& error) {
    const SourcePosition& where = error.where();
    std::string place;
    if (!where.file.empty()) {
        place = where.file + ":";
        if (where.line > 0) place += std::to_string(where.line) + ":";
        if (where.line > 0 && where.column > 0) place += std::to_string(where.column) + ":";
        place += " ";
    }
    print_error(place + error.what());
}
void print_note(std::string_view message) { print_labelled("note:", Style::cyan, message); }

int terminal_width(std::FILE* stream, int otherwise) {
    winsize size{};
    if (::ioctl(::fileno(stream), TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return otherwise;
    return size.ws_col;
}

std::string json_text(const nlohmann::ordered_json& json) {
    // The dump leaves U+007F and on as they are; outside of its strings there are newlines alone.
    return escaped(json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace), "\n");
}

std::string human_duration(double seconds) {
    // More than a year is a guess from too few steps; it also keeps the conversion in range.
    if (!(seconds < 3.2e7)) return "> 1 year";
    const auto whole = std::uint64_t(std::llround(std::max(0.0, seconds)));
    const std::uint64_t hours = whole / 3600, minutes = whole / 60 % 60, rest = whole % 60;
    return hours > 0 ? fmt::format("{}:{:02}:{:02}", hours, minutes, rest)
                     : fmt::format("{}:{:02}", minutes, rest);
}

std::string human_count(std::uint64_t count) {
    std::string digits = std::to_string(count);
    for (std::size_t at = digits.size(); at > 3;) {
        at -= 3;
        digits.insert(at, 1, ',');
    }
    return digits;
}

ProgressBar::ProgressBar(std::string unit, std::uint64_t start, std::uint64_t total, bool enabled)
    : unit_(std::move(unit)),
      start_(start),
      total_(total),
      enabled_(enabled && is_terminal(stderr) && !dumb_terminal()),
      unicode_(unicode_locale()),
      begin_(Clock::now()),
      last_(begin_) {}

ProgressBar::~ProgressBar() { clear(); }

void ProgressBar::update(std::uint64_t done, std::string_view detail) {
    if (!enabled_) return;
    const Clock::time_point now = Clock::now();
    if (drawn_ && now - last_ < std::chrono::milliseconds(100)) return;
    last_ = now;
    drawn_ = true;
    const double elapsed_s = std::chrono::duration<double>(now - begin_).count();
    // One column stays free: some terminals wrap when the last one is written.
    const int width = terminal_width(stderr, 80) - 1;
    print_sequences(
        fmt::format("\r{}\033[K", text(unit_, start_, done, total_, elapsed_s, detail, width, unicode_)));
}

void ProgressBar::clear() {
    if (!drawn_) return;
    print_sequences("\r\033[K");
    drawn_ = false;
}

std::string ProgressBar::text(std::string_view unit, std::uint64_t start, std::uint64_t done,
                              std::uint64_t total, double elapsed_s, std::string_view detail, int width,
                              bool unicode) {
    const double fraction = total == 0 ? 1.0 : std::min(1.0, double(done) / double(total));
    std::string left = fmt::format("{} {}/{}", unit, human_count(done), human_count(total));
    std::string right = fmt::format("{:3.0f}%", std::floor(100 * fraction));
    if (done > start && elapsed_s > 0) {
        const double rate = double(done - start) / elapsed_s;
        right += rate >= 1 ? fmt::format("  {:.1f} {}s/s", rate, unit)
                           : fmt::format("  {:.1f} s/{}", 1 / rate, unit);
        if (done < total) right += fmt::format("  {} left", human_duration(double(total - done) / rate));
    }
    if (!detail.empty()) right += fmt::format("  {}", detail);

    const int room = width - int(left.size() + right.size()) - 4;
    if (room < 5) {
        std::string line = fmt::format("{}  {}", left, right);
        if (int(line.size()) > width) line.resize(std::size_t(std::max(0, width)));
        return line;
    }
    const int columns = std::min(room, 40);
    const int filled = int(std::floor(fraction * columns));
    return fmt::format("{}  {}{}  {}", left, repeat(unicode ? "━" : "#", filled),
                       repeat(unicode ? "─" : "-", columns - filled), right);
}

}  // namespace nephos
