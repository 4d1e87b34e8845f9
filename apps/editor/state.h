// SPDX-License-Identifier: Apache-2.0
#pragma once

// The state of the editor, and the panels that show and change it: plain data and one function a panel.

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <future>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "apps/editor/editor.h"
#include "apps/editor/live.h"
#include "apps/editor/scene_document.h"
#include "apps/editor/settings.h"
#include "apps/editor/window.h"
#include "scenes/format/schema.h"
#include "seeds/model.h"

namespace nephos {

// Where each control is that was drawn in this frame, by its name, for scripts and tests.
struct Controls {
    struct Place {
        ImVec2 min, max;
        bool clipped = false;  // scrolled out of sight
    };
    std::map<std::string, Place> now, last;  // of this frame, of the one before
    std::string wanted;                      // is scrolled into sight
    // Notes the control that was drawn last.
    void note(const std::string& name);
};

// A camera that the user flies; world z is up.
struct ViewCamera {
    Camera camera;
    bool moved = false;      // not that of the scene any more
    double fly_m_per_s = 0;  // 0: by the size of the scene
};

// `nephos run` beside the window.
struct BackgroundRun {
    std::thread thread;
    std::atomic<bool> stop = false, done = false;
    std::mutex mutex;
    double fraction = 0;
    std::string phase, result, failure;
    std::filesystem::path folder;
    ~BackgroundRun() {
        stop = true;
        if (thread.joinable()) thread.join();
    }
};

// The writing of a grid beside the window.
struct BackgroundExport {
    std::thread thread;
    std::atomic<bool> done = false;
    std::filesystem::path path;
    std::uint64_t step = 0;
    std::chrono::steady_clock::time_point begin = std::chrono::steady_clock::now();
    std::string failure;  // when done
    ~BackgroundExport() {
        if (thread.joinable()) thread.join();
    }
};

// A cloud that a base model makes.
struct GeneratedCloud {
    std::uint32_t number = 0;
    Cloud cloud;
    std::vector<Billboard> billboards;
    std::vector<double> absorbed;  // of its boxes, of the light of sketches
};

// What is shown of the clouds that the selected base model makes.
struct Generation {
    std::optional<std::uint32_t> number;  // the one over the picture
    bool shows_grid = false;
    std::uint32_t first = 0;  // of the sketches
    // Clouds that were made last: of a version of the text and a model, from a number on.
    struct Made {
        std::uint64_t version = 0;
        std::size_t model = 0;
        std::uint32_t from = 0;
        std::vector<GeneratedCloud> clouds;
    };
    Made one, grid;
};

// Holds what a file dialog shows of the file that is named.
struct FilePreview {
    std::filesystem::path path;
    std::filesystem::file_time_type time;
    int width = 0, height = 0;          // of the thumbnail
    std::vector<std::uint32_t> pixels;  // of the thumbnail, as ImGui has colours; empty: no picture
    std::string text, problem;          // what it holds, or why it cannot be used
};

enum class SliceOf { nothing, bits, p_hum, p_act, p_ext };
inline constexpr const char* kSliceNames[] = {"no slice", "bits", "probability of hum", "probability of act",
                                              "probability of ext"};

// A question before something is overwritten or broken off.
struct Question {
    std::string text, yes;  // label of the button that lets `act` be done
    std::function<void()> act;
};

enum class FileDialog { none, open, save_as, export_grid, screenshot, choose };
// What waits for an answer about unsaved edits.
enum class Pending { none, close, close_scene, open, new_scene, empty_scene };

// A scene that is open: its document, and its simulation, which runs whether it is the one that is shown or not.
struct OpenScene {
    std::unique_ptr<SceneDocument> document;
    std::unique_ptr<LiveScene> live;

    // Of the scene as the live part has it.
    std::optional<Scene> shown_scene;
    std::uint64_t shown_version = 0;
    std::optional<std::uint64_t> start_step;  // that is shown first; none: that of the first frame
    bool running = true;
    double speed = 60;  // simulated seconds a second
    LiveView view;
    ViewCamera camera;
    std::shared_ptr<const LivePicture> picture;
    std::vector<LiveStep> steps;
    std::uint64_t steps_version = 0;
    std::vector<std::uint64_t> checkpoints;  // steps that the user wants to come back to, rising
    bool record = false;  // edits of wind, climate and lights become key frames at the present step

    // State of the panels.
    TextPath selected;                     // in the outline: a section or an element
    TextPath revealed;                     // what the outline has opened for
    std::map<std::string, Node> defaults;  // values of keys that the text does not have
    std::uint64_t defaults_version = 0;
    std::string text_buffer;
    std::uint64_t text_version = 0;
    Generation generation;

