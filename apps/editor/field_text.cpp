// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/field_text.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include <imgui_internal.h>
#include <imgui_stdlib.h>

#include "core/text.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// ImGui takes no private characters of the keyboard: those of the field are of scripts that its font does not have (from Yi
// to Cherokee).
constexpr unsigned kFirstOfTable = 0xA000, kLastOfTable = 0xABFF, kFirstPrivate = 0xE000,
                   kLastPrivate = 0xF8FF;
constexpr unsigned kLastOfField = 0xFFFF;

bool needs_another(unsigned code) {
    return code > kLastOfField || (code >= kFirstPrivate && code <= kLastPrivate) ||
           (code >= kFirstOfTable && code <= kLastOfTable);
}

// Holds the table of all fields: ImGui has one context, too.
struct Table {
    std::map<unsigned, unsigned> fields;  // characters of the table by what they stand for
    std::vector<unsigned> codes;          // the n-th of them stands for
};

Table& table() {
    static Table all;
    return all;
}

void append_utf8(std::string& text, unsigned code) {
    if (code > kLastOfField) text += char(0xF0 | code >> 18);
    text += char(code > kLastOfField ? 0x80 | (code >> 12 & 0x3F) : 0xE0 | code >> 12);
    text += char(0x80 | (code >> 6 & 0x3F));
    text += char(0x80 | (code & 0x3F));
}

// Returns the text with other characters in place of those that need them.
template <class Other>
std::string replaced(std::string_view text, const Other& other) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t at = 0; at < text.size();) {
        const Character c = character_at(text, at);
        if (c.valid && needs_another(unsigned(c.code)))
            append_utf8(out, other(unsigned(c.code)));
        else
            out += c.bytes;
        at += c.bytes.size();
    }
    return out;
}

bool ends_lines_with_return(std::string_view text) {
    const std::size_t end = text.find('\n');
    return end != text.npos && end > 0 && text[end - 1] == '\r';
}

std::string without_returns(std::string_view text) {
    std::string out;
    out.reserve(text.size());
    for (std::size_t at = 0; at < text.size(); ++at)
        if (text[at] != '\r' || at + 1 == text.size() || text[at + 1] != '\n') out += text[at];
    return out;
}

std::string with_returns(std::string_view text) {
    std::string out;
    for (const char c : text) {
        if (c == '\n') out += '\r';
        out += c;
    }
    return out;
}

// Returns where the n-th character of without_returns(text) begins, with a return before it.
std::size_t place_of(std::string_view text, std::size_t n) {
    std::size_t at = 0;
    for (; n > 0; --n, ++at)
        if (text[at] == '\r' && at + 1 < text.size() && text[at + 1] == '\n') ++at;
    return at;
}

// Puts what has become of the lines of a text into it: what is the same before and behind stays as it is.
std::string with_lines(std::string_view text, std::string_view lines, std::string_view now) {
    const auto differ = std::ranges::mismatch(lines, now);
    const std::size_t before = std::size_t(differ.in1 - lines.begin());
    std::size_t behind = 0;
    while (behind < std::min(lines.size(), now.size()) - before &&
           lines[lines.size() - 1 - behind] == now[now.size() - 1 - behind])
        ++behind;
    const std::string_view more = now.substr(before, now.size() - behind - before);
    std::string out(text.substr(0, place_of(text, before)));
    out += ends_lines_with_return(text) ? with_returns(more) : std::string(more);
    return out.append(text.substr(place_of(text, lines.size() - behind)));
}

// The field that had the caret last: what it was given, and what it gave back. Of ImGui as a whole, which has one state of fields.
struct LastField {
    ImGuiID id = 0;
    std::string given, taken;
};

LastField& last_field() {
    static LastField last;
    return last;
}

