# SPDX-License-Identifier: Apache-2.0
"""Pictures of `nephos run` and `nephos render`, and devices that are missing or lost."""

import json
import os
import pathlib
import shutil
import signal
import struct
import subprocess
import time
import unittest

from PIL import Image

from case import NEPHOS, PATIENCE, SCENE, SOURCE, Case, unsealed


class Vulkan(Case):
    """Without a device, whatever this machine has."""

    NONE = {"VK_ICD_FILENAMES": "/nonexistent", "VK_DRIVER_FILES": "/nonexistent"}

    def without_loader(self):
        """An environment in which no libvulkan.so.1 can be opened."""
        if "NO_LOADER" not in os.environ:
            self.skipTest("NO_LOADER does not say where the library lies that hides the loader")
        sanitizer = os.environ.get("LD_PRELOAD", "")
        return {"LD_PRELOAD": f"{sanitizer} {os.environ['NO_LOADER']}".strip()}

    def test_the_processor_draws_without_a_driver_and_without_a_loader(self):
        self.call("run", self.scene, "--splatting", "cpu", "--out", "whole")
        for name, env in (("driver", self.NONE), ("loader", self.without_loader())):
            for splatting in ("auto", "cpu"):
                out = f"{name}_{splatting}"
                result = self.call("run", self.scene, "--splatting", splatting, "--out", out, "--json", env=env)
                self.assertEqual(result.stderr, "")
                report = json.loads(result.stdout)
                self.assertEqual(report["backend"], "cpu")
                self.assertTrue(report["device"].startswith("cpu ("), report["device"])
                self.assertEqual(len(report["files"]["png"]), 5)
                for picture in report["files"]["png"]:
                    self.assertEqual((self.folder / picture).read_bytes(),
                                     (self.folder / "whole/frames" / pathlib.Path(picture).name).read_bytes())
                timing = json.loads((self.folder / out / "manifest.json").read_text())["timing"]
                self.assertEqual((timing["backend"], timing["device"]), ("cpu", report["device"]))
            self.call("render", "whole/density/tiny_0005.vdb", "--out", f"{name}.png", env=env)

    def test_a_device_that_is_asked_for_and_missing_is_status_4_and_says_what_to_install(self):
        self.call("run", self.scene, "--no-render", "--out", "out", env=self.NONE)
        render = ["render", "out/density/tiny_0005.vdb", "--out", "x.png", "--quiet"]
        for env in (self.NONE, self.without_loader()):
            for wish in (["--splatting", "vulkan"], ["--splatting", "blended"], ["--device", "llvmpipe"]):
                for arguments in (["run", self.scene, "--out", "other", *wish], [*render, *wish]):
                    result = self.refused(4, *arguments, says="mesa-vulkan-drivers", env=env)
                    self.assertNotIn("unexpected", result.stderr)
            self.refused(4, "run", self.scene, "--out", "other", "--set", 'frames.splatting="blended"',
                         says="mesa-vulkan-drivers", env=env)
            self.refused(4, *render, says="mesa-vulkan-drivers", env={**env, "NEPHOS_DEVICE": "llvmpipe"})
        self.assertFalse((self.folder / "other").exists(), "nothing was done")
        self.assertFalse((self.folder / "x.png").exists())

    def test_back_ends_that_contradict_each_other(self):
        self.refused(2, "run", self.scene, "--splatting", "gpu", says="one of auto, cpu, vulkan and blended")
        self.refused(2, "run", self.scene, "--splatting", "cpu", "--device", "llvmpipe",
                     says='uses no Vulkan device, but "llvmpipe" is asked for')
        result = self.call("validate", self.scene, "--set", 'frames.splatting="cpu"', "--set", 'frames.device="x"', status=2)
        self.assertIn("uses no Vulkan device", result.stderr)

    def test_a_missing_ffmpeg_is_found_before_anything_is_computed(self):
        video = self.write("video.toml", SCENE.replace("[frames]", "[frames]\nvideo = true"))
        for arguments in ([self.scene, "--video"], [video], [self.scene, "--set", "frames.video=true"]):
            # Not even a device is looked for.
            self.refused(3, "run", *arguments, "--out", "out", says="install the package ffmpeg",
                         env={**self.NONE, "PATH": str(self.folder)})
            self.assertFalse((self.folder / "out").exists(), "nothing was done")
        self.call("run", video, "--no-render", "--out", "out", env={**self.NONE, "PATH": str(self.folder)})

    def test_a_scene_without_pictures_needs_no_device(self):
        self.call("run", self.scene, "--set", "frames.png=false", env=self.NONE)


