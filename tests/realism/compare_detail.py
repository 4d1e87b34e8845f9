#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What level of detail costs in pictures: draws a frame of each scene at full detail and with the scene's own
[level_of_detail], and prints the mean and the largest difference in 1/255 and the share of pixels that differ by
more than 4/255. Exits with 1 when a mean is above 1/255, the goal.

    compare_detail.py --nephos build/release/bin/nephos scenes/*.toml scenes/genera/*.toml
    compare_detail.py --nephos build/release/bin/nephos wdas_cloud_sixteenth.vdb
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

import numpy

import flip

GOAL = 1.0  # mean difference, in 1/255


def picture(nephos, source, frame, folder, settings):
    """A picture of a scene's frame or of a volume, as numbers 0..255."""
    command = [nephos, "run", source, "--out", folder, "--frames", str(frame), "--overwrite", "--quiet"]
    if source.suffix == ".vdb":
        scene = folder / "detail.toml"
        scene.write_text('[lattice]\ncells = [8, 8, 8]\n', encoding="utf-8")
        command = [nephos, "render", source, "--out", folder / "frames.png", "--quiet", "--scene", scene, "--view", "side"]
    sets = [word for setting in settings for word in ("--set", setting)]
    subprocess.run([str(word) for word in command + sets], check=True)
    (drawn,) = folder.glob("**/*.png")
    return flip.pixels_of(drawn).astype(float)


def differences(nephos, source, frame, settings):
    size = ["camera.width=640", "camera.height=480"] if source.suffix == ".vdb" else []  # scenes have their own
    pictures = []
    for detail in (["level_of_detail.pixels=0"], []):
        with tempfile.TemporaryDirectory() as folder:
            pictures.append(picture(nephos, source, frame, pathlib.Path(folder), size + settings + detail))
    return numpy.abs(pictures[1] - pictures[0])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sources", nargs="+", type=pathlib.Path, help="scenes or VDB files")
    parser.add_argument("--nephos", required=True, type=pathlib.Path, help="the command")
    parser.add_argument("--frame", default=1, type=int, help="which frame of a scene (default: 1)")
    parser.add_argument("--set", default=[], action="append", metavar="KEY=VALUE", help="change a key of every scene")
    arguments = parser.parse_args()
    print(f"{'':28}    mean  largest   > 4/255")
    missed = False
    for source in arguments.sources:
        difference = differences(arguments.nephos, source, arguments.frame, arguments.set)
        mean, share = difference.mean(), (difference.max(axis=2) > 4).mean()
        missed = missed or mean > GOAL
        print(f"{source.stem:28}  {mean:6.3f}  {difference.max():7.0f}  {100 * share:6.2f} %", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
