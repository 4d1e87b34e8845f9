// SPDX-License-Identifier: Apache-2.0
#pragma once

// One layer of the sky over time (T, chapter 3.4): clouds drift with the wind, leave the world downwind and
// enter it on the opposite side. Entering clouds are drawn from the skies that bracket the state of the
// atmosphere, so that a change of weather comes over the horizon while the present clouds remain.
//
//     SkySimulation sky(options);       // scattered at random, from the sky nearest to the initial state
//     sky.step();                       // together with the automaton's step
//     for (const SkyCloud& cloud : sky.clouds()) ... sky.shape(cloud), sky.position_m(cloud), cloud.phase ...
//
// A step moves every cloud by the wind at its centre's height at the step's begin, advances the phases,
// removes the clouds that have left, and then adjusts the number of clouds to that of the state (climate.h).
// With Entering::anywhere:
// - For each cloud that left, one enters upwind, where its shape just touches the edge. Its position along
//   the wind is random within the displacement of one step, so that fast wind leaves no gaps, and the two
//   upwind sides get clouds in proportion to the air that crosses them.
// - Missing clouds form inside; surplus ones, drawn at random, dissolve inside. In calm air all form inside.
// - Wind that crosses the world in one step leaves no cloud for longer than two steps.
// - In a world that repeats (SkyOptions::periodic) clouds re-enter where they leave, and all others form inside.
// - A sky without base models supplies no cloud: the other bracketing sky then supplies all.
//
// With Entering::horizon the air that flows in carries clouds as densely as the state asks for, and no cloud forms
// or dissolves inside. Of the n clouds of a kind at a state, that touch the world of width w (the world's and their
// own) and depth d, the wind (x, y) of a step replaces
//
//     n (|x| / w + |y| / d), at most n
//
// so that their number follows the state while the air is exchanged, and in calm air stays. Fractions of a cloud
// add up from step to step.
//
// Fields of the wind (core/wind_field.h) carry clouds too, along the ground: a cloud keeps its height. Those that enter
// are brought by the profile.
//
// Positions are fixed-point sums of displacements (core/wind.h): there is no rounding drift, and the state
// can be saved and restored exactly. One object is one simulation; while a thread steps, others may call the
// functions that depend on the options alone: options(), shapes(), shape(), model(), forms() of a state, state_at(),
// lean_m(), position_m(), sphere() and ahead().

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "automaton/checkpoint.h"
#include "core/wind.h"
#include "seeds/cloud.h"
#include "seeds/sky.h"

namespace nephos {

// One of the shapes of the layer's skies, generated when the simulation starts.
struct CloudShape {
    std::size_t model = 0;     // index in SkyOptions::models
    std::uint32_t number = 0;  // of the cloud made from it
    Cloud cloud;
};

// One cloud in the sky.
struct SkyCloud {
    std::uint32_t serial = 0;  // unique in its layer, rises in order of birth
    std::uint32_t shape = 0;   // index in SkySimulation::shapes()
    std::uint32_t sky = 0;     // index in SkyOptions::skies, of the sky that it was drawn from
    Displacement place;        // of the model's origin in the world, metres * 2^32
    double base_m = 0;         // world z of the model's origin
    double phase = 1;          // 0 no cloud .. 1 the whole cloud (cloud.h, phase_weight)
    bool dissolving = false;   // no longer counts towards the sky's number of clouds
    // The lowest number that was free at its birth. Distributes recurring work over frames
    // (light_schedule.h) and has no other effect.
    std::uint32_t slot = 0;
    bool operator==(const SkyCloud&) const = default;
};

// One of the forms that a cloud has at a time: a shape and how far it is there.
struct CloudForm {
    std::uint32_t shape = 0;  // index in SkySimulation::shapes()
    double phase = 1;         // as SkyCloud::phase, of this form
    bool operator==(const CloudForm&) const = default;
};

// The forms of a cloud: one, or two while it changes; the second is what it changes into.
struct CloudForms {
    CloudForm of[2];
    int count = 1;
    const CloudForm* begin() const { return of; }
    const CloudForm* end() const { return of + count; }
    // The one that is there the most.
    const CloudForm& main() const { return of[count == 2 && of[1].phase > of[0].phase ? 1 : 0]; }
};

class SkySimulation {
  public:
    // Throws Error(usage) on options that check() refuses, and when a cloud is larger than the world.
    explicit SkySimulation(const SkyOptions& options);

    // Advances by one step of options().time_step_s. Throws Error(usage) when the wind moves a cloud by more
    // than 5e8 m.
    void step();