// Makes ImGui forget the copy of a text that it has of a field, where something else has changed the text.
void forget_other_text(ImGuiID id, const std::string& field) {
    LastField& last = last_field();
    if (last.id != id || field == last.given || field == last.taken) return;
    last.id = 0;
    ImGuiInputTextState* const state = ImGui::GetInputTextState(id);
    if (state == nullptr) return;
    if (ImGui::GetActiveID() == id) {
        ImGui::ClearActiveID();
        ImGui::GetCurrentContext()->ActiveIdPreviousFrameHasBeenEditedBefore =
            false;  // what was typed is not taken
    }
    state->ID = 0;
}

// Shows `text` in a field by `show`, which returns what ImGui does.
template <class Show>
bool edited(const char* label, std::string& text, const Show& show) {
    const ImGuiID id = ImGui::GetCurrentWindow()->GetID(label);
    std::string field = field_text(text);
    forget_other_text(id, field);
    const bool is_held = text.find('\0') == text.npos && find_invalid_utf8(text) == text.size() &&
                         text_of_field(field) == text;
    const std::string before = field;
    const bool result = show(field, is_held ? 0 : ImGuiInputTextFlags_ReadOnly);
    field.resize(std::min(field.size(), field.find('\0')));  // what ImGui leaves behind its end
    if (ImGui::GetInputTextState(id) != nullptr) last_field() = {id, before, is_held ? field : before};
    if (is_held && field != before) text = text_of_field(field);
    return result;
}

// Input that waits for a field to be finished, frame by frame:
//
//     Enter is pressed  -->  released, what waits is pressed  -->  released  -->  the caret has come, after Tab
//
// Without a field that has the caret ImGui takes Tab for the first field of all, so that it is not pressed: move_caret_on() asks
// for the one behind.
enum class Waiting { none, enter_is_pressed, to_be_passed_on, passed_on, caret_to_come };

struct HeldInput {
    Waiting stage = Waiting::none;
    std::array<bool, 3> buttons{};
    int key = -1;
    bool ctrl = false, shift = false;
    ImGuiID left = 0;            // the field that Tab leaves for the one behind
    bool moves_on = false;       // in the frame that begins
    int frames = 0;              // in which the caret may come yet
    std::vector<ImWchar> typed;  // meanwhile: it is for where the caret then is
};

// Fields in which Enter does something else: a line more, or what a dialog is there for.
std::set<ImGuiID>& fields_with_own_enter() {
    static std::set<ImGuiID> ids;
    return ids;
}

HeldInput& held_input() {
    static HeldInput held;
    return held;
}

// Keeps what the backend has set.
struct Clipboard {
    const char* (*get)(void*) = nullptr;
    void (*set)(void*, const char*) = nullptr;
    void* data = nullptr;
    std::string field;  // what ImGui was given last
};

}  // namespace

unsigned field_character(unsigned code) {
    if (!needs_another(code)) return code;
    Table& all = table();
    const auto [found, added] = all.fields.try_emplace(code, kFirstOfTable + unsigned(all.codes.size()));
    if (!added) return found->second;
    if (found->second > kLastOfTable) {
        constexpr unsigned kReplacement = 0xFFFD;
        all.fields.erase(found);
        return kReplacement;
    }
    all.codes.push_back(code);
    return found->second;
}

std::string field_text(std::string_view text) { return replaced(text, field_character); }

std::string text_of_field(std::string_view field) {
    return replaced(field, [](unsigned code) {
        const std::vector<unsigned>& codes = table().codes;
        const bool is_known = code >= kFirstOfTable && code - kFirstOfTable < codes.size();
        return is_known ? codes[code - kFirstOfTable] : code;
    });
}

ImGuiID active_item() { return ImGui::GetActiveID(); }

bool is_number_field_active() {
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    return g.ActiveId != 0 && g.ActiveId == g.TempInputId;
}

void leave_number_field() {
    if (!is_number_field_active()) return;
    ImGuiContext& g = *ImGui::GetCurrentContext();
    ImGui::ClearActiveID();
    g.ActiveIdPreviousFrameHasBeenEditedBefore = false;  // what was typed is not taken
    g.InputTextState.ID = 0;
}

