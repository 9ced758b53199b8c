"""One tool's settings varied from quick to thorough: what a user would turn to trade time for accuracy."""

import dataclasses
import json
import re

from .tools import Elastix, Plastimatch, Tissuewarp

# Times the iterations of scripts/peers, in every stage.
ELASTIX_PARTS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1, 2)
PLASTIMATCH_PARTS = (1 / 16, 1 / 8, 1 / 4, 1 / 2, 1, 2)
ITERATIONS = re.compile(r"((?:MaximumNumberOfIterations |max_its=))(\d+)")


@dataclasses.dataclass
class Setting:
    series: str  # what is varied
    value: str  # and to what
    tool: object


def scaled(source, part, folder):
    """A file of scripts/peers with a part of its iterations, one at the least, and that file's name."""
    path = folder / f"{source.stem}-{part:g}{source.suffix}"
    path.write_text(ITERATIONS.sub(lambda found: f"{found[1]}{max(1, round(int(found[2]) * part))}", source.read_text()))
    return path


def settings(tool, edges_mm, budgets_s, folder):
    """Of a tool of scripts/compare; meshes and budgets to try, and the folder that takes changed settings of the peers."""
    if isinstance(tool, Tissuewarp):
        more = [("default", "", [])]
        more += [("mesh", f"{edge:g} mm", ["--edge-length", edge]) for edge in edges_mm]
        more += [("rounds", f"{count}", ["--rounds", count]) for count in (1, 2, 4)]
        more += [("budget", f"{seconds:g} s", ["--time-budget", f"{seconds:g}s"]) for seconds in budgets_s]
        return [Setting(series, value, Tissuewarp([*tool.arguments, *words])) for series, value, words in more]
    parts = ELASTIX_PARTS if isinstance(tool, Elastix) else PLASTIMATCH_PARTS
    if isinstance(tool, Elastix):
        change = lambda part: [scaled(path, part, folder) for path in tool.settings]
    else:
        change = lambda part: scaled(tool.settings[0], part, folder)
    return [Setting("iterations", f"x {part:g}", dataclasses.replace(tool, stages=change(part))) for part in parts]


def name_of(tool):
    return {Tissuewarp: "tissuewarp", Elastix: "elastix", Plastimatch: "plastimatch"}[type(tool)]


def at_hand_share(folder):
    """What part of a run of tissuewarp came after the data were at hand: the rest can be prepared before. None of others."""
    report = folder / "report.json"
    if not report.exists():
        return None
    report = json.loads(report.read_text())
    return report["intraoperative_seconds"] / report["total_seconds"]
