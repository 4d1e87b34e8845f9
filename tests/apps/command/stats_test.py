# SPDX-License-Identifier: Apache-2.0
"""`nephos stats` of masks that others wrote, against NumPy and SciPy; and masks as targets of fits."""

import json
import math
import os
import resource
import struct
import subprocess
import sys
import unittest
import zlib

import numpy
from PIL import Image
from scipy import ndimage
from scipy.io import netcdf_file

from case import Case, NEPHOS, SANITIZED, SOURCE, limit_addresses
from fit_test import FIT, NULL
from sweep_test import rows


NONE = {"mean": None, "se": None, "sd": None}


def random_mask(seed, shape, cover):
    return numpy.random.default_rng(seed).random(shape) < cover


class Stats(Case):
    def stats(self, *arguments):
        return json.loads(self.call("stats", *arguments, "--json").stdout)

    def netcdf(self, name, values, dimensions, variable="ql", kind="f4", **attributes):
        with netcdf_file(self.folder / name, "w") as file:
            for dimension, size in zip(dimensions, values.shape):
                file.createDimension(dimension, size)
            written = file.createVariable(variable, kind, dimensions)
            written[:] = values
            for attribute, value in attributes.items():
                setattr(written, attribute, value)
        return name

    def check(self, found, masks, size, height):
        """Compares with the definitions, computed the slow way: masks (time, z, y, x), open sides."""
        expected = {"cover": [], "cloud_fraction": [], "clouds_per_km2": [], "cloud_area_m2": [], "edge_per_km": [],
                    "base_mean_m": [], "top_mean_m": []}
        area_km2 = masks.shape[2] * masks.shape[3] * size * size / 1e6
        for mask in masks:
            shadow = mask.any(axis=0)
            count = ndimage.label(shadow)[1]
            edges = (shadow[1:] != shadow[:-1]).sum() + (shadow[:, 1:] != shadow[:, :-1]).sum()
            lowest = mask.argmax(axis=0)[shadow]
            highest = mask.shape[0] - mask[::-1].argmax(axis=0)[shadow]
            for name, value in (("cover", shadow.mean()), ("cloud_fraction", mask.mean()),
                                ("clouds_per_km2", count / area_km2), ("cloud_area_m2", shadow.sum() / count * size**2),
                                ("edge_per_km", edges * size / 1000 / area_km2),
                                ("base_mean_m", lowest.mean() * height), ("top_mean_m", highest.mean() * height)):
                expected[name].append(value)
        flat = masks.shape[1] == 1
        self.assertEqual((found["seen_from_above"], found["level_height_m"]), (flat, None if flat else height))
        for name, values in expected.items():
            got = found["statistics"][name]
            if flat and name in ("cloud_fraction", "base_mean_m", "top_mean_m"):
                self.assertEqual(got, NONE, name)
                continue
            self.assertTrue(math.isclose(got["mean"], numpy.mean(values), rel_tol=1e-9), name)
            if 1 < len(values) < 8:
                self.assertTrue(math.isclose(got["se"], numpy.std(values, ddof=1) / math.sqrt(len(values)), rel_tol=1e-6,
                                             abs_tol=1e-9), name)

    def test_netcdf_has_times_levels_and_sizes(self):
        masks = random_mask(1, (5, 6, 40, 70), 0.03)
        name = self.netcdf("les.nc", masks * 2e-5, ("time", "z", "y", "x"))
        found = self.stats(name, "--threshold", "1e-5", "--cell-size", "100", "--level-height", "40")
        self.assertEqual((found["snapshots"], found["cells"], found["cell_size_m"]), (5, [70, 40, 6], 100))
        self.check(found, masks, 100, 40)
        # Three dimensions are levels, unless the first is called time; two are a mask from above.
        self.check(self.stats(self.netcdf("z.nc", masks[0] * 1.0, ("lev", "y", "x")), "--cell-size", "50"), masks[:1], 50, 50)
        self.check(self.stats(self.netcdf("t.nc", masks[:, 0] * 1.0, ("time", "y", "x")), "--cell-size", "50"),
                   masks[:, :1], 50, 50)
        self.check(self.stats(self.netcdf("yx.nc", masks[0, 0] * 1.0, ("y", "x")), "--cell-size", "50"), masks[:1, :1], 50, 50)
        text = self.call("stats", name, "--cell-size", "100").stdout
        self.assertIn("5 snapshots of 70 x 40 x 6 cells of 100 m", text)
        self.assertRegex(text, r"\niorg +\d")

    def test_a_view_from_above_has_no_heights_and_no_fraction_of_cells(self):
        """Nor has a variable of one level, unless its height is given."""
        mask = random_mask(6, (1, 30, 50), 0.2)
        Image.fromarray((mask[0] * 255).astype(numpy.uint8)).save(self.folder / "a.png")
        self.netcdf("yx.nc", mask[0] * 1.0, ("y", "x"))
        self.netcdf("zyx.nc", mask * 1.0, ("z", "y", "x"))
        for name in ("a.png", "yx.nc", "zyx.nc"):
            found = self.stats(name, "--cell-size", "20")
            self.assertTrue(found["seen_from_above"], name)
            self.assertAlmostEqual(found["statistics"]["cover"]["mean"], mask.mean())
            for statistic in ("cloud_fraction", "base_mean_m", "top_mean_m", "overlap", "act_fraction", "lifetime_s"):
                self.assertEqual(found["statistics"][statistic], NONE, (name, statistic))
            text = self.call("stats", name, "--cell-size", "20").stdout
            self.assertIn("1 snapshot of 50 x 30 cells of 20 m, seen from above", text)
            self.assertRegex(text, r"\ncloud_fraction +- +-  none: a view from above has no levels\n")
            self.assertRegex(text, r"\nsize_exponent_line +- +-  none: too few clouds")
            self.assertRegex(text, r"\nlifetime_s +- +-  none: of runs alone\n")
        for name in ("a.png", "yx.nc"):
            self.refused(2, "stats", name, "--cell-size", "20", "--level-height", "40", says="leave out --level-height")
        slab = self.stats("zyx.nc", "--cell-size", "20", "--level-height", "40")
        self.assertEqual((slab["seen_from_above"], slab["statistics"]["top_mean_m"]["mean"]), (False, 40))

    def test_pictures_of_sixteen_bits(self):
        """The threshold is of what a picture shows, whatever its depth and not rounded: 127 of 255."""
        for value, threshold, cover in ((20000, 127, 0), (32639, 127, 0), (32640, 127, 1), (33500, 127, 1), (100, 0, 1), (0, 0, 0),
                                        (32760, 127.3, 1), (32760, 127.5, 0)):
            Image.fromarray(numpy.full((4, 4), value, dtype=numpy.uint16)).save(self.folder / "deep.png")
            options = ("--cell-size", "30", *(("--threshold", str(threshold)) if threshold != 127 else ()))
            self.assertEqual(self.stats("deep.png", *options)["statistics"]["cover"]["mean"], cover, (value, threshold))

    def test_interlaced_pictures_of_sixteen_bits(self):
        """By passes, libpng's simple reading mixes lines of 16 bits; edges at odd places show it."""
        passes = ((0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2), (0, 1, 1, 2))
        mask = ndimage.gaussian_filter(numpy.random.default_rng(3).random((150, 200)), 5)
        mask = mask > numpy.quantile(mask, 0.8)

        def chunk(kind, data):
            return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

        for grey, values in ((33500, 1), (32000, 0)):  # above the threshold of 127 of 255, and below
            for colours, channels in ((0, 1), (2, 3)):
                pixels = numpy.repeat((mask * grey).astype(">u2")[..., None], channels, axis=2)
                lines = b"".join(b"\0" + line.tobytes() for x, y, dx, dy in passes for line in pixels[y::dy, x::dx])
                head = struct.pack(">IIBBBBB", 200, 150, 16, colours, 0, 0, 1)
                (self.folder / "woven.png").write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head)
                                                        + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b""))
                Image.fromarray((mask * values * 255).astype(numpy.uint8)).save(self.folder / "plain.png")
                found = [self.stats(name, "--cell-size", "30")["statistics"] for name in ("woven.png", "plain.png")]
                self.assertEqual(*found)
                self.assertAlmostEqual(found[0]["cover"]["mean"], mask.mean() * values)

    def test_masks_at_different_heights(self):
        """Each snapshot has its own lowest level: the order of files changes nothing."""
        import pyopenvdb
        for name, metres in (("low.vdb", 500), ("high.vdb", 1500)):
            grid = pyopenvdb.FloatGrid()
            grid.name = "density"
            grid.fill((0, 0, 0), (7, 7, 3), 1.0)
            grid.transform = pyopenvdb.createLinearTransform([[100, 0, 0, 0], [0, 100, 0, 0], [0, 0, 100, 0], [50, 50, metres + 50, 1]])
            pyopenvdb.write(str(self.folder / name), [grid])
        for names in (("low.vdb", "high.vdb"), ("high.vdb", "low.vdb")):
            base = self.stats(*names)["statistics"]["base_mean_m"]
            self.assertEqual((base["mean"], base["se"]), (1000, 500), names)

    def test_a_few_voxels_far_apart(self):
        """The box around them is held as bits alone."""
        import pyopenvdb
        grid = pyopenvdb.BoolGrid()
        grid.name = "cld"
        for corner in ((0, 0, 0), (1000, 1000, 400)):
            grid.fill(corner, corner, True)
        pyopenvdb.write(str(self.folder / "far.vdb"), [grid])
        found = json.loads(self.call("stats", "far.vdb", "--json", preexec_fn=lambda: limit_addresses(1500 << 20)).stdout)
        self.assertAlmostEqual(found["statistics"]["cover"]["mean"], 2 / 1001 ** 2)

    def test_every_statistic_has_a_place(self):
        """Also where it has no value."""
        self.netcdf("a.nc", random_mask(7, (3, 20, 30), 0.05) * 1.0, ("z", "y", "x"))
        found = self.stats("a.nc", "--cell-size", "20")["statistics"]
        self.assertEqual(len(found), 16)
        self.assertEqual(found["size_exponent_line"], NONE)

    def axes(self, name, values, dimensions, **coordinates):
        """A variable with coordinate variables: their values and attributes."""
        self.netcdf(name, values, dimensions)
        with netcdf_file(self.folder / name, "a") as file:
            for dimension, (numbers, attributes) in coordinates.items():
                written = file.createVariable(dimension, "f8", (dimension,))
                written[:] = numbers
                for attribute, value in attributes.items():
                    setattr(written, attribute, value)
        return name

    def test_axes_are_known_by_names_and_attributes(self):
        masks = random_mask(8, (3, 5, 12, 20), 0.05)
        size = ("--cell-size", "50", "--level-height", "20")
        for number, dimensions in enumerate((("Time", "bottom_top", "south_north", "west_east"), ("TIME", "Lev", "lat", "lon"),
                                             ("t", "height_2", "rlat", "rlon"), ("time", "zt", "yt", "xt"))):
            result = self.call("stats", self.netcdf(f"{number}.nc", masks * 1.0, dimensions), *size, "--json")
            self.assertEqual(result.stderr, "")
            self.check(json.loads(result.stdout), masks, 50, 20)
        # Three dimensions are not levels where the first is a time, however it is written.
        for name in ("Time", "XTIME", "T"):
            found = self.stats(self.netcdf("wrf.nc", masks[:, 0] * 1.0, (name, "south_north", "west_east")), *size[:2])
            self.check(found, masks[:, :1], 50, 50)
        # Attributes tell what names do not, and come before them.
        for attributes in ({"axis": "T"}, {"standard_name": "time"}, {"units": "hours since 2020-01-01"}):
            name = self.axes("cf.nc", masks[:, 0] * 1.0, ("z", "b", "c"), z=(range(3), attributes),
                             b=(range(12), {"units": "degrees_north"}), c=(range(20), {"axis": "X"}))
            result = self.call("stats", name, *size[:2], "--json")
            self.assertEqual(result.stderr, "")
            self.check(json.loads(result.stdout), masks[:, :1], 50, 50)
        # Unknown ones are taken by their places, and that is said.
        result = self.call("stats", self.netcdf("abc.nc", masks[0] * 1.0, ("a", "b", "c")), *size, "--json")
        self.check(json.loads(result.stdout), masks[:1], 50, 20)
        self.assertIn("note: abc.nc: the dimensions (a, b, c) of the variable ql are taken as z, y, x by their places",
                      result.stderr)
        again = self.netcdf("abd.nc", masks[0] * 1.0, ("a", "b", "c"))
        result = self.call("stats", "abc.nc", again, *size)
        self.assertEqual(result.stderr.count("note:"), 1)
        self.assertIn("abc.nc and 1 more: the dimensions", result.stderr)

    def test_another_order_of_axes_is_refused_with_its_cure(self):
        mask = random_mask(9, (5, 12, 20), 0.05) * 1.0
        size = ("--cell-size", "50")
        self.refused(2, "stats", self.netcdf("yxz.nc", mask.transpose(1, 2, 0), ("y", "x", "z")), *size,
                     says="yxz.nc: the dimensions (y, x, z) of the variable ql are y, x, z; expected (time,) (z,) y, x, the last "
                          "fastest: `ncpdq -a z,y,x IN.nc OUT.nc` reorders them")
        self.refused(2, "stats", self.netcdf("lonlat.nc", mask[0].T, ("lon", "lat")), *size, says="ncpdq -a lat,lon")
        self.refused(2, "stats", self.netcdf("ztyx.nc", mask[None].transpose(1, 0, 2, 3), ("lev", "time", "y", "x")), *size,
                     says="ncpdq -a time,lev,y,x")
        self.refused(2, "stats", self.netcdf("section.nc", mask[0], ("z", "x")), *size, says="are z, x; expected")
        self.refused(2, "stats", self.netcdf("five.nc", mask[None, None], ("time", "member", "z", "y", "x")), *size,
                     says="has 5 dimensions (time, member, z, y, x); expected")
        name = self.axes("attributes.nc", mask, ("a", "b", "c"), a=(range(5), {"axis": "Y"}), c=(range(20), {"axis": "Z"}))
        self.refused(2, "stats", name, *size, says="are y, unknown, z; expected")

    def test_levels_that_go_downwards_are_turned_over(self):
        mask = random_mask(10, (1, 6, 12, 20), 0.03)
        size = ("--cell-size", "50", "--level-height", "20")
        rising, falling = numpy.arange(6.0), numpy.arange(6.0)[::-1]
        for down, attributes, values in ((False, {"units": "m"}, rising), (True, {"units": "m"}, falling),
                                         (True, {"units": "hPa"}, rising), (False, {"units": "Pa"}, falling),
                                         (True, {"positive": "down"}, rising), (False, {"positive": "up", "units": "hPa"}, rising)):
            stored = mask[0, ::-1] if down else mask[0]
            name = self.axes("z.nc", stored * 1.0, ("lev", "y", "x"), lev=(values, attributes))
            result = self.call("stats", name, *size, "--json")
            self.check(json.loads(result.stdout), mask, 50, 20)
            self.assertEqual("z.nc: the levels of the variable ql go downwards, and are turned over" in result.stderr, down)

    def test_levels_that_are_records_or_packed_are_turned_over_likewise(self):
        mask = random_mask(10, (1, 6, 12, 20), 0.03)
        for kind, values, attributes, down in (("f8", numpy.arange(6.0), {"positive": "down"}, True), ("f8", numpy.arange(6.0), {"units": "m"}, False),
                                               ("i2", numpy.arange(6), {"units": "m", "scale_factor": -1.0}, True),
                                               ("i1", [100, 110, 120, -126, -116, -106], {"units": "m", "_Unsigned": "true"}, False)):
            for levels in (6, None):
                with netcdf_file(self.folder / "r.nc", "w") as file:
                    for name, count in (("lev", levels), ("y", 12), ("x", 20)):
                        file.createDimension(name, count)
                    lev, ql = file.createVariable("lev", kind, ("lev",)), file.createVariable("ql", "f8", ("lev", "y", "x"))
                    for name, value in attributes.items():
                        setattr(lev, name, value)
                    lev[:] = numpy.asarray(values)
                    ql[:] = (mask[0, ::-1] if down else mask[0]) * 1.0
                result = self.call("stats", "r.nc", "--cell-size", "50", "--level-height", "20", "--json")
                self.check(json.loads(result.stdout), mask, 50, 20)
                self.assertEqual("go downwards, and are turned over" in result.stderr, down, (attributes, levels))

    def test_values_that_are_missing_are_no_cloud(self):
        """Of 30 x 50 values every fifth is cloud, and 7 columns are missing, by each way to say so."""
        mask = random_mask(5, (30, 50), 0.2)
        gone = numpy.zeros((30, 50), dtype=bool)
        gone[:, 11:18] = True
        cover = (mask & ~gone).mean()
        values = numpy.where(gone, 9e9, mask * 2e-5)
        unwritten = numpy.where(gone, numpy.float32(9.96921e36), mask * 2e-5)
        packed = numpy.where(gone, -32767, numpy.where(mask, 20, 0))
        for number, (raw, kind, attributes) in enumerate((
                (values, "f4", {"_FillValue": numpy.float32(9e9)}),
                (values, "f4", {"missing_value": 9e9}),
                (numpy.where(gone, numpy.where(numpy.arange(50) % 2, 7.0, 9e9), mask * 2e-5), "f4",
                 {"missing_value": numpy.array([7.0, 9e9])}),
                (numpy.where(gone, numpy.where(numpy.arange(50) % 2, 7.0, math.nan), mask * 2e-5), "f4",
                 {"missing_value": numpy.array([9e9, math.nan, 7.0, 7.0, -3.0])}),
                (values, "f4", {"valid_range": numpy.array([0, 1], dtype="f4")}),
                (values, "f4", {"valid_max": numpy.float32(1)}),
                (numpy.where(gone, -1, mask * -2e-5), "f4", {"valid_min": numpy.float32(-0.5), "scale_factor": numpy.float32(-1)}),
                (unwritten, "f4", {}),
                (packed, "i2", {"scale_factor": 1e-6}),
                (numpy.where(gone, 99, packed), "i2", {"scale_factor": 1e-6, "_FillValue": numpy.int16(99)}),
                # The range is of packed values where it has their type, and of unpacked ones where it has the type of the factor.
                (numpy.where(gone, 99, packed), "i2", {"scale_factor": 1e-6, "valid_range": numpy.array([0, 50], dtype="i2")}),
                (numpy.where(gone, 99, packed), "i2", {"scale_factor": 1e-6, "valid_range": numpy.array([0, 5e-5])}),
                # Whole numbers without a sign, as bytes of a byte mask are stored: 255 is -1, 200 is -56.
                (numpy.where(gone, -1, mask * -56), "i1", {"_Unsigned": "true", "_FillValue": numpy.int8(-1)}),
                (numpy.where(gone, -1, mask * -56), "i1", {"_Unsigned": "true", "valid_range": numpy.array([0, -6], dtype="i1")}),
                (numpy.where(gone, -32767, mask * -20), "i2", {"_Unsigned": "true", "scale_factor": 1e-6}),
                # What packs them has a sign of its own.
                (numpy.where(gone, -32767, mask * 20 + 100), "i2", {"_Unsigned": "true", "add_offset": numpy.int16(-100)}),
                (numpy.where(gone, -2, mask * -20), "i4", {"_Unsigned": "true", "missing_value": numpy.int32(-2)}),
                (numpy.where(gone, 99, packed), "i2", {"_Unsigned": "false", "scale_factor": 1e-6, "_FillValue": numpy.int16(99)}),
                (numpy.where(gone, 99, packed + 5), "i2", {"scale_factor": 1e-6, "add_offset": -5e-6,
                                                           "missing_value": numpy.int16(99)}))):
            with self.subTest(kind=kind, **attributes):
                name = self.netcdf(f"{number}.nc", raw, ("y", "x"), kind=kind, **attributes)
                result = self.call("stats", name, "--cell-size", "50", "--threshold", "1e-5", "--json")
                found = json.loads(result.stdout)
                self.assertAlmostEqual(found["statistics"]["cover"]["mean"], cover, places=9)
                self.assertEqual(found["missing_values"], 210)
                self.assertIn(f"note: {name}: 210 of 1500 values are missing", result.stderr)
        for attributes, says in (({"valid_range": numpy.array([0.0])}, "valid_range of the variable ql has 1 values: expected 2"),
                                 ({"valid_range": numpy.array([2.0, 1.0])}, "valid_range of the variable ql is empty"),
                                 ({"scale_factor": "two"}, "scale_factor of the variable ql is a text: expected a number"),
                                 ({"missing_value": numpy.arange(10_001.0)},
                                  "missing_value of the variable ql has 10001 values: expected at most 10000"),
                                 ({"scale_factor": math.nan}, "scale_factor of the variable ql is not finite")):
            name = self.netcdf("bad.nc", values, ("y", "x"), **attributes)
            self.refused(3, "stats", name, "--cell-size", "50", says=says)

    @unittest.skipIf(SANITIZED, "it measures memory")
    def test_a_large_mask_takes_little_more_than_its_file(self):
        """Not eight bytes for each of its values."""
        mask = numpy.zeros((4, 4096, 4096), dtype="i1")
        mask[:, 5:9, 7:11] = 1
        name = self.netcdf("large.nc", mask, ("time", "y", "x"), kind="i1")
        took = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); " \
               "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
        most = subprocess.run([sys.executable, "-c", took, NEPHOS, "stats", name, "--cell-size", "50"], cwd=self.folder,
                              env=self.environment, capture_output=True, text=True, check=True).stdout
        self.assertLess(int(most), 400 << 10, "KiB; the file has 64 MiB, its values as doubles 512")

    def test_voxels_of_any_height(self):
        """Levels of a VDB file are as high as it says, and those of several files as each other's."""
        import pyopenvdb
        mask = random_mask(5, (6, 8, 10), 0.3)
        for name, height in (("high.vdb", 100), ("flat.vdb", 40), ("again.vdb", 40)):
            grid = pyopenvdb.BoolGrid()
            grid.name = "cld"
            grid.copyFromArray(numpy.ascontiguousarray(mask.transpose()).astype(bool))
            grid.transform = pyopenvdb.createLinearTransform([[100, 0, 0, 0], [0, 100, 0, 0], [0, 0, height, 0], [0, 0, 0, 1]])
            pyopenvdb.write(str(self.folder / name), grids=[grid])
        high, flat = (self.stats(name)["statistics"] for name in ("high.vdb", "flat.vdb"))
        for name in ("cover", "cloud_area_m2", "clouds_per_km2", "cloud_fraction"):
            self.assertEqual(high[name]["mean"], flat[name]["mean"], name)
        # Voxels are placed by their centres, so the lowest face is half a height below 0.
        self.assertAlmostEqual(high["base_mean_m"]["mean"] / 100, flat["base_mean_m"]["mean"] / 40, 9)
        self.assertIn("cells of 100 m, 40 m high", self.call("stats", "flat.vdb").stdout)
        self.assertEqual(self.stats("flat.vdb", "again.vdb")["statistics"]["base_mean_m"]["mean"], flat["base_mean_m"]["mean"])
        self.refused(2, "stats", "flat.vdb", "high.vdb", says="high.vdb: has another height of levels than the masks before it")
        # A transform with a place loses digits of the edges.
        for name, place in (("low.vdb", 500.3), ("top.vdb", 1300.9)):
            grid = pyopenvdb.BoolGrid()
            grid.name = "cld"
            grid.copyFromArray(numpy.ascontiguousarray(mask.transpose()).astype(bool))
            grid.transform = pyopenvdb.createLinearTransform([[100, 0, 0, 0], [0, 100, 0, 0], [0, 0, 100, 0], [0, 0, place, 1]])
            pyopenvdb.write(str(self.folder / name), grids=[grid])
        self.assertEqual(self.stats("low.vdb", "top.vdb")["statistics"]["cover"]["mean"], high["cover"]["mean"])

    def test_pictures_whose_head_lies_cost_nothing(self):
        def png(width, height, depth, data):
            def piece(kind, content):
                return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
            return (b"\x89PNG\r\n\x1a\n" + piece(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, 0, 0, 0, 0)) +
                    piece(b"IDAT", data) + piece(b"IEND", b""))
        limit = lambda: limit_addresses(2 << 30)
        for width, height, status, says in ((65536, 65536, 3, "at most 65536 on a side and 268435456 in all"),
                                            (32768, 8193, 3, "32768 x 8193 pixels; expected at most"),
                                            (16384, 16384, 3, "its head claims 16384 x 16384 pixels, more than"),
                                            (70000, 1, 3, "70000 x 1 pixels; expected at most")):
            (self.folder / "small.png").write_bytes(png(width, height, 8, zlib.compress(b"\0" * 100)))
            self.assertLess((self.folder / "small.png").stat().st_size, 100)
            self.refused(status, "stats", "small.png", "--cell-size", "5", preexec_fn=limit, says=says)
        # What is packed as tightly as deflate can is read.
        (self.folder / "clear.png").write_bytes(png(8000, 8000, 1, zlib.compress(b"\0" * (1001 * 8000), 9)))
        self.assertEqual(self.stats("clear.png", "--cell-size", "5")["statistics"]["cover"]["mean"], 0)

    @unittest.skipIf(SANITIZED, "it limits memory")
    def test_clouds_that_take_too_much_memory_are_refused(self):
        """A small picture of millions of clouds; and one of half a cloud, whose random twins are of millions."""
        dots = numpy.zeros((4096, 4096), numpy.uint8)
        dots[::2, ::2] = 255
        half = numpy.zeros((4096, 4096), numpy.uint8)
        half[:2048] = 255
        for name, pixels in (("dots.png", dots), ("half.png", half)):
            Image.fromarray(pixels).save(self.folder / name)
            self.assertLess((self.folder / name).stat().st_size, 100_000)
            self.refused(2, "stats", name, "--cell-size", "5", preexec_fn=lambda: limit_addresses(500 << 20),
                         says=f"{name}: labelling the clouds of 4096 x 4096 columns takes about 6")
        # Runs of two columns have sums of places each, which single ones lack.
        pairs = numpy.zeros((1024, 1024), numpy.uint8)
        pairs[::2, ::3] = pairs[::2, 1::3] = 255
        Image.fromarray(pairs).save(self.folder / "pairs.png")
        self.refused(2, "stats", "pairs.png", "--cell-size", "5", preexec_fn=lambda: limit_addresses(45 << 20),
                     says="pairs.png: labelling the clouds of 1024 x 1024 columns takes about 37.8 MiB")
        self.call("stats", "pairs.png", "--cell-size", "5", preexec_fn=lambda: limit_addresses(56 << 20))

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_a_grid_of_far_voxels_is_refused_where_its_box_does_not_fit(self):
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.name = "density"
        accessor = grid.getAccessor()
        for place in ((0, 0, 0), (3000, 3000, 3000)):
            accessor.setValueOn(place, 1.0)
        pyopenvdb.write(str(self.folder / "far.vdb"), [grid])
        self.refused(2, "stats", "far.vdb", preexec_fn=lambda: limit_addresses(2500 << 20),
                     says="far.vdb: the mask of 3001 x 3001 x 3001 voxels around its grid takes about 3.")

    def test_heads_of_netcdf_are_read_once_and_limited(self):
        """A head of CDF-1 with a variable of 1,024 times the same dimension, whose coordinate has many attributes; one of more
        variables than anybody writes."""
        def number(n):
            return n.to_bytes(4, "big")
        def name(text):
            return number(len(text)) + text.encode() + bytes(-len(text) % 4)
        attributes = number(0xC) + number(150_000) + (name("") + number(2) + number(0)) * 150_000
        head = b"CDF\x01" + number(0) + number(0xA) + number(1) + name("x") + number(1) + number(0) * 2
        variables = [name("x") + number(1) + number(0) + attributes + number(5) + number(4) + number(0),
                     name("v") + number(1024) + number(0) * 1024 + number(0) * 2 + number(5) + number(4) + number(0)]
        (self.folder / "many.nc").write_bytes(head + number(0xB) + number(2) + b"".join(variables))
        self.refused(2, "stats", "many.nc", "--variable", "v", "--cell-size", "5", says="dimensions",
                     preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (2, 2)))
        (self.folder / "wide.nc").write_bytes(head + number(0xB) + number(100_001) + variables[1] * 3)
        self.refused(3, "stats", "wide.nc", "--cell-size", "5", says="wide.nc: has 100001 variables; at most 100000 can be read")

    def test_pipes_are_refused(self):
        for name in ("pipe.png", "pipe.nc", "pipe.vdb"):
            os.mkfifo(self.folder / name)
            self.refused(3, "stats", name, *(() if name.endswith("vdb") else ("--cell-size", "5")),
                         says="is not a regular file")

    def test_several_files_are_snapshots(self):
        masks = random_mask(2, (3, 1, 30, 50), 0.2)
        names = [self.netcdf(f"{n}.nc", mask[0] * 1.0, ("y", "x")) for n, mask in enumerate(masks)]
        self.check(self.stats(*names, "--cell-size", "20"), masks, 20, 20)
        other = self.netcdf("other.nc", masks[0, 0, 1:] * 1.0, ("y", "x"))
        self.refused(2, "stats", names[0], other, "--cell-size", "20", says="other.nc: has another number of cells")

    def test_pictures_are_seen_from_above_with_north_up(self):
        mask = random_mask(3, (1, 1, 30, 50), 0.3)
        Image.fromarray((mask[0, 0, ::-1] * 255).astype(numpy.uint8)).save(self.folder / "a.png")
        self.check(self.stats("a.png", "--cell-size", "30"), mask, 30, 30)
        # A cloud over the west side only: periodic sides join it with what is at the east.
        strip = numpy.zeros((20, 20), dtype=numpy.uint8)
        strip[5:9, :3] = strip[5:9, 17:] = 200
        Image.fromarray(strip).save(self.folder / "b.png")
        open_sides = self.stats("b.png", "--cell-size", "10")["statistics"]["clouds_per_km2"]["mean"]
        periodic = self.stats("b.png", "--cell-size", "10", "--periodic", "x")["statistics"]["clouds_per_km2"]["mean"]
        self.assertAlmostEqual(open_sides, 2 * periodic)
        self.assertEqual(self.stats("b.png", "--cell-size", "10", "--threshold", "200")["statistics"]["cover"]["mean"], 0)

    def test_grids_of_vdb_have_the_statistics_of_the_run(self):
        self.call("state", self.scene, "--steps", "5", "--out", "state.vdb")
        self.call("run", self.scene, "--statistics-only", "--set", "time.steps=5", "--out", "run")
        row = rows(self.folder / "run/statistics.csv")[-1]
        found = self.stats("state.vdb")["statistics"]
        self.assertEqual(self.stats("state.vdb", "--variable", "cld")["statistics"], found)
        self.assertEqual(found["cover"]["mean"], float(row["cloud_cover"]))
        self.assertEqual(found["base_mean_m"]["mean"], float(row["base_mean_m"]))
        self.assertAlmostEqual(found["cloud_fraction"]["mean"], float(row["cld"]) / (32 * 24 * 12))
        hum = self.stats("state.vdb", "--variable", "hum")["statistics"]
        self.assertAlmostEqual(hum["cloud_fraction"]["mean"], float(row["hum"]) / (32 * 24 * 12))
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        mask = random_mask(4, (12, 10, 8), 0.1)
        mask[0, 0, 0] = mask[-1, -1, -1] = True  # the bounds of what is active are those of the box
        grid.copyFromArray(numpy.ascontiguousarray(mask.transpose(2, 1, 0) * 0.7, dtype=numpy.float32))
        grid.transform = pyopenvdb.createLinearTransform(25.0)
        grid.name = "fog"
        pyopenvdb.write(str(self.folder / "other.vdb"), [grid])
        found = self.stats("other.vdb", "--threshold", "0.5")
        self.assertEqual((found["cells"], found["cell_size_m"]), ([8, 10, 12], 25))
        self.assertAlmostEqual(found["statistics"]["cover"]["mean"], mask.any(axis=0).mean())
        self.assertEqual(self.stats("other.vdb", "--threshold=-1")["statistics"]["cover"]["mean"], 1)
        grid.transform = pyopenvdb.createLinearTransform([[25, 0, 0, 0], [0, 30, 0, 0], [0, 0, 40, 0], [0, 0, 0, 1]])
        pyopenvdb.write(str(self.folder / "flat.vdb"), [grid])  # is resampled, which is another note
        self.assertEqual(self.stats("flat.vdb", "--threshold=-1")["statistics"]["cover"]["mean"], 1)
        grid.transform = pyopenvdb.createLinearTransform(25.0)
        grid.copyFromArray(numpy.ascontiguousarray(mask.transpose(2, 1, 0) * 0.7 - 10, dtype=numpy.float32))
        pyopenvdb.write(str(self.folder / "below.vdb"), [grid])  # whose values below 0 are read as 0
        self.refused(2, "stats", "below.vdb", "--threshold=-9.5", says="values below 0, which are read as 0, and so does not tell what is above -9.5")

    def test_what_is_missing_or_wrong_is_said(self):
        name = self.netcdf("a.nc", numpy.zeros((4, 5)), ("y", "x"))
        self.refused(2, "stats", name, says="give --cell-size METRES")
        self.refused(2, "stats", name, "--cell-size", "0", says="--cell-size '0' is not a number from 1e-06 upwards")
        self.refused(2, "stats", name, "--cell-size", "5", "--periodic", "z", says="'z' is not one of x, y and xy")
        self.refused(2, "stats", self.scene, says="expected .vdb, .nc or .png")
        self.refused(3, "stats", "none.png", "--cell-size", "5", says="none.png")
        self.refused(3, "stats", name, "--cell-size", "5", "--variable", "qc",
                     says="a.nc: has no variable qc; those with two or more dimensions are ql")
        self.netcdf("two.nc", numpy.zeros((4, 5)), ("y", "x"))
        with netcdf_file(self.folder / "two.nc", "a") as file:
            file.createVariable("qi", "f4", ("y", "x"))[:] = 0
        self.refused(3, "stats", "two.nc", "--cell-size", "5",
                     says="two.nc: has several variables: name one with --variable (`variable` of a target) of ql, qi")
        long, names = "n" * 100_000, [f"q{n}" for n in range(25)]
        with netcdf_file(self.folder / "many.nc", "w") as file:
            file.createDimension("y", 4)
            file.createDimension("x", 5)
            for variable in (long, *names):
                file.createVariable(variable, "f4", ("y", "x"))[:] = 0
        for more in ((), ("--variable", "none")):
            said = self.refused(3, "stats", "many.nc", "--cell-size", "5", *more,
                                says="n" * 60 + "..., " + ", ".join(names[:19]) + " and 6 more").stderr
            self.assertLess(len(said), 500)
        self.refused(2, "stats", self.netcdf("long.nc", numpy.zeros((1, 1, 4, 4, 5)), (long, "b", "c", "y", "x")),
                     "--cell-size", "5", says="has 5 dimensions (" + "n" * 60 + "..., b, c, y, x)")
        self.write("text.png", "not a picture")
        self.refused(3, "stats", "text.png", "--cell-size", "5", says="text.png")
        self.call("state", self.scene, "--steps", "1", "--out", "state.vdb")
        self.refused(2, "stats", "state.vdb", "--cell-size", "5", says="leave out the size")
        self.refused(3, "stats", "state.vdb", "--variable", "act2", says="act2")
        flat = self.netcdf("flat.nc", numpy.zeros(4), ("x",))
        self.refused(3, "stats", flat, "--cell-size", "5", says="two or more dimensions")

    def test_a_mask_is_the_target_of_a_fit(self):
        """Snapshots of a run far apart are the target: the fit finds the run's parameter."""
        self.write("null.toml", NULL)
        for n in range(4):
            self.call("state", "null.toml", "--steps", 300 + 60 * n, "--set", "field.background.ext=0.08", "--out", f"{n}.vdb")
        self.check_target("from = \"0.vdb\"\nsd = 0.004\nperiodic = [\"x\", \"y\"]")
        self.refused_fit("from = \"0.vdb\"", "expected sd")
        self.refused_fit("from = \"no.vdb\"\nsd = 0.1", "no.vdb", status=3)
        self.refused_fit("from = \"0.vdb\"\nsd = 0.1\nvalue = 0.3", "both value and from")
        self.refused_fit("from = \"0.vdb\"\nsd = 0.1\ntreshold = 0.3", "threshold")
        self.refused_fit("from = \"0.vdb\"\nsd = 0.1\nperiodic = [\"z\"]", "'z' is no axis of a mask")

    def test_missing_values_of_a_target_are_not_clear_in_silence(self):
        """Half a swath is not half the cover: the fit says so, unless the file says that what is missing is clear."""
        self.write("null.toml", NULL)
        values = numpy.zeros((4, 8))
        values[:, :2] = 1
        values[:, 4:] = -9
        self.netcdf("swath.nc", values, ("y", "x"), _FillValue=-9.0)
        text = "from = \"swath.nc\"\ncell_size_m = 50\nsd = 0.05\n"
        self.refused_fit(text, "16 of 32 values of swath.nc are missing")
        self.refused_fit(text + "missing = \"cloud\"", "clear")
        self.call("fit", self.with_target(text + "missing = \"clear\""), "--out", "clear", "-j", "2")
        target = json.loads((self.folder / "clear/fit.json").read_text())["targets"][0]
        self.assertEqual((target["target"], target["missing"], target["from"]), (0.25, 16, "swath.nc"))
        notes = json.loads((self.folder / "clear/fit.json").read_text())["notes"]
        self.assertIn("swath.nc has 8 x 4 cells of 50 m, null.toml has 128 x 64 x 20 cells of 50 m", notes[0])
        self.assertIn("swath.nc: 16 of 32 values are missing, and count as clear", notes[1])

    def test_several_files_are_a_target_with_its_own_error(self):
        """Two targets of other kinds for two parameters; levels of NetCDF begin at 0 m, those of the scene higher."""
        self.write("null.toml", NULL.replace("[time]", "origin_m = [0, 0, 600]\n[time]"))
        for n in range(3):
            self.call("state", "null.toml", "--steps", 300 + 60 * n, "--set", "field.background.ext=0.08",
                      "--set", "field.background.act=0.0012", "--out", f"{n}.vdb")
        found = self.stats("0.vdb", "1.vdb", "2.vdb", "--variable", "cld")["statistics"]
        levels = self.netcdf("levels.nc", random_mask(13, (20, 64, 128), 0.012) * 1.0, ("z", "y", "x"))
        fit = FIT[:FIT.index("[[target]]")].replace("runs = 32", "runs = 24")
        self.write("two.toml", fit + """\
[[parameter]]
key = "field.background.act"
prior = { from = 0.0005, to = 0.002, scale = "log" }
[[target]]
statistic = "lifetime_s"
value = 120
sd = 3
[[target]]
statistic = "cover"
from = ["0.vdb", "1.vdb", "2.vdb"]
variable = "cld"
""")
        self.call("fit", "two.toml", "--out", "two", "-j", "2")
        result = json.loads((self.folder / "two/fit.json").read_text())
        lifetime, cover = result["targets"]
        self.assertEqual((lifetime["from"], cover["from"], result["notes"]), (None, "0.vdb and 2 more", []))
        self.assertEqual((cover["target"], cover["sd"]), (found["cover"]["mean"], found["cover"]["se"]))
        self.assertEqual([direction["strength"] > 1 for direction in result["directions"]], [True, True])
        # Cells live for 1 / ext steps of 10 s.
        self.assertAlmostEqual(result["parameters"][0]["mean"], 10 / 120, delta=4 * 10 / 120 * 3 / 120)
        self.write("base.toml", fit.replace("runs = 24", "runs = 10").replace("proof = 4", "proof = 0") + """\
[[target]]
statistic = "base_mean_m"
from = "levels.nc"
cell_size_m = 50
sd = 20
""")
        said = self.call("fit", "base.toml", "--out", "base", "-j", "2").stderr
        self.assertIn("note: the lowest level of levels.nc begins at 0 m, that of null.toml at 600 m: `base_mean_m`", said)
        self.refused_fit("from = []\nsd = 0.1", "names no file")
        self.refused_fit("from = [\"0.vdb\", 3]\nsd = 0.1", "`target[0].from` holds an integer")

    def test_snapshots_that_are_alike_have_no_standard_error(self):
        """However many: the rounding of their mean is none."""
        self.write("null.toml", NULL)
        Image.fromarray((random_mask(5, (24, 24), 0.38) * 255).astype(numpy.uint8)).save(self.folder / "m.png")
        for count in (2, 7, 8, 11):
            cover = self.stats(*["m.png"] * count, "--cell-size", "50")["statistics"]["cover"]
            self.assertEqual((cover["se"], cover["sd"]), (0, 0), count)
            files = ", ".join(["\"m.png\""] * count)
            self.refused_fit(f"from = [{files}]\ncell_size_m = 50\n", "does not say how uncertain its `cover` is")

    def test_the_cells_of_a_layer_are_a_parameter(self):
        """A mask of other cells is no mistake where the fit changes those of the layer that is measured."""
        Image.fromarray((random_mask(5, (32, 32), 0.3) * 255).astype(numpy.uint8)).save(self.folder / "m.png")
        text = (FIT[:FIT.index("[[target]]")].replace("null.toml", f"{SOURCE}/scenes/genera/Cu-fra.toml").replace("runs = 32", "runs = 9")
                .replace("clouds_every = 0", "clouds_every = 10") + "[[target]]\nstatistic = \"clouds_per_km2\"\n"
                "from = \"m.png\"\ncell_size_m = 40\nsd = 1\n")
        for key, prior, is_told in (("layer[0].base_height_m", "from = 300, to = 600", True),
                                    ("layer[0].lattice.cell_size_m", "from = 30, to = 60", False),
                                    ("lattice.cell_size_m", "from = 30, to = 60", False)):
            fit = text.replace("field.background.ext", key).replace("from = 0.02, to = 0.3", prior)
            said = self.call("fit", self.write("f.toml", fit), "--out", "f", status=2).stderr
            self.assertIn("9 runs are too few", said)
            self.assertEqual("depends on that" in said, is_told, said)

    def test_what_a_view_from_above_lacks_is_no_target(self):
        self.write("null.toml", NULL)
        mask = random_mask(11, (64, 128), 0.25)
        Image.fromarray((mask * 255).astype(numpy.uint8)).save(self.folder / "m.png")
        for statistic in ("cloud_fraction", "base_mean_m", "top_mean_m", "overlap"):
            said = self.refused_fit("from = \"m.png\"\ncell_size_m = 50\nsd = 0.05\n", f"view from above, and has no `{statistic}`",
                                    statistic, clouds_every=10)
            self.assertRegex(said, r"\| +\^\n")
        Image.fromarray(numpy.zeros((64, 128), numpy.uint8)).save(self.folder / "clear.png")
        self.refused_fit("from = \"clear.png\"\ncell_size_m = 50\nsd = 0.05\n", "the `cover` of 0 is no target (of clear.png)")

    def test_sizes_of_mask_and_scene_are_compared(self):
        """The scene has 128 x 64 x 20 cells of 50 m."""
        self.write("null.toml", NULL)
        files = {}
        for name, shape in (("same", (64, 128)), ("large", (128, 256)), ("deep", (10, 64, 128))):
            files[name] = self.netcdf(f"{name}.nc", random_mask(12, shape, 0.25) * 1.0, ("z", "y", "x")[-len(shape):])
        def refused(file, cell, statistic, says, more=""):
            self.refused_fit(f"from = \"{files[file]}\"\ncell_size_m = {cell}\nsd = 0.05\n{more}", says, statistic, clouds_every=10)
        own = "null.toml has 128 x 64 x 20 cells of 50 m"
        for statistic in ("edge_per_km", "clouds_per_km2", "cloud_area_m2", "size_exponent", "fractal_dimension"):
            refused("same", 100, statistic, f"same.nc has 128 x 64 cells of 100 m, {own}: `{statistic}` depends on that")
        refused("large", 50, "size_exponent_line", f"large.nc has 256 x 128 cells of 50 m, {own}: `size_exponent_line` depends")
        refused("deep", 50, "overlap", f"deep.nc has 128 x 64 x 10 cells of 50 m and 40 m high, {own}: `overlap` depends",
                "level_height_m = 40\n")
        # What does not depend on them is compared, and a note says so; nothing is said of equal ones.
        for file, cell, statistic, sizes in (("large", 50, "edge_per_km", "large.nc has 256 x 128 cells of 50 m"),
                                             ("same", 100, "cover", "same.nc has 128 x 64 cells of 100 m"),
                                             ("same", 50, "cover", None)):
            text = FIT.replace("\"cover\"", f"\"{statistic}\"").replace("runs = 32", "runs = 10").replace("proof = 4", "proof = 0")
            self.write("fit.toml", text.replace("value = 0.3\nsd = 0.003",
                                                f"from = \"{files[file]}\"\ncell_size_m = {cell}\nsd = 0.05"))
            result = self.call("fit", "fit.toml", "--out", "fit", "--overwrite", "-j", "2")
            notes = json.loads((self.folder / "fit/fit.json").read_text())["notes"]
            expected = [f"{sizes}, {own}: `{statistic}` is compared across that"] if sizes else []
            self.assertEqual(notes, expected)
            self.assertEqual([line for line in result.stderr.splitlines() if line.startswith("note: ")],
                             [f"note: {note}" for note in expected])

    def with_target(self, text):
        return self.write("fit.toml", FIT.replace("value = 0.3\nsd = 0.003\n", text + "\n"))

    def refused_fit(self, text, says, statistic="cover", clouds_every=0, status=2):
        path = self.with_target(text)
        fit = (self.folder / "fit.toml").read_text().replace("\"cover\"", f"\"{statistic}\"")
        (self.folder / "fit.toml").write_text(fit.replace("clouds_every = 0", f"clouds_every = {clouds_every}"))
        result = self.call("fit", path, status=status)
        self.assertIn(says, result.stderr)
        self.assertIn("fit.toml:", result.stderr)
        return result.stderr

    def check_target(self, text):
        self.call("fit", self.with_target(text), "--out", "fit", "-j", "2")
        fit = json.loads((self.folder / "fit/fit.json").read_text())
        cover = self.stats("0.vdb")["statistics"]["cover"]["mean"]
        self.assertEqual(fit["targets"][0]["target"], cover)
        self.assertEqual(fit["targets"][0]["sd"], 0.004)
        estimate = fit["parameters"][0]
        self.assertLess(estimate["low"], 0.08 * 1.02)
        self.assertGreater(estimate["high"], 0.08 * 0.98)
        self.assertAlmostEqual(estimate["mean"], 0.08, delta=0.006)


if __name__ == "__main__":
    unittest.main()