bool press_enter_in_field() {
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    const ImGuiInputTextState& state = g.InputTextState;
    if (g.ActiveId == 0 || g.ActiveId != state.ID || fields_with_own_enter().contains(g.ActiveId))
        return false;
    ImGuiIO& io = ImGui::GetIO();
    const int enter = io.KeyMap[ImGuiKey_Enter];
    if (enter < 0 || io.KeysDown[enter]) return false;
    io.KeysDown[enter] = true;
    held_input().stage = Waiting::enter_is_pressed;
    return true;
}

namespace {

constexpr int kFramesOfCaret = 5;

// Presses what has waited.
void pass_on(HeldInput& held, ImGuiIO& io) {
    io.KeysDown[io.KeyMap[ImGuiKey_Enter]] = false;
    for (std::size_t button = 0; button < held.buttons.size(); ++button)
        if (held.buttons[button]) io.MouseDown[button] = true;
    held.buttons = {};
    if (held.left != 0) {
        held.moves_on = true;
        return;
    }
    if (held.key < 0) return;
    io.KeysDown[held.key] = true;
    io.KeyCtrl = held.ctrl;
    io.KeyShift = held.shift;
}

// Finds a click elsewhere or a key that leaves a field, and lets it wait where there is one to be finished.
void hold_back(HeldInput& held, ImGuiIO& io) {
    const ImGuiContext& g = *ImGui::GetCurrentContext();
    HeldInput found;
    for (std::size_t button = 0; button < found.buttons.size(); ++button)
        found.buttons[button] = io.MouseDown[button] && io.MouseDownDuration[button] < 0 &&
                                g.HoveredIdPreviousFrame != g.ActiveId;
    const auto is_new = [&](int key) { return io.KeysDown[key] && io.KeysDownDuration[key] < 0; };
    for (const int key : {'S', 'O', 'N', 'Q', 'R'})
        if (io.KeyCtrl && is_new(key)) found.key = key;
    if (const int tab = io.KeyMap[ImGuiKey_Tab]; tab >= 0 && !io.KeyCtrl && is_new(tab)) {
        found.key = tab;
        found.left = io.KeyShift ? 0 : g.ActiveId;
    }
    const bool is_click = std::ranges::count(found.buttons, true) > 0;
    if ((!is_click && found.key < 0) || !press_enter_in_field()) return;
    for (std::size_t button = 0; button < found.buttons.size(); ++button)
        if (found.buttons[button]) io.MouseDown[button] = false;
    if (found.key >= 0) {
        found.ctrl = io.KeyCtrl;
        found.shift = io.KeyShift;
        io.KeysDown[found.key] = false;
        io.KeyCtrl = io.KeyShift = false;
    }
    found.stage = Waiting::to_be_passed_on;
    held = found;
}

}  // namespace

void finish_field_first() {
    ImGuiIO& io = ImGui::GetIO();
    HeldInput& held = held_input();
    if (held.stage != Waiting::none) {
        held.typed.insert(held.typed.end(), io.InputQueueCharacters.begin(), io.InputQueueCharacters.end());
        io.InputQueueCharacters.resize(0);
    }
    switch (held.stage) {
        case Waiting::none:
            hold_back(held, io);
            break;
        case Waiting::enter_is_pressed:  // by press_enter_in_field(), for the frame that begins
            held.stage = Waiting::to_be_passed_on;
            break;
        case Waiting::to_be_passed_on:
            pass_on(held, io);
            held.stage = Waiting::passed_on;
            break;
        case Waiting::passed_on:
            if (held.key >= 0) io.KeysDown[held.key] = false;
            held.stage = held.left != 0 ? Waiting::caret_to_come : Waiting::none;
            held.frames = kFramesOfCaret;
            break;
        case Waiting::caret_to_come: {
            const ImGuiID active = ImGui::GetCurrentContext()->ActiveId;
            if ((active != 0 && active != held.left) || --held.frames == 0) held.stage = Waiting::none;
        }
    }
    if (held.stage == Waiting::none) {
        for (const ImWchar c : held.typed) io.InputQueueCharacters.push_back(c);
        held = {};
    }
    // ImGui leaves the comma of a number out, and 12,5 would be 125.
    if (is_number_field_active())
        for (ImWchar& c : io.InputQueueCharacters)
            if (c == ',') c = '.';
    ImGuiContext& g = *ImGui::GetCurrentContext();
    if (g.InputTextState.ID != 0 && g.ActiveId != g.InputTextState.ID) g.InputTextState.ID = 0;
}

