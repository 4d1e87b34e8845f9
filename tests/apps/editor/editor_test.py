#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The editor as a user has it: the window under Xvfb with the software driver, under the validation layer, moved by
scripts of clicks and keys. Environment: NEPHOS the command, SOURCE the source tree, NO_LOADER a library that hides the
Vulkan loader."""

import csv
import os
import re
import subprocess
import sys
import tomllib
import unittest

from PIL import Image, ImageStat

from case import NEPHOS, PATIENCE, SOURCE, Case


# Two layers: clouds of an automaton, and above them clouds that are drawn directly, so that each kind of change shows.
LIVE_SCENE = """
name = "live"
seed = 3
[time]
step_s = 10
steps = 2000
[[model]]
name = "bank"
light_distance_m = 900
seeds = [{ size_m = [700, 600, 300], billboards = 6, billboard_width_m = [300, 500], billboard_height_m = [200, 300] }]
[[sky]]
name = "few"
state = 0
clouds = 5
models = "bank"
[[sky]]
name = "many"
state = 1
clouds = 14
models = "bank"
[[wind]]
levels = [{ height_m = 1000, from_deg = 270, speed_m_per_s = 4 }]
[[layer]]
name = "low"
skies = ["few", "many"]
base_height_m = 1000
lattice = { cells = [48, 48, 12], cell_size_m = 80, origin_m = [-1920, -1000, 900] }
[[layer]]
name = "high"
skies = ["few", "many"]
automaton = false
base_height_m = 2000
lattice = { cells = [48, 48, 12], cell_size_m = 80, origin_m = [-1920, -1000, 1900] }
[camera]
position_m = [0, -3800, 500]
target_m = [0, 400, 1400]
[sun]
elevation_deg = 30
azimuth_deg = 240
"""


class Window(Case):
    def test_screenshot(self):
        """Saves a picture of the window: panels at the sides, clouds in the middle, nothing of one colour alone."""
        picture = self.folder / "window.png"
        output = self.edit(self.scene("cumulus.toml"), "--screenshot", picture, "--after", "4", "--report", "--validation",
                           "--theme", "dark")
        self.assertIn("frames/s", output)
        with Image.open(picture) as file:
            image = file.convert("RGB")
        self.assertEqual(image.size, (1280, 800))
        view = image.crop((270, 40, 860, 560))
        sky, ground = view.crop((0, 0, 590, 100)), view.crop((0, 450, 590, 520))
        mean_sky, mean_ground = ImageStat.Stat(sky).mean, ImageStat.Stat(ground).mean
        self.assertGreater(mean_sky[2], mean_sky[0] + 20)  # blue above
        self.assertGreater(mean_ground[1], mean_ground[2])  # green below
        self.assertGreater(ImageStat.Stat(view.convert("L")).stddev[0], 20)  # clouds between
        for panel in ((5, 30, 240, 780), (900, 30, 1270, 780), (300, 640, 860, 780)):
            grey = image.crop(panel).convert("L")
            self.assertLess(ImageStat.Stat(grey).mean[0], 90)
            self.assertGreater(grey.getextrema()[1], 120)  # letters

    def test_a_screenshot_replaces_no_file_of_the_scene(self):
        scene, script, picture = self.scene("cumulus.toml"), self.folder / "clicks.txt", self.folder / "mask.png"
        script.write_text("wait 0.1\n", encoding="utf-8")
        Image.new("L", (4, 4), 255).save(picture)
        scene.write_text(scene.read_text(encoding="utf-8").replace("[ground]\n", '[ground]\nheight_map = "mask.png"\n'), encoding="utf-8")
        named, unknown = "is the file that is read", "mask.png: is there already, and may be a file of the scene"
        for path, says in ((scene, named), (script, named), (picture, named), (picture, unknown), (picture, unknown)):
            before = path.read_bytes()
            arguments = ["--script", script] if path == script else []
            said = self.edit(scene, "--screenshot", path, "--after", "0.2", *arguments, status=2)
            self.assertIn(says, said)
            self.assertEqual(path.read_bytes(), before)
            if path == picture:  # the second time the scene has a problem, the third it is no TOML
                scene.write_text(scene.read_text(encoding="utf-8").replace("seed = ", "seed = -"), encoding="utf-8")

    def test_a_screenshot_replaces_no_file_of_a_run(self):
        scene = self.scene("cumulus.toml")
        subprocess.run([NEPHOS, "run", scene, "--statistics-only", "--set", "time.steps=20", "--out", "out", "-q"], cwd=self.folder, check=True)
        table = self.folder / "out/statistics.csv"
        before = table.read_bytes()
        self.assertIn("is a file of the run in ", self.edit(scene, "--screenshot", table, "--after", "0.2", status=2))
        self.assertIn("is a file of the run in ", self.edit(scene, script="wait-step 1\nhashes out/statistics.csv\n", status=2))
        self.assertEqual(table.read_bytes(), before)

    def test_light_theme_and_large_text(self):
        picture = self.folder / "window.png"
        self.edit("--screenshot", picture, "--after", "3", "--theme", "light", "--scale", "1.5", "--validation")
        self.assertGreater(ImageStat.Stat(self.image(picture, (5, 40, 300, 780))).mean[0], 200)

    def test_sizes(self):
        """Very small, minimised, large: nothing is lost, and the validation layer is silent."""
        self.edit(self.scene("cumulus-by-hand.toml"), "--validation", script="""
            wait-step 3
            resize 200 150
            wait 0.7
            screenshot small.png
            minimise
            wait 0.7
            restore
            resize 1500 900
            wait 0.7
            screenshot large.png
            """)
        self.assertEqual(self.image("small.png").size, (200, 150))
        self.assertEqual(self.image("large.png").size, (1500, 900))

    def test_every_panel(self):
        """Opens every section of the outline, every tab, menu and mode once."""
        sections = ["lattice", "time", "field", "wind", "model", "sky", "climate", "layer", "density", "detail", "frames",
                    "camera", "sun", "light", "lightning", "air", "atmosphere", "ground", "terrain", "water", "wet_ground", "precipitation",
                    "shells", "light_shafts", "fog", "level_of_detail", "debug_view", "scene"]
        lines = ["wait-step 1", "key SPACE"]
        lines += [f"click {name}" for name in sections]
        lines += ["click tab Text", "wait 0.2", "click tab View", "wait 0.2"]
        lines += [f"click mode {mode}" for mode in ("density", "transmittance", "light only", "beauty")]
        lines += ["click Seed boxes", "click Centre axes", "click Roots", "click Light rays", "wait-picture"]
        lines += ["screenshot view.png", "key F1", "wait 0.2", "key F1", "key CTRL+R", "wait 0.2",
                  "expect-control Start the run", "click menu File", "wait 0.2", "click mode beauty", "wait 0.2", "click menu View",
                  "wait 0.2", "click menu Light", "wait 0.3", "screenshot light.png"]
        self.edit(self.scene("torchelsen/cloud-1.toml"), "--validation", script="\n".join(lines))
        dark = ImageStat.Stat(self.image("view.png", (5, 40, 200, 780))).mean[0]
        light = ImageStat.Stat(self.image("light.png", (5, 200, 200, 780))).mean[0]
        self.assertLess(dark, light - 80)

    def test_slice_of_the_bits(self):
        """Red, orange and green cells over the picture, and none of them without the slice."""
        self.edit(self.scene("cumulus-by-hand.toml"), "--validation", script="""
            wait-step 60
            key SPACE
            click tab View
            wait-picture
            screenshot without.png
            click slice of
            click choice bits
            wait 0.5
            screenshot slice.png
            """)
        with Image.open(self.folder / "without.png") as a, Image.open(self.folder / "slice.png") as b:
            box = (300, 60, 850, 550)
            reds = [sum(1 for red, green, blue in image.convert("RGB").crop(box).getdata() if red > blue + 60)
                    for image in (a, b)]
        self.assertGreater(reds[1], reds[0] + 200)

    def test_slice_of_layers_of_different_heights(self):
        """A low layer shows the highest cells that it has; the slice of the high one is where it was."""
        scene = self.folder / "heights.toml"
        scene.write_text('seed = 4\n[time]\nstep_s = 2\nsteps = 9\n[[model]]\nname = "a"\nseeds = [{ position_m = [0, 0, 200], size_m = [300, 200, 150] }]\n'
                         '[[sky]]\nname = "fair"\nstate = 0\nclouds = 8\nmodels = ["a"]\n' +
                         "".join(f'[[layer]]\nname = "{name}"\nskies = ["fair"]\nbase_height_m = {base}\nlattice = {{ cells = [16, 16, {cells}] }}\n'
                                 for name, base, cells in (("low", 200, 6), ("high", 900, 24))), encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait-step 3
            key SPACE
            wait-picture
            click layer
            click layer[1]
            click tab View
            click slice of
            click choice bits
            wait 0.5
            click-at slice 0.75 0.5
            wait 0.5
            screenshot high.png
            click layer[0]
            click tab View
            wait 0.5
            screenshot low.png
            click layer[1]
            click tab View
            wait 0.5
            screenshot again.png
            """)
        slider = (890, 560, 1265, 585)
        high, low, again = (self.image(name, slider) for name in ("high.png", "low.png", "again.png"))
        self.assertNotEqual(high.tobytes(), low.tobytes())
        self.assertEqual(high.tobytes(), again.tobytes())

    def test_handles_hodograph_and_key_frames(self):
        """Drags what can be dragged: a seed along an axis, its root's direction and opening, a point of the hodograph, a
        rain area's size, a key frame on the time line; the saved scene has what the mouse did, and nothing else."""
        scene = self.folder / "drags.toml"
        text = LIVE_SCENE.replace("billboards = 6,", "billboards = 6, roots = [{ open_yaw_deg = 60 }],")
        scene.write_text(text + "[climate]\nschedule = [{ time_s = 0, state = 0 }, { time_s = 600, state = 1 }]\n",
                         encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait-step 2
            key SPACE
            click model
            click model[0]
            click open model[0].seeds
            click model[0].seeds[0]
            wait 0.3
            drag handle move up 0 -60
            click open model[0].seeds[0].roots
            click model[0].seeds[0].roots[0]
            wait 0.3
            drag handle root direction 0 -50
            drag handle root opening sideways -30 -10
            click wind
            click wind[0]
            wait 0.3
            drag hodograph 0 0 -30
            click layer
            click layer[0]
            click layer[0].rain
            click new layer[0].rain.placed
            wait 0.3
            drag handle size x -40 0
            drag "key frame climate.schedule[1]" -60 0
            wait 0.3
            screenshot drags.png
            key CTRL+S
            wait 0.5
            """)
        before, after = tomllib.loads(text), tomllib.loads(scene.read_text(encoding="utf-8"))
        seed = after["model"][0]["seeds"][0]
        self.assertGreater(seed["position_m"][2], 50)
        self.assertEqual(seed["position_m"][:2], [0, 0])
        self.assertGreater(seed["roots"][0]["pitch_deg"], 5)
        self.assertNotEqual(seed["roots"][0]["open_yaw_deg"], 60)
        level = after["wind"][0]["levels"][0]
        self.assertNotEqual((level["from_deg"], level["speed_m_per_s"]), (270, 4))
        self.assertNotEqual(after["layer"][0]["rain"]["placed"][0].get("semi_a_m", 1000), 1000)
        self.assertLess(after["climate"]["schedule"][1]["time_s"], 600)
        self.assertEqual(after["climate"]["schedule"][1]["time_s"] % 10, 0)
        self.assertEqual(after["sun"], before["sun"])

    def test_go_to_a_cloud(self):
        """A double click on a cloud brings it nearer; beside clouds the view stays. Where clouds are depends on the step."""
        self.edit(self.scene("cumulus-by-hand.toml"), "--validation", script="""
            wait-step 60
            key SPACE
            wait-picture
            picture far.png
            double-click-at view 0.5 0.02
            wait-picture
            picture same.png
            click tab View
            click "Look at the clouds"
            wait-picture
            picture all.png
            double-click-at view 0.5 0.5
            wait-picture
            double-click-at view 0.45 0.5
            wait-picture
            double-click-at view 0.55 0.52
            wait-picture
            double-click-at view 0.4 0.48
            wait-picture
            picture near.png
            """)
        pictures = {name: self.image(name + ".png").tobytes() for name in ("far", "same", "all", "near")}
        self.assertTrue(pictures["far"] == pictures["same"])
        self.assertTrue(pictures["all"] != pictures["near"])

    def test_cubes_wireframe_and_field(self):
        """Cubes have the colours of the plots, a slab leaves some out, a wireframe has none; a probability is a slice."""
        self.edit(self.scene("cumulus-by-hand.toml"), "--validation", script="""
            wait-step 60
            key SPACE
            click tab View
            key 6
            wait 0.3
            wait-picture
            picture cubes.png
            key 5
            wait 0.3
            wait-picture
            picture wire.png
            key 1
            wait 0.3
            wait-picture
            screenshot plain.png
            click slice of
            click choice probability of hum
            wait 0.5
            screenshot field.png
            """)

        def count(name, wanted):
            with Image.open(self.folder / name) as image:
                return sum(1 for pixel in image.convert("RGB").getdata() if wanted(*pixel))

        def is_red(red, green, blue):
            return red > green + 60 and red > blue + 60

        self.assertGreater(count("cubes.png", is_red), 500)
        self.assertEqual(count("wire.png", is_red), 0)
        self.assertGreater(count("wire.png", lambda red, green, blue: blue > 120 and blue > red + 20), 300)
        self.assertGreater(count("field.png", is_red), count("plain.png", is_red) + 100)

    def test_keys_in_turn_are_as_many_steps(self):
        """Also where a step is long, and the next key comes before it is taken; and by the buttons."""
        scene = self.folder / "long.toml"
        scene.write_text("seed = 4\n[lattice]\ncells = [256, 256, 128]\n[time]\nsteps = 40\n", encoding="utf-8")
        self.edit(scene, script="wait 0.5\nkey SPACE\nkey HOME\n" + 6 * "key .\n" + "wait-step 6\npicture shown-%.png\n"
                  + 3 * "key ,\n" + "click >\n" + 2 * "click <\n" + "wait 0.5\nwait-picture\npicture shown-%.png\n")
        self.assertEqual(sorted(path.name for path in self.folder.glob("shown-*.png")), ["shown-2.png", "shown-6.png"])

    def test_checkpoints_in_turn_go_back_one_by_one(self):
        """Also where a step is long, and the next key comes before it is taken."""
        scene = self.folder / "long.toml"
        scene.write_text("seed = 4\n[lattice]\ncells = [256, 256, 128]\n[time]\nsteps = 40\n", encoding="utf-8")
        marks = "".join("key .\n" * 2 + f"wait-step {step}\nwait-picture\nkey M\n" for step in (2, 4, 6))
        self.edit(scene, script="wait 0.5\nkey SPACE\nkey HOME\nwait-step 0\n" + marks + 2 * "key B\n" + "wait 0.5\nwait-picture\npicture shown-%.png\n")
        self.assertEqual([path.name for path in self.folder.glob("shown-*.png")], ["shown-2.png"])

    def test_slider_shows_in_the_picture(self):
        """A sun below the horizon darkens the picture, and undo brings the day back."""
        self.edit(self.scene("cumulus-by-hand.toml"), "--validation", script="""
            wait-step 2
            key SPACE
            click sun
            wait-picture
            screenshot day.png
            set sun.elevation_deg -8
            wait-picture
            screenshot night.png
            key ESCAPE
            click scene
            key CTRL+Z
            wait-picture
            screenshot again.png
            """)

        def brightness(name):
            return ImageStat.Stat(self.image(name, (300, 60, 850, 550))).mean[0]

        self.assertLess(brightness("night.png"), brightness("day.png") - 40)
        self.assertAlmostEqual(brightness("again.png"), brightness("day.png"), delta=8)  # day.png may be a step earlier


class Story(Case):
    def test_a_sky_from_nothing(self):
        """T's chapter 3: a cloud of 15 seeds, a sky of it, a simulation in a layer, a wind that is changed while it
        runs; saved, and simulated again from the file with the same state hashes as the window showed."""
        new_seeds = "\n".join(["click new model[0].seeds\nwait 0.15"] * 14)
        script = f"""
            wait-step 1
            key SPACE
            click new model
            {new_seeds}
            click model[0]
            set model[0].name bank
            click new sky
            set sky[0].clouds 12
            click new layer
            wait 0.5
            click field
            click wind
            """
        # The scene of a first start has a field of its own, which layers exclude: begin with an empty one.
        scene = self.folder / "sky.toml"
        scene.write_text('name = "sky"\nseed = 7\n[lattice]\ncells = [64, 64, 16]\ncell_size_m = 60\n'
                         'origin_m = [-1920, -1920, 900]\n[[wind]]\nlevels = [{ height_m = 1000, from_deg = 270, '
                         'speed_m_per_s = 4 }]\n', encoding="utf-8")
        script += """
            click tab View
            click Record as key frames
            click tab Properties
            click wind
            click wind[0]
            click open wind[0].levels
            wait 0.3
            click wind[0].levels[0]
            key SPACE
            wait-step 12
            set wind[0].levels[0].speed_m_per_s 15
            wait-step 40
            key SPACE
            wait-picture
            screenshot story.png
            hashes seen.txt
            key CTRL+S
            wait 0.5
            """
        self.edit(scene, "--validation", script=script)
        text = scene.read_text(encoding="utf-8")
        self.assertEqual(text.count("[[model]]"), 1, text)
        self.assertIn('name = "bank"', text)
        self.assertIn('models = ["bank"]', text)
        model = tomllib.loads(text)["model"][0]
        self.assertEqual(len(model["seeds"]), 15, text)
        self.assertGreaterEqual(text.count("[[wind]]"), 3, text)  # before, until then, from then on
        seen = (self.folder / "seen.txt").read_text(encoding="utf-8").splitlines()
        self.assertGreater(len(seen), 40)
        last = len(seen) - 1
        replay = subprocess.run([NEPHOS, "hash", str(scene), "--steps", str(last)], capture_output=True, text=True,
                                check=True).stdout.splitlines()
        self.assertEqual(replay, seen)

    def replayed(self, scene, step, size):
        """The picture of a step as `nephos run` draws it from the saved scene, of the size that the window showed."""
        out = self.folder / f"replay-{step}"
        number = f"{step + 1}..{step + 1}"  # frames count from 1, steps from 0
        subprocess.run([NEPHOS, "run", str(scene), "--out", str(out), "--quiet", "--splatting", "cpu", "--frames", number,
                        "--set", "frames.start_s=0", "--set", "frames.per_second=1", "--set", "frames.time_scale=10",
                        "--set", f"camera.width={size[0]}", "--set", f"camera.height={size[1]}"], check=True)
        (picture,) = out.glob("frames/*.png")
        with Image.open(picture) as image:
            return image.convert("RGB")

    def test_live_changes_are_replayed(self):
        """Wind, climate, lightning and the clouds that follow the light in a frame, all changed while the scene runs: the
        saved scene has the window's state hashes at every step, and its pictures before, at and after the changes."""
        scene = self.folder / "live.toml"
        scene.write_text(LIVE_SCENE, encoding="utf-8")
        self.edit(scene, "--validation", size="1100x760", script="""
            wait-step 1
            click tab View
            click "Record as key frames"
            click tab Properties
            click wind
            click wind[0]
            click open wind[0].levels
            wait 0.3
            click wind[0].levels[0]
            wait-step 6
            set wind[0].levels[0].speed_m_per_s 15
            wait-step 12
            click tab View
            set "final state" 1
            click "Start the change now"
            wait-step 20
            key SPACE
            click tab Properties
            click light
            set light.cfa_clouds_per_frame 2
            click tab View
            click "Lightning where I click"
            click-at view 0.5 0.45
            wait 0.3
            wait-picture
            picture shown-%.png
            key SPACE
            wait-step 36
            key SPACE
            wait-picture
            picture shown-%.png
            set "time line" 3
            wait-picture
            picture shown-%.png
            set "time line" 15
            wait-picture
            picture shown-%.png
            hashes seen.txt
            key CTRL+S
            wait 0.5
            """)
        saved = tomllib.loads(scene.read_text(encoding="utf-8"))
        self.assertGreaterEqual(len(saved["wind"]), 3)
        self.assertGreaterEqual(len(saved["climate"]["schedule"]), 2)
        self.assertEqual(saved["light"]["cfa_clouds_per_frame"], 2)
        flash = saved["lightning"][0]
        seen = (self.folder / "seen.txt").read_text(encoding="utf-8").splitlines()
        replay = subprocess.run([NEPHOS, "hash", str(scene), "--steps", str(len(seen) - 1)], capture_output=True, text=True,
                                check=True).stdout.splitlines()
        self.assertEqual(replay, seen)
        shown = {int(path.stem.split("-")[1]): path for path in self.folder.glob("shown-*.png")}
        self.assertEqual(len(shown), 4, shown)
        self.assertIn(flash["time_s"] / 10, shown)  # the flash burns in one of them
        for step, path in sorted(shown.items()):
            with Image.open(path) as image:
                window = image.convert("RGB")
            self.assertTrue(self.replayed(scene, step, window.size).tobytes() == window.tobytes(), f"step {step}")

    def test_a_sun_that_is_moved_is_replayed(self):
        """The sun is dragged on its dial and typed while the scene runs and stands, below the horizon too, with clouds that
        follow it in turn: the saved scene has key frames of it, and the window's pictures before, at and after each."""
        scene = self.folder / "sun.toml"
        scene.write_text(LIVE_SCENE + "[light]\ncfa_clouds_per_frame = 2\n", encoding="utf-8")
        self.edit(scene, "--validation", size="1100x900", script="""
            wait-step 1
            click tab View
            click "Record as key frames"
            wait-step 8
            click-at "sun dial in view" 0.9 0.5
            wait-step 14
            key SPACE
            wait-picture
            click tab Properties
            click sun
            set sun.elevation_deg 4
            wait-picture
            click-at "sun dial" 0.2 0.45
            wait-picture
            picture shown-%.png
            key .
            wait-picture
            set sun.elevation_deg -9
            wait-picture
            picture shown-%.png
            key SPACE
            wait-step 24
            key SPACE
            wait-picture
            picture shown-%.png
            set "time line" 7
            wait-picture
            picture shown-%.png
            hashes seen.txt
            screenshot sun.png
            key CTRL+S
            wait 0.5
            """)
        saved = tomllib.loads(scene.read_text(encoding="utf-8"))
        self.assertEqual(saved["sun"]["elevation_deg"], 30)  # as before the first change
        path = saved["sun"]["path"]
        self.assertGreaterEqual(len(path), 5, path)
        self.assertEqual(path[0]["elevation_deg"], 30)
        self.assertEqual(path[-1]["elevation_deg"], -9)
        self.assertEqual(path[-1]["time_s"] % 10, 0)
        self.assertEqual(len({key["azimuth_deg"] for key in path}), 3, path)
        seen = (self.folder / "seen.txt").read_text(encoding="utf-8").splitlines()
        replay = subprocess.run([NEPHOS, "hash", str(scene), "--steps", str(len(seen) - 1)], capture_output=True, text=True,
                                check=True).stdout.splitlines()
        self.assertEqual(replay, seen)
        shown = {int(path.stem.split("-")[1]): path for path in self.folder.glob("shown-*.png")}
        self.assertGreaterEqual(len(shown), 4, shown)
        for step, path in sorted(shown.items()):
            with Image.open(path) as image:
                window = image.convert("RGB")
            self.assertTrue(self.replayed(scene, step, window.size).tobytes() == window.tobytes(), f"step {step}")

    def test_save_keeps_what_was_not_touched(self):
        """One slider and a save: one line of the file differs."""
        scene = self.scene("cumulus.toml")
        before = scene.read_text(encoding="utf-8").splitlines()
        self.edit(scene, script="""
            wait-step 1
            click sun
            set sun.elevation_deg 21
            wait 0.3
            key CTRL+S
            wait 0.5
            """)
        after = scene.read_text(encoding="utf-8").splitlines()
        self.assertEqual(len(before), len(after))
        changed = [(a, b) for a, b in zip(before, after) if a != b]
        self.assertEqual(changed, [("elevation_deg = 38", "elevation_deg = 21")])

    def test_problem_is_shown_and_the_last_good_scene_stays(self):
        scene = self.folder / "a.toml"
        scene.write_text("seed = 1\n[lattice]\ncells = [32, 32, 12]\n", encoding="utf-8")
        self.edit(scene, script="""
            wait-step 1
            click tab Text
            click text
            type [sun
            wait 0.4
            expect-control problems
            wait-step 3
            screenshot problem.png
            """)


class Together(Case):
    def test_simulations_side_by_side(self):
        """A copy of a scene and a new one run beside it, each on its own clock; changing one leaves the other as it is; each
        has the state hashes of `nephos hash`; closing asks about unsaved edits of all."""
        scene = self.folder / "one.toml"
        scene.write_text(LIVE_SCENE, encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait-step 3
            click "copy simulation"
            wait-step 5
            click wind
            click wind[0]
            click open wind[0].levels
            wait 0.3
            click wind[0].levels[0]
            set wind[0].levels[0].speed_m_per_s 9
            wait-step 12
            key CTRL+S
            set "file name" two.toml
            wait 0.3
            hashes two.txt
            click "new simulation"
            wait-step 6
            click "run simulation 3"
            click "simulation 1"
            wait-step 15
            click "run all simulations"
            wait 0.3
            hashes one.txt
            wait-picture
            screenshot three.png
            click sun
            set sun.elevation_deg 21
            click "delete simulation 3"
            wait 0.3
            click "simulation 1"
            wait-picture
            key CTRL+Q
            wait 0.3
            expect-control "unsaved one.toml"
            click "Save them"
            wait 0.5
            """)
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))
        two = tomllib.loads((self.folder / "two.toml").read_text(encoding="utf-8"))
        self.assertEqual(two["wind"][0]["levels"][0]["speed_m_per_s"], 9)
        for name in ("one", "two"):
            seen = (self.folder / f"{name}.txt").read_text(encoding="utf-8").splitlines()
            self.assertGreater(len(seen), 12, name)
            replay = subprocess.run([NEPHOS, "hash", str(self.folder / f"{name}.toml"), "--steps", str(len(seen) - 1)],
                                    capture_output=True, text=True, check=True).stdout.splitlines()
            self.assertEqual(replay, seen, name)
        one = (self.folder / "one.txt").read_text(encoding="utf-8").splitlines()
        two = (self.folder / "two.txt").read_text(encoding="utf-8").splitlines()
        self.assertNotEqual(one[12], two[12])

    def test_files_are_chosen_and_exported(self):
        """A texture is chosen in the file dialog, which shows it; one without transparency is said to be none; a wind field's
        file likewise. The present grid is exported beside the window."""
        pictures = self.folder / "pictures"
        pictures.mkdir()
        Image.new("RGBA", (64, 48), (255, 255, 255, 128)).save(pictures / "soft.png")
        Image.new("RGB", (64, 48), (255, 255, 255)).save(pictures / "opaque.png")
        scene = self.folder / "files.toml"
        scene.write_text(LIVE_SCENE, encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait-step 2
            key SPACE
            click model
            click model[0]
            click "file of model[0].textures"
            wait 0.3
            click "file pictures"
            wait 0.3
            click "file opaque.png"
            expect-control "problem of opaque.png"
            click "file soft.png"
            expect-control "preview of soft.png"
            screenshot choice.png
            click Choose
            wait 0.3
            wait-picture
            click menu File
            click "menu Export the grid..."
            set "file name" grid.vdb
            wait 2
            key CTRL+S
            wait 0.5
            click new wind_field
            wait 0.3
            click "file of wind_field[0].files"
            wait 0.3
            click "file grid.vdb"
            expect-control "preview of grid.vdb"
            click Cancel
            wait 0.3
            """)
        saved = tomllib.loads(scene.read_text(encoding="utf-8"))
        self.assertEqual(saved["model"][0]["textures"], ["pictures/soft.png"])
        info = subprocess.run([NEPHOS, "info", str(self.folder / "grid.vdb")], capture_output=True, text=True, check=True)
        self.assertIn("density", info.stdout)


class Tutorial(Case):
    def test_the_page_leads_from_nothing_to_rain(self):
        """The walk of docs/editor.md, click by click: the page names every value of the script, each step has its picture, and
        the saved scene has the window's state hashes and rains."""
        script = (SOURCE / "tests/apps/editor/tutorial.txt").read_text(encoding="utf-8")
        page = (SOURCE / "docs/editor.md").read_text(encoding="utf-8")
        page = page[page.index("## From nothing to a sky of rain"):page.index("## Clouds from base models")]
        words = set(re.findall(r"[-\w.]*\w", page))
        for line in script.splitlines():
            if line.startswith("set "):
                self.assertIn(line.split()[-1], words, line)
        self.edit("--validation", script=script)
        for step in range(1, 10):
            self.assertIn(f"pictures/tutorial-{step}.jpg", page)
            self.assertGreater(ImageStat.Stat(self.image(f"tutorial-{step}.png", (300, 60, 850, 500))).stddev[0], 5, step)
        scene = self.folder / "SKY.toml"
        seen = (self.folder / "tutorial-hashes.txt").read_text(encoding="utf-8").splitlines()
        self.assertGreater(len(seen), 200)
        replay = subprocess.run([NEPHOS, "hash", str(scene), "--steps", str(len(seen) - 1)], capture_output=True, text=True,
                                check=True).stdout.splitlines()
        self.assertEqual(replay, seen)
        subprocess.run([NEPHOS, "run", str(scene), "--quiet", "--statistics-only", "--out", str(self.folder / "out"),
                        "--set", f"time.steps={len(seen) - 1}"], check=True)
        with open(self.folder / "out/statistics/low.csv", encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(float(rows[50]["rain_mm_per_h"]), 0)
        self.assertGreater(float(rows[-1]["rain_mm_per_h"]), 5)


class Wild(Case):
    def test_two_thousand_random_inputs(self):
        """Clicks, drags and keys at random: no crash, no message of the validation layer, no frame of two seconds. Files
        are not written: dialogs have no folder to save into but the test's own. They open up to eight simulations: beside
        other work that takes minutes."""
        output = self.edit(self.scene("torchelsen/cloud-1.toml"), "--validation", "--report", size="1000x640", timeout=840,
                           script="wait-step 1\nrandom 2000 20261122\n")
        longest = int(re.search(r"longest frame (\d+) ms", output).group(1))
        self.assertLess(longest, 2000, output)


class Failures(Case):
    def test_no_display(self):
        output = self.edit(display=False, status=4, environment={"DISPLAY": "", "WAYLAND_DISPLAY": ""})
        self.assertIn("no window can be opened", output)
        self.assertIn("xvfb-run", output)

    def test_no_driver(self):
        """A machine without a Vulkan driver, and one whose driver is broken."""
        nothing = self.folder / "none.json"
        output = self.edit("--screenshot", "x.png", status=4, environment={"VK_ICD_FILENAMES": str(nothing)})
        self.assertIn("mesa-vulkan-drivers", output)
        broken = self.folder / "broken.json"
        broken.write_text('{"file_format_version": "1.0.0", "ICD": {"library_path": "/nowhere/lib.so", "api_version": '
                          '"1.3.0"}}', encoding="utf-8")
        output = self.edit("--screenshot", "x.png", status=4, environment={"VK_ICD_FILENAMES": str(broken)})
        self.assertIn("mesa-vulkan-drivers", output)

    def test_lost_device(self):
        """A graphics card that is lost after an edit (lost_device_layer.cpp): the program says so and ends, the edit is
        kept beside the scene, the scene's own file stays as it was, and the next session offers the edit."""
        scene = self.scene("cumulus-by-hand.toml")
        before = scene.read_bytes()
        lost = self.folder / "lost.txt"
        output = self.edit(scene, status=4, script=f"""
            wait-step 1
            click sun
            set sun.elevation_deg 21
            wait 0.3
            hashes {lost}
            wait 60
            """, environment={"VK_LAYER_PATH": os.environ["LAYERS"],
                              "VK_INSTANCE_LAYERS": "VK_LAYER_NEPHOS_lost_device",
                              "NEPHOS_LOSE_DEVICE_WHEN": str(lost)})
        self.assertIn("the graphics device was lost", output)
        self.assertIn("unsaved edits are kept", output)
        self.assertEqual(scene.read_bytes(), before)
        kept = list(self.folder.glob(".*.autosave"))
        self.assertEqual(len(kept), 1, list(self.folder.iterdir()))
        self.assertIn("elevation_deg = 21", kept[0].read_text(encoding="utf-8"))
        self.edit(scene, script="wait 0.5\nexpect-control Take them\nclick Take them\nwait 0.3\nkey CTRL+S\nwait 0.5\n")
        self.assertIn("elevation_deg = 21", scene.read_text(encoding="utf-8"))

    def test_memory_of_the_device_ends_in_any_call(self):
        """Also in those that the library of the window makes, which then has half of what it frees."""
        failures = 0
        for allocations in range(8, 22):
            scene = self.scene("cumulus.toml")
            script = """
                wait-step 1
                click sun
                set sun.elevation_deg 21
                wait 0.3
                resize 900 700
                wait 0.3
                resize 1200 800
                wait 0.3
                key CTRL+S
                wait 0.3
                """
            environment = {"VK_LAYER_PATH": os.environ["LAYERS"], "VK_INSTANCE_LAYERS": "VK_LAYER_NEPHOS_lost_device",
                           "NEPHOS_REFUSE_MEMORY_AFTER": str(allocations)}
            done = subprocess.run(self.command(scene, script=script), capture_output=True, text=True, timeout=PATIENCE, cwd=self.folder,
                                  env={**self.environment, **environment}, check=False)
            self.assertIn(done.returncode, (0, 4), (allocations, done.stdout + done.stderr))
            failures += done.returncode == 4
            if done.returncode == 4:
                self.assertIn("the graphics device failed", done.stderr)
        self.assertGreater(failures, 3)

    def test_pictures_while_the_window_shows_none(self):
        """They wait for the next frame that it shows; where none comes the editor says so."""
        scene = self.scene("cumulus-by-hand.toml")
        layer = {"VK_LAYER_PATH": os.environ["LAYERS"], "VK_INSTANCE_LAYERS": "VK_LAYER_NEPHOS_lost_device"}
        script = "screenshot first.png\nwait-step 1\nkey SPACE\nclick scene\n" + 250 * "screenshot many.png\n" + "".join(f"set seed {seed}\nwait 0.2\nscreenshot {seed}.png\n" for seed in range(100, 108))
        self.edit(scene, script=script, environment={**layer, "NEPHOS_SHOW_EVERY": "3"})
        pictures = {(self.folder / f"{seed}.png").read_bytes() for seed in range(100, 108)}
        self.assertEqual(len(pictures), 8)
        self.edit(scene, "--screenshot", "all.png", environment={**layer, "NEPHOS_SHOW_EVERY": "3"})
        self.assertEqual(self.image("all.png").size, (1280, 800))
        for arguments in ({"script": "wait-step 1\nscreenshot none.png\n"}, {}):
            options = () if arguments else ("--screenshot", "none.png")
            said = self.edit(scene, *options, status=4, environment={**layer, "NEPHOS_SHOW_EVERY": "0"}, **arguments)
            self.assertIn("none.png: the window showed no picture for 10 seconds", said)
        # That the user has asked for is not worth the edits.
        self.edit(scene, environment={**layer, "NEPHOS_SHOW_EVERY": "0"}, script="""
            wait-step 1
            key F12
            wait 0.5
            set "file name" mine.png
            wait 1
            expect-control refusal
            """)
        self.assertFalse((self.folder / "mine.png").exists())

    def test_scenes(self):
        self.assertIn("no/such.toml", self.edit("no/such.toml", status=3))
        empty = self.folder / "empty"
        empty.mkdir()
        self.assertIn("no scene", self.edit(empty, status=2))

    def test_a_scene_with_problems_opens(self):
        scene = self.folder / "bad.toml"
        scene.write_text("[sun]\nelevation_deg = 95\n", encoding="utf-8")
        self.edit(scene, script="wait 1\nexpect-control problems\nscreenshot bad.png\n")

    def test_script(self):
        self.assertIn("no command", self.edit(script="fly away\n", status=2))
        for line in ('type new "name', 'click "abc'):
            self.assertIn("a quotation mark that is not closed", self.edit(script=f"{line}\n", status=2))
        self.assertIn("no control", self.edit(script="click nothing of that name\n", status=1))

    def test_lines_behind_the_end_are_told(self):
        """What was expected there was not looked at; but nothing is missed behind `quit`, and by what waits for the end."""
        said = self.edit(script="wait 1\nclose-window\nwait 5\nexpect-control \"unsaved nothing.toml\"\n", status=1)
        self.assertIn("script.txt:4: `expect-control unsaved nothing.toml` was not reached: the editor had ended before", said)
        self.edit(script="wait 1\nclose-window\nwait 5\nexpect-end\n")
        self.edit(script="wait 1\nquit\nclick nothing\n")
        said = self.edit("--screenshot", "never.png", "--after", "60", script="wait-step 1\nwait-picture\nclose-window\nwait 9\n", status=3)
        self.assertIn("never.png: no picture was made: the editor had ended before", said)
        self.assertIn("script.txt:2: waited too long for the end", self.edit(script="wait 1\nexpect-end\n", status=1))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *[f"{name}" for name in sys.argv[1:]]], verbosity=2)
