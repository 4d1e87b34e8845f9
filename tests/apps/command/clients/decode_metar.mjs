// SPDX-License-Identifier: Apache-2.0
// Decodes the reports on standard input, a line each, by metar-taf-parser, and prints them as JSON, a line each. A
// forecast begins with TAF.

import { readFileSync } from "node:fs";
import { parseMetar, parseTAF } from "../../../vendor/metar-taf-parser/metar-taf-parser.js";

for (const line of readFileSync(0, "utf8").split("\n").filter((text) => text !== "")) {
    try {
        console.log(JSON.stringify(line.startsWith("TAF") ? parseTAF(line) : parseMetar(line)));
    } catch (error) {
        console.log(JSON.stringify({ error: String(error), line }));
    }
}
