"""Public benchmarks as cohorts: one module a family of sets. Each says its set's layout and rules, with the source of both,
and has `cases(data, work)`, `score(case, folder)` and `total(scores)`. None was ever run on the real files; the tests make
folders of the same form. docs/lab/benchmarks.md"""

import dataclasses
import pathlib


@dataclasses.dataclass
class Case:
    id: str
    columns: dict  # of the cohort's table: paths, or lists of paths
    truth: dict = dataclasses.field(default_factory=dict)  # what score() needs


@dataclasses.dataclass(frozen=True)
class Benchmark:
    title: str
    options: dict  # columns that are the same in every row: stated once a set, never tuned on it
    published: tuple  # (method, result, source)
    cases: object  # (data, work) -> [Case]
    score: object  # (case, folder of the result) -> {measure: number}
    total: object  # [scores] -> {measure: number}
    notes: tuple = ()


class Layout(Exception):
    """The folder is not of the set's form: what is missing and where it was looked for."""


def required(path):
    path = pathlib.Path(path)
    if not path.exists():
        raise Layout(f"'{path}' is missing; give the folder of the set as it is handed out")
    return path
