#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The automaton in vectorised NumPy: the same rules as automaton/, whole arrays at a time.

It is what ./bench compares the automaton with, and a second, independent reading of the rules of Dobashi et al.
(2000): growth, then extinction and birth, then advection. Its random numbers come from NumPy, so that its states
agree with those of nephos in distribution, not bit by bit; with probabilities of 0 and 1 alone they agree exactly.

Arrays have the shape (z, y, x), x fastest, one byte a cell (NumPy has no packed bits that can be shifted).

    numpy_twin.py --cells 256 128 20 --steps 20           time of a step, as JSON
    numpy_twin.py --scene scenes/cumulus.toml --steps 200 --statistics
    numpy_twin.py --scene scenes/cumulus.toml --steps 200 --dump states.npz
"""

import argparse
import json
import math
import statistics
import sys
import time
import tomllib

import numpy as np


# --- the rules ------------------------------------------------------------------------------------------------

def shifted(plane, dx, dy, dz, periodic):
    """plane(i + dx, j + dy, k + dz); beyond an open boundary lies 0. periodic = (x, y, z)."""
    for axis, amount, wraps in ((2, dx, periodic[0]), (1, dy, periodic[1]), (0, dz, periodic[2])):
        if amount == 0:
            continue
        if wraps:
            plane = np.roll(plane, -amount, axis)
            continue
        result = np.zeros_like(plane)
        size = plane.shape[axis]
        if abs(amount) < size:
            source = [slice(None)] * 3
            target = [slice(None)] * 3
            source[axis] = slice(amount, None) if amount > 0 else slice(None, amount)
            target[axis] = slice(None, -amount) if amount > 0 else slice(-amount, None)
            result[tuple(target)] = plane[tuple(source)]
        plane = result
    return plane


# The six nearest, the four at distance two along the horizontal axes, and the one two cells below.
NEIGHBOURS = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1),
              (2, 0, 0), (-2, 0, 0), (0, 2, 0), (0, -2, 0), (0, 0, -2))


def grow(hum, act, cld, periodic):
    """hum' = hum & !act, cld' = cld | act, act' = !act & hum & f_act, all from the same time."""
    near = np.zeros_like(act)
    for dx, dy, dz in NEIGHBOURS:
        near |= shifted(act, dx, dy, dz, periodic)
    return hum & ~act, ~act & hum & near, cld | act


def extinguish_and_bear(hum, act, cld, field, random):
    """cld' = cld & (rnd >= p_ext), hum' = hum | (rnd < p_hum), act' = act | (rnd < p_act); fresh numbers each."""
    p_hum, p_act, p_ext = field
    shape = hum.shape
    hum = hum | (random.random(shape, np.float32) < p_hum)
    act = act | (random.random(shape, np.float32) < p_act)
    cld = cld & (random.random(shape, np.float32) >= p_ext)
    return hum, act, cld


def advect(planes, cells_x, cells_y, periodic):
    """v'(i, j, k) = v(i - wx(k), j - wy(k), k): each layer moves by whole cells of its own."""
    results = []
    for plane in planes:
        result = np.empty_like(plane)
        for k in range(plane.shape[0]):
            layer = plane[k:k + 1]
            if periodic[0] or abs(cells_x[k]) < plane.shape[2]:
                layer = shifted(layer, -int(cells_x[k]), 0, 0, periodic)
            else:
                layer = np.zeros_like(layer)
            if periodic[1] or abs(cells_y[k]) < plane.shape[1]:
                layer = shifted(layer, 0, -int(cells_y[k]), 0, periodic)
            else:
                layer = np.zeros_like(layer)
            result[k] = layer[0]
        results.append(result)
    return results


# --- the probability field ------------------------------------------------------------------------------------

