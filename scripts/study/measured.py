"""Runs a program and tells what it took.

The program is started by this file as a small process of its own, because Linux counts the peak memory of whoever
started a program as the program's.
"""

import json
import os
import pathlib
import subprocess
import sys
import threading
import time


def run(command, log, environment=None, limit_seconds=7200.0):
    """Seconds of the wall and of all cores, peak resident memory in MB and the exit code (negative: the signal).

    Standard output and error go to the file `log`. A program past its limit is killed; its exit code is then -9.
    """
    result = pathlib.Path(f"{log}.json")
    subprocess.run([sys.executable, "-S", "-E", __file__, str(result), str(log), str(limit_seconds), *map(str, command)],
                   env=dict(os.environ, **(environment or {})), check=True)
    return json.loads(result.read_text())


def main():
    result, log, limit = sys.argv[1], sys.argv[2], float(sys.argv[3])
    with open(log, "wb") as output:
        begin = time.monotonic()
        process = subprocess.Popen(sys.argv[4:], stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT)
        watch = threading.Timer(limit, process.kill)
        watch.start()
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.monotonic() - begin
        watch.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    with open(result, "w", encoding="utf-8") as output:
        json.dump(dict(seconds=seconds, cpu_seconds=usage.ru_utime + usage.ru_stime, peak_mb=usage.ru_maxrss / 1024,
                       exit_code=process.returncode), output)


if __name__ == "__main__":
    main()