    SceneDocument::Disk disk = SceneDocument::Disk::same;  // as it was last said
    std::vector<LeftAutosave> left_autosaves;  // of earlier sessions, that the user is asked about
    bool is_answered = false;                  // at the end of the program: its edits are discarded
};

// Returns a text with an edit made in it.
using TextEdit = std::function<std::string(const std::string& text)>;

// The base part is the scene that is shown; the others stand in `scenes`, in which its own place is empty
// (simulations.cpp).
struct Editor : OpenScene {
    explicit Editor(const EditorOptions& options);
    ~Editor();

    EditorOptions options;
    std::filesystem::path folder;  // of settings and of what was never saved
    Settings settings;
    std::unique_ptr<Window> window;
    std::vector<OpenScene> scenes{1};
    std::size_t shown = 0;                   // index in `scenes`
    std::vector<std::future<void>> closing;  // simulations that end
    Controls controls;

    ImVec2 view_min{}, view_max{};                // of the picture in the window
    float final_state = 1, climate_minutes = 30;  // of a change of climate
    std::uint64_t pictures = 0;                   // that were shown

    // State of the panels.
    std::string filter;                   // of the properties
    int tab = 0, wanted_tab = -1;         // properties, text
    SliceOf slice_of = SliceOf::nothing;  // what a slice over the picture shows
    int slice = 0;                        // its height, in cells
    int slice_cells = 0;  // the height of the lattice that it goes through; 0: none was shown yet
    double slice_most = 0;                // the largest probability in it
    bool show_gizmos = true, show_plots = true;
    bool flash_on_click = false;  // the next click on the picture is lightning

