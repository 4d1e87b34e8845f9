// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/editor.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <thread>

#include <fmt/format.h>

#include "apps/editor/capture.h"
#include "apps/editor/field_text.h"
#include "apps/editor/report.h"
#include "apps/editor/script.h"
#include "apps/editor/state.h"
#include "apps/nephos/arguments.h"
#include "apps/nephos/commands.h"
#include "core/descriptor.h"
#include "core/error.h"
#include "render/image/image_file.h"

namespace nephos {
namespace {

using Clock = Report::Clock;

constexpr double kFrameSeconds = 1.0 / 60, kIdleSeconds = 0.1;
constexpr std::chrono::milliseconds kRowsAlone{200};

// Before a scene is drawn: where the camera of the one before stands there may be ground.
void send_scene_camera(Editor& editor) {
    take_scene_camera(editor);
    editor.view.camera = editor.camera.camera;
    editor.live->set_view(editor.view);
}

// Sends what the document became to the live scene.
void follow_document(Editor& editor) {
    if (editor.shown_version == editor.document->version()) return;
    editor.shown_version = editor.document->version();
    const Scene* const scene = editor.document->current_scene();
    if (scene == nullptr) return;
    if (!editor.shown_scene) {
        const double start = scene->frames.enabled ? scene->frames.start_s : 0;
        const Moment moment = moment_of(std::max(0.0, start), scene->automaton.time_step_s);
        editor.shown_scene = *scene;
        send_scene_camera(editor);
        editor.live->start(*scene,
                           editor.start_step.value_or(std::min<std::uint64_t>(moment.step, scene->steps)));
        return;
    }
    const SceneChange change = change_between(*editor.shown_scene, *scene);
    const bool camera_changed = !(editor.shown_scene->render.camera == scene->render.camera);
    editor.shown_scene = *scene;
    if (camera_changed) send_scene_camera(editor);
    if (change == SceneChange::simulation) {
        const LiveStatus status = editor.live->status();
        editor.live->start(*scene, std::max(status.goal, status.step));
    } else if (change == SceneChange::picture) {
        editor.live->redraw(*scene);
    }
}

// Gives a camera whose heights are above the ground those of the world, which its first picture knows: flying, pointing and
// what lies over the picture want them.
void stand_on_ground(Editor& editor) {
    Camera& camera = editor.camera.camera;
    if (!camera.above_ground || !(editor.picture->view.camera == camera)) return;
    camera.position_m = editor.picture->position_m;
    camera.target_m = editor.picture->target_m;
    camera.above_ground = false;
}

// The rows of steps are taken with a picture, so that plots and picture change in one frame, or after a while without.
void take_new_results(Editor& editor, Clock::time_point& taken) {
    const std::uint64_t known = editor.picture ? editor.picture->number : 0;
    if (std::shared_ptr<const LivePicture> next = editor.live->picture(known)) {
        editor.window->set_picture(next->width, next->height, next->rgba.data());
        editor.picture = std::move(next);
        ++editor.pictures;
        stand_on_ground(editor);
    } else if (editor.running && Clock::now() - taken < kRowsAlone) {
        return;
    }
    taken = Clock::now();
    const LiveStatus status = editor.live->status();
    if (status.rows_version != editor.steps_version || status.rows < editor.steps.size())
        editor.steps.clear();
    editor.steps_version = status.rows_version;
    if (status.rows != editor.steps.size()) {
        const std::vector<LiveStep> more = editor.live->steps(editor.steps.size());
        editor.steps.insert(editor.steps.end(), more.begin(), more.end());
    }
}

// Writes the unsaved edits of all scenes down, of each whatever becomes of the others. Returns what could not be kept;
// empty: all was.
std::string autosave_all(Editor& editor) {
    std::string failures;
    for_each_scene(editor, [&](OpenScene& scene) {
        try {
            scene.document->autosave(editor.folder,
                                     &scene == &editor ? text_with_typed(editor) : scene.document->text());
        } catch (const std::exception& error) {
            failures += (failures.empty() ? "" : "; ") + scene.document->title() + ": " + error.what();
        }
    });
    return failures;
}

// Opens files that were dropped on the window, up to one that cannot be opened, or about which something is asked: what is
// answered is of the scene that is open.
void open_dropped(Editor& editor, const std::vector<std::filesystem::path>& paths) {
    for (const std::filesystem::path& path : paths) {
        const std::string name = path.filename().string();
        if (is_refusal_unseen(editor)) return say(editor, editor.message + "; not opened: " + name, true);
        if (is_asking(editor))
            return say(editor,
                       "Not opened: " + name +
                           ". A question or a dialog waits for an answer: drop it once more behind that",
                       true);
        ask_before(editor, Pending::open, path);
    }
}

void look_after_files(Editor& editor) {
    const Clock::time_point now = Clock::now();
    if (now - editor.last_disk_look > std::chrono::milliseconds(700)) {
        editor.last_disk_look = now;
        attempt(editor, [&] {
            const SceneDocument::Disk disk = editor.document->look_at_disk();
            if (disk == SceneDocument::Disk::reloaded) {
                follow_document(editor);  // what is recorded below is a change of this one
                leave_number_field();
                say(editor, "Another program changed the file: it was read again");
            }
            // Once: later messages are to be seen, too.
            if (std::exchange(editor.disk, disk) == disk) return;
            if (disk == SceneDocument::Disk::differs)
                say(editor,
                    "Another program changed the file; saving overwrites that, File > Reload takes it", true);
            if (disk == SceneDocument::Disk::gone)
                say(editor, "The file is gone from the disk; saving makes it anew", true);
        });
    }
    if (now - editor.last_autosave > std::chrono::seconds(5)) {
        editor.last_autosave = now;
        const std::string failures = autosave_all(editor);
        if (!failures.empty()) say(editor, "Not autosaved: " + failures, true);
    }
}

void shortcuts(Editor& editor) {
    if (is_asking(editor)) return;
    const ImGuiIO& io = ImGui::GetIO();
    const auto pressed = [](int key) { return ImGui::IsKeyPressed(key, false); };
    if (io.KeyCtrl) {
        if (pressed('S')) {
            if (io.KeyShift || !editor.document->has_file()) {
                open_dialog(editor, FileDialog::save_as);
            } else {
                save_document(editor);
            }
        }
        if (pressed('O')) open_dialog(editor, FileDialog::open);
        if (pressed('N')) ask_before(editor, Pending::new_scene);
        if (pressed('Q')) ask_before(editor, Pending::close);
        if (pressed('R')) editor.show_run = true;
        if (io.WantTextInput) return;
        if (pressed('Z')) {
            editor.document->undo();
            say(editor, "Undone");
        }
        if (pressed('Y')) {
            editor.document->redo();
            say(editor, "Done again");
        }
        return;
    }
    if (pressed(key_code("F1"))) editor.show_shortcuts = !editor.show_shortcuts;
    if (pressed(key_code("F12"))) open_dialog(editor, FileDialog::screenshot);
    if (io.WantTextInput) return;
    if (pressed(key_code("SPACE"))) editor.live->run(editor.running = !editor.running);
    if (pressed(key_code("HOME"))) go_to_step(editor, 0);
    if (pressed(key_code(","))) step_back(editor);
    if (pressed(key_code("."))) step_on(editor);
    if (pressed('F')) frame_scene(editor);
    if (pressed('C')) take_scene_camera(editor);
    if (pressed('G')) editor.show_gizmos = !editor.show_gizmos;
    if (pressed('M')) keep_checkpoint(editor);
    if (pressed('B')) back_to_checkpoint(editor);
    if (pressed('L')) editor.flash_on_click = !editor.flash_on_click;
    if (pressed('V') && ImGui::IsMousePosValid()) go_to_cloud(editor, io.MousePos);
    for (int mode = 0; mode < int(std::size(kViewModes)); ++mode) {
        if (pressed('1' + mode)) editor.view.mode = mode;
    }
}

void draw_interface(Editor& editor) {
    const float scale = ImGui::GetFontSize() / 15;
    editor.controls.last = std::move(editor.controls.now);
    editor.controls.now.clear();
    if (editor.typed) editor.typed->is_drawn = false;
    shortcuts(editor);
    menu_bar(editor);
    layout(editor, scale);
    dialogs(editor);
    take_typed_value(editor);
    finish_recorded_value(editor);
    // Keeps what is dragged, or typed into one field, one step of undo.
    const ImGuiID item = active_item();
    const bool goes_on = ImGui::IsAnyMouseDown() || (item != 0 && item == editor.merged_item);
    if (!goes_on) editor.document->end_merging();
    editor.merged_item = item;
}

void update_title(Editor& editor, std::string& shown) {
    const std::string title =
        (editor.document->is_modified() ? "\u2022 " : "") + editor.document->title() + " - nephos";
    if (title != shown) editor.window->set_title(shown = title);
}

// Returns the exit status.
int loop(Editor& editor, Script& script, Report& report, bool& screenshot_due) {
    const bool scripted = !editor.options.script.empty();
    std::string title;
    Clock::time_point last_frame = Clock::now(), last_input = Clock::now(), last_results;
    Capture capture;
    std::vector<std::filesystem::path> dropped;
    while (!editor.quit) {
        if (const int signal = pending_signal(); signal != 0) {
            const std::string failures = autosave_all(editor);
            if (!failures.empty()) fmt::print(stderr, "unsaved edits could not be kept: {}\n", failures);
            return 128 + signal;
        }
        if (!editor.window->is_minimised()) {
            editor.settings.width = editor.window->width();
            editor.settings.height = editor.window->height();
        }
        bool any_runs = false;
        for_each_scene(editor, [&](const OpenScene& scene) { any_runs |= scene.running; });
        const bool busy = any_runs || script.is_active() || seconds_since(last_input) < 1 ||
                          editor.live->status().goal != editor.live->status().step ||
                          editor.window->is_minimised();
        const double pause = (busy ? kFrameSeconds : kIdleSeconds) - seconds_since(last_frame);
        if (script.is_active() && pause > 0)
            std::this_thread::sleep_for(std::chrono::duration<double>(pause / 2));
        if (std::exchange(editor.theme_changed, false)) apply_theme(editor);
        if (!editor.window->begin_frame(script.is_active() ? 0 : std::max(pause, 0.001))) {
            if (!press_enter_in_field()) {  // what is typed is taken first
                editor.window->ask_to_close(false);
                ask_before(editor, Pending::close);
            }
        }
        const double interval = seconds_since(last_frame);
        last_frame = Clock::now();
        if (scripted && script.is_active() && !awaits_capture(editor, script)) script.apply(editor);
        for (std::filesystem::path& path : editor.window->take_dropped()) dropped.push_back(std::move(path));
        if (!dropped.empty() && !press_enter_in_field()) {  // likewise
            const std::vector<std::filesystem::path> paths = std::exchange(dropped, {});
            if (!is_refusal_unseen(editor))
                open_dropped(editor, paths);  // else they can be dropped once more
        }
        finish_field_first();
        ImGui::NewFrame();
        move_caret_on();
        const ImGuiIO& io = ImGui::GetIO();
        if (io.MouseDelta.x != 0 || io.MouseDelta.y != 0 || io.MouseWheel != 0 || ImGui::IsAnyItemActive()) {
            last_input = Clock::now();
        }
        follow_document(editor);
        take_new_results(editor, last_results);
        report.watch(editor);
        look_after_files(editor);
        watch_export(editor);
        draw_interface(editor);
        update_title(editor, title);
        if (script.is_random()) editor.quit = false;
        // Without a picture that could come, of what is wrong.
        const bool whole =
            editor.picture ? editor.running || editor.picture->refined || !editor.view.detail
                           : !editor.document->problems().empty() || !editor.live->status().failure.empty();
        if (screenshot_due && seconds_since(report.begin) > editor.options.after_s && whole &&
            !script.is_active() && editor.capture_to.empty()) {
            editor.capture_to = editor.options.screenshot;
            editor.capture_by_user = false;
            screenshot_due = false;
        }
        Capture::begin(editor);
        editor.window->end_frame();
        capture.end(editor, script);
        if (report.frames++ == 0) report.first_frame_s = seconds_since(report.begin);
        const double spent = seconds_since(last_frame);
        if (report.frames > 3) report.longest_frame_s = std::max(report.longest_frame_s, spent);
        if (report.frames > 3 && busy) report.intervals.push_back(interval);
        const bool is_last = editor.options.screenshot.empty() ? scripted : !screenshot_due;
        if (is_last && !script.is_active() && editor.capture_to.empty()) editor.quit = true;
    }
    return 0;
}

std::unique_ptr<SceneDocument> first_document(Editor& editor) {
    namespace fs = std::filesystem;
    if (editor.options.scene.empty()) return std::make_unique<SceneDocument>(first_scene_text());
    // Nobody is there to be asked about what was left of a scene that is gone.
    const bool is_alone = !editor.options.screenshot.empty();
    if (!fs::is_directory(editor.options.scene)) {
        return is_alone ? std::make_unique<SceneDocument>(editor.options.scene)
                        : SceneDocument::opened(editor.options.scene, editor.folder);
    }
    std::vector<fs::path> scenes, gone;  // of those that are gone edits may be left
    for (const auto& entry : fs::directory_iterator(editor.options.scene)) {
        // Not what other programs keep beside: locks of Emacs, attributes of macOS.
        const bool is_hidden = entry.path().filename().string().starts_with('.');
        std::error_code error;
        if (entry.path().extension() == ".toml" && !is_hidden && entry.is_regular_file(error))
            scenes.push_back(entry.path());
        const std::string scene = scene_of_autosave(entry.path().filename());
        if (!is_alone && !scene.empty() && !left_autosaves(editor.options.scene, scene).empty())
            gone.push_back(editor.options.scene / scene);
    }
    if (scenes.empty()) scenes = std::move(gone);
    if (scenes.empty()) {
        throw Error(ErrorCode::usage, editor.options.scene.string() + ": no scene (*.toml) in this folder");
    }
    std::ranges::sort(scenes);
    editor.folder_scenes = std::move(scenes);
    return SceneDocument::opened(editor.folder_scenes.front(), editor.folder);
}

// Writes unsaved edits down before the program ends by an error; what to say about it.
std::string kept_edits(Editor& editor) {
    bool any = false;
    for_each_scene(editor, [&](const OpenScene& scene) {
        scene.document->look_whether_gone();
        any |= scene.document->is_modified();
    });
    if (!any && !editor.typed && !editor.recorded_value) return {};
    const std::string failures = autosave_all(editor);
    if (!failures.empty()) return "; unsaved edits could not be kept: " + failures;
    return "; unsaved edits are kept, and are offered at the next start with this scene";
}

}  // namespace

void refuse_own_files(Editor& editor, const std::filesystem::path& file, bool was_asked) {
    refuse_to_replace_listed_file(file);
    for_each_scene(editor, [&](const OpenScene& open) {
        const SceneDocument& document = *open.document;
        if (document.has_file()) refuse_to_replace(document.path(), file);
        if (const Scene* const scene = document.current_scene())
            refuse_to_replace_files_of(*scene, file);
        else if (is_there(file) &&
                 (!was_asked || document.text().find(file.filename().string()) != std::string::npos))
            throw Error(ErrorCode::usage,
                        file.string() +
                            ": is there already, and may be a file of the scene, whose text has "
                            "problems: expected the name of another one to write");
    });
}

Editor::Editor(const EditorOptions& from)
    : options(from), folder(settings_folder()), settings(read_settings(folder)) {
    live = std::make_unique<LiveScene>(DeviceOptions{.splatting = Splatting::cpu});
    if (!options.theme.empty()) settings.dark = options.theme != "light";
    show_plots = settings.plots;
    show_gizmos = settings.shapes;
    wanted_tab = settings.tab;
    document = first_document(*this);
    WindowOptions of_window;
    of_window.width = options.width > 0 ? options.width : settings.width;
    of_window.height = options.height > 0 ? options.height : settings.height;
    of_window.device = options.device;
    of_window.validation = options.validation;
    of_window.lost = [this] {
        const std::string said = "error: the display is gone" + kept_edits(*this) + "\n";
        std::fputs(said.c_str(), stderr);
    };
    // Simulates the first picture while the window opens.
    follow_document(*this);
    live->run(running);
    window = std::make_unique<Window>(of_window);
    apply_theme(*this);
    last_autosave = Clock::now();
}

Editor::~Editor() = default;

void say(Editor& editor, std::string message, bool is_bad) {
    // Ctrl+S leaves a field first, whose text may be refused: what is saved is told behind that.
    const bool just_refused =
        editor.message_is_bad && Clock::now() - editor.message_time < std::chrono::seconds(1);
    const bool goes_on = just_refused && !is_bad && !editor.message_goes_on;
    editor.message = goes_on ? editor.message + " - " + message : std::move(message);
    editor.message_is_bad = is_bad || goes_on;
    editor.message_goes_on = goes_on;
    editor.message_time = Clock::now();
}

bool is_refusal_unseen(Editor& editor) {
    const bool is_new = editor.message_is_bad && Clock::now() - editor.message_time < std::chrono::seconds(1);
    return is_new && std::exchange(editor.held_refusal, editor.message_time) != editor.message_time;
}

void Controls::note(const std::string& name) {
    const ImVec2 min = ImGui::GetItemRectMin(), max = ImGui::GetItemRectMax();
    const ImVec2 middle(0.5f * (min.x + max.x), 0.5f * (min.y + max.y));
    const ImDrawList& list = *ImGui::GetWindowDrawList();
    const ImVec2 low = list.GetClipRectMin(), high = list.GetClipRectMax();
    const bool visible = middle.x >= low.x && middle.y >= low.y && middle.x < high.x && middle.y < high.y;
    if (name == wanted && !visible) ImGui::SetScrollHereY(0.5f);
    now[name] = {min, max, !visible};
}

void tooltip_of_last(const char* text) {
    if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled)) tooltip(text);
}

