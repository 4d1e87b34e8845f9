// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/value_controls.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>

#include <imgui.h>

#include "apps/editor/field_text.h"
#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

double number_of(const Node& node) {
    return node.kind == Node::Kind::integer ? double(node.integer) : node.number;
}

// Precondition: of number_text().
double number_of_text(const std::string& text) {
    double number = 0;
    std::from_chars(text.data(), text.data() + text.size(), number);
    return number;
}

std::vector<double> numbers_of(const Node* node, std::size_t count) {
    std::vector<double> out;
    if (node != nullptr && node->kind == Node::Kind::array) {
        for (const Node& item : node->items) out.push_back(number_of(item));
    } else if (node != nullptr) {
        out.push_back(number_of(*node));
    }
    while (out.size() < count) out.push_back(out.empty() ? 0 : out.back());  // one number stands for all
    out.resize(count);
    return out;
}

std::string number_list(const std::vector<double>& numbers, bool integers) {
    std::string out = numbers.size() > 1 ? "[" : "";
    for (std::size_t n = 0; n < numbers.size(); ++n) {
        if (n > 0) out += ", ";
        out += integers ? std::to_string(std::llround(numbers[n])) : number_text(numbers[n]);
    }
    return numbers.size() > 1 ? out + "]" : out;
}

// Returns as many digits as the number has, at least six: a field that is typed into begins with what it shows.
std::string number_format(double number) {
    int digits = 6;
    while (digits < 17 && std::isfinite(number) && number_of_text(number_text(number, digits)) != number)
        ++digits;
    return "%." + std::to_string(digits) + "g";
}

// "%.6g m": a percent sign of a unit would be read as a format.
std::string format_of(const Key& key, double number, bool integers) {
    std::string unit = key.unit == "per step" || key.unit == "cells" ? "" : unit_sign(key.unit);
    std::erase(unit, '%');
    return (integers ? "%.0f" : number_format(number)) + (unit.empty() || unit == "°" ? unit : " " + unit);
}

// Returns how far a drag of one pixel goes: at most a 300th of a small range, otherwise 0.006 of the number's size.
double drag_speed(const Key& key, double value, bool integers) {
    const double range = key.limits.max - key.limits.min;
    double speed = std::max(std::abs(value), 1.0) * 0.006;
    if (std::isfinite(range) && range <= 1000) speed = std::min(speed, range / 300);
    if (integers) speed = std::max(speed, 0.1);
    return speed;
}

// Returns whether the whole range fits on a slider.
bool is_slider(const Key& key) {
    const double range = key.limits.max - key.limits.min;
    return std::isfinite(range) && range <= 400 && range > 0 && key.unit != "per step";
}

// To a power of ten that is at most `step`.
double rounded(double number, double step) {
    if (!std::isfinite(number) || !(step > 0)) return number;
    const double unit = std::pow(10.0, std::floor(std::log10(step)));
    return number_of_text(number_text(std::round(number / unit) * unit, 9));  // 0.3, not 0.30000000000000004
}

// A field for each number, each with a name of its own: "size_m[2]".
bool drag_numbers(Editor& editor, const ValueRow& row, std::vector<double>& numbers, bool integers) {
    const float gap = ImGui::GetStyle().ItemInnerSpacing.x, count = float(numbers.size());
    const float width =
        std::max(1.0f, std::floor((ImGui::GetContentRegionAvail().x - (count - 1) * gap) / count));
    const float speed = float(drag_speed(row.key, numbers[0], integers));
    bool changed = false;
    ImGui::BeginGroup();
    for (std::size_t n = 0; n < numbers.size(); ++n) {
        if (n > 0) ImGui::SameLine(0, gap);
        ImGui::PushID(int(n));
        ImGui::SetNextItemWidth(width);
        const std::string format = numbers.size() < 3 ? format_of(row.key, numbers[n], integers)
                                   : integers         ? "%.0f"
                                                      : number_format(numbers[n]);
        changed |= ImGui::DragScalar("##number", ImGuiDataType_Double, &numbers[n], speed, nullptr, nullptr,
                                     format.c_str());
        const std::string whole = number_text(numbers[n]);
        if (ImGui::CalcTextSize(whole.c_str()).x > width) tooltip_of_last(whole.c_str());
        if (numbers.size() > 1) editor.controls.note(path_text(row.path) + "[" + std::to_string(n) + "]");
        ImGui::PopID();
    }
    ImGui::EndGroup();
    return changed;
}

