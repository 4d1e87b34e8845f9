// SPDX-License-Identifier: Apache-2.0
#include "apps/editor/live.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <utility>

#include "apps/editor/live_picture.h"
#include "core/error.h"
#include "seeds/coupling.h"
#include "simulation/memory.h"

namespace nephos {
namespace {

// Steps from one checkpoint to the next while there is memory: a step that is gone to is at most so many away.
constexpr std::uint64_t kCheckpointSteps = 4;
// Checkpoints are compared by this name alone: which scene they belong to is known here.
const std::string kLive = "live";

// The scene as it is simulated here: a frame a step, for as long as anybody looks.
Scene live_scene(Scene scene) {
    scene.frames = film_of_steps(scene);
    scene.steps = kMaxFrames - 1;
    scene.density.write_state = true;  // planes for the views of hum, act and cld
    return scene;
}

std::vector<LiveField> fields_of(const Simulation& simulation, const Scene& scene) {
    std::vector<LiveField> fields;
    for (const LayerSimulation& layer : simulation.layers()) {
        LiveField& field = fields.emplace_back();
        if (layer.automaton() == nullptr) continue;
        field = {layer.automaton()->ellipsoids(), layer.automaton()->options().field.background};
        if (layer.sky() == nullptr) continue;
        const LayerOptions& options = scene.layers[fields.size() - 1];
        std::vector<ActiveEllipsoid> of_clouds = ellipsoids_of(*layer.sky(), options.coupling);
        append_columns(of_clouds, layer.rain(), options.rain.column);
        field.ellipsoids.insert(field.ellipsoids.end(), of_clouds.begin(), of_clouds.end());
    }
    return fields;
}

// Keeps the last frame and all steps that a simulation hands out.
struct Collector : SimulationSink {
    void step(const StepResult& result) override {
        steps.push_back({result.step, {result.time_s, result.statistics, result.hash, result.layers}});
    }
    void frame(const FrameResult& result) override { last = result; }
    std::vector<std::pair<std::uint64_t, LiveStep>> steps;
    std::optional<FrameResult> last;
};

std::size_t bytes_of(const Checkpoint& checkpoint) {
    return checkpoint.automaton.size() + checkpoint.history.size();
}

// Returns the simulation that goes on from a state of this scene, or of what it was before a change while it ran.
std::shared_ptr<Simulation> goes_on(const Scene& scene, const Checkpoint& from) {
    return std::make_shared<Simulation>(scene, full_range(scene), kLive, from, SimulationResults::everything,
                                        Restart::branch);
}

}  // namespace

FrameOptions film_of_steps(const Scene& scene) {
    FrameOptions frames;
    frames.start_s = 0;
    frames.per_second = 1;
    frames.time_scale = scene.automaton.time_step_s;
    frames.count = 0;
    return frames;
}

SceneChange change_between(const Scene& before, const Scene& after) {
    if (before == after) return SceneChange::none;
    Scene same = before;
    same.render = after.render;
    same.sun_path = after.sun_path;
    same.frames = after.frames;
    same.name = after.name;
    same.steps = after.steps;
    same.density.extinction_per_m = after.density.extinction_per_m;
    same.density.metaball_radius_cells = after.density.metaball_radius_cells;
    // Rain and snow lie on the ground.
    if (after.ground_cover.enabled && !(before.render.precipitation == after.render.precipitation)) {
        return SceneChange::simulation;
    }
    return same == after ? SceneChange::picture : SceneChange::simulation;
}

LiveScene::LiveScene(DeviceOptions device) : device_(std::move(device)) {
    simulation_thread_ = std::thread([this] { simulate(); });
    try {
        drawing_thread_ = std::thread([this] { draw(); });
        refining_thread_ = std::thread([this] { refine(); });
    } catch (...) {  // there is no more thread to be had
        end_threads();
        throw;
    }
}

LiveScene::~LiveScene() { end_threads(); }

void LiveScene::end_threads() {
    {
        const std::scoped_lock lock(mutex_);
        ended_ = true;
        hold_ = false;
    }
    simulation_due_.notify_all();
    drawing_due_.notify_all();
    simulation_thread_.join();
    if (drawing_thread_.joinable()) drawing_thread_.join();
    if (refining_thread_.joinable()) refining_thread_.join();
}

void LiveScene::start(const Scene& scene, std::uint64_t goal) {
    const std::scoped_lock lock(mutex_);
    new_scene_ = live_scene(scene);
    keeps_state_ = false;
    next_drawn_ = scene;
    next_number_ = ++scenes_;
    goal_ = goal;
    status_.failure.clear();
    draw_failure_.clear();
    simulation_due_.notify_all();
}

void LiveScene::change(const Scene& scene) {
    const std::scoped_lock lock(mutex_);
    const bool keeps = !new_scene_ || keeps_state_;
    new_scene_ = live_scene(scene);
    keeps_state_ = keeps;
    next_drawn_ = scene;
    next_number_ = ++scenes_;
    simulation_due_.notify_all();
}

void LiveScene::redraw(const Scene& scene) {
    const std::scoped_lock lock(mutex_);
    if (next_drawn_) {  // frames of its simulation are still to come
        next_drawn_ = scene;
        next_number_ = ++scenes_;
        return;
    }
    drawn_scene_ = scene;
    drawn_number_ = ++scenes_;
    scene_to_draw_ = true;
    drawing_due_.notify_all();
}

void LiveScene::clear() {
    const std::scoped_lock lock(mutex_);
    new_scene_.reset();
    next_drawn_.reset();
    clear_ = true;
    ++clears_;
    frame_.reset();
    picture_.reset();
    status_.failure.clear();
    draw_failure_.clear();
    simulation_due_.notify_all();
}

std::uint64_t LiveScene::hold() {
    std::unique_lock lock(mutex_);
    hold_ = true;
    simulation_due_.notify_all();
    held_.wait(lock, [this] { return is_held_ || ended_; });
    return status_.steps_taken;
}

void LiveScene::release() {
    const std::scoped_lock lock(mutex_);
    hold_ = false;
    simulation_due_.notify_all();
}

void LiveScene::run(bool running) {
    const std::scoped_lock lock(mutex_);
    running_ = status_.running = running;
    stops_here_ = !running && is_advancing_;
    if (!running && !is_advancing_) goal_ = std::min(goal_, status_.step);
    simulation_due_.notify_all();
    drawing_due_.notify_all();
}

void LiveScene::set_speed(double steps_per_second) {
    const std::scoped_lock lock(mutex_);
    if (std::exchange(steps_per_second_, steps_per_second) == steps_per_second) return;
    simulation_due_.notify_all();
}

void LiveScene::seek(std::uint64_t step) {
    const std::scoped_lock lock(mutex_);
    if (!status_.failure.empty() && !new_scene_) return;  // nothing goes there
    goal_ = std::min<std::uint64_t>(step, kMaxFrames - 2);
    stops_here_ = false;
    simulation_due_.notify_all();
}

void LiveScene::set_view(const LiveView& view) {
    const std::scoped_lock lock(mutex_);
    if (view == view_) return;
    view_ = view;
    drawing_due_.notify_all();
}

void LiveScene::show(bool shown) {
    const std::scoped_lock lock(mutex_);
    shown_ = shown;
    drawing_due_.notify_all();
}

void LiveScene::keep_at_most(std::size_t checkpoint_bytes) {
    const std::scoped_lock lock(mutex_);
    most_checkpoint_bytes_ = checkpoint_bytes;
    thins_ = true;
    simulation_due_.notify_all();
}

std::shared_ptr<const LivePicture> LiveScene::picture(std::uint64_t than) const {
    const std::scoped_lock lock(mutex_);
    return picture_ && picture_->number > than ? picture_ : nullptr;
}

std::shared_ptr<const LiveFrame> LiveScene::frame() const {
    const std::scoped_lock lock(mutex_);
    return frame_;
}

LiveScene::FrameOfScene LiveScene::frame_of_scene() const {
    const std::scoped_lock lock(mutex_);
    return {frame_, drawn_scene_};
}

LiveStatus LiveScene::status() const {
    const std::scoped_lock lock(mutex_);
    LiveStatus status = status_;
    // A pause gives up a goal that is far away, once the step under way has ended.
    status.goal = stops_here_ ? std::min(goal_, status_.step + 1) : goal_;
    status.rows = rows_.size();
    status.scenes = scenes_;
    if (status.failure.empty()) status.failure = draw_failure_;
    return status;
}

std::vector<LiveStep> LiveScene::steps(std::uint64_t from) const {
    const std::scoped_lock lock(mutex_);
    if (from >= rows_.size()) return {};
    return {rows_.begin() + std::ptrdiff_t(from), rows_.end()};
}

// With the mutex held: forgets a simulation that failed, so that only another scene starts one.
void LiveScene::fail(const std::string& what) {
    is_advancing_ = stops_here_ = false;
    forget_simulation();
    if (new_scene_ || clear_) return;  // another takes its place: nobody looks at this one
    status_.failure = what;
    goal_ = status_.step;
    drawing_due_.notify_all();  // the last picture gets its detail
}

void LiveScene::forget_simulation() {
    simulation_.reset();
    checkpoints_.clear();
    checkpoint_bytes_ = status_.checkpoint_bytes = status_.checkpoints = 0;
}

void LiveScene::simulate() {
    yield_to_window(kNicer);
    std::unique_lock lock(mutex_);
    Clock::time_point last_step = Clock::now();  // when it was due
    while (true) {
        const auto has_work = [this] {
            return ended_ || hold_ || new_scene_ || clear_ || thins_ ||
                   (simulation_ && (running_ || !frame_ || goal_ != status_.step));
        };
        simulation_due_.wait(lock, has_work);
        if (ended_) return;
        if (std::exchange(clear_, false)) {
            forget_simulation();
            rows_.clear();
            ++status_.rows_version;
            status_.step = status_.steps_taken = 0;
            if (!new_scene_) goal_ = 0;
            frame_.reset();  // a step was under way
            picture_.reset();
            continue;
        }
        if (hold_) {
            is_held_ = true;
            held_.notify_all();
            simulation_due_.wait(lock, [this] { return !hold_ || ended_; });
            is_held_ = false;
            continue;
        }
        const auto pause = std::chrono::duration_cast<Clock::duration>(
            std::chrono::duration<double>(1 / std::max(steps_per_second_, 0.01)));
        const Clock::time_point next_step = last_step + pause;
        try {
            if (new_scene_) {
                take_scene(lock);
            } else if (std::exchange(thins_, false)) {
                thin_checkpoints();
            } else if (goal_ != status_.step || !frame_) {
                advance(lock, goal_);
                last_step = Clock::now() - pause;
            } else if (Clock::now() < next_step) {
                simulation_due_.wait_until(lock, next_step);
            } else {
                last_step = std::max(next_step, Clock::now() - std::chrono::milliseconds(100));
                goal_ = status_.step + 1;
                advance(lock, goal_);
            }
        } catch (const std::bad_alloc&) {
            if (!lock.owns_lock()) lock.lock();
            fail("out of memory: the simulation was stopped");
        } catch (const std::exception& error) {
            if (!lock.owns_lock()) lock.lock();
            fail(error.what());
        }
    }
}

void LiveScene::take_scene(std::unique_lock<std::mutex>& lock) {
    const Scene scene = std::move(*new_scene_);
    const bool keeps_state = keeps_state_ && simulation_ != nullptr;
    new_scene_.reset();
    status_.failure.clear();  // of the one before: what is gone to from here on is of this one
    lock.unlock();
    std::shared_ptr<Simulation> simulation;
    if (keeps_state) {
        // States before this moment stay valid, those after it do not.
        const Checkpoint now = simulation_->save();
        simulation = goes_on(scene, now);
    } else {
        check_memory(scene, RunParts::statistics);
        SimulationStart start = simulation_start(scene);
        simulation = std::make_shared<Simulation>(scene, full_range(scene), kLive, std::move(start.initial));
    }
    lock.lock();
    scene_ = scene;
    simulation_ = std::move(simulation);
    ++simulation_number_;
    if (keeps_state) {
        std::erase_if(checkpoints_, [this](const auto& entry) {
            const bool goes = entry.first > simulation_->next_step();
            if (goes) checkpoint_bytes_ -= bytes_of(entry.second);
            return goes;
        });
        if (rows_.size() > simulation_->next_step()) {
            rows_.resize(simulation_->next_step());
            ++status_.rows_version;
        }
    } else {
        checkpoints_.clear();
        checkpoint_bytes_ = 0;
        checkpoint_every_ = kCheckpointSteps;
        rows_.clear();
        ++status_.rows_version;
        status_.step = 0;
        frame_.reset();
        const auto most = std::uint64_t(kMaxFrames - 2);
        goal_ = std::min(goal_, most);
        keep_checkpoint();
        thin_checkpoints();
    }
    status_.steps_taken = simulation_->steps_taken();
    if (!new_scene_ && next_drawn_) {  // otherwise it belongs to a scene that is taken next
        drawn_scene_ = std::move(*next_drawn_);
        next_drawn_.reset();
        drawn_number_ = next_number_;
        scene_to_draw_ = true;
        drawing_due_.notify_all();
    }
}

// Without the mutex, whose holder must not wait for a state that is written. Returns whether there is one more.
bool LiveScene::keep_checkpoint() {
    const std::uint64_t step = simulation_->next_step();
    if (checkpoints_.contains(step) || step % checkpoint_every_ != 0) return false;
    Checkpoint checkpoint = simulation_->save();
    checkpoint_bytes_ += bytes_of(checkpoint);
    checkpoints_.emplace(step, std::move(checkpoint));
    return true;
}

// With the mutex: leaves out every other checkpoint until they keep to their memory, and tells how many there are.
void LiveScene::thin_checkpoints() {
    while (checkpoint_bytes_ > most_checkpoint_bytes_ && checkpoints_.size() > 2) {
        checkpoint_every_ *= 2;
        std::erase_if(checkpoints_, [this](const auto& entry) {
            const bool goes = entry.first % checkpoint_every_ != 0;
            if (goes) checkpoint_bytes_ -= bytes_of(entry.second);
            return goes;
        });
    }
    status_.checkpoints = checkpoints_.size();
    status_.checkpoint_bytes = checkpoint_bytes_;
}

// Without the mutex. The frame of step s comes after the report of step s.
void LiveScene::go_back(std::uint64_t step) {
    auto nearest = checkpoints_.upper_bound(step);
    nearest = std::prev(nearest);  // the first is that of step 0
    simulation_ = goes_on(scene_, nearest->second);
}

// Simulates up to the frame of step `goal`, or of an earlier one after a while, so that a picture is seen meanwhile.
void LiveScene::advance(std::unique_lock<std::mutex>& lock, std::uint64_t goal) {
    const bool is_first = !frame_;
    const auto begin = Clock::now();
    is_advancing_ = true;
    lock.unlock();
    const std::uint64_t next_frame = std::uint64_t(simulation_->next_frame() - 1);  // of step 0 is number 1
    std::uint64_t from = next_frame;
    if (goal < next_frame) {
        go_back(goal);
        from = std::uint64_t(simulation_->next_frame() - 1);
    } else if (const auto nearest = std::prev(checkpoints_.upper_bound(goal));
               nearest->first > next_frame + 1) {
        go_back(goal);  // forwards over steps that are known
        from = std::uint64_t(simulation_->next_frame() - 1);
    }
    Collector collector;
    std::uint64_t done = from;
    while (!collector.last || done <= goal) {
        simulation_->advance(collector);
        const std::uint64_t reached = std::uint64_t(simulation_->next_frame() - 1);
        if (reached > done) {
            done = reached;
            const bool kept = keep_checkpoint();
            lock.lock();
            if (kept) thin_checkpoints();
            const bool interrupted = ended_ || hold_ || new_scene_ || clear_ || goal_ != goal || stops_here_;
            lock.unlock();
            if (interrupted || Clock::now() - begin > std::chrono::milliseconds(is_first ? 0 : 150)) break;
        }
    }
    std::vector<LiveField> fields = fields_of(*simulation_, scene_);
    const double spent_ms = std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
    lock.lock();
    for (const auto& [step, row] : collector.steps) {
        if (step == rows_.size()) rows_.push_back(row);
    }
    auto frame = std::make_shared<LiveFrame>();
    frame->simulation = simulation_;
    frame->frame = std::move(*collector.last);
    frame->frame.number = int(frame->frame.step) + 1;  // a film of a frame a step, see film_of_steps()
    frame->fields = std::move(fields);
    frame->simulation_number = simulation_number_;
    status_.step = frame->frame.step;
    is_advancing_ = false;
    if (std::exchange(stops_here_, false)) goal_ = status_.step;
    status_.steps_taken = simulation_->steps_taken();
    const double steps = double(std::max<std::uint64_t>(done - from, 1));
    status_.step_ms += 0.2 * (spent_ms / steps - status_.step_ms);
    frame_ = std::move(frame);
    drawing_due_.notify_all();
}

}  // namespace nephos
