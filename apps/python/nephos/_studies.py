# SPDX-License-Identifier: Apache-2.0
"""Sweeps and fits from Python: the `nephos` command does them, in processes of its own, so that tables have the same bytes
however they were asked for."""

import collections.abc
import contextlib
import csv
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile

import numpy

from ._nephos import Error, Scene, _toml_text

# A number as the tables have them.
_NUMBER = re.compile(r"-?(0|[1-9][0-9]*)(\.[0-9]+)?(e[-+]?[0-9]+)?")
_WORDS = ("run", "status", "regime", "state_hash", "message", "command")


def _command():
    """The program that belongs to this package: $NEPHOS, that of the same build or prefix, or the one in the path."""
    if os.environ.get("NEPHOS"):
        return os.environ["NEPHOS"]
    for folder in pathlib.Path(__file__).resolve().parents:
        if (folder / "bin/nephos").is_file():
            return str(folder / "bin/nephos")
    found = shutil.which("nephos")
    if not found:
        raise _error("the command `nephos` is not found: put it into PATH, or its path into NEPHOS", "usage")
    return found


def _error(text, code, file=None, line=None, column=None):
    error = Error(text)
    error.code, error.file, error.line, error.column = code, file, line, column
    return error


def _call(arguments, allowed=(0,), plan=None, axes=()):
    """Runs the command. `plan` is a file that its user did not write: messages call it the arguments, and name the axis that
    `axes` has for a line of it."""
    try:
        process = subprocess.Popen([_command(), *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   text=True, errors="backslashreplace", env={**os.environ, "NEPHOS_CALLER": str(os.getpid())})
    except OSError as error:
        raise _error(f"{error.filename}: cannot be run: {error.strerror}", "io", error.filename) from None
    try:
        message = process.communicate()[1].strip()
    except BaseException as error:
        # What is done is kept; its arguments must stay until it has ended.
        process.send_signal(signal.SIGINT if isinstance(error, KeyboardInterrupt) else signal.SIGTERM)
        with contextlib.suppress(ValueError):  # the pipe was read to its end before
            process.communicate()
        process.wait()
        raise
    if process.returncode not in allowed:
        code = {1: "check", 2: "usage", 3: "io", 4: "gpu"}.get(process.returncode, "io")
        if plan is not None:
            message = re.sub(rf"^{re.escape(str(plan))}:(\d+):\d+: (?=error: )",
                             lambda place: f"arguments: axis {axes[int(place[1])]}: " if int(place[1]) in axes else place[0],
                             message, flags=re.MULTILINE).replace(f"{plan}:", "arguments:")
            message = message.replace(f"{plan.with_name('scene.toml')}:", "scene:")
        place = re.match(r"(?:error: )?(?!arguments:)(.+?):(?:(\d+):(\d+):)? ", message)
        found = place and (os.path.isabs(place[1]) or place[1] in map(str, arguments) or os.path.exists(place[1]))
        where = (place[1], *(int(number) if number else None for number in place.groups()[1:])) if found else ()
        raise _error(message or f"nephos ended with status {process.returncode}", code, *where)


def _column(name, values):
    if name in _WORDS:
        return numpy.array(values)
    if name == "seed":
        return numpy.array([int(value) for value in values], dtype=numpy.uint64)
    # Texts such as "007" and "2024_01", which are names, are no numbers, though Python takes them for some.
    if all(_NUMBER.fullmatch(value) for value in values if value):
        for kind in (int, float):
            try:
                return numpy.array([kind(value or "nan") for value in values])
            except ValueError:
                pass
    return numpy.array(values)


def _ends_its_last_line(path):
    with open(path, "rb") as file:
        file.seek(-1, os.SEEK_END)
        return file.read() == b"\n"


def _table(path):
    """The columns of a table. Raises Error where the file is no whole table."""
    most = csv.field_size_limit(sys.maxsize)  # a value of an axis may be a long one, such as a wind
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = csv.reader(file)
            names = next(rows, None)
            if not names:
                raise _error(f"{path}: is empty; expected a table with names in its first line", "io", str(path))
            lines = []
            for row in rows:
                if len(row) != len(names):
                    raise _error(f"{path}:{rows.line_num}: has {len(row)} values; expected {len(names)}, as the first line has names",
                                 "io", str(path), rows.line_num)
                lines.append(row)
            if lines and not _ends_its_last_line(path):
                raise _error(f"{path}: its last line is cut", "io", str(path))
    except (UnicodeDecodeError, csv.Error) as error:
        raise _error(f"{path}: is damaged: {error}", "io", str(path)) from None
    finally:
        csv.field_size_limit(most)
    columns = list(zip(*lines)) or [()] * len(names)
    return {name: _column(name, values) for name, values in zip(names, columns)}


class Sweep:
    """The tables of a sweep in a folder, also of one that the command made or that is not complete. docs/research.md
    defines every column; a mean is NaN where a point has none."""

    def __init__(self, folder):
        """Raises Error where the folder has no tables."""
        self.folder = pathlib.Path(folder)
        self._records = [self.folder]  # folders that have the records of its runs
        if not (self.folder / "runs.csv").is_file():
            raise _error(f"{self.folder}: has no runs.csv; `nephos merge` makes it from shards", "io")

    def runs(self):
        """Returns runs.csv as a dict of NumPy arrays, a value a run, ready for pandas.DataFrame."""
        return _table(self.folder / "runs.csv")

    def points(self):
        """Returns points.csv, a value a point: means over the replicates, with their 95 % intervals."""
        return _table(self.folder / "points.csv")

    def tracks(self):
        """Returns tracks.csv of a sweep with tracks=True, a value a run: births, deaths, splits, mergers and lifetimes of
        clouds. Raises Error where clouds were not followed."""
        path = self.folder / "tracks.csv"
        if not path.is_file():
            raise _error(f"{self.folder}: has no tracks.csv; a sweep with tracks=True makes it", "io")
        return _table(path)

    def failures(self):
        """Returns failures.csv: what failed, why, and the command that repeats it."""
        return _table(self.folder / "failures.csv")

    def report(self, path=None):
        """Writes the sweep as one HTML page, and returns its path (report.html in the folder by default)."""
        path = pathlib.Path(os.fsdecode(path)) if path is not None else self.folder / "report.html"
        _call(["report", *map(_path, self._records), "--out", _path(path), "--quiet"])
        return path

    @property
    def series_file(self):
        """Path of series.nc: every step of every run. xarray.open_dataset reads it."""
        return self.folder / "series.nc"

    def __repr__(self):
        return f"<nephos.Sweep in {str(self.folder)!r}>"


def _path(path):
    """A path as an argument of the command, which takes what begins with a dash for an option."""
    path = os.fsdecode(path)
    return os.path.join(".", path) if path.startswith("-") else path


def _folder(path):
    if not os.fsdecode(path):
        raise _error("the folder `out` has no name", "usage")
    return _path(path)


def _pair(name, values, expected):
    values = (values,) if isinstance(values, str) or not hasattr(values, "__iter__") else tuple(values)
    if len(values) != 2:
        raise _error(f"{name} is {values!r}; expected {expected}", "usage")
    return values


def _plan(axes, options):
    """Returns the lines of a plan, and the keys of the axis that stands in a line of it, by its number from 1."""
    if not isinstance(axes, collections.abc.Mapping):
        raise _error(f"axes is a {type(axes).__name__}; expected a dict of keys and their values", "usage")
    places = {}
    lines = [f"{key} = {_toml_text(value)}" for key, value in options.items() if value is not None]
    for key, values in axes.items():
        keys = [key] if isinstance(key, str) else list(key)
        if isinstance(values, (str, bytes)):
            raise _error(f"axes[{key!r}] is one text; expected a list of values", "usage")
        is_range = isinstance(values, collections.abc.Mapping)
        if not is_range and not hasattr(values, "__iter__"):
            raise _error(f"axes[{key!r}] is a {type(values).__name__}; expected a list of values", "usage")
        values = dict(values) if is_range else list(values)
        if not values and not is_range:
            raise _error(f"axes[{key!r}] has no values; expected one or more, or {{'from': a, 'to': b, 'count': n}}", "usage")
        name = "range" if is_range else "values"
        lines += ["", "[[axis]]", f"keys = {_toml_text(keys)}", f"{name} = {_toml_text(values)}"]
        places.update(dict.fromkeys((len(lines) - 1, len(lines)), "+".join(map(str, keys))))
    return "\n".join(lines) + "\n", places


def sweep(scene, axes, out, *, replicates=5, steps=(300, 3000), design="grid", points=None, seed=1, seeds="per_point",
          clouds_every=10, tracks=False, layer=None, until=None, workers=None, shard=None, retry_failed=False,
          overwrite=False):
    """Runs a scene over values of its keys, as `nephos sweep` does, and returns the Sweep.

    scene     a Scene, or the path of one
    axes      {key: values}: a list of values; {"from": a, "to": b, "count": n, "scale": "log"} spread between two; without
              "count" the range of a sampled design. A tuple of keys moves them together. A value may be the name of a file
    out       folder of the sweep; the same call again, or one with longer axes, runs only what is missing
    steps     (least, most): a run goes on, up to the most, until it is judged steady
    design    "grid", "list", "random", "latin_hypercube" or "sobol"; the last three take `points`
    tracks    True: clouds are followed from step to step, and tracks.csv has their births, deaths and lifetimes
    until     (statistic, standard error): runs go on, up to the most steps, until the mean is that exact
    workers   processes at a time; None: one a core
    shard     (i, n): only the i-th of n parts of the runs, i from 0, for calls on several machines; then None is returned, and
              merge() makes the tables
    retry_failed, overwrite   run again what failed; throw the records in the folder (of the shard, if one is named) away first

    Raises Error before the first run where a value is out of range, with the text of the command. Runs that fail are in
    failures(), and do not raise. Ctrl-C stops, and what is done stays."""
    out = _folder(out)
    options = {"scene": "scene.toml", "design": design, "points": points, "replicates": replicates, "seed": seed,
               "seeds": seeds, "clouds_every": clouds_every, "tracks": tracks or None, "layer": layer}
    with contextlib.suppress(OSError, UnicodeEncodeError):  # without such a current folder only names of files need one
        os.getcwd().encode()
        options["folder"] = os.getcwd()
    least, most = _pair("steps", steps, "(least, most)")
    rules = {"min": least, "max": most}
    if until is not None:
        statistic, error = _pair("until", until, "(statistic, standard error)")
        rules["until"] = {"statistic": statistic, "standard_error": error}
    options["steps"] = rules
    with tempfile.TemporaryDirectory(prefix="nephos-") as folder:
        if isinstance(scene, Scene):
            pathlib.Path(folder, "scene.toml").write_text(scene._given(), encoding="utf-8")
        else:
            options["scene"] = os.path.abspath(scene)
        plan = pathlib.Path(folder, "sweep.toml")
        text, places = _plan(axes, options)
        plan.write_text(text, encoding="utf-8")
        jobs = [] if workers is None else ["--workers", workers]
        part = [] if shard is None else ["--shard", "{}/{}".format(*_pair("shard", shard, "(i, n)"))]
        _call(["sweep", plan, "--out", out, "--quiet", *jobs, *part, *_flags(retry_failed, overwrite)], allowed=(0, 1), plan=plan,
              axes=places)
    return Sweep(out) if shard is None else None


def _flags(retry_failed, overwrite):
    return ["--retry-failed"] * bool(retry_failed) + ["--overwrite"] * bool(overwrite)


def merge(folders, out=None, *, overwrite=False):
    """Makes the tables of a sweep from the shards in one or several folders, and returns the Sweep; `out` is the first
    folder by default. Runs that are missing yet stand in runs.csv as missing. Raises Error where that would lose runs of earlier
    tables, unless `overwrite`."""
    folders = [folders] if isinstance(folders, (str, bytes, os.PathLike)) else list(folders)
    if not folders:
        raise _error("folders is empty; expected the folder of a sweep, or several", "usage")
    folders = [_path(folder) for folder in folders]
    out = _folder(folders[0] if out is None else out)
    _call(["merge", *folders, "--out", out, "--quiet", *_flags(False, overwrite)])
    sweep = Sweep(out)
    sweep._records = folders
    return sweep


def fit(path, out, *, workers=None, retry_failed=False, overwrite=False):
    """Finds the parameters that a fit file asks for, as `nephos fit` does, and returns fit.json as a dict with `posterior`
    added: a dict of arrays, 1,000 equally likely values of each key. The same call again runs only what is missing;
    `retry_failed` runs again what failed, `overwrite` throws the records of an earlier fit away first. Raises Error with the
    text of the command."""
    out = _folder(out)
    jobs = [] if workers is None else ["--workers", workers]
    _call(["fit", _path(path), "--out", out, "--quiet", *jobs, *_flags(retry_failed, overwrite)])
    result = json.loads(pathlib.Path(out, "fit.json").read_text(encoding="utf-8"))
    result["posterior"] = _table(pathlib.Path(out, "posterior.csv"))
    return result
