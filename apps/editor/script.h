// SPDX-License-Identifier: Apache-2.0
#pragma once

// Clicks and keys from a file instead of a user, for tests and for the pictures of the documentation. A line is a
// command; controls have names, those of keys are their paths ("sun.elevation_deg"):
//
//     click NAME             the left button on the middle of a control
//     click-at NAME X Y      on a part of a control: 0 0 is its upper left, 1 1 its lower right
//     double-click-at NAME X Y
//     drag NAME X Y          from there by so many pixels
//     set NAME VALUE         types a value into a number's control, or a text's; a NAME with blanks stands in quotes
//     type TEXT              types where the cursor is
//     key CTRL+S             presses keys: letters, digits, SPACE, ENTER, ESCAPE, DELETE, HOME, F1 ..., with CTRL, SHIFT
//     patience N             the lines that follow give up on controls, steps, pictures and the end after N times as long
//     wait SECONDS           lets time pass, and some frames of the window
//     wait-step N            until that step is shown (a minute at most)
//     wait-picture           until the picture is drawn with all its detail (a minute at most)
//     screenshot FILE        saves a picture of the window, once it shows a frame (ten seconds at most; a minimised window
//                            is not waited for while there are lines)
//     picture FILE           saves the picture of the clouds alone; "%" in the name becomes its step
//     hashes FILE            saves the state hashes of the steps that were simulated, as `nephos hash` prints them
//     expect-control NAME    fails unless the control is there
//     resize X Y, minimise, restore
//     drop FILE ...          files that are dropped on the window; a name with blanks stands in quotes
//     random N SEED          N random clicks, drags and keys
//     close-window           presses the cross of the window
//     quit                   ends at once, whatever is unsaved
//     expect-end             fails unless the editor ends within twenty seconds
//
// A control that is not there within ten seconds ends the program with status 1 and says which there are; so does an end of
// the editor before a line that would have done anything.

#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <random>
#include <string>
#include <vector>

#include "apps/editor/state.h"

namespace nephos {

class Script {
  public:
    // Throws Error(usage) naming the line that is no command, Error(io) when the file cannot be read.
    explicit Script(const std::filesystem::path& path);
    Script() = default;

    bool is_active() const { return !lines_.empty() || !inputs_.empty() || random_left_ > 0; }
    // Returns true during `random`, which must not end the program.
    bool is_random() const { return random_left_ > 0; }
    // Gives ImGui the input of this frame; between its NewFrame() of the back end and its own. Throws Error(check).
    void apply(Editor& editor);
    // Throws Error(check) where lines are left that the editor, which has ended, should have read.
    void require_read() const;

  private:
    struct Line {
        int number = 0;
        std::vector<std::string> words;
    };
    // The mouse and keys in one frame.
    struct Input {
        ImVec2 mouse{-1, -1};
        bool left = false, right = false, ctrl = false, shift = false;
        int key = -1;
        std::string text;
        float wheel = 0;
    };
    using Clock = std::chrono::steady_clock;

    void begin_line(Editor& editor);
    bool find(Editor& editor, const std::string& name, ImVec2& at);
    void click(const ImVec2& at, bool ctrl = false);
    void press(const std::string& chord);
    void random_input(Editor& editor);
    [[noreturn]] void fail(const std::string& what) const;

    std::filesystem::path path_;
    std::deque<Line> lines_;
    std::deque<Input> inputs_;
    ImVec2 mouse_{-1, -1};
    Clock::time_point line_begin_ = Clock::now();
    double patience_ = 1;
    bool line_begun_ = false;
    ImVec2 found_at_{-1, -1};  // where a control was in the frame before
    int found_frames_ = 0;     // for how many frames
    int waited_frames_ = 0;    // by a line that waits
    std::uint64_t random_left_ = 0;
    std::mt19937 random_;
    int last_key_ = -1;
};

// Names of GLFW's keys for scripts; -1 when there is no such key.
int key_code(const std::string& name);

}  // namespace nephos
