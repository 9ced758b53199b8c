"""Sends pairs of points to `tissuewarp serve` and says where the organ is: over_openigtlink.py pairs.csv [port]

Rows of the file: pre_x,pre_y,pre_z,intra_x,intra_y,intra_z (mm, LPS), below a header. Needs tissuewarp_client.py beside
it or on PYTHONPATH, and nothing else.
"""

import csv
import sys

from tissuewarp_client import Client


def main(path, port=18944):
    with open(path, newline="", encoding="utf-8") as file:
        rows = [list(map(float, row)) for row in list(csv.reader(file))[1:]]
    with Client(port=int(port)) as client:
        client.send_points("moving_points", {str(n): row[:3] for n, row in enumerate(rows)})
        client.send_points("fixed_points", {str(n): row[3:] for n, row in enumerate(rows)})
        answer = client.update(points_sd_mm=0.5)
        if answer["status"] not in ("ok", "doubted"):
            sys.exit(answer["why"])
        organ = client.newest("organ")
    moved = organ["arrays"]["displacement_mm"]
    print(f"{answer['status']} after {answer['seconds']['total']:.2f} s: {len(organ['points'])} points of the surface "
          f"moved by up to {max(moved):.1f} mm, 95 % within {answer['error_mm']['interval_95']:.1f} mm")
    for doubt in answer["doubts"]:
        print(f"{doubt['severity']} ({doubt['code']}): {doubt['text']}")


if __name__ == "__main__":
    main(*sys.argv[1:])
