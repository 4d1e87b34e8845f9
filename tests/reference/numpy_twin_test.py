# SPDX-License-Identifier: Apache-2.0
"""The NumPy twin follows the rules: the golden vectors of tests/golden/growth.txt cell by cell, exact motion, and the
probabilities within four sigma. What ./bench measures against is thereby the same automaton."""

import math
import pathlib
import sys
import unittest

import numpy as np

import numpy_twin as twin

GOLDEN = pathlib.Path(__file__).resolve().parent.parent / "golden" / "growth.txt"


def golden_cases():
    """(name, periodic, p, [states]); a state is an array (z, y, x) of hum + 2 act + 4 cld."""
    cases, state = [], None
    for line in GOLDEN.read_text().splitlines():
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0] == "case":
            cases.append({"name": line[5:], "states": []})
        elif words[0] == "cells":
            x, y, z = map(int, words[1:])
            shape = (z, y, x)
        elif words[0] == "periodic":
            cases[-1]["periodic"] = tuple(word == "1" for word in words[1:])
        elif words[0] == "p":
            cases[-1]["p"] = tuple(map(float, words[1:]))
        elif words[0] == "step":
            state = []
            cases[-1]["states"].append((shape, state))
        else:
            state.extend(int(digit) for digit in words[0])
    for case in cases:
        case["states"] = [np.array(digits, np.uint8).reshape(shape) for shape, digits in case["states"]]
    return cases


def planes_of(state):
    return [(state >> bit & 1).astype(bool) for bit in range(3)]


def simulation(tables, cells, seed=1):
    return twin.Simulation(twin.Scene(tables, cells), seed)


class NumpyTwinTest(unittest.TestCase):
    def test_golden_vectors(self):
        cases = golden_cases()
        self.assertGreaterEqual(len(cases), 6)
        steps = 0
        for case in cases:
            random = np.random.default_rng(1)
            hum, act, cld = planes_of(case["states"][0])
            for step, expected in enumerate(case["states"][1:], 1):
                hum, act, cld = twin.grow(hum, act, cld, case["periodic"])
                hum, act, cld = twin.extinguish_and_bear(hum, act, cld, case["p"], random)
                got = hum + 2 * act + 4 * cld
                self.assertTrue((got == expected).all(), f"{case['name']}, step {step}")
                steps += 1
        self.assertGreaterEqual(steps, 6 * len(cases))

    def test_motion_never_drifts(self):
        """After n steps a bit has moved floor(n * speed) cells, round a periodic axis; an open one loses it."""
        speed_cells = 0.3
        tables = {"lattice": {"boundaries": ["periodic", "open", "open"], "initial": "empty", "cell_size_m": 10},
                  "time": {"step_s": 10}, "field": {"background": {"ext": 0}},
                  "wind": [{"levels": [{"height_m": 0, "east_m_per_s": speed_cells, "north_m_per_s": -2}]}]}
        run = simulation(tables, (7, 9, 2))
        run.cld[1, 8, 0] = True
        for n in range(1, 25):
            run.step()
            expected = np.zeros_like(run.cld)
            y = 8 - 2 * n
            if y >= 0:
                expected[1, y, math.floor(n * speed_cells + 1e-9) % 7] = True
            self.assertTrue((run.cld == expected).all(), f"step {n}")

    def test_field_of_one_parcel(self):
        """p(u) = rim + (centre - rim) (1 - u^2)^2, against a plain evaluation; the background outside."""
        tables = {"lattice": {"cell_size_m": 10, "initial": "empty"},
                  "field": {"background": {"hum": 0.02, "ext": 0.3},
                            "ellipsoids": [{"centre_m": [100, 70, 50], "semi_axes_m": [60, 30, 40], "yaw_deg": 30,
                                            "centre": {"hum": 0.5, "act": 0.1, "ext": 0.05},
                                            "rim": {"hum": 0.0, "act": 0.01, "ext": 0.5}}]}}
        run = simulation(tables, (20, 15, 11))
        hum, act, ext = twin.probability_field(run.scene, run.parcels, 0.0)
        inside = 0
        for k in range(11):
            for j in range(15):
                for i in range(20):
                    x, y, z = 10 * i + 5 - 100, 10 * j + 5 - 70, 10 * k + 5 - 50
                    along = x * math.cos(math.pi / 6) + y * math.sin(math.pi / 6)
                    across = y * math.cos(math.pi / 6) - x * math.sin(math.pi / 6)
                    square = (along / 60) ** 2 + (across / 30) ** 2 + (z / 40) ** 2
                    expected = (0.02, 0.0, 0.3)
                    if square < 1:
                        inside += 1
                        bump = (1 - square) ** 2
                        expected = (max(0.02, 0.5 * bump), 0.01 + 0.09 * bump, min(0.3, 0.5 - 0.45 * bump))
                    for plane, p in zip((hum, act, ext), expected):
                        self.assertAlmostEqual(float(plane[k, j, i]), p, places=6)
        self.assertGreater(inside, 100)

    def test_probabilities(self):
        """Births and deaths come as often as they should, within four sigma."""
        n, p = 200_000, (0.1, 0.001, 0.25)
        shape = (20, 100, 100)
        random = np.random.default_rng(5)
        empty, full = np.zeros(shape, bool), np.ones(shape, bool)
        hum, act, cld = twin.extinguish_and_bear(empty, empty, full, p, random)
        for got, expected in ((hum.sum(), p[0]), (act.sum(), p[1]), (n - cld.sum(), p[2])):
            self.assertLess(abs(got - n * expected), 4 * math.sqrt(n * expected * (1 - expected)))

    def test_parcels_fade_and_are_replaced(self):
        tables = {"field": {"scatters": [{"count": 5, "life_s": 100, "fade_in_s": 50, "fade_out_s": 25,
                                          "replace": True}]}}
        run = simulation(tables, (32, 32, 8))
        parcel = run.parcels[0]
        self.assertEqual([parcel.weight(t) for t in (-1, 0, 25, 60, 87.5, 100)], [0, 0, 0.5, 1, 0.5, 0])
        for _ in range(11):
            run.step()
        self.assertEqual(len(run.parcels), 5)
        self.assertTrue(all(parcel.birth_s == 100 for parcel in run.parcels))


if __name__ == "__main__":
    sys.exit(unittest.main())
