#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Every control of the editor and the simulator of T, printed in his figures 22 to 28 or implied by his text: each is
reached by its name, and what it does is in the saved scene or in the picture. See case.py."""

import subprocess
import sys
import tomllib
import unittest

from PIL import Image, ImageChops

from case import NEPHOS, Case

# Clouds that are drawn directly, as T's.
SCENE = """name = "torchelsen"
seed = 4
[time]
step_s = 10
[[model]]
name = "bank"
light_distance_m = 900
seeds = [{ size_m = [700, 600, 300], billboards = 8, billboard_width_m = [200, 400], billboard_height_m = [150, 250], \
roots = [{ pitch_deg = 30, open_yaw_deg = 360, seeds_start = 3, seeds_end = 2, reproductions = [1, 2] }] }]
[[sky]]
name = "few"
state = 0
clouds = 4
models = "bank"
[[layer]]
name = "low"
skies = "few"
automaton = false
base_height_m = 1000
lattice = { cells = [40, 40, 8], cell_size_m = 80, origin_m = [-1600, -1600, 900] }
[camera]
position_m = [0, -3200, 700]
target_m = [0, 0, 1150]
[sun]
elevation_deg = 40
azimuth_deg = 200
"""


def near(colour, wanted, most=60):
    return all(abs(a - b) <= most for a, b in zip(colour, wanted))


class Torchelsen(Case):
    def walk(self, script, **more):
        """Opens SCENE, walks, saves; returns the saved scene."""
        scene = self.folder / "sky.toml"
        scene.write_text(SCENE, encoding="utf-8")
        self.edit(scene, "--validation", script=f"wait-step 1\nkey SPACE\n{script}\nkey CTRL+S\nwait 0.5\n", **more)
        checked = subprocess.run([NEPHOS, "validate", str(scene)], capture_output=True, text=True, check=False)
        self.assertEqual(checked.returncode, 0, checked.stderr + scene.read_text(encoding="utf-8"))
        return tomllib.loads(scene.read_text(encoding="utf-8"))

    def test_cloud_screen(self):
        """Figure 23: the list of clouds with New, copy, rename and delete, the light distance up to infinity, textures,
        billboards and their sizes."""
        saved = self.walk("""
            click model
            click model[0]
            set model[0].name heap
            click "model[0].light_distance_m infinite"
            key CTRL+D
            expect-control model[1]
            click "model[1].light_distance_m infinite"
            set model[1].light_distance_m 700
            click new model
            expect-control model[2]
            set model[2].name third
            click model[2]
            key DELETE
            wait 0.3
            click model[0]
            click open model[0].seeds
            click model[0].seeds[0]
            click model[0].seeds[0].texture
            click choice dense
            set model[0].seeds[0].billboards[0] 5
            set model[0].seeds[0].billboards[1] 9
            set model[0].seeds[0].billboard_width_m[0] 250
            set model[0].seeds[0].billboard_width_m[1] 450
            set model[0].seeds[0].billboard_height_m[0] 120
            set model[0].seeds[0].billboard_height_m[1] 260
            """)
        self.assertEqual([model["name"] for model in saved["model"]][0], "heap")
        self.assertEqual(len(saved["model"]), 2)
        self.assertEqual(saved["sky"][0]["models"], "heap")  # renaming keeps the users
        self.assertEqual(saved["model"][0]["light_distance_m"], float("inf"))
        self.assertEqual(saved["model"][1]["light_distance_m"], 700)
        seed = saved["model"][0]["seeds"][0]
        self.assertEqual(seed["texture"], "dense")
        self.assertEqual(seed["billboards"], [5, 9])
        self.assertEqual(seed["billboard_width_m"], [250, 450])
        self.assertEqual(seed["billboard_height_m"], [120, 260])

    def test_seeds_and_roots(self):
        """Figure 24: seeds with New, Delete and Copy New, size and position; roots with the same, pitch, yaw and their
        opening, seeds at the start and the end, reproductions."""
        saved = self.walk("""
            click model
            click model[0]
            click new model[0].seeds
            expect-control model[0].seeds[1]
            key CTRL+D
            expect-control model[0].seeds[2]
            key DELETE
            wait 0.3
            click model[0].seeds[1]
            set model[0].seeds[1].size_m[0] 400
            set model[0].seeds[1].size_m[1] 350
            set model[0].seeds[1].size_m[2] 250
            set model[0].seeds[1].position_m[0] 120
            set model[0].seeds[1].position_m[1] -80
            set model[0].seeds[1].position_m[2] 90
            click new model[0].seeds[1].roots
            expect-control model[0].seeds[1].roots[0]
            key CTRL+D
            expect-control model[0].seeds[1].roots[1]
            key DELETE
            wait 0.3
            click model[0].seeds[1].roots[0]
            set model[0].seeds[1].roots[0].pitch_deg 20
            set model[0].seeds[1].roots[0].yaw_deg 45
            set model[0].seeds[1].roots[0].open_pitch_deg 80
            set model[0].seeds[1].roots[0].open_yaw_deg 120
            set model[0].seeds[1].roots[0].seeds_start 4
            set model[0].seeds[1].roots[0].seeds_end 8
            set model[0].seeds[1].roots[0].reproductions[0] 2
            set model[0].seeds[1].roots[0].reproductions[1] 3
            """)
        seeds = saved["model"][0]["seeds"]
        self.assertEqual(len(seeds), 2)
        self.assertEqual(seeds[1]["size_m"], [400, 350, 250])
        self.assertEqual(seeds[1]["position_m"], [120, -80, 90])
        self.assertEqual(len(seeds[1]["roots"]), 1)
        root = seeds[1]["roots"][0]
        wanted = {"pitch_deg": 20, "yaw_deg": 45, "open_pitch_deg": 80, "open_yaw_deg": 120, "seeds_start": 4,
                  "seeds_end": 8, "reproductions": [2, 3]}
        self.assertEqual({key: root.get(key) for key in wanted}, wanted)

    def test_skies_and_simulations(self):
        """Figures 25 to 27: skies with state, number and models; layers with skies, base height, area and formation; the
        atmosphere at the start; simulations that are added, copied, run and stopped, and the list of layers that run."""
        saved = self.walk("""
            click new sky
            set sky[1].name many
            set sky[1].state 1
            set sky[1].clouds 9
            click layer
            click layer[0]
            click layer[0].skies
            click choice many
            click find
            set layer[0].base_height_m[0] 1100
            set layer[0].base_height_m[1] 1300
            set layer[0].lattice.cells[0] 48
            set layer[0].lattice.origin_m[0] -1920
            click climate
            set climate.initial_state 0.25
            click new layer
            set layer[1].name high
            set layer[1].base_height_m[0] 600
            set layer[1].base_height_m[1] 600
            click tab View
            expect-control "low##simulation"
            click "high##simulation"
            wait 0.3
            click "high##simulation"
            click "copy simulation"
            expect-control "simulation 2"
            click "run all simulations"
            wait 0.5
            click "run all simulations"
            click "simulation 1"
            """)
        self.assertEqual(saved["sky"][1]["state"], 1)
        self.assertEqual(saved["sky"][1]["clouds"], 9)
        layer = saved["layer"][0]
        self.assertEqual(layer["skies"], ["few", "many"])
        self.assertEqual(layer["base_height_m"], [1100, 1300])
        self.assertEqual(layer["lattice"]["cells"], [48, 40, 8])
        self.assertEqual(layer["lattice"]["origin_m"], [-1920, -1600, 900])
        self.assertEqual(saved["climate"]["initial_state"], 0.25)
        self.assertEqual([one["name"] for one in saved["layer"]], ["low", "high"])

    def test_what_the_clouds_consist_of(self):
        """Figure 28: seed boxes and roots blue, the centre's axes red, green and blue, rays of the light yellow, and red
        inside of boxes; each is a toggle that changes the picture."""
        toggles = ["Seed boxes", "Centre axes", "Roots", "Light rays"]
        self.walk("click tab View\nwait-picture\npicture plain.png\n" + "".join(
            f'click "{name}"\nwait-picture\npicture only-{n}.png\nclick "{name}"\n' for n, name in enumerate(toggles)))
        with Image.open(self.folder / "plain.png") as image:
            plain = image.convert("RGB")
        wanted = [[(40, 80, 255)], [(255, 50, 50), (50, 220, 50), (60, 90, 255)], [(40, 80, 255)],
                  [(255, 230, 40), (255, 50, 40)]]
        for n, colours in enumerate(wanted):
            with Image.open(self.folder / f"only-{n}.png") as image:
                lines = image.convert("RGB")
            changed = ImageChops.difference(plain, lines).convert("L").point(lambda value: 255 if value > 20 else 0)
            pixels = [colour for colour, mask in zip(lines.getdata(), changed.getdata()) if mask]
            for colour in colours:
                count = sum(1 for pixel in pixels if near(pixel, colour, 90))
                self.assertGreater(count, 20, f"{toggles[n]}: {colour} of {len(pixels)}")

    def test_ways_to_show_camera_and_rates(self):
        """The six ways to show the clouds differ; the camera goes round, flies and comes nearer; the status bar has the
        rates; the scene's camera is as it was, until it is kept."""
        saved = self.walk("""
            wait-picture
            picture mode-1.png
            key 2
            wait-picture
            picture mode-2.png
            key 3
            wait-picture
            picture mode-3.png
            key 4
            wait-picture
            picture mode-4.png
            key 5
            wait-picture
            picture mode-5.png
            key 6
            wait-picture
            picture mode-6.png
            key 1
            expect-control rates
            drag view 120 30
            wait-picture
            picture round.png
            click menu View
            click menu Keep this camera in the scene
            """)
        pictures = {}
        for name in ["mode-1", "mode-2", "mode-3", "mode-4", "mode-5", "round"]:
            with Image.open(self.folder / f"{name}.png") as image:
                pictures[name] = image.convert("RGB").tobytes()
        self.assertEqual(len(set(pictures.values())), len(pictures), "two ways show the same")
        self.assertNotEqual(saved["camera"]["position_m"], [0, -3200, 700])
        self.assertEqual(saved["camera"]["target_m"], [0, 0, 1150])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[1:]])
