#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of docs/editor.md anew: walks through tutorial.txt, and shows the modes of the picture. Look at what
it made. Usage: draw_tutorial.py [NEPHOS], on a machine with xvfb-run."""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

from PIL import Image

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parents[2]
PICTURES = SOURCE / "docs/pictures"
PARCELS = """
click tab Properties
wait-step 80
key SPACE
click field.scatters
click field.scatters[0]
wait-picture
screenshot editor.png
"""
MODEL = """
click tab Properties
wait-step 20
key SPACE
key F
click model
click model[0]
click open model[0].seeds
click model[0].seeds[3]
wait-picture
screenshot editor-model.png
"""
LIVE = """
wait-step 60
click tab View
click "Record as key frames"
click "Start the change now"
click-at "sun dial in view" 0.22 0.62
wait-step 75
click-at "sun dial in view" 0.14 0.58
wait-step 85
key SPACE
wait-picture
screenshot editor-climate.png
"""
VOXELS = """
click tab View
wait-step 60
key SPACE
key 6
wait 0.3
wait-picture
screenshot editor-voxels.png
"""
SIMULATIONS = """
click tab Properties
wait-step 30
click "copy simulation"
wait-step 34
click sun
set sun.elevation_deg 9
set sun.azimuth_deg 300
click "new simulation"
wait-step 20
click "simulation 2"
wait-step 60
click "run all simulations"
click sun
wait-picture
screenshot editor-simulations.png
"""
GRID = """
wait-step 1
key SPACE
click model
click model[0]
click "20 at once"
click "cloud 7"
wait 0.7
screenshot editor-generate.png
"""


def walk(nephos, script, folder, *arguments):
    subprocess.run(["xvfb-run", "-a", "-s", "-screen 0 1600x1000x24", nephos, "edit", *arguments, "--script", str(script),
                    "--size", "1280x800", "--theme", "dark"],
                   check=True, cwd=folder, env={**os.environ, "XDG_CONFIG_HOME": str(folder / "config")})


def main():
    nephos = str(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else SOURCE / "build/release/bin/nephos").resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        shutil.copytree(SOURCE / "scenes", folder / "scenes")  # so that the pictures show no folder of this machine
        walk(nephos, HERE / "tutorial.txt", folder)
        for number, (script, scene) in enumerate([
                (PARCELS, "cumulus"), (MODEL, "torchelsen/cloud-4"), (LIVE, "climate"), (VOXELS, "cumulus"),
                (SIMULATIONS, "cumulus"), (GRID, "torchelsen/cloud-4")]):
            path = folder / f"walk-{number}.txt"
            path.write_text(script, encoding="utf-8")
            walk(nephos, path, folder, f"scenes/{scene}.toml")
        for picture in sorted(folder.glob("*.png")):
            with Image.open(picture) as image:
                image.convert("RGB").save(PICTURES / (picture.stem + ".jpg"), quality=88)


if __name__ == "__main__":
    main()
