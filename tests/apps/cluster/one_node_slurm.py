# SPDX-License-Identifier: Apache-2.0
"""A Slurm cluster of this machine alone, for tests: munged, slurmctld and slurmd of our own, with keys, sockets, ports and
state in a folder, and ended with the test. Needs root, which Slurm's node daemon does; and the packages slurm-wlm and
munge."""

import os
import pathlib
import socket
import subprocess
import time

CONFIGURATION = """\
ClusterName=nephos
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller}
SlurmdPort={node}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SwitchType=switch/none
MpiDefault=none
ProctrackType=proctrack/pgid
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,batch_sched_delay=0
ReturnToService=2
KillWait=10
MinJobAge=600
JobRequeue=1
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP OverSubscribe=NO
"""


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Slurm:
    def __init__(self, folder, cores=4):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(mode=0o755)
        for name in ("state", "spool"):
            (self.folder / name).mkdir()
        key = self.folder / "munge.key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        self.configuration = self.folder / "slurm.conf"
        # cores more than this machine has, so that tasks overlap: slurmd -N and config_overrides allow it.
        self.configuration.write_text(CONFIGURATION.format(host=socket.gethostname().split(".")[0], folder=self.folder,
                                                           controller=free_port(), node=free_port(), cores=cores)
                                      + "SlurmdParameters=config_overrides\n")
        self.environment = {**os.environ, "SLURM_CONF": str(self.configuration)}
        self.processes = []

    def start(self):
        self._start("munged", "--foreground", "--force", f"--key-file={self.folder}/munge.key",
                    f"--socket={self.folder}/munge.socket", f"--pid-file={self.folder}/munged.pid",
                    f"--log-file={self.folder}/munged.log", f"--seed-file={self.folder}/munged.seed")
        self._wait(lambda: (self.folder / "munge.socket").exists(), "munged")
        self._start("slurmctld", "-D", "-f", self.configuration)
        self._wait(lambda: self.call("scontrol", "ping").stdout.count("UP") == 1, "slurmctld")
        self._start("slurmd", "-D", "-f", self.configuration)
        self._wait(lambda: self.call("sinfo", "-h", "-o", "%T").stdout.strip() == "idle", "slurmd")
        return self

    def stop(self):
        for process in reversed(self.processes):
            process.terminate()
        for process in reversed(self.processes):
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self.processes = []

    def call(self, *arguments, cwd=None):
        return subprocess.run([str(word) for word in arguments], env=self.environment, cwd=cwd, capture_output=True,
                              text=True, timeout=600)

    def submit(self, *arguments, cwd):
        result = self.call("sbatch", "--parsable", *arguments, cwd=cwd)
        if result.returncode != 0:
            raise RuntimeError(result.stderr)
        return result.stdout.strip()

    def tasks(self, job):
        """The state of each task of a job, by its number ("" of a job without)."""
        shown = self.call("scontrol", "show", "job", job, "--oneliner").stdout
        tasks = {}
        for line in shown.splitlines():
            fields = dict(word.split("=", 1) for word in line.split() if "=" in word)
            if "JobState" in fields:
                tasks[fields.get("ArrayTaskId", "")] = fields
        return tasks

    def wait(self, job, seconds=240):
        """Waits for the end of all tasks; returns their states."""
        ended = {"COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "NODE_FAIL"}
        states = {}
        for _ in range(seconds * 5):
            states = {number: fields["JobState"] for number, fields in self.tasks(job).items()}
            if states and set(states.values()) <= ended:
                return states
            time.sleep(0.2)
        raise RuntimeError(f"job {job} did not end: {states}\n{self.logs()}")

    def logs(self):
        return "\n".join(f"{path.name}:\n{path.read_text()[-2000:]}" for path in sorted(self.folder.glob("*.log")))

    def _start(self, *arguments):
        with open(self.folder / f"{arguments[0]}.out", "wb") as output:
            self.processes.append(subprocess.Popen([str(word) for word in arguments], env=self.environment, stdout=output,
                                                   stderr=subprocess.STDOUT, start_new_session=True))

    def _wait(self, ready, name):
        for _ in range(3000):
            if ready():
                return
            if self.processes[-1].poll() is not None:
                break
            time.sleep(0.2)
        output = (self.folder / f"{name}.out").read_text()
        self.stop()
        raise RuntimeError(f"{name} did not start:\n{output}\n{self.logs()}")
