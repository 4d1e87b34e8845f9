// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <sstream>
#include <utility>
#include <vector>

#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"

namespace nephos {
namespace {

constexpr int kMaxWidth = 100;

// Appends `text`, wrapped between columns `indent` and `width`, the first line starting at column `at`.
void wrap(std::string& out, const std::string& text, int at, int indent, int width) {
    std::istringstream words(text);
    int column = at;
    bool first = true;
    for (std::string word; words >> word; first = false) {
        if (!first && column + 1 + int(word.size()) > width) {
            out += '\n' + std::string(std::size_t(indent), ' ');
            column = indent;
            first = true;
        }
        if (!first) {
            out += ' ';
            ++column;
        }
        out += word;
        column += int(word.size());
    }
    out += '\n';
}

using Rows = std::vector<std::pair<std::string, std::string>>;

// Two columns under a heading: "  label   description". Labels that are too long for theirs get a line of
// their own.
void table(std::string& out, const std::string& heading, const Rows& rows, int width) {
    if (rows.empty()) return;
    out += '\n' + styled(heading, Style::bold, colours_on(stdout)) + '\n';
    constexpr std::size_t kMaxLabel = 24;
    std::size_t column = 0;
    for (const auto& [label, text] : rows) {
        if (label.size() <= kMaxLabel) column = std::max(column, label.size());
    }
    const int indent = int(column) + 4;
    for (const auto& [label, text] : rows) {
        out += "  " + label;
        if (int(label.size()) + 4 > indent) {
            out += '\n' + std::string(std::size_t(indent), ' ');
        } else {
            out += std::string(std::size_t(indent) - 2 - label.size(), ' ');
        }
        wrap(out, text, indent, indent, width);
    }
}

}  // namespace

std::string option_label(const CLI::Option& option) {
    if (option.get_positional()) return option.get_name(true, false);
    std::string label;
    for (const std::string& name : option.get_snames()) label += "-" + name + ", ";
    for (const std::string& name : option.get_lnames()) label += "--" + name + ", ";
    label.resize(label.size() - 2);
    if (option.get_type_size() != 0) label += " " + option.get_type_name();
    return label;
}

std::string usage_line(const CLI::App& app) {
    const CLI::App* parent = app.get_parent();
    std::string line = parent == nullptr ? app.get_name() : parent->get_name() + " " + app.get_name();
    bool options = false;
    for (const CLI::Option* option : app.get_options()) {
        if (option->get_positional()) {
            const std::string name =
                option->get_name(true, false) + (option->get_expected_max() > 1 ? "..." : "");
            line += option->get_required() ? " " + name : " [" + name + "]";
        } else if (option->get_required()) {
            line += " " + option_label(*option);
        } else {
            options = true;
        }
    }
    if (!app.get_subcommands({}).empty()) return line + " COMMAND [options]";
    return line + (options ? " [options]" : "");
}

std::string HelpPage::make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const {
    const int width = std::min(terminal_width(stdout, kMaxWidth), kMaxWidth);
    std::string out;
    wrap(out, app->get_description(), 0, 0, width);
    out += '\n' + styled("Usage:", Style::bold, colours_on(stdout)) + ' ' + usage_line(*app) + '\n';

    Rows commands;
    for (const CLI::App* sub : app->get_subcommands({}))
        commands.emplace_back(sub->get_name(), sub->get_description());
    table(out, "Commands:", commands, width);

    Rows positionals;
    std::vector<std::pair<std::string, Rows>> groups;
    for (const CLI::Option* option : app->get_options()) {
        if (option->get_group().empty()) continue;
        std::pair row(option_label(*option), option->get_description());
        if (option->get_positional()) {
            positionals.push_back(std::move(row));
            continue;
        }
        const auto same = [&](const auto& group) { return group.first == option->get_group(); };
        auto group = std::find_if(groups.begin(), groups.end(), same);
        if (group == groups.end()) group = groups.insert(group, {option->get_group(), {}});
        group->second.push_back(std::move(row));
    }
    table(out, "Arguments:", positionals, width);
    // The general group (help) last, under the others.
    std::stable_partition(groups.begin(), groups.end(),
                          [](const auto& group) { return group.first != "General"; });
    for (const auto& [heading, rows] : groups) table(out, heading + ":", rows, width);

    if (!app->get_footer().empty()) out += '\n' + app->get_footer() + '\n';
    return out;
}

}  // namespace nephos
