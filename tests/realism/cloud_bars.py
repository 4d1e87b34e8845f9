#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures clouds with detail and prints each figure beside its bar: how sharp pictures are, their spectrum, whether
files have the mass and the look of what is drawn, what changes when the eye creeps or goes with the wind, relief, and
how near the back-ends are.

    tests/realism/cloud_bars.py --out FOLDER [--nephos PROGRAM] [--only NAME ...]

Draws frame 40 of scenes/cumulus.toml and needs python3-numpy, python3-openimageio and some minutes; not part of ./test.
Exits with 1 when a bar is missed."""

import argparse
import math
import pathlib
import subprocess
import sys

import numpy
import OpenImageIO

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SCENE = ROOT / "scenes/cumulus.toml"
SIZE = (1280, 720)
FRAME = 40
# Of cumulus.toml's own camera, of an eye 300 m from a cloud, and of one on the ground.
VIEWS = {"scene": {}, "near": {"camera.position_m": "[-2000, -900, 1300]", "camera.target_m": "[-1900, 900, 1350]"},
         "below": {"camera.position_m": "[0, 500, 2]", "camera.target_m": "[0, 2200, 1100]"}}
LUMINANCE = numpy.array([0.2126, 0.7152, 0.0722])


class Studio:
    """Draws pictures, each once, into a folder."""

    def __init__(self, options):
        self.nephos, self.out = options.nephos, options.out
        self.out.mkdir(parents=True, exist_ok=True)

    def run(self, *words):
        result = subprocess.run([str(word) for word in (self.nephos, *words)], capture_output=True, text=True, check=False)
        if result.returncode != 0:
            sys.exit(f"failed: {' '.join(str(word) for word in words)}\n{result.stderr[-2000:]}")

    def folder(self, name, keys, *words, frames=f"{FRAME}..{FRAME}"):
        folder = self.out / name
        if not folder.exists():
            keys = {"camera.width": SIZE[0], "camera.height": SIZE[1], "frames.exr": "true"} | keys
            sets = [word for key, value in keys.items() for word in ("--set", f"{key}={value}")]
            self.run("run", SCENE, "--out", folder, "--frames", frames, "--quiet", *words, *sets)
        return folder

    def picture(self, name, keys, *words, frame=FRAME, frames=f"{FRAME}..{FRAME}"):
        """Levels 0..255 of a picture, rows x columns x 3, and its transmittance."""
        base = self.folder(name, keys, *words, frames=frames) / f"frames/cumulus_{frame:04}"
        return levels_of(f"{base}.png"), channels_of(f"{base}.exr", "transmittance.Y")


def channels_of(path, wanted):
    image = OpenImageIO.ImageBuf(str(path))
    names = list(image.spec().channelnames)
    if wanted not in names:
        sys.exit(f"{path}: no channel {wanted} among {names}")
    return image.get_pixels(OpenImageIO.FLOAT)[..., names.index(wanted)]


def levels_of(path):
    return 255.0 * OpenImageIO.ImageBuf(str(path)).get_pixels(OpenImageIO.FLOAT)[..., :3]


def luminance(levels):
    return levels @ LUMINANCE


def sharpness(levels, covered):
    """The 99.9th percentile of the change from a pixel to the next over the cloud's pixels, levels."""
    change = numpy.abs(numpy.diff(luminance(levels), axis=1))
    return numpy.percentile(change[covered[:, 1:] | covered[:, :-1]], 99.9)


