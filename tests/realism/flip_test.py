#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""FLIP against the numbers that the authors' implementation (github.com/NVlabs/flip, 67.02 pixels per degree)
gives for the pictures that are made here, and against what the definition says of simple ones."""

import sys
import unittest

import numpy

import flip

WIDTH, HEIGHT = 48, 40


def picture(value):
    """`value`: of column, row, channel, to 0..255."""
    return numpy.array([[[value(x, y, c) for c in range(3)] for x in range(WIDTH)] for y in range(HEIGHT)]) / 255


def constant(red, green, blue):
    return picture(lambda x, y, c: (red, green, blue)[c])


# Reference, test, mean, and the map at (x, y) = (24, 20), (0, 0) and (31, 7).
PUBLISHED = {
    "ramps": (
        picture(lambda x, y, c: (x * 5 + y * 3 + c * 40) % 256),
        picture(lambda x, y, c: (x * 5 + y * 3 + c * 40) % 256 * 9 // 10),
        0.339974, (0.396444, 0.150781, 0.373772)),
    "checks": (
        picture(lambda x, y, c: 230 - 20 * c if (x // 6 + y // 5) % 2 else 30 + 25 * c),
        picture(lambda x, y, c: 230 - 20 * c if ((x + 1) // 6 + y // 5) % 2 else 30 + 25 * c),
        0.279891, (0.275823, 0.056757, 0.402497)),
    "rough": (
        picture(lambda x, y, c: (x * x * 7 + y * y * 13 + x * y * 3 + c * 57) % 256),
        picture(lambda x, y, c: (x * x * 7 + y * y * 13 + x * y * 3 + c * 57 + (30 if x > 24 else 0)) % 256),
        0.188383, (0.210455, 0.0, 0.234650)),
    "a dot": (
        constant(128, 128, 128),
        picture(lambda x, y, c: 255 if (x, y) == (24, 20) else 128),
        0.002240, (0.378678, 0.0, 0.0)),
    "green and blue": (constant(0, 255, 0), constant(0, 0, 255), 1.0, (1.0, 1.0, 1.0)),
    "black and white": (constant(0, 0, 0), constant(255, 255, 255), 0.967401, (0.967388, 0.967388, 0.967388)),
}


class FlipTest(unittest.TestCase):
    def test_gives_the_published_values(self):
        for name, (reference, test, mean, (middle, corner, elsewhere)) in PUBLISHED.items():
            with self.subTest(name):
                values = flip.flip(reference, test)
                self.assertAlmostEqual(values.mean(), mean, delta=3e-5)
                self.assertAlmostEqual(values[20, 24], middle, delta=3e-5)
                self.assertAlmostEqual(values[0, 0], corner, delta=3e-5)
                self.assertAlmostEqual(values[7, 31], elsewhere, delta=3e-5)

    def test_is_zero_for_the_same_and_symmetric(self):
        for name, (reference, test, _, _) in PUBLISHED.items():
            with self.subTest(name):
                self.assertEqual(flip.flip(reference, reference).max(), 0)
                numpy.testing.assert_allclose(flip.flip(reference, test), flip.flip(test, reference), atol=1e-12)

    # No features: the lightness L = 100 of white is all the difference to black, and 0.4 of the largest one, that of
    # green and blue, is where the upper 5 % of the scale begin.
    def test_black_and_white_by_hand(self):
        green, blue = flip.hunt(flip.to_lab(numpy.array([[0.0, 1, 0], [0, 0, 1]])))
        largest = flip.hyab(green, blue) ** 0.7
        expected = 0.95 + (100**0.7 - 0.4 * largest) / (0.6 * largest) * 0.05
        values = flip.flip(constant(0, 0, 0), constant(255, 255, 255))
        numpy.testing.assert_allclose(values, expected, atol=1e-9)

    def test_grows_with_the_difference(self):
        means = [flip.flip(constant(100, 100, 100), constant(100 + d, 100 + d, 100)).mean() for d in range(0, 150, 10)]
        self.assertTrue(all(a < b for a, b in zip(means, means[1:])), means)
        self.assertTrue(0 <= means[0] and means[-1] <= 1)

    def test_refuses_pictures_of_two_sizes(self):
        with self.assertRaises(ValueError):
            flip.flip(constant(0, 0, 0), constant(0, 0, 0)[:-1])


if __name__ == "__main__":
    sys.exit(unittest.main())
