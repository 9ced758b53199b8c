"""Panels of error over time as one SVG, both axes logarithmic."""

import html
import math

COLOURS = {"tissuewarp": "#1d4ed8", "tissuewarp, prepared before": "#60a5fa", "elastix": "#c2410c", "plastimatch": "#047857"}
MARKS = {"default": "star", "mesh": "circle", "rounds": "square", "budget": "triangle", "iterations": "circle"}
WIDTH, HEIGHT, LEFT, TOP, GAP = 440, 300, 62, 70, 74
MOST = 6  # times the least error: beyond, a setting failed
TICKS = [number * 10.0**power for power in range(-2, 5) for number in (1, 1.5, 2, 3, 5)]


def text(x, y, content, anchor="middle", size=12, fill="#111827", turn=""):
    return (f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" font-family="sans-serif" fill="{fill}"{turn}>'
            f"{html.escape(content)}</text>")


def mark(kind, x, y, colour):
    if kind == "circle":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="{colour}"/>'
    if kind == "square":
        return f'<rect x="{x - 3.6:.1f}" y="{y - 3.6:.1f}" width="7.2" height="7.2" fill="{colour}"/>'
    turns = range(3) if kind == "triangle" else range(10)
    reach = (lambda k: 5.2) if kind == "triangle" else (lambda k: 8 if k % 2 == 0 else 3.4)
    corners = [(x + reach(k) * math.sin(2 * math.pi * k / len(turns)), y - reach(k) * math.cos(2 * math.pi * k / len(turns)))
               for k in turns]
    return f'<polygon points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in corners)}" fill="{colour}"/>'


def front(points):
    """Those that no other point beats in both time and error, by time."""
    best, kept = math.inf, []
    for point in sorted(points, key=lambda p: (p["seconds"], p["error"])):
        if point["error"] < best:
            kept.append(point)
            best = point["error"]
    return kept


def span(values):
    low, high = min(values), max(values)
    return low / 1.25, high * 1.25


def panel(title, everything, left, top):
    """Points are dicts of tool, series, seconds, error (mm). Failures are named at the top, off the scale."""
    most = MOST * min(p["error"] for p in everything)
    points = [p for p in everything if p["error"] <= most]
    xs, ys = span([p["seconds"] for p in points]), span([p["error"] for p in points])
    x = lambda value: left + WIDTH * math.log(value / xs[0]) / math.log(xs[1] / xs[0])
    y = lambda value: top + HEIGHT * (1 - math.log(value / ys[0]) / math.log(ys[1] / ys[0]))
    yield f'<rect x="{left}" y="{top}" width="{WIDTH}" height="{HEIGHT}" fill="#f9fafb" stroke="#9ca3af"/>'
    yield text(left + WIDTH / 2, top - 10, title, size=14)
    for tick in TICKS:
        if xs[0] <= tick <= xs[1]:
            yield f'<line x1="{x(tick):.1f}" x2="{x(tick):.1f}" y1="{top}" y2="{top + HEIGHT}" stroke="#e5e7eb"/>'
            yield text(x(tick), top + HEIGHT + 16, f"{tick:g}")
        if ys[0] <= tick <= ys[1]:
            yield f'<line x1="{left}" x2="{left + WIDTH}" y1="{y(tick):.1f}" y2="{y(tick):.1f}" stroke="#e5e7eb"/>'
            yield text(left - 6, y(tick) + 4, f"{tick:g}", "end")
    for tool, colour in COLOURS.items():
        own = [p for p in points if p["tool"] == tool]
        path = " ".join(f"{x(p['seconds']):.1f},{y(p['error']):.1f}" for p in front(own))
        if path:
            yield f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="1.6" opacity="0.7"/>'
        yield from (mark(MARKS[p["series"]], x(p["seconds"]), y(p["error"]), colour) for p in own)
    for number, p in enumerate(p for p in everything if p["error"] > most):
        yield text(left + WIDTH - 8, top + 18 + 16 * number, f"{p['tool']}: {p['error']:.2g} mm in {p['seconds']:.2g} core seconds", "end",
                   fill=COLOURS[p["tool"]])
    yield text(left + WIDTH / 2, top + HEIGHT + 36, "core seconds")
    middle = top + HEIGHT / 2
    yield text(left - 44, middle, "mean error, mm", turn=f' transform="rotate(-90 {left - 44} {middle})"')


def legend(at):
    for tool, colour in COLOURS.items():
        yield mark("circle", at, 22, colour)
        yield text(at + 10, 26, tool, "start")
        at += 34 + 7 * len(tool)
    for series in ("default", "mesh", "rounds", "budget"):
        yield mark(MARKS[series], at, 22, "#4b5563")
        yield text(at + 11, 26, series, "start")
        at += 36 + 7 * len(series)


def figure(panels, columns=2):
    """panels: {title: points}."""
    rows = -(-len(panels) // columns)
    width, height = LEFT + columns * (WIDTH + GAP), TOP + rows * (HEIGHT + GAP + 10)
    lines = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">',
             '<rect width="100%" height="100%" fill="#ffffff"/>', *legend(LEFT)]
    for number, (title, points) in enumerate(panels.items()):
        row, column = divmod(number, columns)
        lines += panel(title, points, LEFT + column * (WIDTH + GAP), TOP + row * (HEIGHT + GAP + 10))
    return "\n".join([*lines, "</svg>"]) + "\n"
