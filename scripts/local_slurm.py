"""A Slurm of one node on this machine, for tests: munged, slurmctld and slurmd of Debian's packages, as root, all of their
files in a folder of their own. Its partition is called `local`, its node has as many processors as are said."""

import os
import pathlib
import secrets
import shutil
import socket
import subprocess
import time

PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue", "scontrol", "scancel")
PATIENCE_S = 40

CONFIGURATION = """
ClusterName=drill
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={control_port}
SlurmdPort={node_port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket={folder}/munge/socket
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
MpiDefault=none
SwitchType=switch/none
ReturnToService=2
SchedulerType=sched/backfill
SchedulerParameters=batch_sched_delay=1,sched_interval=2,bf_interval=2
SelectType=select/cons_tres
SelectTypeParameters=CR_Core_Memory
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SlurmdParameters=config_overrides
KillWait=5
MinJobAge=600
InactiveLimit=0
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} RealMemory={memory} State=UNKNOWN
PartitionName=local Nodes={host} Default=YES MaxTime=INFINITE State=UP OverTimeLimit=0
"""


def missing():
    """What of Slurm this machine lacks; empty where all is there."""
    path = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
    lacking = [name for name in PROGRAMS if shutil.which(name, path=path) is None]
    return lacking + ([] if os.geteuid() == 0 else ["root"])


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class LocalSlurm:
    """with LocalSlurm(folder, cores) as slurm: slurm.environment has what clients need."""

    def __init__(self, folder, cores=2, memory=4000):
        self.folder, self.daemons = pathlib.Path(folder), []
        self.host = socket.gethostname().split(".")[0]
        self.values = {"host": self.host, "folder": self.folder, "cores": cores, "memory": memory,
                       "control_port": free_port(), "node_port": free_port()}
        self.environment = {**os.environ, "SLURM_CONF": str(self.folder / "slurm.conf"),
                            "PATH": os.environ.get("PATH", "") + ":/usr/sbin:/sbin"}

    def start(self, name, command):
        log = open(self.folder / f"{name}.out", "w", encoding="utf-8")
        self.daemons.append((name, subprocess.Popen(command, stdout=log, stderr=log, env=self.environment)))

    def __enter__(self):
        for name in ("munge", "state", "spool"):
            (self.folder / name).mkdir(parents=True, mode=0o700)
        os.chmod(self.folder / "munge", 0o711)
        os.chmod(self.folder, 0o755)
        key = self.folder / "munge" / "key"
        key.touch(mode=0o600)
        key.write_bytes(secrets.token_bytes(1024))
        (self.folder / "slurm.conf").write_text(CONFIGURATION.format(**self.values), encoding="utf-8")
        place = str(self.folder / "munge")
        try:
            self.start("munged", ["munged", "--foreground", "--force", f"--key-file={key}", f"--socket={place}/socket",
                                  f"--pid-file={place}/pid", f"--log-file={place}/log", f"--seed-file={place}/seed"])
            self.wait_for(lambda: (self.folder / "munge" / "socket").exists(), "munged")
            self.start("slurmctld", ["slurmctld", "-D", "-i"])
            self.start("slurmd", ["slurmd", "-D", "-N", self.host])
            self.wait_for(lambda: "idle" in self.say("sinfo", "--noheader", "--format=%T"), "the node")
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        self.say("scancel", "--user=root")
        for name, daemon in reversed(self.daemons):
            daemon.terminate()
            try:
                daemon.wait(15)
            except subprocess.TimeoutExpired:
                daemon.kill()
                daemon.wait()

    def say(self, *command):
        done = subprocess.run(command, capture_output=True, text=True, env=self.environment)
        return done.stdout

    def wait_for(self, there, what):
        until = time.time() + PATIENCE_S
        while time.time() < until:
            if there():
                return
            time.sleep(0.2)
        logs = "".join((self.folder / name).read_text(errors="replace")[-1500:]
                       for name in ("munged.out", "slurmctld.out", "slurmd.out") if (self.folder / name).exists())
        raise RuntimeError(f"{what} of the local Slurm is not up after {PATIENCE_S} s: {logs}")

    def drain(self):
        self.say("scontrol", "update", f"nodename={self.host}", "state=drain", "reason=drill")

    def resume(self):
        self.say("scontrol", "update", f"nodename={self.host}", "state=resume")
