"""What `tissuewarp cohort` starts: cohort.py PROGRAM TABLE --output DIR …"""

import sys

if sys.version_info < (3, 10):
    sys.exit("tissuewarp cohort: Python 3.10 or newer is needed, this is %d.%d; put one first in PATH" % sys.version_info[:2])

from tissuewarp_cohort.main import main  # noqa: E402

sys.exit(main(sys.argv[2:], sys.argv[1]))
