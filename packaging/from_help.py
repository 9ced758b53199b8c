#!/usr/bin/env python3
"""Man pages and bash completion from what the program says of itself.

    from_help.py PROGRAM SHARE      writes SHARE/man/man1/*.1.gz and SHARE/bash-completion/completions/tissuewarp
"""

import gzip
import pathlib
import re
import subprocess
import sys


def say(program, *arguments):
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def sections(text):
    """What stands before the first heading, and [(heading, lines)]. A heading ends with a colon and is not indented."""
    before, found = [], []
    for line in text.splitlines():
        heading = re.fullmatch(r"(\S[^:]*):", line)
        if heading:
            found.append((heading[1], []))
        else:
            (found[-1][1] if found else before).append(line)
    return before, found


def entries(lines):
    """[(what, meaning)] of an indented list: the meaning stands two blanks or more behind, or on the lines below."""
    result = []
    for line in lines:
        entry = re.fullmatch(r" {2}(\S.*?)(?: {2,}(\S.*))?", line)
        if entry:
            result.append([entry[1], entry[2] or ""])
        elif line.strip() and result:
            result[-1][1] = f"{result[-1][1]} {line.strip()}".strip()
    return result


def verbs_of(program):
    return [what.split()[0] for heading, lines in sections(say(program, "--help"))[1] if heading == "Subcommands"
            for what, _ in entries(lines)]


def escaped(text):
    text = text.replace("\\", r"\e").replace("-", r"\-")
    return r"\&" + text if text.startswith((".", "'")) else text


def man_page(name, version, text, others):
    before, found = sections(text)
    about = [line.strip() for line in before if line.strip()]
    usage = next((line for line in about if line.startswith("Usage: ")), None)
    about = [line for line in about if line != usage]
    lines = [f'.TH {name.upper()} 1 "" "tissuewarp {version}" "User commands"', ".SH NAME",
             escaped(name) + r" \- " + escaped(about[0].rstrip(".")), ".SH SYNOPSIS",
             escaped(usage.removeprefix("Usage: ") if usage else name.replace("-", " ", 1))]
    if about[1:]:
        lines += [".SH DESCRIPTION", *map(escaped, about[1:])]
    for heading, body in found:
        lines.append(f".SH {heading.upper()}")
        listed = entries(body)
        if heading.startswith("Example"):
            lines += [".nf", *(escaped(line.strip()) for line in body if line.strip()), ".fi"]
            continue
        for what, meaning in listed:
            lines += [".TP", ".B " + escaped(what), escaped(meaning)]
    lines += [".SH SEE ALSO", ", ".join(f"\\fB{escaped(other)}\\fR(1)" for other in others if other != name)]
    return "\n".join(lines) + "\n"


def options_of(text):
    """--names, and which of them take a file."""
    names, files = [], []
    for heading, lines in sections(text)[1]:
        for what, _ in entries(lines):
            for name in re.findall(r"--[a-z][a-z0-9-]*", what.split(" ")[0]):
                names.append(name)
                if re.search(r" (FILE|FOLDER)", what):
                    files.append(name)
    return sorted(set(names)), sorted(set(files))


def completion(program, verbs):
    cases = []
    for verb in verbs:
        names, files = options_of(say(program, verb, "--help-all"))
        cases.append(f"        {verb}) options='{' '.join(names)}'; files='{' '.join(files)}' ;;")
    return f"""# Completion of tissuewarp for bash.
_tissuewarp() {{
    local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} options='' files=''
    COMPREPLY=()
    if [ "$COMP_CWORD" -eq 1 ]; then
        COMPREPLY=($(compgen -W '{' '.join(verbs)} --help --version' -- "$word"))
        return
    fi
    case ${{COMP_WORDS[1]}} in
{chr(10).join(cases)}
    esac
    case " $files " in *" $before "*) compopt -o default; return ;; esac
    case $word in
        -*) COMPREPLY=($(compgen -W "$options" -- "$word")) ;;
        *) compopt -o default ;;
    esac
}}
complete -F _tissuewarp tissuewarp
"""


def main(program, share):
    share = pathlib.Path(share)
    version = say(program, "--version").split()[-1]
    verbs = verbs_of(program)
    if not verbs:
        sys.exit(f"from_help.py: '{program} --help' lists no subcommands")
    pages = {"tissuewarp": say(program, "--help")}
    pages.update({f"tissuewarp-{verb}": say(program, verb, "--help-all") for verb in verbs})
    for name, text in pages.items():
        path = share / "man/man1" / f"{name}.1.gz"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(gzip.compress(man_page(name, version, text, pages).encode(), mtime=0))
    path = share / "bash-completion/completions/tissuewarp"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(completion(program, verbs))


if __name__ == "__main__":
    main(*sys.argv[1:])
