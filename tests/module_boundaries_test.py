#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Fails when a folder includes what it may not, a public header drags a heavy one along, or a source file lacks its
licence line. The rules are the table below; the root of the source tree is the argument."""

import functools
import pathlib
import re
import sys

# Folder: the other folders that it may include.
MAY_USE = {
    "automaton": set(),
    "seeds": {"automaton"},
    "density": {"automaton"},
    "render": {"automaton", "density"},
    "scenes": {"automaton", "seeds", "density", "render"},
    "apps": {"automaton", "seeds", "density", "render", "scenes"},
}
# Start of a system header's name: the folders that may include it.
LIBRARIES = {
    "openvdb/": {"density"},
    "vulkan/": {"render"},
    "OpenEXR/": {"render"},
    "Imf": {"render"},
    "png.h": {"render"},
    "CLI/": {"apps"},
    "toml++/": {"scenes"},
    "Random123/": {"automaton", "seeds"},
    "xxhash.h": {"automaton", "render", "scenes"},
}
# Seconds and hundreds of megabytes each: never in a public header (those that the module's CMakeLists.txt lists).
HEAVY = ("openvdb/", "vulkan/")
SOURCES = {".h", ".cpp", ".vert", ".frag", ".comp", ".glsl", ".py", ".sh"}
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


@functools.cache
def public_headers(folder):
    match = re.search(r"\bHEADERS\b([^)]*)\)", (folder / "CMakeLists.txt").read_text(encoding="utf-8"))
    return set(match.group(1).split()) if match else set()


def problems_of(root, file):
    folder = file.relative_to(root).parts[0]
    public = file.name in public_headers(root / folder)
    text = file.read_text(encoding="utf-8")
    if "SPDX-License-Identifier: Apache-2.0" not in "\n".join(text.splitlines()[:3]):
        yield "lacks the line SPDX-License-Identifier: Apache-2.0"
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quoted, name = match.group(1) == '"', match.group(2)
        other = name.split("/")[0]
        if quoted and other in MAY_USE and other != folder and other not in MAY_USE[folder]:
            yield f"line {number}: {folder}/ may not include {name}"
        for library, folders in LIBRARIES.items():
            if name.startswith(library) and folder not in folders:
                yield f"line {number}: {folder}/ may not use {name}; {', '.join(sorted(folders))} may"
        if public and name.startswith(HEAVY):
            yield f"line {number}: {name} is too heavy for a public header"


def main():
    root = pathlib.Path(sys.argv[1])
    files = [f for folder in MAY_USE for f in sorted((root / folder).rglob("*")) if f.suffix in SOURCES]
    if len(files) < 50:
        sys.exit(f"only {len(files)} source files found below {root}: wrong folder?")
    found = [f"{file.relative_to(root)}: {problem}" for file in files for problem in problems_of(root, file)]
    print("\n".join(found) or f"{len(files)} files keep the boundaries")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
