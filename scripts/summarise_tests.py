#!/usr/bin/python3
"""One line of what a run of ctest did: how many tests passed, failed and were skipped, and for want of what.

    scripts/summarise_tests.py REPORT    what ctest --output-junit wrote
"""

import collections
import re
import sys
import xml.etree.ElementTree

SKIPPED = re.compile(r": Skipped\n(.*)\n")  # as GoogleTest prints the reason


def outcome(case):
    """'passed', 'failed' or 'skipped'. What ctest could not start has failed, though its report lists it as skipped."""
    skipped = case.find("skipped")
    if skipped is not None:
        return "skipped" if skipped.get("message", "").startswith("SKIP_") else "failed"
    return "passed" if case.get("status") == "run" else "failed"


def reason(case):
    found = SKIPPED.search(case.findtext("system-out", ""))
    return found.group(1).strip() if found else "no reason given"


def summary(path):
    cases = xml.etree.ElementTree.parse(path).getroot().findall("testcase")
    counts = collections.Counter(outcome(case) for case in cases)
    skipped = collections.defaultdict(list)
    for case in cases:
        if outcome(case) == "skipped":
            skipped[reason(case)].append(case.get("name"))
    line = ", ".join(f"{counts[name]} {name}" for name in ("passed", "failed", "skipped"))
    reasons = (f"{len(names)} {why} ({', '.join(sorted(names))})" for why, names in sorted(skipped.items()))
    return f"Tests: {line}" + "".join("; " + text for text in reasons)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    print(summary(sys.argv[1]))
