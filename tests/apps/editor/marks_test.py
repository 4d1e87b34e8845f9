#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Key frames as marks below the time line, and what else a click writes into the scene that the text has to allow. See
case.py."""

import subprocess
import sys
import tomllib
import unittest

from case import NEPHOS
from kept import MODELS, WIND, Kept

LAYER_STATES = MODELS + "climate = { schedule = [{ time_s = 0, state = 0 }, { time_s = 900, state = 1 }] }\n"
PATH = """seed = 4
[lattice]
cells = [16, 16, 12]
[camera]
vertical_fov_deg = 50
[[camera.path]] # first
time_s = 0
position_m = [0, -4000, 300.5]
target_m = [0, 0, 1000]
[[camera.path]] # last
time_s = 600
position_m = [100, -4000, 300.5]
target_m = [0, 0, 1000]
"""


class Marks(Kept):
    START = "wait-step 2\nkey SPACE\nwait 0.3\n"

    def saved(self, text, script, name="m.toml"):
        scene = self.folder / name
        scene.write_text(text, encoding="utf-8")
        self.edit(scene, script=f"{self.START}{script}key CTRL+S\nwait 0.5\n")
        saved = scene.read_text(encoding="utf-8")
        done = subprocess.run([NEPHOS, "validate", scene], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr + saved)
        return saved

    def test_states_of_a_layer_are_dragged(self):
        saved = self.saved(LAYER_STATES, 'drag "key frame layer[0].climate.schedule[1]" -100 0\nwait 0.3\nclick "key frame layer[0].climate.schedule[1]"\n'
                                         "wait 0.3\nexpect-control layer[0].climate.schedule[1].state\n")
        times = [point["time_s"] for point in tomllib.loads(saved)["layer"][0]["climate"]["schedule"]]
        self.assertEqual(times[0], 0)
        self.assertTrue(0 < times[1] < 900, times)

    def test_a_mark_that_is_dragged_far_stops_before_the_next(self):
        winds = "".join(f"[[wind]]\ntime_s = {time}\nlevels = [{{ height_m = 1000, from_deg = 250, speed_m_per_s = 7.5 }}]\n" for time in (0, 100, 205))
        text = f"seed = 4\n[lattice]\ncells = [16, 16, 12]\n[time]\nstep_s = 10\nsteps = 60\n{winds}"
        for way, time in ((600, 200), (-600, 10)):
            saved = self.saved(text, f'drag "key frame wind[1]" {way} 0\nwait 0.3\n')
            self.assertEqual([frame["time_s"] for frame in tomllib.loads(saved)["wind"]], [0, time, 205])

    def test_states_without_key_frames_have_no_marks(self):
        """They come from keys, which no drag can change."""
        scene = self.folder / "s.toml"
        scene.write_text("[climate]\ninitial_state = 0\nfinal_state = 1\nduration_s = 60\n" + MODELS[MODELS.index("[[model]]"):], encoding="utf-8")
        said = self.edit(scene, script=self.START + 'expect-control "key frame climate.schedule[1]"\n', status=1)
        self.assertIn("no control 'key frame climate.schedule[1]'", said)

    def test_a_change_of_the_climate_is_within_its_range(self):
        """Whatever is typed; where no layer would follow, it is refused."""
        change = 'click "tab View"\nwait 0.2\nset "final state" {}\nset "climate duration" {}\nwait 0.2\nclick "Start the change now"\nwait 0.5\n'
        for state, minutes, expected in (("5", "1e30", (1, 7200)), ("-3", "-1", (0, 60)), ("nan", "nan", None)):
            last = tomllib.loads(self.saved(MODELS, change.format(state, minutes)))["climate"]["schedule"][-1]
            self.assertTrue(0 <= last["state"] <= 1, last)
            if expected:
                self.assertEqual(last["state"], expected[0])
                self.assertTrue(0 <= last["time_s"] - expected[1] < 3000, last)  # from the step that is shown, which a busy machine reaches late
        self.assertEqual(self.saved(LAYER_STATES, 'click "tab View"\nwait 0.2\nclick "Start the change now"\nwait 0.3\nexpect-control refusal\n'), LAYER_STATES)

    def test_the_camera_of_a_path_is_kept_as_its_key_frame(self):
        """Where the user has flown to, to the centimetre; the other key frames stay as they are written."""
        keep = 'click "tab View"\nset "field of view" 33\nwait 0.2\nclick "Look at the clouds"\nwait 0.2\nclick "Keep it in the scene"\nwait 0.5\n'
        saved = self.saved(PATH, keep)
        camera = tomllib.loads(saved)["camera"]
        self.assertEqual([key["time_s"] for key in camera["path"]][::2], [0, 600])
        self.assertEqual(len(camera["path"]), 3)
        self.assertNotIn("position_m", camera)
        self.assertEqual(camera["vertical_fov_deg"], 33)
        for key in ("first", "last"):
            frame = PATH[PATH.index(f"[[camera.path]] # {key}"):]
            frame = frame[:frame.index("target_m")]
            self.assertIn(frame, saved)
        above = PATH.replace("vertical_fov_deg = 50\n", "vertical_fov_deg = 50\nabove_ground = true\n")
        self.assertEqual(self.saved(above, 'click "tab View"\nclick "Keep it in the scene"\nwait 0.3\nexpect-control refusal\n'), above)
        broken = self.folder / "broken.toml"
        broken.write_text(PATH + "unknown = 1\n", encoding="utf-8")
        self.edit(broken, script='wait 1\nclick "tab View"\nwait 0.3\nclick "Keep it in the scene"\nwait 0.3\nexpect-control refusal\nkey CTRL+S\nwait 0.5\n')
        self.assertEqual(broken.read_text(encoding="utf-8"), PATH + "unknown = 1\n")

    def test_an_eye_keeps_its_height(self):
        text = PATH[:PATH.index("[[camera.path]]")] + "position_m = [0, -4000, 1.75]\ntarget_m = [0, 0, 1000]\n"
        self.assertEqual(self.saved(text, 'click "tab View"\nclick "Keep it in the scene"\nwait 0.3\n'), text)

    def test_a_handle_from_afar_leaves_a_size(self):
        """Dragged beyond the middle: what it writes is always above 0."""
        text = ("seed = 4\n[lattice]\ncells = [32, 32, 24]\ncell_size_m = 100\n[camera]\nposition_m = [0, -30000, 300]\ntarget_m = [0, 0, 1200]\n"
                "[field]\nellipsoids = [{ centre_m = [0, 0, 1200], semi_axes_m = [2400, 2000, 900] }]\n")
        saved = self.saved(text, 'click field\nclick field.ellipsoids\nclick field.ellipsoids[0]\nwait 0.3\ndrag "handle size x" 200 0\nwait 0.3\n'
                                 'expect-control "handle size x"\n')
        axes = tomllib.loads(saved)["field"]["ellipsoids"][0]["semi_axes_m"]
        self.assertEqual(axes[1:], [2000, 900])
        self.assertTrue(0 < axes[0] < 10, axes)

    def test_a_copy_of_a_key_frame_has_a_time_of_its_own(self):
        two = WIND + "[[wind]]\ntime_s = 100\nlevels = [{ height_m = 1000, from_deg = 240, speed_m_per_s = 7.5 }, { height_m = 2000, from_deg = 240, speed_m_per_s = 7.5 }]\n"
        saved = self.saved(two, "click wind\nclick wind[0]\nwait 0.2\nkey CTRL+D\nwait 0.3\nclick wind[2]\nclick wind[2].levels\nclick wind[2].levels[1]\nwait 0.2\nkey CTRL+D\nwait 0.3\n")
        wind = tomllib.loads(saved)["wind"]
        self.assertEqual([frame.get("time_s", 0) for frame in wind], [0, 50, 100])
        self.assertEqual([level["height_m"] for level in wind[2]["levels"]], [1000, 2000, 2500])

    def test_a_search_says_what_it_leaves_out(self):
        frames = "".join(f"[[wind]]\ntime_s = {n}\nlevels = [{{ height_m = 1000, from_deg = 250, speed_m_per_s = 7 }}]\n" for n in range(60))
        scene = self.folder / "f.toml"
        scene.write_text(f'name = "w"\n[lattice]\ncells = [16, 16, 12]\n{frames}', encoding="utf-8")
        self.edit(scene, script=self.START + 'click "tab Properties"\nwait 0.2\nset find wind\nwait 0.3\nexpect-control "more of wind"\n'
                                                 "set find wind[55]\nwait 0.3\nexpect-control wind[55].time_s\n"
                                                 "set find wind[57].time\nwait 0.3\nexpect-control wind[57].time_s\n")

    def test_of_two_marks_the_nearest_is_taken(self):
        """Those of a recorded change stand a step apart; of two at one place the one that is seen."""
        levels = "levels = [{ height_m = 1000, from_deg = 250, speed_m_per_s = 7.5 }]\n"
        winds = "".join(f"[[wind]]\ntime_s = {time}\n{levels}" for time in (0, 690, 700))
        two = f"seed = 4\n[lattice]\ncells = [16, 16, 12]\n{winds}" + "".join(
            f"[[camera.path]]\ntime_s = {time}\nposition_m = [0, {-4000 - time}, 300]\ntarget_m = [0, 0, 1000]\n" for time in (0, 690))
        for mark, key in (("wind[2]", "wind"), ("camera.path[1]", "camera")):
            saved = tomllib.loads(self.saved(two, f'drag "key frame {mark}" 90 0\nwait 0.3\nclick "key frame {mark}"\nwait 0.3\nexpect-control {mark}.time_s\n'))
            times = {"wind": [frame["time_s"] for frame in saved["wind"]], "camera": [frame["time_s"] for frame in saved["camera"]["path"]]}
            self.assertGreater(times[key].pop(), 800, mark)
            self.assertEqual(times["wind"][:2] + times["camera"][:1], [0, 690, 0])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[1:]], verbosity=2)
