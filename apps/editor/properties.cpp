// SPDX-License-Identifier: Apache-2.0
// The panel of the selected section: a row for each key, made from the key's description. Nothing here knows a key by
// name.

#include <algorithm>
#include <cmath>
#include <utility>

#include <imgui.h>

#include "apps/editor/field_text.h"
#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "apps/editor/value_controls.h"
#include "apps/editor/wind_level.h"
#include "core/error.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

std::string hint_of(const ValueRow& row) {
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
    static const Scene kPlain;
    const TextPath above(path.begin(), path.end() - 1);
    // While the text has problems the elements of the last scene may be others.
    const bool is_in_list =
        std::ranges::any_of(above, [](const TextStep& step) { return step.name.empty(); });
    const Scene* scene = editor.document->current_scene();
    if (scene == nullptr && editor.document->last_sound_scene())
        scene = is_in_list ? &kPlain : &*editor.document->last_sound_scene();
    if (const Node* level =
            level_of_wind(editor.document->values(), path))  // in the form that it is not given in
        value = number_text(*value_of_wind(velocity_of(*level), key.name), 6);
    else if (scene != nullptr)
        value = default_value(key, owner_at(*scene, above, models_from_files(editor)));
    Node& made = editor.defaults[name];  // a table: it has none
    if (!value.empty()) made = parsed_value(value);
    return made.kind == Node::Kind::table ? nullptr : &made;
}

// The names of models that the scene has from files; none while the text has problems, as the scene is then of an earlier one.
std::vector<std::string> names_from_files(const Editor& editor) {
    std::vector<std::string> names;
    const Scene* const scene = editor.document->current_scene();
    if (scene == nullptr) return names;
    for (std::size_t n = 0; n < models_from_files(editor); ++n) names.push_back(scene->models[n].name);
    return names;
}

NumberForm form_of(const Key& key) {
    switch (key.kind) {
        case KeyKind::integer:
        case KeyKind::count:
        case KeyKind::counts:
        case KeyKind::extent:
        case KeyKind::seed:
            return NumberForm::integer;
        default:
            return NumberForm::any;
    }
}

// Returns whether Escape has left a number as it was before it was typed; what was typed is then gone.
bool is_given_up(Editor& editor, const TextPath& path) {
    if (!ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Escape)) ||
        ImGui::IsMouseDown(ImGuiMouseButton_Left))
        return false;
    if (editor.recorded_value && editor.recorded_value->path == path) {
        editor.recorded_value.reset();
        return true;
    }
    return editor.document->take_back(path_text(path));
}

// Returns whether a value is a name by which other keys may call its element.
bool is_name(const TextPath& path, const Key& key, const std::string& value) {
    return key.name == "name" && path.size() >= 2 && value.starts_with('"');
}

// Throws Error(usage) for a name that is refused.
std::string renamed(const Editor& editor, const std::string& text, const TextPath& path,
                    const std::string& name) {
    return with_new_name(text, editor.document->values(), path, name, names_from_files(editor));
}

bool starts_with(const TextPath& path, const TextPath& beginning) {
    return path.size() >= beginning.size() && std::equal(beginning.begin(), beginning.end(), path.begin());
}

// Returns by what ImGui knows the field of a key.
std::string row_id(const Editor& editor, const TextPath& path) {
    if (!editor.followed_rows || !starts_with(path, editor.followed_rows->now)) return path_text(path);
    TextPath id = editor.followed_rows->before;
    id.insert(id.end(), path.begin() + std::ptrdiff_t(editor.followed_rows->now.size()), path.end());
    return path_text(id);
}