void tooltip(const char* text) {
    if (text == nullptr || *text == '\0') return;
    ImGui::BeginTooltip();
    ImGui::PushTextWrapPos(28 * ImGui::GetFontSize());
    ImGui::TextUnformatted(text);
    ImGui::PopTextWrapPos();
    ImGui::EndTooltip();
}

bool button(Editor& editor, const std::string& name, const char* hint) {
    const bool pressed = ImGui::Button(name.c_str());
    editor.controls.note(name);
    tooltip_of_last(hint);
    return pressed;
}

bool toggle(Editor& editor, const std::string& name, bool& on, const char* hint) {
    const bool changed = ImGui::Checkbox(name.c_str(), &on);
    editor.controls.note(name);
    tooltip_of_last(hint);
    return changed;
}

void save_rgba(const std::filesystem::path& path, int width, int height, std::span<const std::uint8_t> rgba) {
    Rgb8Image out;
    out.width = width;
    out.height = height;
    out.rgb.reserve(rgba.size() / 4 * 3);
    for (std::size_t at = 0; at + 3 < rgba.size(); at += 4)
        out.rgb.insert(out.rgb.end(), {rgba[at], rgba[at + 1], rgba[at + 2]});
    write_png(path, out, RenderOptions{}, PictureMetadata{});
}

