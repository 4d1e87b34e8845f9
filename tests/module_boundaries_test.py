#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Fails when a folder includes what it may not, a header of another module is private, a public header drags a heavy
one along, two headers have a type of one name, or a source file lacks its licence line or specialises a function
template that no header declares so. The rules are the tables below; the root of the source tree is the argument. With
--self-test the checker itself is tested: it must see each kind of offence."""

import functools
import pathlib
import re
import sys
import tempfile

# Module: the modules that it may include. A module is a folder with a CMakeLists.txt of its own.
MAY_USE = {
    "core": set(),
    "core/png": {"core"},
    "automaton": {"core"},
    "seeds": {"core", "automaton"},
    "statistics": {"core", "automaton"},
    "density": {"core", "core/png", "automaton", "statistics"},
    "render/options": {"core"},
    "render": {"core", "core/png", "automaton", "density", "render/options"},
    "scenes/format": {"core", "automaton", "seeds", "density", "render/options"},
    "scenes/metar": {"core"},
    "simulation": {"core", "automaton", "statistics", "seeds", "density", "render", "render/options", "scenes/format",
                   "scenes/metar"},
    "study": {"core", "core/png", "automaton", "statistics", "seeds", "density", "render/options", "scenes/format", "simulation"},
    "apps/nephos": {"core", "automaton", "statistics", "seeds", "density", "render", "render/options", "scenes/format",
                    "scenes/metar", "simulation", "study"},
    "apps/editor": {"core", "automaton", "statistics", "seeds", "density", "render", "render/options", "scenes/format",
                    "simulation", "apps/nephos"},
    "apps/mpi": {"core", "automaton", "statistics", "density", "scenes/format", "simulation", "study", "apps/nephos"},
    "apps/python": {"core", "automaton", "statistics", "density", "render", "render/options", "scenes/format", "simulation"},
}
# Folders of render/ from the lowest to the highest: each may include those of the rows above its own. The renderer's
# own files, at the root of render/, may include all of them, and none of them may include these.
RENDER_LAYERS = (
    {"shared"},
    {"options"},
    {"image"},
    {"atmosphere"},
    {"cloud"},
    {"frame"},
    {"shading"},
    {"rain", "ground"},
    {"backend"},
    {"gpu"},
    {"vulkan", "cpu", "blended"},
    {"veil"},
    {"terrain"},
)
# render/shared/ is a leaf of plain structs that C++ and GLSL both read.
LEAF = "render/shared/"
# Start of a system header's name: the modules that may include it.
LIBRARIES = {
    "openvdb/": {"density"},
    "nanovdb/": {"density"},
    "zlib.h": {"density", "render", "study"},
    "vulkan/": {"render", "apps/editor"},
    "GLFW/": {"apps/editor"},
    "imgui": {"apps/editor"},
    "backends/imgui": {"apps/editor"},
    "OpenEXR/": {"render"},
    "Imf": {"render"},
    "png.h": {"core/png", "density", "render", "study"},
    "CLI/": {"apps/mpi", "apps/nephos"},
    "mpi.h": {"apps/mpi"},
    "pybind11/": {"apps/python"},
    "toml++/": {"scenes/format"},
    "Random123/": {"core", "automaton", "seeds"},
    "seccomp.h": {"density"},
    "xxhash.h": {"core", "automaton", "render", "scenes/format"},
}
# Seconds and hundreds of megabytes each: never in a public header.
HEAVY = ("openvdb/", "nanovdb/", "vulkan/")
SOURCES = {".h", ".cpp", ".vert", ".frag", ".comp", ".glsl", ".py", ".sh"}
SPECIALISATION = re.compile(r"^template <>\n[^;{]*?(\w+<[\w:]+>)\(", re.MULTILINE)
NAMESPACE_OR_TYPE = re.compile(r"^(?:namespace ([\w:]+) \{|(?:struct|class|enum class|enum|union) (\w+)(?!\w|::)[^;{]*\{)", re.MULTILINE)
INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def module_of(path):
    """The module that a path from the root belongs to: the longest that matches; None outside of all."""
    found = [module for module in MAY_USE if path.startswith(module + "/")]
    return max(found, key=len, default=None)


@functools.cache
def listed_headers(root, module, keyword):
    """Paths from the root of the headers that a module's CMakeLists.txt lists after HEADERS or INTERNAL."""
    text = (root / module / "CMakeLists.txt").read_text(encoding="utf-8")
    call = re.search(r"nephos_module\(([^)]*)\)", text)
    if not call:
        return frozenset()
    words = call.group(1).split()
    current, found = None, set()
    for word in words:
        if word in ("SOURCES", "HEADERS", "INTERNAL"):
            current = word
        elif current == keyword:
            found.add(f"{module}/{word}")
    return frozenset(found)


def render_layer(path):
    """The row of RENDER_LAYERS of a path; one beyond the last for the renderer's own files."""
    parts = path.split("/")
    if len(parts) == 2:
        return len(RENDER_LAYERS)
    return next((row for row, folders in enumerate(RENDER_LAYERS) if parts[1] in folders), None)


def include_problem(root, path, name):
    """What is wrong with the file at `path` including the project's header `name`; None if nothing is."""
    module, other = module_of(path), module_of(name)
    if other is None:
        return None
    if path.startswith("render/") and name.startswith("render/"):
        here, there = render_layer(path), render_layer(name)
        if here is None or there is None:
            return f"{path if here is None else name} stands in no folder of RENDER_LAYERS"
        same_folder = pathlib.PurePath(path).parent == pathlib.PurePath(name).parent
        if there > here or (there == here and not same_folder):
            return f"{'/'.join(path.split('/')[:2])} may not include {name}, which stands above or beside it"
    if name.startswith(LEAF) or module == other:
        return None
    if other not in MAY_USE[module]:
        return f"{module}/ may not include {name}"
    if other.startswith("apps/"):  # programs: no library, so no headers of one
        return None
    if name not in listed_headers(root, other, "HEADERS") | listed_headers(root, other, "INTERNAL"):
        return f"{name} is private to {other}/"
    return None