void value_row(Editor& editor, const ValueRow& row) {
    const std::string name = path_text(row.path);
    ImGui::TableNextRow();
    ImGui::TableNextColumn();
    ImGui::PushID(row_id(editor, row.path).c_str());
    ImGui::AlignTextToFramePadding();
    const std::string label = readable_name(row.key);
    if (row.present) {
        ImGui::TextUnformatted(label.c_str());
    } else {
        ImGui::TextDisabled("%s", label.c_str());
    }
    tooltip_of_last(hint_of(row).c_str());
    ImGui::TableNextColumn();
    bool unfinished = false;
    const std::optional<std::string> value = edit_value(editor, row, unfinished);
    if (!is_given_up(editor, row.path) && value) {
        const bool dragging = active_item() != 0 || ImGui::IsMouseDown(ImGuiMouseButton_Left);
        if (unfinished)
            editor.typed = {row.path, &row.key, *value, true};
        else
            take_value(editor, row.path, row.key, *value, dragging);
    }
    editor.controls.note(name);
    ImGui::TableNextColumn();
    if (row.present && !row.key.required) {
        if (ImGui::SmallButton("\u00d7")) {
            change_text(
                editor, [&](const std::string& text) { return without(text, row.path); }, "Reset " + name);
        }
        editor.controls.note("reset " + name);
        tooltip_of_last("Take it out of the scene: the default holds");
    }
    ImGui::PopID();
}

