# SPDX-License-Identifier: Apache-2.0
"""The JSON Schema says what the reader says: it is a valid draft 4 schema, accepts every shipped scene, and refuses
what it can know to be wrong. TOML is converted by Python's own parser, not by ours."""

import datetime
import json
import pathlib
import sys
import tomllib

import jsonschema

ROOT = pathlib.Path(sys.argv[1])
BAD = ROOT / "tests/scenes/bad"

# What concerns several keys, or file names, is beyond a schema; so is what is no TOML at all.
ACCEPTED_BY_THE_SCHEMA = {
    "layer_with_field", "layers_names", "layers_reach", "layers_simulation", "layers_slab_alone", "layers_veil",
    "layers_veil_fine", "sky_without_layer", "sun_date", "sun_date_alone", "sun_moves", "sun_path_date",
    "sun_path_times", "sun_time", "terrain_ending", "terrain_raw", "terrain_raw_size", "camera_path_times",
    "camera_point", "empty", "only_comment", "frames_beyond", "frames_start", "frames_too_many", "name",
    "name_empty", "periodic_size", "shells_far", "wind_order", "wind_times", "wind_too_fast",
    "density_grids", "field_order", "frames_of_steps", "layers_without_automaton", "model_textures", "place_start",
    "tile_lattice", "tile_layers", "wind_fields_height", "detail_sizes", "many_ellipsoids",
}


def load(path):
    text = path.read_bytes().decode("utf-8-sig")
    return tomllib.loads(text)


def main():
    failures = []
    schema = json.loads((ROOT / "scenes/nephos.schema.json").read_text())
    jsonschema.Draft4Validator.check_schema(schema)
    # A TOML date is none of JSON's types.
    validator = jsonschema.Draft4Validator(schema)

    shipped = sorted((ROOT / "scenes").rglob("*.toml"))
    if len(shipped) < 4:
        failures.append("the shipped scenes are missing")
    for path in shipped:
        for error in validator.iter_errors(load(path)):
            failures.append(f"{path.name}: {'/'.join(map(str, error.absolute_path))}: {error.message}")

    refused = 0
    for path in sorted(BAD.glob("*.toml")):
        try:
            scene = load(path)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError):
            continue
        scene = json.loads(json.dumps(scene, default=lambda value: str(value)
                                      if isinstance(value, (datetime.date, datetime.time)) else None))
        valid = validator.is_valid(scene)
        refused += not valid
        if valid != (path.stem in ACCEPTED_BY_THE_SCHEMA):
            failures.append(f"bad/{path.name}: the schema says {'valid' if valid else 'invalid'}")
    if refused < 12:
        failures.append(f"only {refused} bad scenes were refused")

    print("\n".join(failures) or f"{len(shipped)} scenes accepted, {refused} refused")
    return 1 if failures else 0


sys.exit(main())
