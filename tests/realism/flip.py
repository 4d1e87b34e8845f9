#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""LDR-FLIP, the difference that a person sees when two pictures alternate: 0 none, 1 the largest. From the paper:
Andersson, Nilsson, Akenine-Moller, Oskarsson, Astrom and Fairchild 2020, "FLIP: A Difference Evaluator for Alternating
Images", Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2).

    flip.py reference.png test.png [map.png]          prints the mean

Agrees with the implementation of its authors within 3e-5 (flip_test.py)."""

import math
import sys

import numpy
from PIL import Image

# An observer 0.7 m before a screen 0.7 m and 3840 pixels wide.
PIXELS_PER_DEGREE = 0.7 * 3840 / 0.7 * math.pi / 180

# Two Gaussians (a, b) for each of the channels Y, Cx, Cz.
CONTRAST = (((1.0, 0.0047), (0.0, 1e-5)), ((1.0, 0.0053), (0.0, 1e-5)), ((34.1, 0.04), (13.5, 0.025)))
COLOUR_EXPONENT, FEATURE_EXPONENT = 0.7, 0.5  # q_c, q_f
SPLIT, SPLIT_TARGET = 0.4, 0.95               # p_c, p_t: redistribution of errors
FEATURE_DEGREES = 0.082                       # width of the features that the eye finds


def pixels_of(path):
    """The picture of a file: height x width x 3, bytes."""
    with Image.open(path) as picture:
        return numpy.asarray(picture.convert("RGB"))


def _rgb_to_xyz():
    """Columns: XYZ of the primaries of Rec. 709 such that their sum is the white D65."""
    def xyz(x, y):
        return numpy.array([x / y, 1, (1 - x - y) / y])

    primaries = numpy.stack([xyz(0.64, 0.33), xyz(0.30, 0.60), xyz(0.15, 0.06)], axis=1)
    return primaries * numpy.linalg.solve(primaries, xyz(0.3127, 0.3290))


RGB_TO_XYZ = _rgb_to_xyz()
WHITE = RGB_TO_XYZ.sum(axis=1)


def to_linear(srgb):
    return numpy.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def to_opponent(linear):
    """Y, Cx, Cz: CIELAB without its cube root, in which light adds up."""
    x, y, z = numpy.moveaxis(linear @ RGB_TO_XYZ.T / WHITE, -1, 0)
    return numpy.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def from_opponent(opponent):
    y = (opponent[..., 0] + 16) / 116
    xyz = numpy.stack([y + opponent[..., 1] / 500, y, y - opponent[..., 2] / 200], axis=-1)
    return xyz * WHITE @ numpy.linalg.inv(RGB_TO_XYZ).T


def to_lab(linear):
    relative = linear @ RGB_TO_XYZ.T / WHITE
    edge = 6 / 29
    f = numpy.where(relative > edge**3, numpy.cbrt(relative), relative / (3 * edge**2) + 4 / 29)
    x, y, z = numpy.moveaxis(f, -1, 0)
    return numpy.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def hunt(lab):
    """Colours look less colourful where it is dark."""
    return lab * numpy.stack([numpy.ones_like(lab[..., 0]), 0.01 * lab[..., 0], 0.01 * lab[..., 0]], axis=-1)


def hyab(a, b):
    difference = a - b
    return abs(difference[..., 0]) + numpy.hypot(difference[..., 1], difference[..., 2])


def filtered(channel, across, down):
    """Both kernels have an odd length; beyond its edge a picture goes on as it ends."""
    for axis, kernel in ((1, across), (0, down)):
        reach = len(kernel) // 2
        padding = [(reach, reach) if each == axis else (0, 0) for each in range(2)]
        padded = numpy.pad(channel, padding, mode="edge")
        size = channel.shape[axis]
        channel = sum(
            weight * padded.take(range(i, i + size), axis=axis) for i, weight in enumerate(kernel))
    return channel


def contrast_filtered(opponent, pixels_per_degree):
    """What the eye does not resolve is gone."""
    largest = max(b for channel in CONTRAST for _, b in channel)
    reach = math.ceil(3 * math.sqrt(largest / (2 * math.pi**2)) * pixels_per_degree)
    degrees = numpy.arange(-reach, reach + 1) / pixels_per_degree
    result = numpy.empty_like(opponent)
    for i, gaussians in enumerate(CONTRAST):
        total, weights = 0, 0
        for a, b in gaussians:
            kernel = numpy.exp(-((math.pi * degrees) ** 2) / b)
            weight = a * math.sqrt(math.pi / b)
            weights += weight * kernel.sum() ** 2
            if weight > 0:
                total = total + weight * filtered(opponent[..., i], kernel, kernel)
        result[..., i] = total / weights
    return result


def colour_difference(reference, test, pixels_per_degree):
    """Of pictures in Y, Cx, Cz: 0..1."""
    def seen(opponent):
        linear = from_opponent(contrast_filtered(opponent, pixels_per_degree))
        return hunt(to_lab(numpy.clip(linear, 0, 1)))

    difference = hyab(seen(reference), seen(test)) ** COLOUR_EXPONENT
    green, blue = hunt(to_lab(numpy.array([[0.0, 1, 0], [0, 0, 1]])))
    largest = hyab(green, blue) ** COLOUR_EXPONENT
    split = SPLIT * largest
    below = SPLIT_TARGET / split * difference
    above = SPLIT_TARGET + (difference - split) / (largest - split) * (1 - SPLIT_TARGET)
    return numpy.where(difference < split, below, above)


def feature_difference(reference, test, pixels_per_degree):
    """Of luminances 0..1: 0..1."""
    deviation = 0.5 * FEATURE_DEGREES * pixels_per_degree
    reach = math.ceil(3 * deviation)
    x = numpy.arange(-reach, reach + 1)
    blur = numpy.exp(-(x**2) / (2 * deviation**2))

    def balanced(kernel):
        return numpy.where(kernel > 0, kernel / kernel[kernel > 0].sum(), -kernel / kernel[kernel < 0].sum())

    edge, point = balanced(-x * blur), balanced((x**2 / deviation**2 - 1) * blur)
    blur = blur / blur.sum()

    def strength(luminance, kernel):
        return numpy.hypot(filtered(luminance, kernel, blur), filtered(luminance, blur, kernel))

    differences = [abs(strength(reference, kernel) - strength(test, kernel)) for kernel in (edge, point)]
    return (numpy.maximum(*differences) / math.sqrt(2)) ** FEATURE_EXPONENT


def flip(reference, test, pixels_per_degree=PIXELS_PER_DEGREE):
    """Map of the difference, 0..1, of two pictures in sRGB, height x width x 3, 0..1, of the same size."""
    if reference.shape != test.shape or reference.ndim != 3 or reference.shape[2] != 3:
        raise ValueError(f"pictures of {reference.shape} and {test.shape}: expected height x width x 3, both the same")
    opponents = [to_opponent(to_linear(numpy.asarray(each, dtype=float))) for each in (reference, test)]
    colour = colour_difference(*opponents, pixels_per_degree)
    feature = feature_difference(*((each[..., 0] + 16) / 116 for each in opponents), pixels_per_degree)
    return colour ** (1 - feature)


def heat(values):
    """Bytes of a picture of a map: black over violet and orange to pale yellow."""
    stops = numpy.array([[0, 0, 4], [80, 18, 123], [182, 54, 121], [251, 136, 97], [252, 253, 191]])
    places = numpy.linspace(0, 1, len(stops))
    return numpy.stack([numpy.interp(values, places, stops[:, c]) for c in range(3)], axis=-1).round().astype(numpy.uint8)


def main():
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    values = flip(*(pixels_of(path) / 255 for path in sys.argv[1:3]))
    print(f"{values.mean():.6f}")
    if len(sys.argv) == 4:
        Image.fromarray(heat(values)).save(sys.argv[3])


if __name__ == "__main__":
    main()
