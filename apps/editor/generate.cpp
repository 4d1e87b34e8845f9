// SPDX-License-Identifier: Apache-2.0
// The clouds that a base model makes (T, figure 23, "Generate"): one after the other over the picture, or twenty at once
// as sketches, of which one can be chosen and kept as a base model of its own.

#include <algorithm>
#include <cmath>
#include <numeric>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "core/text.h"
#include "scenes/format/text.h"
#include "seeds/light_absorption.h"

namespace nephos {
namespace {

constexpr int kColumns = 5, kRows = 4;
constexpr std::uint32_t kLastNumber = 65'535;  // of a sky's clouds
constexpr std::int64_t kMostBoxes = 4'000;
constexpr std::size_t kMostSketched = 220;     // billboards of a sketch; of more every n-th is drawn
constexpr std::size_t kMostKeptSeeds = 2'000;  // of a cloud that becomes a base model
const Vec3 kSketchSun{-0.5, -0.55, 0.67};      // towards it: from the left, behind the one who looks north

// The index in Scene::models of the base model that is selected; nothing where none is, and while the text has problems.
std::optional<std::size_t> selected_model(const Editor& editor) {
    const Scene* const scene = editor.document->current_scene();
    if (scene == nullptr || editor.selected.size() < 2 || editor.selected[0].name != "model")
        return std::nullopt;
    const std::size_t index = editor.selected[1].index + models_from_files(editor);
    return index < scene->models.size() ? std::optional(index) : std::nullopt;
}

// Whether twenty of its clouds are made within a frame of the window; their light takes the square of the boxes.
bool is_quick(const Editor& editor, std::size_t model) {
    return largest_cloud(editor.document->current_scene()->models[model]) <= kMostBoxes;
}

GeneratedCloud generated(const Scene& scene, std::size_t model, std::uint32_t number) {
    GeneratedCloud out;
    out.number = number;
    out.cloud = reproduce(scene.models[model], scene.automaton.seed, std::uint32_t(model), number);
    out.billboards = scatter_billboards(scene.models[model], out.cloud, scene.automaton.seed,
                                        std::uint32_t(model), number);
    out.absorbed = absorbed_light(out.cloud, {}, {kSketchSun, true});
    return out;
}

// The clouds from `first` on, made anew when the scene or the choice is another.
const std::vector<GeneratedCloud>& clouds_of(const Editor& editor, Generation::Made& made, std::size_t model,
                                             std::uint32_t first, std::uint32_t count) {
    const std::uint64_t version = editor.document->version();
    const bool known = made.version == version && made.model == model && made.from == first;
    if (known && made.clouds.size() == count) return made.clouds;
    made = {version, model, first, {}};
    for (std::uint32_t n = 0; n < count; ++n)
        made.clouds.push_back(generated(*editor.document->current_scene(), model, first + n));
    return made.clouds;
}

// A soft ellipse: opaque in its middle, clear at its rim.
void puff(ImDrawList& list, const ImVec2& middle, float across, float up, ImU32 colour) {
    constexpr int kSides = 12;
    const ImVec2 white = ImGui::GetFontTexUvWhitePixel();
    list.PrimReserve(3 * kSides, kSides + 1);
    const auto first = ImDrawIdx(list._VtxCurrentIdx);
    for (int n = 0; n < kSides; ++n) {
        list.PrimWriteIdx(first);
        list.PrimWriteIdx(ImDrawIdx(first + 1 + n));
        list.PrimWriteIdx(ImDrawIdx(first + 1 + (n + 1) % kSides));
    }
    list.PrimWriteVtx(middle, white, colour);
    for (int n = 0; n < kSides; ++n) {
        const float angle = 6.2831853f * float(n) / kSides;
        list.PrimWriteVtx(ImVec2(middle.x + across * std::cos(angle), middle.y + up * std::sin(angle)), white,
                          colour & ~IM_COL32_A_MASK);
    }
}

// T's light of a billboard: what the sun gives to a surface that looks away from the cloud's middle, less what the
// boxes absorb, over a sky that is brighter above.
ImU32 colour_of(const GeneratedCloud& cloud, const Billboard& billboard) {
    const Vec3 out = billboard.centre_m - cloud.cloud.centre_m;
    const double far = std::max(length(out), 1e-6);
    const double direct = std::clamp(dot(kSketchSun, out) / far - cloud.absorbed[billboard.box], 0.0, 1.0);
    const double height = std::max(cloud.cloud.high_m.z - cloud.cloud.low_m.z, 1e-6);
    const double above = std::clamp((billboard.centre_m.z - cloud.cloud.low_m.z) / height, 0.0, 1.0);
    const double light = std::min(1.0, 0.48 + 0.22 * above + 0.5 * direct);
    return IM_COL32(int(250 * light), int(252 * light), int(255 * std::min(1.0, 1.05 * light)), 190);
}

// The cloud from the south, as large as the rectangle allows.
void sketch(const GeneratedCloud& cloud, const ImVec2& min, const ImVec2& max) {
    ImDrawList& list = *ImGui::GetWindowDrawList();
    double left = 1e30, right = -1e30, low = 1e30, high = -1e30;
    for (const Billboard& billboard : cloud.billboards) {
        left = std::min(left, billboard.centre_m.x - 0.5 * billboard.width_m);
        right = std::max(right, billboard.centre_m.x + 0.5 * billboard.width_m);
        low = std::min(low, billboard.centre_m.z - 0.5 * billboard.height_m);
        high = std::max(high, billboard.centre_m.z + 0.5 * billboard.height_m);
    }
    if (left >= right || low >= high) return;
    const float scale =
        0.94f * std::min((max.x - min.x) / float(right - left), (max.y - min.y) / float(high - low));
    const ImVec2 middle(0.5f * (min.x + max.x), 0.5f * (min.y + max.y));
    std::vector<std::uint32_t> order(cloud.billboards.size());
    std::iota(order.begin(), order.end(), 0u);
    std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
        return cloud.billboards[a].centre_m.y > cloud.billboards[b].centre_m.y;
    });
    const std::size_t stride = std::max<std::size_t>(1, order.size() / kMostSketched);
    list.PushClipRect(min, max, true);
    for (std::size_t n = 0; n < order.size(); n += stride) {
        const Billboard& billboard = cloud.billboards[order[n]];
        const ImVec2 at(middle.x + scale * float(billboard.centre_m.x - 0.5 * (left + right)),
                        middle.y - scale * float(billboard.centre_m.z - 0.5 * (low + high)));
        puff(list, at, 0.5f * scale * float(billboard.width_m), 0.5f * scale * float(billboard.height_m),
             colour_of(cloud, billboard));
    }
    list.PopClipRect();
}

