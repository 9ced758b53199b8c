"""Updates leave no memory behind. TISSUEWARP_UPDATES says how many; by default fewer, so that the test is short."""

import gc
import os
import unittest

import tissuewarp

from phantom import FIXED_LABELS, MOVING, MOVING_LABELS

UPDATES = int(os.environ.get("TISSUEWARP_UPDATES", 60))
WARM = max(10, UPDATES // 5)  # before which caches and pools fill
MOST_MEGABYTES = 8  # of growth; one result alone, kept, has 1 MB, and its field 0.8


def resident_megabytes():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


class Leaks(unittest.TestCase):
    def test_updates_leave_nothing(self):
        model = tissuewarp.prepare(MOVING_LABELS, edge_length=9.0)
        updater = tissuewarp.Updater(model, device="cpu", rounds=2)
        after = []
        for _ in range(UPDATES):
            result = updater.update(labels=FIXED_LABELS, progress=lambda stage, fraction: True)
            result.warp(MOVING)
            del result
            gc.collect()
            after.append(resident_megabytes())
        growth = max(after[-5:]) - max(after[WARM - 5:WARM])
        print(f"{UPDATES} updates: {after[0]:.1f} MB after the first, {after[WARM - 1]:.1f} after {WARM}, "
              f"{after[-1]:.1f} at the end")
        self.assertLess(growth, MOST_MEGABYTES)

    def test_failures_leave_nothing(self):
        model = tissuewarp.prepare(MOVING_LABELS, edge_length=9.0)
        updater = tissuewarp.Updater(model, device="cpu")
        after = []
        for _ in range(UPDATES):
            with self.assertRaises(tissuewarp.Cancelled):
                updater.update(labels=FIXED_LABELS, progress=lambda stage, fraction: False)
            after.append(resident_megabytes())
        self.assertLess(max(after[-5:]) - max(after[WARM - 5:WARM]), MOST_MEGABYTES)


if __name__ == "__main__":
    unittest.main()
