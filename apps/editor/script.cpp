// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/script.h"

#define GLFW_INCLUDE_NONE
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <map>
#include <sstream>

#include <GLFW/glfw3.h>

#include "apps/editor/field_text.h"
#include "core/atomic_file.h"
#include "core/error.h"
#include "core/text.h"

namespace nephos {
namespace {

constexpr std::chrono::seconds kPatience{10}, kPatienceOfEnd{20}, kLongPatience{60};
constexpr double kMostPixels = 16384;

const std::map<std::string, int>& commands() {  // and how many words follow at least
    static const std::map<std::string, int> known{{"click", 1},      {"click-at", 3},  {"double-click-at", 3},
                                                  {"picture", 1},    {"drag", 3},      {"set", 2},
                                                  {"type", 1},       {"key", 1},       {"patience", 1},
                                                  {"wait", 1},       {"wait-step", 1}, {"wait-picture", 0},
                                                  {"screenshot", 1}, {"hashes", 1},    {"expect-control", 1},
                                                  {"resize", 2},     {"drop", 1},      {"minimise", 0},
                                                  {"restore", 0},    {"random", 2},    {"close-window", 0},
                                                  {"expect-end", 0}, {"quit", 0}};
    return known;
}

std::string rest_of(const std::vector<std::string>& words, std::size_t from) {
    std::string out;
    for (std::size_t n = from; n < words.size(); ++n) out += (n > from ? " " : "") + words[n];
    return out;
}

// Tells whether the picture in the window is that of the present scene, view and step, with all its detail where
// nothing moves.
bool picture_is_whole(const Editor& editor) {
    const LiveStatus status = editor.live->status();
    if (!editor.picture || editor.shown_version != editor.document->version()) return false;
    const LivePicture& picture = *editor.picture;
    if (picture.scene_number != status.scenes || picture.step != status.step || status.goal != status.step)
        return false;
    return editor.running || (picture.refined && picture.view == editor.view);
}

}  // namespace

int key_code(const std::string& name) {
    static const std::map<std::string, int> named{{"SPACE", GLFW_KEY_SPACE},
                                                  {"ENTER", GLFW_KEY_ENTER},
                                                  {"ESCAPE", GLFW_KEY_ESCAPE},
                                                  {"DELETE", GLFW_KEY_DELETE},
                                                  {"BACKSPACE", GLFW_KEY_BACKSPACE},
                                                  {"HOME", GLFW_KEY_HOME},
                                                  {"END", GLFW_KEY_END},
                                                  {"TAB", GLFW_KEY_TAB},
                                                  {"LEFT", GLFW_KEY_LEFT},
                                                  {"RIGHT", GLFW_KEY_RIGHT},
                                                  {"UP", GLFW_KEY_UP},
                                                  {"DOWN", GLFW_KEY_DOWN},
                                                  {".", GLFW_KEY_PERIOD},
                                                  {",", GLFW_KEY_COMMA},
                                                  {"F1", GLFW_KEY_F1},
                                                  {"F2", GLFW_KEY_F2},
                                                  {"F5", GLFW_KEY_F5},
                                                  {"F11", GLFW_KEY_F11},
                                                  {"F12", GLFW_KEY_F12}};
    const auto found = named.find(name);
    if (found != named.end()) return found->second;
    if (name.size() == 1 && ((name[0] >= 'A' && name[0] <= 'Z') || (name[0] >= '0' && name[0] <= '9')))
        return name[0];
    return -1;
}

Script::Script(const std::filesystem::path& path) : path_(path) {
    std::ifstream file(path);
    if (!file || std::filesystem::is_directory(path))
        throw Error(ErrorCode::io, path.string() + ": cannot be read");
    int number = 0;
    for (std::string text; std::getline(file, text);) {
        ++number;
        std::istringstream in(text);
        if ((in >> std::ws).peek() == '#') continue;
        Line line{number, {}};
        while (!(in >> std::ws).eof()) {
            std::string word;
            if (!(in >> std::quoted(word)))
                throw Error(ErrorCode::usage, path.string() + ":" + std::to_string(number) + ": '" + text +
                                                  "' has a quotation mark that is not closed");
            line.words.push_back(word);
        }
        if (line.words.empty()) continue;
        const auto known = commands().find(line.words.front());
        if (known == commands().end() || int(line.words.size()) - 1 < known->second) {
            throw Error(ErrorCode::usage, path.string() + ":" + std::to_string(number) + ": '" + text +
                                              "' is no command of a script (docs/editor.md)");
        }
        lines_.push_back(std::move(line));
    }
}

void Script::require_read() const {
    for (const Line& line : lines_) {
        if (line.words.front() == "wait" || line.words.front() == "expect-end") continue;
        throw Error(ErrorCode::check, path_.string() + ":" + std::to_string(line.number) + ": `" +
                                          rest_of(line.words, 0) +
                                          "` was not reached: the editor had ended before");
    }
}

void Script::fail(const std::string& what) const {
    const std::string where =
        path_.string() + ":" + std::to_string(lines_.empty() ? 0 : lines_.front().number);
    throw Error(ErrorCode::check, where + ": " + what);
}

bool Script::find(Editor& editor, const std::string& name, ImVec2& at) {
    const auto found = editor.controls.last.find(name);
    if (found != editor.controls.last.end() && !found->second.clipped) {
        at = ImVec2(0.5f * (found->second.min.x + found->second.max.x),
                    0.5f * (found->second.min.y + found->second.max.y));
        // Where the last command moved it to: only what stands still is clicked.
        found_frames_ = at.x == found_at_.x && at.y == found_at_.y ? found_frames_ + 1 : 0;
        found_at_ = at;
        return found_frames_ >= 3;
    }
    editor.controls.wanted = name;
    if (Clock::now() - line_begin_ < patience_ * kPatience) return false;
    std::string names;
    for (const auto& [known, place] : editor.controls.last) names += (names.empty() ? "" : ", ") + known;
    fail("no control '" + name + "' within " + number_text(patience_ * double(kPatience.count()), 6) +
         " seconds; there are: " + names);
}

void Script::click(const ImVec2& at, bool ctrl) {
    Input input;
    input.mouse = at;
    input.ctrl = ctrl;
    inputs_.push_back(input);
    inputs_.push_back(input);
    input.left = true;
    inputs_.push_back(input);
    input.left = false;
    inputs_.push_back(input);
    inputs_.push_back(input);
}

void Script::press(const std::string& chord) {
    Input input;
    input.mouse = mouse_;
    std::istringstream in(chord);
    for (std::string part; std::getline(in, part, '+');) {
        if (part == "CTRL") {
            input.ctrl = true;
        } else if (part == "SHIFT") {
            input.shift = true;
        } else {
            input.key = key_code(part);
            if (input.key < 0) fail("no key '" + part + "'");
        }
    }
    inputs_.push_back(input);
    Input released;
    released.mouse = mouse_;
    inputs_.push_back(released);
}

void Script::random_input(Editor& editor) {
    const ImVec2 size = ImGui::GetIO().DisplaySize;
    const auto below = [&](float most) {
        return std::uniform_real_distribution<float>(0, std::max(most, 1.0f))(random_);
    };
    const std::uint32_t kind = random_() % 20;
    if (kind < 12) {
        ImVec2 at(below(size.x), below(size.y));
        if (!editor.controls.last.empty() && kind < 9) {
            auto chosen = editor.controls.last.begin();
            std::advance(chosen, std::ptrdiff_t(random_() % editor.controls.last.size()));
            at = ImVec2(0.5f * (chosen->second.min.x + chosen->second.max.x),
                        0.5f * (chosen->second.min.y + chosen->second.max.y));
        }
        Input input;  // quicker than click(): there are many
        input.mouse = at;
        input.ctrl = kind == 0;
        input.left = true;
        inputs_.push_back(input);
        input.left = false;
        inputs_.push_back(input);
    } else if (kind < 16) {
        Input input;
        input.mouse = ImVec2(below(size.x), below(size.y));
        inputs_.push_back(input);
        (kind < 15 ? input.left : input.right) = true;
        inputs_.push_back(input);
        input.mouse.x += below(200) - 100;
        input.mouse.y += below(200) - 100;
        inputs_.push_back(input);
        input.left = input.right = false;
        input.wheel = below(4) - 2;
        inputs_.push_back(input);
    } else {
        static constexpr std::array<const char*, 22> kChords{
            "SPACE", "HOME", ".", ",", "CTRL+Z", "CTRL+Y", "CTRL+D", "DELETE", "ESCAPE", "ENTER",  "TAB",
            "W",     "A",    "S", "D", "F",      "G",      "1",      "5",      "F1",     "CTRL+F", "CTRL+R"};
        press(kChords[random_() % kChords.size()]);
    }
}

void Script::begin_line(Editor& editor) {
    const std::vector<std::string> words = lines_.front().words;
    const std::string& command = words.front();
    if (!line_begun_) line_begin_ = Clock::now();
    if (!line_begun_) found_at_ = ImVec2(-1, -1);
    // Two clicks are one however slow the machine is.
    ImGuiIO& io = ImGui::GetIO();
    io.MouseDoubleClickTime = command == "double-click-at" ? 30.0f : 0.3f;
    if (command == "double-click-at" && !line_begun_)
        io.MouseClickedTime[0] = -1e9;  // those before are others
    if (!line_begun_) waited_frames_ = 0;
    line_begun_ = true;
    const auto done = [this] {
        lines_.pop_front();
        line_begun_ = false;
    };
    const auto number = [&](std::size_t n, double least = -1e6, double most = 1e6) {
        double value = 0;
        const char* const end = words[n].data() + words[n].size();
        const auto [rest, error] = std::from_chars(words[n].data(), end, value);
        if (error != std::errc() || rest != end || !(value >= least && value <= most))
            fail("'" + words[n] + "' is no number from " + number_text(least, 6) + " to " +
                 number_text(most, 6));
        return value;
    };
    const auto waited = [&](std::chrono::seconds most, const std::string& for_what) {
        if (Clock::now() - line_begin_ > patience_ * most) fail("waited too long for " + for_what);
    };
    ImVec2 at;
    if (command == "click") {
        if (!find(editor, rest_of(words, 1), at)) return;
        click(at);
    } else if (command == "click-at" || command == "double-click-at") {
        const std::string name = rest_of({words.begin(), words.end() - 2}, 1);
        if (!find(editor, name, at)) return;
        const Controls::Place& place = editor.controls.last.at(name);
        at = ImVec2(place.min.x + float(number(words.size() - 2)) * (place.max.x - place.min.x),
                    place.min.y + float(number(words.size() - 1)) * (place.max.y - place.min.y));
        click(at);
        if (command == "double-click-at") click(at);
    } else if (command == "drag") {
        if (!find(editor, rest_of({words.begin(), words.end() - 2}, 1), at)) return;
        const float x = float(number(words.size() - 2)), y = float(number(words.size() - 1));
        Input input;
        input.mouse = at;
        inputs_.push_back(input);
        input.left = true;
        inputs_.push_back(input);
        for (int n = 1; n <= 8; ++n) {
            input.mouse = ImVec2(at.x + x * float(n) / 8, at.y + y * float(n) / 8);
            inputs_.push_back(input);
        }
        input.left = false;
        inputs_.push_back(input);
    } else if (command == "set") {
        if (!find(editor, words[1], at)) return;
        click(at, true);
        press("CTRL+A");
        Input typed;
        typed.mouse = at;
        typed.text = rest_of(words, 2);
        inputs_.push_back(typed);
        press("ENTER");
    } else if (command == "type") {
        Input typed;
        typed.mouse = mouse_;
        typed.text = rest_of(words, 1);
        inputs_.push_back(typed);
    } else if (command == "key") {
        press(words[1]);
    } else if (command == "patience") {
        patience_ = number(1, 0.1, 1000);
    } else if (command == "wait") {
        // On a slow machine a short time is less than a frame, and what is waited for needs some.
        const double seconds = number(1, 0);
        if (++waited_frames_ < std::min(20.0, 30 * seconds)) return;
        if (std::chrono::duration<double>(Clock::now() - line_begin_).count() < seconds) return;
    } else if (command == "wait-step") {
        waited(kLongPatience, "step " + words[1]);
        if (!editor.picture || double(editor.picture->step) < number(1, 0, 1e15)) return;
    } else if (command == "wait-picture") {
        waited(kLongPatience, "a picture");
        if (!picture_is_whole(editor)) {
            waited_frames_ = 0;
            return;
        }
        // The frame of an input is laid out before the one after it, which may move what the picture shows.
        if (++waited_frames_ < 4) return;
    } else if (command == "screenshot") {
        if (!editor.capture_to.empty())
            fail(editor.capture_to.string() + " waits for the window, which is minimised");
        editor.capture_to = rest_of(words, 1);
        mouse_ = ImVec2(-1, -1);  // no tooltip in the picture
    } else if (command == "picture") {
        waited(kLongPatience, "a picture");
        if (!editor.picture) return;
        std::string name = rest_of(words, 1);
        const std::size_t percent = name.find('%');
        if (percent != std::string::npos) name.replace(percent, 1, std::to_string(editor.picture->step));
        refuse_own_files(editor, name, false);
        save_rgba(name, editor.picture->width, editor.picture->height, editor.picture->rgba);
    } else if (command == "hashes") {
        std::string text;
        const std::vector<LiveStep> steps = editor.live->steps();
        for (std::size_t n = 0; n < steps.size(); ++n)
            text += std::to_string(n) + " " + steps[n].hash.hex() + "\n";
        refuse_own_files(editor, rest_of(words, 1), false);
        write_atomically(rest_of(words, 1), text);
    } else if (command == "expect-control") {
        if (!find(editor, rest_of(words, 1), at)) return;
    } else if (command == "resize") {
        editor.window->set_size(int(number(1, 1, kMostPixels)), int(number(2, 1, kMostPixels)));
    } else if (command == "drop") {
        editor.window->drop({words.begin() + 1, words.end()});
    } else if (command == "minimise" || command == "restore") {
        editor.window->minimise(command == "minimise");
    } else if (command == "random") {
        random_left_ = std::uint64_t(number(1, 0, 1e9));
        random_.seed(unsigned(number(2, 0, 4294967295.0)));
    } else if (command == "close-window") {
        editor.window->ask_to_close(true);
    } else if (command == "expect-end") {
        return waited(kPatienceOfEnd, "the end of the editor");
    } else if (command == "quit") {
        editor.quit = true;
        lines_.resize(1);
    }
    done();
}

void Script::apply(Editor& editor) {
    editor.controls.wanted.clear();
    ImGuiIO& io = ImGui::GetIO();
    if (last_key_ >= 0) io.KeysDown[last_key_] = false;
    last_key_ = -1;
    if (inputs_.empty() && random_left_ > 0) {
        --random_left_;
        random_input(editor);
    }
    if (inputs_.empty() && !lines_.empty()) begin_line(editor);
    Input input;
    input.mouse = mouse_;
    if (!inputs_.empty()) {
        input = inputs_.front();
        inputs_.pop_front();
    }
    mouse_ = input.mouse;
    io.MousePos = input.mouse;
    io.MouseDown[0] = input.left;
    io.MouseDown[1] = input.right;
    io.MouseWheel = input.wheel;
    io.KeyCtrl = input.ctrl;
    io.KeyShift = input.shift;
    if (input.key >= 0) {
        io.KeysDown[input.key] = true;
        last_key_ = input.key;
    }
    if (!input.text.empty()) io.AddInputCharactersUTF8(field_text(input.text).c_str());
}

}  // namespace nephos
