// SPDX-License-Identifier: Apache-2.0
// Replaces the still figures of series with ones that zoom. Without scripts the still ones stay.
"use strict";
for (const figure of document.querySelectorAll("figure.series")) {
    const still = figure.querySelector("svg");
    const { colour, warmUp, data } = JSON.parse(figure.querySelector("script").textContent);
    const holder = document.createElement("div");
    figure.insertBefore(holder, still);
    const digits = (u, value) => (value === null || value === undefined ? "" : value.toPrecision(3));
    new uPlot({
        width: 440,
        height: 210,
        scales: { x: { time: false } },
        axes: [{ label: "step", size: 34, labelSize: 18 }, { label: "cover", size: 46, labelSize: 18 }],
        legend: { show: false },
        series: [
            { label: "step" },
            { label: "mean", stroke: colour, width: 1.5, value: digits, points: { show: false } },
            { label: "lowest", width: 0, value: digits, points: { show: false } },
            { label: "highest", width: 0, value: digits, points: { show: false } },
        ],
        hooks: {
            drawClear: [(u) => {  // the warm-up, as in the still figure
                const from = Math.max(u.valToPos(0, "x", true), u.bbox.left);
                const to = Math.min(u.valToPos(warmUp, "x", true), u.bbox.left + u.bbox.width);
                u.ctx.fillStyle = "#eef1f5";
                if (to > from) u.ctx.fillRect(from, u.bbox.top, to - from, u.bbox.height);
            }],
        },
        bands: [{ series: [3, 2], fill: colour + "48" }],
    }, data, holder);
    still.style.display = "none";
}
for (const hint of document.querySelectorAll(".zoom"))
    hint.textContent = " Drag to zoom, double-click to see all.";