class LostDevice(Case):
    """A graphics card that is lost while it draws (lost_device_layer.cpp): exit status 4, and finished frames stay."""

    def setUp(self):
        super().setUp()
        if "LAYERS" not in os.environ:
            self.skipTest("LAYERS does not say where the layer lies")

    def lost_after(self, submissions=10**9, waits=10**9):
        return {"VK_LAYER_PATH": os.environ["LAYERS"], "VK_INSTANCE_LAYERS": "VK_LAYER_NEPHOS_lost_device",
                "NEPHOS_LOSE_DEVICE_AFTER": str(submissions), "NEPHOS_LOSE_WAIT_AFTER": str(waits)}

    def test_a_run_keeps_its_finished_frames_and_goes_on_with_another(self):
        never = self.lost_after()
        self.call("run", self.scene, "--out", "whole", env=never)
        numbers = set()
        for what, count in [("submissions", n) for n in (0, 1, 3, 6, 10, 14)] + [("waits", n) for n in (0, 3, 6, 10)]:
            with self.subTest(what, count=count):
                out = self.folder / f"{what}{count}"
                result = self.refused(4, "run", self.scene, "--out", out, says="ErrorDeviceLost",
                                      env=self.lost_after(**{what: count}))
                self.assertNotIn("unexpected", result.stderr)
                self.assertEqual([p for p in self.folder.rglob("*") if ".part" in p.name], [])
                frames = json.loads((out / "manifest.json").read_text())["frames"]
                numbers.add(len(frames))
                self.assertEqual([frame["number"] for frame in frames], list(range(1, len(frames) + 1)))
                for picture in (out / "frames").glob("*.png"):
                    self.assertEqual(picture.read_bytes(), (self.folder / "whole/frames" / picture.name).read_bytes())
                self.assertEqual(len(list((out / "frames").glob("*.png"))), len(frames))
                self.call("run", self.scene, "--out", out, env=never)
                self.same_runs("whole", out.name)
        self.assertGreater(len(numbers), 2, "it is lost at several frames")

    def test_render_writes_nothing(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        for submissions in (0, 2):
            self.refused(4, "render", "out/density/tiny_0005.vdb", "--out", "x.png", "--scene", self.scene, says="ErrorDeviceLost",
                         env=self.lost_after(submissions))
            self.assertFalse((self.folder / "x.png").exists())


def png_pixels(path):
    """The samples of a picture as bytes: red, green and blue of each pixel, row after row from the top."""
    with Image.open(path) as picture:
        return picture.convert("RGB").tobytes()


class Pictures(Case):
    """With a device (lavapipe at least)."""

    def test_run_draws_every_frame(self):
        result = json.loads(self.call("run", self.scene, "--out", "out", "--set", "frames.exr=true", "--json").stdout)
        self.assertEqual(len(result["files"]["png"]), 5)
        self.assertEqual(len(result["files"]["exr"]), 5)
        info = json.loads(self.call("info", "--json", result["files"]["exr"][4]).stdout)
        self.assertEqual(info["kind"], "exr")
        self.assertEqual((info["parts"][0]["width"], info["parts"][0]["height"]), (64, 48))
        self.assertTrue(all(part["complete"] for part in info["parts"]))
        film = info["parts"][0]["attributes"]
        self.assertEqual((film["framesPerSecond"], film["timeScale"]), ("1000/1000", "15"))
        png = (self.folder / result["files"]["png"][4]).read_bytes()
        self.assertEqual(png[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(struct.unpack(">II", png[16:24]), (64, 48))
        self.assertNotEqual(png, (self.folder / result["files"]["png"][0]).read_bytes())

    def test_every_back_end_can_be_asked_for_and_says_its_name(self):
        pixels = {}
        for splatting in ("cpu", "vulkan", "blended"):
            out = self.folder / splatting
            options = ["--splatting", splatting] if splatting != "vulkan" else ["--set", 'frames.splatting="vulkan"']
            options += ["--set", "detail.enabled=false"]  # which `blended` has not
            result = self.call("run", self.scene, *options, "--out", out, "--set", "frames.exr=true", "--json")
            report = json.loads(result.stdout)
            self.assertEqual(report["backend"], splatting)
            timing = json.loads((out / "manifest.json").read_text())["timing"]
            self.assertEqual((timing["backend"], timing["device"]), (splatting, report["device"]))
            exr = json.loads(self.call("info", "--json", report["files"]["exr"][4]).stdout)["parts"][0]["attributes"]
            self.assertEqual(exr["backend"], splatting)
            self.assertEqual(exr.get("device"), None if splatting == "cpu" else report["device"])
            render = json.loads(self.call("render", out / "density/tiny_0005.vdb", "--out", out / "x.png", "--json",
                                          *options[:2 if splatting != "vulkan" else 0]).stdout)
            if splatting != "vulkan":
                self.assertEqual((render["backend"], render["device"]), (splatting, report["device"]))
            pixels[splatting] = png_pixels(out / "frames/tiny_0005.png")
        for splatting in ("vulkan", "blended"):
            self.assertLessEqual(max(abs(a - b) for a, b in zip(pixels["cpu"], pixels[splatting])), 1)

    def test_interrupted_pictures_are_the_same(self):
        changes = ["--set", "time.steps=40", "--set", "frames.time_scale=20", "--set", "frames.exr=true"]
        if shutil.which("ffmpeg"):
            changes.append("--video")  # frames of before the interruption are read back for it
        self.call("run", self.scene, *changes, "--out", "whole")
        process = subprocess.Popen([NEPHOS, "run", self.scene, *changes, "--out", "stopped"], cwd=self.folder,
                                   env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        end = time.monotonic() + PATIENCE
        while not (self.folder / "stopped/frames/tiny_0003.png").exists():
            self.assertLess(time.monotonic(), end)
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.wait(timeout=PATIENCE), 130)
        self.call("run", self.scene, *changes, "--out", "stopped", "--resume")
        self.same_runs("whole", "stopped")
        for name in sorted(p.name for p in (self.folder / "whole/frames").iterdir()):
            self.assertEqual((self.folder / "whole/frames" / name).read_bytes(),
                             (self.folder / "stopped/frames" / name).read_bytes(), name)

    def test_render_with_a_scene_draws_the_runs_frame(self):
        """Rain, wet ground and clouds included, at the time of the file."""
        for name in ("rain", "wet-ground"):
            scene = SOURCE / f"scenes/{name}.toml"
            changes = ["--set", "camera.width=80", "--set", "camera.height=60", "--set", "detail.enabled=false"]
            self.call("run", scene, *changes, "--frames", "3", "--out", name)
            self.call("render", f"{name}/density/{name}_0003.vdb", "--scene", scene, *changes, "--out", f"{name}.png")
            self.assertEqual(png_pixels(self.folder / f"{name}.png"),
                             png_pixels(self.folder / f"{name}/frames/{name}_0003.png"), name)
            dry = ["--set", "precipitation.enabled=false", "--set", "wet_ground.enabled=false"]
            self.call("render", f"{name}/density/{name}_0003.vdb", "--scene", scene, *changes, *dry, "--out", "dry.png")
            self.assertNotEqual(png_pixels(self.folder / "dry.png"), png_pixels(self.folder / f"{name}.png"), name)

    def test_render_draws_what_run_wrote(self):
        self.call("run", self.scene, "--no-render", "--out", "out")
        volume = "out/density/tiny_0005.vdb"
        self.call("render", volume, "--out", "a.png", "--out", "a.exr", "--size", "80x60")
        info = json.loads(self.call("info", "--json", "a.exr").stdout)
        self.assertEqual(info["parts"][0]["width"], 80)
        result = json.loads(self.call("render", volume, "--out", "b.png", "--scene", self.scene, "--json").stdout)
        self.assertEqual((result["width"], result["height"]), (64, 48))
        self.assertEqual(result["extinction_per_m"], 0.02)
        below = json.loads(self.call("render", volume, "--out", "c.png", "--view", "below", "--size", "32x32",
                                     "--camera", "-10,-200,5", "--json").stdout)
        self.assertEqual(below["camera_m"], [-10, -200, 5])
        views = [self.call("render", volume, "--out", "d.png", "--scene", self.scene, *words, "--json").stdout
                 for words in ([], ["--view", "side"], ["--view", "above"])]
        self.assertEqual(len({str(json.loads(view)["camera_m"]) for view in views}), 3)

    def test_pictures_of_run_and_render_agree(self):
        """Without detail, whose growth is not in a file."""
        smooth = ["--set", "detail.enabled=false"]
        self.call("run", self.scene, *smooth, "--out", "out")
        self.call("render", "out/density/tiny_0005.vdb", "--scene", self.scene, *smooth, "--out", "again.png")
        a, b = [png_pixels(self.folder / p) for p in ("out/frames/tiny_0005.png", "again.png")]
        self.assertEqual(a, b)

    def test_fog_has_drifted_as_far_in_render_as_in_run(self):
        """Fog is a function of time, which stands in the file."""
        drifting = ["fog.extinction_per_m=0.01", "fog.height_m=100", "fog.patchiness=1", "fog.patch_m=200",
                    "fog.velocity_m_per_s=[40,9,0]", "shells.spacing_m=40", "time.step_s=10", "frames.time_scale=10",
                    "detail.enabled=false"]  # whose growth is not in a file
        changes = [word for change in drifting for word in ("--set", change)]
        self.call("run", self.scene, *changes, "--out", "out")
        pictures = []
        for number in (1, 6):
            file = f"tiny_{number:04}"
            self.call("render", f"out/density/{file}.vdb", "--scene", self.scene, *changes, "--out", f"{file}.png")
            pictures.append(png_pixels(self.folder / f"{file}.png"))
            self.assertEqual(pictures[-1], png_pixels(self.folder / f"out/frames/{file}.png"), file)
        still = [word for change in drifting if "velocity" not in change for word in ("--set", change)]
        self.call("render", "out/density/tiny_0006.vdb", "--scene", self.scene, *still, "--set", "fog.velocity_m_per_s=[0,0,0]",
                  "--out", "still.png")
        differences = [abs(x - y) for x, y in zip(pictures[1], png_pixels(self.folder / "still.png"))]
        self.assertGreater(max(differences), 10, "the fog drifts")

    def test_refined_grids_look_as_the_runs_own_picture(self):
        """They have the detail that the run drew: rays march through their voxels as they are. Without detail they are
        drawn with metaballs of the same size, whose radius is in cells."""
        changes = ["--set", "density.refine=2", "--set", "density.metaball_radius_cells=2.5", "--set", "lattice.cells=[48,32,24]"]
        self.call("run", self.scene, *changes, "--out", "out")
        result = self.call("render", "out/density/tiny_0005.vdb", "--scene", self.scene, *changes, "--out", "again.png",
                           "--json")
        self.assertEqual(json.loads(result.stdout)["metaball_radius_voxels"], 1)
        smooth = self.call("render", "out/density/tiny_0005.vdb", "--scene", self.scene, *changes, "--set",
                           "detail.enabled=false", "--out", "smooth.png", "--json")
        self.assertEqual(json.loads(smooth.stdout)["metaball_radius_voxels"], 5)
        a, b = [png_pixels(self.folder / p) for p in ("out/frames/tiny_0005.png", "again.png")]
        differences = sorted(abs(x - y) for x, y in zip(a, b))
        self.assertLess(sum(differences) / len(differences), 4)  # edges are as wide as its voxels

    def test_foreign_volumes_are_drawn(self):
        import pyopenvdb
        grid = pyopenvdb.FloatGrid()
        grid.name = "smoke"
        grid.transform = pyopenvdb.createLinearTransform(0.05)
        grid.fill((-10, -10, -10), (10, 10, 10), 0.7)
        pyopenvdb.write(str(self.folder / "foreign.vdb"), [grid])
        for up in ("y", "z"):
            result = self.call("render", "foreign.vdb", "--up", up, "--out", f"{up}.png", "--size", "64x64")
            self.assertIn("extinction", result.stderr)
            pixels = png_pixels(self.folder / f"{up}.png")
            self.assertGreater(len(set(pixels)), 20, "something is in the picture")
        middle = 3 * (64 * 32 + 32)
        self.assertNotEqual(pixels[middle:middle + 3], pixels[:3])

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_video(self):
        self.call("run", self.scene, "--out", "out", "--video")
        self.assertGreater((self.folder / "out/frames/tiny.mp4").stat().st_size, 500)

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_a_signal_while_ffmpeg_hangs(self):
        """One is enough; and how ffmpeg ended is known also to a command that was told to ignore how children end."""
        hanging = self.folder / "hanging"
        hanging.mkdir()
        environment = {**self.environment, "PATH": f"{hanging}:{os.environ['PATH']}"}
        command = [NEPHOS, "run", self.scene, "--video", "--splatting", "cpu", "--set", "camera.width=400", "--set", "camera.height=400",
                   "--out", "out", "-q"]
        # At the end, and on the way: a frame of 480 kB does not fit into what waits for it.
        for number, reads in ((signal.SIGINT, "cat > /dev/null"), (signal.SIGTERM, ":")):
            (hanging / "ffmpeg").write_text(f"#!/bin/sh\n{reads}; touch taken; exec sleep 60\n")
            (hanging / "ffmpeg").chmod(0o700)
            process = subprocess.Popen(command, cwd=self.folder, env=environment)
            while not (self.folder / "taken").exists():
                self.assertIsNone(process.poll())
                time.sleep(0.05)
            process.send_signal(number)
            self.assertEqual(process.wait(timeout=PATIENCE), 128 + number)
            (self.folder / "taken").unlink()
            command.append("--resume")
        (hanging / "ffmpeg").write_text(f"#!/bin/sh\n{shutil.which('ffmpeg')} \"$@\"; exit 1\n")
        ignoring = subprocess.run(command, cwd=self.folder, env=environment, capture_output=True, text=True,
                                  preexec_fn=lambda: signal.signal(signal.SIGCHLD, signal.SIG_IGN))
        self.assertEqual(ignoring.returncode, 3, ignoring.stderr)
        self.call(*command[1:])
        self.call("verify", "out")

    def failing_ffmpeg(self):
        """The environment of a call whose ffmpeg fails."""
        broken = self.folder / "broken"
        broken.mkdir()
        (broken / "ffmpeg").write_text("#!/bin/sh\necho 'disk full' >&2\nexit 3\n")
        (broken / "ffmpeg").chmod(0o700)
        return {"PATH": f"{broken}:{os.environ['PATH']}"}

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_a_video_that_failed_is_made_by_resuming(self):
        """A failing ffmpeg does not end the run; nor does a run that goes on with more steps keep the old video."""
        self.refused(3, "run", self.scene, "--video", "--out", "out", "--quiet", says="disk full", env=self.failing_ffmpeg())
        self.assertEqual(len(list((self.folder / "out/frames").iterdir())), 5, "pictures and no video")
        video = self.folder / "out/frames/tiny.mp4"
        for steps in (6, 9):
            change = ["--set", f"time.steps={steps}"]
            self.call("run", self.scene, "--video", "--out", "out", "--resume", *change)
            self.call("run", self.scene, "--video", "--out", f"whole{steps}", *change)
            self.assertEqual(video.read_bytes(), (self.folder / f"whole{steps}/frames/tiny.mp4").read_bytes())

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_a_video_of_the_users_is_kept_by_a_run_that_goes_on(self):
        """One that another program made of the frames so far: a run knows its own by what it names."""
        call = ("run", self.scene, "--video", "--splatting", "cpu", "--out", "out", "-q")
        self.refused(3, *call, says="ffmpeg", env=self.failing_ffmpeg())
        video, manifest = self.folder / "out/frames/tiny.mp4", self.folder / "out/manifest.json"
        checkpoint = self.folder / "out/checkpoint.nephos"
        for content in (b"mine", b""):
            video.write_bytes(content)
            self.refused(2, *call, "--resume", says="tiny.mp4: is of another run, or of none, and has the place of the video of this one")
            self.assertEqual(video.read_bytes(), content)
        began = checkpoint.read_bytes()
        checkpoint.unlink()  # as killed before the first
        self.refused(2, *call, says="frames/tiny.mp4 is not what the run in it has written")
        self.assertEqual(video.read_bytes(), b"")
        checkpoint.write_bytes(began)
        video.unlink()
        self.call(*call, "--resume")
        self.call("verify", "out")
        own = video.read_bytes()
        # One that is put into a complete run is not listed by one that goes on without a frame.
        video.write_bytes(b"mine")
        longer = ("--set", "time.steps=7")
        self.refused(2, *call, "--resume", *longer, says="tiny.mp4: would be replaced by the video of the run, which has not written it")
        self.assertEqual(video.read_bytes(), b"mine")
        video.write_bytes(own)
        # Killed between the video and the manifest that says so: its own stays.
        manifest.write_text(unsealed({**json.loads(manifest.read_text()), "complete": False}))
        checkpoint.write_bytes(began)
        written = video.stat().st_mtime_ns
        self.call(*call, "--resume")
        self.assertEqual((video.read_bytes(), video.stat().st_mtime_ns), (own, written))
        self.call("verify", "out")

    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_a_rate_that_no_video_has_is_refused_before_the_run(self):
        self.refused(2, "run", self.scene, "--video", "--splatting", "cpu", "--out", "slow", "--set", "frames.per_second=1e-7",
                     "--set", "frames.time_scale=1e-7", says="`frames.per_second` is 1e-07: a video has at least 5e-05")
        self.assertFalse((self.folder / "slow").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
