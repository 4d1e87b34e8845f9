#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Fails when docs/features.md does not agree with the tree: a row names a file, a symbol, a scene, a key or a test that is
not there, or a key that its scene does not have, lacks one of them, or a shipped scene stands in no row. The root of the
source tree is the argument. With a second argument, the `nephos` command, its commands are tried as well: those of the page
run, and of each row `nephos validate` accepts the settings and does not say that one of them has no effect. With --self-test
the checker itself is tested: it must see each kind of wrong row."""

import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib

PAGE = "docs/features.md"
COLUMNS = ("feature", "code", "scene", "test")
GOOGLE_TEST = re.compile(r"^TEST(?:_P|_F)?\((\w+),\s*(\w+)\)", re.M)


def names_of_tests(root):
    """Names Suite.Test of all GoogleTest tests."""
    return {f"{suite}.{name}" for path in (root / "tests").rglob("*.cpp")
            for suite, name in GOOGLE_TEST.findall(path.read_text(encoding="utf-8"))}


def is_key(schema, path):
    """Whether the JSON schema has a key at a path such as layer[0].slab.enabled."""
    at = schema
    for name in re.sub(r"\[\d+\]", "", path).split("."):
        choices = [at, *at.get("anyOf", []), *at.get("oneOf", [])]
        choices += [choice["items"] for choice in choices if isinstance(choice.get("items"), dict)]
        found = [choice["properties"][name] for choice in choices if name in choice.get("properties", {})]
        if not found:
            return False
        at = found[0]
    return True


def has_key(scene, path):
    """Whether a scene says something for a key, in one of the tables of an array at least."""
    found = [tomllib.loads(scene.read_text(encoding="utf-8"))]
    for name in re.sub(r"\[\d+\]", "", path).split("."):
        tables = [each for at in found for each in (at if isinstance(at, list) else [at]) if isinstance(each, dict)]
        found = [table[name] for table in tables if name in table]
    return bool(found)


def rows(text):
    """Line numbers and cells of the rows of all tables, without heads."""
    for number, line in enumerate(text.splitlines(), 1):
        if not line.startswith("|"):
            continue
        cells = [cell.strip() for cell in line.strip().strip("|").split("|")]
        if tuple(cells) != COLUMNS and not set(line) <= set("|-"):
            yield number, cells


def key_of(setting):
    """The key that `--set KEY=VALUE` sets, written as for a shell; none when it is written otherwise."""
    words = shlex.split(setting)
    match = re.fullmatch(r"([^=]+)=.+", words[1]) if len(words) == 2 and words[0] == "--set" else None
    return match.group(1) if match else None


def without_effect(notes, key):
    """The lines of notes that say that a key, or its whole section, has no effect."""
    path = re.sub(r"\[\d+\]", "", key)
    name = path.split(".")[-1]

    def is_of(line):
        section = re.search(r"(?<! of )\[([\w.]+)\]$", line)
        return re.search(rf"`(?:[^`]*\.)?{name}`", line) or section and path.startswith(section.group(1) + ".")
    said = [line[:found.start()] for line in notes.splitlines() if (found := re.search(" ha(?:s|ve) no effect(?! but)", line))]
    return [line for line in said if is_of(line)]


def command_problems(root, nephos):
    """A line for each command of the page that fails, tried in a folder of its own beside the scenes."""
    text = (root / PAGE).read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        (pathlib.Path(folder) / "scenes").symlink_to(root / "scenes")

        def call(*arguments):
            return subprocess.run([nephos, *arguments], cwd=folder, capture_output=True, text=True, check=False)
        for number, line in enumerate(text.splitlines(), 1):
            if line.startswith("    nephos "):
                result = call(*shlex.split(line)[1:])
                if result.returncode != 0:
                    yield f"{PAGE}:{number}: {result.stderr}"
        for number, cells in rows(text):
            scene, *settings = re.findall(r"`([^`]+)`", cells[2])
            settings = [setting for setting in settings if setting.startswith("--")]
            if not settings:
                continue
            result = call("validate", scene, *(word for setting in settings for word in shlex.split(setting)))
            if result.returncode != 0:
                yield f"{PAGE}:{number}: {result.stderr}"
            for setting in settings:
                for note in without_effect(result.stderr, key_of(setting)):
                    yield f"{PAGE}:{number}: {setting}: {note} has no effect"


def row_problems(root, cells, tests, schema):
    """What is wrong with the cells of one row."""
    if len(cells) != len(COLUMNS) or not all(cells):
        yield f"expected {len(COLUMNS)} columns with something in each"
        return
    code, scene, test = (re.findall(r"`([^`]+)`", cell) for cell in cells[1:])
    if len(code) != 2:
        yield "expected a file and a symbol as code"
    elif not (root / code[0]).is_file():
        yield f"there is no {code[0]}"
    elif not re.search(rf"\b{re.escape(code[1])}\b", (root / code[0]).read_text(encoding="utf-8")):
        yield f"{code[0]} has no {code[1]}"
    if not scene or not scene[0].startswith("scenes/"):
        yield "expected a scene"
    elif not (root / scene[0]).is_file():
        yield f"there is no {scene[0]}"
    for setting in scene[1:]:
        if not setting.startswith("--"):
            if not is_key(schema, setting):
                yield f"{setting} is no key"
            elif (root / scene[0]).is_file() and not has_key(root / scene[0], setting):
                yield f"{scene[0]} has no {setting}"
            continue
        key = key_of(setting)
        if not key or not is_key(schema, key):
            yield f"{setting} sets no key"
    if len(test) == 2:
        path = root / test[0]
        if not path.is_file() or not re.search(rf"def {re.escape(test[1])}\b", path.read_text(encoding="utf-8")):
            yield f"{test[0]} has no {test[1]}"
    elif len(test) != 1 or test[0] not in tests:
        yield f"there is no test {' '.join(test) or cells[3]}"


def problems(root):
    """How many rows there are, and a line for each problem."""
    text = (root / PAGE).read_text(encoding="utf-8")
    tests = names_of_tests(root)
    schema = json.loads((root / "scenes" / "nephos.schema.json").read_text(encoding="utf-8"))
    count, found = 0, []
    for number, cells in rows(text):
        count += 1
        found += [f"{PAGE}:{number}: {problem}" for problem in row_problems(root, cells, tests, schema)]
    shown = set(re.findall(r"`(scenes/[^`]+\.toml)`", text))
    shipped = {path.relative_to(root).as_posix() for path in (root / "scenes").rglob("*.toml")}
    found += [f"{PAGE}: no row shows {scene}" for scene in sorted(shipped - shown)]
    return count, found


def self_test():
    head = "| feature | code | scene | test |\n|---|---|---|---|\n"
    good = "| a | `a.h` `thing` | `scenes/a.toml` `--set layer[0].deep.key=1` | `Suite.Test` |\n" \
           "| a | `a.h` `thing` | `scenes/a.toml` `layer[0].flat` | `Suite.Test` |\n"
    wrong = {
        "| b | `gone.h` `thing` | `scenes/a.toml` | `Suite.Test` |": "there is no gone.h",
        "| c | `a.h` `thin` | `scenes/a.toml` | `Suite.Test` |": "a.h has no thin",
        "| d | `a.h` `thing` | `scenes/gone.toml` | `Suite.Test` |": "there is no scenes/gone.toml",
        "| e | `a.h` `thing` | `scenes/a.toml` `--set layer.none=1` | `Suite.Test` |":
            "--set layer.none=1 sets no key",
        "| j | `a.h` `thing` | `scenes/a.toml` `layer.none` | `Suite.Test` |": "layer.none is no key",
        "| k | `a.h` `thing` | `scenes/a.toml` `layer[0].deep` | `Suite.Test` |": "scenes/a.toml has no layer[0].deep",
        "| f | `a.h` `thing` | `scenes/a.toml` | `Suite.Gone` |": "there is no test Suite.Gone",
        "| g | `a.h` `thing` | `scenes/a.toml` | `tests/t.py` `test_gone` |": "tests/t.py has no test_gone",
        "| h | `a.h` `thing` | | `Suite.Test` |": "expected 4 columns with something in each",
        "| i | `a.h` | `scenes/a.toml` | `tests/t.py` `test_it` |": "expected a file and a symbol as code",
    }
    schema = {"properties": {"layer": {"type": "array", "items": {"properties": {
        "flat": {"type": "number"}, "deep": {"properties": {"key": {"type": "number"}}}}}}}}
    tree = {PAGE: head + good + "\n".join(wrong) + "\n", "a.h": "void thing();\n", "scenes/a.toml": "[[layer]]\nflat = 1\n",
            "scenes/b.toml": "",
            "scenes/nephos.schema.json": json.dumps(schema), "tests/t.cpp": "TEST(Suite, Test) {}\n",
            "tests/t.py": "def test_it():\n    pass\n"}
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for path, text in tree.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")
        count, found = problems(root)
    expected = [f"{PAGE}:{number}: {problem}" for number, problem in enumerate(wrong.values(), 5)]
    expected.append(f"{PAGE}: no row shows scenes/b.toml")
    if found != expected or count != len(wrong) + 2:
        sys.exit(f"seen {found}, not {expected}")
    if (key_of("--set 'a[0].b=[{c=1}]'"), key_of("--set a"), key_of("--sat a=1")) != ("a[0].b", None, None):
        sys.exit("settings are not read as a shell does")
    notes = """note: a.toml: layer 'x': `shear_s` has no effect without `automaton`
note: a.toml: `light.cfa` and `x` have no effect
note: a.toml: [water] has no effect: there is none
note: a.toml: `g` of [layer.slab] has no effect
note: a.toml: [wet] has no effect but for its reflection
"""
    seen = ["layer[1].shear_s", "light.cfa", "water.colour", "layer[0].slab.g"]
    unseen = ["layer[0].automaton", "a.shear", "layer[0].slab.halo", "waters.colour", "wet.reflection"]
    if [key for key in seen + unseen if without_effect(notes, key)] != seen:
        sys.exit("notes are not read")
    print(f"{len(expected)} wrong rows seen")


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    root = pathlib.Path(sys.argv[1]).resolve()
    count, found = problems(root)
    for nephos in sys.argv[2:]:
        found += command_problems(root, pathlib.Path(nephos).resolve())
    if count < 50:
        sys.exit(f"only {count} rows found: wrong folder?")
    print("\n".join(found) or f"{count} features, all of them there")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