    const SkyOptions& options() const { return options_; }
    std::uint64_t steps() const { return steps_; }
    double time_s() const { return double(steps_) * options_.time_step_s; }
    double state() const;  // of the atmosphere, 0..1, now

    std::span<const SkyCloud> clouds() const { return clouds_; }  // oldest first
    std::size_t count() const;                                    // of clouds that are not dissolving
    std::span<const CloudShape> shapes() const { return shapes_; }
    const Cloud& shape(const SkyCloud& cloud) const { return shapes_[cloud.shape].cloud; }
    const BaseModel& model(const SkyCloud& cloud) const {
        return options_.models[shapes_[cloud.shape].model];
    }
    const BaseModel& model(const CloudForm& form) const { return options_.models[shapes_[form.shape].model]; }
    // Returns what a cloud looks like in a state of the atmosphere: its own shape, or, by SkyOptions::metamorphoses, the
    // same number of another model; while it changes both, the first dissolving from its edges inwards and the second
    // forming from its centre outwards, each in its own boxes. A function of cloud and state alone.
    CloudForms forms(const SkyCloud& cloud, double state) const;
    CloudForms forms(const SkyCloud& cloud) const { return forms(cloud, state()); }
    double state_at(double time_s) const;  // of the atmosphere, by the schedule
    // Returns how far billboards at a height of a cloud lean by profile and fields (SkyOptions::shear_s), m east and north.
    Vec3 lean_m(const SkyCloud& cloud, const CloudForm& form, double height_m, double time_s) const;
    Vec3 position_m(const SkyCloud& cloud) const;  // world position of the model's origin
    Sphere sphere(const SkyCloud& cloud) const;    // around the cloud, in the world

    // Extrapolates a cloud at time `at_s` by `after_s`, 0..time_step_s, with the motion and change of phase
    // of the step that begins at `at_s`, so that it moves continuously from step to step.
    SkyCloud ahead(const SkyCloud& cloud, double at_s, double after_s) const;

    // Returns the displacement of the air at the middle of the base heights since the start, metres * 2^32
    // (wraps around).
    const Displacement& carried() const { return carried_; }

    // Returns the hash of the state without the slots: of everything that determines later clouds.
    StateHash hash() const;

    // Returns whether a cloud can be one of this sky, whatever its serial and slot.
    bool is_possible(const SkyCloud& cloud) const;

    // Serialise and restore the complete state. restore() throws Error(io) on bytes that no simulation with
    // these options wrote, and then leaves the simulation unchanged.
    std::vector<std::byte> save() const;
    void restore(std::span<const std::byte> bytes);

  private:
    // The clouds of one shape that enter over the horizon in a step.
    struct Inflow {
        std::uint32_t sky = 0, shape = 0;  // as in SkyCloud
        double up_to = 0;                  // their number, and that of the shapes before
    };

    void make_shapes();
    void move_clouds();
    void re_enter(SkyCloud& cloud) const;
    void retire_clouds();
    void adjust_number(std::size_t left);
    void let_enter();
    void dissolve(std::size_t number);
    std::vector<Inflow> inflow() const;
    SkyCloud new_cloud(std::size_t sky);
    void assign_slots(std::size_t first_new);
    std::vector<std::byte> bytes_without_slots() const;
    std::size_t draw_sky(std::uint32_t word) const;
    void place_inside(SkyCloud& cloud) const;
    bool place_upwind(SkyCloud& cloud) const;
    Displacement wind_step(const SkyCloud& cloud, double time_s) const;
    // By the profile alone: what brings clouds into the world.
    Displacement inflow_step(const SkyCloud& cloud) const;
    Displacement checked_step(const Vec3& velocity) const;
    bool outside(const SkyCloud& cloud, const Displacement& wind) const;

    SkyOptions options_;
    std::vector<CloudShape> shapes_;
    std::vector<std::uint32_t> first_of_model_;  // index of number 0 of each model's shapes
    std::vector<std::uint32_t> generated_;       // number of these
    std::vector<std::vector<std::uint32_t>>
        first_shape_;  // [sky][entry of its models]: index of its number 0
    std::vector<SkyCloud> clouds_;
    std::uint64_t steps_ = 0;
    std::uint32_t born_ = 0;       // clouds made so far, those entering, forming and scattered
    std::uint32_t dissolved_ = 0;  // clouds drawn to dissolve so far
    std::int64_t due_ = 0;         // of a cloud that has not entered yet, clouds * 2^32; Entering::horizon
    Displacement carried_;
};

}  // namespace nephos
