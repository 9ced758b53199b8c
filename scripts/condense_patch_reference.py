#!/usr/bin/python3
"""Condenses the homogeneous states of p3_patch.json to what the tests read: F, W and P of every state. S and sigma are
products of F and P, J is det F; without them and without indentation the file is a fifth of its size.
    condense_patch_reference.py full.json data/reference/p3_patch.json"""
import json
import sys

GROUPS = ("uniaxial_z", "equibiaxial_xy", "simple_shear_xz", "confined_z", "general_F")

with open(sys.argv[1]) as stream:
    full = json.load(stream)
condensed = {key: full[key] for key in ("problem", "statement", "material", "uncertainty", "method")}
condensed["condensed"] = "F, W (J/m3) and P (Pa) of every state; see scripts/condense_patch_reference.py"
condensed["values"] = []
for block in full["values"]:
    entry = {key: value for key, value in block.items() if key not in GROUPS}
    for group in GROUPS:
        if group in block:
            entry[group] = [{key: state[key] for key in ("F", "W", "P")} for state in block[group]]
    condensed["values"].append(entry)
with open(sys.argv[2], "w") as stream:
    stream.write(json.dumps(condensed, separators=(",", ":")).replace('{"material"', '\n{"material"') + "\n")
