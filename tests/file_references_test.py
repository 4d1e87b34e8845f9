#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Fails when a comment or a document names a file that the tree does not have. Read are the comments of C++, GLSL,
Python, CMake, TOML and shell files and all of the Markdown.

A name with a folder stands at that place from the root of the tree, from the folder of the file that names it or one
above, or from scenes/, as scenes name each other. One without a folder stands anywhere in the tree, or is that of a
header of a library that the tree includes. Links and images of Markdown are followed from the document's folder, and to
the heading behind their #.

The root of the source tree is the argument; with --self-test the checker itself is tested: it must see each kind of
wrong name."""

import ast
import os
import pathlib
import re
import sys
import tempfile
import tokenize

# Names in prose. The endings of what builds and runs write (.vdb, .exr, .csv ...) are not among these, nor are names in
# capitals, which stand for any, or behind <, which are headers of others.
NAME = re.compile(r"(?<![\w./<{*$%~-])(?:\.\./)*(?:\w[\w.-]*/)*(?![A-Z]+\.)\w[\w-]*(?:\.[\w-]+)*"
                  r"\.(?:h|cpp|glsl|comp|frag|vert|md|py|toml|txt|sh|cmake)\b(?![\w/*{-]|\.\w)")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)(?:\s+\"[^\"]*\")?\)")
SLASHES = re.compile(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'|//[^\n]*|/\*.*?\*/', re.S)
INCLUDE = re.compile(r"#include <([^>]+)>")
HASH = re.compile(r"(?m)(?:^|(?<=\s))#[^\n]*")


def files_below(root):
    """Paths from the root of all files of the tree, without what is hidden, built or drawn."""
    for folder, folders, names in os.walk(root):
        folders[:] = [name for name in folders
                      if not name.startswith(".") and not (folder == str(root) and name in ("build", "out", "shared"))]
        for name in names:
            yield pathlib.Path(folder, name).relative_to(root).as_posix()


def python_comments(text):
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)) and ast.get_docstring(node):
            yield node.body[0].lineno, ast.get_docstring(node, clean=False)
    lines = iter(text.splitlines(keepends=True))
    for token in tokenize.generate_tokens(lambda: next(lines, "")):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def prose_of(path, text):
    """Pairs of the line where a piece of prose begins, and the piece."""
    suffix = pathlib.PurePath(path).suffix
    if suffix == ".md":
        yield 1, text
    elif suffix == ".py":
        yield from python_comments(text)
    elif suffix in (".h", ".cpp", ".glsl", ".comp", ".frag", ".vert"):
        for match in SLASHES.finditer(text):
            if match.group().startswith("/"):
                yield text.count("\n", 0, match.start()) + 1, match.group()
    elif suffix in (".toml", ".txt", ".cmake", ".sh") or (not suffix and text.startswith("#!")):
        for match in HASH.finditer(text):
            yield text.count("\n", 0, match.start()) + 1, match.group()


def anchors(text):
    """What links to the headings of a document are called, as GitHub makes them."""
    found, fenced = set(), False
    for line in text.splitlines():
        fenced ^= line.startswith("```")
        heading = re.match(r"#+ +(.*)", line)
        if not heading or fenced:
            continue
        words = LINK.sub(lambda match: match.group().split("](")[0].lstrip("!["), heading.group(1))
        name = base = re.sub(r"[^\w\- ]", "", words.lower()).strip().replace(" ", "-")
        for n in range(1, 100):
            if name not in found:
                break
            name = f"{base}-{n}"
        found.add(name)
    return found


def exists(name, path, files, names):
    if "/" not in name:
        return name in names
    return any(os.path.normpath(folder / name) in files
               for folder in (*pathlib.PurePath(path).parents, pathlib.PurePath("scenes")))


def problems(root):
    """How many names were found, and a line for each that stands for no file."""
    files = set(files_below(root))
    folders = {parent.as_posix() for file in files for parent in pathlib.PurePath(file).parents}
    names = {file.rsplit("/", 1)[-1] for file in files}
    texts = {}
    for path in sorted(files):
        try:
            texts[path] = (root / path).read_text(encoding="utf-8")
        except UnicodeDecodeError:  # no text
            continue
        if path.endswith((".h", ".cpp")):
            names.update(header.rsplit("/", 1)[-1] for header in INCLUDE.findall(texts[path]))
    count, found = 0, []
    for path, text in texts.items():
        for line, piece in prose_of(path, text):
            wrong = []
            if path.endswith(".md"):
                for match in LINK.finditer(piece):
                    target, _, anchor = match.group(1).partition("#")
                    if re.match(r"[a-z]+:", target):
                        continue
                    count += 1
                    at = os.path.normpath(os.path.join(os.path.dirname(path), target)) if target else path
                    if at not in files and at not in folders:
                        wrong.append((match.start(), target))
                    elif anchor and at.endswith(".md") and anchor not in anchors(texts[at]):
                        wrong.append((match.start(), match.group(1)))
                # The addresses of links are checked; what they show is prose.
                piece = LINK.sub(lambda match: match.group().replace(match.group(1), " " * len(match.group(1))), piece)
            for match in NAME.finditer(piece):
                count += 1
                if not exists(match.group(), path, files, names):
                    wrong.append((match.start(), match.group()))
            found += [f"{path}:{line + piece.count(chr(10), 0, at)}: there is no {name}" for at, name in wrong]
    return count, found


def self_test():
    """A tree with a wrong name of each kind: every one must be seen, and what is right must not be."""
    tree = {
        "core/a.h": "#include <c/c.h>\n// See b.h, core/b.h, c.h, c.md and https://example.org/x.h.\n// Formerly gone.h.\n",
        "core/b.h": '/* As in shaders/gone.glsl. */ const char* name = "// made.txt";\n',
        "docs/c.md": "[a](../core/a.h) ![b](pictures/b.png) [c](gone.md) [d](https://example.org/d.md) "
                     "[e](d.md#a-heading-with-code) [f](d.md#gone)\n",
        "docs/d.md": "## A heading, with `code`\n`core/a.h` and `core/gone.cpp`, out of out/x.vdb\n",
        "docs/pictures/b.png": "",
        "tests/e.py": '"""Tests d.md."""\nX = "gone.toml"  # of gone.py\n',
        "CMakeLists.txt": "add(gone.cpp)  # as gone.cmake says\n",
        "run": "#!/bin/bash\n# Reads gone.txt\n",
    }
    expected = {"core/a.h:3: there is no gone.h", "core/b.h:1: there is no shaders/gone.glsl",
                "docs/c.md:1: there is no gone.md", "docs/c.md:1: there is no d.md#gone", "docs/d.md:2: there is no core/gone.cpp",
                "tests/e.py:2: there is no gone.py", "CMakeLists.txt:1: there is no gone.cmake",
                "run:2: there is no gone.txt"}
    with tempfile.TemporaryDirectory() as folder:
        root = pathlib.Path(folder)
        for path, text in tree.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")
        found = set(problems(root)[1])
    if found != expected:
        sys.exit(f"seen {sorted(found)}, not {sorted(expected)}")
    print(f"{len(expected)} wrong names seen")


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    count, found = problems(pathlib.Path(sys.argv[1]).resolve())
    if count < 300:
        sys.exit(f"only {count} names of files found below {sys.argv[1]}: wrong folder?")
    print("\n".join(found) or f"{count} names of files, all of them there")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
