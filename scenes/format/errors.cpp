// SPDX-License-Identifier: Apache-2.0
#include "scenes/format/errors.h"

#include <algorithm>
#include <cctype>
#include <tuple>
#include <utility>

#include "scenes/format/text.h"

namespace nephos {
namespace {

// Blanks as wide as the part of `line` before the caret; tabs stay tabs.
std::string indent_to(std::string_view line, int caret) {
    std::string out;
    std::size_t offset = 0;
    for (int n = 1; n < caret && offset < line.size(); ++n) {
        const Character character = character_at(line, offset);
        if (character.code == '\t') {
            out += '\t';
        } else {
            out.append(std::size_t(display_width(character.code)), ' ');
        }
        offset += character.bytes.size();
    }
    return out;
}

std::string headline(const Problem& problem) {
    std::string out = printable(problem.where.file);
    for (const int number : {problem.where.line, problem.where.column}) {
        if (problem.where.line > 0) (out += ':') += std::to_string(number);
    }
    return out + ": error: " + problem.message + "\n";
}

std::string message_of(const std::vector<Problem>& problems) {
    std::string text = format(std::span<const Problem>(problems));
    text.pop_back();  // a message ends without a newline
    return text;
}

SourcePosition first_place(const std::vector<Problem>& problems) {
    return problems.empty() ? SourcePosition{} : problems.front().where;
}

// Cost of replacing one letter by another, in halves: the other case of the same letter is a smaller slip.
int replacement_cost(char a, char b) {
    if (a == b) return 0;
    const auto lower = [](char c) { return std::tolower(static_cast<unsigned char>(c)); };
    return lower(a) == lower(b) ? 1 : 2;
}

// Optimal string alignment distance, in halves of an edit.
int edit_distance(std::string_view a, std::string_view b) {
    std::vector<int> before(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
    for (std::size_t j = 0; j <= b.size(); ++j) above[j] = int(2 * j);
    for (std::size_t i = 1; i <= a.size(); ++i) {
        row[0] = int(2 * i);
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const int replaced = above[j - 1] + replacement_cost(a[i - 1], b[j - 1]);
            row[j] = std::min({above[j] + 2, row[j - 1] + 2, replaced});
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
                row[j] = std::min(row[j], before[j - 2] + 2);
            }
        }
        std::swap(before, above);
        std::swap(above, row);
    }
    return above[b.size()];
}

}  // namespace

std::string format(const Problem& problem) {
    std::string out = headline(problem);
    std::string number = " ";
    if (problem.where.line > 0) number += std::to_string(problem.where.line);
    const std::string blank(number.size(), ' ');
    if (!problem.source_line.empty()) {
        out += number + " | " + problem.source_line + "\n";
        if (problem.caret > 0) out += blank + " | " + indent_to(problem.source_line, problem.caret) + "^\n";
    }
    if (!problem.expected.empty()) out += blank + " = " + problem.expected + "\n";
    return out;
}

std::string format(std::span<const Problem> problems) {
    std::string out;
    for (const Problem& problem : problems) out += format(problem) + "\n";
    return out + std::to_string(problems.size()) + (problems.size() == 1 ? " error\n" : " errors\n");
}

SceneErrors::SceneErrors(std::vector<Problem> problems, ErrorCode code)
    : Error(code, message_of(problems), first_place(problems)), problems_(std::move(problems)) {}

void throw_problems(std::vector<Problem> problems, const std::string& scene_file, ErrorCode code) {
    const auto order = [&](const Problem& problem) {
        return std::make_tuple(problem.where.line == 0,
                               problem.where.file == scene_file ? std::string() : problem.where.file,
                               problem.where.line, problem.where.column);
    };
    std::ranges::stable_sort(problems, [&](const Problem& a, const Problem& b) { return order(a) < order(b); });
    if (problems.size() >= kMostProblems) {
        problems.resize(kMostProblems);
        Problem more;
        more.where.file = problems.front().where.file;
        more.message = "too many errors, only the first " + std::to_string(problems.size()) + " are listed";
        problems.push_back(std::move(more));
    }
    throw SceneErrors(std::move(problems), code);
}

std::string_view closest_word(std::string_view word, std::span<const std::string_view> candidates) {
    constexpr std::size_t kLongestWord =
        64;  // longer ones are no slip of the fingers, and the cost is quadratic
    if (word.empty() || word.size() > kLongestWord) return {};
    for (const std::string_view candidate : candidates) {  // the unit was left out: "elevation"
        if (candidate.size() > word.size() && candidate.starts_with(word) && candidate[word.size()] == '_') {
            return candidate;
        }
    }
    std::string_view best;
    int best_distance = 2 * std::max(1, int(word.size() + 1) / 3) + 1;
    for (const std::string_view candidate : candidates) {
        const int distance = edit_distance(word, candidate);
        if (distance < best_distance) {
            best = candidate;
            best_distance = distance;
        }
    }
    return best;
}

}  // namespace nephos
