// SPDX-License-Identifier: Apache-2.0

#include <memory>
#include <vector>

#include <fmt/format.h>

#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"

namespace nephos {
namespace {

// What completes the value of an option or a positional, by its type name.
enum class Value { none, file, folder, shell, free };

Value value_of(const CLI::Option& option) {
    if (option.get_items_expected_max() == 0) return Value::none;  // a flag
    const std::string type = option.get_type_name();
    if (type == "DIR") return Value::folder;
    if (type == "SHELL") return Value::shell;
    for (const char* file : {"SCENE", "FILE", "FILE.vdb", "IMG"}) {
        if (type == file) return Value::file;
    }
    return Value::free;
}

std::vector<std::string> names_of(const CLI::Option& option) {
    std::vector<std::string> names;
    for (const std::string& name : option.get_snames()) names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
    return names;
}

// The first sentence part of a description, without characters that mean something in a shell's description.
std::string summary(const std::string& text) {
    std::string result;
    for (const char c : text.substr(0, text.find(';'))) {
        if (std::string_view("'\"`[]\\:$").find(c) == std::string_view::npos) result += c;
    }
    return result;
}

std::string join(const std::vector<std::string>& words, const char* separator) {
    return fmt::format("{}", fmt::join(words, separator));
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) { return app.get_subcommands({}); }

std::vector<const CLI::Option*> options_of(const CLI::App& app, bool positional) {
    std::vector<const CLI::Option*> options;
    for (const CLI::Option* option : app.get_options()) {
        if (option->get_positional() == positional) options.push_back(option);
    }
    return options;
}

// Options of all commands whose value is of this kind, as a bash pattern "--out|--from".
std::string bash_pattern(const CLI::App& command, Value kind) {
    std::vector<std::string> names;
    for (const CLI::Option* option : options_of(command, false)) {
        if (value_of(*option) != kind) continue;
        for (const std::string& name : names_of(*option)) names.push_back(name);
    }
    return join(names, "|");
}

std::string bash_command(const CLI::App& command) {
    std::string out = fmt::format("        {})\n            case $previous in\n", command.get_name());
    const auto branch = [&](Value kind, const char* action) {
        const std::string pattern = bash_pattern(command, kind);
        if (!pattern.empty()) out += fmt::format("                {}) {} ;;\n", pattern, action);
    };
    branch(Value::file, "mapfile -t COMPREPLY < <(compgen -f -- \"$current\"); return");
    branch(Value::folder, "mapfile -t COMPREPLY < <(compgen -d -- \"$current\"); return");
    branch(Value::free, "return");
    out += "            esac\n";
    std::vector<std::string> words;
    for (const CLI::Option* option : options_of(command, false)) {
        for (const std::string& name : names_of(*option)) words.push_back(name);
    }
    out += fmt::format("            words='{}'\n", join(words, " "));
    for (const CLI::Option* option : options_of(command, true)) {
        if (value_of(*option) == Value::shell) out += "            positionals='bash zsh fish'\n";
        if (value_of(*option) == Value::file) out += "            paths=-f\n";
        if (value_of(*option) == Value::folder)
            out += "            paths=${paths:--d}\n";  // files where either may stand
    }
    return out + "            ;;\n";
}

std::string bash_script(const CLI::App& app) {
    std::vector<std::string> commands, options;
    for (const CLI::App* command : commands_of(app)) commands.push_back(command->get_name());
    for (const CLI::Option* option : options_of(app, false)) {
        for (const std::string& name : names_of(*option)) options.push_back(name);
    }
    std::string out =
        "# bash completion for nephos; to use it: source <(nephos completion bash)\n"
        "_nephos() {\n"
        "    local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD-1]}\n"
        "    local words= positionals= paths= IFS=$' \\t\\n'\n"
        "    COMPREPLY=()\n";
    out += fmt::format(
        "    if ((COMP_CWORD == 1)); then\n"
        "        COMPREPLY=($(compgen -W '{} {}' -- \"$current\"))\n"
        "        return\n"
        "    fi\n"
        "    case ${{COMP_WORDS[1]}} in\n",
        join(commands, " "), join(options, " "));
    for (const CLI::App* command : commands_of(app)) out += bash_command(*command);
    out +=
        "    esac\n"
        "    if [[ $current == -* ]]; then\n"
        "        COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
        "        return\n"
        "    fi\n"
        "    COMPREPLY=($(compgen -W \"$positionals\" -- \"$current\"))\n"
        "    if [[ $paths ]]; then\n"
        "        mapfile -t -O ${#COMPREPLY[@]} COMPREPLY < <(compgen $paths -- \"$current\")\n"
        "    fi\n"
        "}\n"
        "complete -o filenames -F _nephos nephos\n";
    return out;
}

// One argument of zsh's _arguments.
std::string zsh_spec(const CLI::Option& option) {
    std::string value;
    switch (value_of(option)) {
        case Value::none:
            break;
        case Value::file:
            value = fmt::format(":{}:_files", option.get_type_name());
            break;
        case Value::folder:
            value = fmt::format(":{}:_files -/", option.get_type_name());
            break;
        case Value::shell:
            value = ":shell:(bash zsh fish)";
            break;
        case Value::free:
            value = fmt::format(":{}: ", summary(option.get_type_name()));
            break;
    }
    if (option.get_positional()) {
        const char* repeat = option.get_expected_max() > 1 ? "*" : "";
        return fmt::format("            '{}{}' \\\n", repeat, value);
    }
    const std::vector<std::string> names = names_of(option);
    const bool repeated =
        option.get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll && !value.empty();
    std::string out;
    for (const std::string& name : names) {
        const std::string others = repeated ? "*" : fmt::format("({})", join(names, " "));
        out += fmt::format("            '{}{}[{}]{}' \\\n", others, name, summary(option.get_description()),
                           value);
    }
    return out;
}

std::string zsh_script(const CLI::App& app) {
    std::string out =
        "#compdef nephos\n"
        "# zsh completion for nephos; to use it: nephos completion zsh > a folder of $fpath/_nephos\n"
        "_nephos() {\n"
        "    local -a commands\n"
        "    commands=(\n";
    for (const CLI::App* command : commands_of(app)) {
        out += fmt::format("        '{}:{}'\n", command->get_name(), summary(command->get_description()));
    }
    out +=
        "    )\n"
        "    if ((CURRENT == 2)); then\n"
        "        _describe command commands\n"
        "        _arguments \\\n";
    for (const CLI::Option* option : options_of(app, false)) out += zsh_spec(*option);
    out +=
        "            && return\n"
        "        return\n"
        "    fi\n"
        "    local command=$words[2]\n"
        "    shift words\n"
        "    ((CURRENT--))\n"
        "    case $command in\n";
    for (const CLI::App* command : commands_of(app)) {
        out += fmt::format("    {})\n        _arguments \\\n", command->get_name());
        for (const bool positional : {false, true}) {
            for (const CLI::Option* option : options_of(*command, positional)) out += zsh_spec(*option);
        }
        out += "            && return\n        ;;\n";
    }
    out +=
        "    esac\n"
        "}\n"
        "if [[ $funcstack[1] == _nephos ]]; then _nephos \"$@\"; else compdef _nephos nephos; fi\n";
    return out;
}

std::string fish_option(const CLI::Option& option, const std::string& condition) {
    std::string out = fmt::format("complete -c nephos -n '{}'", condition);
    for (const std::string& name : option.get_snames()) out += " -s " + name;
    for (const std::string& name : option.get_lnames()) out += " -l " + name;
    switch (value_of(option)) {
        case Value::none:
            break;
        case Value::file:
            out += " -r -F";
            break;
        case Value::folder:
            out += " -x -a '(__fish_complete_directories)'";
            break;
        case Value::shell:
            out += " -x -a 'bash zsh fish'";
            break;
        case Value::free:
            out += " -x";
            break;
    }
    return out + fmt::format(" -d '{}'\n", summary(option.get_description()));
}

std::string fish_script(const CLI::App& app) {
    std::string out =
        "# fish completion for nephos; to use it: nephos completion fish > "
        "~/.config/fish/completions/nephos.fish\n"
        "complete -c nephos -f\n";
    for (const CLI::Option* option : options_of(app, false))
        out += fish_option(*option, "__fish_use_subcommand");
    for (const CLI::App* command : commands_of(app)) {
        out += fmt::format("complete -c nephos -n '__fish_use_subcommand' -a {} -d '{}'\n",
                           command->get_name(), summary(command->get_description()));
        const std::string condition = "__fish_seen_subcommand_from " + command->get_name();
        for (const CLI::Option* option : options_of(*command, false)) out += fish_option(*option, condition);
        for (const CLI::Option* option : options_of(*command, true)) {
            if (value_of(*option) == Value::shell) {
                out += fmt::format("complete -c nephos -n '{}' -a 'bash zsh fish'\n", condition);
            } else {
                out += fmt::format("complete -c nephos -n '{}' -F\n", condition);
            }
        }
    }
    return out;
}

}  // namespace

std::string completion_script(const CLI::App& app, const std::string& shell) {
    if (shell == "bash") return bash_script(app);
    if (shell == "zsh") return zsh_script(app);
    if (shell == "fish") return fish_script(app);
    throw Error(ErrorCode::usage, fmt::format("SHELL '{}' is not one of bash, zsh and fish", shell));
}

void add_completion_command(CLI::App& app, Action& action) {
    CLI::App* command = app.add_subcommand("completion", "Print a completion script for a shell");
    const auto shell = std::make_shared<std::string>();
    command->add_option("SHELL", *shell, "bash, zsh or fish")->required()->type_name("SHELL");
    command->footer(
        "Examples:\n"
        "  source <(nephos completion bash)                                       in ~/.bashrc\n"
        "  nephos completion zsh > ~/.zfunc/_nephos                               with ~/.zfunc in $fpath\n"
        "  nephos completion fish > ~/.config/fish/completions/nephos.fish");
    command->callback([&app, &action, shell] {
        action = [&app, shell] {
            Output().write(completion_script(app, *shell));
            return 0;
        };
    });
}

}  // namespace nephos
