"""The cohort's page: one HTML file without network. Pictures of the pairs to look at first are inside; those of the others
lie in their folders."""

import base64
import html
import os
import statistics

from . import histogram
from .summary import MEASURES

PICTURES_INSIDE = 100
SHOWN = ["worst_interval_95_mm", "interval_95_mm", "error_mean_mm", "dice", "true_dice", "least_j", "seconds"]
STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2em auto; max-width: 1400px; padding: 0 1em; color: #1a1a1a; background: #fff }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin-top: 2em }
table { border-collapse: collapse; width: 100% } th, td { padding: .35em .6em; text-align: right; vertical-align: top; border-bottom: 1px solid #ddd }
th { position: sticky; top: 0; background: #fff; cursor: pointer; font-weight: 600 } td.text, th.text { text-align: left } td:last-child { min-width: 24em }
img { width: 96px; image-rendering: auto; display: block } a { color: #0b57a4 }
.failed td { background: #fdecea } .left td { color: #777 } .out { color: #b3261e; font-weight: 600 }
.figures { display: flex; flex-wrap: wrap; gap: 1em } figure { margin: 0 } figcaption { font-size: .85em; color: #444 }
small { color: #555 } .bad { color: #b3261e }
@media (prefers-color-scheme: dark) { body, th { background: #16181c; color: #e6e6e6 } td, th { border-color: #333 }
 a { color: #8ab4f8 } .failed td { background: #3a1d1c } small, figcaption { color: #aaa } .out, .bad { color: #ff8a80 } }
"""
SCRIPT = """
for (const head of document.querySelectorAll('th[data-key]')) head.onclick = () => {
  const body = document.querySelector('#pairs tbody'), place = head.cellIndex;
  const down = head.dataset.down = head.dataset.down === '1' ? '0' : '1';
  const value = row => { const text = row.cells[place].dataset.v; return text === '' ? -Infinity : isNaN(text) ? text : +text; };
  [...body.rows].sort((a, b) => { const x = value(a), y = value(b); return (x < y ? -1 : x > y ? 1 : 0) * (down === '1' ? -1 : 1); })
    .forEach(row => body.append(row)); };
"""


def number(value):
    if value is None:
        return "–"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}" if abs(value) < 100 else f"{value:.0f}"


def picture(layout, row, place):
    path = os.path.join(layout.pair(row["id"]), "thumbnail.png")
    if row["state"] != "done" or not os.path.exists(path):
        return ""
    source = f"pairs/{row['id']}/thumbnail.png"
    if place < PICTURES_INSIDE:
        with open(path, "rb") as file:
            source = "data:image/png;base64," + base64.b64encode(file.read()).decode()
    return f'<img loading="lazy" alt="slice of {html.escape(row["id"])}" src="{source}">'


def link(layout, row):
    name = html.escape(row["id"])
    if row["state"] == "done":
        return f'<a href="pairs/{name}/report.html">{name}</a>'
    return f'<a href="logs/{name}.txt">{name}</a>' if os.path.exists(layout.log_of("pair", row["id"])) else name


def words(row):
    if row["state"] != "done":
        return html.escape(row["why"] or "not run yet")
    parts = [html.escape(doubt) for doubt in row["doubt_texts"]]
    parts += [f"<small>{html.escape(notice)}</small>" for notice in row["notices"]]
    if row["outlier_of"]:
        names = ", ".join(MEASURES[key][0] for key in row["outlier_of"])
        parts.append(f'<span class="out">unlike the cohort: {html.escape(names)}</span>')
    return "<br>".join(parts)


def table_row(layout, row, place, shown):
    cells = [f'<td data-v="">{picture(layout, row, place)}</td>',
             f'<td class="text" data-v="{html.escape(row["id"])}">{link(layout, row)}</td>',
             f'<td data-v="{"" if row["doubts"] is None else row["doubts"]}">{"–" if row["doubts"] is None else row["doubts"]}</td>']
    for key in shown:
        mark = ' class="out"' if key in row["outlier_of"] else ""
        cells.append(f'<td{mark} data-v="{"" if row[key] is None else row[key]}">{number(row[key])}</td>')
    cells.append(f'<td class="text" data-v="">{words(row)}</td>')
    return f'<tr class="{row["state"]}">{"".join(cells)}</tr>'


def heading(key):
    name, unit = MEASURES[key][:2]
    return f'<th data-key="{key}">{html.escape(name)}{f", {unit}" if unit else ""}</th>'


def figures(rows):
    parts = []
    for key, (name, unit, how, _) in MEASURES.items():
        values = [row[key] for row in rows if row[key] is not None]
        if len(set(values)) > 1:
            caption = f"{name}{f', {unit}' if unit else ''}: median {number(statistics.median(values))} of {len(values)}"
            parts.append(f"<figure>{histogram.svg(values, how == 'log')}<figcaption>{html.escape(caption)}</figcaption></figure>")
    return f'<div class="figures">{"".join(parts)}</div>' if parts else "<p>Nothing is done yet.</p>"


def summary_words(rows):
    count = {state: sum(row["state"] == state for row in rows) for state in ("done", "failed", "left")}
    doubted = sum(bool(row["doubts"]) for row in rows)
    outliers = sum(bool(row["outlier_of"]) for row in rows)
    failed = f'<span class="bad">{count["failed"]} failed</span>' if count["failed"] else "none failed"
    return (f"<p>{len(rows)} pairs: {count['done']} done, {failed}, {count['left']} left. {doubted} are doubted, "
            f"{outliers} unlike the cohort.</p>")


def group_part(groups):
    return "" if not groups else f"<h2>Groups and loops</h2>{groups}"


def html_of(layout, rows, title, about, groups=""):
    shown = [key for key in SHOWN if any(row[key] is not None for row in rows)]
    head = ("".join(['<th></th><th class="text" data-key="id">pair</th><th data-key="doubts">doubts</th>',
                     *map(heading, shown), '<th class="text">what speaks against it</th>']))
    body = "".join(table_row(layout, row, place, shown) for place, row in enumerate(rows))
    return f"""<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>
<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body>
<h1>{html.escape(title)}</h1>{summary_words(rows)}<p><small>{html.escape(about)}</small></p>
<h2>Pairs</h2><p><small>Failures first, then doubts, then the worst expected error: look at these from the top. A click on a heading sorts.
Pictures: a slice near the worst expected error, red where tissue may lie 5 mm off (1 σ).
Unlike the cohort: more than 3.5 robust standard deviations from its median, for the worse.
Tables for statistics: <a href="cohort.csv">cohort.csv</a>, <a href="labels.csv">labels.csv</a>.</small></p>
<table id="pairs"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>
<h2>Distributions</h2>{figures(rows)}{group_part(groups)}
<script>{SCRIPT}</script></body></html>
"""


def write(layout, rows, title, about, groups=""):
    text = html_of(layout, rows, title, about, groups)
    partial = layout.page + ".partial"
    with open(partial, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(partial, layout.page)
