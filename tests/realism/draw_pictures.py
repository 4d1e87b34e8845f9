#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Draws the pictures of README.md and docs/ anew, from the shipped scenes, into docs/pictures/ or another folder.
Pictures that compare nephos with another program or build are made elsewhere: against-cycles.jpg by
compare_with_cycles.py.

    draw_pictures.py --nephos build/release/bin/nephos             # all of them
    draw_pictures.py --nephos build/release/bin/nephos genera fog  # these
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy
from PIL import Image, ImageDraw

ROOT = pathlib.Path(__file__).resolve().parents[2]
FROM_ABOVE = {"camera.position_m": "[0, -2500, 3200]", "camera.target_m": "[0, 1500, 1100]"}
FROM_BELOW = {"camera.position_m": "[0, -900, 2]", "camera.target_m": "[0, 2600, 1150]"}
HIGH = {"camera.position_m": "[0, -9000, 10000]", "camera.target_m": "[0, 16000, 0]"}
SPLASHES = {"precipitation.splashes": "1", "camera.path": "[]", "camera.position_m": "[0, 1000, 1.7]",
            "camera.target_m": "[6, 1012, 0.2]"}
WITHIN_RAIN = {"camera.path": "[]", "camera.position_m": "[0, 1400, 1.7]", "camera.target_m": "[0, 2400, 60]"}
NO_DETAIL = {"detail.enabled": "false"}
GENERA = ["Ci", "Cc", "Cs", "Ac", "As", "Ns", "Sc", "St", "Cu", "Cb", "St-fra", "Cu-fra"]

# File: columns, size of each part, and parts: scene, frame, changed keys.
PICTURES = {
    "cumulus.png": (1, (960, 600), [("cumulus", 40, {})]),
    "cumulus-to-horizon.jpg": (1, (960, 540), [("cumulus", 40, HIGH)]),
    "cumulus-from-above.png": (1, (960, 600), [("cumulus", 40, FROM_ABOVE)]),
    "cumulus-from-below.png": (1, (960, 600), [("cumulus", 40, FROM_BELOW)]),
    "stratus.png": (1, (640, 480), [("stratus", 20, {})]),
    "large.png": (1, (960, 600), [("large", 1, {})]),
    "climate.jpg": (3, (400, 300), [("climate", frame, {}) for frame in (1, 12, 22, 32, 42, 55)]),
    "genera.jpg": (4, (320, 240), [(f"genera/{genus}", 1, {}) for genus in GENERA]),
    "sunset.jpg": (1, (960, 540), [("sunset", 20, {})]),
    "mammatus.jpg": (1, (960, 600), [("mammatus", 1, {})]),
    "shafts.jpg": (1, (640, 480), [("shafts", 20, {})]),
    "sea.jpg": (1, (960, 540), [("sea", 1, {})]),
    "mountains.jpg": (1, (960, 540), [("mountains", 1, {})]),
    "fog.jpg": (1, (640, 480), [("fog", 8, {})]),
    "cirrus.png": (1, (640, 480), [("cirrus", 1, {})]),
    "rain-shafts.jpg": (1, (640, 480), [("rain", 1, {})]),
    "rain-edge.jpg": (1, (640, 480), [("rain", 150, {})]),
    "rain-near.jpg": (1, (640, 480), [("rain", 205, WITHIN_RAIN)]),
    "snow.jpg": (1, (640, 480), [("snow", 60, {})]),
    "rain-found.jpg": (1, (960, 600), [("rain-found", 24, {})]),
    "rainbow.jpg": (1, (960, 600), [("rainbow", 1, {})]),
    "painted.jpg": (1, (960, 540), [("torchelsen/painted", 1, {})]),
    **{f"sapronov-{name}.jpg": (1, (640, 400), [(f"sapronov/{name}", 1, {})])
       for name in ("cumulus", "stratus", "cirrus", "halo", "glory", "fogbow")},
    "splashes.jpg": (1, (960, 600), [("rain", 205, SPLASHES)]),
    "storm.jpg": (3, (480, 270), [("storm", frame, {}) for frame in (1, 24, 40, 52, 66, 80)]),
    "nightfall.jpg": (2, (640, 360), [("nightfall", frame, {"frames.time_scale": "16800", "frames.count": "4"})
                                      for frame in (1, 2, 3, 4)]),
    "wet-ground.jpg": (3, (400, 300), [("wet-ground", frame, {}) for frame in (2, 4, 5, 6, 7, 9)]),
    "detail.jpg": (2, (640, 400), [("cumulus", 40, view | off) for view in ({}, FROM_ABOVE, FROM_BELOW)
                                   for off in (NO_DETAIL, {})]),
    "lighting-light-pass.png": (1, (640, 480), [("cumulus", 40, {"light.lighting": "light_pass"} | NO_DETAIL)]),
    "lighting-cfa.png": (1, (640, 480), [("cumulus", 40, {"light.lighting": "cfa", "light.light_distance_m": "100"}
                                          | NO_DETAIL)]),
    "torchelsen-shade.jpg": (1, (640, 400), [("torchelsen/shade", 1, {})]),
    "torchelsen-cumulonimbus.jpg": (1, (640, 400), [("torchelsen/cumulonimbus", 1, {})]),
    "torchelsen-dark-and-bright.jpg": (1, (640, 400), [("torchelsen/dark-and-bright", 1, {})]),
    "torchelsen-alike.jpg": (1, (640, 400), [("torchelsen/dark-and-bright", 1, {"layer[0].light_absorption": "0"})]),
    "sapronov-shade.jpg": (1, (640, 400), [("sapronov/shade", 1, {})]),
    "sapronov-rain.jpg": (1, (640, 400), [("sapronov/rain", 24, {})]),
    "sapronov-fog-over-water.jpg": (1, (640, 400), [("sapronov/fog-over-water", 24, {})]),
    "debug-view.png": (1, (640, 480), [("torchelsen/cloud-1", 1, {f"debug_view.{part}": "true" for part in ("boxes", "axes", "roots", "rays")} | {"camera.vertical_fov_deg": "22"})]),
}
GAP = 3  # pixels between parts


