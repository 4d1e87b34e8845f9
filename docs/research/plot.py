#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Plots of a study as SVG, with Python's standard library alone.

    plot.py points SWEEP/points.csv field.background.ext cover 0.3 0.03 > picture.svg    a statistic along an axis
    plot.py posterior FIT/posterior.csv > picture.svg                                    two parameters of a fit

The first draws means with their 95 % intervals, a line for each value of the other axes, and the band of a target; the second the 1,000 points of the posterior on
logarithmic axes."""

import csv
import math
import sys
from xml.sax.saxutils import escape

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 640, 400, 95, 20, 20, 55


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def ticks(low, high, log):
    if log:
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        return [m * 10.0 ** p for p in powers for m in (1, 2, 5) if low <= m * 10.0 ** p <= high]
    step = 10 ** math.floor(math.log10((high - low) / 4))
    step *= next(m for m in (1, 2, 5, 10) if (high - low) / (m * step) <= 7)
    return [n * step for n in range(math.ceil(low / step), math.floor(high / step + 1e-9) + 1)]


class Plot:
    def __init__(self, x, y, x_label, y_label, log=False):
        self.log, self.x, self.y = log, x, y
        self.out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
                    f'height="{HEIGHT}" font-family="sans-serif" font-size="13">',
                    f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>']
        for value in ticks(*x, log):
            at = self.at_x(value)
            self.out.append(f'<path d="M{at:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>'
                            f'<text x="{at:.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{value:g}</text>')
        for value in ticks(*y, log):
            at = self.at_y(value)
            self.out.append(f'<path d="M{LEFT} {at:.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>'
                            f'<text x="{LEFT - 8}" y="{at + 4:.1f}" text-anchor="end">{value:g}</text>')
        self.out.append(f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{HEIGHT - 12}" text-anchor="middle">{x_label}</text>'
                        f'<text transform="translate(16 {(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)" '
                        f'text-anchor="middle">{y_label}</text>')

    def scaled(self, value, limits):
        if self.log:
            value, limits = math.log(value), [math.log(limit) for limit in limits]
        return (value - limits[0]) / (limits[1] - limits[0])

    def at_x(self, value):
        return LEFT + self.scaled(value, self.x) * (WIDTH - LEFT - RIGHT)

    def at_y(self, value):
        return HEIGHT - BOTTOM - self.scaled(value, self.y) * (HEIGHT - TOP - BOTTOM)

    def text(self):
        return "\n".join(self.out + ["</svg>"])


def points(path, key, statistic, target, band):
    rows = [row for row in rows_of(path) if row[statistic]]
    xs = [float(row[key]) for row in rows]
    ys = [float(row[statistic]) for row in rows]
    margin = 0.05 * (max(xs) - min(xs))
    plot = Plot((min(xs) - margin, max(xs) + margin), (0, 1.1 * max(ys)), key, statistic)
    high, low = plot.at_y(target + band), plot.at_y(target - band)
    plot.out.append(f'<rect x="{LEFT}" y="{high:.1f}" width="{WIDTH - LEFT - RIGHT}" height="{low - high:.1f}" '
                    'fill="#2a7" fill-opacity="0.25"/>')
    columns = list(rows[0])
    others = [column for column in columns[1:columns.index("runs")] if column != key]  # a line for each of their values
    lines = {}
    for row, x, y in zip(rows, xs, ys):
        lines.setdefault(tuple(row[column] for column in others), []).append((x, y))
    for values, line in lines.items():
        along = " ".join(f"{plot.at_x(x):.1f},{plot.at_y(y):.1f}" for x, y in sorted(line))
        plot.out.append(f'<polyline points="{along}" fill="none" stroke="#25c"/>')
        if others:
            name = escape(", ".join(f"{column} = {value}" for column, value in zip(others, values)))
            x, y = max(line)
            plot.out.append(f'<text x="{plot.at_x(x) - 6:.1f}" y="{plot.at_y(y) - 6:.1f}" text-anchor="end">{name}</text>')
    for row, x, y in zip(rows, xs, ys):
        a, b = (plot.at_y(float(row[f"{statistic}_{end}"] or y)) for end in ("low", "high"))
        at = plot.at_x(x)
        plot.out.append(f'<path d="M{at:.1f} {a:.1f}V{b:.1f}M{at - 4:.1f} {a:.1f}h8M{at - 4:.1f} {b:.1f}h8" stroke="black"/>'
                        f'<circle cx="{at:.1f}" cy="{plot.at_y(y):.1f}" r="3" fill="#25c"/>')
    return plot.text()


def posterior(path):
    rows = rows_of(path)
    x_key, y_key = list(rows[0])[:2]
    xs, ys = ([float(row[key]) for row in rows] for key in (x_key, y_key))
    plot = Plot((min(xs) * 0.9, max(xs) * 1.1), (min(ys) * 0.8, max(ys) * 1.25), x_key, y_key, log=True)
    for x, y in zip(xs, ys):
        plot.out.append(f'<circle cx="{plot.at_x(x):.1f}" cy="{plot.at_y(y):.1f}" r="2" fill="#25c" fill-opacity="0.35"/>')
    return plot.text()


def main():
    if len(sys.argv) == 7 and sys.argv[1] == "points":
        print(points(sys.argv[2], sys.argv[3], sys.argv[4], float(sys.argv[5]), float(sys.argv[6])))
    elif len(sys.argv) == 3 and sys.argv[1] == "posterior":
        print(posterior(sys.argv[2]))
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
