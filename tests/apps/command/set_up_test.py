# SPDX-License-Identifier: Apache-2.0
"""The scripts that build and start the command: ./run and what it installs."""

import os
import pathlib
import shutil
import stat
import subprocess
import unittest

from case import NEPHOS, PATIENCE, SCENE, SOURCE, Case


class SetUp(Case):
    """apps/setup.sh with stand-ins for the system's commands: what it would install, and how."""

    def stand_in(self, name, body):
        path = pathlib.Path(self.write(f"bin/{name}", f"#!/bin/bash\n{body}\n"))
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    def install(self, groups, *, missing, root_user=True, sudo=True):
        installed = [line.split()[1] for line in (SOURCE / "packages.txt").read_text().splitlines()
                     if line and not line.startswith("#")]
        installed = [name for name in installed if name not in missing]
        # As the real one: a package that it does not know makes the status 1.
        self.stand_in("dpkg-query", f"printf 'installed %s\\n' {' '.join(installed)}\nexit {int(bool(missing))}")
        self.stand_in("apt-get", f'printf "%s\\n" "$DEBIAN_FRONTEND $*" >> "{self.folder}/apt.log"')
        self.stand_in("id", f"echo {0 if root_user else 1000}")
        self.stand_in("sudo", 'test "$1" = -n && shift && exec "$@"' if sudo else "exit 1")
        script = f'set -euo pipefail; root="{SOURCE}"; . "{SOURCE}/apps/setup.sh"; install_packages {groups}'
        result = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=PATIENCE,
                                env={**self.environment, "PATH": f"{self.folder}/bin:{os.environ['PATH']}"})
        log = self.folder / "apt.log"
        calls = log.read_text().splitlines() if log.exists() else []
        return result, calls

    def test_missing_packages_are_listed_and_installed_once(self):
        result, calls = self.install("build vulkan", missing=["cmake", "mesa-vulkan-drivers", "openexr"])
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("  cmake\n  mesa-vulkan-drivers\n", result.stderr)
        self.assertEqual(len(calls), 2)
        self.assertTrue(calls[0].endswith("update"))
        self.assertTrue(calls[1].endswith("install --no-install-recommends cmake mesa-vulkan-drivers"), calls[1])
        self.assertTrue(all(call.startswith("noninteractive ") for call in calls))
        self.assertEqual(result.stdout, "")

    def test_what_a_run_needs(self):
        video = self.write("video.toml", SCENE.replace("[frames]", "[frames]\nvideo = true"))
        for arguments, needs in (([self.scene], ""), ([video], "ffmpeg\n"), ([video, "--no-render"], ""),
                                 ([self.scene, "--splatting", "vulkan"], "vulkan\n"),
                                 ([self.scene, "--device", "llvmpipe"], "vulkan\n"),
                                 ([self.scene, "--video", "--splatting", "blended"], "vulkan\nffmpeg\n"),
                                 ([self.scene, "--set", 'frames.splatting="vulkan"'], "vulkan\n"),
                                 ([self.scene, "--set", "frames.video=true"], "ffmpeg\n"),
                                 ([video, "--set", "frames.enabled=false"], ""),
                                 ([self.scene, "--set", "frames.png=false"], "")):
            self.assertEqual(self.call("run", *arguments, "--needs").stdout, needs)
        self.assertFalse((self.folder / "out").exists(), "nothing was done")

    def test_run_installs_what_a_run_asks_for(self):
        # A tree that is built already, whose command tells what it was called with.
        for name in ("run", "apps/setup.sh", "packages.txt"):
            (self.folder / name).parent.mkdir(exist_ok=True)
            shutil.copy(SOURCE / name, self.folder / name)
        video = self.write("a scene.toml", SCENE.replace("[frames]", "[frames]\nvideo = true"))
        self.write("CMakePresets.json", "")
        self.write("build/release/CMakeCache.txt", f"CMAKE_HOME_DIRECTORY:INTERNAL={self.folder}\n")
        self.write("build/release/build.ninja", "")
        nephos = pathlib.Path(self.write("build/release/bin/nephos", f"""#!/bin/bash
            case "$*" in *--needs*) exec '{NEPHOS}' "$@" ;; esac
            printf '<%s>' "$@"
        """))
        nephos.chmod(0o755)
        self.stand_in("ninja", "echo 'ninja: no work to do.'")
        self.stand_in("dpkg-query", "sed -n 's/^[a-z]\\+ \\+\\([^ ]*\\).*/installed \\1/p' packages.txt | grep -v -e ffmpeg -e mesa; exit 1")
        self.stand_in("apt-get", f'echo "$*" >> "{self.folder}/apt.log"')
        self.stand_in("id", "echo 0")
        card = bool(list(pathlib.Path("/dev").glob("dri/renderD*")))
        for arguments, ffmpeg, driver in (
                ([self.scene], False, card), ([self.scene, "--video"], True, card), ([video], True, card),
                ([video, "--no-render"], False, card), ([self.scene, "--set", "frames.video=true"], True, card),
                ([self.scene, "--splatting", "vulkan"], False, True), (["no.toml"], False, card)):
            log = self.folder / "apt.log"
            log.unlink(missing_ok=True)
            result = subprocess.run(["./run", *arguments], cwd=self.folder, capture_output=True, text=True, timeout=PATIENCE,
                                    env={**self.environment, "PATH": f"{self.folder}/bin:{os.environ['PATH']}"})
            self.assertEqual(result.stdout, "".join(f"<{a}>" for a in ["run", *arguments]), result.stderr)
            installed = log.read_text() if log.exists() else ""
            self.assertEqual("install --no-install-recommends ffmpeg" in installed, ffmpeg, arguments)
            self.assertEqual("install --no-install-recommends mesa-vulkan-drivers" in installed, driver, arguments)

    def test_nothing_to_do_says_nothing(self):
        result, calls = self.install("build vulkan test bench", missing=[])
        self.assertEqual((result.returncode, result.stderr, result.stdout, calls), (0, "", "", []))

    def test_sudo_without_a_password_or_a_command_to_copy(self):
        result, calls = self.install("build", missing=["cmake"], root_user=False)
        self.assertEqual((result.returncode, len(calls)), (0, 2), result.stderr)
        (self.folder / "apt.log").unlink()
        result, calls = self.install("build", missing=["cmake"], root_user=False, sudo=False)
        self.assertEqual((result.returncode, calls), (3, []))
        self.assertIn("sudo apt-get install --no-install-recommends cmake", result.stderr.replace("update && ", ""))


if __name__ == "__main__":
    unittest.main(verbosity=2)