def draw(nephos, scene, frame, keys, size):
    keys = {"camera.width": size[0], "camera.height": size[1], "level_of_detail.pixels": 0} | keys
    sets = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([nephos, "run", ROOT / f"scenes/{scene}.toml", "--out", folder, "--frames", str(frame), "--quiet",
                        "--overwrite", *map(str, sets)], check=True)
        (path,) = pathlib.Path(folder).glob("frames/*.png")
        return Image.open(path).convert("RGB")


def sheet(nephos, columns, size, parts, labelled):
    rows = -(-len(parts) // columns)
    whole = Image.new("RGB", (columns * (size[0] + GAP) - GAP, rows * (size[1] + GAP) - GAP), "white")
    for n, (scene, frame, keys) in enumerate(parts):
        part = draw(nephos, scene, frame, keys, size)
        if labelled:
            ImageDraw.Draw(part).text((8, 5), pathlib.Path(scene).name.replace("-", " "), fill="white")
        whole.paste(part, (n % columns * (size[0] + GAP), n // columns * (size[1] + GAP)))
    return whole


def tiles(nephos):
    """Nine copies of a frame of tile.toml from above, north up: opacity of each column, lit from the west."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        subprocess.run([nephos, "run", ROOT / "scenes/tile.toml", "--no-render", "--out", folder / "run", "--frames", "24", "--quiet"], check=True)
        subprocess.run([nephos, "export", folder / "run", "--to", "raw", "--type", "r32f", "-o", folder / "raw", "--quiet"], check=True)
        sidecar = json.loads((folder / "raw/tile.volume.json").read_text())
        nx, ny, nz = sidecar["size"]
        density = numpy.fromfile(next((folder / "raw").glob("*.raw")), "<f4").reshape(nz, ny, nx)
    depth = density.sum(0) * sidecar["extinction_per_m"] * sidecar["voxel_size_m"][2]
    opacity = 1 - numpy.exp(-depth / 2)
    height = (density * numpy.arange(nz)[:, None, None]).sum(0) / numpy.maximum(density.sum(0), 1e-6)
    light = numpy.clip(0.86 + 0.05 * (height - numpy.roll(height, 1, 1)), 0.55, 1)
    colour = opacity[..., None] * light[..., None] * numpy.array([255, 252, 246]) + (1 - opacity[..., None]) * numpy.array([58, 92, 66])
    whole = Image.fromarray(numpy.tile(colour[::-1], (3, 3, 1)).astype("u1"))
    ticks = ImageDraw.Draw(whole)
    for edge in (nx, 2 * nx):
        ticks.line([(edge, 0), (edge, 9)], fill="red")
        ticks.line([(0, edge * ny // nx), (9, edge * ny // nx)], fill="red")
    return whole


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", help="files without their ending (default: all)")
    parser.add_argument("--nephos", required=True, type=pathlib.Path, help="the command")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "docs/pictures", help="folder (default: docs/pictures)")
    arguments = parser.parse_args()
    names = [*PICTURES, "tiles.jpg"]
    unknown = set(arguments.names) - {pathlib.Path(name).stem for name in names}
    if unknown:
        parser.error(f"no such picture: {', '.join(sorted(unknown))}; known: "
                     f"{', '.join(pathlib.Path(name).stem for name in names)}")
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, (columns, size, parts) in PICTURES.items():
        if arguments.names and pathlib.Path(name).stem not in arguments.names:
            continue
        picture = sheet(arguments.nephos, columns, size, parts, labelled=name == "genera.jpg")
        picture.save(arguments.out / name, **({"quality": 88} if name.endswith(".jpg") else {"optimize": True}))
        print(f"{name}: {picture.width} x {picture.height}", flush=True)
    if not arguments.names or "tiles" in arguments.names:
        tiles(arguments.nephos).save(arguments.out / "tiles.jpg", quality=88)
    return 0


if __name__ == "__main__":
    sys.exit(main())
