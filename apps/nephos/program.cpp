// SPDX-License-Identifier: Apache-2.0

// The command line: parses, calls one subcommand, and turns what went wrong into a message and an exit
// status.
//
//     0 done    1 a check failed    2 usage or scene    3 input or output    4 GPU    130 Ctrl-C    143
//     SIGTERM

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <sys/types.h>
#include <unistd.h>

#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "apps/nephos/terminal.h"
#include "core/error.h"
#include "core/memory.h"
#include "core/threads.h"
#include "scenes/format/errors.h"

namespace nephos {
namespace {

constexpr int kUsage = int(ErrorCode::usage);
constexpr int kIo = int(ErrorCode::io);

// The subcommand that was being parsed, or the whole.
const CLI::App& parsed_app(const CLI::App& app) {
    const std::vector<CLI::App*> chosen = app.get_subcommands();
    return chosen.empty() ? app : *chosen.front();
}

// The command or option that an unknown argument was probably meant to be.
std::string suggestion(const CLI::App& app, const std::string& word) {
    std::vector<std::string> names;
    if (word.starts_with("-")) {
        for (const CLI::Option* option : app.get_options()) {
            for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
        }
    } else if (app.get_parent() == nullptr) {
        for (const CLI::App* sub : app.get_subcommands({})) names.push_back(sub->get_name());
    }
    const std::vector<std::string_view> candidates(names.begin(), names.end());
    const std::string_view closest = closest_word(word.substr(0, word.find('=')), candidates);
    return closest.empty() ? "" : ": did you mean `" + std::string(closest) + "`?";
}

std::string explain(const CLI::App& app, const CLI::ParseError& error) {
    std::vector<std::string> words = app.remaining(true);
    if (words.empty() && app.get_parent() != nullptr) words = app.get_parent()->remaining(false);
    std::erase(words, "--");  // behind which they may stand
    // A command that is misspelt is to the parser one that is missing.
    const bool no_command = app.get_parent() == nullptr && !words.empty();
    if (no_command || dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
        const std::string word = words.empty() ? "" : words.front();
        const char* kind = word.starts_with("-") ? "unknown option" : "unexpected argument";
        if (app.get_parent() == nullptr && !word.starts_with("-")) kind = "unknown command";
        return std::string(kind) + " `" + word + "`" + suggestion(app, word);
    }
    if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
        if (app.get_parent() == nullptr) return "a command is missing";
        for (const CLI::Option* option : app.get_options()) {
            if (option->get_required() && option->count() == 0) return option_label(*option) + " is missing";
        }
    }
    if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) {
        for (const CLI::Option* option : app.get_options()) {
            const std::string name = option->get_name();
            if (!name.empty() && std::string(error.what()).find(name) != std::string::npos) {
                return option_label(*option) + ": the value is missing, or given more than once";
            }
        }
    }
    return error.what();
}

int report_usage(const CLI::App& app, const std::string& message) {
    const std::string command = app.get_parent() == nullptr ? "nephos" : "nephos " + app.get_name();
    print_error(message);
    print_message("usage: " + usage_line(app) + "\n       `" + command + " --help` explains them\n");
    return kUsage;
}

int report(const Error& error) {
    print_error(error);
    return int(error.code());
}

// An option with a value that is empty, such as `--out=`: the parser would take the next argument for it.
std::string_view option_without_value(int argc, const char* const* argv) {
    for (int n = 1; n < argc; ++n) {
        const std::string_view word = argv[n];
        if (word == "--") break;
        if (word.starts_with("--") && word.find('=') == word.size() - 1) return word;
    }
    return {};
}

// An option or argument whose value is an empty text, as of a variable of a script that is not set: nothing takes one, and
// much would take it for an option that is not there.
const CLI::Option* option_with_empty_value(const CLI::App& command) {
    for (const CLI::Option* option : command.get_options())
        if (option->count() > 0 && std::ranges::count(option->results(), "") > 0) return option;
    return nullptr;
}

