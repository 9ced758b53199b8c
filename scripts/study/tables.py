"""Markdown tables of scripts/results and scripts/compare."""

from . import scoring


def line(*cells):
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def spread(errors):
    return f"{errors['mean']:.2f} / {errors['median']:.2f} / {errors['p95']:.2f} / {errors['maximum']:.2f}"


def percent(share):
    """Enough digits that a single voxel does not read as none."""
    return "0" if share == 0 else f"{100 * share:.2g}"


def comparison(rows):
    """The table of scripts/compare: rows of case name, case, tool name, result, in order."""
    yield line("case", "tool", "targets", "n", "error: mean / median / 95th / max, mm", "folded in organ / grid, %",
               "seconds", "core seconds", "peak memory, MB")
    yield line(*["---"] * 9)
    former = None
    for name, case, tool, result in rows:
        if name != former:
            for targets, (moving, fixed) in case.targets.items():
                before = scoring.summary(scoring.distances(moving, fixed))
                yield line(name, "none (headers)", targets, before["count"], spread(before), *["–"] * 4)
            former = name
        cost = f"{result['seconds']:.0f}", f"{result['cpu_seconds']:.0f}", f"{result['peak_mb']:.0f}"
        if result["failure"]:
            yield line(name, tool, "–", "–", result["failure"], "–", *cost)
            continue
        folds = f"{percent(result['folded']['organ'])} / {percent(result['folded']['grid'])}"
        for targets, errors in result["targets"].items():
            lost = f" ({errors['not_inverted']} without inverse)" if errors["not_inverted"] else ""
            yield line(name, tool, targets, errors["count"], spread(errors) + lost, folds, *cost)
            folds, cost = "″", ["″"] * 3
