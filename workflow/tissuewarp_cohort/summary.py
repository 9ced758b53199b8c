"""What the runs of a cohort say, as rows for tables: one a pair, and one for each label of a pair."""

import csv
import io
import math
import os
import statistics

from .digests import read_json

OUTLIER_Z = 3.5  # robust z-score (median, 1.4826 times the median absolute deviation): Iglewicz and Hoaglin 1993
LEAST_FOR_OUTLIERS = 8

# key: (heading, unit, how it is compared: on a logarithm, of what it lacks to 1, or as it is; which way is bad)
MEASURES = {
    "worst_interval_95_mm": ("worst expected error, 95 %", "mm", "log", 1),
    "interval_95_mm": ("expected error, 95 %", "mm", "log", 1),
    "unknown_share": ("tissue called unknown", "", "plain", 1),
    "dice": ("Dice of all labels", "", "lack", 1),
    "hausdorff_95_mm": ("HD95", "mm", "log", 1),
    "true_dice": ("Dice with the truth", "", "lack", 1),
    "error_mean_mm": ("error at landmarks, mean", "mm", "log", 1),
    "error_95_mm": ("error at landmarks, 95th percentile", "mm", "log", 1),
    "held_out_mm": ("held-out surface, mean", "mm", "log", 1),
    "least_j": ("least det J in the organ", "", "plain", -1),
    "folded_share": ("share of the organ that folds", "", "plain", 1),
    "seconds": ("time", "s", "log", 1),
    "memory_mb": ("memory", "MB", "log", 1),
}
COLUMNS = ["id", "row", "state", "why", "doubts", "doubt_texts", "notices", "outlier_of", *MEASURES, "dice_before",
           "error_mean_before_mm", "error_median_mm", "landmarks"]


def at(value, *keys):
    """The entry of nested dictionaries, None where one is missing."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value


def texts_of(report, severity):
    """Doubts speak against a result; notices say that less is known than was asked for."""
    return [doubt.get("text", "") for doubt in report.get("doubts", []) if doubt.get("severity") == severity]


def measures_of(report, scores, record):
    errors = at(scores, "target_registration_error", "all") or at(report, "target_registration_error", "all")
    return {
        "worst_interval_95_mm": at(report, "error_estimate", "worst_interval_95_mm"),
        "interval_95_mm": at(report, "error_estimate", "interval_95_mm"),
        "unknown_share": at(report, "error_estimate", "unknown_share"),
        "dice": at(report, "overlap", "after", "all", "dice"),
        "dice_before": at(report, "overlap", "before", "all", "dice"),
        "hausdorff_95_mm": at(report, "overlap", "after", "all", "hausdorff_95_mm"),
        "true_dice": at(scores, "overlap", "all", "dice"),
        "error_mean_mm": at(errors, "after", "mean"), "error_median_mm": at(errors, "after", "median"),
        "error_95_mm": at(errors, "after", "percentile_95"), "error_mean_before_mm": at(errors, "before", "mean"),
        "landmarks": at(errors, "after", "count"),
        "held_out_mm": at(scores, "held_out_surface", "distance_mm", "mean"),
        "least_j": at(report, "jacobian", "field_in_organ", "minimum"),
        "folded_share": at(report, "jacobian", "field_in_organ", "folded_share"),
        "seconds": at(record, "took", "seconds"), "memory_mb": at(record, "took", "memory_mb"),
    }


def row_of(layout, job):
    name = job["id"]
    row = dict.fromkeys(COLUMNS)
    row.update(id=name, row=job["row"], state="left", doubt_texts=[], notices=[], outlier_of=[], doubts=None)
    record, failure = read_json(layout.record("pair", name)), read_json(layout.failure("pair", name))
    if failure and not record:
        row.update(state="failed", why=failure.get("why", ""))
    elif not record and job["patient"]:
        unprepared = read_json(layout.failure("prepare", job["patient"]))
        if unprepared:
            row.update(state="failed", why="its patient was not prepared: " + unprepared.get("why", ""))
    if record:
        report = read_json(os.path.join(layout.pair(name), "report.json")) or {}
        scores = read_json(os.path.join(layout.pair(name), "scores.json")) or {}
        doubts, notices = texts_of(report, "doubt"), texts_of(report, "notice")
        row.update(state="done", doubts=len(doubts), doubt_texts=doubts, notices=notices, **measures_of(report, scores, record))
    return row


def comparable(value, how):
    if how == "log":
        return math.log(max(value, 1e-6))
    return math.log(max(1 - value, 1e-6)) if how == "lack" else value


def mark_outliers(rows):
    """Writes into each row which of its measures are unlike the cohort's, in the bad direction."""
    for key, (_, _, how, bad) in MEASURES.items():
        known = [(row, comparable(row[key], how)) for row in rows if row[key] is not None]
        if len(known) < LEAST_FOR_OUTLIERS:
            continue
        middle = statistics.median(value for _, value in known)
        spread = 1.4826 * statistics.median(abs(value - middle) for _, value in known)
        for row, value in known:
            if spread > 0 and bad * (value - middle) / spread > OUTLIER_Z:
                row["outlier_of"].append(key)


def order(row):
    """Failures, then doubts, then the worst expected error; what is left to do last."""
    state = {"failed": 0, "done": 1, "left": 2}[row["state"]]
    return state, -(row["doubts"] or 0), -(row["worst_interval_95_mm"] or 0), row["id"]


def rows_of(layout, jobs):
    rows = [row_of(layout, job) for job in jobs]
    mark_outliers(rows)
    return sorted(rows, key=order)


def cell(value):
    if isinstance(value, list):
        return " | ".join(value)
    return "" if value is None else f"{value:.6g}" if isinstance(value, float) else value


def csv_text(columns, rows):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([cell(row[column]) for column in columns] for row in rows)
    return text.getvalue()


def label_rows(layout, rows):
    for row in rows:
        if row["state"] != "done":
            continue
        overlap = at(read_json(os.path.join(layout.pair(row["id"]), "report.json")) or {}, "overlap") or {}
        for label, after in (overlap.get("after") or {}).items():
            if label != "all":
                yield {"id": row["id"], "label": label, "name": after.get("name"), "dice": after.get("dice"),
                       "dice_before": at(overlap, "before", label, "dice"),
                       "hausdorff_95_mm": after.get("hausdorff_95_mm"),
                       "mean_surface_distance_mm": after.get("mean_surface_distance_mm")}


LABEL_COLUMNS = ["id", "label", "name", "dice_before", "dice", "hausdorff_95_mm", "mean_surface_distance_mm"]


def write_tables(layout, rows):
    with open(layout.table, "w", encoding="utf-8") as file:
        file.write(csv_text(COLUMNS, rows))
    with open(os.path.join(layout.folder, "labels.csv"), "w", encoding="utf-8") as file:
        file.write(csv_text(LABEL_COLUMNS, label_rows(layout, rows)))
