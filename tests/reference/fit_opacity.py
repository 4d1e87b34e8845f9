#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the coefficients of render/shared/opacity_fit.h: the opacity of a metaball, 1 - exp(-d column(w)), as a
polynomial w^2 sum_ij c_ij w^i s^(j+1) with s = d / (d + 4), for depth scales d in 0..6. Least squares on a grid with
Lawson's weights, so that the largest error, relative to min(1, d), becomes about as small as it can be."""

import numpy

W_TERMS, S_TERMS, LARGEST = 6, 5, 6.0

w = numpy.linspace(0, 1, 97)[1:]
d = LARGEST * numpy.linspace(0, 1, 81)[1:] ** 3
w, d = (axis.ravel() for axis in numpy.meshgrid(w, d))
s = d / (d + 4)
opacity = 1 - numpy.exp(-d * w**2.5 * (16 / 27 + 128 / 315 * w))
basis = numpy.stack([w ** (2 + i) * s**j for i in range(W_TERMS) for j in range(1, S_TERMS + 1)], 1)
scale = 1 / numpy.minimum(1, d)
weights = numpy.ones_like(opacity)
least = None
for _ in range(80):
    root = numpy.sqrt(weights) * scale
    fit = numpy.linalg.lstsq(basis * root[:, None], opacity * root, rcond=None)[0]
    error = numpy.abs(basis @ fit - opacity) * scale
    if least is None or error.max() < least:
        least, best = error.max(), fit
    weights *= error + 1e-9
    weights /= weights.mean()
print(f"// largest error {least:.6f}")
for row in best.reshape(W_TERMS, S_TERMS):
    print(", ".join(f"{value:.8g}f" for value in row) + ",")
