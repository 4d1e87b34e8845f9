// SPDX-License-Identifier: Apache-2.0
#pragma once

// The probability field: probabilities of vapour, activation and extinction in each cell and step (D, control
// of motion). A background and ellipsoids, each a humid parcel of air that the wind advects.
//
// Inside an ellipsoid, with u = the normalised distance from its centre (0 at the centre, 1 at the rim):
//
//     p(u) = rim + (centre - rim) * (1 - u^2)^2        smooth, and flat at the centre and at the rim
//
// Outside (u >= 1) an ellipsoid has no effect. A fade weight w in 0..1 (birth, death) mixes p with the
// background: background + w * (p - background). Where ellipsoids overlap, the larger hum and act and the
// smaller ext win, the background always taking part.

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/sample_grid.h"
#include "core/vec.h"

namespace nephos {

// Probabilities of one cell and step, each in 0..1.
struct Probabilities {
    double hum = 0;  // hum' = hum | (rnd < p_hum)
    double act = 0;  // act' = act | (rnd < p_act)
    double ext = 0;  // cld' = cld & (rnd >= p_ext)
    bool operator==(const Probabilities&) const = default;
};

inline constexpr double kForever = std::numeric_limits<double>::infinity();

// One ellipsoid: a parcel of air.
struct Ellipsoid {
    Vec3 centre_m{};                  // at its birth, or at time 0 if that is later
    Vec3 semi_axes_m{500, 500, 300};  // > 0, before the turn by yaw
    double yaw_deg = 0;               // turn about the vertical, counter-clockwise seen from above
    Probabilities centre{0.1, 0.001, 0.1};
    Probabilities rim{0, 0, 0.1};
    double birth_s = 0;        // time at which it appears
    double life_s = kForever;  // until it is gone, fades included
    double fade_in_s = 0;      // linear in time
    double fade_out_s = 0;     // linear; ends at birth_s + life_s
    bool carried = true;       // moves with the wind at its centre's height; otherwise fixed
    bool operator==(const Ellipsoid&) const = default;
};

// A plume of thermals instead of one ellipsoid: bubbles of warm air that leave the condensation level one after the
// other and rise (the bubble theory of convection: Scorer and Ludlam, Q. J. R. Meteorol. Soc. 79, 1953).
//
// The scatter's ellipsoid stays at its height: the base. Thermal n is released `interval_s` n after the birth of the
// plume, in it and as high as it, `width` times as wide, and lives for `life_s`; the last one dies with the plume. At
// the fraction u of its life it has risen by
//
//     h = rise_m u (2 - u)
//
// so it slows down evenly and comes to rest. Its semi-axes change by `spread` h in proportion to the mean of the two
// horizontal ones, down to a fifth. In air of the same stability a thermal's radius grows by a quarter of its rise
// (Scorer, J. Fluid Mech. 2, 1957; Woodward, Q. J. R. Meteorol. Soc. 85, 1959); of a cloud in dry air the rim
// evaporates, and what is left of a bubble shrinks: spread < 0. The wind carries a thermal by its value at the middle of
// the way that it has risen, the plume by that at the level of release: towers lean with the shear.
struct ThermalPlume {
    double interval_s = 0;   // between releases; 0: no plume
    double life_s = 900;     // of a thermal, > 0
    Range rise_m{800, 800};  // height gained, drawn for each plume; >= 0
    double width = 0.6;      // 0.05..1: of a thermal, in widths of the base
    double spread = -0.1;    // -1..1
    double variety = 0.4;    // 0..0.9: size and rise of a thermal are 1 - variety to 1 of those above
    double wander = 0.5;     // 0..10: largest distance of a release from the axis, in semi-axes of the base
    bool operator==(const ThermalPlume&) const = default;
};

// Ellipsoids with parameters drawn uniformly from ranges, by the scene's seed.
struct EllipsoidScatter {
    int count = 0;        // alive at any time when `replace`, else in total; 0..100000
    Range x_m, y_m, z_m;  // of the centres, in world space
    Range semi_axis_x_m, semi_axis_y_m, semi_axis_z_m;  // > 0
    Range yaw_deg;
    Probabilities centre{0.1, 0.001, 0.1};
    Probabilities rim{0, 0, 0.1};
    Range birth_s;  // times of birth
    Range life_s{kForever, kForever};
    double fade_in_s = 0, fade_out_s = 0;
    bool carried = true;
    // Redraws an ellipsoid that left the box (upwind of it) or died (anywhere).
    bool replace = false;
    ThermalPlume thermals;
    bool operator==(const EllipsoidScatter&) const = default;
};

// The background at one height of a profile.
struct BackgroundLevel {
    double height_m = 0;  // world z; levels rise strictly
    Probabilities background{0, 0, 0.1};
    bool operator==(const BackgroundLevel&) const = default;
};

// The background by height at one time: linear between levels, constant below the first and above the last.
struct BackgroundKeyframe {
    double time_s = 0;  // keyframes rise strictly
    std::vector<BackgroundLevel> levels;
    bool operator==(const BackgroundKeyframe&) const = default;
};

// Which of the three probabilities; the numbers of kHum, kAct and kExt.
enum class ProbabilityKind { hum, act, ext };

// One probability of the background in each cell, from a file: linear between its points.
struct ProbabilityGrid {
    ProbabilityKind of = ProbabilityKind::hum;
    std::optional<std::filesystem::path> file;
    std::string grid;  // empty: the only one
    std::shared_ptr<const SampleGrid> samples;  // of `file`; not null in an automaton; each value 0..1
    bool operator==(const ProbabilityGrid&) const = default;
};

// The background is that of a grid where there is one, else that of the profile where there is one, else `background`.
// Where it varies, an ellipsoid that fades in or out comes from and goes to no effect: it mixes with 0 of hum and act
// and with 1 of ext in place of the background.
struct FieldOptions {
    Probabilities background{0, 0, 0.1};
    std::vector<BackgroundKeyframe> profile{};
    std::vector<ProbabilityGrid> grids{};  // at most one of each kind
    std::vector<Ellipsoid> ellipsoids{};
    std::vector<EllipsoidScatter> scatters{};
    bool operator==(const FieldOptions&) const = default;
};

}  // namespace nephos
