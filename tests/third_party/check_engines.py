"""Engines that run many tasks drive the parts of a surface: GNU parallel, Slurm and Dask.

check_engines.py ISOBRICK ENGINE. Exit code 77: the engine is not installed or cannot run here.
"""
import contextlib
import os
import pathlib
import secrets
import shutil
import socket
import subprocess
import sys
import tempfile
import time

PARTS = 5


class Work:
    """A store, the pieces of its surface and the mesh of one command."""

    def __init__(self, isobrick, folder):
        self.isobrick = isobrick
        self.folder = folder
        self.store = folder / "g.zarr"
        self.run("synth", "gyroid", self.store, "--dims", "120,110,100", "--type", "u8")
        self.run("extract", self.store, "--isovalue", "120", "-o", folder / "one.ply")

    def run(self, *words):
        subprocess.run([str(word) for word in (self.isobrick, *words)], check=True,
                       stdout=subprocess.DEVNULL)

    def piece(self, number):
        return self.folder / f"p_{number}of{PARTS}.piece"

    def part(self, number):
        """The words of a task, `number` may be a variable of the engine's."""
        return [str(self.isobrick), "extract", str(self.store), "--isovalue", "120", "--threads",
                "1", "--part", f"{number}/{PARTS}", "-o", str(self.piece(number))]

    def is_same(self):
        self.run("merge", *(self.piece(i) for i in range(1, PARTS + 1)), "-o",
                 self.folder / "parts.ply")
        return (self.folder / "one.ply").read_bytes() == (self.folder / "parts.ply").read_bytes()


def run_parallel(work):
    if not shutil.which("parallel"):
        return False
    subprocess.run(["parallel", "-j", "2", *work.part("{}"), ":::",
                    *(str(i) for i in range(1, PARTS + 1))],
                   check=True, stdout=subprocess.DEVNULL)
    return True


def run_dask(work):
    try:
        from distributed import Client
    except ImportError:
        return False
    client = Client(n_workers=2, threads_per_worker=1, dashboard_address=None)
    tasks = [client.submit(subprocess.run, work.part(i), check=True, stdout=subprocess.DEVNULL)
             for i in range(1, PARTS + 1)]
    client.gather(tasks)
    client.close()
    return True


def free_port():
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def slurm_configuration(folder, host):
    """A cluster of this machine alone, with all of its files in `folder`."""
    return f"""ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.sock
CredType=cred/munge
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
MpiDefault=none
SchedulerType=sched/builtin
ReturnToService=2
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
NodeName={host} NodeAddr=127.0.0.1 CPUs={os.cpu_count()} State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


@contextlib.contextmanager
def daemon(*words, log):
    """A process that runs in the foreground, ended afterwards."""
    with open(log, "wb") as out:
        process = subprocess.Popen(words, stdout=out, stderr=out)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def wait_until_idle(seconds):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        state = subprocess.run(["sinfo", "-h", "-o", "%T"], capture_output=True, text=True,
                               timeout=60)
        if state.stdout.strip() == "idle":
            return True
        time.sleep(0.2)
    return False


def run_array(work):
    script = work.folder / "surface.sbatch"
    task = " ".join(f"'{word}'" if "$" not in word else f'"{word}"'
                    for word in work.part("${SLURM_ARRAY_TASK_ID}"))
    script.write_text(f"#!/bin/bash\n#SBATCH --array=1-{PARTS}\n{task}\n")
    subprocess.run(["sbatch", "--wait", "--output", f"{work.folder}/%a.out", str(script)],
                   check=True, stdout=subprocess.DEVNULL, timeout=300)


def run_slurm(work):
    daemons = ["munged", "slurmctld", "slurmd"]
    path = f"{os.environ['PATH']}:/usr/sbin"
    if os.geteuid() != 0 or not all(shutil.which(name, path=path) for name in daemons + ["sbatch"]):
        return False
    folder = work.folder / "slurm"
    folder.mkdir(mode=0o700)
    (folder / "state").mkdir()
    (folder / "spool").mkdir()
    key = folder / "munge.key"
    key.write_bytes(secrets.token_bytes(1024))
    key.chmod(0o400)
    host = socket.gethostname().split(".")[0]
    (folder / "slurm.conf").write_text(slurm_configuration(folder, host))
    os.environ["SLURM_CONF"] = str(folder / "slurm.conf")
    os.environ["PATH"] = path
    munge = ["munged", "--foreground", "--force", f"--key-file={key}",
             f"--socket={folder}/munge.sock", f"--pid-file={folder}/munge.pid",
             f"--log-file={folder}/munge.log", f"--seed-file={folder}/munge.seed"]
    with daemon(*munge, log=folder / "munge.out"), \
            daemon("slurmctld", "-D", log=folder / "slurmctld.out"), \
            daemon("slurmd", "-D", log=folder / "slurmd.out"):
        if not wait_until_idle(60):  # a container may not let it
            return False
        run_array(work)
    return True


def main():
    isobrick = pathlib.Path(sys.argv[1]).resolve()
    engine = {"parallel": run_parallel, "slurm": run_slurm, "dask": run_dask}[sys.argv[2]]
    with tempfile.TemporaryDirectory() as folder:
        work = Work(isobrick, pathlib.Path(folder))
        if not engine(work):
            print(f"{sys.argv[2]} is not here")
            return 77
        if not work.is_same():
            print("the merged mesh is another")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
