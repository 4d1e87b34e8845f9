#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Base models and the clouds that are made of them. See case.py."""

import subprocess
import sys
import tomllib
import unittest

from PIL import Image

from case import NEPHOS, Case
from kept import MODELS


class Models(Case):
    def test_clouds_of_a_model(self):
        """Generate again counts up; twenty sketches show different clouds; the chosen one becomes a base model whose seeds
        are its boxes, with what the model has besides."""
        scene = self.folder / "models.toml"
        scene.write_text(MODELS, encoding="utf-8")
        self.edit(scene, "--validation", script="""
            wait-step 1
            key SPACE
            click model
            click model[0]
            click "Generate again"
            expect-control "cloud number 0"
            click "Generate again"
            expect-control "cloud number 1"
            click "20 at once"
            wait 0.5
            screenshot grid.png
            click "The next 20"
            click "cloud 27"
            wait 0.3
            expect-control "cloud number 27"
            click "Make it a base model"
            wait 0.5
            key CTRL+S
            wait 0.5
            """)
        before, model = tomllib.loads(MODELS)["model"][0], None
        models = tomllib.loads(scene.read_text(encoding="utf-8"))["model"]
        self.assertEqual(models[0], before)
        self.assertEqual(len(models), 2)
        model = models[1]
        self.assertNotEqual(model["name"], "bank")
        self.assertEqual(model["light_distance_m"], 900)
        self.assertGreater(len(model["seeds"]), 3)
        for seed in model["seeds"]:
            self.assertEqual(seed["size_m"], [700, 600, 300])
            self.assertEqual(seed["texture"], "dense")
            self.assertEqual(seed["billboard_width_m"], [200, 400])
            self.assertTrue(4 <= seed["billboards"] <= 8, seed)
            self.assertNotIn("roots", seed)
        self.assertEqual(len({tuple(seed["position_m"]) for seed in model["seeds"]}), len(model["seeds"]))
        subprocess.run([NEPHOS, "validate", str(scene)], check=True, capture_output=True)
        with Image.open(self.folder / "grid.png") as image:  # sketches: bright puffs on blue
            pixels = list(image.convert("RGB").getdata())
        puffs = sum(1 for red, green, blue in pixels if min(red, green, blue) > 200)
        self.assertGreater(puffs, 5000)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[1:]], verbosity=2)
