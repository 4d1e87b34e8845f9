# SPDX-License-Identifier: Apache-2.0
"""Files and folders that are missing, damaged, in the way or too large for the disk."""

import json
import os
import pathlib
import resource
import shutil
import struct
import subprocess
import unittest

from case import BAD, NEPHOS, PATIENCE, SANITIZED, SCENE, Case, limit_addresses, unsealed


class Files(Case):
    def test_files_that_are_not_there_are_named(self):
        for arguments in (["run", "no.toml"], ["validate", "no.toml"], ["hash", "no.toml"],
                          ["state", "no.toml", "--out", "x.vdb"], ["info", "no.toml"],
                          ["render", "no.toml", "--out", "x.png"], ["hash", self.scene, "--from", "no.toml"],
                          ["hash", self.scene, "--check", "no.toml"], ["render", "x.vdb", "--scene", "no.toml", "--out", "x.png"]):
            with self.subTest(arguments=arguments):
                self.refused(3, *arguments, says="no.toml")

    def test_folders_where_files_should_be(self):
        (self.folder / "folder.toml").mkdir()
        for arguments in (["run"], ["validate"], ["hash"], ["info"], ["state", "--out", "x.vdb"],
                          ["render", "--out", "x.png"], ["hash", self.scene, "--from"], ["hash", self.scene, "--check"]):
            with self.subTest(arguments=arguments):
                self.refused(3, *arguments, "folder.toml", says="folder.toml")
        self.refused(3, "state", self.scene, "--out", "folder.toml", says="folder.toml")

    def test_garbage_is_refused_by_name(self):
        for name, content in (("empty", b""), ("text", b"hello world" * 10), ("vdb", b" BDV\0\0\0\0" + b"x" * 100),
                              ("exr", b"\x76\x2f\x31\x01" + b"x" * 100), ("checkpoint", b"NEPHOSCP" + b"x" * 100)):
            path = self.folder / name
            path.write_bytes(content)
            with self.subTest(name=name):
                self.refused(3, "info", path, says=name)
                self.refused(3, "render", path, "--out", "x.png", says=name)
                self.refused(3, "hash", self.scene, "--from", path, says=name)

    def test_a_picture_of_many_attributes(self):
        def attribute(name, kind, value):
            return f"{name}\0{kind}\0".encode() + struct.pack("<I", len(value)) + value
        channels = b"Y\0" + struct.pack("<IIII", 2, 0, 1, 1) + b"\0"
        names = [f"a{n:06}" for n in range(30_000)]
        head = b"\x76\x2f\x31\x01" + struct.pack("<I", 2) + attribute("channels", "chlist", channels)
        head += attribute("compression", "compression", b"\0") + attribute("lineOrder", "lineOrder", b"\0")
        for window in ("dataWindow", "displayWindow"):
            head += attribute(window, "box2i", bytes(16))
        head += attribute("pixelAspectRatio", "float", struct.pack("<f", 1))
        head += attribute("screenWindowCenter", "v2f", bytes(8)) + attribute("screenWindowWidth", "float", struct.pack("<f", 1))
        head += b"".join(attribute(name, "string", name[1:].encode()) for name in names) + b"\0"
        (self.folder / "many.exr").write_bytes(head + struct.pack("<Qii", len(head) + 8, 0, 4) + bytes(4))
        attributes = json.loads(self.call("info", "many.exr", "--json").stdout)["parts"][0]["attributes"]
        self.assertEqual([name for name in attributes if name[0] == "a"], names)
        self.assertTrue(all(attributes[name] == name[1:] for name in names))

    def test_pipes_and_links_in_the_folder_of_a_run(self):
        for name in ("manifest.json", "statistics.csv", "checkpoint.nephos", "density/tiny_0001.vdb"):
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            (self.folder / "out/density").mkdir(parents=True)
            os.mkfifo(self.folder / "out" / name)
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", says=name)
            self.assertTrue((self.folder / "out" / name).is_fifo())
            self.call("run", self.scene, "--no-render", "--out", "out", "--overwrite")
            self.assertTrue((self.folder / "out" / name).is_file())
        for name in ("checkpoint.nephos", "manifest.json", "statistics.csv"):
            shutil.rmtree(self.folder / "out", ignore_errors=True)
            self.call("run", self.scene, "--no-render", "--out", "out")
            (self.folder / "out" / name).unlink()
            os.mkfifo(self.folder / "out" / name)
            self.refused(3, "run", self.scene, "--no-render", "--out", "out", "--resume", says=name)
        (self.folder / "until").mkdir()
        os.mkfifo(self.folder / "until/manifest.json")
        self.refused(3, "run", self.scene, "--statistics-only", "--until", "cover.se=0.5", "--max-steps", "9", "--out", "until",
                     "--resume", says="manifest.json")
        # The folder and its parts may be links, to elsewhere and to nothing.
        elsewhere = self.folder / "elsewhere"
        (elsewhere / "grids").mkdir(parents=True)
        (self.folder / "link").symlink_to(elsewhere)
        (elsewhere / "density").symlink_to("grids")
        self.call("run", self.scene, "--no-render", "--out", "link")
        self.assertEqual(len(list((elsewhere / "grids").iterdir())), 5)
        (self.folder / "nowhere").symlink_to("not there")
        self.refused(3, "run", self.scene, "--no-render", "--out", "nowhere", says="nowhere")
        # A link in the place of a file is somebody's, whatever it points to.
        (self.folder / "mine").write_text("mine")
        (self.folder / "third").mkdir()
        (self.folder / "third/statistics.csv").symlink_to("../mine")
        self.refused(2, "run", self.scene, "--no-render", "--out", "third", says="statistics.csv")
        self.call("run", self.scene, "--no-render", "--out", "third", "--overwrite")
        self.assertEqual((self.folder / "mine").read_text(), "mine")

    def test_a_copy_of_a_run_that_is_made_of_links(self):
        """`cp -l` gives the files of a run a second name each; to go on under one leaves the other as it was."""
        layered = ["--set", 'layer=[{name="low", veil={form="stratus", base_m=100, top_m=400}}]']
        for name, more, file in (("plain", [], "statistics.csv"), ("layered", layered, "statistics/low.csv")):
            begin = [self.scene, "--no-render", *more, "--out", name]
            self.call("run", *begin, "--set", "time.steps=3")
            shutil.copytree(self.folder / name, self.folder / f"{name} linked", copy_function=os.link)
            before = {path: path.read_bytes() for path in (self.folder / f"{name} linked").rglob("*") if path.is_file()}
            self.call("run", *begin, "--resume")
            self.assertGreater(len((self.folder / name / file).read_bytes()), len((self.folder / f"{name} linked" / file).read_bytes()))
            for path, content in before.items():
                self.assertEqual(path.read_bytes(), content, path)
            for folder in (name, f"{name} linked"):
                self.call("verify", folder)

    def test_a_foreign_manifest(self):
        for text in ("", "{}", "[1, 2]", "mine", '{"format": "nephos run", "format_version": 999}'):
            self.write("out/manifest.json", text)
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", says="manifest.json")
            self.assertEqual((self.folder / "out/manifest.json").read_text(), text)
        self.assertEqual(len(list((self.folder / "out").iterdir())), 1)
        # Of many keys, and of long lists, in and beside what is read.
        self.call("run", self.scene, "--no-render", "--out", "whole")
        whole = json.loads((self.folder / "whole/manifest.json").read_text())
        other = json.loads(json.dumps(whole))
        other["scene"]["hash"] = "0" * 32
        other["parameters"].update({f"k{n}": "1" for n in range(100_000)}, seed="4")
        other["list"] = [{}] * 200_000
        self.write("out/manifest.json", json.dumps(other))
        self.refused(2, "run", self.scene, "--no-render", "--out", "out", says="`seed` was 4, now 3; `k0` was 1, now not there")
        whole["list"] = other["list"]
        whole.update({f"k{n}": [] for n in range(100_000)})
        (self.folder / "whole/manifest.json").write_text(unsealed(whole))
        self.call("verify", "whole")
        self.call("run", self.scene, "--no-render", "--out", "out", "--overwrite")

    def test_a_run_of_another_scene_stays(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        table = (self.folder / "out/statistics.csv").read_text()
        for change in (["--seed", "77"], ["--set", "time.step_s=7"]):
            self.refused(2, "run", self.scene, "--no-render", "--out", "out", *change, says="another scene or seed")
            self.assertEqual((self.folder / "out/statistics.csv").read_text(), table)
        self.call("run", self.scene, "--no-render", "--out", "out")  # the same scene: the same files
        self.assertEqual((self.folder / "out/statistics.csv").read_text(), table)
        self.call("run", self.scene, "--no-render", "--out", "out", "--seed", "77", "--overwrite")
        self.assertNotEqual((self.folder / "out/statistics.csv").read_text(), table)

    def test_named_pipes_are_refused_and_those_of_commands_read(self):
        os.mkfifo(self.folder / "pipe")
        for arguments in (["info"], ["validate"], ["run"], ["hash"], ["hash", self.scene, "--check"],
                          ["hash", self.scene, "--from"]):
            with self.subTest(arguments=arguments):
                self.refused(3, *arguments, "pipe", says="pipe")
        self.refused(3, "hash", self.scene, "--check", "/dev/zero", says="/dev/zero: is a device: expected a file")
        result = subprocess.run(["bash", "-c", f'"{NEPHOS}" validate <(cat "{self.scene}")'], capture_output=True, text=True,
                                timeout=PATIENCE, env=self.environment)
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_one_unreadable_file_does_not_hide_the_others(self):
        bad = self.write("bad.toml", BAD)
        result = self.call("validate", "no.toml", bad, self.scene, "--json", status=3)
        entries = json.loads(result.stdout)
        self.assertEqual([entry["valid"] for entry in entries], [False, False, True])
        self.assertIn("no.toml", entries[0]["error"])
        self.assertIn("error: ", result.stderr)
        self.assertIn("tiny.toml: valid", self.call("validate", "no.toml", self.scene, status=3).stdout)

        self.call("state", self.scene, "--out", "good.vdb")
        self.write("empty", "")
        result = self.call("info", "empty", "no.vdb", "good.vdb", "--json", status=3)
        entries = json.loads(result.stdout)
        self.assertEqual([entry.get("kind") for entry in entries], [None, None, "vdb"])
        self.assertIn("is empty", entries[0]["error"])
        result = self.call("info", "empty", "good.vdb", status=3)
        self.assertTrue(result.stdout.startswith("good.vdb: OpenVDB"), result.stdout)
        self.assertEqual(result.stderr.count("error: "), 1)
        self.assertIn("no.vdb", json.loads(self.call("info", "no.vdb", "--json", status=3).stdout)["error"])

    def test_a_checkpoint_that_lies_about_its_size(self):
        head = b"NEPHOSCP" + struct.pack("<II", 1, 2) + b"a" * 32 + bytes(24)
        for name, sizes in (("state", [1 << 62]), ("history", [8, 1 << 62]), ("sum", [(1 << 64) - 8])):
            content = head
            for size in sizes:
                content += struct.pack("<Q", size) + bytes(8 if size == 8 else 0)
            path = self.folder / name
            path.write_bytes(content)
            self.refused(3, "info", path, says="bytes announced")
        # A sparse file of a terabyte costs nothing to make, and must cost nothing to refuse.
        with open(self.folder / "huge", "wb") as file:
            file.write(head + struct.pack("<Q", 100))
            file.truncate(1 << 40)
        self.refused(3, "info", "huge", says="bytes after its end")
        with open(self.folder / "huge", "r+b") as file:
            file.seek(len(head))
            file.write(struct.pack("<Q", (1 << 40) - len(head) - 32))
        self.refused(3, "info", "huge", says="to read, but")

    def test_an_output_that_is_in_the_way(self):
        self.write("file", "mine")
        self.refused(3, "run", self.scene, "--no-render", "--out", "file", says="file")
        self.refused(3, "run", self.scene, "--no-render", "--out", "file/below", says="file")
        self.refused(3, "state", self.scene, "--out", "file/x.vdb", says="file")
        self.assertEqual((self.folder / "file").read_text(), "mine")

    def test_a_file_that_is_replaced_keeps_its_access_list(self):
        """And one without gets none of its folder: the rights of the group are else those of others."""
        def entries(*of):
            return struct.pack("<I", 2) + b"".join(struct.pack("<HHI", tag, rights, who) for tag, rights, who in of)
        nobody, mine, named, group, mask, others = 0xffffffff, 1, 2, 4, 0x10, 0x20
        listed = entries((mine, 6, nobody), (named, 6, 2000), (group, 0, nobody), (mask, 6, nobody), (others, 0, nobody))
        path = pathlib.Path(self.write("lists/x.vdb", "old"))
        try:
            os.setxattr(path, "system.posix_acl_access", listed)
        except OSError as error:
            self.skipTest(f"no access control lists here: {error}")
        self.call("state", self.scene, "--steps", "1", "--out", "lists/x.vdb")
        self.assertEqual(os.getxattr(path, "system.posix_acl_access"), listed)
        self.assertEqual(path.stat().st_mode & 0o777, 0o660)
        os.setxattr(path.parent, "system.posix_acl_default",
                    entries((mine, 7, nobody), (named, 7, 2000), (group, 5, nobody), (mask, 7, nobody), (others, 5, nobody)))
        os.removexattr(path, "system.posix_acl_access")
        path.chmod(0o640)
        self.call("state", self.scene, "--steps", "2", "--out", "lists/x.vdb")
        self.assertNotIn("system.posix_acl_access", os.listxattr(path))
        self.assertEqual(path.stat().st_mode & 0o777, 0o640)

    def test_a_folder_without_rights(self):
        locked = self.folder / "locked"
        locked.mkdir()
        locked.chmod(0o555)
        os.chmod(self.folder, 0o755)
        drop = (lambda: os.setuid(65534)) if os.getuid() == 0 else None
        self.refused(3, "run", self.scene, "--no-render", "--out", "locked/out", says="locked", preexec_fn=drop)
        self.refused(3, "state", self.scene, "--out", "locked/x.vdb", says="locked", preexec_fn=drop)

    def test_names_with_spaces_and_other_scripts(self):
        scene = self.write("Вечер 雲/mein Himmel ☁.toml", "name = \"cloud\"\n" + SCENE)
        self.call("run", scene, "--no-render", "--out", "aus gabe/雲")
        self.assertTrue((self.folder / "aus gabe/雲/density/cloud_0001.vdb").exists())
        self.call("info", "aus gabe/雲/density/cloud_0001.vdb")
        self.call("state", scene, "--steps", "1", "--out", "état.vdb")
        self.call("hash", scene, "--steps", "1", "--from", "état.vdb")

    def test_a_full_disk_is_status_3_and_leaves_nothing_half(self):
        def small():
            resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
        result = self.refused(3, "state", self.scene, "--out", "x.vdb", says="x.vdb", preexec_fn=small)
        self.assertNotIn("unexpected", result.stderr)
        self.assertEqual([p.name for p in self.folder.iterdir()], ["tiny.toml"])
        self.refused(3, "run", self.scene, "--no-render", "--out", "out", says="out/", preexec_fn=small)
        left = [p.name for p in (self.folder / "out").rglob("*") if p.is_file()]
        self.assertFalse([name for name in left if "part" in name or name.endswith(".vdb")], left)
        # With room again the same command works.
        self.call("run", self.scene, "--no-render", "--out", "out")

    @unittest.skipIf(SANITIZED, "its shadow memory would not fit")
    def test_an_export_is_not_false_where_memory_is_short(self):
        self.call("run", self.scene, "--no-render", "--out", "run", "-q")
        self.call("export", "run", "--to", "raw", "-o", "exported", "-q")
        result = self.call("verify", "exported", status=3, preexec_fn=lambda: limit_addresses(150 << 20))
        self.assertIn("cannot be loaded", result.stderr)

    def test_little_memory_is_an_error_and_no_crash(self):
        big = self.write("big.toml", SCENE.replace("[32, 24, 12]", "[4096, 4096, 512]"))
        def small():
            resource.setrlimit(resource.RLIMIT_AS, (700 << 20, 700 << 20))
        result = self.call("run", big, "--no-render", status=2, preexec_fn=small)
        self.assertIn("error:", result.stderr)
        result = self.call("hash", big, status=2, preexec_fn=small)
        self.assertIn("error:", result.stderr)


class Disk(Case):
    """A full disk at every kind of file: exit status 3, the file's name, nothing half, and the rest as it was."""

    def limited(self, size):
        return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    def need_device(self):
        if shutil.which("vulkaninfo") is None and not list(pathlib.Path("/usr/share/vulkan/icd.d").glob("*")):
            self.skipTest("no Vulkan device")

    def no_parts(self):
        parts = [p for p in self.folder.rglob("*") if ".part" in p.name]
        self.assertEqual(parts, [])

    def size(self, name):
        return (self.folder / name).stat().st_size

    def refused_at(self, size, says, *arguments):
        result = self.refused(3, *arguments, says=says, preexec_fn=self.limited(size))
        self.assertIn("File too large", result.stderr)
        self.no_parts()

    def test_manifest(self):
        self.refused_at(100, "manifest.json", "run", self.scene, "--no-render", "--out", "out")
        self.assertEqual([p for p in (self.folder / "out").rglob("*") if p.is_file()], [])

    def test_vdb(self):
        # Larger than manifest and table, smaller than a grid.
        more = ["--set", "lattice.cells=[96, 64, 24]", "--no-render", "--out"]
        self.call("run", self.scene, *more, "whole")
        small = max(self.size("whole/manifest.json"), self.size("whole/statistics.csv"))
        limit = small + 1000
        self.assertGreater(self.size("whole/density/tiny_0001.vdb"), 2 * limit)
        self.refused_at(limit, "tiny_0001.vdb", "run", self.scene, *more, "out")
        self.call("run", self.scene, *more, "out")
        self.same_runs("whole", "out")
        self.refused_at(5000, "x.vdb", "state", self.scene, "--out", "x.vdb")

    def test_frames_that_were_finished_stay(self):
        """Files grow with the clouds: a limit that some later frame is the first to pass."""
        growing = ["--set", "density.write_state=false", "--set", "field.background.act=0.0002", "--set", "field.background.ext=0",
                   "--set", "time.steps=20", "--no-render", "--out"]
        self.call("run", self.scene, *growing, "whole")
        sizes = [(self.folder / frame["density"]).stat().st_size for frame in self.listed("whole")]
        limit = 2 * max(sizes) // 3
        failed = next(n for n, size in enumerate(sizes) if size > limit)
        self.assertGreater(failed, 2)
        for threads in (1, 2):
            with self.subTest(threads=threads):
                out = f"out{threads}"
                self.refused_at(limit, f"tiny_{failed + 1:04}.vdb", "run", self.scene, *growing, out, "--threads", threads)
                self.assertEqual([frame["number"] for frame in self.listed(out)], list(range(1, failed + 1)))
                on_disk = sorted(p.name for p in (self.folder / out / "density").iterdir())
                self.assertEqual(on_disk, [f"tiny_{n:04}.vdb" for n in range(1, failed + 1)])
                self.call("run", self.scene, *growing, out)
                self.same_runs("whole", out)

    def listed(self, out):
        """The frames in a run's manifest, each of whose files is there."""
        frames = json.loads((self.folder / out / "manifest.json").read_text())["frames"]
        for frame in frames:
            frame["density"] = f"{out}/{frame['density']}"
            self.call("info", frame["density"])
        return frames

    def test_statistics(self):
        # Grids of few voxels stay small, the table of many steps does not.
        few = ["--set", "lattice.cells=[8,8,8]", "--set", "density.write_state=false", "--set", "frames.time_scale=100000",
               "--set", "time.steps=300", "--no-render", "--out", "out"]
        self.refused_at(15000, "statistics.csv", "run", self.scene, *few)
        # Whole rows or none, and the run can start again.
        text = (self.folder / "out/statistics.csv").read_text()
        self.assertTrue(text.endswith("\n"))
        self.call("run", self.scene, *few)
        self.assertGreater((self.folder / "out/statistics.csv").stat().st_size, 15000)

    def test_checkpoint(self):
        # Planes without a cloud: grids stay small, planes as bits do not.
        bare = ["--set", "field.background.act=0", "--set", "density.write_state=false", "--set", "lattice.cells=[256,256,32]",
                "--no-render", "--out", "out"]
        self.refused_at(100000, "checkpoint.nephos", "run", self.scene, *bare)
        self.assertFalse((self.folder / "out/checkpoint.nephos").exists())
        self.call("run", self.scene, *bare)

    def test_pictures(self):
        self.need_device()
        small = ["--set", "lattice.cells=[16,16,8]", "--set", "density.write_state=false", "--set", "camera.width=640",
                 "--set", "camera.height=480"]
        self.refused_at(20000, "tiny_0001.png", "run", self.scene, *small, "--out", "png")
        self.refused_at(20000, "tiny_0001.exr", "run", self.scene, *small, "--out", "exr", "--set", "frames.png=false",
                        "--set", "frames.exr=true")
        self.call("run", self.scene, *small, "--no-render", "--out", "out")
        for name in ("x.png", "x.exr"):
            self.refused_at(20000, name, "render", "out/density/tiny_0005.vdb", "--out", name)
            self.assertFalse((self.folder / name).exists())

    def test_pictures_that_were_finished_stay(self):
        """The first picture that is larger than all before it fails; those before it are as in a whole run."""
        self.need_device()
        changes = ["--set", "density.write_state=false", "--set", "camera.width=640", "--set", "camera.height=480",
                   "--set", "field.background.act=0.0002", "--set", "field.background.ext=0", "--set", "time.steps=20"]
        self.call("run", self.scene, *changes, "--out", "whole")
        names = sorted(p.name for p in (self.folder / "whole/frames").iterdir())
        sizes = [(self.folder / "whole/frames" / name).stat().st_size for name in names]
        failed = next(n for n in range(3, len(sizes)) if sizes[n] > max(sizes[:n]))
        limit = max(sizes[:failed])
        others = [p for p in (self.folder / "whole").rglob("*") if p.is_file() and p.suffix != ".png"]
        self.assertLess(max(p.stat().st_size for p in others), limit, "a picture is the first to fail")
        for threads in (1, 2):
            with self.subTest(threads=threads):
                out = self.folder / f"out{threads}"
                self.refused_at(limit, names[failed], "run", self.scene, *changes, "--out", out, "--threads", threads)
                self.assertEqual([frame["number"] for frame in json.loads((out / "manifest.json").read_text())["frames"]],
                                 list(range(1, failed + 1)))
                self.assertEqual(sorted(p.name for p in (out / "frames").iterdir()), names[:failed])
                for name in names[:failed]:
                    self.assertEqual((out / "frames" / name).read_bytes(), (self.folder / "whole/frames" / name).read_bytes())
                self.call("run", self.scene, *changes, "--out", out)
                self.same_runs("whole", out.name)

    def test_a_small_file_system(self):
        """No limit on files but a disk that is really full, where this machine lets us mount one."""
        self.need_device()
        disk = self.folder / "disk"
        disk.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", disk], capture_output=True).returncode != 0:
            self.skipTest("mounting is not allowed here")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        for kind, many in (("density", ["--no-render"]), ("frames", ["--set", "frames.png=false", "--set", "frames.exr=true"])):
            result = self.refused(3, "run", self.scene, *many, "--out", f"disk/{kind}", "--set", "time.steps=60",
                                  says="No space left on device")
            self.assertIn(f"disk/{kind}/", result.stderr)
            self.no_parts()
            frames = json.loads((disk / kind / "manifest.json").read_text())["frames"]
            self.assertGreater(len(frames), 1)
            self.assertLessEqual(len(frames), len(list((disk / kind / kind).iterdir())))
            for frame in (disk / kind / kind).iterdir():
                self.call("info", frame)
            shutil.rmtree(disk / kind)


if __name__ == "__main__":
    unittest.main(verbosity=2)
