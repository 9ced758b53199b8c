"""What the program says of itself: its version, and every option of register with kind, choices and limits."""

import dataclasses
import hashlib
import re
import subprocess
import xml.etree.ElementTree

from .problems import CohortError

# Set by the workflow itself, or of no use in it.
NOT_IN_TABLES = {
    "output": "the folder of each pair is made below --output of the cohort",
    "save-parameters": "every run's report.json holds its parameters",
    "dry-run": "give --dry-run to tissuewarp cohort",
    "quiet": "what each run prints is kept in logs/",
    "strict": "the cohort's page and table list every doubt",
    "bids": "names of BIDS are not known to the cohort's page; run register for these",
    "threads": "give --threads to tissuewarp cohort; the bits do not depend on it",
    "help": "leave the column out", "help-all": "leave the column out",
}
FILE_TAGS = {"image", "geometry", "file", "transform", "pointfile", "table"}


@dataclasses.dataclass(frozen=True)
class Option:
    name: str
    kind: str  # file, number, integer, switch, choice, text, list
    choices: tuple = ()
    least: float = float("-inf")
    most: float = float("inf")
    repeatable: bool = False
    prepares: bool = False  # makes the patient's model: an option of prepare
    updates: bool = False  # an option of update


@dataclasses.dataclass(frozen=True)
class Program:
    path: str
    version: str
    sha256: str
    options: dict  # name: Option


def say(path, *arguments):
    try:
        done = subprocess.run([path, *arguments], capture_output=True, text=True, timeout=60)
    except OSError as failure:
        raise CohortError(f"'{path}' cannot be run ({failure.strerror}); name the program in TISSUEWARP", 3) from failure
    if done.returncode != 0:
        raise CohortError(f"'{path} {' '.join(arguments)}' ended with {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def names_in_help(path, verb):
    return set(re.findall(r"--([a-z][a-z-]+)", "\n".join(
        line[:40] for line in say(path, verb, "--help-all").splitlines() if re.match(r"  -", line))))


def kind_of(element):
    if element.tag in FILE_TAGS:
        return "file"
    return {"double": "number", "float": "number", "integer": "integer", "boolean": "switch",
            "string-enumeration": "choice", "string-vector": "list", "directory": "text"}.get(element.tag, "text")


def options_of(path):
    prepare, update = names_in_help(path, "prepare"), names_in_help(path, "update")
    options = {"config": Option("config", "file")}
    for group in xml.etree.ElementTree.fromstring(say(path, "register", "--xml")).iter("parameters"):
        for element in group:
            flag = element.findtext("longflag")
            if flag is None:
                continue
            name = flag.replace("_", "-")
            number = {tag: element.findtext(f"constraints/{tag}") for tag in ("minimum", "maximum")}
            options[name] = Option(
                name, kind_of(element), tuple(choice.text for choice in element.findall("element")),
                float(number["minimum"] or "-inf"), float(number["maximum"] or "inf"),
                name in ("moving", "fixed") or kind_of(element) == "list", name in prepare, name in update)
    return options


def read_program(path):
    version = say(path, "--version").strip().removeprefix("tissuewarp ")
    with open(path, "rb") as file:
        digest = hashlib.sha256(file.read()).hexdigest()
    return Program(str(path), version, digest, options_of(path))