int run_editor(const EditorOptions& options) {
    Report report;
    Script script = options.script.empty() ? Script() : Script(options.script);
    defer_signals();
    Editor editor(options);
    if (editor.document->has_file()) note_recent(editor.settings, editor.document->path());
    if (options.screenshot.empty()) editor.left_autosaves = editor.document->left_autosaves(editor.folder);
    int status = 0;
    bool screenshot_due = !options.screenshot.empty();
    try {
        status = loop(editor, script, report, screenshot_due);
    } catch (const Error& error) {
        const std::string kept = kept_edits(editor);
        if (kept.empty()) throw;
        throw Error(error.code(), error.what() + kept, error.where());
    } catch (const std::exception& error) {
        throw Error(ErrorCode::io, error.what() + kept_edits(editor));
    }
    std::string failure;
    try {
        finish_export(editor);
    } catch (const std::exception& error) {
        failure = error.what();
    }
    if (options.report) report.print(editor);
    if (status != 0) {  // by a signal: edits were kept
        if (!failure.empty()) fmt::print(stderr, "error: {}\n", failure);
        return status;
    }
    for_each_scene(editor, [](OpenScene& scene) { scene.document->remove_autosave(); });
    keep_settings(editor);
    if (!failure.empty()) throw Error(ErrorCode::io, failure);
    script.require_read();
    const bool is_screenshot_under_way =
        !options.screenshot.empty() && editor.capture_to == options.screenshot;
    if (!options.screenshot.empty() && (screenshot_due || is_screenshot_under_way || !editor.picture)) {
        if (!editor.document->problems().empty()) throw SceneErrors(editor.document->problems());
        const std::string failed = editor.live->status().failure;
        throw Error(ErrorCode::io, failed.empty() ? options.screenshot.string() +
                                                        ": no picture was made: the editor had ended before"
                                                  : failed);
    }
    if (!editor.capture_to.empty() && !editor.capture_by_user)
        throw Error(ErrorCode::check,
                    editor.capture_to.string() + ": was not saved: the editor had ended before");
    const std::vector<std::string> messages = editor.window->validation_messages();
    for (const std::string& message : messages) fmt::print(stderr, "validation: {}\n", message);
    return messages.empty() ? status : int(ErrorCode::gpu);
}

}  // namespace nephos
