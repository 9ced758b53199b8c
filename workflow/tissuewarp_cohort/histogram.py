"""A histogram as SVG."""

import math

WIDTH, HEIGHT, FOOT = 260, 110, 18  # pixels
MOST_BINS = 24


def bins_of(values, logarithmic):
    """(edges, counts) of equal bins, of the logarithm where all values are above 0."""
    logarithmic = logarithmic and min(values) > 0
    scaled = [math.log10(value) for value in values] if logarithmic else values
    low, high = min(scaled), max(scaled)
    count = max(1, min(MOST_BINS, round(2 * len(values) ** 0.5))) if high > low else 1
    step = (high - low) / count or 1.0
    counts = [0] * count
    for value in scaled:
        counts[min(count - 1, int((value - low) / step))] += 1
    edges = [low + step * k for k in range(count + 1)]
    return [10 ** edge for edge in edges] if logarithmic else edges, counts


def svg(values, logarithmic):
    edges, counts = bins_of(values, logarithmic)
    width, tallest = WIDTH / len(counts), max(counts)
    bars = "".join(
        f'<rect x="{k * width:.1f}" y="{(HEIGHT - FOOT) * (1 - count / tallest):.1f}" width="{max(1, width - 1):.1f}" '
        f'height="{(HEIGHT - FOOT) * count / tallest:.1f}"><title>{edges[k]:.3g} to {edges[k + 1]:.3g}: {count}</title></rect>'
        for k, count in enumerate(counts) if count)
    return (f'<svg width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" fill="#4a7fb5">{bars}'
            f'<g fill="currentColor" font-size="11"><text x="0" y="{HEIGHT - 4}">{edges[0]:.3g}</text>'
            f'<text x="{WIDTH}" y="{HEIGHT - 4}" text-anchor="end">{edges[-1]:.3g}</text></g></svg>')