def spectrum(levels, covered):
    """Slope of log power over log frequency between periods of 32 and 3 pixels, and the largest ratio of the power of a
    period to that of its neighbours, of square windows that the cloud fills."""
    size, picture = 128, luminance(levels)
    window = numpy.hanning(size)[:, None] * numpy.hanning(size)[None, :]
    power, count = numpy.zeros((size, size)), 0
    for y in range(0, picture.shape[0] - size, size // 2):
        for x in range(0, picture.shape[1] - size, size // 2):
            if covered[y:y + size, x:x + size].mean() < 0.95:
                continue
            part = picture[y:y + size, x:x + size]
            power += numpy.abs(numpy.fft.fft2((part - part.mean()) * window)) ** 2
            count += 1
    if count == 0:
        return None
    frequency = numpy.hypot(*numpy.meshgrid(numpy.fft.fftfreq(size), numpy.fft.fftfreq(size)))
    edges = numpy.geomspace(1 / 32, 1 / 3, 17)
    means = numpy.array([power[(frequency >= low) & (frequency < high)].mean() for low, high in zip(edges, edges[1:])])
    centres = numpy.sqrt(edges[1:] * edges[:-1])
    slope = numpy.polyfit(numpy.log(centres), numpy.log(means), 1)[0]
    smooth = numpy.sqrt(means[2:] * means[:-2])
    return slope, (means[1:-1] / smooth).max(), count


def high_pass(picture):
    """Brightness at 6 to 24 pixels: the difference of two blurs."""
    def blurred(pixels):
        reach = int(3 * pixels)
        kernel = numpy.exp(-0.5 * (numpy.arange(-reach, reach + 1) / pixels) ** 2)
        kernel /= kernel.sum()
        rows = numpy.apply_along_axis(lambda line: numpy.convolve(line, kernel, "same"), 1, picture)
        return numpy.apply_along_axis(lambda line: numpy.convolve(line, kernel, "same"), 0, rows)
    return blurred(2) - blurred(8)


def moved(keys, metres):
    """A view from `metres` farther east."""
    def shift(text):
        x, y, z = (float(number) for number in text.strip("[]").split(","))
        return f"[{x + metres}, {y}, {z}]"
    return keys | {key: shift(keys[key]) for key in ("camera.position_m", "camera.target_m")}


class Report:
    def __init__(self):
        self.missed = 0

    def row(self, what, value, low, high, unit=""):
        good = low <= value <= high
        self.missed += not good
        bar = f">= {low:g}" if high == math.inf else f"<= {high:g}" if low == -math.inf else f"{low:g} to {high:g}"
        print(f"{what:58} {value:9.3f} {unit:8} bar {bar:16} {'met' if good else 'MISSED'}", flush=True)


def report_sharpness(studio, report):
    for view, bar in (("scene", 30), ("near", 18), ("below", 28)):
        levels, left = studio.picture(view, VIEWS[view])
        report.row(f"sharpness, {view}", sharpness(levels, left < 0.5), bar, math.inf, "levels")


def report_spectrum(studio, report):
    for view in VIEWS:
        levels, left = studio.picture(view, VIEWS[view])
        found = spectrum(levels, left < 0.1)
        if found is None:
            print(f"spectrum, {view}: no window of 128 x 128 pixels is full of cloud")
            continue
        report.row(f"spectrum, slope from 32 to 3 pixels, {view}", found[0], -3.6, -2.6)
        report.row(f"spectrum, highest peak over its neighbours, {view}", found[1], -math.inf, 2)


def mass_of(folder):
    import pyopenvdb
    (file,) = sorted((folder / "density").glob("*.vdb"))
    grid = pyopenvdb.read(str(file), "density")
    cell = grid.transform.voxelSize()[0]
    return sum(item.value * item.count for item in grid.citerOnValues()) * cell ** 3


def report_mass(studio, report):
    small = {"camera.width": 64, "camera.height": 36, "frames.exr": "false"}
    plain = mass_of(studio.folder("mass-0", small | {"detail.enabled": "false"}, "--no-render"))
    for refine in (1, 2, 4, 8):
        detailed = mass_of(studio.folder(f"mass-{refine}", small | {"density.refine": refine}, "--no-render"))
        report.row(f"mass of files, refine {refine}, over that without detail", detailed / plain, 0.98, 1.02)


def report_export(studio, report):
    levels, left = studio.picture("scene", {})
    folder = studio.folder("mass-8", {"density.refine": 8}, "--no-render")
    (file,) = (folder / "density").glob("*.vdb")
    picture = studio.out / "export.png"
    if not picture.exists():
        studio.run("render", file, "--scene", SCENE, "--out", picture, "--size", f"{SIZE[0]}x{SIZE[1]}", "--quiet")
    difference = numpy.abs(levels_of(picture) - levels)[left < 0.99]
    report.row("picture of the file of refine 8, mean difference", difference.mean(), -math.inf, 2, "levels")


def report_creep(studio, report):
    """The eye moves by a tenth of a pixel of what is 3 km away."""
    keys = {"camera.position_m": "[0, -3200, 250]", "camera.target_m": "[0, 1500, 1150]"}
    step = 0.1 * 3000 * 2 * math.tan(math.radians(25)) / SIZE[1]
    for view in ({"scene": keys, "near": VIEWS["near"]}).items():
        first, _ = studio.picture(f"creep-{view[0]}-0", view[1])
        second, _ = studio.picture(f"creep-{view[0]}-1", moved(view[1], step if view[0] == "scene" else step / 8))
        change = numpy.abs(second - first)
        report.row(f"eye creeps a tenth of a pixel, mean, {view[0]}", change.mean(), -math.inf, 0.03, "levels")
        slope = numpy.abs(numpy.gradient(luminance(first), axis=1))
        print(f"    a picture that is shifted by a tenth of a pixel changes by {0.1 * slope.mean():.3f} in the mean")
        report.row(f"eye creeps a tenth of a pixel, largest, {view[0]}", change.max(), -math.inf, 12, "levels")


def report_swim(studio, report):
    """The camera goes with the wind in the middle of the clouds' layer: what changes from a frame to the next, over that
    without detail."""
    changes = []
    for name, detail in (("with", "true"), ("without", "false")):
        keys = {"detail.enabled": detail, "camera.position_m": "[0, -3200, 250]", "camera.target_m": "[0, 1500, 1150]"}
        first, _ = studio.picture(f"swim-{name}-0", keys)
        drift = 2.5 * 6.5 * math.cos(math.radians(2.5))  # metres in a frame, to the east
        second, _ = studio.picture(f"swim-{name}-1", moved(keys, drift), frame=FRAME + 1, frames=f"{FRAME + 1}..{FRAME + 1}")
        changes.append(numpy.abs(second - first).mean())
    report.row("camera with the wind: change of a frame over that without", changes[0] / changes[1], -math.inf, 1.7)


def report_relief(studio, report):
    pictures = []
    for azimuth in (90, 270):
        levels, left = studio.picture(f"relief-{azimuth}", {"sun.azimuth_deg": azimuth, "sun.elevation_deg": 30})
        pictures.append(high_pass(luminance(levels))[left < 0.1])
    report.row("relief: correlation under opposite suns", numpy.corrcoef(*pictures)[0, 1], -math.inf, 0.7)
    report.row("relief: rms at 6 to 24 pixels", numpy.std(pictures[0]), 4, math.inf, "levels")


def report_backends(studio, report):
    small = {"camera.width": 640, "camera.height": 360}
    pictures = [studio.picture(f"by-{name}", small, "--splatting", name)[0] for name in ("cpu", "vulkan")]
    difference = numpy.abs(pictures[0].round() - pictures[1].round()).max(axis=2)
    report.row("cpu and vulkan: pixels more than 1/255 apart", 100 * (difference > 1).mean(), -math.inf, 0, "%")


REPORTS = {"sharpness": report_sharpness, "spectrum": report_spectrum, "mass": report_mass, "export": report_export,
           "creep": report_creep, "swim": report_swim, "relief": report_relief, "backends": report_backends}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder for pictures; those that are there are used")
    parser.add_argument("--nephos", type=pathlib.Path, default=ROOT / "build/release/bin/nephos", help="the program")
    parser.add_argument("--only", choices=REPORTS, nargs="+", default=list(REPORTS), help="some of the figures")
    options = parser.parse_args()
    studio, report = Studio(options), Report()
    for name in options.only:
        REPORTS[name](studio, report)
    return 1 if report.missed else 0


if __name__ == "__main__":
    sys.exit(main())
