// SPDX-License-Identifier: Apache-2.0
#pragma once

// Text in the fields of Dear ImGui, for any text. Its packaged library has characters of 16 bits and lines that end with
// "\n": a character beyond U+FFFF (a symbol of weather, say) would be replaced for good by U+FFFD, and what is typed at
// the end of a line with "\r\n" would stand behind the "\r". In fields, characters from U+A000 to U+ABFF stand for those
// beyond, for private ones (U+E000 to U+F8FF), which it takes of no keyboard, and for those of this range. There is one
// table of them, so that texts can be copied between fields; all functions are for the thread that draws.

#include <optional>
#include <string>
#include <string_view>

#include <imgui.h>

namespace nephos {

// Return a text as a field holds it, and the text of a field. A text beyond the table's 3,072 characters does not come back.
std::string field_text(std::string_view text);
std::string text_of_field(std::string_view field);
// Returns the character that stands for one that is typed.
unsigned field_character(unsigned code);

// A field that has the caret holds its own copy of a text, and Ctrl+Z in it its own way back: when the text is changed meanwhile by
// something else, by undo, another file or another program, the field is left, and both are forgotten.

// As ImGui::InputText() or, with a hint, InputTextWithHint(). Only what the user does changes `text`; one that no field can
// hold, as it has a byte of 0 or is no UTF-8, is read-only.
bool input_text(const char* label, std::string& text, const char* hint = nullptr,
                ImGuiInputTextFlags flags = 0);

// Shows a value in a field of one line. Returns true once the field was left with another text, by Enter, Tab, a click or a
// window that opens over it (at the latest in the frame after that, or, where it is not drawn, when it is again); only then
// `text` is changed, to what was typed. Escape brings back what was there.
bool input_value(const char* label, std::string& text, ImGuiInputTextFlags flags = 0);

// Returns what was typed into a field of input_value() that still has the caret; nothing where that is what it began with.
std::optional<std::string> unfinished_text(const char* label);
// Forgets it; returns whether there was any.
bool forget_unfinished_text();

// As ImGui::InputTextMultiline(), but returns whether the text was changed. Lines keep their ends; what is added has those of
// the first line.
bool input_lines(const char* label, std::string& text, const ImVec2& size, ImGuiInputTextFlags flags = 0);

// To be called right before ImGui::NewFrame(), when all input is known. A field of one line gives its text away where it is left,
// but one that is drawn before it, or a shortcut, acts first: so a click elsewhere, Tab and Ctrl with a letter wait for a frame in
// which Enter is pressed. And a field that was left forgets its way back, which is of a text that may not have been taken.
void finish_field_first();

// To be called right after ImGui::NewFrame(): gives the caret to the field behind the one that Tab has left.
void move_caret_on();

// Returns what has the mouse or the caret; 0 when nothing has.
ImGuiID active_item();

// Returns whether a field of a number has the caret.
bool is_number_field_active();

// Takes the caret out of a field of a number, which would give its own copy back once the number is another.
void leave_number_field();

// Presses Enter, for one frame, in a field of one line that has the caret; returns whether there is one.
bool press_enter_in_field();

// Has the clipboard hold texts and not their fields. To be called once, when the backend has set its own functions.
void keep_clipboard_apart();

}  // namespace nephos
