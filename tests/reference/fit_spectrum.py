#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Prints the coefficients of render/atmosphere/spectrum.h: radiances at six wavelengths, each relative to the sun's
above the air, as linear sRGB. Least squares over light that has passed and was scattered by many columns of air, against
integration in steps of 1 nm. Sources:

    matching functions  C. Wyman, P.-P. Sloan, P. Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching
                        Functions", JCGT 2(2), 2013, equation 4 (CIE 1931, 2 degrees)
    sun                 ASTM G-173, extraterrestrial, means over 10 nm, W / (m^2 nm)
    ozone               cross sections at 233 K, means over 10 nm, m^2: Gorshelev and others, Serdyuchenko and others,
                        AMT 7, 2014; 300 Dobson units, in a tent of 2 x 15 km
    white               Bradford's matrix: the sun at 60 degrees through the Earth's air becomes D65"""

import itertools

import numpy

WAVELENGTHS = numpy.array([415.0, 455, 520, 565, 620, 695])
SUN = [1.11776, 1.14259, 1.01249, 1.14716, 1.72765, 1.73054, 1.6887, 1.61253, 1.91198, 2.03474, 2.02042, 2.02212,
       1.93377, 1.95809, 1.91686, 1.8298, 1.8685, 1.8931, 1.85149, 1.8504, 1.8341, 1.8345, 1.8147, 1.78158, 1.7533,
       1.6965, 1.68194, 1.64654, 1.6048, 1.52143, 1.55622, 1.5113, 1.474, 1.4482, 1.41018, 1.36775, 1.34188, 1.31429,
       1.28303, 1.26758]  # from 360 nm on, 10 nm apart
OZONE = [1.18e-27, 2.182e-28, 2.818e-28, 6.636e-28, 1.527e-27, 2.763e-27, 5.52e-27, 8.451e-27, 1.582e-26, 2.316e-26,
         3.669e-26, 4.924e-26, 7.752e-26, 9.016e-26, 1.48e-25, 1.602e-25, 2.139e-25, 2.755e-25, 3.091e-25, 3.5e-25,
         4.266e-25, 4.672e-25, 4.398e-25, 4.701e-25, 5.019e-25, 4.305e-25, 3.74e-25, 3.215e-25, 2.662e-25, 2.238e-25,
         1.852e-25, 1.473e-25, 1.209e-25, 9.423e-26, 7.455e-26, 6.566e-26, 5.105e-26, 4.15e-26, 4.228e-26, 3.237e-26]
DOBSON = 2.687e20  # molecules / m^2
RGB_OF_XYZ = numpy.array([[3.2404542, -1.5371385, -0.4985314], [-0.969266, 1.8760108, 0.041556],
                          [0.0556434, -0.2040259, 1.0572252]])  # IEC 61966-2-1
D65 = numpy.array([0.95047, 1, 1.08883])
BRADFORD = numpy.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
HEIGHTS = 8000, 1200, 15000  # of the columns of molecules, haze and ozone, metres

nm = numpy.arange(380.0, 750)
tens = numpy.arange(360.0, 760, 10)


def lobe(height, middle, below, above):
    return height * numpy.exp(-0.5 * ((nm - middle) * numpy.where(nm < middle, below, above)) ** 2)


def extinctions(wavelengths):
    """Of molecules, haze and ozone, per metre; those of the model at the ground and at its densest ozone."""
    molecules = 1.24062e-6 * (wavelengths / 1000) ** -4.0
    ozone = numpy.interp(wavelengths, tens, OZONE) * 300 * DOBSON / HEIGHTS[2]
    return molecules, 4.44e-6 + 0 * wavelengths, ozone


matching = numpy.stack([
    lobe(0.362, 442.0, 0.0624, 0.0374) + lobe(1.056, 599.8, 0.0264, 0.0323) - lobe(0.065, 501.1, 0.0490, 0.0382),
    lobe(0.821, 568.8, 0.0213, 0.0247) + lobe(0.286, 530.9, 0.0613, 0.0322),
    lobe(1.217, 437.0, 0.0845, 0.0278) + lobe(0.681, 459.0, 0.0385, 0.0725)])
weights = matching * numpy.interp(nm, tens, SUN)
weights /= weights[1].sum()
depth = sum(e * height for e, height in zip(extinctions(nm), HEIGHTS)) / numpy.sin(numpy.radians(60))
noon = (weights * numpy.exp(-depth)).sum(1)
gains = (BRADFORD @ D65) / (BRADFORD @ (noon / noon[1]))
exact = RGB_OF_XYZ @ numpy.linalg.inv(BRADFORD) @ numpy.diag(gains) @ BRADFORD @ weights


def family(wavelengths):
    """Spectra of sunlight behind columns of air, of what it scatters once, and of what thick air scatters."""
    molecules, haze, ozone = extinctions(wavelengths)
    for air, more, hazy in itertools.product([0, 1, 2, 5, 10, 20, 38], [0, 1, 5, 12], [0, 1, 10]):
        left = numpy.exp(-air * (molecules * HEIGHTS[0] + hazy * haze * HEIGHTS[1]) - more * ozone * HEIGHTS[2])
        yield left
        yield left * molecules * 1e5
        yield left * (1 - numpy.exp(-molecules * HEIGHTS[0] * 20))


goal = numpy.array([exact @ spectrum for spectrum in family(nm)])
given = numpy.array(list(family(WAVELENGTHS)))
scale = 1 / numpy.abs(goal).max(1, keepdims=True)
fit = numpy.linalg.lstsq(given * scale, goal * scale, rcond=None)[0]
error = numpy.abs(given @ fit - goal) * scale
print(f"// largest error {error.max():.5f}, mean {error.mean():.5f}")
for row in fit.T:
    print(", ".join(f"{value:.9g}" for value in row) + ",")
print("// ozone per metre")
print(", ".join(f"{value:.6g}" for value in extinctions(WAVELENGTHS)[2]))
print("// sun above the air", fit.sum(0), "exactly", exact.sum(1))
print("// thin air: molecules, ozone", *[(exact @ e) / exact.sum(1) for e in extinctions(nm)[::2]])
# Samples for tests/render/spectrum_test.cpp: columns of air, of ozone, haze, kind of spectrum, exact colour.
kinds = itertools.product([0, 1, 2, 5, 10, 20, 38], [0, 1, 5, 12], [0, 1, 10], [0, 1, 2])
for number, (kind, colour) in enumerate(zip(kinds, goal)):
    if number % 23 == 0:
        print("{" + ", ".join(f"{v}" for v in kind) + ", {" + ", ".join(f"{v:.6g}" for v in colour) + "}},")
