"""What `tissuewarp cohort` starts: cohort.py PROGRAM TABLE --output DIR …"""

import sys

from tissuewarp_cohort.main import main

sys.exit(main(sys.argv[2:], sys.argv[1]))
