// SPDX-License-Identifier: Apache-2.0
// Reads a KTX 2 file by ktx-parse, and prints what it found as JSON.

import { readFileSync } from "node:fs";
import { read } from "../../../vendor/ktx-parse/index.mjs";

const file = read(new Uint8Array(readFileSync(process.argv[2])));
const { width, height } = { width: file.pixelWidth, height: file.pixelHeight };
console.log(JSON.stringify({
    vkFormat: file.vkFormat,
    typeSize: file.typeSize,
    size: [width, height, file.pixelDepth],
    layers: file.layerCount,
    faces: file.faceCount,
    supercompression: file.supercompressionScheme,
    levels: file.levels.map((level) => [level.levelData.length, level.uncompressedByteLength]),
    first: Array.from(file.levels[0].levelData.slice(0, 4096)),
    model: file.dataFormatDescriptor[0].colorModel,
    texelBlock: file.dataFormatDescriptor[0].texelBlockDimension,
    bytesPlane: file.dataFormatDescriptor[0].bytesPlane,
    samples: file.dataFormatDescriptor[0].samples.map((sample) => [sample.bitOffset, sample.bitLength]),
    keys: Object.fromEntries(Object.entries(file.keyValue).map(([key, value]) =>
        [key, typeof value === "string" ? value : new TextDecoder().decode(value)])),
}));
