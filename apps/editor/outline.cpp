// SPDX-License-Identifier: Apache-2.0
// The outline: sections of the scene, and the elements of its lists with New, Copy and Delete.

#include <algorithm>
#include <array>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "scenes/format/text.h"

namespace nephos {
namespace {

// Headings over the sections of a scene, by the first of each group.
constexpr std::array<std::pair<std::string_view, const char*>, 5> kHeadings{{
    {"lattice", "SIMULATION"},
    {"model", "CLOUDS AND SKIES"},
    {"density", "DENSITY AND FILES"},
    {"camera", "CAMERA AND LIGHT"},
    {"air", "AIR AND GROUND"},
}};

TextPath joined_path(const TextPath& path, const std::string& name) {
    TextPath out = path;
    out.push_back({name, 0});
    return out;
}

TextPath element_path(const TextPath& array, std::size_t index) {
    TextPath out = array;
    out.push_back({{}, index});
    return out;
}

// Where something new is put: in the middle of the lattice, on its floor.
Vec3 middle_of(const Editor& editor) {
    const std::optional<Scene>& scene = editor.document->last_sound_scene();
    if (!scene) return {0, 0, 1000};
    const bool of_layer = !scene->layers.empty();
    const Extent& cells = of_layer ? scene->layers.front().extent : scene->automaton.extent;
    const Placement& place = of_layer ? scene->layers.front().placement : scene->automaton.placement;
    const double edge = place.cell_size_m;
    return {place.origin_m.x + 0.5 * edge * cells.x, place.origin_m.y + 0.5 * edge * cells.y,
            place.origin_m.z};
}

// What was selected since the last frame is seen: everything above it opens, and itself.
bool leads_to_new_selection(const Editor& editor, const TextPath& path) {
    return editor.selected != editor.revealed && editor.selected.size() >= path.size() &&
           std::equal(path.begin(), path.end(), editor.selected.begin());
}

std::string label_of(const Node& element, const Key& list, std::size_t index) {
    const Entry* name = element.find("name");
    if (name != nullptr && name->value.kind == Node::Kind::text && !name->value.text.empty())
        return name->value.text;
    return element_name(list.name) + " " + std::to_string(index + 1);
}

// Chooses what the outline shows, and brings its keys to the front in the properties.
void choose(Editor& editor, const TextPath& path) {
    editor.selected = path;
    editor.wanted_tab = 0;
}

void add_element(Editor& editor, const Key& list, const TextPath& path) {
    const std::optional<Scene>& scene = editor.document->last_sound_scene();
    // Seeds and roots stand in their model's own space.
    const bool in_model = path.size() > 2 && path.front().name == "model";
    const Vec3 place = in_model ? Vec3{} : middle_of(editor);
    const Node* array = value_node(editor.document->values(), path);
    const std::size_t index = array != nullptr ? array->items.size() : 0;
    const auto added = [&](const std::string& text) {
        return with_new_element(
            text, path, new_element(list, editor.document->values(), path, scene ? &*scene : nullptr, place));
    };
    if (!change_text(editor, added, "New " + path_text(element_path(path, index)))) return;
    choose(editor, element_path(path, index));
}

void copy_element(Editor& editor, const TextPath& array, std::size_t index) {
    const auto copied = [&](const std::string& before) {
        std::string text = with_copied_element(before, array, index);
        const Node& values = editor.document->values();
        const Node* list = value_node(values, array);
        if (list == nullptr) return text;
        const TextPath copy = element_path(array, index + 1);
        const Entry* name = list->items.at(index).find("name");
        if (name != nullptr && name->value.kind == Node::Kind::text)
            text = with_value(
                text, joined_path(copy, "name"),
                toml_string(unused_name(name->value.text,
                                        taken_names(values, array, editor.document->current_scene()))));
        const Key* const tables = key_at(array);
        if (tables == nullptr) return text;
        if (const std::optional<TextEntry> place = place_of_copy(*tables, *list, index))
            text = with_value(text, joined_path(copy, place->first), place->second);
        return text;
    };
    if (!change_text(editor, copied, "Copy " + path_text(element_path(array, index)))) return;
    editor.selected = element_path(array, index + 1);
}

void delete_element(Editor& editor, const TextPath& array, std::size_t index) {
    const auto deleted = [&](const std::string& text) { return without(text, element_path(array, index)); };
    if (change_text(editor, deleted, "Delete " + path_text(element_path(array, index))))
        editor.selected = array;
}

void outline_keys(Editor& editor, const Section& section, const TextPath& path, bool top);

void element_row(Editor& editor, const Key& list, const TextPath& array, const Node& elements,
                 std::size_t index) {
    const TextPath at = element_path(array, index);
    const bool has_lists = std::ranges::any_of(list.section->keys, [](const Key& key) {
        return key.kind == KeyKind::tables ||
               (key.section != nullptr && std::ranges::any_of(key.section->keys, [](const Key& inner) {
                    return inner.kind == KeyKind::tables;
                }));
    });
    ImGui::PushID(int(index));
    const ImGuiTreeNodeFlags flags =
        (has_lists ? ImGuiTreeNodeFlags_OpenOnArrow : ImGuiTreeNodeFlags_Leaf) |
        ImGuiTreeNodeFlags_SpanAvailWidth |
        (editor.selected == at ? ImGuiTreeNodeFlags_Selected : ImGuiTreeNodeFlags_None);
    const std::string label = label_of(elements.items[index], list, index);
    if (has_lists && leads_to_new_selection(editor, at)) ImGui::SetNextItemOpen(true);
    const bool open = ImGui::TreeNodeEx("element", flags, "%s", label.c_str());
    editor.controls.note(path_text(at));
    if (ImGui::IsItemClicked() || ImGui::IsItemClicked(ImGuiMouseButton_Right)) choose(editor, at);
    if (ImGui::BeginPopupContextItem()) {
        if (ImGui::MenuItem("Copy", "Ctrl+D")) copy_element(editor, array, index);
        if (ImGui::MenuItem("Delete", "Del")) delete_element(editor, array, index);
        ImGui::EndPopup();
    }
    if (open) {
        if (has_lists) outline_keys(editor, *list.section, at, false);
        ImGui::TreePop();
    }
    ImGui::PopID();
}

void list_row(Editor& editor, const Key& key, const TextPath& at) {
    const Node* array = value_node(editor.document->values(), at);
    const std::size_t count = array != nullptr ? array->items.size() : 0;
    const std::string name = path_text(at);
    ImGui::PushID(name.c_str());
    const ImGuiTreeNodeFlags flags =
        ImGuiTreeNodeFlags_OpenOnArrow | ImGuiTreeNodeFlags_SpanAvailWidth |
        ImGuiTreeNodeFlags_AllowItemOverlap |
        (count == 0 ? ImGuiTreeNodeFlags_Leaf : ImGuiTreeNodeFlags_None) |
        (editor.selected == at ? ImGuiTreeNodeFlags_Selected : ImGuiTreeNodeFlags_None);
    if (count == 0) ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
    if (leads_to_new_selection(editor, at)) ImGui::SetNextItemOpen(true);
    const bool open = ImGui::TreeNodeEx("list", flags, "%s (%zu)", list_name(key).c_str(), count);
    if (count == 0) ImGui::PopStyleColor();
    editor.controls.note(name);
    const bool hovered = ImGui::IsItemHovered();
    const bool clicked = ImGui::IsItemClicked() && !ImGui::IsItemToggledOpen();
    ImGui::SameLine(ImGui::GetContentRegionMax().x - 1.3f * ImGui::GetFontSize());
    if (ImGui::SmallButton("+")) add_element(editor, key, at);
    editor.controls.note("new " + name);
    if (clicked && !ImGui::IsItemHovered()) choose(editor, at);
    if (ImGui::IsItemHovered()) {
        ImGui::SetTooltip("New %s", element_name(key.name).c_str());
    } else if (hovered) {
        tooltip(key.effect.c_str());
    }
    if (open) {
        const Node* now = value_node(editor.document->values(), at);  // a click may have changed it
        for (std::size_t n = 0; now != nullptr && n < now->items.size(); ++n) {
            element_row(editor, key, at, *now, n);
            now = value_node(editor.document->values(), at);
        }
        ImGui::TreePop();
    }
    ImGui::PopID();
}

void outline_keys(Editor& editor, const Section& section, const TextPath& path, bool top) {
    for (const Key& key : section.keys) {
        if (key.section == nullptr) continue;
        const TextPath at = joined_path(path, key.name);
        const auto heading =
            std::ranges::find(kHeadings, key.name, [](const auto& entry) { return entry.first; });
        if (top && heading != kHeadings.end()) {
            ImGui::Spacing();
            ImGui::TextDisabled("%s", heading->second);
        }
        if (key.kind == KeyKind::tables) {
            list_row(editor, key, at);
            continue;
        }
        const bool has_lists = std::ranges::any_of(
            key.section->keys, [](const Key& inner) { return inner.kind == KeyKind::tables; });
        if (!top && !has_lists) continue;  // in the properties
        const bool present = value_node(editor.document->values(), at) != nullptr;
        const ImGuiTreeNodeFlags flags =
            ImGuiTreeNodeFlags_OpenOnArrow | ImGuiTreeNodeFlags_SpanAvailWidth |
            (has_lists ? ImGuiTreeNodeFlags_None : ImGuiTreeNodeFlags_Leaf) |
            (has_lists && present ? ImGuiTreeNodeFlags_DefaultOpen : ImGuiTreeNodeFlags_None) |
            (editor.selected == at ? ImGuiTreeNodeFlags_Selected : ImGuiTreeNodeFlags_None);
        if (!present) ImGui::PushStyleColor(ImGuiCol_Text, ImGui::GetStyleColorVec4(ImGuiCol_TextDisabled));
        if (has_lists && leads_to_new_selection(editor, at)) ImGui::SetNextItemOpen(true);
        const bool open = ImGui::TreeNodeEx(key.name.c_str(), flags, "%s", readable_name(key).c_str());
        if (!present) ImGui::PopStyleColor();
        editor.controls.note(path_text(at));
        tooltip_of_last(key.section->effect.c_str());
        if (ImGui::IsItemClicked() && !ImGui::IsItemToggledOpen()) choose(editor, at);
        if (open) {
            if (has_lists) outline_keys(editor, *key.section, at, false);
            ImGui::TreePop();
        }
    }
}

}  // namespace

void outline_panel(Editor& editor) {
    simulations_list(editor);
    const ImGuiTreeNodeFlags flags =
        ImGuiTreeNodeFlags_Leaf | ImGuiTreeNodeFlags_SpanAvailWidth |
        (editor.selected.empty() ? ImGuiTreeNodeFlags_Selected : ImGuiTreeNodeFlags_None);
    if (ImGui::TreeNodeEx("scene", flags, "%s", editor.document->title().c_str())) ImGui::TreePop();
    editor.controls.note("scene");
    if (ImGui::IsItemClicked()) choose(editor, {});
    const TextPath selected = editor.selected;
    outline_keys(editor, scene_section(), {}, true);
    editor.revealed = selected;

    const bool is_element = !editor.selected.empty() && editor.selected.back().name.empty();
    const bool typing = ImGui::GetIO().WantTextInput;
    if (is_element && !typing && !is_asking(editor) &&
        value_node(editor.document->values(), editor.selected) != nullptr) {
        const TextPath array(editor.selected.begin(), editor.selected.end() - 1);
        const std::size_t index = editor.selected.back().index;
        const bool here = ImGui::IsWindowFocused(ImGuiFocusedFlags_ChildWindows);
        if (here && ImGui::IsKeyPressed(ImGui::GetKeyIndex(ImGuiKey_Delete), false)) {
            delete_element(editor, array, index);
        } else if (ImGui::GetIO().KeyCtrl && ImGui::IsKeyPressed(int('D'), false)) {
            copy_element(editor, array, index);
        }
    }
}

}  // namespace nephos