// A patch of the colour, which opens a picker. Components that it changed have no more digits than a float, four behind the
// point where the mouse chose them.
bool colour_patch(std::vector<double>& numbers) {
    const float before[3] = {float(numbers[0]), float(numbers[1]), float(numbers[2])};
    float colour[3] = {before[0], before[1], before[2]};
    constexpr ImGuiColorEditFlags kPatch =
        ImGuiColorEditFlags_NoInputs | ImGuiColorEditFlags_Float | ImGuiColorEditFlags_HDR;
    if (!ImGui::ColorEdit3("##colour", colour, kPatch)) return false;
    const bool by_mouse = !ImGui::GetIO().WantTextInput;
    for (std::size_t n = 0; n < 3; ++n) {
        if (colour[n] == before[n]) continue;
        const double shown = number_of_text(number_text(double(colour[n]), 7));
        numbers[n] = by_mouse ? std::round(shown * 1e4) / 1e4 : shown;
    }
    return true;
}

// Numbers side by side. Returns the new value as TOML.
std::optional<std::string> edit_numbers(Editor& editor, const ValueRow& row, std::size_t count,
                                        bool integers) {
    const std::vector<double> before = numbers_of(row.node, count);
    std::vector<double> numbers = before;
    bool changed = false;
    if (count == 1 && row.key.limits.infinite) {
        bool infinite = std::isinf(numbers[0]);
        if (ImGui::Checkbox("\u221e##infinite", &infinite)) {
            numbers[0] = infinite ? INFINITY : 1000;
            changed = true;
        }
        editor.controls.note(path_text(row.path) + " infinite");
        tooltip_of_last("No end");
        ImGui::SameLine();
        if (infinite) {
            ImGui::TextDisabled("no end");
            if (!changed) return std::nullopt;
            return number_text(numbers[0]);
        }
    }
    bool picked = false;
    ImGui::SetNextItemWidth(-1);
    if (count == 1 && is_slider(row.key)) {
        const double low = row.key.limits.min, high = row.key.limits.max;
        changed |= ImGui::SliderScalar("##value", ImGuiDataType_Double, numbers.data(), &low, &high,
                                       format_of(row.key, numbers[0], integers).c_str());
    } else {
        if (row.key.kind == KeyKind::colour) {
            picked = colour_patch(numbers);
            editor.controls.note(path_text(row.path) + " colour");
            ImGui::SameLine();
        }
        changed |= drag_numbers(editor, row, numbers, integers);
    }
    if (!changed && !picked) return std::nullopt;
    const bool by_mouse = !ImGui::GetIO().WantTextInput && !picked;
    for (std::size_t n = 0; n < count; ++n) {
        if (numbers[n] == before[n]) continue;  // one of several stays as it is, with all its digits
        if (by_mouse && !integers) numbers[n] = rounded(numbers[n], drag_speed(row.key, numbers[n], false));
        numbers[n] = within_limits(row.key.limits, numbers[n]);
    }
    const bool one_for_both =
        count == 2 && row.node != nullptr && row.node->kind != Node::Kind::array && row.present;
    if (one_for_both && numbers[0] == numbers[1]) numbers.resize(1);
    return number_list(numbers, integers);
}

// The ending of the files that a key names; empty: none. These keys are texts of the schema, whose files are no kind.
std::string_view files_of(const Key& key) {
    if (key.kind == KeyKind::path || key.name == "file" || key.name == "files") return ".vdb";
    if (key.name == "textures") return ".png";
    return {};
}

// A button behind a text that chooses a file; leaves room for it.
void file_choice(Editor& editor, const ValueRow& row,
                 const std::function<std::string(const std::string&)>& value_of) {
    const std::string extension(files_of(row.key));
    if (extension.empty()) return;
    ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
    file_button(editor, path_text(row.path), extension,
                [&editor, path = row.path, value_of](const std::string& name) {
                    set_value(editor, path, value_of(name));
                });
}