std::string lower(std::string text) {
    std::ranges::transform(text, text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return text;
}

bool matches(const std::string& filter, const ValueRow& row) {
    if (filter.empty()) return true;
    const std::string wanted = lower(filter);
    return lower(path_text(row.path)).find(wanted) != std::string::npos ||
           lower(readable_name(row.key)).find(wanted) != std::string::npos;
}

TextPath joined_path(const TextPath& path, const std::string& name) {
    TextPath out = path;
    out.push_back({name, 0});
    return out;
}

// Returns what the field of a key shows that key frames stand for: `value`, but while a number has the caret what it was before.
const std::string& standing_value(Editor& editor, const TextPath& path, const std::string& value) {
    std::string& shown = editor.values_now[path_text(path)];
    if (shown.empty() || !is_number_field_active()) shown = value;
    return shown;
}

// Rows of the plain keys of a section; returns whether there were any.
bool plain_rows(Editor& editor, const Section& section, const TextPath& path, const std::string& filter) {
    bool any = false, open = false;
    for (const Key& key : section.keys) {
        if (key.kind == KeyKind::table || key.kind == KeyKind::tables) continue;
        const TextPath at = joined_path(path, key.name);
        const Node* node = value_node(editor.document->values(), at);
        const bool present = node != nullptr;
        Node now;  // of a key that key frames stand for
        if (const std::optional<std::string> value = value_now(editor, at)) {
            const bool is_typed = editor.recorded_value && editor.recorded_value->path == at;
            now = parsed_value(is_typed ? *value : standing_value(editor, at, *value));
            node = &now;
        }
        const ValueRow row{key, at, node != nullptr ? node : default_node(editor, key, at), present};
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
        ImGui::PushID(row_id(editor, at).c_str());
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

// Returns true when a search names an element by its number, or a key of it: "wind[55]", "wind[55].time_s".
bool is_asked_for(const TextPath& element, const std::string& filter) {
    if (filter.find('[') == std::string::npos) return false;
    const std::string name = lower(path_text(element)), wanted = lower(filter);
    return name.find(wanted) != std::string::npos || wanted.find(name) != std::string::npos;
}

// All keys of the scene whose names match. Returns whether there were any.
bool found_rows(Editor& editor, const Section& section, const TextPath& path) {
    constexpr std::size_t kMostShown = 50;  // of a list
    const std::string heading = path.empty() ? "Scene" : path_text(path);
    ImGui::PushID(heading.c_str());
    const float before = ImGui::GetCursorPosY();
    bool any = plain_rows(editor, section, path, editor.filter);
    if (any && ImGui::GetCursorPosY() > before) {
        ImGui::TextDisabled("%s", ("\u2191 " + heading).c_str());
        ImGui::Separator();
    }
    ImGui::PopID();
    for (const Key& key : section.keys) {
        if (key.kind == KeyKind::table) any |= found_rows(editor, *key.section, joined_path(path, key.name));
        if (key.kind != KeyKind::tables) continue;
        const TextPath at = joined_path(path, key.name);
        const auto size = [&]() -> std::size_t {  // an edit replaces the values
            const Node* array = value_node(editor.document->values(), at);
            return array != nullptr ? array->items.size() : 0;
        };
        bool any_of_list = false;
        std::size_t shown = std::min(size(), kMostShown);
        for (std::size_t n = 0; n < size(); ++n) {
            TextPath element = at;
            element.push_back({{}, n});
            if (n >= kMostShown && !is_asked_for(element, editor.filter)) continue;
            if (n >= kMostShown && ++shown > 2 * kMostShown) break;
            any_of_list |= found_rows(editor, *key.section, element);
        }
        any |= any_of_list;
        shown = std::min(shown, 2 * kMostShown);
        if (!any_of_list || size() <= shown) continue;
        ImGui::TextDisabled("%s: %zu more, in the outline", path_text(at).c_str(), size() - shown);
        editor.controls.note("more of " + path_text(at));
    }
    return any;
}

// Goes up to the list where what is selected is not there any more, as another program has taken it out.
void leave_missing_element(Editor& editor) {
    if (editor.document->has_syntax_error()) return;  // it may be there all the same
    TextPath path;
    for (const TextStep& step : editor.selected) {
        path.push_back(step);
        if (!step.name.empty() || value_node(editor.document->values(), path) != nullptr) continue;
        path.pop_back();
        editor.selected = path;
        return;
    }
}

}  // namespace

void take_value(Editor& editor, const TextPath& path, const Key& key, const std::string& value,
                bool dragging) {
    if (!is_name(path, key, value)) return set_value(editor, path, value, dragging, form_of(key));
    const std::string name = parsed_value(value).text;
    change_text(
        editor, [&](const std::string& text) { return renamed(editor, text, path, name); },
        "Rename to " + name);
}

std::string text_with_typed(const Editor& editor) {
    const std::string& text = editor.document->text();
    if (editor.document->has_syntax_error()) return text;
    try {
        const Node& values = editor.document->values();
        if (const auto& recorded = editor.recorded_value) {
            const std::optional<TextPath> place = recorded_place(editor, recorded->path);
            const TextPath path = place.value_or(recorded->path);
            const std::string edited =
                with_value_of_wind(text, values, path, recorded->value, recorded->form);
            if (!place) return edited;  // it would be refused, and is kept where it was typed
            try {
                return with_recorded(editor, path, edited);
            } catch (const Error&) {  // it is kept as it would be without recording
                return edited;
            }
        }
        if (!editor.typed) return text;
        const auto& [path, key, value, is_drawn] = *editor.typed;
        if (is_name(path, *key, value)) {
            try {
                return renamed(editor, text, path, parsed_value(value).text);
            } catch (const Error&) {  // it would be refused, and is kept as it is
            }
        }
        return with_value_of_wind(text, values, path, value, form_of(*key));
    } catch (const Error&) {  // the text was changed meanwhile, and has no such place any more
        return text;
    }
}

void take_typed_value(Editor& editor) {
    if (!editor.typed || editor.typed->is_drawn) return;
    const Editor::TypedValue typed = *std::exchange(editor.typed, std::nullopt);
    // A field that was left by Enter or Escape has no text any more.
    if (forget_unfinished_text()) take_value(editor, typed.path, *typed.key, typed.value);
}

std::size_t models_from_files(const Editor& editor) {
    const Scene* const scene = editor.document->current_scene();
    const Node* own = value_node(editor.document->values(), text_path("model"));
    const std::size_t in_text = own != nullptr ? own->items.size() : 0;
    return scene != nullptr && scene->models.size() > in_text ? scene->models.size() - in_text : 0;
}

void properties_panel(Editor& editor) {
    leave_missing_element(editor);
    const bool is_followed = editor.followed_rows && editor.filter.empty() &&
                             starts_with(editor.selected, editor.followed_rows->now);
    if (!is_followed) editor.followed_rows.reset();
    ImGui::SetNextItemWidth(-1);
    input_text("##filter", editor.filter, "Find a key of the scene");
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
            generation_row(editor);
            ImGui::Separator();
            if (is_list) {
                ImGui::TextWrapped("Choose an element on the left, or make one with +.");
            } else if (section != nullptr) {
                section_rows(editor, *section, editor.selected);
                hodograph(editor);
                if (editor.selected.size() == 1 && editor.selected[0].name == "sun") {
                    ImGui::Spacing();
                    sun_dial(editor, "sun dial");
                }
            }
        }
    }
    ImGui::EndChild();
}

}  // namespace nephos