@functools.cache
def is_declared(root, module, beginning):
    """Whether a header of the module has a specialisation that begins so."""
    return any(beginning in header.read_text(encoding="utf-8") for header in (root / module).rglob("*.h"))


def problems_of(root, file):
    path = file.relative_to(root).as_posix()
    module = module_of(path)
    public = path in listed_headers(root, module, "HEADERS")
    text = file.read_text(encoding="utf-8")
    if "SPDX-License-Identifier: Apache-2.0" not in "\n".join(text.splitlines()[:3]):
        yield "lacks the line SPDX-License-Identifier: Apache-2.0"
    if file.suffix == ".cpp":
        for match in SPECIALISATION.finditer(text):
            if not is_declared(root, module, match.group(1) + "("):
                yield (f"line {text[:match.start()].count(chr(10)) + 1}: {match.group(1)}() is declared in no header: where another file "
                       "uses it, each compiler takes what it likes")
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        quoted, name = match.group(1) == '"', match.group(2)
        if quoted:
            problem = include_problem(root, path, name)
            if problem:
                yield f"line {number}: {problem}"
            if public and module_of(name) and not name.startswith(LEAF) and \
                    name not in listed_headers(root, module_of(name), "HEADERS"):
                yield f"line {number}: a public header includes {name}, which is not installed"
        for library, modules in LIBRARIES.items():
            if name.startswith(library) and module not in modules:
                yield f"line {number}: {module}/ may not use {name}; {', '.join(sorted(modules))} may"
        if public and name.startswith(HEAVY):
            yield f"line {number}: {name} is too heavy for a public header"


def types_of_one_name(files):
    """A problem for each type of a header that another header has in the same namespace: a program with both is none, whatever
    the compiler makes of it."""
    first = {}
    for file in files:
        if file.suffix != ".h":
            continue
        namespace, text = "", file.read_text(encoding="utf-8")
        for match in NAMESPACE_OR_TYPE.finditer(text):
            if match.group(1):
                namespace = match.group(1)
            elif first.setdefault((namespace, match.group(2)), file) != file:
                yield file, (f"line {text[:match.start()].count(chr(10)) + 1}: {namespace}::{match.group(2)} is the name of a type of "
                             f"{first[namespace, match.group(2)].name}, too")


def problems(root):
    files = sorted({file for module in MAY_USE for file in (root / module).rglob("*") if file.suffix in SOURCES})
    found = [(file, problem) for file in files for problem in problems_of(root, file)]
    return files, [f"{file.relative_to(root)}: {problem}" for file, problem in [*found, *types_of_one_name(files)]]


def self_test():
    """A tree with one offence of each kind: every one must be seen, and what is allowed must not be."""
    licence = "// SPDX-License-Identifier: Apache-2.0\n"
    tree = {
        "core/CMakeLists.txt": "nephos_module(core SOURCES a.cpp HEADERS error.h INTERNAL bytes.h)",
        "automaton/CMakeLists.txt": "nephos_module(automaton HEADERS automaton.h heavy.h)",
        "render/CMakeLists.txt": "nephos_module(render HEADERS renderer.h)",
        "core/error.h": licence,
        "core/bytes.h": licence,
        "core/private.h": licence,
        "core/up.h": licence + '#include "automaton/automaton.h"\n',
        "automaton/automaton.h": licence + '#include "core/bytes.h"\n',
        "automaton/heavy.h": licence + "#include <openvdb/openvdb.h>\n",
        "automaton/step.cpp": licence + '#include "core/private.h"\n',
        "automaton/fine.cpp": licence + '#include "core/bytes.h"\n#include "core/error.h"\n',
        "render/renderer.h": licence,
        "render/cloud/splats.h": licence + '#include "render/renderer.h"\n',
        "render/cpu/view.h": licence + '#include "render/vulkan/lists.h"\n',
        "render/vulkan/lists.h": licence + '#include "render/cloud/splats.h"\n',
        "render/bare.cpp": "int x;\n",
        "core/type.h": licence + "namespace a {\nenum class Access {\n",
        "core/type_of_b.h": licence + "namespace b {\nclass Access {\n",
        "core/type_again.h": licence + "struct Access;\nnamespace a {\nstruct Access : Base {\n",
        "core/made.h": licence + "template <>\nint made<float>();\n",
        "core/made.cpp": licence + "template <>\nint made<float>() {}\n",
        "core/hidden.cpp": licence + "template <>\nint a::made<double>() {}\n",
    }
    expected = {"core/up.h", "automaton/automaton.h", "automaton/heavy.h", "automaton/step.cpp",
                "render/cloud/splats.h", "render/cpu/view.h", "render/bare.cpp", "core/hidden.cpp", "core/type_again.h"}
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for module in MAY_USE:
            (root / module).mkdir(parents=True, exist_ok=True)
        for path, text in tree.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")
        found = {problem.split(":")[0] for problem in problems(root)[1]}
    if found != expected:
        sys.exit(f"seen {sorted(found)}, not {sorted(expected)}")
    print(f"{len(expected)} offences seen")


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    root = pathlib.Path(sys.argv[1])
    files, found = problems(root)
    if len(files) < 300:
        sys.exit(f"only {len(files)} source files found below {root}: wrong folder?")
    print("\n".join(found) or f"{len(files)} files keep the boundaries")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
