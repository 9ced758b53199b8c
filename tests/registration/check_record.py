"""Reads a run record with h5py, which knows nothing of tissuewarp, and compares it with what the test wrote as text.

check_record.py record.h5 expected.txt
"""
import sys

import h5py
import numpy as np

record = h5py.File(sys.argv[1], "r")
with open(sys.argv[2]) as stream:
    nodes, tets = map(int, stream.readline().split())
    rows = [list(map(float, line.split())) for line in stream]
assert record.attrs["format"] == "tissuewarp registration record"
assert record.attrs["format_version"] == 2
assert np.array_equal(record["mesh/nodes"][:], np.array(rows[:nodes]))
assert np.array_equal(record["displacement"][:], np.array(rows[nodes : 2 * nodes]))
assert np.array_equal(record["placement"][:], np.array(rows[2 * nodes :]))
assert record["mesh/tetrahedra"].shape == (tets, 4) and record["mesh/labels"].shape == (tets,)
assert record["mesh/nodes"].compression == "gzip"

# det F anew, from the file alone.
rest, moved = record["mesh/nodes"][:], record["mesh/nodes"][:] + record["displacement"][:]
corners = record["mesh/tetrahedra"][:]
edges = lambda x: np.stack([x[corners[:, k]] - x[corners[:, 0]] for k in (1, 2, 3)], axis=-1)
jacobian = np.linalg.det(edges(moved)) / np.linalg.det(edges(rest))
assert np.allclose(record["jacobian"][:], jacobian, rtol=1e-9)

assert [law.decode() for law in record["materials/law"][:]] == ["neo_hookean_lnj", "neo_hookean_iso"]
assert list(record["materials/label"][:]) == [1, 7]
assert list(record["rounds/range_mm"][:]) == [15.0, 4.0]
assert list(record["rounds/held_back"][:]) == [11, 0]
assert record["estimated_error_mm"][()] == 0.02
assert record["engine"][0].decode() == "CPU, 2 threads"
names = [name.decode() for name in record["provenance/name"][:]]
values = [value.decode() for value in record["provenance/value"][:]]
assert dict(zip(names, values))["device"] == "llvmpipe \u00b5"


def require_units(name, item):
    if isinstance(item, h5py.Dataset) and item.dtype.kind in "if":
        assert item.attrs["units"] != "", name


record.visititems(require_units)
