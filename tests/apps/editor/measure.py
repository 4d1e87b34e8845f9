#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Measures what docs/editor.md promises of the window, under Xvfb with the software driver, and prints a table: the first
picture of every shipped scene, the interface's rate while a scene of 256x128x20 cells steps and draws, pictures a second
of cumulus at 960x540, how soon a change and a step of a thousand are shown. On a machine that does nothing else.
Usage: measure.py [NEPHOS] [WORD ...], words choose rows: first, rates, change, scrub."""

import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
SOURCE = HERE.parents[2]
# Panels that leave 960x540 to the picture in a window of SIZE.
SIZE = "1560x800"
CONFIG = "left = 220\nright = 370\nbottom = 190\nplots = on\n"
NUMBER = r"([\d.]+)"


class Window:
    def __init__(self, nephos):
        self.nephos = nephos

    def report(self, *arguments, script=None):
        """What --report prints of a session."""
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "nephos").mkdir()
            (folder / "nephos/editor.conf").write_text(CONFIG, encoding="utf-8")
            command = ["xvfb-run", "-a", "-s", "-screen 0 1600x1000x24", self.nephos, "edit", *map(str, arguments), "--report",
                       "--size", SIZE]
            if script is not None:
                (folder / "script.txt").write_text(script, encoding="utf-8")
                command += ["--script", str(folder / "script.txt")]
            done = subprocess.run(command, capture_output=True, text=True, cwd=folder, timeout=600, check=False,
                                  env={**os.environ, "XDG_CONFIG_HOME": name})
        if done.returncode != 0:
            sys.exit(done.stdout + done.stderr)
        return done.stdout


def found(pattern, text):
    return [float(number) for number in re.search(pattern, text).groups()]


def row(what, value, bar):
    print(f"| {what} | {value} | {bar} |", flush=True)


def first_pictures(window):
    times = {}
    for scene in sorted((SOURCE / "scenes").rglob("*.toml")):
        (seconds,) = found(rf"first picture {NUMBER} s", window.report(scene, script="wait-step 0\n"))
        times[str(scene.relative_to(SOURCE / "scenes"))] = seconds
    slowest = sorted(times, key=times.get, reverse=True)[:4]
    row(f"first picture, the slowest of {len(times)} shipped scenes",
        ", ".join(f"{name} {times[name]:.2f} s" for name in slowest), "2 s")


def rates(window):
    for scene in ("cumulus", "climate"):
        report = window.report(SOURCE / f"scenes/{scene}.toml", script="click speed\nclick \"speed 1000x\"\nwait 12\n")
        frames, within = found(rf"interface {NUMBER} frames/s.*99 % within {NUMBER} ms", report)
        pictures, width, height = found(rf"pictures {NUMBER} a second, the last of (\d+)x(\d+)", report)
        row(f"interface while {scene} steps and draws", f"{frames:.1f} frames/s, 99 % within {within:.0f} ms", "30 frames/s")
        row(f"pictures of {scene} in 960x540 while it runs", f"{pictures:.1f} a second (drafts of {width:.0f}x{height:.0f})",
            "15 a second")


def change(window):
    for scene in ("cumulus", "climate"):
        script = "wait-step 2\nkey SPACE\nclick sun\n" + "".join(
            f"set sun.elevation_deg {20 + n}\nwait 0.3\n" for n in range(12))
        count, longest = found(rf"changes {NUMBER}, shown within {NUMBER} ms",
                               window.report(SOURCE / f"scenes/{scene}.toml", script=script))
        row(f"a changed slider of {scene} shows", f"in the next picture, {count:.0f} times within {longest:.0f} ms",
            "next picture")


def scrub(window):
    for scene in ("cumulus", "climate"):
        steps = [3, 997, 500, 501, 250, 123, 871, 42, 640, 999, 333, 0, 777]
        script = ("key SPACE\nset \"time line\" 1000\n" + "".join(f"wait-step {step}\n" for step in range(100, 1001, 100)) +
                  "".join(f"set \"time line\" {step}\nwait 1.2\n" for step in steps))
        count, longest = found(rf"steps gone to {NUMBER}, shown within {NUMBER} ms",
                               window.report(SOURCE / f"scenes/{scene}.toml", script=script))
        row(f"any of 1,000 steps of {scene} that were seen", f"{count:.0f} times within {longest:.0f} ms", "500 ms")


def main():
    nephos = str(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else SOURCE / "build/release/bin/nephos").resolve())
    kinds = {"first": first_pictures, "rates": rates, "change": change, "scrub": scrub}
    print("| what | measured | bar |\n|---|---|---|")
    for name in sys.argv[2:] or kinds:
        kinds[name](Window(nephos))


if __name__ == "__main__":
    main()