int run_command(CLI::App& app, int argc, const char* const* argv, const EditFunction& edit) {
    Action action;
    add_commands(app, action, edit);
    if (const std::string_view option = option_without_value(argc, argv); !option.empty())
        return report_usage(
            app, "`" + std::string(option) + "` has no value: expected " + std::string(option) + "VALUE");
    try {
        app.parse(argc, argv);
    } catch (const CLI::CallForHelp&) {
        Output().write_styled(parsed_app(app).help());
        return 0;
    } catch (const CLI::CallForVersion& version) {
        Output().line(version.what());
        return 0;
    } catch (const CLI::ParseError& error) {
        const CLI::App& command = parsed_app(app);
        return report_usage(command, explain(command, error));
    } catch (const Error& error) {  // from the checked conversion of a value (arguments.h)
        return report_usage(parsed_app(app), error.what());
    }
    const CLI::App& command = parsed_app(app);
    if (const CLI::Option* option = option_with_empty_value(command)) {
        const std::string name =
            option->get_lnames().empty() ? option->get_name() : "--" + option->get_lnames().front();
        return report_usage(command, name + " is empty: expected " + option->get_type_name());
    }
    return action();
}

constexpr std::string_view kNoThread =
    "cannot start another thread: expected a higher limit of processes or addresses (`ulimit -a`), or fewer "
    "threads (-j 1)";

// Returns whether this thread may tell why the program ends: one of several that end it at once does, and the others wait for that,
// five seconds at most.
bool may_tell() {
    static std::atomic<pid_t> teller = 0;
    const pid_t own = ::gettid();
    for (int tenths_s = 0; tenths_s < 50; ++tenths_s) {
        pid_t before = 0;
        if (teller.compare_exchange_strong(before, own) || before == own) return true;
        ::usleep(100'000);
    }
    return false;
}

// Tells the exception that is being handled, and returns the exit status for it.
int report_exception() {
    try {
        throw;
    } catch (const SceneErrors& error) {
        print_scene_errors(error);
        return int(error.code());
    } catch (const Error& error) {
        return report(error);
    } catch (const std::bad_alloc&) {
        print_error("out of memory");
        return kIo;
    } catch (const std::filesystem::filesystem_error& error) {
        print_error(error.path1().string() + ": " + error.code().message());
        return kIo;
    } catch (const std::exception& error) {
        print_error(is_lack_of_threads(error) ? std::string(kNoThread)
                                              : std::string("unexpected: ") + error.what());
        return kIo;
    }
}

int told_status = -1;  // the exit status, once its reason has been told

// The only place where exceptions end.
int guarded(int argc, const char* const* argv, const EditFunction& edit) {
    CLI::App app;
    try {
        const int status = run_command(app, argc, argv, edit);
        Output().flush();
        return status;
    } catch (const OutputClosed&) {
        return 0;
    } catch (const std::exception&) {
        may_tell();  // or another thread has ended the program
        told_status = report_exception();
        return told_status;
    }
}

pid_t program = 0;
std::terminate_handler ends_otherwise = nullptr;

// Tells a lack of memory or of threads, which libraries meet where no exception may leave them, in place of an abort: files are
// whole or absent then, as after a signal. Threads that end at once tell it once. All else, and children of the program, end as
// they would.
[[noreturn]] void end_and_tell() {
    std::string_view told;
    try {
        if (std::current_exception()) throw;
    } catch (const std::bad_alloc&) {
        told = "out of memory";
    } catch (const std::exception& error) {
        if (is_lack_of_threads(error)) told = kNoThread;
    } catch (...) {
    }
    if (!told.empty() && ::getpid() == program) {
        if (may_tell()) {
            if (told_status >= 0) ::_exit(told_status);  // a library's, at the program's end
            char line[256];  // in one piece, and without memory
            const auto end = fmt::format_to_n(line, sizeof line, "error: {}\n", told).out;
            [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, line, std::size_t(end - line));
        }
        ::_exit(kIo);
    }
    ends_otherwise();
    std::abort();
}

}  // namespace

int run_program(int argc, const char* const* argv, const EditFunction& edit) {
    keep_freed_memory();
    install_signal_handlers();
    program = ::getpid();
    ends_otherwise = std::set_terminate(end_and_tell);
    return guarded(argc, argv, edit);
}

}  // namespace nephos
