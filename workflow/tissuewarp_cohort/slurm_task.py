"""One task of an array: its share of the jobs, one after the other.

    python3 -m tissuewarp_cohort.slurm_task OUTPUT pair|prepare LISTING SESSION THREADS TASK"""

import signal
import sys

from .digests import read_json
from .job import Ended, attempt, end
from .layout import Layout


def main():
    folder, kind, listing, session, threads, task = sys.argv[1:7]
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, end)
    jobs = read_json(listing)
    first = int(task) * jobs["bundle"]
    try:
        codes = [attempt(Layout(folder), kind, name, session, int(threads))
                 for name in jobs["jobs"][first:first + jobs["bundle"]]]
    except Ended:
        return 130
    return max(codes, default=0)


if __name__ == "__main__":
    sys.exit(main())
