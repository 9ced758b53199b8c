"""What is wrong with a table: all of it, with row, column, value and remedy."""

import dataclasses

MOST_SHOWN = 100


@dataclasses.dataclass(frozen=True)
class Problem:
    row: int  # line of the table; 0: the table itself
    column: str
    value: str
    what: str
    remedy: str

    def __str__(self):
        place = f"row {self.row}" if self.row else "the table"
        column = f", column '{self.column}'" if self.column else ""
        value = f", '{self.value}'" if self.value else ""
        return f"{place}{column}{value}: {self.what}; {self.remedy}"


class Refused(Exception):
    """The table cannot be run as it is."""

    def __init__(self, problems):
        super().__init__(f"{len(problems)} problems")
        self.problems = sorted(problems, key=lambda problem: (problem.row, problem.column))

    def __str__(self):
        shown = [str(problem) for problem in self.problems[:MOST_SHOWN]]
        if len(self.problems) > MOST_SHOWN:
            shown.append(f"and {len(self.problems) - MOST_SHOWN} more")
        return "\n".join(shown)


class CohortError(Exception):
    """What ends a run, in one sentence with a remedy; `code` is the exit code, as the program has them."""

    def __init__(self, message, code=1):
        super().__init__(message)
        self.code = code
