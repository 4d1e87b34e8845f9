# SPDX-License-Identifier: Apache-2.0
"""A hundred small scenes from one seed, for matrix_test.py: extents that are no multiples of 8, all boundaries, winds that
change with height and time, ellipsoids, scatters, layers with clouds of base models, climates, rain, veils."""

import json
import pathlib
import random

COUNT = 100
SEED = 20240621
GENERA = pathlib.Path(__file__).resolve().parents[2] / "scenes/genera"


def toml(value):
    """A value of a TOML file."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {toml(v)}" for key, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


def boundaries(draw):
    return [draw.choice(["open", "periodic"]) for _ in range(2)] + [draw.choice(["open", "open", "periodic"])]


def lattice(draw):
    return {"cells": [draw.randint(5, 75), draw.randint(5, 40), draw.randint(3, 21)],
            "cell_size_m": draw.choice([10, 50, 62.5, 100]), "boundaries": boundaries(draw),
            "initial": draw.choice(["field", "empty"])}


def wind(draw):
    def level(height):
        if draw.random() < 0.5:
            return {"height_m": height, "east_m_per_s": round(draw.uniform(-30, 30), 2),
                    "north_m_per_s": round(draw.uniform(-30, 30), 2)}
        return {"height_m": height, "from_deg": draw.randint(0, 359), "speed_m_per_s": round(draw.uniform(0, 40), 2)}
    times = sorted(draw.sample(range(0, 200), draw.randint(1, 3)))
    return [{"time_s": time, "levels": [level(height) for height in sorted(draw.sample(range(0, 2000), draw.randint(1, 3)))]}
            for time in times]


def probabilities(draw, weight=1.0):
    return {"hum": round(draw.uniform(0, 0.3) * weight, 4), "act": round(draw.uniform(0, 0.03) * weight, 5),
            "ext": round(draw.uniform(0.01, 0.4), 4)}


def ellipsoid(draw, box):
    return {"centre_m": [round(draw.uniform(0, side), 1) for side in box],
            "semi_axes_m": [round(draw.uniform(0.1, 0.6) * side, 1) for side in box], "yaw_deg": draw.randint(0, 180),
            "centre": probabilities(draw), "birth_s": draw.choice([0, -100, 25]), "life_s": draw.choice([60, 1000]),
            "fade_in_s": draw.choice([0, 20]), "fade_out_s": draw.choice([0, 20]), "carried": draw.random() < 0.7}


def scatter(draw, box):
    return {"count": draw.randint(1, 12), "semi_axis_x_m": [round(0.1 * box[0], 1), round(0.4 * box[0], 1)],
            "semi_axis_y_m": [round(0.1 * box[1], 1), round(0.4 * box[1], 1)],
            "semi_axis_z_m": [round(0.2 * box[2], 1), round(0.5 * box[2], 1)], "centre": probabilities(draw)}


def smoothing(draw):
    return {"kernel": draw.choice(["box", "tent", "gaussian"]), "i0": draw.randint(0, 4), "j0": draw.randint(0, 4),
            "k0": draw.randint(0, 3), "t0": draw.randint(0, 3)}


def plain(draw, scene):
    box = [n * scene["lattice"]["cell_size_m"] for n in scene["lattice"]["cells"]]
    scene["field"] = {"background": probabilities(draw, draw.choice([0, 0.2, 1]))}
    scene["field"]["ellipsoids"] = [ellipsoid(draw, box) for _ in range(draw.randint(0, 4))]
    scene["field"]["scatters"] = [scatter(draw, box) for _ in range(draw.randint(0, 2))]


def layered(draw, scene):
    """A layer of clouds that models make, with rain, and one that is a veil or grows from scatters."""
    scene["models"] = [str(GENERA / name) for name in ("Cu.toml", "Cu-fra.toml")]
    scene["field"] = {"background": {"ext": 0.3}}
    scene["climate"] = {"schedule": [{"time_s": 0, "state": 0}, {"time_s": draw.randint(30, 90), "state": 1}]}
    scene["sky"] = [{"name": "few", "state": 0, "clouds": draw.randint(1, 6), "models": "Cu"},
                    {"name": "many", "state": 1, "clouds": draw.randint(6, 20), "models": ["Cu", "Cu fra"], "generated": 2}]
    size = scene["lattice"]["cell_size_m"] = 100
    scene["lattice"]["cells"] = [max(25, n) for n in scene["lattice"]["cells"][:2]] + scene["lattice"]["cells"][2:]
    box = [n * size for n in scene["lattice"]["cells"]]
    low = {"name": "low", "skies": ["few", "many"], "base_height_m": [0.1 * box[2], 0.4 * box[2]], "formation_s": 30,
           "dissolution_s": 30, "lattice": {"cells": scene["lattice"]["cells"]},
           "rain": {"find": draw.random() < 0.5, "finder": {"start_water_m": 150, "keep_water_m": 100, "min_area_m2": 0},
                    "placed": [{"x_m": box[0] / 2, "y_m": box[1] / 2, "semi_a_m": box[0] / 4, "semi_b_m": box[1] / 4,
                                "carried": True}]}}
    if draw.random() < 0.5:
        high = {"name": "high", "lattice": {"origin_m": [0, 0, box[2] + 500], "cells": [39, 35, 6], "cell_size_m": 25},
                "veil": {"form": draw.choice(["cumulus", "stratus", "cirrus", "cirrostratus"]),
                         "octaves": draw.randint(1, 3), "wavelength_m": draw.choice([300, 900]),
                         "displacement": draw.choice([0, 0.5])}}
    else:
        scene["sky"].append({"name": "clear", "state": 0, "clouds": 0})
        high = {"name": "high", "skies": ["clear"], "base_height_m": box[2] + 500,
                "lattice": {"origin_m": [0, 0, box[2] + 500], "cells": [31, 18, 7]},
                "scatters": [scatter(draw, [3100, 1800, 700])]}
    scene["layer"] = [low, high]


def scene_of(number):
    draw = random.Random(f"{SEED} {number}")
    steps, step_s = draw.randint(4, 9), draw.choice([5, 10, 12.5])
    scene = {"name": f"scene-{number:03}", "seed": draw.getrandbits(63), "lattice": lattice(draw),
             "time": {"step_s": step_s, "steps": steps}}
    (layered if number % 3 == 2 else plain)(draw, scene)
    if draw.random() < 0.8:
        scene["wind"] = wind(draw)
    scene["density"] = {"smoothing": smoothing(draw), "metaball_radius_cells": draw.choice([1, 2, 3]),
                        "refine": draw.choice([1, 1, 1, 2]), "half": draw.random() < 0.2}
    scene["frames"] = {"per_second": 1, "time_scale": step_s * draw.choice([1.5, 2, 3])}
    return scene


def write_scene(folder, scene):
    path = pathlib.Path(folder) / f"{scene['name']}.toml"
    path.write_text("".join(f"{key} = {toml(value)}\n" for key, value in scene.items()))
    return path


def write_all(folder):
    return [write_scene(folder, scene_of(number)) for number in range(COUNT)]
