// SPDX-License-Identifier: Apache-2.0
// Parses a USD text file by tinyusdz, and says so. Exit status 1 with tinyusdz' message where
// it is no USD. tinyusdz is built for browsers: it looks for their window, and takes Node for something else.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

globalThis.window = globalThis;
process.type = "renderer";
globalThis.require = createRequire(import.meta.url);
const vendor = new URL("../../../vendor/tinyusdz/", import.meta.url);
const { default: initialise } = await import(new URL("tinyusdz.js", vendor));
const tinyusdz = await initialise({ wasmBinary: readFileSync(new URL("tinyusdz.wasm", vendor)) });
const loader = new tinyusdz.TinyUSDZLoaderNative();
const good = loader.loadAsLayerFromBinary(new Uint8Array(readFileSync(process.argv[2])), process.argv[2]);
if (!good) {
    console.error(loader.error());
    process.exit(1);
}
console.log("parsed");