std::string vector_toml(const Vec3& v) {
    const auto part = [](double value) { return number_text(std::round(1000 * value) / 1000, 9); };
    return "[" + part(v.x) + ", " + part(v.y) + ", " + part(v.z) + "]";
}

// A box of a cloud as a seed without roots: with what its own seed has besides.
std::string seed_toml(const SeedBox& box, const Seed& seed) {
    const Seed plain;
    const auto range = [](const Range& r) {
        return "[" + number_text(r.min) + ", " + number_text(r.max) + "]";
    };
    static constexpr const char* kTextures[] = {"soft", "wispy", "dense"};
    std::string out = "{ position_m = " + vector_toml(box.centre_m) +
                      ", size_m = " + vector_toml(box.size_m) +
                      ", billboards = " + std::to_string(box.billboards);
    if (!(seed.billboard_width_m == plain.billboard_width_m))
        out += ", billboard_width_m = " + range(seed.billboard_width_m);
    if (!(seed.billboard_height_m == plain.billboard_height_m))
        out += ", billboard_height_m = " + range(seed.billboard_height_m);
    if (seed.texture != plain.texture)
        out += std::string(", texture = \"") + kTextures[std::size_t(seed.texture)] + "\"";
    if (seed.strength != plain.strength) out += ", strength = " + number_text(seed.strength);
    return out + " }";
}

// Adds a copy of the selected base model after it whose seeds are the boxes of one of its clouds.
void keep_as_model(Editor& editor, std::size_t model, const GeneratedCloud& cloud) {
    if (cloud.cloud.boxes.size() > kMostKeptSeeds) {
        return say(editor,
                   "This cloud has " + std::to_string(cloud.cloud.boxes.size()) +
                       " boxes; a base model of it has at most " + std::to_string(kMostKeptSeeds) + " seeds",
                   true);
    }
    const std::size_t index = editor.selected[1].index;
    const BaseModel& from = editor.document->current_scene()->models[model];
    std::string seeds = "[";
    for (const SeedBox& box : cloud.cloud.boxes)
        seeds += (seeds.size() > 1 ? ", " : "") + seed_toml(box, from.seeds[box.seed]);
    seeds += "]";
    const std::string name = unused_name(from.name, taken_names(editor.document->values(), text_path("model"),
                                                                editor.document->current_scene()));
    const TextPath added{{"model", 0}, {{}, index + 1}};
    const auto with = [](TextPath path, const char* key) {
        path.push_back({key, 0});
        return path;
    };
    const auto kept = [&](const std::string& before) {
        std::string text = with_copied_element(before, text_path("model"), index);
        text = with_value(text, with(added, "name"), toml_string(name));
        return with_value(without(text, with(added, "seeds")), with(added, "seeds"), seeds);
    };
    if (!change_text(editor, kept, "Keep cloud " + std::to_string(cloud.number) + " of " + from.name)) return;
    editor.selected = added;
    editor.generation.shows_grid = false;
    editor.generation.number.reset();
    say(editor, "The cloud is the base model " + name + " now: skies can have it");
}

}  // namespace

const GeneratedCloud* generated_cloud(Editor& editor) {
    const std::optional<std::size_t> model = selected_model(editor);
    if (!model || !editor.generation.number || !is_quick(editor, *model)) return nullptr;
    return &clouds_of(editor, editor.generation.one, *model, *editor.generation.number, 1).front();
}

