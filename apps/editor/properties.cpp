// SPDX-License-Identifier: Apache-2.0
// The panel of the selected section: a control for each key, made from the key's description. Nothing here knows a key
// by name.

#include <algorithm>
#include <cmath>

#include <imgui.h>
#include <imgui_stdlib.h>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"

namespace nephos {
namespace {

// A key in the panel: its place, and its value in the text or else the default.
struct Row {
    const Key& key;
    TextPath path;
    const Node* node;  // its value; null when it has none at all
    bool present;      // in the text
};

std::string hint_of(const Row& row) {
    const Key& key = row.key;
    std::string text = key.effect.empty() ? readable_name(key) : key.effect;
    text += "\n\n" + path_text(row.path) + ": " + expected_text(key);
    const std::string fallback = !key.default_text.empty() ? key.default_text : "";
    if (key.required) {
        text += "\nrequired";
    } else if (!fallback.empty()) {
        text += "\nwithout it: " + fallback;
    }
    if (!key.source.empty()) text += "\nsource: " + key.source;
    return text;
}

double number_of(const Node& node) {
    return node.kind == Node::Kind::integer ? double(node.integer) : node.number;
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
        out += integers ? std::to_string(std::llround(numbers[n])) : number_text(numbers[n], 7);
    }
    return numbers.size() > 1 ? out + "]" : out;
}

// "%.6g m": a percent sign of a unit would be read as a format.
std::string format_of(const Key& key, bool integers) {
    std::string unit = key.unit == "per step" || key.unit == "cells" ? "" : unit_sign(key.unit);
    std::erase(unit, '%');
    return std::string(integers ? "%.0f" : "%.6g") + (unit.empty() || unit == "°" ? unit : " " + unit);
}

// How far a drag of one pixel goes: a five-hundredth of a small range, otherwise of the number's size.
double drag_speed(const Key& key, double value, bool integers) {
    const double range = key.limits.max - key.limits.min;
    double speed = std::max(std::abs(value), 1.0) * 0.006;
    if (std::isfinite(range) && range <= 1000) speed = std::min(speed, range / 300);
    if (integers) speed = std::max(speed, 0.1);
    return speed;
}

// Whether the whole range fits on a slider.
bool is_slider(const Key& key) {
    const double range = key.limits.max - key.limits.min;
    return std::isfinite(range) && range <= 400 && range > 0 && key.unit != "per step";
}

void within_limits(const Key& key, std::vector<double>& numbers) {
    for (double& number : numbers) {
        if (std::isnan(number)) number = 0;
        if (key.limits.infinite && std::isinf(number)) continue;
        const double room =
            std::min(1e-3, std::isfinite(key.limits.max) ? 1e-3 * (key.limits.max - key.limits.min) : 1e-3);
        const double low = key.limits.above_min ? key.limits.min + room : key.limits.min;
        const double high = key.limits.below_max ? key.limits.max - room : key.limits.max;
        number = std::clamp(number, low, high);
    }
}

// To a power of ten that is at most `step`.
double rounded(double number, double step) {
    if (!std::isfinite(number) || !(step > 0)) return number;
    const double unit = std::pow(10.0, std::floor(std::log10(step)));
    return std::round(number / unit) * unit;
}

// Numbers side by side. Returns the new value as TOML.
std::optional<std::string> edit_numbers(const Row& row, std::size_t count, bool integers) {
    std::vector<double> numbers = numbers_of(row.node, count);
    const std::string format = format_of(row.key, integers);
    bool changed = false;
    if (count == 1 && row.key.limits.infinite) {
        bool infinite = std::isinf(numbers[0]);
        if (ImGui::Checkbox("\u221e##infinite", &infinite)) {
            numbers[0] = infinite ? INFINITY : 1000;
            changed = true;
        }
        ImGui::SameLine();
        if (infinite) {
            ImGui::TextDisabled("no end");
            if (!changed) return std::nullopt;
            return number_text(numbers[0], 7);
        }
    }
    ImGui::SetNextItemWidth(-1);
    if (count == 1 && is_slider(row.key)) {
        const double low = row.key.limits.min, high = row.key.limits.max;
        changed |=
            ImGui::SliderScalar("##value", ImGuiDataType_Double, numbers.data(), &low, &high, format.c_str());
    } else {
        const float speed = float(drag_speed(row.key, numbers[0], integers));
        changed |=
            ImGui::DragScalarN("##value", ImGuiDataType_Double, numbers.data(), int(count), speed, nullptr,
                               nullptr, count > 2 ? (integers ? "%.0f" : "%.5g") : format.c_str());
    }
    if (!changed) return std::nullopt;
    if (!ImGui::GetIO().WantTextInput && !integers) {  // by the mouse: no more digits than a pixel means
        for (double& number : numbers) number = rounded(number, drag_speed(row.key, number, false));
    }
    within_limits(row.key, numbers);
    const bool one_for_both =
        count == 2 && row.node != nullptr && row.node->kind != Node::Kind::array && row.present;
    if (one_for_both && numbers[0] == numbers[1]) numbers.resize(1);
    return number_list(numbers, integers);
}

std::optional<std::string> edit_text(const Row& row) {
    std::string text = row.node != nullptr ? row.node->text : "";
    if (row.node != nullptr && row.node->kind == Node::Kind::integer)
        text = std::to_string(row.node->integer);
    ImGui::SetNextItemWidth(-1);
    ImGui::InputText("##value", &text);
    if (!ImGui::IsItemDeactivatedAfterEdit()) return std::nullopt;
    if (row.key.kind == KeyKind::seed) {
        std::uint64_t seed = 0;
        if (!parse_seed(text, seed)) return std::nullopt;
        const bool plain = seed <= 0x7fffffffffffffff && !text.starts_with("0x");
        return plain ? std::to_string(seed) : toml_string(text);
    }
    return toml_string(text);
}

std::optional<std::string> edit_word(const Row& row) {
    const std::string now = row.node != nullptr ? row.node->text : "";
    std::optional<std::string> chosen;
    ImGui::SetNextItemWidth(-1);
    if (ImGui::BeginCombo("##value", now.empty() ? "(none)" : now.c_str())) {
        for (const std::string_view word : row.key.words) {
            if (ImGui::Selectable(std::string(word).c_str(), word == now)) chosen = toml_string(word);
        }
        ImGui::EndCombo();
    }
    return chosen;
}

std::optional<std::string> edit_boundaries(const Row& row) {
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

std::optional<std::string> edit_colour(const Row& row) {
    const std::vector<double> numbers = numbers_of(row.node, 3);
    float colour[3] = {float(numbers[0]), float(numbers[1]), float(numbers[2])};
    ImGui::SetNextItemWidth(-1);
    if (!ImGui::ColorEdit3("##value", colour, ImGuiColorEditFlags_Float | ImGuiColorEditFlags_HDR))
        return std::nullopt;
    std::vector<double> out{colour[0], colour[1], colour[2]};
    within_limits(row.key, out);
    for (double& part : out) part = std::round(part * 1e4) / 1e4;
    return number_list(out, false);
}

// Names that a list of texts may hold: those of models or skies.
std::vector<std::string> candidates(const Editor& editor, const Row& row) {
    std::vector<std::string> names;
    const std::optional<Scene>& scene = editor.document->scene();
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

std::optional<std::string> edit_texts(Editor& editor, const Row& row) {
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
    ImGui::SetNextItemWidth(-1);
    const std::vector<std::string> names = candidates(editor, row);
    if (names.empty()) {
        ImGui::InputText("##value", &shown);
        if (!ImGui::IsItemDeactivatedAfterEdit()) return std::nullopt;
        std::vector<std::string> parts;
        for (std::size_t at = 0; at <= shown.size();) {
            const std::size_t comma = std::min(shown.find(',', at), shown.size());
            const std::size_t first = std::min(shown.find_first_not_of(' ', at), comma);
            std::string part = shown.substr(first, comma - first);
            while (!part.empty() && part.back() == ' ') part.pop_back();
            if (!part.empty()) parts.push_back(std::move(part));
            at = comma + 1;
        }
        return as_toml(parts);
    }
    std::optional<std::string> out;
    if (ImGui::BeginCombo("##value", shown.empty() ? "(none)" : shown.c_str())) {
        for (const std::string& name : names) {
            bool on = std::ranges::find(texts, name) != texts.end();
            if (ImGui::Checkbox(name.c_str(), &on)) {
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

std::optional<std::string> edit_value(Editor& editor, const Row& row) {
    switch (row.key.kind) {
        case KeyKind::boolean: {
            bool on = row.node != nullptr && row.node->boolean;
            if (ImGui::Checkbox("##value", &on)) return on ? "true" : "false";
            return std::nullopt;
        }
        case KeyKind::integer:
        case KeyKind::count:
            return edit_numbers(row, 1, true);
        case KeyKind::number:
            return edit_numbers(row, 1, false);
        case KeyKind::extent:
            return edit_numbers(row, 3, true);
        case KeyKind::vector:
            return edit_numbers(row, 3, false);
        case KeyKind::range:
            return edit_numbers(row, 2, false);
        case KeyKind::counts:
            return edit_numbers(row, 2, true);
        case KeyKind::colour:
            return edit_colour(row);
        case KeyKind::word:
            return edit_word(row);
        case KeyKind::boundaries:
            return edit_boundaries(row);
        case KeyKind::texts:
            return edit_texts(editor, row);
        case KeyKind::text:
        case KeyKind::path:
        case KeyKind::seed:
            return edit_text(row);
        case KeyKind::table:
        case KeyKind::tables:
            break;
    }
    return std::nullopt;
}

std::size_t models_from_files(const Editor& editor) {
    const std::optional<Scene>& scene = editor.document->scene();
    const Node* own = value_node(editor.document->values(), text_path("model"));
    const std::size_t in_text = own != nullptr ? own->items.size() : 0;
    return scene && scene->models.size() > in_text ? scene->models.size() - in_text : 0;
}

// The value of a key that the text does not have; kept until the text changes.
const Node* default_node(Editor& editor, const Key& key, const TextPath& path) {
    if (editor.defaults_version != editor.document->version()) {
        editor.defaults.clear();
        editor.defaults_version = editor.document->version();
    }
    const std::string name = path_text(path);
    const auto known = editor.defaults.find(name);
    if (known != editor.defaults.end())
        return known->second.kind == Node::Kind::table ? nullptr : &known->second;
    std::string value;
    if (const std::optional<Scene>& scene = editor.document->scene()) {
        const TextPath above(path.begin(), path.end() - 1);
        value = default_value(key, owner_at(*scene, above, models_from_files(editor)));
    }
    Node& made = editor.defaults[name];  // a table: it has none
    if (!value.empty()) made = parsed_value(value);
    return made.kind == Node::Kind::table ? nullptr : &made;
}

void value_row(Editor& editor, const Row& row) {
    const std::string name = path_text(row.path);
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::PushID(name.c_str());
    ImGui::AlignTextToFramePadding();
    const std::string label = readable_name(row.key);
    if (row.present) {
        ImGui::TextUnformatted(label.c_str());
    } else {
        ImGui::TextDisabled("%s", label.c_str());
    }
    tooltip_of_last(hint_of(row).c_str());
    ImGui::TableNextColumn();
    if (const std::optional<std::string> value = edit_value(editor, row)) {
        const bool dragging = ImGui::IsItemActive() || ImGui::IsMouseDown(ImGuiMouseButton_Left);
        if (row.key.name == "name" && row.path.size() > 1 && value->starts_with('"')) {
            const Node typed = parsed_value(*value);
            change_text(
                editor,
                with_new_name(editor.document->text(), editor.document->values(), row.path, typed.text),
                "Rename to " + typed.text);
        } else {
            set_value(editor, row.path, *value, dragging);
        }
    }
    editor.controls.note(name);
    ImGui::TableNextColumn();
    if (row.present && !row.key.required) {
        if (ImGui::SmallButton("\u00d7")) {
            change_text(editor, without(editor.document->text(), row.path), "Reset " + name);
        }
        editor.controls.note("reset " + name);
        tooltip_of_last("Take it out of the scene: the default holds");
    }
    ImGui::PopID();
}

bool matches(const std::string& filter, const Row& row) {
    if (filter.empty()) return true;
    const auto lower = [](std::string text) {
        std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
        return text;
    };
    const std::string wanted = lower(filter);
    return lower(path_text(row.path)).find(wanted) != std::string::npos ||
           lower(readable_name(row.key)).find(wanted) != std::string::npos;
}

TextPath joined_path(const TextPath& path, const std::string& name) {
    TextPath out = path;
    out.push_back({name, 0});
    return out;
}

// Rows of the plain keys of a section; returns whether there were any.
bool plain_rows(Editor& editor, const Section& section, const TextPath& path, const std::string& filter) {
    bool any = false, open = false;
    for (const Key& key : section.keys) {
        if (key.kind == KeyKind::table || key.kind == KeyKind::tables) continue;
        const TextPath at = joined_path(path, key.name);
        const Node* node = value_node(editor.document->values(), at);
        const Row row{key, at, node != nullptr ? node : default_node(editor, key, at), node != nullptr};
        if (!matches(filter, row)) continue;
        if (!any) {
            open = ImGui::BeginTable("keys", 3, ImGuiTableFlags_SizingStretchProp);
            if (open) {
                ImGui::TableSetupColumn("key", ImGuiTableColumnFlags_WidthStretch, 0.42f);
                ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch, 0.58f);
                ImGui::TableSetupColumn("reset", ImGuiTableColumnFlags_WidthFixed,
                                        1.8f * ImGui::GetFontSize());
            }
            any = true;
        }
        if (open) value_row(editor, row);
    }
    if (open) ImGui::EndTable();
    return any;
}

void section_rows(Editor& editor, const Section& section, const TextPath& path);

// Tables within a section, each under a heading that folds.
void nested_tables(Editor& editor, const Section& section, const TextPath& path) {
    for (const Key& key : section.keys) {
        if (key.kind != KeyKind::table) continue;
        const TextPath at = joined_path(path, key.name);
        const bool present = value_node(editor.document->values(), at) != nullptr;
        const std::string name = path_text(at);
        ImGui::PushID(name.c_str());
        const bool open = ImGui::CollapsingHeader(
            readable_name(key).c_str(), present ? ImGuiTreeNodeFlags_DefaultOpen : ImGuiTreeNodeFlags_None);
        editor.controls.note("section " + name);
        tooltip_of_last(key.effect.c_str());
        if (open) {
            ImGui::Indent(6);
            section_rows(editor, *key.section, at);
            ImGui::Unindent(6);
        }
        ImGui::PopID();
    }
}

void section_rows(Editor& editor, const Section& section, const TextPath& path) {
    plain_rows(editor, section, path, {});
    if (path.empty()) return;  // the sections of a scene stand in the outline
    nested_tables(editor, section, path);
    for (const Key& key : section.keys) {
        if (key.kind != KeyKind::tables) continue;
        const TextPath at = joined_path(path, key.name);
        const Node* array = value_node(editor.document->values(), at);
        const std::size_t count = array != nullptr ? array->items.size() : 0;
        const std::string label = list_name(key) + " (" + std::to_string(count) + ")";
        ImGui::Spacing();
        if (ImGui::Selectable((label + "  \u203a##" + path_text(at)).c_str())) editor.selected = at;
        editor.controls.note("open " + path_text(at));
        tooltip_of_last(key.effect.c_str());
    }
}

// All keys of the scene whose names match.
void found_rows(Editor& editor, const Section& section, const TextPath& path) {
    const std::string heading = path.empty() ? "Scene" : path_text(path);
    ImGui::PushID(heading.c_str());
    const float before = ImGui::GetCursorPosY();
    if (plain_rows(editor, section, path, editor.filter) && ImGui::GetCursorPosY() > before) {
        ImGui::TextDisabled("%s", ("\u2191 " + heading).c_str());
        ImGui::Separator();
    }
    ImGui::PopID();
    for (const Key& key : section.keys) {
        if (key.kind == KeyKind::table) found_rows(editor, *key.section, joined_path(path, key.name));
        if (key.kind != KeyKind::tables) continue;
        const TextPath at = joined_path(path, key.name);
        for (std::size_t n = 0; n < 50; ++n) {
            const Node* array = value_node(editor.document->values(), at);  // an edit replaces the values
            if (array == nullptr || n >= array->items.size()) break;
            TextPath element = at;
            element.push_back({{}, n});
            found_rows(editor, *key.section, element);
        }
    }
}

}  // namespace

void properties_panel(Editor& editor) {
    ImGui::SetNextItemWidth(-1);
    ImGui::InputTextWithHint("##filter", "Find a key of the scene", &editor.filter);
    editor.controls.note("find");
    if (ImGui::BeginChild("keys")) {
        if (!editor.filter.empty()) {
            found_rows(editor, scene_section(), {});
        } else {
            const bool is_list = !editor.selected.empty() && !editor.selected.back().name.empty() &&
                                 key_at(editor.selected) != nullptr &&
                                 key_at(editor.selected)->kind == KeyKind::tables;
            const Section* section = section_at(editor.selected);
            const std::string heading = editor.selected.empty() ? "Scene" : path_text(editor.selected);
            ImGui::TextUnformatted(heading.c_str());
            const Key* key = key_at(editor.selected);
            const std::string& effect = key != nullptr ? key->effect : scene_section().effect;
            if (!effect.empty()) {
                ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
                ImGui::TextWrapped("%s", effect.substr(0, 260).c_str());
                ImGui::PopStyleColor();
            }
            ImGui::Separator();
            if (is_list) {
                ImGui::TextWrapped("Choose an element on the left, or make one with +.");
            } else if (section != nullptr) {
                section_rows(editor, *section, editor.selected);
            }
        }
    }
    ImGui::EndChild();
}

}  // namespace nephos
