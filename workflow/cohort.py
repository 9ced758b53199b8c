"""What `tissuewarp cohort` starts: cohort.py PROGRAM TABLE --output DIR …"""

import os
import sys

if sys.version_info < (3, 10):
    sys.exit("tissuewarp cohort: Python 3.10 or newer is needed, this is %d.%d; put one first in PATH" % sys.version_info[:2])

from tissuewarp_cohort.main import main  # noqa: E402

try:
    code = main(sys.argv[2:], sys.argv[1])
    sys.stdout.flush()
except BrokenPipeError:  # whoever read the output has gone
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    code = 1
sys.exit(code)
