# SPDX-License-Identifier: Apache-2.0
"""`nephos export`, and its files in programs of others: OpenVDB, VTK, NanoVDB's tools, ffmpeg, xmllint, Pillow."""

import json
import subprocess
import sys
import unittest

import numpy

from case import Case, SCENE, SOURCE, voxels
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

    def test_an_interrupted_export_goes_on(self):
        folder = self.export("out", "--to", "raw")
        listing = json.loads((folder / "export.json").read_text())
        listing["complete"] = False
        (folder / "export.json").write_text(json.dumps(listing))
        (folder / "placed_0002.raw").write_bytes(b"damaged")
        (folder / "placed_0004.raw").unlink()
        before = (folder / "placed_0001.raw").stat().st_mtime_ns
        report = json.loads(self.call("export", "run", "--to", "raw", "-o", "out", "--json").stdout)
        self.assertEqual(report["kept"], len(listing["files"]) - 4)
        self.assertEqual((folder / "placed_0001.raw").stat().st_mtime_ns, before)
        self.call("verify", "out")
        self.refused(2, "export", "run", "--to", "raw", "--type", "r8", "-o", "out", says="other options")
        self.refused(2, "export", "run", "--to", "raw", "-o", "run", says="not empty")

    def test_damage_is_found(self):
        folder = self.export("out", "--to", "ktx2")
        content = bytearray((folder / "placed_0003.ktx2").read_bytes())
        content[-100] ^= 0xFF
        (folder / "placed_0003.ktx2").write_bytes(content)
        self.assertIn("placed_0003.ktx2", self.call("verify", "out", status=1).stdout)

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

    def test_mistakes_are_named(self):
        for arguments, says in ((["--to", "obj"], "raw, vti"), ([], "neither --to nor --for"), (["--for", "doom"], "blender, unreal"),
                                (["--to", "vti", "--type", "bc4"], "r8, r16 and r32f"), (["--to", "raw", "--voxel", "70"], "a multiple such as"),
                                (["--to", "raw", "--layer", "low"], "has no layers"), (["--to", "raw", "--frames", "90..99"], "no frame of this range"),
                                (["--to", "nvdb", "--budget", "1MiB"], "--budget counts"), (["--to", "raw", "--budget", "1"], "less than the smallest"),
                                (["--to", "dds", "--legacy-dds", "--type", "r16f"], "old header"), (["--to", "raw", "--type", "r9"], "r8, r16")):
            with self.subTest(arguments=arguments):
                self.refused(2, "export", "run", *arguments, "-o", "bad", says=says)
                self.assertFalse((self.folder / "bad").exists())
        plan = json.loads(self.call("export", "run", "--for", "vulkan", "--plan", "--json").stdout)
        self.assertEqual(plan["sequences"][0]["frames"], 5)
        self.assertFalse((self.folder / "export").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
