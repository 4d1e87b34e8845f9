// SPDX-License-Identifier: Apache-2.0
// Files beside the scene's: export of the present grid, the choice of files that keys name, and what is in them. All that
// reads or writes much does so beside the window.

#include <algorithm>
#include <cmath>

#include <imgui.h>

#include "apps/editor/schema_values.h"
#include "apps/editor/state.h"
#include "core/error.h"
#include "core/paths.h"
#include "density/vdb/vdb_file.h"
#include "render/image/alpha_image.h"
#include "scenes/format/text.h"
#include "scenes/format/writer.h"
#include "simulation/frame_writer.h"

namespace nephos {
namespace {

namespace fs = std::filesystem;

constexpr int kThumbnail =
    56;  // at most so many points on a side: ImGui's back end knows no textures but its own

// The picture over a blue sky, each point the mean of what it covers.
void add_thumbnail(const AlphaImage& image, FilePreview& to) {
    const int longest = std::max(image.width, image.height);
    to.width = std::max(1, image.width * kThumbnail / longest);
    to.height = std::max(1, image.height * kThumbnail / longest);
    if (longest < kThumbnail) to.width = image.width, to.height = image.height;
    for (int y = 0; y < to.height; ++y) {
        for (int x = 0; x < to.width; ++x) {
            const int x0 = x * image.width / to.width,
                      x1 = std::max(x0 + 1, (x + 1) * image.width / to.width);
            const int y0 = y * image.height / to.height,
                      y1 = std::max(y0 + 1, (y + 1) * image.height / to.height);
            double opacity = 0, bright = 0;
            for (int row = y0; row < y1; ++row) {
                for (int column = x0; column < x1; ++column) {
                    const std::size_t n = std::size_t(row) * std::size_t(image.width) + std::size_t(column);
                    opacity += double(image.opacity[n]);
                    bright += double(image.bright[n]);
                }
            }
            const double count = double(x1 - x0) * double(y1 - y0);
            const auto shown = [&](double sky) {
                const double light = bright / count + (1 - opacity / count) * sky;
                return int(std::lround(255 * std::pow(std::clamp(light, 0.0, 1.0), 1 / 2.2)));
            };
            to.pixels.push_back(IM_COL32(shown(0.06), shown(0.16), shown(0.38), 255));
        }
    }
}

FilePreview preview_of(const fs::path& path, fs::file_time_type time) {
    FilePreview out;
    out.path = path;
    out.time = time;
    try {
        if (path.extension() == ".png") {
            const AlphaImage image = read_alpha_image(path);
            out.text = std::to_string(image.width) + " x " + std::to_string(image.height) + " pixels";
            add_thumbnail(image, out);
        } else if (path.extension() == ".vdb") {
            for (const VdbGridInfo& grid : read_vdb_info(path).grids) {
                out.text +=
                    grid.name + ": " + grid.type + ", " + std::to_string(grid.active_voxels) + " voxels\n";
            }
            if (out.text.empty()) out.problem = "there is no grid in it";
        } else {
            const SceneDocument scene(path);
            out.text = std::to_string(scene.text().size()) + " bytes";
            if (!scene.problems().empty()) out.problem = scene.problems().front().message;
        }
    } catch (const std::exception& error) {
        out.problem = error.what();
    }
    return out;
}

void draw_thumbnail(const FilePreview& preview) {
    const ImVec2 corner = ImGui::GetCursorScreenPos();
    const float room = std::max(8.0f, ImGui::GetContentRegionAvail().x);
    const float size = std::floor(room / float(std::max(preview.width, preview.height)) * 4) / 4;
    ImDrawList& list = *ImGui::GetWindowDrawList();
    for (int y = 0; y < preview.height; ++y) {
        for (int x = 0; x < preview.width; ++x) {
            const ImVec2 from(corner.x + size * float(x), corner.y + size * float(y));
            list.AddRectFilled(from, ImVec2(from.x + size, from.y + size),
                               preview.pixels[std::size_t(y) * std::size_t(preview.width) + std::size_t(x)]);
        }
    }
    ImGui::Dummy(ImVec2(size * float(preview.width), size * float(preview.height)));
}

// As it stands in a scene of that folder: relative where the file is in it or below.
std::string name_in_scene(const Editor& editor, const fs::path& path) {
    std::error_code error;
    fs::path folder = editor.document->folder();
    if (folder.empty()) folder = fs::current_path(error);
    const fs::path relative = fs::proximate(fs::absolute(path), fs::absolute(folder), error);
    const bool below = !error && !relative.empty() && *relative.begin() != "..";
    const std::string name = below ? relative.generic_string() : normal_path(fs::absolute(path)).string();
    if (find_invalid_utf8(name) != name.size())
        throw Error(ErrorCode::usage, name + ": its name is not UTF-8, which the text of a scene is");
    return name;
}

}  // namespace

void start_export(Editor& editor, const fs::path& path) {
    if (editor.exported) throw Error(ErrorCode::usage, "another grid is being written: wait for its end");
    LiveScene::FrameOfScene shown = editor.live->frame_of_scene();
    const std::shared_ptr<const LiveFrame> frame = shown.frame;
    if (!frame) throw Error(ErrorCode::usage, "there is no grid yet");
    if (!has_density(shown.scene))
        throw Error(ErrorCode::usage, "the clouds of this scene are drawn directly: there is no grid");
    auto exported = std::make_unique<BackgroundExport>();
    BackgroundExport& state = *exported;
    state.path = path;
    state.step = frame->frame.step;
    state.thread = std::thread([&state, frame, scene = std::move(shown.scene)] {
        try {
            const FrameResult& result = frame->frame;
            VdbContent content;
            content.density = &result.density;
            content.cells = result.density.placement();
            content.half = scene.density.half;
            write_vdb(state.path, content,
                      frame_metadata(scene, frames_hash(scene), result.time_s, result.hash, std::nullopt,
                                     result.density));
        } catch (const std::exception& error) {
            state.failure = error.what();
        }
        state.done = true;
        Window::wake();
    });
    editor.exported = std::move(exported);
}

void watch_export(Editor& editor) {
    if (!editor.exported || !editor.exported->done) return;
    attempt(editor, [&] { finish_export(editor); });
}

void finish_export(Editor& editor) {
    if (!editor.exported) return;
    const std::unique_ptr<BackgroundExport> done = std::move(editor.exported);
    done->thread.join();
    if (!done->failure.empty()) throw Error(ErrorCode::io, "no grid was written: " + done->failure);
    say(editor, "Grid of step " + std::to_string(done->step) + ": " + done->path.string());
}

void file_button(Editor& editor, const std::string& name, const std::string& extension,
                 std::function<void(const std::string&)> take) {
    const bool pressed = ImGui::Button("...");
    editor.controls.note("file of " + name);
    tooltip_of_last(("Choose a file (" + extension + "); it is shown before").c_str());
    if (!pressed) return;
    open_dialog(editor, FileDialog::choose);
    editor.chosen_extension = extension;
    editor.take_chosen = [&editor, take = std::move(take)](const fs::path& path) {
        take(name_in_scene(editor, path));
    };
}

void offer_grid(Editor& editor, const fs::path& path) {
    const Node* const list = value_node(editor.document->values(), text_path("layer"));
    const bool layers = list != nullptr && !list->items.empty();
    const std::string key = layers ? "layer[0].lattice.initial_state" : "lattice.initial_state";
    editor.question = {
        path.filename().string() +
            " is a grid, no scene. Its grids hum, act and cld can be the state that this simulation starts "
            "from;\n`nephos render` draws a density.",
        "Start from it", [&editor, key, name = name_in_scene(editor, path)] {
            set_value(editor, text_path(key), toml_string(name));
        }};
}

void file_preview(Editor& editor, const fs::path& path) {
    std::error_code error;
    const fs::file_time_type time = fs::last_write_time(path, error);
    if (error) return ImGui::TextDisabled("no such file");
    const auto is_ready = [&] {
        return editor.coming_preview.valid() &&
               editor.coming_preview.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    };
    if (is_ready()) editor.preview = editor.coming_preview.get();
    FilePreview& shown = editor.preview;
    if (shown.path != path || shown.time != time) {
        if (!editor.coming_preview.valid()) {
            attempt(editor, [&] {
                editor.coming_preview =
                    std::async(std::launch::async, [path, time] { return preview_of(path, time); });
            });
        }
        return ImGui::TextDisabled("reading...");
    }
    if (!shown.pixels.empty()) draw_thumbnail(shown);
    ImGui::PushTextWrapPos(0);
    ImGui::TextUnformatted(shown.text.c_str());
    if (shown.problem.empty()) {
        editor.controls.note("preview of " + path.filename().string());
    } else {
        ImGui::PushStyleColor(ImGuiCol_Text, ImVec4(0.93f, 0.36f, 0.32f, 1));
        ImGui::TextUnformatted(shown.problem.c_str());
        ImGui::PopStyleColor();
        editor.controls.note("problem of " + path.filename().string());
    }
    ImGui::PopTextWrapPos();
}

}  // namespace nephos
