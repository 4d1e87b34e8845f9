# SPDX-License-Identifier: Apache-2.0
"""`nephos export`, and its files in programs of others: OpenVDB, VTK, NanoVDB's tools, ffmpeg, xmllint, Pillow."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest
import zlib

import numpy

from case import NEPHOS, PATIENCE, SANITIZED, SCENE, SOURCE, Case, limit_addresses, unsealed, voxels
from verify_test import LAYERED, PLACED


def dense(path):
    """The density of a VDB file as an array by z, y, x; and its grid."""
    import pyopenvdb
    grid = pyopenvdb.read(str(path), "density")
    last = grid.metadata["nephos_bbox_max"]
    array = numpy.zeros([n + 1 for n in last], "f4")
    grid.copyToArray(array)
    return array.transpose(2, 1, 0), grid


class Export(Case):
    def setUp(self):
        super().setUp()
        self.call("run", self.write("placed.toml", PLACED), "--no-render", "--out", "run")
        self.density, self.grid = dense(self.folder / "run/density/placed_0003.vdb")

    def export(self, folder, *arguments):
        self.call("export", "run", "-o", folder, *arguments)
        self.call("verify", folder)
        return self.folder / folder

    def tool(self, *command):
        result = subprocess.run([str(word) for word in command], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, f"{command}\n{result.stdout}\n{result.stderr}")
        return result.stdout

    def test_vtk_reads_vti_and_pvd(self):
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkIOXML import vtkXMLImageDataReader
        for arguments in ([], ["--zip"], ["--type", "r8"]):
            folder = self.export("vti" + "".join(arguments), "--to", "vti", *arguments)
            reader = vtkXMLImageDataReader()
            reader.SetFileName(str(folder / "placed_0003.vti"))
            reader.Update()
            image = reader.GetOutput()
            self.assertEqual(image.GetDimensions(), (32, 24, 12))
            origin = self.grid.transform.indexToWorld((0, 0, 0))
            self.assertEqual(tuple(image.GetOrigin()), tuple(origin))
            self.assertEqual(image.GetFieldData().GetArray("TimeValue").GetValue(0), 30)
            found = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(12, 24, 32)
            if "r8" in arguments:
                self.assertLessEqual(abs(found / 255 - self.density).max(), 1 / 509)
            else:
                self.assertTrue((found == self.density).all())
            self.tool("xmllint", "--noout", folder / "placed.pvd")

    def test_nanovdb_tools_take_nvdb(self):
        folder = self.export("nvdb", "--to", "nvdb")
        self.tool("nanovdb_validate", folder / "placed_0003.nvdb")
        self.tool("nanovdb_convert", "-f", folder / "placed_0003.nvdb", folder / "back.vdb")
        import pyopenvdb
        back = pyopenvdb.readAll(str(folder / "back.vdb"))[0][0]
        array = numpy.zeros((32, 24, 12), "f4")
        back.copyToArray(array)
        self.assertTrue((array.transpose(2, 1, 0) == self.density).all())
        self.assertEqual(back.transform.indexToWorld((1, 2, 3)), self.grid.transform.indexToWorld((1, 2, 3)))

    def test_vdb_print_names_what_is_in_a_file(self):
        """OpenVDB's own tool: the grid, its class, its box and our metadata, of the run's file and of the export's."""
        folder = self.export("flat", "--to", "vdb")
        for file in (self.folder / "run/density/placed_0003.vdb", folder / "placed_0003.vdb"):
            said = self.tool("vdb_print", "-l", file)
            for text in ("Name: density", "fog volume", "nephos_latitude_deg", "51.4775", "nephos_ecef_from_world"):
                self.assertIn(text, said)
            self.assertRegex(said, r"\[0, 0, 0\] -> \[31, 23, 11\]")

    def test_ffmpeg_decodes_bc4(self):
        folder = self.export("dds", "--to", "dds", "--mips")
        pixels = subprocess.run(["ffmpeg", "-v", "error", "-i", folder / "placed_0003.dds", "-f", "rawvideo", "-pix_fmt", "gray", "-"],
                                capture_output=True, check=True).stdout
        found = numpy.frombuffer(pixels, "u1")[:32 * 24].reshape(24, 32)
        self.assertLessEqual(abs(found / 255 - self.density[0]).max(), 1 / 14 + 2 / 255)

    def test_osgconv_keeps_every_slice(self):
        """OpenSceneGraph, FlightGear's loader: reads and writes volumes, upside down, and blocks of BC4."""
        folder = self.export("dds-r8", "--to", "dds", "--type", "r8", "--legacy-dds")
        self.tool("osgconv", folder / "placed_0003.dds", self.folder / "back.dds")
        head = 128
        given = numpy.frombuffer((folder / "placed_0003.dds").read_bytes()[head:], "u1").reshape(12, 24, 32)
        back = numpy.frombuffer((self.folder / "back.dds").read_bytes()[head:], "u1").reshape(12, 24, 32)
        self.assertLessEqual(abs(given / 255 - self.density).max(), 1 / 509)
        self.assertTrue((back == given[:, ::-1]).all())
        folder = self.export("dds-bc4", "--to", "dds", "--type", "bc4", "--legacy-dds")
        self.tool("osgconv", folder / "placed_0003.dds", self.folder / "blocks.dds")
        given, back = (folder / "placed_0003.dds").read_bytes(), (self.folder / "blocks.dds").read_bytes()
        self.assertEqual(sorted(given[head:]), sorted(back[head:]))
        self.assertEqual(back[84:88], b"ATI1")

    def test_bricks(self):
        """The table by NumPy: every voxel with density lies in a brick, and ranges are those of the voxels."""
        folder = self.export("bricks", "--to", "bricks", "--bricks", "8", "--type", "r16", "--mips")
        data = (folder / "placed_0003.bricks").read_bytes()
        kind, edge, border, levels = numpy.frombuffer(data[8:24], "<u4")
        self.assertEqual((data[:8], kind, edge, border), (b"NPHBRIC1", 1, 8, 1))
        count = int(numpy.frombuffer(data[24:32], "<u8")[0])
        entry = numpy.dtype([("at", "<u4", 4), ("offset", "<u8"), ("bytes", "<u8"), ("range", "<f4", 2)])
        table = numpy.frombuffer(data, entry, count, 32 + 12 * int(levels))
        found = numpy.zeros_like(self.density)
        for brick in table[table["at"][:, 0] == 0]:
            if not brick["bytes"]:
                continue
            voxels = numpy.frombuffer(data, "<u2", 1000, int(brick["offset"])).reshape(10, 10, 10) / 65535
            self.assertAlmostEqual(voxels.max(), brick["range"][1], delta=1e-4)
            i, j, k = 8 * brick["at"][1:]
            part = found[k:k + 8, j:j + 8, i:i + 8]
            part[:] = voxels[1:9, 1:9, 1:9][:part.shape[0], :part.shape[1], :part.shape[2]]
        self.assertLessEqual(abs(found - self.density).max(), 1 / 131000)
        sidecar = json.loads((folder / "placed.volume.json").read_text())
        self.assertEqual(sidecar["formats"][0]["brick"], {"edge": 8, "border": 1})

    def test_pillow_reads_slices(self):
        import PIL.Image
        folder = self.export("slices", "--to", "slices")
        sidecar = json.loads((folder / "placed.volume.json").read_text())
        columns = sidecar["formats"][0]["columns"]
        wide = self.export("slices16", "--to", "slices", "--type", "r16")
        picture = numpy.array(PIL.Image.open(wide / "placed_0003.png"))
        self.assertLessEqual(abs(picture[:24, :32] / 65535 - self.density[0]).max(), 1 / 131000)
        picture = numpy.array(PIL.Image.open(folder / "placed_0003.png"))
        for k in range(12):
            y, x = k // columns * 24, k % columns * 32
            self.assertLessEqual(abs(picture[y:y + 24, x:x + 32] / 255 - self.density[k]).max(), 1 / 509)

    def test_blender_files_are_moved_and_have_its_velocity(self):
        scene = self.write("windy.toml", SCENE + "[[wind]]\nlevels = [{ height_m = 0, from_deg = 270, speed_m_per_s = 7 }]\n")
        self.call("run", scene, "--no-render", "--out", "windy")
        self.call("export", "windy", "--for", "blender", "-o", "blender")
        self.call("verify", "blender")
        import pyopenvdb
        before = pyopenvdb.read(str(self.folder / "windy/density/windy_0002.vdb"), "density")
        after = pyopenvdb.readAll(str(self.folder / "blender/windy_0002.vdb"))[0]
        self.assertEqual([grid.name for grid in after], ["density", "velocity"])
        half = before.transform.voxelSize()[0] / 2
        for a, b in zip(before.transform.indexToWorld((0, 0, 0)), after[0].transform.indexToWorld((0, 0, 0))):
            self.assertAlmostEqual(a - half, b)
        self.assertAlmostEqual(next(after[1].citerOnValues()).value[0], 7, 5)
        self.assertIn("Half a voxel", (self.folder / "blender/README.txt").read_text())
        self.assertEqual(after[1].activeVoxelCount(), 32 * 24 * 12)  # it blows where no cloud is, too

    def test_winds_of_files_are_those_of_each(self):
        """Files of a run in which the wind turns, exported by themselves, and a calm one among them."""
        turning = SCENE + "".join(f"[[wind]]\ntime_s = {time}\nlevels = [{{ height_m = 0, from_deg = {turn}, speed_m_per_s = {speed} }}]\n"
                                  for time, turn, speed in ((0, 270, 5), (1000, 180, 9)))
        self.call("run", self.write("turning.toml", turning), "--no-render", "--out", "turning")
        self.call("export", *sorted((self.folder / "turning/density").glob("*.vdb")), "--to", "raw", "-o", "files")
        self.call("export", "turning", "--to", "raw", "-o", "whole")
        winds, of_run = (json.loads((self.folder / out / "turning.volume.json").read_text())["wind"] for out in ("files", "whole"))
        frames = json.loads((self.folder / "files/turning.volume.json").read_text())["frames"]
        self.assertEqual([wind["time_s"] for wind in winds], [frame["time_s"] for frame in frames])
        self.assertEqual([wind["time_s"] for wind in of_run], [0, 1000])
        for wind in winds:  # linear between those of the run
            level, = wind["levels"]
            self.assertAlmostEqual(level["east_m_per_s"], 5 * (1 - wind["time_s"] / 1000), 5)
            self.assertAlmostEqual(level["north_m_per_s"], 9 * wind["time_s"] / 1000, 5)
        self.call("export", *sorted((self.folder / "run/density").glob("*.vdb")), "--to", "raw", "-o", "calm")
        self.assertEqual(json.loads(next((self.folder / "calm").glob("*.volume.json")).read_text())["wind"], [])

    def test_the_wind_of_all_layers_has_their_key_frames(self):
        """Of those of layers, which may be all that there are, as of those of the scene."""
        frames = lambda table, times: "".join(f"[[{table}]]\ntime_s = {time}\nlevels = [{{ height_m = 0, from_deg = {turn}, speed_m_per_s = {speed} }}]\n"
                                              for time, turn, speed in times)
        layer = ('[[model]]\nname = "m"\nseeds = [{ size_m = [300, 300, 200] }]\n[[sky]]\nname = "s"\nstate = 0\nmodels = "m"\nclouds = 3\n'
                 '[[layer]]\nname = "low"\nskies = "s"\nbase_height_m = 200\n') + frames("layer.wind", ((0, 270, 5), (1000, 180, 9)))
        for name, more, times in (("own", layer, [0, 1000]), ("both", frames("wind", ((0, 90, 1), (600, 90, 3))) + layer, [0, 600, 1000])):
            self.call("run", self.write(f"{name}.toml", SCENE + more), "--no-render", "--out", name)
            self.call("export", name, "--to", "raw", "-o", f"{name}-raw")
            sidecar = json.loads(next((self.folder / f"{name}-raw").glob("*.volume.json")).read_text())
            self.assertEqual([wind["time_s"] for wind in sidecar["wind"]], times)
            last = sidecar["wind"][-1]["levels"][0]
            self.assertAlmostEqual(last["north_m_per_s"], 9, 5)
            self.assertAlmostEqual(last["east_m_per_s"], 0, 5)

    def test_velocity_has_the_fields_of_the_wind(self):
        """Those of the run's own grid, also where there is no profile; those of files are told."""
        import pyopenvdb
        field = "[[wind_field]]\nkind = \"vortex\"\nx_m = 400\ny_m = 300\nradius_m = 300\nspeed_m_per_s = 8\n"
        self.call("run", self.write("vortex.toml", SCENE + field), "--no-render", "--set", "density.write_velocity=true", "--out", "vortex")
        said = self.call("export", "vortex", "--to", "vdb", "--velocity", "v", "-o", "fields").stderr
        self.assertNotIn("calm", said)
        own, exported = (pyopenvdb.read(str(self.folder / folder / "vortex_0002.vdb"), name).getConstAccessor()
                         for folder, name in (("vortex/density", "vel"), ("fields", "v")))
        for voxel in ((0, 0, 0), (5, 9, 3), (31, 23, 11), (12, 8, 6)):
            for a, b in zip(own.getValue(voxel), exported.getValue(voxel)):
                self.assertAlmostEqual(a, b, 5)
        self.assertGreater(max(map(abs, own.getValue((5, 9, 3)))), 1)

    def test_the_wind_of_files_alone_is_no_calm_air(self):
        """Without the files there are no velocities: no grid, instead of one of zeros."""
        import pyopenvdb
        wind = pyopenvdb.Vec3SGrid()
        wind.copyFromArray(numpy.full((4, 4, 4, 3), 5, dtype="f4"))
        wind.name = "vel"
        wind.transform = pyopenvdb.createLinearTransform(voxelSize=1000)
        pyopenvdb.write(str(self.folder / "wind.vdb"), [wind])
        field = "[[wind_field]]\nkind = \"grid\"\nfiles = \"wind.vdb\"\n"
        self.call("run", self.write("filed.toml", SCENE + field), "--no-render", "--out", "filed")
        said = self.call("export", "filed", "--to", "vdb", "--velocity", "v", "-o", "alone").stderr
        self.assertIn("the wind that the scene has from files is not in the grid `v`", said)
        self.assertIn("no other wind blows: its VDB files have no grid `v`", said)
        said = self.call("export", "filed", "--to", "layers", "-o", "weather").stderr
        self.assertIn("what `[[wind_field]]` adds is not in them", said)
        self.assertNotIn("wind_field", self.call("export", "run", "--to", "layers", "-o", "profile").stderr)
        vortex = "[[wind_field]]\nkind = \"vortex\"\nradius_m = 300\nspeed_m_per_s = 20\n"
        self.call("run", self.write("formula.toml", SCENE + vortex), "--no-render", "--out", "formula")
        self.assertIn("what `[[wind_field]]` adds is not in them", self.call("export", "formula", "--to", "metar", "-o", "of-formula").stderr)
        self.assertEqual([grid.name for grid in pyopenvdb.readAllGridMetadata(str(self.folder / "alone/filed_0001.vdb"))], ["density"])

    def test_verify_of_decimal_places(self):
        """Of cells and origins that binary numbers do not hold: the centre of the first voxel is what files have."""
        for number, (origin, cell) in enumerate((("[48, -9.06, 6805.16]", 40.1), ("[0.1, 0.2, 0.3]", 30), ("[-600, -600, 1000.1]", 40))):
            place = ("--set", f"lattice.origin_m={origin}", "--set", f"lattice.cell_size_m={cell}", "--set", "frames.count=1")
            self.call("run", self.write("tiny.toml", SCENE), "--no-render", *place, "--out", f"place{number}")
            for more in (["--for", "blender"], ["--to", "vdb", "--size", "7"], ["--to", "vdb", "--voxel", str(2 * cell)], ["--to", "usd", "--velocity", "v"]):
                out = f"x{number}{more[-1]}"
                self.call("export", f"place{number}", *more, "-o", out)
                self.call("verify", out)
        self.assertIn("another place", self.moved(next((self.folder / "x27").glob("*.vdb"))))
        # Volumes of other programs, whose first voxel is far from the origin.
        import numpy
        import pyopenvdb
        for number, (first, size) in enumerate(((-64, 0.1), (150, 0.05), (-3000, 0.3), (37, 30.48))):
            grid = pyopenvdb.FloatGrid()
            grid.copyFromArray(numpy.full((8, 8, 8), 0.5, "f4"), ijk=(first, first + 3, first - 1))
            grid.name, grid.gridClass = "density", pyopenvdb.GridClass.FOG_VOLUME
            grid.transform = pyopenvdb.createLinearTransform(size)
            pyopenvdb.write(str(self.folder / f"fog{number}.vdb"), [grid])
            for more in (["--for", "blender"], ["--to", "vdb"], ["--to", "vdb", "--voxel", str(2 * size)]):
                out = f"fog{number}{more[-1]}"
                self.call("export", f"fog{number}.vdb", *more, "-o", out)
                self.call("verify", out)

    def moved(self, path):
        """What verify says of an export whose grid lies a thousandth of a voxel elsewhere."""
        import pyopenvdb
        grids, metadata = pyopenvdb.readAll(str(path))
        for grid in grids:
            grid.transform.translate((0.04, 0, 0))
        pyopenvdb.write(str(path), grids, metadata)
        result = subprocess.run([NEPHOS, "verify", str(path.parent)], capture_output=True, text=True, cwd=self.folder, env=self.environment)
        self.assertEqual(result.returncode, 1)
        return result.stdout + result.stderr

    def test_verify_tells_all_that_is_damaged(self):
        """A file that cannot be read takes nothing from what its checksum says, in a moment; the others are judged."""
        folder = self.export("hit", "--to", "nvdb", "--frames", "1..3")
        clean = {path: path.read_bytes() for path in folder.glob("*.nvdb")}
        first = folder / "placed_0001.nvdb"
        for at, value in ((12, 0x58), (224, 0x10), (225, 1), (227, 0x40), (960, 3), (24, 0xFF)):
            for path, data in clean.items():
                path.write_bytes(data)
            data = bytearray(clean[first])
            data[at] ^= value
            first.write_bytes(bytes(data))
            result = self.call("verify", "hit", status=1)
            self.assertIn("placed_0001.nvdb: its bytes are not those that were written", result.stdout + result.stderr, at)
            self.assertNotIn("longer than allowed", result.stdout + result.stderr, at)
            told = self.call("verify", "hit", "--json", status=1).stdout
            self.assertIn("placed_0001.nvdb", json.loads(told)["checks"][2]["detail"])
        first.write_bytes(clean[first])
        source = self.folder / "run/density/placed_0002.vdb"
        whole = source.read_bytes()
        source.write_bytes(whole[:len(whole) // 2])
        checks = json.loads(self.call("verify", "hit", "--json", status=3).stdout)["checks"]
        decoding, = [check for check in checks if check["name"] == "decoding"]
        self.assertEqual(decoding["detail"].count("placed_0002.vdb"), 1)
        self.assertEqual([check["name"] for check in checks if not check["passed"]], ["decoding"])
        source.write_bytes(whole)
        first.write_bytes(b"cut")
        os.chmod(self.folder, 0o755)
        subprocess.run(["chmod", "-R", "a+rX", self.folder], check=True)
        (self.folder / "run/density").chmod(0o700)
        if os.getuid() == 0:  # another user may not enter the folder of the sources
            result = subprocess.run(["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", NEPHOS, "verify", "hit"],
                                    capture_output=True, text=True, cwd=self.folder, env=self.environment)
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertIn("placed_0001.nvdb: 3 bytes", result.stdout + result.stderr)
        (self.folder / "run/density").chmod(0o755)

    def test_genera_are_those_of_layers_and_models(self):
        """Not of what their names begin with; clouds of no genus are cumulus, which the automaton makes."""
        height = "base_height_m = 1000"
        for name, genus, place, wanted, xplane in (("Storm", "Cb", height, "Cb", 3), ("Storm", "none", height, "", 2), ("Sc-2", "none", height, "Sc", 1),
                                                   ("Storm", "Cu", 'genus = "Cb"', "Cb", 3), ("Storm", "none", 'genus = "St fra"', "St", 1)):
            text = (f'name = "g"\nseed = 1\n[time]\nstep_s = 10\nsteps = 60\n[frames]\nstart_s = 590\ncount = 1\n[[model]]\nname = "{name}"\ngenus = "{genus}"\n'
                    'seeds = [{ position_m = [0, 0, 300], size_m = [1500, 1500, 1000] }]\n[[sky]]\nname = "s"\nclouds = 8\nstate = 0\n'
                    f'models = ["{name}"]\n[[layer]]\nname = "tower"\nskies = ["s"]\n{place}\n'
                    "lattice = { cells = [60, 60, 36], cell_size_m = 100, origin_m = [-3000, -3000, 300] }\n")
            self.call("run", self.write("g.toml", text), "--no-render", "--out", "g", "--overwrite")
            self.call("export", "g", "--to", "layers", "--to", "xplane", "-o", "summary")
            layers = json.loads(next((self.folder / "summary").glob("*.layers.json")).read_text())
            self.assertEqual(layers["frames"][0]["layers"][0]["genus"], wanted)
            self.assertIn(f'"cloud_type": {xplane}', next((self.folder / "summary").glob("*.xplane.json")).read_text())
            shutil.rmtree(self.folder / "summary")

    def test_showers_are_of_several_areas_that_rain(self):
        place = 'name = "g"\nseed = 1\n[time]\nstep_s = 10\nsteps = 1\n[frames]\ncount = 1\n[[model]]\nname = "m"\n' \
            'seeds = [{ position_m = [0, 0, 300], size_m = [1500, 1500, 1000] }]\n[[sky]]\nname = "s"\nclouds = 8\nstate = 0\nmodels = ["m"]\n' \
            '[[layer]]\nname = "low"\nskies = ["s"]\nbase_height_m = 1000\nlattice = { cells = [32, 32, 24], cell_size_m = 100 }\n'
        for second, wanted in ((0, " RA "), (2, " SHRA ")):
            areas = "".join(f"[[layer.rain.placed]]\nx_m = {x}\ny_m = 0\nsemi_a_m = 500\nintensity_mm_per_h = {rain}\n" for x, rain in ((0, 4), (2000, second)))
            self.call("run", self.write("g.toml", place + areas), "--no-render", "--out", "g", "--overwrite")
            self.call("export", "g", "--to", "metar", "-o", f"rain{second}")
            self.assertIn(wanted, next((self.folder / f"rain{second}").glob("*.metar.txt")).read_text())

    def test_values_beyond_16_bits_are_refused(self):
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(numpy.linspace(0, 1e5, 1000, dtype="f4").reshape(10, 10, 10))
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "large.vdb"), [grid])
        for arguments in (["--for", "unreal"], ["--to", "raw", "--type", "r16f"], ["--to", "vdb", "--type", "r16f"]):
            self.refused(2, "export", "large.vdb", *arguments, "-o", "large", says="large.vdb: its largest value is 100000, and 16-bit floats end at 65504")
            shutil.rmtree(self.folder / "large", ignore_errors=True)
        self.call("export", "large.vdb", "--to", "raw", "--type", "r16f", "--range", "auto", "-o", "large")
        self.call("verify", "large")

    def write_apart(self, side, edge_m=1.0, value=0.5):
        """apart.vdb: two voxels at opposite corners of a box."""
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.transform = pyopenvdb.createLinearTransform(edge_m)
        for place in ((0, 0, 0), (side - 1, side - 1, side - 1)):
            grid.getAccessor().setValueOn(place, value)
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "apart.vdb"), [grid])

    def test_boxes_beyond_the_memory(self):
        """Two voxels far apart: what holds all between them is refused before it is made, and a grid of them needs none of it."""
        self.write_apart(16000)
        for side, arguments in ((16000, ["--to", "flightgear"]), (8000, ["--to", "nvdb", "--voxel", "2"]), (8000, ["--to", "vdb", "--voxel", "2"])):
            self.refused(2, "export", "apart.vdb", *arguments, "-o", "apart", says=f"apart.vdb: a box of {side} x {side} x {side} voxels")
            planned = self.call("export", "apart.vdb", *arguments, "-o", "apart", "--plan").stderr
            self.assertRegex(planned, f"note: apart.vdb: a box of {side} x .* are all there is: an export would be refused")
            self.assertFalse((self.folder / "apart").exists())
        self.assertEqual(self.call("export", "apart.vdb", "--to", "vdb", "--plan").stderr, "")
        self.call("export", "apart.vdb", "--to", "vdb", "--to", "nvdb", "-o", "apart")
        self.call("verify", "apart")

    def test_codes_of_the_largest_floats_are_refused(self):
        for value, status in ((3.4028235e38, 2), (3.4028225e38, 0)):
            self.write_apart(8, value=value)
            for bits in ("fp8", "fp16"):
                said = self.call("export", "apart.vdb", "--to", "nvdb", "--quantise", bits, "-o", f"{bits}-{status}", status=status).stderr
                self.assertEqual("--quantise takes grids up to 3.40282" in said, status == 2, said)
                if status == 0:
                    self.call("verify", f"{bits}-0")

    def test_halves_hold_means(self):
        """One value beyond 16-bit floats among many whose mean is not."""
        self.write_apart(16)
        import pyopenvdb
        grid = pyopenvdb.read(str(self.folder / "apart.vdb"), "density")
        grid.getAccessor().setValueOn((0, 0, 0), 70000)
        pyopenvdb.write(str(self.folder / "beyond.vdb"), [grid])
        for name in ("raw", "vdb"):
            arguments = ("export", "beyond.vdb", "--to", name, "--type", "r16f")
            self.refused(2, *arguments, "-o", name, says="its largest value is 70000, and 16-bit floats end at 65504")
            self.call(*arguments, "--voxel", "2", "-o", name)
            self.call("verify", name)

    SLACK = 16  # MiB that a program takes beside what it asks for

    def limited(self, mebibytes, *arguments):
        result = subprocess.run([NEPHOS, *arguments, "-j", "1"], cwd=self.folder, capture_output=True, text=True, env=self.environment,
                                preexec_fn=lambda: limit_addresses(int(mebibytes) << 20))
        return result.returncode, result.stdout + result.stderr

    def asked(self, text):
        """What was asked for beyond what there is, in MiB; none in another message."""
        found = re.search(r" takes about ([0-9.]+) ([KMG])iB, but ([0-9.]+) ([KMG])iB \(", text)
        units = {"K": 1 / 1024, "M": 1, "G": 1024}
        return found and float(found[1]) * units[found[2]] - float(found[3]) * units[found[4]]

    def enough(self, *command, status):
        """Returns addresses that are enough, in MiB: of its libraries, and what it has asked for in turn with `status`."""
        mebibytes, has_asked = 100, False
        while mebibytes < 1500:
            found, text = self.limited(mebibytes, *command)
            if found == 0:
                return mebibytes
            more = self.asked(text)
            if more is not None:
                self.assertEqual(found, status, text)
            else:
                self.assertFalse(has_asked, text)
            has_asked = has_asked or more is not None
            mebibytes += 10 if more is None else more + self.SLACK
        return self.fail(text)

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_boxes_need_what_is_asked_for(self):
        """Little less than that is refused before anything is written, that much is enough."""
        self.write_apart(400)
        first = 100

        def least_of(*command):
            """The least of addresses with which the program comes to ask: its libraries take most of them."""
            nonlocal first
            for mebibytes in range(first, 1000, 10):
                first = mebibytes
                status, text = self.limited(mebibytes, *command)
                if self.asked(text) is not None:
                    return mebibytes, status, text
                self.assertNotEqual(status, 0, f"{command} has {mebibytes} MiB\n{text}")
            self.fail(text)

        for n, (arguments, is_sparse) in enumerate(((["--to", "raw", "--type", "r8"], False), (["--to", "bricks", "--type", "r32f"], False),
                                                    (["--to", "bricks", "--bricks", "256"], False), (["--to", "raw", "--mips"], False),
                                                    (["--to", "vti", "--zip"], False), (["--to", "slices"], False), (["--to", "flightgear"], False),
                                                    (["--to", "nvdb", "--voxel", "2"], False), (["--to", "vdb", "--to", "nvdb"], True))):
            folder = f"box{n}"
            export = ("export", "apart.vdb", *arguments, "-o", folder)
            if is_sparse:
                self.assertEqual(self.limited(190, *export)[0], 0)
                self.assertEqual(self.limited(190, "verify", folder)[0], 0)
                continue
            least, status, text = least_of(*export)
            self.assertEqual(status, 2, text)
            self.assertRegex(text, "apart.vdb: a box of [0-9]+ x [0-9]+ x [0-9]+ voxels")
            self.assertFalse((self.folder / folder).exists())
            status, text = self.limited(least + self.asked(text) + self.SLACK, *export)
            self.assertEqual(status, 0, text)
            least, status, text = least_of("verify", folder)
            self.assertEqual(status, 3, text)
            self.assertIn("nothing is wrong, but the check `decoding` could not be done", text)
            for _ in range(3):  # for the codes, then for the voxels beside them
                if status == 0:
                    break
                least += self.asked(text) + self.SLACK
                status, text = self.limited(least, "verify", folder)
            self.assertEqual(status, 0, text)

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_a_note_on_what_is_cut_needs_no_more(self):
        """Means above the scale, which are looked for, beside the same voxels below it."""
        for value, name in ((0.9, "low"), (100, "high")):
            self.write_apart(512, value=value)
            for more in (["--to", "raw", "--type", "r8"], ["--to", "raw", "--to", "vti", "--type", "r16", "--mips"]):
                self.enough("export", "apart.vdb", *more, "--voxel", "2", "-o", name + more[-1], status=2)

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_a_cloud_needs_what_is_asked_for(self):
        """Of two of a size, both of which are held while the larger one gets its edge."""
        import pyopenvdb
        values = numpy.zeros((1000, 840, 5), "f4")
        values[..., :2], values[..., 2], values[..., 3:] = 0.9, 0.1, 0.95
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(values)
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "two.vdb"), [grid])
        self.enough("export", "two.vdb", "--to", "flightgear", "-o", "two", status=2)
        self.enough("verify", "two", status=3)

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_a_range_of_many_frames_needs_little_more(self):
        """They are looked at for their largest value, and no more of them kept for the export than a short memory has room for."""
        import pyopenvdb
        values = numpy.random.default_rng(1).integers(1, 4, (64, 64, 64)).astype("f4") / 8
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(values)
        grid.getAccessor().setValueOn((199, 199, 199), 0.5)
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "c_0001.vdb"), [grid])
        files = ["c_0001.vdb"]
        for number in range(2, 121):
            files.append(f"c_{number:04}.vdb")
            os.link(self.folder / files[0], self.folder / files[-1])
        export = ("export", *files, "--to", "raw", "--type", "r8")
        least = self.enough(*export, "-o", "one", status=2)
        status, text = self.limited(least + 2 * self.SLACK, *export, "--range", "auto", "-o", "auto")
        self.assertEqual(status, 0, text)

    def test_small_values(self):
        """What is lost of them is told, and floats of 16 bits are compared as exactly as they hold them."""
        import pyopenvdb
        values = (numpy.random.default_rng(2).random((20, 20, 20)) * 4e-4).astype("f4")
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(values)
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "thin.vdb"), [grid])
        for arguments, is_told in ((["--to", "raw", "--type", "r8"], True), (["--to", "dds"], True), (["--to", "flightgear"], True),
                                   (["--to", "raw", "--type", "r16"], False), (["--to", "raw", "--type", "r8", "--range", "auto"], False)):
            shutil.rmtree(self.folder / "thin", ignore_errors=True)
            said = self.call("export", "thin.vdb", *arguments, "-o", "thin").stderr
            self.assertEqual("nothing of it is left" in said, is_told, said)
            self.call("verify", "thin")
        for arguments in (["--to", "raw", "--type", "r16f"], ["--to", "vdb", "--type", "r16f"], ["--to", "nvdb", "--quantise", "fp16"]):
            shutil.rmtree(self.folder / "thin")
            self.assertNotIn("nothing", self.call("export", "thin.vdb", *arguments, "-o", "thin").stderr)
            self.call("verify", "thin")
        # The formats in which nothing is left are named, also where only means are below a step.
        thin = values / values.max()
        alone = numpy.zeros_like(values)
        alone[4, 4, 4] = 1
        for shape, largest, arguments, lost in ((thin, 1e-3, ["--to", "raw", "--type", "r16", "--to", "flightgear"], "flightgear"),
                                                (thin, 2**-25, ["--to", "raw", "--type", "r16f", "--to", "vdb"], "raw, vdb"),
                                                (thin, 4e-8, ["--to", "raw", "--type", "r16f", "--to", "vdb"], None),
                                                (alone, 0.01, ["--to", "raw", "--type", "r8"], None),
                                                (alone, 0.01, ["--to", "raw", "--type", "r8", "--to", "nvdb", "--size", "5"], "raw"),
                                                (alone, 3e-7, ["--to", "vdb", "--type", "r16f", "--voxel", "4"], "vdb")):
            grid.copyFromArray((shape * numpy.float32(largest)).astype("f4"))
            pyopenvdb.write(str(self.folder / "thinner.vdb"), [grid])
            shutil.rmtree(self.folder / "thin")
            said = self.call("export", "thinner.vdb", *arguments, "-o", "thin").stderr
            found = re.search("nothing of it is left in ([a-z, ]+): its", said)
            self.assertEqual(found and found[1], lost, said)
            self.assertEqual(self.call("export", "thinner.vdb", *arguments, "-o", "thin").stderr, said)  # of what is kept, too
            self.call("verify", "thin")
        # Codes of NanoVDB end where floats do.
        grid.copyFromArray(values * numpy.float32(1e-33))
        pyopenvdb.write(str(self.folder / "thinner.vdb"), [grid])
        self.refused(2, "export", "thinner.vdb", "--to", "nvdb", "--quantise", "fp8", "-o", "codes", says="takes grids from 3.8")
        self.assertEqual([path.name for path in (self.folder / "codes").iterdir() if path.is_file()], ["export.json"])
        self.refused(2, "export", "thinner.vdb", "--to", "raw", "--to", "nvdb", "--quantise", "fp8", "-o", "codes", says="takes grids from 3.8")
        grid.copyFromArray((alone * numpy.float32(5e-34)).astype("f4"))
        pyopenvdb.write(str(self.folder / "mean.vdb"), [grid])
        self.call("export", "mean.vdb", "--to", "nvdb", "--quantise", "fp8", "-o", "fine")
        self.refused(2, "export", "mean.vdb", "--to", "nvdb", "--quantise", "fp8", "--voxel", "4", "-o", "coarse", says="takes grids from 3.8")
        self.call("export", "thinner.vdb", "--to", "nvdb", "-o", "codes")  # as it says, into the folder that was not used
        self.call("verify", "codes")
        shutil.rmtree(self.folder / "thin")
        self.call("export", "thin.vdb", "--to", "raw", "--type", "r16f", "-o", "thin")
        file, = (self.folder / "thin").glob("*.raw")
        file.write_bytes(bytes(len(file.read_bytes())))
        self.relisted(self.folder / "thin", file.name)
        self.assertRegex(self.call("verify", "thin", status=1).stdout, "FAIL +raw")

    def test_verify_notices_a_cloud_beside_a_denser_one(self):
        """A voxel may differ by its own error alone, not by that of the greatest, which coarser voxels do not even have."""
        import pyopenvdb

        def write(name, greatest, haze):
            values = numpy.zeros((24, 24, 24), "f4")
            values[12:20, 12:20, 12:20] = haze * numpy.random.default_rng(5).random((8, 8, 8))
            values[0, 0, 0] = values[-1, -1, -1] = greatest
            grid = pyopenvdb.FloatGrid()
            grid.copyFromArray(values)
            grid.name = "density"
            pyopenvdb.write(str(self.folder / name), [grid])
        for greatest, haze, arguments in ((1e4, 4, ["--to", "raw", "--type", "r16f"]), (1e4, 4, ["--to", "vdb", "--type", "r16f"]),
                                          (1e9, 250, ["--to", "vdb"]), (1e9, 250, ["--to", "nvdb"]), (1e9, 250, ["--to", "raw", "--mips"]),
                                          (1e9, 250, ["--to", "vti"]), (1, 4e-4, ["--to", "bricks", "--type", "r16f"]),
                                          (1, 0.05, ["--to", "raw", "--type", "bc4"]), (1, 0.0015, ["--to", "nvdb", "--quantise", "fp8"]),
                                          (1, 0.001, ["--to", "raw", "--type", "r16f", "--voxel", "8"]),
                                          (1, 0.001, ["--to", "nvdb", "--quantise", "fp8", "--voxel", "8"])):
            with self.subTest(arguments=arguments):
                for folder in ("whole", "robbed"):
                    write("two.vdb", greatest, haze if folder == "whole" else 0)
                    shutil.rmtree(self.folder / folder, ignore_errors=True)
                    self.call("export", "two.vdb", *arguments, "-o", folder)
                write("two.vdb", greatest, haze)
                self.call("verify", "whole")
                file, = (path for path in (self.folder / "whole").iterdir() if path.name.startswith("two_"))
                shutil.copy(self.folder / "robbed" / file.name, file)
                self.relisted(self.folder / "whole", file.name)
                said = self.call("verify", "whole", status=1).stdout
                self.assertIn("a voxel differs by", re.search("FAIL.*", said)[0])

    def test_verify_takes_what_the_formats_make_of_it(self):
        """Also where a cloud ends in the least that floats hold, and their codes, or values of its scale, cannot be told apart."""
        import pyopenvdb
        x = numpy.arange(96) - 48
        for largest, formats in ((1, (["--to", "nvdb", "--quantise", "fp8"], ["--to", "nvdb", "--quantise", "fp16"], ["--to", "dds"])),
                                 (1e9, (["--to", "raw", "--type", "r32f", "--range", "auto", "--mips"], ["--to", "vti", "--range", "auto"],
                                        ["--to", "raw", "--type", "r16f", "--range", "auto"], ["--to", "vdb", "--to", "nvdb", "--voxel", "3"]))):
            values = largest * numpy.exp(-(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2) / 5.2**2)
            grid = pyopenvdb.FloatGrid()
            grid.copyFromArray(values.astype("f4"))
            grid.name = "density"
            pyopenvdb.write(str(self.folder / "gauss.vdb"), [grid])
            for arguments in formats:
                self.call("export", "gauss.vdb", *arguments, "-o", "gauss")
                self.call("verify", "gauss")
                shutil.rmtree(self.folder / "gauss")

    def test_values_above_one_are_verified(self):
        """In 16 bits, whose steps are hardly larger than what is rounded on the way to a code and back."""
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray((numpy.random.default_rng(1).random((20, 20, 20)) * 100).astype("f4"))
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "hundred.vdb"), [grid])
        self.call("export", "hundred.vdb", "--to", "raw", "--to", "vti", "--type", "r16", "--range", "auto", "-o", "hundred")
        self.call("verify", "hundred")
        values = (numpy.random.default_rng(1).random((64, 64, 64)) * 173).astype("f4")
        values[::8, ::8, ::8], values[1::8, ::8, ::8] = 0, 173  # in every leaf
        grid.copyFromArray(values)
        pyopenvdb.write(str(self.folder / "leaves.vdb"), [grid])
        self.call("export", "leaves.vdb", "--to", "nvdb", "--quantise", "fp16", "-o", "leaves")
        self.call("verify", "leaves")

    def test_sidecar_keeps_its_schema_and_the_example_reads_it(self):
        import jsonschema
        schema = json.loads((SOURCE / "docs/volume.schema.json").read_text())
        cases = (["--to", "raw", "--type", "r16", "--range", "auto", "--mips", "--border", "wrap"], ["--for", "unity"],
                 ["--for", "vulkan"], ["--for", "blender"], ["--to", "raw", "--to", "nvdb", "--voxel", "100"])
        for n, arguments in enumerate(cases):
            folder = self.export(f"case{n}", *arguments)
            sidecar = json.loads((folder / "placed.volume.json").read_text())
            jsonschema.validate(sidecar, schema)
            self.assertEqual(sidecar["georeference"]["latitude_deg"], 51.4775)
            self.assertAlmostEqual(sidecar["frames"][2]["sum"], float(self.density.sum(dtype="f8")), 2)
            self.assertEqual(sidecar["frames"][2]["utc"], "2024-06-21T13:50:30Z")
        example = SOURCE / "docs/examples/read_volume.py"
        said = self.tool(sys.executable, example, self.folder / "case0/placed.volume.json", 3)
        self.assertIn(f"densest {self.density.max():.4f}", said)
        self.assertIn(f"sum {self.density.sum():.0f}"[:6], said)

    def test_usd_names_every_frame(self):
        scene = self.write("layered.toml", LAYERED)
        self.call("run", scene, "--no-render", "--out", "layers")
        self.call("export", "layers", "--for", "omniverse", "--layer", "each", "-o", "usd")
        text = (self.folder / "usd/layered.usda").read_text()
        self.assertTrue(text.startswith("#usda 1.0\n"))
        self.assertEqual(text.count("{"), text.count("}"))
        for layer in ("low", "high"):
            self.assertIn(f'def Volume "{layer}"', text)
            for number in (1, 2, 3):
                self.assertIn(f"{number}: @./layered_{layer}_{number:04}.vdb@", text)
                self.assertTrue((self.folder / f"usd/layered_{layer}_{number:04}.vdb").is_file())

    def test_plain_vdb_files_are_copied(self):
        """Of a run, where nothing is to be changed: the same bytes. What is not as the run wrote it is encoded anew."""
        import pyopenvdb
        def exported(run, *arguments):
            folder = self.export_of(run, *arguments)
            return [(folder / f"tiny_000{n}.vdb").read_bytes() == (self.folder / run / f"density/tiny_000{n}.vdb").read_bytes()
                    for n in (1, 2, 3)]
        settings = {"plain": ["density.write_state=false"], "state": [], "half": ["density.write_state=false", "density.half=true"]}
        for name, values in settings.items():
            self.call("run", self.scene, "--no-render", "--out", name, *(word for value in values for word in ("--set", value)))
            self.assertEqual(exported(name, "--to", "usd"), [name == "plain"] * 3)
            self.assertEqual([grid.name for grid in pyopenvdb.readAll(str(self.folder / "exported/tiny_0002.vdb"))[0]], ["density"])
        self.assertEqual(exported("plain", "--to", "vdb", "--type", "r16f"), [False] * 3)
        self.assertEqual(exported("plain", "--to", "vdb", "--voxel", "200"), [False] * 3)
        before = dense(self.folder / "plain/density/tiny_0003.vdb")[0]
        shutil.copy(self.folder / "plain/density/tiny_0003.vdb", self.folder / "plain/density/tiny_0002.vdb")
        self.assertEqual(exported("plain", "--to", "vdb"), [True, False, True])
        self.assertTrue((dense(self.folder / "exported/tiny_0002.vdb")[0] == before).all())

    def export_of(self, run, *arguments):
        shutil.rmtree(self.folder / "exported", ignore_errors=True)
        self.call("export", run, "-o", "exported", *arguments)
        self.call("verify", "exported")
        return self.folder / "exported"

    def test_an_interrupted_export_goes_on(self):
        folder = self.export("out", "--to", "raw")
        listing = json.loads((folder / "export.json").read_text())
        listing["complete"] = False
        (folder / "export.json").write_text(unsealed(listing))
        (folder / "placed_0002.raw").write_bytes(b"damaged")
        (folder / "placed_0004.raw").unlink()
        before = (folder / "placed_0001.raw").stat().st_mtime_ns
        report = json.loads(self.call("export", "run", "--to", "raw", "-o", "out", "--json").stdout)
        self.assertEqual(report["kept"], len(listing["files"]) - 4)
        self.assertEqual((folder / "placed_0001.raw").stat().st_mtime_ns, before)
        self.call("verify", "out")
        self.refused(2, "export", "run", "--to", "raw", "--type", "r8", "-o", "out", says="other options")
        self.refused(2, "export", "run", "--to", "raw", "-o", "run", says="not empty")
        self.refused(3, "export", "nowhere", "--to", "raw", "--layer", "low", "-o", "out", says="nowhere: ")

    def test_a_second_export_leaves_what_was_asked_for_last(self):
        """Frames that it does not make are of the first, and in no list: they go, but for what somebody changed."""
        folder = self.export("out", "--to", "raw", "--to", "layers")
        (folder / "placed_0004.raw").write_bytes(b"mine")
        said = self.call("export", "run", "--to", "raw", "--frames", "1", "-o", "out").stderr
        self.assertIn("out: 4 files of an earlier export, which this one does not make, were removed", said)
        self.assertIn("placed_0004.raw: is of an earlier export and was changed since: it stays", said)
        self.assertEqual({path.name for path in folder.iterdir()},
                         {"README.txt", "export.json", "placed.volume.json", "placed_0001.raw", "placed_0004.raw"})
        self.assertIn("listed nowhere", self.call("verify", "out", status=1).stdout)
        (folder / "placed_0004.raw").unlink()
        self.call("verify", "out")

    def test_files_that_no_export_has_written_stay(self):
        """Under the name of a further frame; one that was changed is made again, and that is said."""
        folder = self.export("out", "--to", "raw", "--frames", "1..2")
        (folder / "placed_0003.raw").write_bytes(b"mine")
        (folder / "placed_0002.raw").write_bytes(b"edited")
        self.refused(2, "export", "run", "--to", "raw", "-o", "out", says="placed_0003.raw: is there already, and no export of this has listed it")
        self.assertEqual([(folder / f"placed_000{n}.raw").read_bytes() for n in (2, 3)], [b"edited", b"mine"])
        (folder / "placed_0003.raw").unlink()
        said = self.call("export", "run", "--to", "raw", "-o", "out").stderr
        self.assertIn("placed_0002.raw: is not as an earlier export had listed it, and is made again", said)
        self.call("verify", "out")

    def test_sequences_are_numbered_from_0(self):
        """As most programs number them."""
        for number in range(3):
            shutil.copy(self.folder / f"run/density/placed_000{number + 1}.vdb", self.folder / f"smoke_000{number}.vdb")
        files = [f"smoke_000{number}.vdb" for number in range(3)]
        def names(*arguments):
            self.call("export", *files, "--to", "raw", "-o", "from0", *arguments)
            self.call("verify", "from0")
            return sorted(path.name for path in (self.folder / "from0").glob("*.raw"))
        self.assertEqual(names(), ["smoke_0000.raw", "smoke_0001.raw", "smoke_0002.raw"])
        sidecar = json.loads((self.folder / "from0/smoke.volume.json").read_text())
        self.assertEqual((sidecar["first"], [frame["number"] for frame in sidecar["frames"]]), (0, [0, 1, 2]))
        self.assertEqual(names("--frames", "..2/2"), ["smoke_0000.raw", "smoke_0002.raw"])
        self.assertEqual(names("--frames", "1.."), ["smoke_0001.raw", "smoke_0002.raw"])
        self.assertEqual(names("--frames", "0"), ["smoke_0000.raw"])
        folder = self.export("run2", "--to", "raw", "--frames", "..5/2")
        self.assertEqual(sorted(path.name for path in folder.glob("*.raw")), [f"placed_000{n}.raw" for n in (1, 3, 5)])

    def test_verify_says_what_it_did_not_look_at(self):
        for codes, most in (("fp8", 0.5 / 255), ("fp16", 0.5 / 65535)):
            folder = self.export(codes, "--to", "nvdb", "--quantise", codes)
            checks = {check["name"]: check for check in json.loads(self.call("verify", folder, "--json").stdout)["checks"]}
            self.assertIn("5 files read back", checks["nvdb"]["detail"])
            self.assertLess(0, checks["nvdb"]["figures"]["largest"])
            self.assertLessEqual(checks["nvdb"]["figures"]["largest"], most * 1.01 + 1e-6)
        # Another frame under its name, with the checksum made right.
        shutil.copy(folder / "placed_0005.nvdb", folder / "placed_0002.nvdb")
        self.relisted(folder, "placed_0002.nvdb")
        self.assertIn("FAIL  nvdb", self.call("verify", folder, status=1).stdout)
        # No sidecar of volumes.
        folder = self.export("alone", "--to", "raw")
        listing = json.loads((folder / "export.json").read_text())
        listing["files"] = [file for file in listing["files"] if not file["path"].endswith(".volume.json")]
        (folder / "export.json").write_text(unsealed(listing))
        (folder / "placed.volume.json").unlink()
        self.assertIn("lists volumes, but no placed.volume.json", self.call("verify", folder, status=1).stdout)
        # No source.
        folder = self.export("orphan", "--to", "raw")
        shutil.rmtree(self.folder / "run")
        said = self.call("verify", folder).stdout
        self.assertIn("5 of 5 files were not compared: their sources are not there any more; only checksums and sidecars", said)
        self.assertIn("not all of box, axes, levels, place, times and figures was compared", said)

    def test_names_that_mean_something_in_texts(self):
        """What a file is called stands in XML, in USD and in a printf pattern."""
        import xml.dom.minidom
        source = self.folder / "run/density/placed_0001.vdb"
        for name in ('R&D <"1">', "100%d", "a@b", "a@@@b", "\u96f2"):
            file = self.folder / f"{name}_0001.vdb"
            shutil.copy(source, file)
            self.call("export", file, "-o", "named", "--to", "vti", "--to", "usd", "--to", "raw")
            self.call("verify", "named")
            folder = self.folder / "named"
            collection = xml.dom.minidom.parse(str(folder / f"{name}.pvd"))
            self.assertEqual(collection.getElementsByTagName("DataSet")[0].getAttribute("file"), f"{name}_0001.vti")
            sidecar = json.loads((folder / f"{name}.volume.json").read_text())
            self.assertTrue((folder / (next(f["files"] for f in sidecar["formats"] if f["format"] == "raw") % 1)).is_file())
            (asset,) = (line.split(": ", 1)[1].rstrip(",") for line in next(folder.glob("*.usda")).read_text().splitlines() if "_0001.vdb" in line)
            mark = "@@@" if "@" in name else "@"
            self.assertTrue(asset.startswith(f"{mark}./") and asset.endswith(f".vdb{mark}"), asset)
            self.assertEqual(asset[len(mark):-len(mark)].replace("\\@@@", "@@@"), f"./{name}_0001.vdb")
            shutil.rmtree(folder)
        bad = os.fsencode(self.folder) + b"/a\xff_0001.vdb"
        shutil.copy(source, bad)
        for file in (bad, self.folder / "a\nb_0001.vdb", self.folder / "a\uffff_0001.vdb"):
            shutil.copy(source, file)
            said = subprocess.run([NEPHOS, "export", file, "-o", "bad", "--to", "raw"], cwd=self.folder, capture_output=True)
            self.assertEqual(said.returncode, 2, said.stderr)
            self.assertIn(b"expected UTF-8 without control characters", said.stderr)
        shutil.copy(source, self.folder / "c_2147483647.vdb")
        self.call("export", "c_2147483647.vdb", "-o", "date", "--to", "raw")  # no number of a frame
        self.assertTrue((self.folder / "date/c_2147483647_0001.raw").is_file())

    def test_a_changed_source_is_exported_anew(self):
        """Files of an export know their source: what another run of the same scene left is not taken over."""
        folder = self.export("out", "--to", "raw")
        first = (folder / "placed_0002.raw").read_bytes()
        shutil.copy(self.folder / "run/density/placed_0005.vdb", self.folder / "run/density/placed_0002.vdb")
        checks = json.loads(self.call("verify", "out", "--json", status=1).stdout)["checks"]
        self.assertIn("have changed since", next(c["detail"] for c in checks if c["name"] == "sources"))
        report = json.loads(self.call("export", "run", "--to", "raw", "-o", "out", "--json").stdout)
        self.assertEqual((report["kept"], report["written"]), (4, 3))
        self.assertNotEqual((folder / "placed_0002.raw").read_bytes(), first)
        self.assertEqual((folder / "placed_0002.raw").read_bytes(), (folder / "placed_0005.raw").read_bytes())
        self.call("verify", "out")

    def test_flightgear_gets_the_largest_cloud(self):
        """The picture's voxels are those of the cloud that SciPy finds: slices from the left, north at the top."""
        from PIL import Image
        from scipy import ndimage
        folder = self.export("out", "--to", "flightgear", "--range", "auto")
        sidecar = json.loads((folder / "placed.volume.json").read_text())
        self.assertEqual(sidecar["period_m"], [None] * 3)
        codes = numpy.rint(self.density / sidecar["scale"] * 255 + 1e-6).astype("u1")
        names, _ = ndimage.label(self.density >= numpy.float32(0.3) * numpy.float32(self.density.max()))
        masses = ndimage.sum_labels(self.density, names, range(1, names.max() + 1))
        whole = ndimage.binary_dilation(names == 1 + masses.argmax(), iterations=3, mask=codes > 0)
        cloud = numpy.where(whole, codes, 0)
        z, y, x = (slice(axis.min(), axis.max() + 1) for axis in cloud.nonzero())
        picture = numpy.array(Image.open(folder / "placed_0003.voxels.png"))
        side = picture.shape[0]
        self.assertEqual((side, picture.shape), (32, (32, 32 * (z.stop - z.start), 4)))
        found = picture.reshape(side, -1, side, 4).transpose(1, 0, 2, 3)[:, ::-1]  # up, north, east
        first = [(side - (axis.stop - axis.start)) // 2 for axis in (y, x)]
        expected = numpy.zeros(found.shape[:3], "u1")
        expected[:, first[0]:first[0] + y.stop - y.start, first[1]:first[1] + x.stop - x.start] = cloud[z, y, x]
        self.assertGreater(cloud.max(), 100)
        self.assertLessEqual(abs(found[..., 2].astype(int) - expected).max(), 1)
        self.assertEqual(set(numpy.unique(found[..., 1][found[..., 2] > 0])), {204})  # cumulus
        self.assertEqual(found[..., 0].max(), 0)
        for name, says in (("placed_0003.voxels.png", "no picture of a cloud"), ("placed_0004.voxels.png", "cannot be read as PNG: it ends early")):
            path = folder / name
            if "early" in says:
                path.write_bytes(path.read_bytes()[:100])
            else:
                Image.new("RGBA", (40, 40)).save(path)
            self.relisted(folder, name)
            self.assertIn(says, self.call("verify", "out", status=1).stdout)
            self.export_again()

    def test_flightgear_gets_a_cloud_of_any_height(self):
        """A texture has 2,048 layers at least, and libpng takes a million columns: a taller cloud is of coarser voxels."""
        import pyopenvdb
        from PIL import Image
        Image.MAX_IMAGE_PIXELS = None
        for tall, layers in ((2048, 2048), (2049, 1025), (10000, 2000)):
            grid = pyopenvdb.FloatGrid()
            grid.fill((0, 0, 0), (9, 9, tall - 1), 1.0)
            grid.name = "density"
            pyopenvdb.write(str(self.folder / "tall.vdb"), [grid])
            self.call("export", "tall.vdb", "--to", "flightgear", "-o", f"tall{tall}")
            with Image.open(next((self.folder / f"tall{tall}").glob("*.png"))) as picture:
                self.assertEqual(picture.size, (32 * layers, 32))
                blue = numpy.array(picture)[..., 2].astype(float)
            factor = -(-tall // layers)
            self.assertAlmostEqual(blue.sum() * factor**3, 255 * 100 * tall, delta=2.55 * 100 * tall)  # its mass
            self.call("verify", f"tall{tall}")

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_a_lack_of_memory_is_no_damage(self):
        """Of readers and writers that tell it in words of their own."""
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(numpy.random.default_rng(3).random((160, 160, 160)).astype("f4"))
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "full.vdb"), [grid])
        self.call("export", "full.vdb", "--to", "nvdb", "--zip", "-o", "full")
        told = set()
        for mebibytes in range(120, 420, 15):
            status, text = self.limited(mebibytes, "verify", "full")
            self.assertNotEqual(status, 1, text)
            self.assertNotIn("damaged", text)
            told.add(status)
            shutil.rmtree(self.folder / "again", ignore_errors=True)
            status, text = self.limited(mebibytes, "export", "full.vdb", "--to", "nvdb", "-o", "again")
            self.assertNotIn("Failed to", text)
            self.assertIn(status, (0, 2, 3), text)
            told.add(status)
        self.assertLessEqual({0, 3}, told)

    def told(self, limits, *command, out):
        """What an export comes to under limits of addresses, in MiB: the text of each status."""
        found = {}
        for mebibytes in limits:
            shutil.rmtree(self.folder / out, ignore_errors=True)
            status, text = self.limited(mebibytes, "export", *command, "-o", out)
            found.setdefault(status, []).append(text)
        return found

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_memory_of_each_frame_is_asked_for(self):
        """Of a sequence that begins with an empty one, as NanoVDB."""
        import pyopenvdb
        for number, side in ((1, 1), (2, 192)):
            grid = pyopenvdb.FloatGrid()
            grid.copyFromArray(numpy.random.default_rng(1).random((side, side, side), dtype="f4"))
            grid.getAccessor().setValueOn((191, 191, 191), 0.5)
            grid.name = "density"
            pyopenvdb.write(str(self.folder / f"grows_{number}.vdb"), [grid])
        least = self.enough("export", "grows_1.vdb", "--to", "nvdb", "-o", "one", status=2)
        found = self.told(range(least, least + 160, 8), "grows_1.vdb", "grows_2.vdb", "--to", "nvdb", out="grown")
        self.assertIn(0, found)
        self.assertTrue(any("grows_2.vdb: as NanoVDB takes about" in text for text in found.get(2, [])), found)
        self.assertFalse([text for text in found.get(3, []) if "out of memory while" in text])

    @unittest.skipIf(SANITIZED, "a sanitizer takes most of the addresses")
    def test_memory_of_a_uniform_wind_in_larger_voxels_is_asked_for(self):
        """None of its blocks is inside of the box: OpenVDB's lack of memory would end the program."""
        scene = "[lattice]\ncells = [2056, 2056, 8]\ninitial = \"empty\"\n[time]\nsteps = 1\n[field.background]\nhum = 0.001\nact = 0\next = 0\n" \
                "[[wind]]\nlevels = [{ height_m = 0, from_deg = 240, speed_m_per_s = 7 }]\n"
        self.call("run", self.write("windy.toml", scene), "--no-render", "--out", "windy")
        found = self.told(range(150, 300, 20), "windy", "--to", "vdb", "--velocity", "v", out="blown")
        self.assertLessEqual({0, 2}, set(found))
        self.assertLessEqual(set(found), {0, 2, 3})

    def test_plans_are_of_coarser_voxels(self):
        planned = lambda *arguments: json.loads(self.call("export", "run", *arguments, "--plan", "--json").stdout)["sequences"][0]["estimated_bytes_a_frame"]
        for name, of_nothing in (("vdb", 0), ("flightgear", 500)):
            self.assertAlmostEqual((planned("--to", name, "--size", "8") - of_nothing) * 64 / (planned("--to", name) - of_nothing), 1, delta=0.05)
        # Of 12 x 24 x 32 voxels most are nodes, which have their size whatever a value has.
        self.assertLess(planned("--to", "nvdb", "--quantise", "fp8"), planned("--to", "nvdb", "--quantise", "fp16"))
        self.assertLess(planned("--to", "nvdb", "--quantise", "fp16"), planned("--to", "nvdb"))

    def test_a_plan_of_weather_alone_has_no_volumes(self):
        said = self.call("export", "run", "--to", "metar", "--plan").stdout
        self.assertRegex(said, r"^summaries of weather alone, .*; nothing was written\n$")
        self.assertIn(" in all (estimated); nothing", self.call("export", "run", "--to", "metar", "--to", "vdb", "--plan").stdout)

    def test_advice_of_a_preset_can_be_followed(self):
        self.write_apart(4094, 0.4115226)
        error = self.refused(2, "export", "apart.vdb", "--for", "vulkan", "--border", "zero", "-o", "bad", says="give --voxel").stderr
        voxel = re.search("give --voxel ([0-9.]+) or", error)[1]
        side = max(json.loads(self.call("export", "apart.vdb", "--for", "vulkan", "--border", "zero", "--voxel", voxel, "--plan",
                                        "--json").stdout)["sequences"][0]["size"])
        self.assertLessEqual(side, 2048)

    def test_size_counts_border_and_padding(self):
        plan = lambda *arguments: json.loads(self.call("export", "run", "--to", "raw", *arguments, "--plan", "--json").stdout)["sequences"][0]
        for size, arguments, expected in ((32, [], 32), (32, ["--border", "zero"], 18), (34, ["--border", "zero"], 34), (16, ["--pad", "16"], 16),
                                          (17, ["--pad", "16"], 16), (20, ["--pad", "pow2"], 16), (10, ["--to", "dds"], 8), (3, ["--border", "zero"], 3)):
            self.assertEqual(max(plan("--size", size, *arguments)["size"]), expected, (size, arguments))
        for size, arguments, least in ((2, ["--border", "zero"], 3), (15, ["--pad", "16"], 16), (3, ["--to", "dds"], 4)):
            self.refused(2, "export", "run", "--to", "raw", "--size", size, *arguments, "-o", "small", says=f"at least {least} voxels")

    def test_the_least_size_of_tiles_is_one_that_is_taken(self):
        """Whole tiles: what a refusal names counts border, padding and blocks, and voxels beyond the longest side have a cure, too."""
        scene = self.write("tiles.toml", SCENE.replace("cells = [32, 24, 12]", 'cells = [24, 36, 16]\nboundaries = ["periodic", "periodic", "open"]'))
        self.call("run", scene, "--no-render", "--out", "tiles")
        for arguments in (["--to", "dds"], ["--to", "raw", "--border", "zero"], ["--to", "raw"], ["--to", "vdb"]):
            error = self.refused(2, "export", "tiles", *arguments, "--size", "1", "-o", "tiled", says="voxels").stderr
            least = re.search("at least ([0-9]+) voxels", error)[1]
            self.call("export", "tiles", *arguments, "--size", least, "--plan")
            self.refused(2, "export", "tiles", *arguments, "--size", int(least) - 1, "--plan", says=f"at least {least} voxels")
        edge = json.loads(self.call("export", "tiles", "--to", "raw", "--plan", "--json").stdout)["sequences"][0]["voxel_size_m"][0]
        for factor in (36, 37, 10_000, 12.5, 2 ** 21):
            self.refused(2, "export", "tiles", "--to", "raw", "--voxel", factor * edge, "--plan", says=f" {12 * edge:g}\n")

    def test_a_refused_export_has_made_nothing(self):
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.fill((0, 0, 0), (7, 7, 7), 1e-30)
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "small.vdb"), [grid])
        self.refused(2, "export", "small.vdb", "--to", "nvdb", "--quantise", "fp16", "-o", "refused", says="expected --quantise none")
        self.assertIn("the export has made nothing yet: it was refused or interrupted", self.call("verify", "refused", status=1).stdout)

    def export_again(self):
        shutil.rmtree(self.folder / "out")
        self.export("out", "--to", "flightgear", "--range", "auto")

    def test_small_and_empty_runs(self):
        """One cell, and no cloud at all, in every format: also where a packed file is smaller than a kilobyte."""
        one = self.write("one.toml", SCENE.replace("cells = [32, 24, 12]", "cells = [1, 1, 1]").replace("write_state = true", "half = false"))
        empty = self.write("empty.toml", SCENE.split("[field")[0].replace("cells = [32, 24, 12]", 'cells = [9, 5, 3]\ninitial = "empty"')
                           + "[frames]\nper_second = 1\ntime_scale = 15\n")
        every = [word for name in ("raw", "bricks", "vti", "dds", "ktx2", "nvdb", "usd", "slices", "vdb", "flightgear", "layers", "cigi",
                                   "wpr", "xplane", "metar") for word in ("--to", name)]
        for name, scene in (("one", one), ("empty", empty)):
            self.call("run", scene, "--no-render", "--out", name)
            self.call("verify", name)
            for number, arguments in enumerate((every, [*every, "--mips", "--border", "wrap", "--range", "auto", "--zip"],
                                                ["--to", "nvdb", "--zip", "--quantise", "fp8"], ["--to", "nvdb", "--zip", "--quantise", "fp16"])):
                with self.subTest(run=name, arguments=arguments):
                    folder = f"{name}{number}"
                    self.call("export", name, *arguments, "-o", folder)
                    self.call("verify", folder)
                    for file in (self.folder / folder).glob("*.nvdb"):
                        self.tool("nanovdb_validate", file)

    def test_what_was_whole_before_a_failure_is_kept(self):
        """A damaged frame ends the export; those before it are in the list, and are not made again."""
        whole = (self.folder / "run/density/placed_0004.vdb").read_bytes()
        (self.folder / "run/density/placed_0004.vdb").write_bytes(whole[:1000])
        self.refused(3, "export", "run", "--to", "raw", "-o", "out", says="placed_0004.vdb: it is truncated")
        checks = {check["name"]: check for check in json.loads(self.call("verify", "out", "--json", status=1).stdout)["checks"]}
        self.assertEqual([name for name, check in checks.items() if not check["passed"]], ["complete"])
        self.assertEqual(sorted(path.name for path in (self.folder / "out").glob("*.raw")), [f"placed_000{n}.raw" for n in (1, 2, 3)])
        (self.folder / "run/density/placed_0004.vdb").write_bytes(whole)
        report = json.loads(self.call("export", "run", "--to", "raw", "-o", "out", "--json").stdout)
        self.assertEqual(report["kept"], 3)
        self.call("verify", "out")

    def test_a_file_that_the_manifest_does_not_list_is_named(self):
        """Bits of voxels that were flipped, in a file that can be read: each export says that it is not the run's."""
        path = self.folder / "run/density/placed_0003.vdb"
        whole = path.read_bytes()
        path.write_bytes((self.folder / "run/density/placed_0002.vdb").read_bytes())
        for number, arguments in enumerate((["--to", "raw"], ["--to", "vdb"], ["--for", "blender"])):
            said = self.call("export", "run", *arguments, "-o", f"noted-{number}").stderr
            self.assertEqual(said.count("is damaged or was changed"), 1, said)
            self.assertIn("placed_0003.vdb: is damaged or was changed", said)
        path.write_bytes(whole)

    def test_weather_of_a_file_that_the_manifest_does_not_list(self):
        """The clouds of a layer are those of another frame, as in the midst of a copy: named once, also beside volumes of the same file."""
        self.call("run", self.write("layered.toml", LAYERED.replace("steps = 2", "steps = 4")), "--no-render", "--out", "run", "--overwrite")
        files = sorted((self.folder / "run/density/low").iterdir())
        files[1].write_bytes(files[2].read_bytes())
        wrong = f"{files[1].relative_to(self.folder)}: is damaged or was changed"
        for formats in (["--to", "layers", "--to", "metar"], ["--to", "metar", "--to", "raw", "--layer", "low"]):
            said = self.call("export", "run", *formats, "-o", "out").stderr
            self.assertEqual(said.count(wrong), 1, said)
            said = self.call("export", "run", *formats, "--frames", "3..4", "-o", "other").stderr
            self.assertNotIn("is damaged", said)
            for name in ("out", "other"):
                self.call("verify", name)
                shutil.rmtree(self.folder / name)

    def test_weather_needs_the_files_of_layers_alone(self):
        """Not that of all together; without files of layers it is refused before anything is written."""
        scene = self.write("layered.toml", LAYERED.replace("[density]\n", "[density]\ncombined = false\n"))
        self.call("run", scene, "--no-render", "--out", "run", "--overwrite")
        formats = ["--to", "layers", "--to", "wpr", "--to", "cigi"]
        apart = self.export("apart", *formats)
        self.call("run", self.write("layered.toml", LAYERED), "--no-render", "--out", "run", "--overwrite")
        both = self.export("both", *formats)
        self.assertEqual(*(json.loads((folder / "layered.layers.json").read_text())["frames"] for folder in (apart, both)))
        names = {path.name for path in both.iterdir()} - {"README.txt", "export.json", "layered.layers.json"}
        self.assertGreater(len(names), 1)
        for name in names:
            self.assertEqual((apart / name).read_bytes(), (both / name).read_bytes(), name)
        for path in (self.folder / "run/density").glob("*.vdb"):
            path.unlink()
        self.assertEqual((self.export("gone", *formats) / "layered.layers.json").read_bytes(), (both / "layered.layers.json").read_bytes())
        self.call("run", self.write("layered.toml", LAYERED.replace("[density]\n", "[density]\nper_layer = false\n")), "--no-render", "--out", "run", "--overwrite")
        self.refused(2, "export", "run", *formats, "-o", "none", says="layer 'low' has no density files")
        self.assertFalse((self.folder / "none").exists())

    def test_one_export_at_a_time(self):
        import fcntl
        folder = self.export("out", "--to", "raw")
        (folder / ".placed_0001.part1-2.raw").write_bytes(b"of the other one")
        held = os.open(folder, os.O_RDONLY)
        self.addCleanup(os.close, held)
        fcntl.flock(held, fcntl.LOCK_EX)
        self.refused(3, "export", "run", "--to", "raw", "-o", "out", says="another run or export is writing")
        self.assertTrue((folder / ".placed_0001.part1-2.raw").exists())
        fcntl.flock(held, fcntl.LOCK_UN)
        self.call("export", "run", "--to", "raw", "-o", "out")
        self.assertFalse((folder / ".placed_0001.part1-2.raw").exists())

    def test_a_folder_that_is_removed_meanwhile(self):
        """Not a success: nothing of the export is left."""
        self.call("run", self.scene, "--no-render", "--out", "long", "--set", "time.steps=600")
        process = subprocess.Popen([NEPHOS, "export", "long", "--to", "vti", "--zip", "-o", "gone"], cwd=self.folder,
                                   env=self.environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        out = self.folder / "gone"
        while process.poll() is None and not (out / "tiny_0003.vti").exists():
            time.sleep(0.001)
        out.rename(self.folder / "elsewhere")
        _, error = process.communicate(timeout=PATIENCE)
        self.assertEqual(process.returncode, 3, error)
        self.assertIn("was removed or renamed while the export was writing", error)
        self.assertFalse((out / "export.json").exists())

    def test_a_source_that_changes_meanwhile(self):
        """Its voxels may be of the old file and its checksum of the new one: it is not listed."""
        self.call("run", self.scene, "--no-render", "--out", "long", "--set", "time.steps=600")
        process = subprocess.Popen([NEPHOS, "export", "long", "--to", "vti", "--zip", "-o", "raced"], cwd=self.folder,
                                   env=self.environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
        while process.poll() is None and not (self.folder / "raced/tiny_0003.vti").exists():
            time.sleep(0.001)
        process.send_signal(signal.SIGSTOP)
        last = max((self.folder / "long/density").glob("*.vdb"))
        self.assertFalse((self.folder / "raced" / last.with_suffix(".vti").name).exists())
        shutil.copy(self.folder / "long/density/tiny_0001.vdb", last)
        process.send_signal(signal.SIGCONT)
        error = process.communicate(timeout=PATIENCE)[1]
        self.assertEqual(process.returncode, 3, error)
        self.assertIn(f"{last.name}: was changed while it was exported", error)
        listing = json.loads((self.folder / "raced/export.json").read_text())
        self.assertNotIn(last.with_suffix(".vti").name, [file["path"] for file in listing["files"]])
        self.call("export", "long", "--to", "vti", "--zip", "-o", "raced")

    def test_lists_that_were_tampered_with(self):
        """Each wrong value of export.json is named with its file, its place and what was expected; nothing crashes."""
        folder = self.export("out", "--to", "raw", "--to", "bricks", "--to", "slices")
        whole = json.loads((folder / "export.json").read_text())
        def tampered(place, value):
            listing = json.loads(json.dumps(whole))
            at = listing
            for key in place[:-1]:
                at = at[key]
            at[place[-1]] = value
            (folder / "export.json").write_text(unsealed(listing))
        layout = ["sequences", 0, "layout"]
        for place, value, says in (
                (["sequences", 0, "levels"], 0, "`sequences[0].levels` is 0: expected a whole number from 1 to 32"),
                (["sequences", 0, "levels"], 2 ** 40, "`sequences[0].levels`"), (["sequences", 0, "scale"], "one", "`sequences[0].scale` is \"one\""),
                (["sequences", 0, "scale"], 0, "`sequences[0].scale`"), ([*layout, "factor"], 2 ** 31 - 1, "`sequences[0].layout.factor`"),
                ([*layout, "factor"], -1, "`sequences[0].layout.factor`"), ([*layout, "multiple"], 2 ** 31 - 1, "`sequences[0].layout.multiple`"),
                ([*layout, "axes"], 9, "`sequences[0].layout.axes`"), ([*layout, "border"], 7, "`sequences[0].layout.border`"),
                ([*layout, "periodic"], [True], "three of true or false"), (["format_version"], "1", "`format_version` is \"1\""),
                (["format"], 1, "`format` is 1: expected a text"), (["options", "types"], 5, "`options.types` is 5: expected an object"),
                (["options", "types", "raw"], 77, "`options.types.raw`"), (["options", "grid"], 1, "`options.grid`"),
                (["files"], {}, "`files` is an object: expected a list"), (["files", 0, "bytes"], "12", "`files[0].bytes`"),
                (["files", 0, "bytes"], -1, "`files[0].bytes`"), (["files", 0, "path"], "../run/manifest.json", "`files[0].path`"),
                (["files", 0, "format"], "obj", "expected one of raw, vti")):
            with self.subTest(place=place, value=value):
                tampered(place, value)
                self.refused(3, "verify", "out", says=says)
                self.assertIn("out/export.json: ", self.call("verify", "out", status=3).stderr)
                if place[0] in ("files", "format", "format_version"):
                    self.refused(3, "export", "run", "--to", "raw", "--to", "bricks", "--to", "slices", "-o", "out", says=says)
        # What is possible and wrong fails without taking the memory that it states.
        for place, value in (([*layout, "factor"], 2 ** 20), ([*layout, "multiple"], 2 ** 24), (["sequences", 0, "levels"], 32),
                             ([*layout, "power_of_two"], True)):
            with self.subTest(place=place, value=value):
                tampered(place, value)
                limited = lambda: limit_addresses(6 << 30)
                self.assertIn("FAIL  voxels", self.call("verify", "out", status=1, preexec_fn=limited).stdout)
        (folder / "export.json").write_text("{\n\"format\": ")
        self.refused(3, "verify", "out", says="line 2 cannot be read")
        # Many keys, and keys twice, of which the last counts; a long one is shortened.
        text = unsealed(whole)
        many = "".join(f'"k{n}": [], ' for n in range(100_000))
        (folder / "export.json").write_text(f"{{{many}\"complete\": 7, {text[1:]}")
        self.call("verify", "out")
        listing = json.loads(text)
        listing["options"]["types"]["n" * 100_000] = 77
        (folder / "export.json").write_text(unsealed(listing))
        self.assertLess(len(self.refused(3, "verify", "out", says="`options.types." + "n" * 60 + "...` is 77").stderr), 400)
        listing = dict(whole)
        del listing["options"]
        (folder / "export.json").write_text(unsealed(listing))
        self.refused(3, "verify", "out", says="`options` is missing")

    def relisted(self, folder, name):
        """Makes the list agree with the bytes of a file, as somebody would who wants it to pass."""
        import xxhash
        listing = json.loads((folder / "export.json").read_text())
        content = (folder / name).read_bytes()
        for file in listing["files"]:
            if file["path"] == name:
                file.update(bytes=len(content), xxh3=xxhash.xxh3_128_hexdigest(content))
        (folder / "export.json").write_text(unsealed(listing))

    def test_what_lies_beside_the_voxels_is_compared(self):
        """Places, borders and ranges of bricks, colours of a picture: each changed in a file whose checksum is right."""
        import struct
        from PIL import Image
        folder = self.export("out", "--to", "nvdb", "--to", "vti", "--to", "bricks", "--bricks", "8", "--mips", "--to", "flightgear", "--to", "ktx2",
                             "--to", "slices", "--frames", "3..3")
        size = json.loads((folder / "placed.volume.json").read_text())["voxel_size_m"][0]

        def changed(name, change, says):
            whole = (folder / name).read_bytes()
            (folder / name).write_bytes(change(whole))
            self.relisted(folder, name)
            self.assertIn(says, self.call("verify", "out", status=1).stdout)
            (folder / name).write_bytes(whole)
            self.relisted(folder, name)

        def recoloured(channel, value):
            def change(_):
                picture = numpy.array(Image.open(folder / "placed_0003.voxels.png"))
                picture[0, 0, channel] = value
                Image.fromarray(picture).save(self.folder / "picture.png")
                return (self.folder / "picture.png").read_bytes()
            return change
        elsewhere = "lies at another place than its source"
        changed("placed_0003.nvdb", lambda file: file.replace(struct.pack("<d", size), struct.pack("<d", size * 2)), "contradict each other")
        changed("placed_0003.nvdb", lambda file: file.replace(struct.pack("<f", size), struct.pack("<f", size * 2)), "contradict each other")
        changed("placed_0003.nvdb", lambda file: file[:208] + file[208:].replace(b"density\0", b"densitx\0"), "its own checksum is of another head")
        changed("placed_0003.nvdb", lambda file: file[:208] + b"\xff" * 8 + file[216:].replace(b"density\0", b"densitx\0"), "its own checksum is of another head")
        for at in (16 + 24, 16 + 48, 16 + 120, 16 + 156):  # voxels, box, edge and nodes in the file's head
            changed("placed_0003.nvdb", lambda file, at=at: file[:at] + bytes([file[at] ^ 1]) + file[at + 1:], "its head is of another grid")
        whole = (folder / "placed_0003.nvdb").read_bytes()
        tree = 200 + 672  # behind file's head and grid's
        for at in (tree + 24, tree + 27, tree + 31, tree + 64 + 24, tree + 64 + 27):  # where the root is, and how many tiles it has
            changed("placed_0003.nvdb", lambda file, at=at: file[:at] + bytes([file[at] ^ 0x80]) + file[at + 1:], "or is damaged: ")
        first_of_level = struct.unpack_from("<4Q", whole, tree)
        lower = tree + first_of_level[1]
        children, table = numpy.unpackbits(numpy.frombuffer(whole, "u1", 512, lower + 544), bitorder="little").nonzero()[0], lower + 1088
        a, b = table + 8 * int(children[0]), table + 8 * int(children[-1])
        self.assertLess(a, b)
        empty = table + 8 * next(n for n in range(4096) if n not in children)

        def edited(*edits):
            """Bytes at places, with the checksum of the grid's head made right again, as no other check would be reached else."""
            def change(file):
                file = bytearray(file)
                for at, value in edits:
                    file[at:at + len(value)] = value
                struct.pack_into("<I", file, grid + 8, zlib.crc32(file[grid + 16:tree + first_of_level[2]]))
                return bytes(file)
            return change

        def flipped(*places):
            return edited(*((at, bytes([whole[at] ^ 1])) for at in places))
        grid, root, leaf, upper = 200, tree + 64, tree + first_of_level[0], tree + first_of_level[2]
        high = next(at for at in range(leaf, lower if lower > leaf else len(whole), 96 + 4 * 512) if struct.unpack_from("<i", whole, at + 8)[0] >> 3 == 1)
        for change, says in (
                (edited((a, whole[b:b + 8]), (b, whole[a:a + 8])), "says that it is elsewhere"),  # two leaves, each in the other's slot
                (edited((a, whole[b:b + 8])), "says that it is elsewhere"),
                (edited((leaf, struct.pack("<3i", 800, 800, 800))), "says that it is elsewhere"),
                (edited((lower, struct.pack("<i", 128))), "says that it is elsewhere"),
                (edited((upper, struct.pack("<i", 4096))), "says that it is elsewhere"),
                (edited((a, struct.pack("<q", 1))), "its nodes do not lie where it says"),
                (edited((a, struct.pack("<q", 1 << 40))), "its nodes lie outside of it"),
                (edited((tree, struct.pack("<Q", first_of_level[0] + 32))), "its nodes do not lie where it says"),
                (edited((tree + 24, struct.pack("<Q", 0))), "its root does not lie where it says"),
                (edited((tree + 32, struct.pack("<I", 99)), (16 + 140, struct.pack("<I", 99))), "it counts more nodes than it has"),
                (edited((tree + 32, struct.pack("<I", 1)), (16 + 140, struct.pack("<I", 1))), "its nodes do not lie where it says"),
                (edited((empty, struct.pack("<f", 0.7))), "a value where there is no voxel"),
                (edited((root + 28, struct.pack("<f", 0.7))), "a value where there is no voxel"),
                (edited((high + 96 + 4 * 7, struct.pack("<f", 0.7))), "it has voxels outside of its box"),
                (edited((high + 16, bytes([whole[high + 16] | 0x80]))), "it has voxels outside of its box"),
                (flipped(root + 12, 16 + 88 + 12), "its box is not that of its voxels"),
                (flipped(grid + 560 + 6, 16 + 40 + 6), "its box in the world is not that of its voxels"),
                (flipped(grid + 608 + 6, 16 + 112 + 6), "its maps contradict each other"),
                (edited((grid + 632, b"\1"), (16 + 36, b"\1")), "it is no fog volume"),
                (edited((grid + 40 + 7, b"x" * 249)), "its grid's name has no end"),
                (edited((grid + 20, b"\1")), "it says more than a grid of ours"),
                (edited((grid + 648, b"\1")), "it says more than a grid of ours")):
            with self.subTest(says=says):
                changed("placed_0003.nvdb", change, says)
        changed("placed_0003.nvdb", lambda file: file[:199] + b"x" + file[200:], "its grid's name has no end")
        changed("placed_0003.nvdb", lambda file: file[:205] + b"x" + file[206:], "its grid does not begin as one")
        for end in (b" ", b" " * 400):
            changed("placed_0003.nvdb", lambda file, end=end: file + end, "it states more or less bytes than it has")
            for name in ("placed_0003.voxels.png", "placed_0003.png"):
                changed(name, lambda file, end=end: file + end, "goes on behind its picture")
            changed("placed_0003.ktx2", lambda file, end=end: file + end, "it does not end behind its levels")
        changed("placed_0003.vti", lambda file: file.replace(b'Direction="1 0', b'Direction="0 1'), "its head is not as nephos writes it")
        changed("placed_0003.vti", lambda file: file.replace(b"LittleEndian", b"BigEndian"), "its head is not as nephos writes it")
        changed("placed_0003.vti", lambda file: re.sub(b'format="ascii">[0-9]', b'format="ascii">9', file, count=1), "is of another moment than its source")
        changed("placed_0003.vti", lambda file: file + b" ", "it does not end behind its voxels")
        changed("placed_0003.bricks", lambda file: file + b" ", "it does not end behind its bricks")
        changed("placed_0003.vti", lambda file: file.replace(b'Origin="', b'Origin="9'), elsewhere)
        changed("placed_0003.vti", lambda file: file.replace(b'Spacing="', b'Spacing="9'), elsewhere)
        levels, bricks = struct.unpack_from("<IQ", (folder / "placed_0003.bricks").read_bytes(), 20)
        first = 32 + 12 * levels
        entries = [struct.unpack_from("<4I2Q2f", (folder / "placed_0003.bricks").read_bytes(), first + 40 * n) for n in range(bricks)]
        full = next(n for n, entry in enumerate(entries) if entry[5] > 0)
        corner = entries[full][4]
        changed("placed_0003.bricks", lambda file: file[:corner] + bytes([file[corner] ^ 0x80]) + file[corner + 1:], f"brick {full} or its border has")
        for at in (32, 36):
            changed("placed_0003.bricks", lambda file, at=first + 40 * full + at: file[:at] + struct.pack("<f", 7) + file[at + 4:],
                    f"brick {full} states values from")
        for channel, value in ((0, 9), (1, 77), (3, 254)):
            changed("placed_0003.voxels.png", recoloured(channel, value), "expected a picture that nephos has written")
        self.call("verify", "out")
        folder = self.export("zip", "--to", "nvdb", "--zip")
        whole = (folder / "placed_0003.nvdb").read_bytes()
        for content in (whole[:-1] + bytes([whole[-1] ^ 1]), whole[:400] + bytes([whole[400] ^ 1]) + whole[401:]):
            (folder / "placed_0003.nvdb").write_bytes(content)
            self.relisted(folder, "placed_0003.nvdb")
            self.assertIn("its compressed bytes are damaged", self.call("verify", folder, status=1).stdout)
        for out, edge_m in (("there", 2), ("here", 1)):
            self.write_apart(16, edge_m)
            self.call("export", "apart.vdb", "--to", "nvdb", "-o", out)
        shutil.copy(self.folder / "there/apart_0001.nvdb", self.folder / "here")
        self.relisted(self.folder / "here", "apart_0001.nvdb")
        self.assertIn(elsewhere, self.call("verify", "here", status=1).stdout)

    def test_codes_of_a_narrow_leaf_are_compared(self):
        """A leaf of NanoVDB has codes from its least to its greatest value."""
        import pyopenvdb
        values = numpy.linspace(0.9981, 1, 16 ** 3, dtype=numpy.float32).reshape(16, 16, 16)
        grid = pyopenvdb.FloatGrid()
        grid.copyFromArray(values)
        grid.name = "density"
        pyopenvdb.write(str(self.folder / "narrow.vdb"), [grid])
        for quantise, width in (("fp8", 1), ("fp16", 2)):
            self.call("export", "narrow.vdb", "--to", "nvdb", "--quantise", quantise, "-o", quantise)
            self.call("verify", quantise)
            file = next((self.folder / quantise).glob("*.nvdb"))
            whole = file.read_bytes()
            file.write_bytes(whole[:-512 * width] + bytes(512 * width))
            self.relisted(self.folder / quantise, file.name)
            self.assertIn("FAIL  nvdb", self.call("verify", quantise, status=1).stdout)

    def test_what_is_cut_is_told(self):
        self.write_apart(24)
        import pyopenvdb
        grid = pyopenvdb.read(str(self.folder / "apart.vdb"), "density")
        grid.getAccessor().setValueOn((0, 0, 0), 3)
        pyopenvdb.write(str(self.folder / "cut.vdb"), [grid])
        said = self.call("export", "cut.vdb", "--to", "flightgear", "-o", "cut").stderr
        self.assertIn("values up to 3 are above 1, and are cut in r8, r16, bc4 and flightgear", said)
        self.assertIn("1 voxels above the scale are cut", self.call("verify", "cut").stdout)
        self.assertNotIn("are cut", self.call("export", "cut.vdb", "--to", "flightgear", "--voxel", "2", "-o", "means").stderr)

    def test_sidecars_that_lie(self):
        folder = self.export("out", "--to", "raw", "--type", "r8", "--mips", "--pad", "64")
        whole = json.loads((folder / "placed.volume.json").read_text())
        def without(key):
            return {name: value for name, value in whole.items() if name != key}
        def with_format(**values):
            return dict(whole, formats=[dict(whole["formats"][0], **values)])
        def with_frame(n, **values):
            return dict(whole, frames=[dict(frame, **values) if m == n else frame for m, frame in enumerate(whole["frames"])])
        def turned(by):
            matrix = whole["georeference"]["ecef_from_world"]
            return dict(whole, georeference=dict(whole["georeference"], ecef_from_world=[matrix[0] + by, *matrix[1:]]))
        levels = whole["formats"][0]["levels"]
        self.assertGreater(len(levels), 1)
        for sidecar, says in ((without("scale"), "`scale` is missing"), (dict(whole, scale="1"), '`scale` is "1": expected a number'),
                              (dict(whole, scale=0.5), "expected 1, as in export.json"), (dict(whole, count=6), "`count` is 6: expected 5"),
                              (dict(whole, name="other"), 'expected "placed"'), (dict(whole, frames=3), "`frames` is 3: expected a list"),
                              (dict(whole, formats=[dict(whole["formats"][0], type="r16")]), '`formats[0].type` is "r16": expected "r8"'),
                              (dict(whole, frames=[dict(whole["frames"][0], number=9)] * 5), "there is no placed_0009.raw"),
                              (dict(whole, size=[1, 2, 3]), "`size` is"), (without("min_m"), "`min_m` is missing"),
                              (dict(whole, voxel_size_m=[x * 2 for x in whole["voxel_size_m"]]), "`voxel_size_m` is"),
                              (dict(whole, min_m=[0.5, 0, 0]), "`min_m` is"), (dict(whole, period_m=[12345, None, None]), "`period_m` is"),
                              (dict(whole, axes=["north", "east", "up"]), "`axes` is"), (dict(whole, border=1), "`border` is"),
                              (dict(whole, handedness="left"), '`handedness` is "left": expected "right"'),
                              (dict(whole, extinction_per_m=1e-3), "`extinction_per_m` is"), (dict(whole, half_voxel_shift=True), "no such value"),
                              (with_format(levels=levels[:1]), "`formats[0].levels` is"), (dict(whole, formats=[]), "`formats` is a list: expected those of export.json"),
                              (dict(whole, first=2), "`first` is 2: expected 1, the first of `frames`"),
                              (with_frame(1, number=1), "`frames[1].number` is 1: expected one above that of the frame before"),
                              (dict(whole, count=4, frames=whole["frames"][:4]), "expected 5 frames, as in export.json"),
                              (with_frame(2, sum=whole["frames"][2]["sum"] * 1.000001), "`frames[2].sum` is"),
                              (with_frame(3, max=whole["frames"][2]["max"]), "`frames[3].max` is"), (with_frame(4, time_s=0), "`frames[4].time_s` is 0"),
                              (with_frame(1, utc=whole["frames"][2]["utc"]), "`frames[1].utc` is"), (dict(whole, layer="low"), "no such value"),
                              (dict(whole, time=dict(whole["time"], first_s=5)), "`time.first_s` is 5"), (without("georeference"), "`georeference` is missing"),
                              (dict(whole, georeference=dict(whole["georeference"], heading_deg=4)), "`georeference.heading_deg` is 4"),
                              (turned(1e-6), "`georeference.ecef_from_world[0]` is"),
                              (dict(whole, source=dict(whole["source"], seed="8")), '`source.seed` is "8"'),
                              (with_format(levels=[dict(levels[0], offset=4), *levels[1:]]), "`formats[0].levels` is")):
            with self.subTest(says=says):
                (folder / "placed.volume.json").write_text(json.dumps(sidecar))
                self.relisted(folder, "placed.volume.json")
                said = self.call("verify", "out", status=1).stdout
                self.assertIn("FAIL  sidecars  out/placed.volume.json: ", said)
                self.assertIn(says, said)
        (folder / "placed.volume.json").write_text(json.dumps(turned(1e-16)))  # as other sines round
        self.relisted(folder, "placed.volume.json")
        self.call("verify", "out")

    def test_files_of_another_program_among_those_of_nephos(self):
        """A frame that lost its metadata has the time of the first; and names of two formats may end alike."""
        import pyopenvdb
        names = []
        for number in (1, 2, 3):
            grids, metadata = pyopenvdb.readAll(str(self.folder / f"run/density/placed_{number:04}.vdb"))
            for grid in grids if number == 2 else []:
                for key in [key for key in grid.metadata if key.startswith("nephos")]:
                    del grid[key]
            names.append(f"m_{number}.vdb")
            pyopenvdb.write(str(self.folder / names[-1]), grids, {} if number == 2 else metadata)
        for n, order in enumerate((names, names[1:])):
            said = self.call("export", *order, "--to", "vti", "--to", "slices", "--to", "flightgear", "-o", f"mixed{n}").stderr
            self.assertEqual("m_2.vdb: says of no moment, unlike the first file" in said, n == 0, said)
            said = self.call("verify", f"mixed{n}").stdout
            self.assertIn(f"and so are times, but for 1 of {3 - n} frames, whose sources say of none", said)
        shutil.copy(self.folder / "m_2.vdb", self.folder / "run/density/placed_0002.vdb")  # of a run
        said = self.call("export", "run", "--to", "vti", "-o", "of-run").stderr
        time_s = json.loads((self.folder / "run/manifest.json").read_text())["frames"][1]["time_s"]
        self.assertIn(f"says of no moment, unlike the first file: it is given that of its run's manifest, {time_s:g} s", said)
        self.call("verify", "of-run")
        self.call("export", "run", "--to", "vti", "--frames", "2..", "-o", "first")
        self.call("verify", "first")

    def test_maps_of_small_voxels(self):
        """Below some 2 mm OpenVDB rounds zeros of their inverse."""
        self.call("run", self.scene, "--no-render", "-q", "--set", "lattice.cell_size_m=0.013", "--set", "density.refine=8", "--set",
                  "lattice.origin_m=[-0.17,0.3,1.1]", "--set", "lattice.cells=[8,8,8]", "--set", "field.background.hum=0.9", "--out", "small")
        self.call("export", "small", "--to", "nvdb", "-o", "small-nvdb")
        self.assertIn("files read back", self.call("verify", "small-nvdb").stdout)
        import pyopenvdb
        for number, (edge, place) in enumerate(((0.001, (0.004, 58.613, 0)), (0.001, (-0.049, 401.225, -946.725)), (0.00215, (-6.359, 0, 20772.5725)))):
            grid = pyopenvdb.FloatGrid()
            grid.copyFromArray(numpy.full((9, 8, 5), 0.5, "f4"))
            grid.name, grid.gridClass, grid.transform = "density", pyopenvdb.GridClass.FOG_VOLUME, pyopenvdb.createLinearTransform(edge)
            grid.transform.translate(place)
            pyopenvdb.write(str(self.folder / f"far_{number}.vdb"), [grid])
            self.call("export", f"far_{number}.vdb", "--to", "nvdb", "-o", f"far-{number}", "-q")
            self.assertIn("files read back", self.call("verify", f"far-{number}").stdout)

    def test_voxels_that_are_no_numbers(self):
        """NaN in a file whose checksum agrees: compared with its source, it is none of its values."""
        for format, type, code, more in (("raw", "r32f", "<f4", []), ("raw", "r16f", "<f2", []), ("bricks", "r32f", "<f4", []),
                                         ("raw", "r32f", "<f4", ["--pad", "64", "--mips"])):  # the last in its second level
            with self.subTest(format=format, type=type, more=more):
                folder = self.export(format + type + "".join(more), "--to", format, "--type", type, *more)
                file = folder / f"placed_0003.{format}"
                content = bytearray(file.read_bytes())
                size = numpy.dtype(code).itemsize
                at = len(content) - 5 * size
                if format == "bricks":  # the fifth voxel along each axis of the first brick, behind its border
                    at = int(numpy.frombuffer(content, "<u8", 1, 60)[0]) + size * (34 * 34 * 5 + 34 * 5 + 5)
                content[at:at + size] = numpy.array([numpy.nan], code).tobytes()
                file.write_bytes(content)
                self.relisted(folder, file.name)
                self.assertIn("no finite number", self.call("verify", folder, status=1).stdout)

    def test_sizes_that_a_small_file_states(self):
        """Files of some kilobytes that state gigabytes are refused before memory is taken."""
        limited = lambda: limit_addresses(6 << 30)
        folder = self.export("bricks", "--to", "bricks", "--type", "r32f")
        head = numpy.array([3, 256, 1, 1], "<u4").tobytes() + numpy.array([100], "<u8").tobytes() + numpy.array([2560, 2560, 256], "<u4").tobytes()
        table = b"".join(numpy.array([0, n % 10, n // 10, 0], "<u4").tobytes() + bytes(24) for n in range(100))
        (folder / "placed_0003.bricks").write_bytes(b"NPHBRIC1" + head + table)
        self.relisted(folder, "placed_0003.bricks")
        self.assertIn("bytes of memory, too many for a file of", self.call("verify", folder, status=1, preexec_fn=limited).stdout)
        folder = self.export("vti", "--to", "vti", "--zip")
        content = (folder / "placed_0003.vti").read_bytes()
        at = content.index(b'raw">\n_') + 7
        content = content[:at + 8] + numpy.array([1 << 30], "<u8").tobytes() + bytes(8) + content[at + 24:]
        (folder / "placed_0003.vti").write_bytes(content)
        self.relisted(folder, "placed_0003.vti")
        self.assertIn("more bytes than it can hold", self.call("verify", folder, status=1, preexec_fn=limited).stdout)

    def test_options_without_effect_are_refused(self):
        for arguments, says in (
                (["--to", "vti", "--mips"], "--mips: is for raw, dds, ktx2 and bricks, and of no effect in vti"),
                (["--to", "raw", "--zip"], "--zip: is for vti and nvdb"), (["--to", "raw", "--quantise", "fp8"], "--quantise: is for nvdb"),
                (["--to", "ktx2", "--legacy-dds"], "--legacy-dds: is for dds"), (["--to", "raw", "--velocity", "vel"], "--velocity: is for usd and vdb"),
                *[(["--to", "vdb", "--velocity", name], f"--velocity: \"{said}\": expected up to 60 letters")
                  for name, said in (("density", "density"), ("a b", "a b"), ("v\x1b[31m", "v\ufffd[31m"))],
                (["--to", "nvdb", "--type", "r8"], "--type r8: is for raw"), (["--to", "vdb", "--axes", "unity"], "--axes: is for raw"),
                (["--to", "vdb", "--border", "zero"], "--border"), (["--to", "nvdb", "--pad", "8"], "--pad"), (["--to", "nvdb", "--range", "auto"], "--range auto"),
                (["--to", "raw", "--bricks", "16"], "--bricks: is for bricks"), (["--for", "xplane", "--voxel", "100"], "--voxel"),
                (["--for", "cigi", "--layer", "all"], "--layer"), (["--for", "unreal", "--type", "r8"], "--type r8")):
            with self.subTest(arguments=arguments):
                self.refused(2, "export", "run", *arguments, "-o", "bad", says=says)
                self.assertFalse((self.folder / "bad").exists())
        # One of several formats takes it; a preset's own options are not the user's.
        self.export("both", "--to", "raw", "--to", "vti", "--type", "r8", "--mips")
        self.assertIn("calm", self.call("export", "run", "--for", "blender", "-o", "calm").stderr)

    def test_coarse_voxels_keep_the_period(self):
        scene = self.write("periodic.toml", SCENE.replace("cells = [32, 24, 12]", 'cells = [32, 24, 12]\nboundaries = ["periodic", "periodic", "open"]'))
        self.call("run", scene, "--no-render", "--out", "periodic")
        cell = json.loads(self.call("export", "periodic", "--to", "raw", "--plan", "--json").stdout)["sequences"][0]["voxel_size_m"][0]
        error = self.refused(2, "export", "periodic", "--to", "raw", "--voxel", 5 * cell, "-o", "bad",
                             says="32 voxels along x and 24 voxels along y").stderr
        self.assertIn(f"expected --voxel {4 * cell:g} or --voxel {8 * cell:g}", error)
        plan = lambda *arguments: json.loads(self.call("export", "periodic", "--to", "raw", *arguments, "--plan", "--json").stdout)["sequences"][0]
        self.assertEqual(plan("--voxel", 4 * cell)["size"][:2], [8, 6])
        self.assertEqual(plan("--size", 7)["size"][:2], [4, 3])  # 5 voxels would do, and do not divide
        self.refused(2, "export", "periodic", "--to", "raw", "--size", 3, "-o", "bad", says="has at least 4 voxels: whole tiles have to fit")
        said = self.call("export", "periodic", "--to", "raw", "--pad", "64", "--plan").stderr
        self.assertIn("not after its size", said)
        self.assertNotIn("not after its size", self.call("export", "run", "--to", "raw", "--pad", "64", "--plan").stderr)
        for budget in (1000, 3000, 9000):
            size = plan("--budget", budget)["size"]
            self.assertEqual((32 % size[0], 24 % size[1], 32 // size[0]), (0, 0, 24 // size[1]))

    def test_damage_is_found(self):
        folder = self.export("out", "--to", "ktx2")
        content = bytearray((folder / "placed_0003.ktx2").read_bytes())
        content[-100] ^= 0xFF
        (folder / "placed_0003.ktx2").write_bytes(content)
        self.assertIn("placed_0003.ktx2", self.call("verify", "out", status=1).stdout)

    def test_frames_that_are_added_leave_the_others_as_they_are(self):
        self.export("whole", "--to", "ktx2")
        self.export("grown", "--to", "ktx2", "--frames", "1..2")
        self.call("export", "run", "--to", "ktx2", "-o", "grown", "-q")
        for path in (self.folder / "whole").iterdir():
            self.assertEqual(path.read_bytes(), (self.folder / "grown" / path.name).read_bytes(), path.name)
        self.call("verify", "grown")
        # One of several formats is made again: the list is that of one go.
        self.export("mended", "--to", "raw", "--to", "bricks")
        whole = json.loads((self.folder / "mended/export.json").read_text())
        (self.folder / "mended/placed_0002.raw").unlink()
        self.call("export", "run", "--to", "raw", "--to", "bricks", "-o", "mended", "-q")
        self.assertEqual(json.loads((self.folder / "mended/export.json").read_text()), whole)

    def test_any_fog_volume(self):
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.name = "smoke"
        grid.transform = pyopenvdb.createLinearTransform(0.5)
        grid.gridClass = pyopenvdb.GridClass.FOG_VOLUME
        grid.fill((0, 0, 0), (9, 4, 3), 0.25)
        for number in (7, 8):
            pyopenvdb.write(str(self.folder / f"smoke.{number:03}.vdb"), [grid])
        self.call("export", "smoke.007.vdb", "smoke.008.vdb", "--to", "raw", "--type", "r8", "-o", "smoke")
        self.call("verify", "smoke")
        codes = numpy.fromfile(self.folder / "smoke/smoke_0008.raw", "u1")
        self.assertEqual((len(codes), set(codes)), (200, {64}))

    def test_odd_fog_volumes(self):
        """Voxels of a metre, of half a metre and turned; values above 1; a single one: what comes out is what went in."""
        import pyopenvdb
        def written(name, low, high, value, matrix):
            grid = pyopenvdb.FloatGrid()
            grid.name = "density"
            grid.gridClass = pyopenvdb.GridClass.FOG_VOLUME
            grid.transform = pyopenvdb.createLinearTransform(matrix)
            grid.fill(low, high, value)
            pyopenvdb.write(str(self.folder / f"{name}.vdb"), [grid])
        def edge(size, turn=False):
            rows = [[0, size, 0, 0], [-size, 0, 0, 0]] if turn else [[size, 0, 0, 0], [0, size, 0, 0]]
            return [*rows, [0, 0, size, 0], [0, 0, 0, 1]]
        written("metre", (0, 0, 0), (20, 9, 5), 0.5, edge(1))
        written("dense", (-9, -5, -3), (20, 9, 5), 7.5, edge(0.5))
        written("turned", (0, 0, 0), (9, 4, 3), 0.3, edge(25, True))
        written("single", (5, 5, 5), (5, 5, 5), 1, edge(50))
        for name in ("metre", "dense", "turned", "single"):
            for arguments in (["--to", "vdb"], ["--to", "vdb", "--type", "r16f"], ["--to", "raw", "--to", "nvdb", "--zip"], ["--to", "raw", "--type", "r16f"],
                              ["--to", "raw", "--to", "slices", "--to", "bricks", "--type", "r8"], ["--for", "vulkan"], ["--to", "vdb", "--voxel"]):
                with self.subTest(name=name, arguments=arguments):
                    size = {"metre": 3, "dense": 1, "turned": 75, "single": 50}[name]
                    said = self.call("export", f"{name}.vdb", *arguments, *([size] if arguments[-1] == "--voxel" else []), "-o", "odd").stderr
                    cut = name == "dense" and ("vulkan" in arguments or "r8" in arguments)
                    self.assertEqual("above 1, and are cut" in said, cut, said)
                    self.assertEqual("voxels above the scale are cut to it" in self.call("verify", "odd").stdout, cut)
                    for file in (self.folder / "odd").glob("*.vdb"):
                        self.assertEqual(json.loads(self.call("info", file, "--json").stdout)["grids"][0]["metadata"]["nephos_refine"], 1)
                    shutil.rmtree(self.folder / "odd")
        # A run whose voxels are halves of its cells says so in what is exported.
        self.call("run", self.scene, "--no-render", "--out", "fine", "--frames", "1", "--set", "density.refine=4")
        for arguments, refine in (([], 4), (["--voxel", 25], 2), (["--voxel", 50], 1), (["--voxel", 37.5], 1)):
            self.call("export", "fine", "--to", "vdb", *arguments, "-o", "odd")
            self.call("verify", "odd")
            found = json.loads(self.call("info", "odd/tiny_0001.vdb", "--json").stdout)
            self.assertEqual(next(g for g in found["grids"] if g["name"] == "density")["metadata"]["nephos_refine"], refine)
            shutil.rmtree(self.folder / "odd")

    def test_mistakes_are_named(self):
        for arguments, says in ((["--to", "obj"], "raw, vti"), ([], "neither --to nor --for"), (["--for", "doom"], "blender, unreal"),
                                (["--to", "vti", "--type", "bc4"], "r8, r16 and r32f"), (["--to", "raw", "--voxel", "70"], "a multiple such as"),
                                (["--to", "raw", "--layer", "low"], "has no layers"), (["--to", "raw", "--frames", "90..99"], "no frame of this range"),
                                (["--to", "nvdb", "--budget", "1MiB"], "--budget: is for raw"), (["--to", "raw", "--budget", "1"], "less than the smallest"),
                                (["--to", "dds", "--legacy-dds", "--type", "r16f"], "old header"), (["--to", "raw", "--type", "r9"], "r8, r16")):
            with self.subTest(arguments=arguments):
                self.refused(2, "export", "run", *arguments, "-o", "bad", says=says)
                self.assertFalse((self.folder / "bad").exists())
        self.refused(2, "export", "run", "--to", "raw", "-o", "", says="--out is empty")
        self.call("run", self.scene, "--statistics-only", "--out", "numbers")
        self.refused(2, "export", "numbers", "--to", "raw", "-o", "bad", says="it was run with --statistics-only")
        plan = json.loads(self.call("export", "run", "--for", "vulkan", "--plan", "--json").stdout)
        self.assertEqual(plan["sequences"][0]["frames"], 5)
        self.assertFalse((self.folder / "export").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