void generation_row(Editor& editor) {
    const std::optional<std::size_t> model = selected_model(editor);
    if (!model || editor.selected.size() != 2) return;
    Generation& generation = editor.generation;
    if (!is_quick(editor, *model)) {
        ImGui::TextDisabled(
            "Its clouds have up to %lld boxes: too many to be shown here.",
            static_cast<long long>(largest_cloud(editor.document->current_scene()->models[*model])));
        return;
    }
    if (button(editor, "Generate again", "The next cloud that this model makes, as boxes over the picture")) {
        generation.number =
            generation.number && *generation.number < kLastNumber ? *generation.number + 1 : 0;
    }
    ImGui::SameLine();
    if (button(editor, "20 at once", "Sketches of twenty of its clouds, to choose one from")) {
        generation.shows_grid = true;
        generation.first = 0;
    }
    if (!generation.number) return;
    const GeneratedCloud* cloud = generated_cloud(editor);
    ImGui::TextDisabled("cloud %u: %zu boxes, %zu billboards", cloud->number, cloud->cloud.boxes.size(),
                        cloud->billboards.size());
    editor.controls.note("cloud number " + std::to_string(cloud->number));
    ImGui::SameLine();
    if (ImGui::SmallButton("\u00d7##generated")) generation.number.reset();
    editor.controls.note("hide generated");
    tooltip_of_last("Show the model's own seeds alone");
}

void generation_window(Editor& editor) {
    Generation& generation = editor.generation;
    if (!generation.shows_grid) return;
    const std::optional<std::size_t> model = selected_model(editor);
    if (!model || !is_quick(editor, *model)) {
        generation.shows_grid = false;
        return;
    }
    const float em = ImGui::GetFontSize();
    const ImVec2 room = ImGui::GetIO().DisplaySize;
    ImGui::SetNextWindowSize(ImVec2(std::min(52 * em, 0.95f * room.x), std::min(37 * em, 0.9f * room.y)),
                             ImGuiCond_Appearing);
    const std::string title =
        "Clouds of " + editor.document->current_scene()->models[*model].name + "###generation";
    if (ImGui::Begin(title.c_str(), &generation.shows_grid,
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoCollapse)) {
        const std::vector<GeneratedCloud>& clouds =
            clouds_of(editor, generation.grid, *model, generation.first, std::uint32_t(kColumns * kRows));
        const ImVec2 free = ImGui::GetContentRegionAvail(), gap = ImGui::GetStyle().ItemSpacing;
        const ImVec2 size(
            std::max(8.0f, std::floor((free.x - (kColumns - 1) * gap.x) / kColumns)),
            std::max(8.0f, std::floor((free.y - kRows * gap.y - ImGui::GetFrameHeight()) / kRows)));
        for (std::size_t n = 0; n < clouds.size(); ++n) {
            if (n % kColumns != 0) ImGui::SameLine();
            const std::string name = "cloud " + std::to_string(clouds[n].number);
            const bool clicked = ImGui::InvisibleButton(name.c_str(), size);
            editor.controls.note(name);
            const ImVec2 min = ImGui::GetItemRectMin(), max = ImGui::GetItemRectMax();
            const bool chosen = generation.number == clouds[n].number;
            ImDrawList& list = *ImGui::GetWindowDrawList();
            list.AddRectFilledMultiColor(min, max, IM_COL32(70, 112, 168, 255), IM_COL32(70, 112, 168, 255),
                                         IM_COL32(148, 180, 214, 255), IM_COL32(148, 180, 214, 255));
            sketch(clouds[n], min, max);
            list.AddText(ImVec2(min.x + 4, min.y + 2), IM_COL32(255, 255, 255, 220),
                         std::to_string(clouds[n].number).c_str());
            if (chosen || ImGui::IsItemHovered())
                list.AddRect(min, max, chosen ? IM_COL32(245, 215, 90, 255) : IM_COL32(255, 255, 255, 160), 0,
                             0, 2);
            tooltip_of_last((std::to_string(clouds[n].cloud.boxes.size()) + " boxes, " +
                             std::to_string(clouds[n].billboards.size()) + " billboards; click: choose it")
                                .c_str());
            if (clicked) generation.number = clouds[n].number;
        }
        if (button(editor, "The next 20") && generation.first + 2 * kColumns * kRows <= kLastNumber)
            generation.first += kColumns * kRows;
        ImGui::SameLine();
        const auto chosen = std::ranges::find_if(
            clouds, [&](const GeneratedCloud& cloud) { return generation.number == cloud.number; });
        if (chosen == clouds.end()) ImGui::BeginDisabled();
        const bool keeps =
            button(editor, "Make it a base model", "A model whose seeds are the boxes of the chosen cloud");
        if (chosen == clouds.end()) ImGui::EndDisabled();
        if (keeps && chosen != clouds.end()) {
            const GeneratedCloud cloud = *chosen;  // the edit makes the clouds anew
            keep_as_model(editor, *model, cloud);
        }
    }
    ImGui::End();
}

}  // namespace nephos
