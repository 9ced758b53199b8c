#!/usr/bin/python3
"""Draws docs/figures/verification_convergence.svg and cook_locking.svg from the lines that verification_table writes,
and prints how many quantities each element meets.
    plot_verification.py verification.csv docs/figures"""
import csv
import math
import pathlib
import sys

COLOURS = {"T4": "#c2410c", "averaged pressure": "#1d4ed8", "T10": "#6b7280", "T10 mixed": "#047857"}
PANELS = [("p1_cube_stretch", "iso", "force z", "Cube pulled by 20 %: force"),
          ("p2_cube_shear", "iso", "force x", "Cube sheared by 50 %: force"),
          ("p4_cook_plane_strain, nu 0.499", "iso", "tip y", "Cook's membrane, ν = 0.499: tip"),
          ("p5_cantilever", "iso", "tip y", "Cantilever: tip"),
          ("p6_ellipsoid_plain", "iso", "points", "Ellipsoid pressed by 10 mm: points"),
          ("p7_breast, prone", "iso", "tip z", "Half ball hanging: tip")]
FONT = 'font-family="sans-serif" fill="#111827"'


def text(x, y, content, size=11, anchor="middle", extra=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" {FONT} {extra}>{content}</text>'


def curve(points, colour):
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    marks = "".join(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6"/>{marks}'


def legend(x, y):
    parts = []
    for name, colour in COLOURS.items():
        parts.append(f'<line x1="{x}" y1="{y - 4}" x2="{x + 22}" y2="{y - 4}" stroke="{colour}" stroke-width="2"/>')
        parts.append(text(x + 28, y, name, anchor="start"))
        x += 50 + 7 * len(name)
    return "".join(parts)


def svg(width, height, parts):
    body = "\n".join(parts)
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
            f'height="{height}">\n<rect width="100%" height="100%" fill="#ffffff"/>\n{body}\n</svg>\n')


class LogAxes:
    """A panel with decades on both axes."""

    def __init__(self, left, top, width, height, xs, ys):
        self.box = (left, top, width, height)
        self.x = (math.log10(min(xs)) - 0.1, math.log10(max(xs)) + 0.1)
        self.y = (math.floor(math.log10(min(ys))), math.ceil(math.log10(max(ys))))

    def at(self, x, y):
        left, top, width, height = self.box
        return (left + width * (math.log10(x) - self.x[0]) / (self.x[1] - self.x[0]),
                top + height * (self.y[1] - math.log10(y)) / (self.y[1] - self.y[0]))

    def frame(self, title, y_label):
        left, top, width, height = self.box
        parts = [f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="#9ca3af"/>',
                 text(left + width / 2, top - 8, title, 12, extra='font-weight="bold"'),
                 text(left + width / 2, top + height + 32, "nodes"),
                 text(left - 44, top + height / 2, y_label,
                      extra=f'transform="rotate(-90 {left - 44} {top + height / 2})"')]
        for decade in range(math.ceil(self.x[0]), math.floor(self.x[1]) + 1):
            x = self.at(10.0 ** decade, 10.0 ** self.y[0])[0]
            parts.append(f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{top + height}" stroke="#e5e7eb"/>')
            parts.append(text(x, top + height + 16, f"{10 ** decade:,}".replace(",", " ")))
        for decade in range(self.y[0], self.y[1] + 1):
            y = self.at(10.0 ** self.x[0], 10.0 ** decade)[1]
            parts.append(f'<line x1="{left}" y1="{y:.1f}" x2="{left + width}" y2="{y:.1f}" stroke="#e5e7eb"/>')
            parts.append(text(left - 6, y + 4, f"{10.0 ** decade:g}", anchor="end"))
        return parts


def convergence(rows):
    parts = [legend(70, 24)]
    for k, (problem, law, quantity, title) in enumerate(PANELS):
        found = [r for r in rows if (r["problem"], r["law"], r["quantity"]) == (problem, law, quantity)]
        if not found:
            continue
        relative = quantity != "points"
        scale = abs(float(found[0]["reference"])) / 100 if relative else 1.0
        off = {name: [(float(r["nodes"]), float(r["off"]) / scale) for r in found if r["element"] == name]
               for name in COLOURS}
        every = [point for points in off.values() for point in points]
        bound = float(found[0]["uncertainty"]) / scale
        axes = LogAxes(70 + 330 * (k % 3), 70 + 270 * (k // 3), 240, 180, [p[0] for p in every],
                       [p[1] for p in every] + [max(bound, min(p[1] for p in every) / 10)])
        parts += axes.frame(title, "off, %" if relative else "off, mm (r.m.s.)")
        if math.log10(bound) > axes.y[0]:
            y = axes.at(10.0 ** axes.x[0], bound)[1]
            left, width = axes.box[0], axes.box[2]
            parts.append(f'<line x1="{left}" y1="{y:.1f}" x2="{left + width}" y2="{y:.1f}" stroke="#111827" '
                         f'stroke-dasharray="4 3"/>')
            parts.append(text(left + 4, y - 4, "uncertainty of the reference", 9, "start"))
        parts += [curve([axes.at(x, y) for x, y in points], COLOURS[name]) for name, points in off.items() if points]
    return svg(1040, 580, parts)


def locking(rows):
    ratios = ["0.3", "0.45", "0.49", "0.499", "0.4999"]
    left, top, width, height = 80, 60, 460, 260
    parts = [legend(left, 24), f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" '
             f'stroke="#9ca3af"/>', text(left + width / 2, top + height + 38, "Poisson's ratio"),
             text(left - 48, top + height / 2, "tip deflection / reference",
                  extra=f'transform="rotate(-90 {left - 48} {top + height / 2})"')]
    place = {nu: left + width * (k + 0.5) / len(ratios) for k, nu in enumerate(ratios)}
    for nu, x in place.items():
        parts.append(text(x, top + height + 18, nu))
    for tick in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0):
        y = top + height * (1.1 - tick) / 1.1
        parts.append(f'<line x1="{left}" y1="{y:.1f}" x2="{left + width}" y2="{y:.1f}" '
                     f'stroke="{"#111827" if tick == 1.0 else "#e5e7eb"}"/>')
        parts.append(text(left - 6, y + 4, f"{tick:g}", anchor="end"))
    for name, colour in COLOURS.items():
        points = []
        for nu in ratios:
            found = [r for r in rows if r["problem"] == f"p4_cook_plane_strain, nu {nu}" and r["law"] == "iso"
                     and r["quantity"] == "tip y" and r["element"] == name]
            if found:
                coarsest = min(found, key=lambda r: float(r["nodes"]))
                ratio = float(coarsest["value"]) / float(coarsest["reference"])
                points.append((place[nu], top + height * (1.1 - ratio) / 1.1))
        if points:
            parts.append(curve(points, colour))
    parts.append(text(left + 8, top + height - 12, "coarsest mesh: 16 × 16 linear cells, 4 × 4 quadratic ones", 10,
                      "start"))
    return svg(580, 380, parts)


def counts(rows):
    """A Markdown table: one line per element, singular corners apart, and plain tetrahedra where they are expected to lock."""
    finest = {(r["problem"], r["law"], r["element"], r["quantity"]): r for r in rows}  # the last line of each
    groups = {}
    for r in finest.values():
        corner, locks = "corner" in r["quantity"], r["expected_to_lock"] == "yes"
        apart = ", corners" if corner else ", ν > 0.46: expected to lock" if locks else ""
        groups.setdefault(r["element"] + apart, []).append(r)
    lines = ["| element | quantities | within uncertainty + mesh error | with safety factor | "
             "largest distance / strict bar |",
             "|---|---|---|---|---|"]
    order = list(COLOURS)
    for name, group in sorted(groups.items(), key=lambda item: order.index(item[1][0]["element"])):
        off, known, mesh, index = (column(group, c) for c in ("off", "uncertainty", "mesh_error", "index_error"))
        bars = [k + m for k, m in zip(known, mesh)]
        lines.append(f"| {name} | {len(group)} | {sum(o <= b for o, b in zip(off, bars))} | "
                     f"{sum(o <= k + i for o, k, i in zip(off, known, index))} | "
                     f"{max(o / b for o, b in zip(off, bars)):.3g} |")
    return "\n".join(lines)


def column(rows, name):
    return [float(r[name]) for r in rows]


def main():
    with open(sys.argv[1], newline="") as stream:
        rows = list(csv.DictReader(stream))
    folder = pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "verification_convergence.svg").write_text(convergence(rows))
    (folder / "cook_locking.svg").write_text(locking(rows))
    print(counts(rows))


main()