    // Of dialogs.
    FileDialog dialog = FileDialog::none;
    std::filesystem::path dialog_folder, pending_path;
    std::string dialog_name, dialog_problem;
    std::filesystem::path replaced;  // an existing file that the dialog has asked about
    // Of FileDialog::choose: the ending of the files, and what is done with the chosen one.
    std::string chosen_extension;
    std::function<void(const std::filesystem::path&)> take_chosen;
    FilePreview preview;
    std::future<FilePreview> coming_preview;
    std::optional<Question> question;
    Pending pending = Pending::none;
    bool is_put_off = false;    // until what was asked before is answered
    bool opens_beside = false;  // what is opened is one more scene
    bool show_shortcuts = false, show_about = false, show_run = false;
    std::vector<std::filesystem::path> folder_scenes;
    std::string message;  // in the status bar
    bool message_is_bad = false, message_goes_on = false;  // behind what was refused
    std::chrono::steady_clock::time_point held_refusal;    // of the message for which the editor did not end
    // Holds what is typed into a field that has the caret: it is kept with the edits, and taken where the field is drawn no more.
    struct TypedValue {
        TextPath path;
        const Key* key = nullptr;
        std::string value;  // as TOML
        bool is_drawn = true;
    };
    std::optional<TypedValue> typed;
    // A number that is recorded when its field is left: of a wind, for a key frame takes its place and the field goes with it, and
    // what is typed of a sun.
    struct RecordedValue {
        TextPath path;
        std::string value;
        NumberForm form = NumberForm::any;
        std::optional<std::string> before;  // of one that key frames stand for
    };
    std::optional<RecordedValue> recorded_value;
    // The key frame that recording has chosen in the place of another one, whose fields it goes on with: the caret stays.
    struct FollowedRows {
        TextPath now, before;
    };
    std::optional<FollowedRows> followed_rows;
    // Keeps what fields show of keys that key frames stand for, by their paths. It stands still while a number has the caret,
    // whose field would give what it began with back as a change.
    std::map<std::string, std::string> values_now;
    // Names what had the mouse or the caret in the frame before: its edits are one step of undo.
    ImGuiID merged_item = 0;
    std::chrono::steady_clock::time_point message_time, last_disk_look, last_autosave;
    std::string rates;  // in the status bar, from time to time: one that changes in every frame cannot be read
    std::chrono::steady_clock::time_point rates_time;
    std::unique_ptr<BackgroundRun> run;
    std::unique_ptr<BackgroundExport> exported;
    bool quit = false, theme_changed = false;
    std::filesystem::path capture_to;  // a picture of the window that is due
    bool capture_by_user = false;      // who goes on without it; otherwise the program was started for it
};

// Writes pixels of 4 bytes, row 0 at the top, as PNG without the fourth. Throws Error(io).
void save_rgba(const std::filesystem::path& path, int width, int height, std::span<const std::uint8_t> rgba);

// Says something in the status bar.
void say(Editor& editor, std::string message, bool is_bad = false);
// Returns whether something was refused in this moment, which the user has not had time to see; once for each refusal.
bool is_refusal_unseen(Editor& editor);

// edits.cpp: does something that may throw; what went wrong is said in the status bar. Returns whether it was done.
bool attempt(Editor& editor, const std::function<void()>& act);

// Changes of the document reach the live scene; `what` names the step for undo. A change
// that fails, and one of a text with a syntax error, in which nothing has its place, is said and changes nothing.
bool change_text(Editor& editor, const TextEdit& edit, const std::string& what,
                 const std::string& merge = {});
void set_value(Editor& editor, const TextPath& path, const std::string& value, bool dragging = false,
               NumberForm form = NumberForm::any);
// Gives a key the value of its field; a name is changed where it is used, too.
void take_value(Editor& editor, const TextPath& path, const Key& key, const std::string& value,
                bool dragging = false);
// Takes what was typed into a field that is not drawn any more, as in a window that became too small for its panel.
void take_typed_value(Editor& editor);
// Returns the text of the scene that is shown with what is being typed, or is to be recorded, in it.
std::string text_with_typed(const Editor& editor);
// Applies what was typed or dragged while it is recorded, once its field is left.
void finish_recorded_value(Editor& editor);
// Several keys of a table as one step of the history.
void set_values(Editor& editor, const TextPath& table, const std::vector<TextEntry>& entries,
                bool dragging = false, NumberForm form = NumberForm::any);
void open_document(Editor& editor, std::unique_ptr<SceneDocument> document);
// Ends what waited for an answer about unsaved edits.
void do_pending(Editor& editor);
void ask_before(Editor& editor, Pending what, std::filesystem::path path = {});
// Ends it without doing it: the user goes on.
void forget_pending(Editor& editor);
// Returns whether a question or a file dialog waits for an answer: keys have no other meaning then.
bool is_asking(const Editor& editor);
// Throws Error(usage) where a file that is written would replace one of the open scenes, or a file that it names; while its text has
// problems, one whose name stands in it, and where nobody was asked, anything.
void refuse_own_files(Editor& editor, const std::filesystem::path& file, bool was_asked);
// Asks first when another program has written the file. Returns whether it was saved.
bool save_document(Editor& editor);
// Writes window, panels, theme and recent files down; what goes wrong is said.
void keep_settings(Editor& editor);

// layout.cpp: panels around the picture; those that find no room are left out. `scale` is that of text.
void layout(Editor& editor, float scale);

// Panels; each fills the ImGui window that its caller opened.
void menu_bar(Editor& editor);
void outline_panel(Editor& editor);
void properties_panel(Editor& editor);
void view_panel(Editor& editor);
void timeline_panel(Editor& editor);
void status_bar(Editor& editor);
void view_options_panel(Editor& editor);
void text_panel(Editor& editor);
void dialogs(Editor& editor);

// dialogs.cpp
void open_dialog(Editor& editor, FileDialog dialog);
// questions.cpp: each shows while it waits for an answer.
void unsaved_dialog(Editor& editor);
void question_dialog(Editor& editor);
void recovery_dialog(Editor& editor);
// run_window.cpp
void run_window(Editor& editor);

// properties.cpp: how many base models of the scene come from other files; they stand before those of the text. 0 while the text
// has problems.
std::size_t models_from_files(const Editor& editor);

// Controls with names; each returns as its ImGui namesake.
bool button(Editor& editor, const std::string& name, const char* hint = nullptr);
bool toggle(Editor& editor, const std::string& name, bool& on, const char* hint = nullptr);
void tooltip_of_last(const char* text);
void tooltip(const char* text);

// view.cpp
void frame_scene(Editor& editor);        // a camera that shows all of the clouds
void take_scene_camera(Editor& editor);  // that of the scene
// Writes the camera of the window into the scene: of a camera that goes along a path, as its key frame at the time that is shown.
void keep_camera(Editor& editor);
std::optional<ImVec2> on_screen(const Editor& editor, const Vec3& world_m);
Camera camera_of_view(const Editor& editor);  // with the size of the picture in the window

// pick.cpp: the point of the first cloud under the mouse; beside clouds none, or a point as far as what is looked at.
std::optional<Vec3> cloud_under(const Editor& editor, const ImVec2& mouse);
Vec3 point_under(const Editor& editor, const ImVec2& mouse);
// Looks at the cloud under the mouse from half as far. Returns false when there is none.
bool go_to_cloud(Editor& editor, const ImVec2& mouse);

// timeline.cpp: a step that is gone to, and stood at. Steps on and back count from the one that is gone to: keys in turn are
// as many steps, however long one takes.
std::uint64_t step_to_go_from(const Editor& editor);
void go_to_step(Editor& editor, std::uint64_t step);
void step_on(Editor& editor);
void step_back(Editor& editor);

// key_frames.cpp: marks below the time line's slider, `from` on in the window; checkpoints that the user set.
void key_frame_strip(Editor& editor, float from, float width, std::uint64_t last_step);
void keep_checkpoint(Editor& editor);     // at the step that is shown
void back_to_checkpoint(Editor& editor);  // the last before the step that steps count from

// simulations.cpp: scenes that are open, each with its simulation.
void simulations_list(Editor& editor);
void layers_list(Editor& editor);  // the layers that run in the shown one
inline constexpr std::size_t kMostScenes = 8;
// Opens one more scene and shows it; with kMostScenes open it says so and returns false.
bool add_scene(Editor& editor, std::unique_ptr<SceneDocument> document);
void show_scene(Editor& editor, std::size_t index);
void copy_scene(Editor& editor);
void close_scene(Editor& editor);  // the shown one, if there is another; without a question
// Calls `act` with each open scene.
void for_each_scene(Editor& editor, const std::function<void(OpenScene&)>& act);

// sun.cpp: a dial of the sky in which the sun is dragged.
void sun_dial(Editor& editor, const char* name);

// files.cpp: writes the density that is shown, beside the window; what it says of it over the picture.
void start_export(Editor& editor, const std::filesystem::path& path);
void watch_export(Editor& editor);
// Waits for the writing's end. Throws Error(io) when it failed.
void finish_export(Editor& editor);
// A button that opens a dialog of files with an ending, and gives their path, relative to the scene where that is
// shorter, to `take`.
void file_button(Editor& editor, const std::string& name, const std::string& extension,
                 std::function<void(const std::string&)> take);
// Asks whether a VDB file is to be the state that the simulation starts from.
void offer_grid(Editor& editor, const std::filesystem::path& path);
// The preview of a file, read when it is another than before.
void file_preview(Editor& editor, const std::filesystem::path& path);

// generate.cpp: buttons of a base model that is selected; sketches of its clouds; and the one that is shown over the
// picture, null when none is.
void generation_row(Editor& editor);
void generation_window(Editor& editor);
const GeneratedCloud* generated_cloud(Editor& editor);

// hodograph.cpp: of the wind that is selected.
void hodograph(Editor& editor);

// gizmos.cpp: shapes of the scene over the picture. Returns true while the mouse moves one.
bool gizmos(Editor& editor);
// slice.cpp: cells with hum, act or cld at one height of a lattice, or probabilities of its field, over the picture.
void slice_over_picture(Editor& editor);

// live_changes.cpp: writes a change of a key that was made while the scene runs as key frames at the present step;
// `edited`: the text as it would be without recording. Returns false for keys that cannot be recorded.
bool record_live(Editor& editor, const TextPath& path, const std::string& edited);
// Returns whether a change of a key is to be recorded: while the user records, and always of a sun with key frames, which
// stand in the place of the key.
bool is_recorded(const Editor& editor, const TextPath& path);
// Returns the path of the key that a recorded change is made in. In a search, where earlier key frames of a wind stay in sight, it is
// that of the newest one, which holds at the present step: nothing where that has no such level. Otherwise it is the path itself.
std::optional<TextPath> recorded_place(const Editor& editor, const TextPath& path);
// Returns whether a key would be recorded were it not for problems of the text: it is then not changed at all.
bool is_kept_from_recording(const Editor& editor, const TextPath& path);
// Returns the text that record_live() would make now; `edited` for keys that cannot be recorded.
std::string with_recorded(const Editor& editor, const TextPath& path, const std::string& edited);
// Returns whether a number that its field changes now is recorded once that is left.
bool is_recorded_when_left(const Editor& editor, const TextPath& path);
// Returns the value of a key that key frames stand for, at the step that is shown; nothing for other keys.
std::optional<std::string> value_now(const Editor& editor, const TextPath& path);
// Moves the sun: from the present step on when that is_recorded(), otherwise for good.
void move_sun(Editor& editor, double elevation_deg, double azimuth_deg, bool dragging);
Sun sun_now(const Editor& editor);  // at the step that is shown
// From the present step on the climate goes to a state, 0..1, within a time.
void record_climate(Editor& editor, double final_state, double duration_s);
void add_flash(Editor& editor, const Vec3& at_m);  // lightning at the step that is shown

// theme.cpp
void apply_theme(Editor& editor);

// first_scene.cpp: scenes that begin with something to see, and with nothing.
std::string first_scene_text();
std::string empty_scene_text();

}  // namespace nephos