class Parcel:
    """One ellipsoid of humid air; p(u) = rim + (centre - rim) (1 - u^2)^2 inside, u = distance / radius."""

    def __init__(self, centre_m, semi_axes_m, yaw_deg, centre, rim, birth_s, life_s, fade_in_s, fade_out_s, carried,
                 scatter=None):
        self.centre_m = list(centre_m)
        self.semi_axes_m = semi_axes_m
        self.yaw = math.radians(yaw_deg)
        self.centre, self.rim = centre, rim
        self.birth_s, self.life_s = birth_s, life_s
        self.fade_in_s, self.fade_out_s = fade_in_s, fade_out_s
        self.carried = carried
        self.scatter = scatter
        self.rise_m = 0.0
        self.drawn_of_thermals, self.random = {}, None

    def weight(self, time_s):
        age, left = time_s - self.birth_s, self.birth_s + self.life_s - time_s
        if age < 0 or left <= 0:
            return 0.0
        rising = min(1.0, age / self.fade_in_s) if self.fade_in_s > 0 else 1.0
        falling = min(1.0, left / self.fade_out_s) if self.fade_out_s > 0 else 1.0
        return min(rising, falling)

    def reach_m(self):
        a, b, c = self.semi_axes_m
        x = math.hypot(a * math.cos(self.yaw), b * math.sin(self.yaw))
        y = math.hypot(a * math.sin(self.yaw), b * math.cos(self.yaw))
        return x, y, c


def segments(first, last, size, periodic):
    """The cells first..last of an axis as [(slice, index of its first cell)]; a periodic axis wraps round."""
    if not periodic:
        first, last = max(first, 0), min(last, size - 1)
        return [(slice(first, last + 1), first)] if first <= last else []
    last = min(last, first + size - 1)
    pieces = []
    while first <= last:
        inside = first % size
        length = min(last - first + 1, size - inside)
        pieces.append((slice(inside, inside + length), first))
        first += length
    return pieces


def add_parcel(field, scene, parcel, weight):
    """Overlapping parcels: the larger hum and act, the smaller ext. Works on slices, in single precision."""
    cell, origin, reach = scene.cell_m, scene.origin_m, parcel.reach_m()
    pieces = []
    for axis in range(3):
        first = math.floor((parcel.centre_m[axis] - reach[axis] - origin[axis]) / cell)
        last = math.ceil((parcel.centre_m[axis] + reach[axis] - origin[axis]) / cell)
        pieces.append(segments(first, last, scene.shape[2 - axis], scene.periodic[axis]))

    def offsets(axis, piece):
        place, first = piece
        cells = np.arange(first, first + place.stop - place.start)
        return (origin[axis] + (cells + 0.5) * cell - parcel.centre_m[axis]).astype(np.float32)

    cosine, sine = np.float32(math.cos(parcel.yaw)), np.float32(math.sin(parcel.yaw))
    a, b, c = (np.float32(1 / axis) for axis in parcel.semi_axes_m)
    for in_x in pieces[0]:
        for in_y in pieces[1]:
            x, y = offsets(0, in_x)[None, :], offsets(1, in_y)[:, None]
            flat = ((cosine * x + sine * y) * a) ** 2 + ((cosine * y - sine * x) * b) ** 2
            for in_z in pieces[2]:
                square = flat[None, :, :] + ((offsets(2, in_z) * c) ** 2)[:, None, None]
                inside = square < 1
                bump = (1 - square) ** 2
                where = (in_z[0], in_y[0], in_x[0])
                for plane, part, combine in zip(field, range(3), (np.maximum, np.maximum, np.minimum)):
                    background, rim = scene.background[part], parcel.rim[part]
                    base = np.float32(background + weight * (rim - background))
                    p = base + np.float32(weight * (parcel.centre[part] - rim)) * bump
                    combine(plane[where], p, out=plane[where], where=inside)


def probability_field(scene, parcels, time_s):
    """The three probabilities of every cell: the background, and where parcels are, theirs."""
    field = [np.full(scene.shape, p, np.float32) for p in scene.background]
    for parcel in parcels:
        weight = parcel.weight(time_s)
        if weight > 0:
            add_parcel(field, scene, parcel, weight)
        for thermal in thermals_of(scene, parcel, time_s):
            add_parcel(field, scene, thermal, thermal.weight(time_s))
    return field


