#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Reads a frame of `nephos export --to raw` by its sidecar alone: read_volume.py NAME.volume.json [NUMBER]"""
import json
import pathlib
import sys

import numpy

path = pathlib.Path(sys.argv[1])
sidecar = json.loads(path.read_text())
number = int(sys.argv[2]) if len(sys.argv) > 2 else sidecar["first"]
raw = next(f for f in sidecar["formats"] if f["format"] == "raw")
if raw["type"] == "bc4":
    sys.exit(f"{path}: blocks of bc4 are for graphics cards: export with --type r8, r16, r16f or r32f to read voxels")
dtype, full = {"r8": ("u1", 255), "r16": ("<u2", 65535), "r16f": ("<f2", 1), "r32f": ("<f4", 1)}[raw["type"]]
nx, ny, nz = raw["levels"][0]["size"]
codes = numpy.fromfile(path.parent / (raw["files"] % number), dtype, nx * ny * nz).reshape(nz, ny, nx)
density = codes.astype("f8") / full * sidecar["scale"] + sidecar["offset"]
k, j, i = numpy.unravel_index(density.argmax(), density.shape)  # z slowest, x fastest
place = [low + (n + 0.5) * edge for low, n, edge in zip(sidecar["min_m"], (i, j, k), sidecar["voxel_size_m"])]
print(f"frame {number}: {nx} x {ny} x {nz} voxels, sum {density.sum():.1f}, densest {density.max():.4f} at {place} m "
      f"({', '.join(sidecar['axes'])}), extinction {density.max() * sidecar.get('extinction_per_m', 1):.4f} per m")
