#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""How close pictures of nephos come to a path tracer: the same clouds, cameras, extinctions, phase function, sun and sky
drawn by nephos, by Blender's Cycles and by OpenVDB's vdb_render, and the mean FLIP of the latter two against Cycles.

    tests/realism/compare_with_cycles.py --out FOLDER [--disney wdas_cloud.vdb] [--only NAME | --genera] [--set KEY=VALUE ...]

The sky has the same radiance in all directions, and there is no ground and no air: what is compared is the light in the
cloud. Of vdb_render, which knows no sky, the best of several strengths of light and amounts of scatter is taken. Pictures
of Cycles stay in the folder and are used again. Needs the programs blender and vdb_render, python3-numpy, and minutes for
each cloud; not part of ./test."""

import argparse
import itertools
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tomllib

import numpy
from PIL import Image

import flip

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SIZE = (320, 240)
SKY = (0.25, 0.35, 0.5)
SUN = (1.0, 0.96, 0.9)
GOAL = 0.08

# Eye, target (metres), sun (elevation, azimuth in degrees), step of Cycles and vdb_render's voxels (metres).
CLOUDS = {
    "disney": {"up": "y", "extinction_per_m": 0.1, "eye_m": (-10, -650, 139), "target_m": (-10, 41, 75),
               "sun": (38, 270), "step_m": 3.0},
    "cumulus": {"scene": "scenes/cumulus.toml", "time_s": 900, "extinction_per_m": 0.15, "eye_m": (0, -3200, 250),
                "target_m": (0, 1500, 1150), "sun": (38, 270), "step_m": 6.0},
    "congestus": {"scene": "scenes/genera/Cb.toml", "time_s": 1500, "extinction_per_m": 0.02,
                  "eye_m": (-4000, -30000, 1500), "target_m": (0, 0, 6000), "sun": (30, 250), "step_m": 60.0},
}
CLOUDS["cumulus-voxels"] = CLOUDS["cumulus"] | {"step_m": 20.0, "refine": 1}  # in the voxels of its lattice
GENERA = ("Ci", "Cc", "Cs", "Ac", "As", "Ns", "Sc", "St", "Cu", "Cb")


def genus(name):
    """The cloud of a scene of a genus, seen by its camera; its voxels are those of the lattice."""
    path = ROOT / f"scenes/genera/{name}.toml"
    scene = tomllib.loads(path.read_text(encoding="utf-8"))
    camera = scene["camera"]
    return {"scene": path, "eye_m": tuple(camera["position_m"]), "target_m": tuple(camera["target_m"]),
            "sun": (scene["sun"]["elevation_deg"], scene["sun"]["azimuth_deg"]), "fov_deg": camera["vertical_fov_deg"],
            "extinction_per_m": scene["density"]["extinction_per_m"],
            "step_m": min(layer["lattice"]["cell_size_m"] for layer in scene["layer"]) / 2, "refine": 1}


def tone_mapped(linear):
    """As nephos's PNG files: the identity up to 1/2, then a shoulder; then sRGB, 0..1 (render/image/tone_map.cpp)."""
    x = numpy.maximum(linear, 0)
    x = numpy.where(x <= 0.5, x, 1 - 0.5 * numpy.exp(-(x - 0.5) / 0.5))
    return numpy.where(x <= 0.0031308, 12.92 * x, 1.055 * numpy.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def save(path, picture):
    Image.fromarray((255 * picture).round().astype(numpy.uint8)).save(path)


def run(*words):
    result = subprocess.run([str(each) for each in words], capture_output=True, text=True, check=False)
    if result.returncode != 0:
        sys.exit(f"failed: {' '.join(str(each) for each in words)}\n{result.stdout[-2000:]}{result.stderr[-2000:]}")
    return result.stdout


def direction_to_sun(elevation_deg, azimuth_deg):
    elevation, azimuth = math.radians(elevation_deg), math.radians(azimuth_deg)
    return (math.sin(azimuth) * math.cos(elevation), math.cos(azimuth) * math.cos(elevation), math.sin(elevation))


def listed(values):
    return "[" + ", ".join(repr(float(each)) for each in values) + "]"


def volume_of(name, cloud, options):
    """The file of a cloud: the one that was given, or the frame of a scene, simulated if it is not there yet."""
    if name == "disney":
        return options.disney
    folder = options.out / name
    files = sorted(folder.glob("density/**/*.vdb"))
    if not files:
        when = ["--frames", "1"] if "time_s" not in cloud else [
            "--set", f"frames.start_s={cloud['time_s']}", "--set", "frames.count=1", "--set",
            f"time.steps={cloud['time_s'] // 10 + 10}"]
        run("nice", options.nephos, "run", ROOT / cloud["scene"], "--out", folder, "--no-render", "--quiet", *when, "--set",
            f"density.refine={cloud.get('refine', 4)}")  # with its detail, so that both see the same cloud
        files = sorted(folder.glob("density/**/*.vdb"))
    return min(files, key=lambda file: len(file.name))  # all layers together


def by_cycles(name, cloud, volume, options):
    """Linear, of two independent runs."""
    base = options.out / f"{name}-g{options.g:g}-{options.bounces}-cycles"
    files = [pathlib.Path(f"{base}-{seed}.npy") for seed in range(2)]
    if not all(file.exists() for file in files):
        job = {"volume": str(volume), "grid": "density", "up": cloud.get("up", "z"), "step_m": cloud["step_m"],
               "extinction_per_m": cloud["extinction_per_m"], "g": options.g, "sun_colour": SUN, "sky": SKY,
               "to_sun": direction_to_sun(*cloud["sun"]), "eye_m": cloud["eye_m"], "target_m": cloud["target_m"],
               "vertical_fov_deg": cloud.get("fov_deg", 50), "size": SIZE, "threads": options.threads, "samples": options.samples,
               "bounces": options.bounces, "out": str(base)}
        pathlib.Path(f"{base}.json").write_text(json.dumps(job), encoding="utf-8")
        run("nice", "-n", 19, "blender", "-b", "--factory-startup", "-P", HERE / "cycles_render.py", "--", f"{base}.json")
    return [numpy.load(file)[..., :3] for file in files]


def by_nephos(name, cloud, volume, options):
    path = options.out / f"{name}-nephos.png"
    keys = {"camera.position_m": listed(cloud["eye_m"]), "camera.target_m": listed(cloud["target_m"]),
            "camera.vertical_fov_deg": cloud.get("fov_deg", 50), "camera.width": SIZE[0], "camera.height": SIZE[1],
            "sun.elevation_deg": cloud["sun"][0], "sun.azimuth_deg": cloud["sun"][1], "sun.colour": listed(SUN),
            "atmosphere.model": '"gradient"', "air.extinction_per_m": "[0, 0, 0]", "air.horizon": listed(SKY), "air.zenith": listed(SKY),
            "ground.height_m": "100000", "light.ambient_top": listed(SKY), "light.ambient_base": listed(SKY),
            "light.phase": '"henyey_greenstein"', "light.g": options.g, "camera.exposure": '"manual"', "camera.tone_curve": '"exponential"', "camera.glare": 0,
            "ground.pattern": '"plain"', "detail.strength": 0, "detail.thermals": 0, "detail.apron_cells": 0,
            "detail.to_horizon": "false",  # Cycles draws the voxels as they are,
            "density.metaball_radius_cells": 1}  # ... linear between them: opacities are then the same to 0.004
    words = [each for key, value in keys.items() for each in ("--set", f"{key}={value}")]
    words += [each for setting in options.set for each in ("--set", setting)]
    run(options.nephos, "render", volume, "--scene", ROOT / "scenes/cumulus.toml", "--up", cloud.get("up", "z"),
        "--extinction", cloud["extinction_per_m"], "--quiet", "--out", path, *words)
    return flip.pixels_of(path) / 255


def by_vdb_render(name, cloud, volume, options, truth):
    """The picture nearest to `truth`, and what it was drawn with."""
    y_up = cloud.get("up", "z") == "y"

    def in_file(point):
        x, y, z = point if not y_up else (point[0], point[2], -point[1])
        return f"{x},{y},{z}"

    across = 2 * math.degrees(math.atan(math.tan(math.radians(25)) * SIZE[0] / SIZE[1]))
    best = None
    jobs, files = [], []
    for gain in (0.0, 0.2, 0.5, 1.0):
        file = options.out / f"{name}-vdb_render-{gain:g}.exr"
        scatter = ",".join([str(cloud["extinction_per_m"])] * 3)
        run("nice", "vdb_render", volume, file, "-name", "density", "-cpus", options.threads, "-res", f"{SIZE[0]}x{SIZE[1]}",
            "-fov", across, "-translate", in_file(cloud["eye_m"]), "-lookat", in_file(cloud["target_m"]), "-up",
            "0,1,0" if y_up else "0,0,1", "-light", in_file(direction_to_sun(*cloud["sun"])) + ",1,1,1", "-absorb", "0,0,0",
            "-scatter", scatter, "-gain", gain, "-far", 1e6)
        files.append((gain, file.with_suffix(".npy")))
        jobs.append([str(file), str(file.with_suffix(".npy"))])
    job = options.out / f"{name}-convert.json"
    job.write_text(json.dumps({"convert": jobs}), encoding="utf-8")
    run("nice", "blender", "-b", "--factory-startup", "-P", HERE / "cycles_render.py", "--", job)
    for (gain, file), light in itertools.product(files, (0.7, 1, 1.4, 2, 2.8, 4, 5.6)):
        rgba = numpy.load(file)
        linear = light * rgba[..., :3] * numpy.array(SUN) + (1 - rgba[..., 3:]) * numpy.array(SKY)
        picture = tone_mapped(linear)
        mean = flip.flip(truth, picture).mean()
        if best is None or mean < best[0]:
            best = (mean, picture, f"light {light:g}, gain {gain:g}")
    return best


def compare(name, options):
    cloud = CLOUDS[name] if name in CLOUDS else genus(name)
    volume = volume_of(name, cloud, options)
    pair = by_cycles(name, cloud, volume, options)
    truth = tone_mapped((pair[0] + pair[1]) / 2)
    noise = flip.flip(*(tone_mapped(each) for each in pair)).mean()
    save(options.out / f"{name}-cycles.png", truth)
    ours = by_nephos(name, cloud, volume, options)
    map_of_ours = flip.flip(truth, ours)
    save(options.out / f"{name}-error.png", flip.heat(map_of_ours) / 255)
    row = {"cloud": name, "nephos": map_of_ours.mean(), "noise": noise}
    covered = (abs(truth - tone_mapped(numpy.array(SKY))) > 0.01).any(axis=-1)
    row["in the cloud"] = map_of_ours[covered].mean()
    if not options.without_vdb_render:
        mean, other, how = by_vdb_render(name, cloud, volume, options, truth)
        save(options.out / f"{name}-vdb_render.png", other)
        row |= {"vdb_render": mean, "how": how}
    save(options.out / f"{name}-side-by-side.png", numpy.concatenate([ours, truth, flip.heat(map_of_ours) / 255], axis=1))
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for pictures")
    parser.add_argument("--nephos", type=pathlib.Path, default=ROOT / "build/release/bin/nephos", help="the program")
    parser.add_argument("--disney", type=pathlib.Path, help="wdas_cloud_sixteenth.vdb or a larger one of its family")
    parser.add_argument("--only", choices=(*CLOUDS, *GENERA), help="one of the clouds")
    parser.add_argument("--genera", action="store_true", help="the ten genera instead, in voxels of their lattices")
    parser.add_argument("--g", type=float, default=0.5, help="asymmetry of the phase function")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="a key of our scene")
    parser.add_argument("--samples", type=int, default=192, help="of Cycles, a pixel and run")
    parser.add_argument("--bounces", type=int, default=1024,
                        help="of Cycles: with 128 a sheet of an optical depth of 30 loses a tenth of its light")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--without-vdb-render", action="store_true")
    options = parser.parse_args()
    for program in ("blender",) if options.without_vdb_render else ("blender", "vdb_render"):
        if shutil.which(program) is None:
            sys.exit(f"skipped: {program} is not installed (Debian: blender, libopenvdb-tools)")
    options.out.mkdir(parents=True, exist_ok=True)
    names = [options.only] if options.only else GENERA if options.genera else [name for name in CLOUDS if name != "disney" or options.disney]
    print("| cloud | nephos | of the cloud's pixels | vdb_render | noise of Cycles |\n|---|---|---|---|---|")
    for row in (compare(name, options) for name in names):
        other = f"{row['vdb_render']:.4f} ({row['how']})" if "vdb_render" in row else ""
        print(f"| {row['cloud']} | {row['nephos']:.4f} | {row['in the cloud']:.4f} | {other} | {row['noise']:.4f} |", flush=True)


if __name__ == "__main__":
    main()
