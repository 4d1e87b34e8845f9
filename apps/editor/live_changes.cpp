// SPDX-License-Identifier: Apache-2.0
// Changes that are made while a scene runs. A key frame holds from its time on; the one before it keeps what was true
// until then. What was simulated up to the present step therefore stays true of the changed scene, and the run goes on
// from its present state.

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/editor/key_frame_text.h"
#include "apps/editor/state.h"
#include "core/error.h"
#include "core/text.h"
#include "scenes/format/reader.h"
#include "scenes/format/text.h"
#include "seeds/climate.h"

namespace nephos {
namespace {

std::string levels_toml(const std::vector<WindLevel>& levels) {
    std::string out = "[";
    for (const WindLevel& level : levels) {
        if (out.size() > 1) out += ", ";
        out += "{ height_m = " + number_text(level.height_m) +
               ", east_m_per_s = " + number_text(level.velocity.east_m_per_s) +
               ", north_m_per_s = " + number_text(level.velocity.north_m_per_s) + " }";
    }
    return out + "]";
}

// A key frame needs a level, also where no wind is.
std::vector<WindLevel> levels_at(const Wind& wind, double time_s) {
    std::vector<WindLevel> levels = profile_at(wind, time_s);
    if (levels.empty()) levels.push_back({});
    return levels;
}

std::vector<KeyFrame> key_frames(const std::vector<WindKeyframe>& keys) {
    std::vector<KeyFrame> out;
    for (const WindKeyframe& key : keys) out.push_back({key.time_s, {{"levels", levels_toml(key.levels)}}});
    return out;
}

// Key frames of a wind that is `before` up to the step before `step` and `after` from it on. Between two key frames of
// `before` every step gets one of its own, so that its steps keep their bits.
std::vector<WindKeyframe> changed_keys(const Wind& before, const std::vector<WindLevel>& after,
                                       std::uint64_t step, double step_s) {
    // As the simulation has them: now - step_s may be another number.
    const double now = double(step) * step_s, last = (double(step) - 1) * step_s;
    std::vector<WindKeyframe> keys;
    for (const WindKeyframe& key : before.keyframes) {
        if (key.time_s <= last) keys.push_back(key);
    }
    const bool between = keys.size() < before.keyframes.size() && !keys.empty();
    if (between) {
        const double from = keys.back().time_s;
        for (std::uint64_t at = std::uint64_t(std::max(0.0, std::ceil(from / step_s))); at < step; ++at) {
            const double time = double(at) * step_s;
            if (time > from) keys.push_back({time, levels_at(before, time)});
        }
    } else if (step > 0 && (keys.empty() || keys.back().time_s < last)) {
        keys.push_back({last, levels_at(before, last)});
    }
    keys.push_back({now, after});
    return keys;
}

bool is_sun(const TextPath& path) {
    static constexpr std::array<std::string_view, 3> kKeys{"elevation_deg", "azimuth_deg", "colour"};
    return path.size() == 2 && path[0].name == "sun" && std::ranges::find(kKeys, path[1].name) != kKeys.end();
}

std::string colour_toml(const Rgb& colour) {
    return "[" + number_text(colour[0]) + ", " + number_text(colour[1]) + ", " + number_text(colour[2]) + "]";
}

SunKey sun_key(const Scene& scene, double time_s) {
    const Sun sun = scene_sun_at(scene, time_s);
    return {time_s, sun.elevation_deg, sun.azimuth_deg, sun.colour};
}

// Key frames of a sun that is as in `scene` up to the step before `step` and `wanted` from it on. Where the sun of the
// scene moves, every step gets one of its own, so that its pictures keep their bits.
std::vector<SunKey> changed_sun(const Scene& scene, SunKey wanted, std::uint64_t step) {
    const double step_s = scene.automaton.time_step_s, now = double(step) * step_s,
                 last = double(step - 1) * step_s;
    std::vector<SunKey> keys;
    for (const SunKey& key : scene.sun_path) {
        if (step > 0 && key.time_s <= last) keys.push_back(key);
    }
    const bool follows_date =
        scene.sun_path.empty() && !scene.render.sun.date.empty() && scene.render.sun.moves;
    if (follows_date || (!keys.empty() && keys.size() < scene.sun_path.size())) {
        const double from = keys.empty() ? -1 : keys.back().time_s;
        for (std::uint64_t at = std::uint64_t(std::max(0.0, std::ceil(from / step_s))); at < step; ++at) {
            if (double(at) * step_s > from) keys.push_back(sun_key(scene, double(at) * step_s));
        }
    } else if (step > 0 && (keys.empty() || keys.back().time_s < last)) {
        keys.push_back(sun_key(scene, last));
    }
    wanted.time_s = now;
    keys.push_back(wanted);
    return keys;
}

// Key frames of a sun that is `wanted` at a step, and as in `scene` at the other key frames.
std::vector<SunKey> sun_with_key(const Scene& scene, SunKey wanted, std::uint64_t step) {
    wanted.time_s = double(step) * scene.automaton.time_step_s;
    std::vector<SunKey> keys = scene.sun_path;
    const auto at = std::ranges::lower_bound(keys, wanted.time_s, {}, &SunKey::time_s);
    if (at != keys.end() && at->time_s == wanted.time_s) {
        *at = wanted;
    } else {
        keys.insert(at, wanted);
    }
    return keys;
}

std::vector<KeyFrame> key_frames(const std::vector<StatePoint>& points) {
    std::vector<KeyFrame> out;
    for (const StatePoint& point : points)
        out.push_back({point.time_s, {{"state", number_text(point.state)}}});
    return out;
}

std::vector<KeyFrame> key_frames(const std::vector<SunKey>& keys, const Rgb& colour) {
    std::vector<KeyFrame> out;
    for (const SunKey& key : keys) {
        std::vector<TextEntry> entries{{"elevation_deg", number_text(key.elevation_deg)},
                                       {"azimuth_deg", number_text(key.azimuth_deg)}};
        if (key.colour != colour) entries.emplace_back("colour", colour_toml(key.colour));
        out.push_back({key.time_s, std::move(entries)});
    }
    return out;
}

// The text with other key frames of the sun, which then follows no date.
std::string with_sun_keys(std::string text, const Scene& scene, const std::vector<SunKey>& keys) {
    for (const char* key : {"sun.date", "sun.time", "sun.moves", "sun.latitude_deg", "sun.longitude_deg"})
        text = without(text, text_path(key));
    const Rgb& colour = scene.render.sun.colour;
    return with_key_frames(text, text_path("sun.path"), key_frames(scene.sun_path, colour),
                           key_frames(keys, colour));
}

// The step of the picture that is shown: what it shows is decided by the newest change.
std::uint64_t shown_step(const Editor& editor) {
    const LiveStatus status = editor.live->status();
    return status.running && editor.picture ? editor.picture->step : status.goal;  // as the time line
}

std::string with_recorded_sun(const Editor& editor, const std::string& text, const SunKey& wanted,
                              std::uint64_t step) {
    const Scene& scene = *editor.document->current_scene();
    const bool adds_one = !editor.record && !scene.sun_path.empty();
    return with_sun_keys(text, scene,
                         adds_one ? sun_with_key(scene, wanted, step) : changed_sun(scene, wanted, step));
}

void record_sun(Editor& editor, const SunKey& wanted) {
    const std::uint64_t step = shown_step(editor);
    const auto changed = [&](const std::string& text) {
        return with_recorded_sun(editor, text, wanted, step);
    };
    // One drag is one step of the history, over as many steps of the simulation as it lasts.
    if (change_text(editor, changed, "Sun from step " + std::to_string(step), "live sun"))
        say(editor, "Sun recorded from step " + std::to_string(step) + " on");
}

// Applies a text that goes on from the present state.
void apply(Editor& editor, const std::string& text, const std::string& what, const std::string& merge) {
    editor.document->edit(text, what, merge);
    editor.shown_version = editor.document->version();
    const Scene* const scene = editor.document->current_scene();
    if (scene == nullptr) return;
    editor.shown_scene = *scene;
    editor.live->change(*editor.shown_scene);
}

// Returns how many steps the automata have taken where the simulation is that the user sees: it may still be on the way there.
std::uint64_t steps_at_goal(const LiveStatus& status, const Scene& scene) {
    const bool is_there = status.goal <= status.step + (status.running ? 1 : 0);
    if (is_there) return status.steps_taken;
    return std::max(status.steps_taken, status.goal + std::uint64_t(scene.density.smoothing.t0));
}

struct Held {
    explicit Held(Editor& editor) : scene(*editor.live) {
        scene.hold();
        step = steps_at_goal(scene.status(), *editor.document->current_scene());
    }
    ~Held() { scene.release(); }
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    LiveScene& scene;
    std::uint64_t step = 0;  // taken, where a change acts from
};

// Length of the path of a wind's array at the start of a path; 0 when it is none.
std::size_t wind_length(const TextPath& path) {
    if (!path.empty() && path[0].name == "wind") return 1;
    return path.size() > 2 && path[0].name == "layer" && path[2].name == "wind" ? 3 : 0;
}

// Returns whether a path leads to a number of a wind's key frame, other than its time.
bool is_of_wind(const TextPath& path) {
    const std::size_t length = wind_length(path);
    return length > 0 && path.size() > length + 1 && path.back().name != "time_s";
}

// The wind of a scene at such a path.
const Wind& wind_at_path(const Scene& scene, const TextPath& path) {
    return path.size() == 1 ? scene.automaton.wind : scene.layers.at(path[1].index).wind;
}

// The scene of a text; none when it has problems, which are shown as any other.
std::optional<Scene> scene_of(const Editor& editor, const std::string& text) {
    try {
        return read_scene_text(text, editor.document->title(), editor.document->folder());
    } catch (const SceneErrors&) {
        return std::nullopt;
    }
}

// Path of the array of a wind that a path leads into.
TextPath wind_array(const TextPath& path) {
    return {path.begin(), path.begin() + std::ptrdiff_t(wind_length(path))};
}

// The text with the wind at `path` as in the text `edited` from a step on, and its number of key frames.
struct RecordedWind {
    std::string text;
    std::size_t keys = 0;
};

// Returns nothing where the text `edited` has problems.
std::optional<RecordedWind> with_recorded_wind(const Editor& editor, const TextPath& path,
                                               const std::string& edited, std::uint64_t from) {
    const std::optional<Scene> wanted = scene_of(editor, edited);
    if (!wanted) return std::nullopt;
    const TextPath array = wind_array(path);
    const std::size_t index = path[array.size()].index;
    const Wind& changed = wind_at_path(*wanted, array);
    if (index >= changed.keyframes.size()) return std::nullopt;
    const Scene& scene = *editor.document->current_scene();
    const Wind& before = wind_at_path(scene, array);
    const std::vector<WindKeyframe> keys =
        changed_keys(before, changed.keyframes[index].levels, from, scene.automaton.time_step_s);
    return RecordedWind{
        with_key_frames(editor.document->text(), array, key_frames(before.keyframes), key_frames(keys)),
        keys.size()};
}

// Clouds that enter at the end of the present step were placed with the wind that it has there: a change follows it.
std::uint64_t step_of_change(std::uint64_t steps_taken) { return steps_taken + 1; }

std::uint64_t step_of_next_change(const Editor& editor) {
    return step_of_change(steps_at_goal(editor.live->status(), *editor.document->current_scene()));
}

bool record_wind(Editor& editor, const TextPath& path, const std::string& edited) {
    const Held held(editor);
    const std::uint64_t from = step_of_change(held.step);
    const auto recorded = with_recorded_wind(editor, path, edited, from);
    if (!recorded) return false;
    const TextPath array = wind_array(path);
    say(editor, "Wind recorded from step " + std::to_string(from) + " on");
    apply(editor, recorded->text, "Wind from step " + std::to_string(from),
          "live " + std::to_string(held.step));
    // What is shown of the list is now its newest key frame.
    if (editor.selected.size() > array.size() &&
        std::equal(array.begin(), array.end(), editor.selected.begin())) {
        editor.selected[array.size()].index = recorded->keys - 1;
    }
    const TextPath frame(path.begin(), path.begin() + std::ptrdiff_t(array.size() + 1));
    TextPath now = frame;
    now.back().index = recorded->keys - 1;
    const bool goes_on = editor.followed_rows && editor.followed_rows->now == frame;
    editor.followed_rows = {now, goes_on ? editor.followed_rows->before : frame};
    return true;
}

// The sun at the step that is shown with a key as in the text `edited`; nothing where that has problems.
std::optional<SunKey> recorded_sun(const Editor& editor, const TextPath& path, const std::string& edited) {
    const std::optional<Scene> wanted = scene_of(editor, edited);
    if (!wanted) return std::nullopt;
    const Sun now = sun_now(editor), &then = wanted->render.sun;
    SunKey key{0, now.elevation_deg, now.azimuth_deg, now.colour};
    if (path[1].name == "elevation_deg") key.elevation_deg = then.elevation_deg;
    if (path[1].name == "azimuth_deg") key.azimuth_deg = then.azimuth_deg;
    if (path[1].name == "colour") key.colour = then.colour;
    return key;
}

}  // namespace

bool is_recorded(const Editor& editor, const TextPath& path) {
    if (editor.record) return true;
    // While the text has problems the sun is that of an earlier one: its keys are shown and set as they are.
    return is_sun(path) && editor.document->current_scene() != nullptr && editor.shown_scene &&
           !editor.shown_scene->sun_path.empty();
}

std::optional<TextPath> recorded_place(const Editor& editor, const TextPath& path) {
    const Scene* const scene = editor.document->current_scene();
    const bool is_search = editor.record && !editor.filter.empty() && scene != nullptr && is_of_wind(path);
    const std::size_t frame = wind_array(path).size(), level = frame + 2;
    if (!is_search || path.size() <= level || path[level - 1].name != "levels") return path;
    const double now_s = double(step_of_next_change(editor)) * scene->automaton.time_step_s;
    const std::vector<WindKeyframe>& keys = wind_at_path(*scene, wind_array(path)).keyframes;
    const auto later = std::ranges::upper_bound(keys, now_s, {}, &WindKeyframe::time_s);
    const auto newest = std::size_t(later - keys.begin()), index = path[frame].index, at = path[level].index;
    if (newest == 0 || index + 1 >= newest) return path;
    const std::vector<WindLevel>&of = keys[index].levels, &now = keys[newest - 1].levels;
    if (at >= of.size() || at >= now.size() || of[at].height_m != now[at].height_m) return std::nullopt;
    TextPath out = path;
    out[frame].index = newest - 1;
    return out;
}

bool is_kept_from_recording(const Editor& editor, const TextPath& path) {
    return editor.record && (is_sun(path) || is_of_wind(path)) && editor.document->current_scene() == nullptr;
}

Sun sun_now(const Editor& editor) {
    return scene_sun_at(*editor.shown_scene,
                        double(shown_step(editor)) * editor.shown_scene->automaton.time_step_s);
}

bool is_recorded_when_left(const Editor& editor, const TextPath& path) {
    return is_recorded(editor, path) && (is_of_wind(path) || (is_sun(path) && ImGui::GetIO().WantTextInput));
}

std::optional<std::string> value_now(const Editor& editor, const TextPath& path) {
    if (editor.recorded_value && editor.recorded_value->path == path) return editor.recorded_value->value;
    if (!is_sun(path) || editor.document->current_scene() == nullptr || !editor.shown_scene ||
        editor.shown_scene->sun_path.empty())
        return std::nullopt;
    const Sun sun = sun_now(editor);
    if (path[1].name == "colour") return colour_toml(sun.colour);
    return number_text(path[1].name == "azimuth_deg" ? sun.azimuth_deg : sun.elevation_deg, 6);
}

void move_sun(Editor& editor, double elevation_deg, double azimuth_deg, bool dragging) {
    const TextPath sun = text_path("sun");
    if (!editor.shown_scene) return;
    if (editor.document->current_scene() == nullptr)
        return say(editor, "The sun stays while the text has problems: mend them, or undo", true);
    if (is_recorded(editor, text_path("sun.elevation_deg")))
        return record_sun(editor, {0, elevation_deg, azimuth_deg, sun_now(editor).colour});
    if (editor.shown_scene->render.sun.date.empty()) {
        set_values(editor, sun,
                   {{"elevation_deg", number_text(elevation_deg)}, {"azimuth_deg", number_text(azimuth_deg)}},
                   dragging);
        return;
    }
    const auto moved = [&](std::string text) {  // a place in the stead of a date
        for (const char* key : {"sun.date", "sun.time", "sun.moves", "sun.latitude_deg", "sun.longitude_deg"})
            text = without(text, text_path(key));
        text = with_value(text, text_path("sun.elevation_deg"), number_text(elevation_deg));
        return with_value(text, text_path("sun.azimuth_deg"), number_text(azimuth_deg));
    };
    change_text(editor, moved, "Move the sun", dragging ? "sun" : "");
}

bool record_live(Editor& editor, const TextPath& path, const std::string& edited) {
    if (!editor.shown_scene || editor.document->current_scene() == nullptr) return false;
    if (is_sun(path)) {
        const std::optional<SunKey> key = recorded_sun(editor, path, edited);
        if (key) record_sun(editor, *key);
        return key.has_value();
    }
    return is_of_wind(path) && record_wind(editor, path, edited);
}

std::string with_recorded(const Editor& editor, const TextPath& path, const std::string& edited) {
    if (!editor.shown_scene || editor.document->current_scene() == nullptr) return edited;
    const std::string& text = editor.document->text();
    if (is_sun(path)) {
        const std::optional<SunKey> key = recorded_sun(editor, path, edited);
        return key ? with_recorded_sun(editor, text, *key, shown_step(editor)) : edited;
    }
    if (!is_of_wind(path)) return edited;
    const auto recorded = with_recorded_wind(editor, path, edited, step_of_next_change(editor));
    return recorded ? recorded->text : edited;
}

void record_climate(Editor& editor, double final_state, double duration_s) {
    if (!editor.shown_scene) return;
    if (editor.document->current_scene() == nullptr)
        return say(editor, "The climate stays while the text has problems: mend them, or undo", true);
    const Held held(editor);
    const Scene& scene = *editor.document->current_scene();
    const bool has_follower =
        std::ranges::any_of(scene.layers, [](const LayerOptions& layer) { return layer.schedule.empty(); });
    if (!has_follower)
        return say(editor, "The climate stays: each layer has states of its own, layer.climate", true);
    const double step_s = scene.automaton.time_step_s, now = double(held.step) * step_s,
                 last = (double(held.step) - 1) * step_s;  // as the simulation has it
    const auto state = [&](double time_s) {
        return scene.climate.schedule.empty() ? 0.0 : state_at(scene.climate.schedule, time_s);
    };
    std::vector<StatePoint> points;
    for (const StatePoint& point : scene.climate.schedule) {
        if (point.time_s < last) points.push_back(point);
    }
    // Every step between two points gets one, so that the past keeps its bits.
    const double from = points.empty() ? -step_s : points.back().time_s;
    const bool moving = points.size() < scene.climate.schedule.size() && !points.empty();
    for (std::uint64_t step = moving ? 0 : (held.step > 0 ? held.step - 1 : 0); step <= held.step; ++step) {
        const double time = double(step) * step_s;
        if (time > from) points.push_back({time, state(time)});
    }
    points.push_back({now + std::max(duration_s, step_s), final_state});
    const bool done = attempt(editor, [&] {
        std::string text = editor.document->text();
        for (const char* key : {"climate.initial_state", "climate.final_state", "climate.duration_s"})
            text = without(text, text_path(key));
        text = with_key_frames(text, text_path("climate.schedule"), key_frames(scene.climate.schedule),
                               key_frames(points));
        apply(editor, text, "Climate from step " + std::to_string(held.step), "");
    });
    if (done) say(editor, "The climate changes from step " + std::to_string(held.step) + " on");
}

void add_flash(Editor& editor, const Vec3& at) {
    if (!editor.shown_scene) return;
    const double time_s = editor.picture ? editor.picture->time_s : 0;
    const auto rounded = [](double number) { return number_text(std::round(number), 7); };
    const std::vector<TextEntry> entries{
        {"position_m", "[" + rounded(at.x) + ", " + rounded(at.y) + ", " + rounded(at.z) + "]"},
        {"time_s", number_text(time_s)},
        {"duration_s", number_text(4 * editor.shown_scene->automaton.time_step_s)},
        {"intensity", "4"}};
    const auto added = [&](const std::string& text) {
        return with_new_element(text, text_path("lightning"), entries);
    };
    change_text(editor, added, "Lightning");
}

}  // namespace nephos