def thermals_of(scene, plume, time_s):
    """The bubbles that have risen from an ellipsoid of a scatter with `thermals`, and still live."""
    table = (plume.scatter or {}).get("thermals")
    if table is None:
        return
    interval_s, life_s, variety = table["interval_s"], table.get("life_s", 900), table.get("variety", 0.4)
    for n in range(int((plume.life_s - life_s) // interval_s) + 1 if math.isfinite(plume.life_s) else 10**6):
        birth_s = plume.birth_s + n * interval_s
        if birth_s > time_s:
            return
        if birth_s + life_s <= time_s:
            continue
        size, rise, a, b = plume.drawn_of_thermals.setdefault(n, plume.random.random(4))
        u = (time_s - birth_s) / life_s
        risen = plume.rise_m * (1 - variety * rise) * u * (2 - u)
        wide = table.get("width", 0.6)
        axes = [f * s * (1 - variety * size) for f, s in zip((wide, wide, 1), plume.semi_axes_m)]
        factor = max(0.2, 1 + table.get("spread", -0.1) * risen / (0.5 * (axes[0] + axes[1])))
        z = plume.centre_m[2]
        lean = [0.0, 0.0]
        if plume.carried:
            above, below = scene.wind_at(z + 0.5 * risen, time_s), scene.wind_at(z, time_s)
            lean = [(v - w) * (time_s - birth_s) for v, w in zip(above, below)]
        wander = table.get("wander", 0.5)
        a, b = wander * plume.semi_axes_m[0] * (2 * a - 1), wander * plume.semi_axes_m[1] * (2 * b - 1)
        cos, sin = math.cos(plume.yaw), math.sin(plume.yaw)
        centre = (plume.centre_m[0] + a * cos - b * sin + lean[0], plume.centre_m[1] + a * sin + b * cos + lean[1],
                  z + risen)
        yield Parcel(centre, [axis * factor for axis in axes], math.degrees(plume.yaw), plume.centre, plume.rim,
                     birth_s, life_s, plume.fade_in_s, plume.fade_out_s, plume.carried)


# --- a scene --------------------------------------------------------------------------------------------------

def probabilities(table, otherwise):
    return tuple(float(table.get(name, value)) for name, value in zip(("hum", "act", "ext"), otherwise))


class Scene:
    """The part of a scene file that decides the bits, with the defaults of the scene reference."""

    def __init__(self, tables, cells=None):
        lattice = tables.get("lattice", {})
        nx, ny, nz = cells or lattice.get("cells", (256, 128, 20))
        self.shape = (nz, ny, nx)
        self.cell_m = float(lattice.get("cell_size_m", 50.0))
        self.origin_m = [float(v) for v in lattice.get("origin_m", (0, 0, 0))]
        boundaries = lattice.get("boundaries", "open")
        if isinstance(boundaries, str):
            boundaries = [boundaries] * 3
        self.periodic = tuple(word == "periodic" for word in boundaries)
        self.initial = lattice.get("initial", "field")
        self.step_s = float(tables.get("time", {}).get("step_s", 10.0))
        field = tables.get("field", {})
        self.background = probabilities(field.get("background", {}), (0, 0, 0.1))
        self.ellipsoids = field.get("ellipsoids", [])
        self.scatters = field.get("scatters", [])
        self.wind = tables.get("wind", [])

    def wind_at(self, height_m, time_s):
        """(east, north) in m/s; profiles are linear in height and mixed linearly in time."""
        if not self.wind:
            return 0.0, 0.0
        profiles = []
        for keyframe in self.wind:
            heights = [level["height_m"] for level in keyframe["levels"]]
            velocities = [level_velocity(level) for level in keyframe["levels"]]
            profiles.append([np.interp(height_m, heights, [v[axis] for v in velocities]) for axis in (0, 1)])
        times = [keyframe.get("time_s", 0.0) for keyframe in self.wind]
        return tuple(float(np.interp(time_s, times, [profile[axis] for profile in profiles])) for axis in (0, 1))

    def box_m(self, axis):
        return self.origin_m[axis], self.origin_m[axis] + self.shape[2 - axis] * self.cell_m


def level_velocity(level):
    if "from_deg" in level:
        angle = math.radians(level["from_deg"])
        return -level["speed_m_per_s"] * math.sin(angle), -level["speed_m_per_s"] * math.cos(angle)
    return level.get("east_m_per_s", 0.0), level.get("north_m_per_s", 0.0)


class Simulation:
    def __init__(self, scene, seed):
        self.scene = scene
        self.random = np.random.Generator(np.random.SFC64(seed))
        self.steps = 0
        self.parcels = [self.placed(table) for table in scene.ellipsoids]
        for scatter in scene.scatters:
            self.parcels += [self.drawn(scatter) for _ in range(scatter["count"])]
        self.moved_x = np.zeros(scene.shape[0])
        self.moved_y = np.zeros(scene.shape[0])
        self.hum, self.act, self.cld = (np.zeros(scene.shape, bool) for _ in range(3))
        if scene.initial == "field":
            p_hum, p_act, _ = probability_field(scene, self.parcels, 0.0)
            self.hum = self.random.random(scene.shape, np.float32) < p_hum
            self.act = self.random.random(scene.shape, np.float32) < p_act

    @staticmethod
    def placed(table):
        return Parcel(table["centre_m"], table.get("semi_axes_m", (500, 500, 300)), table.get("yaw_deg", 0),
                      probabilities(table.get("centre", {}), (0.1, 0.001, 0.1)),
                      probabilities(table.get("rim", {}), (0, 0, 0.1)), table.get("birth_s", 0),
                      table.get("life_s", math.inf), table.get("fade_in_s", 0), table.get("fade_out_s", 0),
                      table.get("carried", True))

    def drawn(self, scatter, birth_s=None):
        def draw(key, otherwise):
            value = scatter.get(key, otherwise)
            low, high = value if isinstance(value, (list, tuple)) else (value, value)
            return low if low == high else self.random.uniform(low, high)

        centre = [draw(key, self.scene.box_m(axis)) for axis, key in enumerate(("x_m", "y_m", "z_m"))]
        axes = (draw("semi_axis_x_m", (400, 900)), draw("semi_axis_y_m", (400, 900)),
                draw("semi_axis_z_m", (200, 500)))
        parcel = Parcel(centre, axes, draw("yaw_deg", (0, 180)),
                      probabilities(scatter.get("centre", {}), (0.1, 0.001, 0.1)),
                      probabilities(scatter.get("rim", {}), (0, 0, 0.1)),
                      draw("birth_s", 0) if birth_s is None else birth_s, draw("life_s", math.inf),
                      scatter.get("fade_in_s", 0), scatter.get("fade_out_s", 0), scatter.get("carried", True), scatter)
        if "thermals" in scatter:
            rise = scatter["thermals"].get("rise_m", 800)
            low, high = rise if isinstance(rise, (list, tuple)) else (rise, rise)
            parcel.rise_m = low if low == high else self.random.uniform(low, high)
        parcel.random = self.random
        return parcel

    def step(self):
        scene, time_s = self.scene, self.steps * self.scene.step_s
        planes = grow(self.hum, self.act, self.cld, scene.periodic)
        planes = extinguish_and_bear(*planes, probability_field(scene, self.parcels, time_s), self.random)
        self.hum, self.act, self.cld = self.advected(planes, time_s)
        self.carry_parcels(time_s)
        self.steps += 1

    def advected(self, planes, time_s):
        scene = self.scene
        heights = scene.origin_m[2] + (np.arange(scene.shape[0]) + 0.5) * scene.cell_m
        wind = np.array([scene.wind_at(height, time_s) for height in heights]) * (scene.step_s / scene.cell_m)
        before_x, before_y = np.floor(self.moved_x), np.floor(self.moved_y)
        self.moved_x += wind[:, 0]
        self.moved_y += wind[:, 1]
        cells_x, cells_y = np.floor(self.moved_x) - before_x, np.floor(self.moved_y) - before_y
        if not cells_x.any() and not cells_y.any():
            return planes
        return advect(planes, cells_x, cells_y, scene.periodic)

    def carry_parcels(self, time_s):
        scene = self.scene
        end_s = (self.steps + 1) * scene.step_s
        for index, parcel in enumerate(self.parcels):
            if parcel.carried and time_s >= parcel.birth_s:
                east, north = scene.wind_at(parcel.centre_m[2], time_s)
                parcel.centre_m[0] += east * scene.step_s
                parcel.centre_m[1] += north * scene.step_s
            for axis in (0, 1):
                if scene.periodic[axis]:
                    low, high = scene.box_m(axis)
                    parcel.centre_m[axis] = low + (parcel.centre_m[axis] - low) % (high - low)
            scatter = parcel.scatter
            if scatter is None or not scatter.get("replace", False):
                continue
            left = self.left_through(parcel)
            if left is not None:
                self.parcels[index] = self.upwind(scatter, left, end_s)
            elif end_s >= parcel.birth_s + parcel.life_s:
                self.parcels[index] = self.drawn(scatter, end_s)

    def left_through(self, parcel):
        """(axis, side) of the open boundary that the whole parcel has passed; None while it is inside."""
        reach = parcel.reach_m()
        for axis in (0, 1):
            low, high = self.scene.box_m(axis)
            if not self.scene.periodic[axis]:
                if parcel.centre_m[axis] - reach[axis] > high:
                    return axis, 1
                if parcel.centre_m[axis] + reach[axis] < low:
                    return axis, 0
        return None

    def upwind(self, scatter, left, birth_s):
        parcel = self.drawn(scatter, birth_s)
        axis, side = left
        low, high = self.scene.box_m(axis)
        reach = parcel.reach_m()[axis]
        parcel.centre_m[axis] = low - reach if side == 1 else high + reach
        return parcel


# --- the command ----------------------------------------------------------------------------------------------

# The load of scenes/cumulus.toml, for timing without a scene.
DEFAULT_TABLES = {
    "lattice": {"cell_size_m": 40, "origin_m": [0, 0, 1000], "boundaries": ["periodic", "periodic", "open"]},
    "field": {"background": {"ext": 0.3},
              "scatters": [{"count": 52, "z_m": [1000, 1060], "semi_axis_x_m": [350, 900], "semi_axis_y_m": [350, 700],
                            "semi_axis_z_m": [250, 720], "rim": {"hum": 0.01, "ext": 0.35}}]},
    "wind": [{"levels": [{"height_m": 1000, "from_deg": 260, "speed_m_per_s": 5},
                         {"height_m": 1800, "from_deg": 275, "speed_m_per_s": 8}]}],
}


def main():
    parser = argparse.ArgumentParser(description="The automaton in vectorised NumPy: time of a step, as JSON.")
    parser.add_argument("--scene", help="scene file; without it, ellipsoids at random in --cells")
    parser.add_argument("--cells", type=int, nargs=3, metavar=("X", "Y", "Z"), help="size of the lattice")
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--statistics", action="store_true", help="a line of counts per step on standard error")
    parser.add_argument("--dump", help="write the cloud plane after every step to this .npz file")
    arguments = parser.parse_args()
    if arguments.steps < 1 or (arguments.cells and min(arguments.cells) < 1):
        parser.error("--steps and --cells take numbers above 0")
    tables = DEFAULT_TABLES
    if arguments.scene:
        with open(arguments.scene, "rb") as file:
            tables = tomllib.load(file)

    simulation = Simulation(Scene(tables, arguments.cells), arguments.seed)
    times_ms, planes = [], []
    for step in range(1, arguments.steps + 1):
        start = time.perf_counter()
        simulation.step()
        times_ms.append((time.perf_counter() - start) * 1000)
        if arguments.statistics:
            cover = simulation.cld.any(axis=0).mean()
            print(f"{step} hum {simulation.hum.sum()} act {simulation.act.sum()} cld {simulation.cld.sum()} "
                  f"cover {cover:.3f}", file=sys.stderr)
        if arguments.dump:
            planes.append(np.packbits(simulation.cld, axis=None))
    if arguments.dump:
        np.savez_compressed(arguments.dump, planes=np.array(planes), shape=np.array(simulation.scene.shape))
    print(json.dumps({"cells": list(reversed(simulation.scene.shape)), "steps": arguments.steps,
                      "ms_per_step": statistics.median(times_ms), "ms_per_step_min": min(times_ms)}))


if __name__ == "__main__":
    main()
