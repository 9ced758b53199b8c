#!/usr/bin/python3
"""Merges files that `tissuewarp calibrate` wrote of different phantoms, on machines of one kind, into one.

    scripts/merge_fronts.py --output fronts.json A.json B.json ...
    scripts/merge_fronts.py --output registration/dial/shipped_fronts.cpp A.json B.json ...   # the program's own figures

So many calibrations can share a machine with many cores, each of one phantom on cores of its own. Medians are of the
files' medians, 95th percentiles of all files; given one phantom each, that is what one calibration of all would write.
"""
import argparse
import json
import statistics
import sys
from pathlib import Path

CPP = '''#include "registration/dial/shipped_fronts.hpp"

namespace tissuewarp::registration::detail {

const char* const shipped_fronts_text = R"json(%s
)json";

}  // namespace tissuewarp::registration::detail
'''


def rounded(value):
    return float(f"{value:.4g}")


def percentile_95(values):
    """Between neighbours linear."""
    ordered = sorted(values)
    place = 0.95 * (len(ordered) - 1)
    low = int(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


def merged_point(points):
    result = dict(points[0])
    for key in result:
        if key not in ("data", "edges_per_organ"):
            result[key] = rounded(statistics.median(point[key] for point in points))
    result["rounds_95_s"] = rounded(percentile_95([point["rounds_95_s"] for point in points]))
    result["error_95_mm"] = rounded(percentile_95([point["error_95_mm"] for point in points]))
    return result


def merged(files):
    first = files[0]
    for key in ("schema_version", "machine"):
        kinds = {json.dumps(file[key]) for file in files}
        if len(kinds) > 1:
            sys.exit(f"the files differ in {key}: {', '.join(sorted(kinds))}; calibrate again on one machine")
    result = dict(first)
    for key, value in first.items():
        if isinstance(value, dict):
            result[key] = {name: rounded(statistics.median(file[key][name] for file in files)) for name in value}
    result["points"] = []
    for point in first["points"]:
        same = [p for file in files for p in file["points"]
                if (p["data"], p["edges_per_organ"]) == (point["data"], point["edges_per_organ"])]
        if len(same) != len(files):
            sys.exit(f"{point['edges_per_organ']} edges from {point['data']} are in {len(same)} of {len(files)} files")
        result["points"].append(merged_point(same))
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("files", type=Path, nargs="+")
    arguments = parser.parse_args()
    text = json.dumps(merged([json.loads(file.read_text()) for file in arguments.files]), indent=1)
    arguments.output.write_text(CPP % text if arguments.output.suffix == ".cpp" else text + "\n")


if __name__ == "__main__":
    main()
