# SPDX-License-Identifier: Apache-2.0
"""Reads the files of write_sample_files with pyopenvdb and compares voxels, transform and metadata.

    /usr/bin/python3 read_with_pyopenvdb.py FOLDER
"""
import json
import pathlib
import sys

import numpy
import pyopenvdb

STATE = ("hum", "act", "cld")
METADATA = {
    "nephos_units": "m",
    "nephos_up_axis": "z",
    "nephos_extinction_per_m": 0.04,
    "nephos_time_s": 33.5,
    "nephos_time_step_s": 5.0,
    "nephos_frames_per_second": 24.0,
    "nephos_time_scale": 150.0,
    "nephos_seed": "12345678901234567890",
    "nephos_scene_hash": "scene",
    "nephos_state_hash": "state",
    "nephos_version": "0.1.0",
    "nephos_random_stream_version": 1,
}


def check(condition, message):
    if not condition:
        sys.exit(f"FAILED: {message}")


def expected_array(folder, name, kind, extent):
    """The plain array, indexed [x, y, z] as pyopenvdb has it."""
    values = numpy.fromfile(folder / f"{name}.{kind}", dtype=numpy.float32)
    return values.reshape(extent[::-1]).transpose(2, 1, 0)


def check_shared(where, grid, spec):
    extent, size = spec["extent"], spec["voxel_m"]
    for index in ((0, 0, 0), (7, 3, 5), tuple(n - 1 for n in extent)):
        world = grid.transform.indexToWorld(index)
        for axis in range(3):
            centre = spec["origin_m"][axis] + (index[axis] + 0.5) * size
            check(abs(world[axis] - centre) < 1e-9, f"{where}: voxel {index} lies at {world}")
    check(grid.transform.voxelSize() == (size,) * 3, f"{where}: voxel size {grid.transform.voxelSize()}")
    wanted = METADATA | {
        "nephos_refine": spec["refine"],
        "nephos_bbox_min": (0, 0, 0),
        "nephos_bbox_max": tuple(n - 1 for n in extent),
    }
    for key, value in wanted.items():
        check(grid[key] == value, f"{where}: {key} is {grid[key]!r}, expected {value!r}")


def check_density(where, grid, expected, spec):
    check(grid.valueTypeName == "float", f"{where}: type {grid.valueTypeName}")
    check(grid.gridClass == pyopenvdb.GridClass.FOG_VOLUME, f"{where}: class {grid.gridClass}")
    check(grid.saveFloatAsHalf == spec["half"], f"{where}: half is {grid.saveFloatAsHalf}")
    check(grid.background == 0, f"{where}: background {grid.background}")
    corners = ((0, 0, 0), tuple(n - 1 for n in spec["extent"]))
    check(grid.evalActiveVoxelBoundingBox() == corners, f"{where}: bounds {grid.evalActiveVoxelBoundingBox()}")
    values = numpy.zeros(spec["extent"], dtype=numpy.float32)
    grid.copyToArray(values)
    tolerance = 2.0**-11 if spec["half"] else 0
    worst = numpy.max(numpy.abs(values - expected) - tolerance * expected)
    check(worst <= 0, f"{where}: voxels differ by {worst}")
    check(numpy.max(expected) == 1 and numpy.max(values) == 1, f"{where}: no saturated voxel in it")
    active = numpy.count_nonzero(expected) + sum(expected[corner] == 0 for corner in corners)
    check(grid.activeVoxelCount() == active, f"{where}: {grid.activeVoxelCount()} active voxels, expected {active}")


def check_plane(where, grid, expected, spec):
    check(grid.valueTypeName == "bool", f"{where}: type {grid.valueTypeName}")
    values = numpy.zeros(spec["extent"], dtype=bool)
    grid.copyToArray(values)
    check(numpy.array_equal(values, expected != 0), f"{where}: voxels differ")
    check(grid.activeVoxelCount() == numpy.count_nonzero(expected), f"{where}: active voxels differ")


def check_velocity(where, grid, density, spec):
    check(grid.valueTypeName == "vec3s", f"{where}: type {grid.valueTypeName}")
    values = numpy.zeros(spec["extent"] + [3], dtype=numpy.float32)
    grid.copyToArray(values)
    inside = density > 0
    check(numpy.any(inside), f"{where}: no density")
    east = numpy.broadcast_to(numpy.array(spec["speed_by_level"], dtype=numpy.float32), density.shape)
    check(numpy.allclose(values[..., 0][inside], east[inside], rtol=1e-5), f"{where}: east components differ")
    check(numpy.all(values[..., 1][inside] == -1), f"{where}: north components differ")
    check(numpy.all(values[..., 2][inside] == 0), f"{where}: vertical components differ")


def check_file(folder, name):
    spec = json.loads((folder / f"{name}.json").read_text())
    grids, metadata = pyopenvdb.readAll(str(folder / f"{name}.vdb"))
    by_name = {grid.name: grid for grid in grids}
    check(sorted(by_name) == ["act", "cld", "density", "hum", "vel"], f"{name}: grids {sorted(by_name)}")
    for key, value in METADATA.items():
        check(metadata[key] == value, f"{name}: file metadata {key} is {metadata[key]!r}")
    for grid in grids:
        check_shared(f"{name}/{grid.name}", grid, spec)
    density = expected_array(folder, name, "density", spec["extent"])
    check_density(f"{name}/density", by_name["density"], density, spec)
    for plane in STATE:
        check_plane(f"{name}/{plane}", by_name[plane], expected_array(folder, name, plane, spec["extent"]), spec)
    check_velocity(f"{name}/vel", by_name["vel"], density, spec)


def check_veil(folder):
    """A veil's voxels against those of its twin in double precision; densities below 2^-10 are left out."""
    spec = json.loads((folder / "veil.json").read_text())
    grid = pyopenvdb.read(str(folder / "veil.vdb"), "density")
    check_shared("veil/density", grid, spec)
    expected = expected_array(folder, "veil", "density", spec["extent"])
    values = numpy.zeros(spec["extent"], dtype=numpy.float32)
    grid.copyToArray(values)
    worst = numpy.max(numpy.abs(values - expected)[(values > 0) | (expected > 1.01 * 2.0**-10)])
    check(worst < 1e-4, f"veil/density: voxels differ from the twin's by {worst}")
    check(numpy.count_nonzero(values) > values.size // 10, "veil/density: hardly any voxels")


def main():
    folder = pathlib.Path(sys.argv[1])
    check_veil(folder)
    for name in ("float", "half", "refined"):
        check_file(folder, name)
        print(f"{name}.vdb: voxels, transform and metadata as expected")


if __name__ == "__main__":
    main()
