# SPDX-License-Identifier: Apache-2.0
"""Scenes after the hundred of golden_scenes.py, from the same seed: scatters that replace, backgrounds by height and time or
from files, winds from files, staggered ones too, and in formulas, schedules. Most are at least 17 levels high, so that three
processes can share them. VDB files are written beside the scenes, with numbers drawn for them."""

import random

import numpy
import pyopenvdb

import golden_scenes as golden

FIRST, COUNT = golden.COUNT, 36


def key_times(draw, steps, step_s, most=3):
    """Times of steps and times between them."""
    at = sorted(draw.sample(range(2 * steps), draw.randint(1, most)))
    return [n // 2 * step_s + n % 2 * round(draw.uniform(0.1, 0.9) * step_s, 3) for n in at]


def heights(draw, box, most=3):
    return sorted(draw.sample(range(int(box[2])), draw.randint(1, most)))


def write_grid(path, grid, values, edge_m, corner_m):
    grid.copyFromArray(values)
    grid.transform = pyopenvdb.createLinearTransform(edge_m)
    grid.transform.translate(tuple(corner_m))
    pyopenvdb.write(str(path), grid)


def numbers(draw, shape, low, high):
    """Multiples of 2^-20, which single precision holds as they are."""
    values = [round(draw.uniform(low, high) * 2**20) / 2**20 for _ in range(int(numpy.prod(shape)))]
    return numpy.array(values, numpy.float32).reshape(shape)


def replaced(draw, scene, box, _folder):
    """Steps that are no binary fraction of a second; ellipsoids leave and die within few of them."""
    step_s = scene["time"]["step_s"] = draw.choice([0.7, 1.1, 12.5])
    steps = scene["time"]["steps"] = 24
    scene["field"]["scatters"] = [
        {**golden.scatter(draw, box), "replace": True, "life_s": [2 * step_s, 6 * step_s], "birth_s": [-3 * step_s, 0],
         "fade_in_s": draw.choice([0, step_s])} for _ in range(2)]
    if draw.random() < 0.5:
        scene["field"]["scatters"][1]["thermals"] = {"interval_s": 2 * step_s, "life_s": 2 * step_s, "rise_m": 0.4 * box[2]}
    gust = box[0] / (steps * step_s)  # crosses the lattice in a run
    scene["wind"] = [{"levels": [{"height_m": 0, "east_m_per_s": round(min(900, gust), 2)},
                                 {"height_m": round(box[2]), "east_m_per_s": round(-min(900, 2 * gust), 2)}]}]


def profile(draw, scene, box, _folder):
    del scene["field"]["background"]
    scene["field"]["profile"] = [
        {"time_s": time, "levels": [{"height_m": height, **golden.probabilities(draw)} for height in heights(draw, box)]}
        for time in key_times(draw, scene["time"]["steps"], scene["time"]["step_s"])]


def grids(draw, scene, box, folder):
    kinds = draw.sample(["hum", "act", "ext"], draw.randint(1, 3))
    scene["field"]["grids"] = [{"of": kind, "file": f"{scene['name']}-{kind}.vdb", "grid": "values"} for kind in kinds]
    for kind in kinds:
        shape = [draw.randint(1, 6) for _ in range(3)]
        low, high = {"hum": (0, 0.3), "act": (0, 0.03), "ext": (0.01, 0.4)}[kind]
        edge = box[0] / draw.choice([3, 5, 7])
        grid = pyopenvdb.FloatGrid(-1.0)
        grid.name = "values"
        write_grid(folder / f"{scene['name']}-{kind}.vdb", grid, numbers(draw, shape, low, high), edge,
                   [draw.randint(-50, 50) for _ in range(3)])


def wind_files(draw, scene, box, folder, by_level=True):
    """One file or more one after the other; `by_level`: each level has one wind, as a profile."""
    step_s, name = scene["time"]["step_s"], scene["name"]
    files = [f"{name}-wind-{n}.vdb" for n in range(draw.randint(1, 3))]
    speed = scene["lattice"]["cell_size_m"] / step_s
    shape = [draw.randint(2, 5) for _ in range(3)]
    staggered = draw.random() < 0.6
    for file in files:
        values = numbers(draw, [*shape, 3], -2 * speed, 2 * speed)
        if by_level:
            values[:] = values[:1, :1]
            values[..., 2] = 0
        grid = pyopenvdb.Vec3SGrid((1e9, 1e9, 1e9))
        grid.name, grid.gridClass = "vel", pyopenvdb.GridClass.STAGGERED if staggered else pyopenvdb.GridClass.UNKNOWN
        write_grid(folder / file, grid, values, box[2] / 4, [0, 0, draw.randint(-20, 20)])
    scene["wind_field"] = [{"kind": "grid", "files": files, "grid": "vel", "start_s": draw.choice([0, -step_s, 1.5 * step_s]),
                            "interval_s": draw.choice([1, 2.5]) * step_s}]


def wind_fields(draw, scene, box, folder):
    """Winds that differ from place to place: from files, or in formulas."""
    if draw.random() < 0.5:
        wind_files(draw, scene, box, folder, by_level=False)
        return
    speed = scene["lattice"]["cell_size_m"] / scene["time"]["step_s"]
    scene["wind_field"] = []
    for kind in draw.sample(["thermal", "roll", "shear_line", "vortex"], 2):
        field = {"kind": kind, "x_m": round(draw.uniform(0, box[0]), 1), "y_m": round(draw.uniform(0, box[1]), 1),
                 "radius_m": round(draw.uniform(0.1, 0.5) * box[0], 1), "speed_m_per_s": round(draw.uniform(-2, 2) * speed, 2)}
        if kind in ("roll", "shear_line"):
            field["direction_deg"] = draw.randint(0, 359)
        scene["wind_field"].append(field)


def scheduled(draw, scene):
    """Layers whose skies follow states, with points of the schedule at steps and between them."""
    golden.layered(draw, scene)
    times = key_times(draw, scene["time"]["steps"], scene["time"]["step_s"], most=5)
    scene["climate"] = {"schedule": [{"time_s": time, "state": draw.choice([0, 0.3, 0.7, 1])} for time in times]}


KINDS = (replaced, profile, grids, wind_files, wind_fields, scheduled)


def kind_of(number):
    return KINDS[number % len(KINDS)]


def scene_of(number, folder):
    """A scene, whose files it writes."""
    draw, kind = random.Random(f"{golden.SEED} {number}"), kind_of(number)
    steps, step_s = draw.randint(6, 10), draw.choice([0.7, 5, 12.5])
    scene = {"name": f"scene-{number:03}", "seed": draw.getrandbits(63), "lattice": golden.lattice(draw),
             "time": {"step_s": step_s, "steps": steps}}
    if kind is scheduled:
        scheduled(draw, scene)
    else:
        cells = scene["lattice"]["cells"]
        cells[2] = draw.randint(17, 30)
        golden.plain(draw, scene)
        kind(draw, scene, [n * scene["lattice"]["cell_size_m"] for n in cells], folder)
    if "wind" not in scene and draw.random() < 0.7:
        scene["wind"] = [{**golden.wind(draw)[0], "time_s": time} for time in key_times(draw, steps, step_s)]
    scene["density"] = {"smoothing": golden.smoothing(draw), "metaball_radius_cells": draw.choice([1, 2, 3]),
                        "refine": draw.choice([1, 1, 1, 2]), "half": draw.random() < 0.2}
    scene["frames"] = {"per_second": 1, "time_scale": scene["time"]["step_s"] * draw.choice([1.5, 2, 3])}
    return scene


def write_all(folder):
    return [golden.write_scene(folder, scene_of(number, folder)) for number in range(FIRST, FIRST + COUNT)]