void move_caret_on() {
    HeldInput& held = held_input();
    if (!std::exchange(held.moves_on, false)) return;
    ImGuiContext& g = *ImGui::GetCurrentContext();
    g.NavId = held.left;
    ImGui::NavMoveRequestSubmit(ImGuiDir_None, ImGuiDir_Down, ImGuiNavMoveFlags_Tabbing,
                                ImGuiScrollFlags_None);
    g.NavTabbingDir = 1;
    g.NavTabbingCounter = 0;
}

bool input_text(const char* label, std::string& text, const char* hint, ImGuiInputTextFlags flags) {
    if ((flags & ImGuiInputTextFlags_EnterReturnsTrue) != 0)
        fields_with_own_enter().insert(ImGui::GetCurrentWindow()->GetID(label));
    return edited(label, text, [&](std::string& field, ImGuiInputTextFlags more) {
        return hint == nullptr ? ImGui::InputText(label, &field, flags | more)
                               : ImGui::InputTextWithHint(label, hint, &field, flags | more);
    });
}

bool input_value(const char* label, std::string& text, ImGuiInputTextFlags flags) {
    const ImGuiID id = ImGui::GetCurrentWindow()->GetID(label);
    std::string shown = text;
    const std::string field = field_text(text);
    forget_other_text(id, field);
    const LastField before = last_field();
    const bool was_active = ImGui::GetActiveID() == id;
    input_text(label, shown, nullptr, flags);
    if (ImGui::GetActiveID() == id) return false;
    // A window that opens takes the caret away between two frames, and ImGui then forgets what was typed. Escape does so
    // in the field.
    if (!was_active && before.id == id && before.given == field && before.taken != field)
        shown = text_of_field(before.taken);
    if (shown == text) return false;
    last_field().id = 0;
    text = std::move(shown);
    return true;
}

std::optional<std::string> unfinished_text(const char* label) {
    const ImGuiID id = ImGui::GetCurrentWindow()->GetID(label);
    const LastField& last = last_field();
    if (ImGui::GetActiveID() != id || last.id != id || last.taken == last.given) return std::nullopt;
    return text_of_field(last.taken);
}

bool forget_unfinished_text() {
    LastField& last = last_field();
    return std::exchange(last.id, 0) != 0 && last.taken != last.given;
}

bool input_lines(const char* label, std::string& text, const ImVec2& size, ImGuiInputTextFlags flags) {
    std::string lines = without_returns(text);
    const std::string before = lines;
    fields_with_own_enter().insert(ImGui::GetCurrentWindow()->GetID(label));
    edited(label, lines, [&](std::string& field, ImGuiInputTextFlags more) {
        return ImGui::InputTextMultiline(label, &field, size, flags | more);
    });
    if (lines == before) return false;
    text = with_lines(text, before, lines);
    return true;
}

void keep_clipboard_apart() {
    static Clipboard clipboard;
    ImGuiIO& io = ImGui::GetIO();
    clipboard = {io.GetClipboardTextFn, io.SetClipboardTextFn, io.ClipboardUserData, {}};
    io.GetClipboardTextFn = [](void*) -> const char* {
        const char* text = clipboard.get(clipboard.data);
        if (text == nullptr) return nullptr;
        clipboard.field = field_text(text);
        if (is_number_field_active()) std::ranges::replace(clipboard.field, ',', '.');
        return clipboard.field.c_str();
    };
    io.SetClipboardTextFn = [](void*, const char* field) {
        clipboard.set(clipboard.data, text_of_field(field).c_str());
    };
}

}  // namespace nephos
