// SPDX-License-Identifier: Apache-2.0
#include "apps/nephos/man_page.h"

#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "apps/nephos/terminal.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "simulation/simulation.h"

namespace nephos {
namespace {

// Returns the text with what troff would take for a request or an escape made harmless. A plain hyphen may become a
// typographic one, which nobody can paste into a shell: it is written as a minus.
std::string troff(std::string_view text) {
    std::string out;
    bool line_begins = true;
    for (const char c : text) {
        if (line_begins && (c == '.' || c == '\'')) out += "\\&";
        line_begins = c == '\n';
        if (c == '\\') {
            out += "\\e";
        } else if (c == '-') {
            out += "\\-";
        } else {
            out += c;
        }
    }
    return out;
}

std::string page_name(const CLI::App& app) {
    const CLI::App* parent = app.get_parent();
    return parent == nullptr ? app.get_name() : parent->get_name() + "-" + app.get_name();
}

std::string entry(const std::string& label, const std::string& text) {
    return fmt::format(".TP\n.B {}\n{}\n", troff(label), troff(text));
}

// The options under their headings, in the order of --help: the general ones last.
std::string options_text(const CLI::App& app) {
    std::string arguments, general;
    std::vector<std::pair<std::string, std::string>> groups;
    for (const CLI::Option* option : app.get_options()) {
        const std::string& heading = option->get_group();
        if (heading.empty()) continue;
        const std::string text = entry(option_label(*option), option->get_description());
        if (option->get_positional()) {
            arguments += text;
        } else if (heading == "General") {
            general += text;
        } else {
            if (groups.empty() || groups.back().first != heading) groups.emplace_back(heading, "");
            groups.back().second += text;
        }
    }
    std::string out;
    if (!arguments.empty()) out += ".SH ARGUMENTS\n" + arguments;
    out += ".SH OPTIONS\n";
    for (const auto& [heading, text] : groups)
        out += (heading == "Options" ? "" : fmt::format(".SS \"{}\"\n", troff(heading))) + text;
    return out + (groups.empty() ? "" : ".SS General\n") + general;
}

// The examples and notes below the options of --help, whose lines stay as they are.
std::string footer_text(const CLI::App& app) {
    std::string footer = app.get_footer();
    if (footer.empty()) return "";
    constexpr std::string_view kExamples = "Examples:\n";
    const bool examples = footer.starts_with(kExamples);
    if (examples) footer.erase(0, kExamples.size());
    return fmt::format(".SH {}\n.nf\n{}\n.fi\n", examples ? "EXAMPLES" : "NOTES", troff(footer));
}

constexpr const char* kExitStatus =
    "0 done, 1 a check failed, 2 usage or scene, 3 input or output, 4 GPU, 130 stopped by Ctrl\\-C, 143 by "
    "SIGTERM, 129 by SIGHUP.";

// The program that `nephos edit` becomes takes its arguments.
std::string editor_page(const CLI::App& edit) {
    const std::string name = "nephos-editor";
    const std::string command = edit.get_parent()->get_name() + " " + edit.get_name();
    std::string usage = usage_line(edit);
    usage.replace(0, command.size(), name);
    return man_page(edit, {name, usage, kExitStatus, {"nephos", page_name(edit)}});
}

}  // namespace

std::string man_page(const CLI::App& app, const ManPageTexts& texts) {
    std::string out = fmt::format(
        ".TH {} 1 \"\" \"nephos {}\" \"nephos\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n{}\n", texts.name,
        version(), troff(texts.name), troff(app.get_description()), troff(texts.usage));
    const std::vector<const CLI::App*> commands = app.get_subcommands({});
    if (!commands.empty()) out += ".SH COMMANDS\n";
    for (const CLI::App* command : commands) out += entry(command->get_name(), command->get_description());
    out += options_text(app) + footer_text(app);
    if (!texts.exit_status.empty()) out += ".SH EXIT STATUS\n" + texts.exit_status + "\n";
    out += ".SH SEE ALSO\n";
    for (std::size_t n = 0; n < texts.see_also.size(); ++n)
        out +=
            fmt::format(".BR {} (1){}\n", troff(texts.see_also[n]), n + 1 < texts.see_also.size() ? "," : "");
    return out;
}

std::string man_page(const CLI::App& app) {
    if (app.get_parent() != nullptr)
        return man_page(app, {page_name(app), usage_line(app), kExitStatus, {page_name(*app.get_parent())}});
    std::vector<std::string> pages;
    for (const CLI::App* command : app.get_subcommands({})) pages.push_back(page_name(*command));
    return man_page(app, {page_name(app), usage_line(app), "", pages});
}

void add_man_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("man", "Print the manual page of a command");
    struct Arguments {
        std::string name, folder;
    };
    const auto a = std::make_shared<Arguments>();
    command->add_option("COMMAND", a->name, "A command (default: the page of nephos itself)")
        ->type_name("COMMAND");
    command->add_option("-o,--out", a->folder, "Write all pages into this folder instead")->type_name("DIR");
    command->footer(
        "Examples:\n"
        "  nephos man run | man -l -\n"
        "  nephos man --out ~/.local/share/man/man1");
    command->callback([&app, &action, a] {
        action = [&app, a] {
            if (!a->folder.empty()) {
                if (!a->name.empty())
                    throw Error(ErrorCode::usage,
                                "COMMAND and --out exclude each other: --out writes all pages");
                const auto write = [&](const CLI::App& page) {
                    write_atomically(std::filesystem::path(a->folder) / (page_name(page) + ".1"),
                                     std::string_view(man_page(page)));
                };
                write(app);
                for (const CLI::App* page : app.get_subcommands({})) write(*page);
                return 0;
            }
            if (a->name.empty()) {
                Output().write(man_page(app));
                return 0;
            }
            std::vector<std::string> names;
            for (const CLI::App* page : app.get_subcommands({})) {
                if (page->get_name() == a->name) {
                    Output().write(man_page(*page));
                    return 0;
                }
                names.push_back(page->get_name());
            }
            if (a->name == "nephos-editor") {
                Output().write(editor_page(*app.get_subcommand("edit")));
                return 0;
            }
            throw Error(ErrorCode::usage,
                        fmt::format("COMMAND '{}' is not one of {}", a->name, fmt::join(names, ", ")));
        };
    });
}

}  // namespace nephos
