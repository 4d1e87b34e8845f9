#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The editor as a user has it: the window under Xvfb with the software driver, under the validation layer, moved by
scripts of clicks and keys. Environment: NEPHOS the command, SOURCE the source tree, NO_LOADER a library that hides the
Vulkan loader."""

import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import unittest

from PIL import Image, ImageStat

NEPHOS = os.environ["NEPHOS"]
SOURCE = pathlib.Path(os.environ["SOURCE"])


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="nephos-editor-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.environment = {**os.environ, "XDG_CONFIG_HOME": str(self.folder / "config"), "VK_LOADER_LAYERS_ENABLE": ""}

    def edit(self, *arguments, script=None, status=0, display=True, size="1280x800", environment=None):
        """Runs the editor; returns what it printed. A hang ends it after four minutes."""
        command = [NEPHOS, "edit", *map(str, arguments)]
        if script is not None:
            path = self.folder / "script.txt"
            path.write_text(script, encoding="utf-8")
            command += ["--script", str(path)]
        if display:
            command += ["--size", size]
            command = ["xvfb-run", "-a", "-s", "-screen 0 1600x1000x24", *command]
        done = subprocess.run(command, capture_output=True, text=True, timeout=240, cwd=self.folder,
                              env={**self.environment, **(environment or {})}, check=False)
        output = done.stdout + done.stderr
        self.assertEqual(done.returncode, status, output)
        return output

    def image(self, name, box=None):
        """A picture of the test's folder in grey, or a part of it."""
        with Image.open(self.folder / name) as image:
            return image.convert("L").crop(box or (0, 0, *image.size))

    def scene(self, name):
        """A copy of a shipped scene in the test's folder."""
        text = (SOURCE / "scenes" / name).read_text(encoding="utf-8")
        path = self.folder / pathlib.Path(name).name
        path.write_text(text, encoding="utf-8")
        return path


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
                    "camera", "sun", "light", "lightning", "air", "atmosphere", "ground", "wet_ground", "precipitation",
                    "shells", "light_shafts", "fog", "level_of_detail", "debug_view", "scene"]
        lines = ["wait-step 1", "key SPACE"]
        lines += [f"click {name}" for name in sections]
        lines += ["click tab Text", "wait 0.2", "click tab View", "wait 0.2"]
        lines += [f"click mode {mode}" for mode in ("density", "transmittance", "light only", "beauty")]
        lines += ["click Seed boxes", "click Centre axes", "click Roots", "click Light rays", "wait-picture"]
        lines += ["screenshot view.png", "key F1", "wait 0.2", "key F1", "key CTRL+R", "wait 0.2",
                  "expect-control Start the run", "click menu File", "wait 0.2", "click scene", "wait 0.2", "click menu View",
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
            click Slice of the bits
            wait 0.5
            screenshot slice.png
            """)
        with Image.open(self.folder / "without.png") as a, Image.open(self.folder / "slice.png") as b:
            box = (300, 60, 850, 550)
            reds = [sum(1 for red, green, blue in image.convert("RGB").crop(box).getdata() if red > blue + 60)
                    for image in (a, b)]
        self.assertGreater(reds[1], reds[0] + 200)

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
        self.assertAlmostEqual(brightness("again.png"), brightness("day.png"), delta=2)


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


class Wild(Case):
    def test_two_thousand_random_inputs(self):
        """Clicks, drags and keys at random: no crash, no message of the validation layer, no frame of two seconds. Files
        are not written: dialogs have no folder to save into but the test's own."""
        output = self.edit(self.scene("torchelsen/cloud-1.toml"), "--validation", "--report", size="1000x640",
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
        self.assertIn("no control", self.edit(script="click nothing of that name\n", status=1))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *[f"{name}" for name in sys.argv[1:]]], verbosity=2)
