// SPDX-License-Identifier: Apache-2.0
#pragma once

// Pictures of the window, which the user (F12), a script or --screenshot asks for.

#include <chrono>

namespace nephos {

struct Editor;
class Script;

// Returns whether the next frame is to be waited for: one that is drawn may not be shown, as while another program changes the
// window's size. A minimised window shows none until a script or the user brings it back.
bool awaits_capture(const Editor& editor, const Script& script);

// Saves what Editor::capture_to names, once a frame that is shown has its picture.
class Capture {
  public:
    // Asks the window for the picture that is due, if there is one. Before the end of a frame.
    static void begin(Editor& editor);
    // Saves it where that frame was shown. What the user has asked for and cannot be saved is told in the window. Throws Error(gpu)
    // where none came for ten seconds, and as refuse_own_files() and save_rgba().
    void end(Editor& editor, const Script& script);

  private:
    using Clock = std::chrono::steady_clock;
    Clock::time_point last_without_ = Clock::now();  // when no picture was due, or one came
};

}  // namespace nephos