float width_before_file_button(const ValueRow& row) {
    const ImGuiStyle& style = ImGui::GetStyle();
    if (files_of(row.key).empty()) return -1;
    return -(ImGui::CalcTextSize("...").x + 2 * style.FramePadding.x + style.ItemInnerSpacing.x);
}

std::optional<std::string> edit_text(Editor& editor, const ValueRow& row, bool& unfinished) {
    std::string text = row.node != nullptr ? row.node->text : "";
    if (row.node != nullptr && row.node->kind == Node::Kind::integer)
        text = std::to_string(row.node->integer);
    ImGui::BeginGroup();
    ImGui::SetNextItemWidth(width_before_file_button(row));
    const bool typed = input_value("##value", text);
    const std::optional<std::string> typing = unfinished_text("##value");
    file_choice(editor, row, [](const std::string& name) { return toml_string(name); });
    ImGui::EndGroup();
    unfinished = typing.has_value();
    if (!typed && !typing) return std::nullopt;
    if (typing) text = *typing;
    if (row.key.kind != KeyKind::seed) return toml_string(text);
    std::uint64_t seed = 0;
    if (parse_seed(text, seed)) {
        const bool plain = seed <= 0x7fffffffffffffff && !text.starts_with("0x");
        return plain ? std::to_string(seed) : toml_string(text);
    }
    if (typing) return toml_string(text);
    say(editor,
        "\"" + shortened(text) +
            "\" is no seed: expected a number from 0 to 18446744073709551615, or 0x and hexadecimal digits",
        true);
    return std::nullopt;
}

std::optional<std::string> edit_word(Editor& editor, const ValueRow& row) {
    const std::string now = row.node != nullptr ? row.node->text : "";
    std::optional<std::string> chosen;
    ImGui::SetNextItemWidth(-1);
    if (ImGui::BeginCombo("##value", now.empty() ? "(none)" : now.c_str())) {
        for (const std::string_view word : row.key.words) {
            if (ImGui::Selectable(std::string(word).c_str(), word == now)) chosen = toml_string(word);
            editor.controls.note("choice " + std::string(word));
        }
        ImGui::EndCombo();
    }
    return chosen;
}

std::optional<std::string> edit_boundaries(const ValueRow& row) {
    std::vector<std::string> words(3, row.node != nullptr ? row.node->text : "open");
    for (std::size_t n = 0; row.node != nullptr && n < row.node->items.size() && n < 3; ++n) {
        words[n] = row.node->items[n].text;
    }
    bool changed = false;
    constexpr const char* kAxes[] = {"east", "north", "up"};
    for (std::size_t n = 0; n < 3; ++n) {
        bool periodic = words[n] == "periodic";
        if (n > 0) ImGui::SameLine();
        if (ImGui::Checkbox(kAxes[n], &periodic)) {
            words[n] = periodic ? "periodic" : "open";
            changed = true;
        }
    }
    if (!changed) return std::nullopt;
    return "[\"" + words[0] + "\", \"" + words[1] + "\", \"" + words[2] + "\"]";
}

// Names that a list of texts may hold: those of models or skies.
std::vector<std::string> candidates(const Editor& editor, const ValueRow& row) {
    std::vector<std::string> names;
    const Scene* const scene = editor.document->current_scene();
    const Node& values = editor.document->values();
    if (row.path.size() < 2) return names;
    if (row.key.name == "models") {
        names = names_of(value_node(values, text_path("model")));
        if (scene) {
            for (const BaseModel& model : scene->models) names.push_back(model.name);
        }
    } else if (row.key.name == "skies") {
        names = names_of(value_node(values, text_path("sky")));
    }
    std::ranges::sort(names);
    names.erase(std::unique(names.begin(), names.end()), names.end());
    return names;
}

// Returns the texts between commas, without blanks around them and without empty ones.
std::vector<std::string> parts_of_list(const std::string& list) {
    std::vector<std::string> parts;
    for (std::size_t at = 0; at <= list.size();) {
        const std::size_t comma = std::min(list.find(',', at), list.size());
        const std::size_t first = std::min(list.find_first_not_of(' ', at), comma);
        std::string part = list.substr(first, comma - first);
        while (!part.empty() && part.back() == ' ') part.pop_back();
        if (!part.empty()) parts.push_back(std::move(part));
        at = comma + 1;
    }
    return parts;
}

