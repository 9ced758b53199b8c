"""The table as text: columns known, rows whole, ids good for folders."""

import csv
import dataclasses
import difflib
import pathlib
import re

from .problems import CohortError, Problem
from .program import NOT_IN_TABLES

# Besides the options of register. The first three names are short for options.
SHORT = {"labels": "moving-labels", "true-labels": "true-labels"}
OWN = {
    "id": "name of the pair and of its folder",
    "true-labels": "what the warped labels are scored against, and never registered to",
    "held-out": "surface points that were not registered to, for scoring",
    "from": "patient that moves, for groups and loops",
    "to": "patient that is fixed, for groups and loops",
}
SEPARATOR = "|"  # of several files or values in one cell
MOST_BYTES = 256 << 20


@dataclasses.dataclass
class Row:
    number: int  # line of the table
    id: str
    cells: dict  # column: text, without what is empty


def canonical(header):
    name = header.strip().lower().replace("_", "-")
    return SHORT.get(name, name)


def rows_of_file(path):
    """(number, cells) of every line that is not empty."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise CohortError(f"'{path}' has more than {MOST_BYTES >> 20} MB and is no table of pairs; give a CSV table", 2)
        text = path.read_text(encoding="utf-8-sig")
    except OSError as failure:
        raise CohortError(f"'{path}' cannot be read ({failure.strerror}); give a CSV table", 3) from failure
    except UnicodeDecodeError as failure:
        raise CohortError(f"'{path}' is not UTF-8 at byte {failure.start}; save the table as CSV in UTF-8", 2) from failure
    if "\0" in text:
        raise CohortError(f"'{path}' holds zero bytes; save the table as CSV", 2)
    head = text.partition("\n")[0]
    delimiter = next((sign for sign in ",;\t" if sign in head), ",")
    reader = csv.reader(text.splitlines(), delimiter=delimiter, strict=True)
    try:
        return [(reader.line_num, [cell.strip() for cell in line]) for line in reader if any(map(str.strip, line))]
    except csv.Error as failure:
        raise CohortError(f"'{path}', line {reader.line_num}: {failure}; close its quotes", 2) from failure


def check_header(header, options):
    problems, known = [], {**OWN, **options}
    for place, name in enumerate(header):
        if name in NOT_IN_TABLES:
            problems.append(Problem(1, name, "", "is no column of a cohort", NOT_IN_TABLES[name]))
        elif name not in known:
            near = difflib.get_close_matches(name, known, 1)
            remedy = f"did you mean '{near[0]}'?" if near else "see tissuewarp register --help-all for what there is"
            problems.append(Problem(1, name, "", "is no option of register", remedy))
        if name in header[:place]:
            problems.append(Problem(1, name, "", "stands there twice",
                                    f"write several values into one cell, separated by {SEPARATOR}"))
    if "id" not in header:
        problems.append(Problem(1, "id", "", "is missing", "add a column 'id' that names each pair"))
    return problems


def check_id(row, seen):
    if not row.id:
        return Problem(row.number, "id", "", "is empty", "name the pair")
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}", row.id):
        return Problem(row.number, "id", row.id, "is no name for a folder",
                       "take at most 80 letters, digits, '.', '_' and '-', a letter or digit first")
    if row.id.lower() in seen:
        return Problem(row.number, "id", row.id, f"is also that of row {seen[row.id.lower()]}", "name each pair once")
    seen[row.id.lower()] = row.number
    return None


def read_table(path, options):
    """(rows, problems). Cells are stripped; columns are named as options are, with hyphens."""
    path = pathlib.Path(path)
    lines = rows_of_file(path)
    if not lines:
        raise CohortError(f"'{path}' is empty; give a CSV table with a column 'id'", 2)
    header = [canonical(name) for name in lines[0][1]]
    problems = check_header(header, options)
    if len(lines) == 1:
        problems.append(Problem(0, "", "", "it has no rows", "write one line for each pair"))
    rows = []
    for number, line in lines[1:]:
        if len(line) != len(header):
            problems.append(Problem(number, "", "", f"has {len(line)} cells where the first line has {len(header)}",
                                    "quote cells that hold the separator"))
            continue
        cells = {name: cell for name, cell in zip(header, line) if cell}
        rows.append(Row(number, cells.pop("id", ""), cells))
    return rows, problems


def check_ids(rows):
    seen = {}
    return [problem for problem in (check_id(row, seen) for row in rows) if problem]
