// SPDX-License-Identifier: Apache-2.0
// The scene of a first start, and of File > New: small enough to move at once, with a little of everything that one
// wants to touch first.

#include "apps/editor/state.h"

namespace nephos {

std::string first_scene_text() {
    return R"toml(# A new scene: fair-weather cumulus in a west wind. Change anything and watch.

name = "untitled"
seed = 1

[lattice]
cells = [160, 96, 28]
cell_size_m = 40
origin_m = [-3200, -1920, 1000]
boundaries = ["periodic", "periodic", "open"]

[time]
step_s = 10
steps = 240

# Between the parcels the air is dry.
[field.background]
ext = 0.3

# Plumes of humid air at random.
[[field.scatters]]
count = 22
z_m = 1000
semi_axis_x_m = [260, 700]
semi_axis_y_m = [240, 520]
semi_axis_z_m = [150, 320]
yaw_deg = [0, 180]
centre = { hum = 0.1, act = 0.001, ext = 0.1 }
rim = { hum = 0.01, act = 0.0, ext = 0.35 }
birth_s = [-1800, 600]
life_s = [1800, 3000]
fade_in_s = 120
fade_out_s = 300
replace = true
thermals = { interval_s = 110, life_s = 800, rise_m = [150, 650], width = 0.6, spread = -0.15, variety = 0.5, wander = 0.5 }

[[wind]]
levels = [
    { height_m = 1000, from_deg = 265, speed_m_per_s = 6 },
    { height_m = 2200, from_deg = 280, speed_m_per_s = 10 },
]

[density]
smoothing = { kernel = "tent", i0 = 1, j0 = 1, k0 = 1, t0 = 1 }
metaball_radius_cells = 1.5
extinction_per_m = 0.15

[frames]
start_s = 400
time_scale = 60
count = 96

[camera]
position_m = [-600, -4300, 600]
target_m = [0, 0, 1150]
vertical_fov_deg = 46
exposure = "automatic"
tone_curve = "neutral"

[sun]
elevation_deg = 38
azimuth_deg = 255
colour = [1.0, 1.0, 1.0]

[atmosphere]
model = "physical"
colours = "spectral"

[ground]
pattern = "country"
)toml";
}

std::string empty_scene_text() {
    return R"toml(# Nothing but a sky over the ground. docs/editor.md fills it in ten minutes.

name = "untitled"
seed = 1

[camera]
exposure = "automatic"
tone_curve = "neutral"

[atmosphere]
model = "physical"

[ground]
pattern = "country"
)toml";
}

}  // namespace nephos