std::optional<std::string> edit_texts(Editor& editor, const ValueRow& row, bool& unfinished) {
    std::vector<std::string> texts;
    if (row.node != nullptr && row.node->kind == Node::Kind::text) texts.push_back(row.node->text);
    if (row.node != nullptr) {
        for (const Node& item : row.node->items) texts.push_back(item.text);
    }
    const auto as_toml = [](const std::vector<std::string>& list) {
        std::string out = "[";
        for (const std::string& text : list) out += (out.size() > 1 ? ", " : "") + toml_string(text);
        return out + "]";
    };
    std::string shown;
    for (const std::string& text : texts) shown += (shown.empty() ? "" : ", ") + text;
    const std::vector<std::string> names = candidates(editor, row);
    ImGui::SetNextItemWidth(names.empty() ? width_before_file_button(row) : -1);
    if (names.empty()) {
        const bool is_plain = std::ranges::none_of(texts, [](const std::string& text) {
            return text.empty() || text.find(',') != text.npos || text.front() == ' ' || text.back() == ' ';
        });
        ImGui::BeginGroup();
        const bool typed = input_value("##value", shown, is_plain ? 0 : ImGuiInputTextFlags_ReadOnly);
        const std::optional<std::string> typing = unfinished_text("##value");
        if (!is_plain) tooltip_of_last("A text with a comma or blanks around it is edited in Text");
        file_choice(editor, row, [texts, as_toml](const std::string& name) {
            std::vector<std::string> more = texts;
            if (std::ranges::find(more, name) == more.end()) more.push_back(name);
            return as_toml(more);
        });
        ImGui::EndGroup();
        unfinished = typing.has_value();
        if (!typed && !typing) return std::nullopt;
        return as_toml(parts_of_list(typing.value_or(shown)));
    }
    std::optional<std::string> out;
    if (ImGui::BeginCombo("##value", shown.empty() ? "(none)" : shown.c_str())) {
        for (const std::string& name : names) {
            bool on = std::ranges::find(texts, name) != texts.end();
            const bool clicked = ImGui::Checkbox(name.empty() ? "(no name)" : name.c_str(), &on);
            editor.controls.note("choice " + name);
            if (clicked) {
                if (on) {
                    texts.push_back(name);
                } else {
                    std::erase(texts, name);
                }
                out = as_toml(texts);
            }
        }
        ImGui::EndCombo();
    }
    return out;
}

}  // namespace

double within_limits(const Limits& limits, double number) {
    if (std::isnan(number)) number = 0;
    if (limits.infinite && std::isinf(number)) return number;
    const double room = std::min(1e-3, std::isfinite(limits.max) ? 1e-3 * (limits.max - limits.min) : 1e-3);
    if (limits.above_min && number <= limits.min) return limits.min + room;
    if (limits.below_max && number >= limits.max) return limits.max - room;
    return std::clamp(number, limits.min, limits.max);
}

std::optional<std::string> edit_value(Editor& editor, const ValueRow& row, bool& unfinished) {
    switch (row.key.kind) {
        case KeyKind::boolean: {
            bool on = row.node != nullptr && row.node->boolean;
            if (ImGui::Checkbox("##value", &on)) return on ? "true" : "false";
            return std::nullopt;
        }
        case KeyKind::integer:
        case KeyKind::count:
            return edit_numbers(editor, row, 1, true);
        case KeyKind::number:
            return edit_numbers(editor, row, 1, false);
        case KeyKind::extent:
            return edit_numbers(editor, row, 3, true);
        case KeyKind::vector:
            return edit_numbers(editor, row, 3, false);
        case KeyKind::range:
            return edit_numbers(editor, row, 2, false);
        case KeyKind::counts:
            return edit_numbers(editor, row, 2, true);
        case KeyKind::colour:
            return edit_numbers(editor, row, 3, false);
        case KeyKind::word:
            return edit_word(editor, row);
        case KeyKind::boundaries:
            return edit_boundaries(row);
        case KeyKind::texts:
            return edit_texts(editor, row, unfinished);
        case KeyKind::text:
        case KeyKind::path:
        case KeyKind::seed:
            return edit_text(editor, row, unfinished);
        case KeyKind::table:
        case KeyKind::tables:
            break;
    }
    return std::nullopt;
}

}  // namespace nephos
