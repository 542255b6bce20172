#!/usr/bin/env python3
"""Runs cmm-uq, or its tests, on a machine that has nothing but Python 3.11 or newer.

    python3 start.py report examples/iota-1102-20C     any cmm-uq command
    python3 start.py test                              lint, types and tests, but those that take long
    python3 start.py test --all                        lint, types and every test
    python3 start.py test --numprocesses=auto --cov    every test, with the lines that they run (twice as long)
    python3 start.py docs                              the documentation as a site, in build/site

Makes a virtual environment in .venv (or in the folder that CMM_UQ_ENV names) on the first call and reuses it until
pyproject.toml changes; the system's Python is left alone. Whoever installs compiles, too: others may run it from a tree
that they cannot write to.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = Path(os.environ.get("CMM_UQ_ENV") or ROOT / ".venv")
SITE = ("--fail-on-warning", "--keep-going", "--quiet", "--conf-dir", "docs")  # a link that leads nowhere is an error
TESTS = ("--numprocesses=auto", "--dist=loadfile", "--no-loadscope-reorder")
SCRIPTS = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")


def main(arguments: list[str]) -> int:
    """Make the environment ready and run what was asked for."""
    if sys.version_info < (3, 11):
        print(f"start.py: Python 3.11 or newer is needed, this is {sys.version.split()[0]}", file=sys.stderr)
        return 2
    task = arguments[0] if arguments[:1] in (["test"], ["docs"]) else ""
    try:
        prepare(task)
        compile_changed()
        if task:
            return test(arguments[1:]) if task == "test" else docs()
        return run("cmm-uq", *arguments)
    except subprocess.CalledProcessError as error:
        print(f"start.py: {' '.join(map(str, error.cmd))} failed", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def prepare(extra: str) -> None:
    """Install the project with an extra, unless just that is installed already."""
    wanted = hashlib.sha256((ROOT / "pyproject.toml").read_bytes() + str(ROOT).encode()).hexdigest()
    marks = [ENVIRONMENT / f"installed-{name}" for name in {extra, "test"}]
    if any(mark.is_file() and mark.read_text() == wanted for mark in marks):
        return
    print(f"Preparing {ENVIRONMENT} (once; a few minutes at most) ...", file=sys.stderr, flush=True)
    if not (ENVIRONMENT / "pyvenv.cfg").is_file():
        venv.create(ENVIRONMENT, with_pip=True)
    install(f"{ROOT}[{extra}]" if extra else str(ROOT))
    # on all processors, and no tests of others, which pip compiles on one
    compile_sources(ENVIRONMENT / ("Lib" if os.name == "nt" else "lib"))
    (ENVIRONMENT / f"installed-{extra}").write_text(wanted)


def install(target: str) -> None:
    """Install by uv, in a fifth of the time that pip takes, or by pip where uv cannot: only pip reads pip's configuration."""
    python = str(SCRIPTS / "python")
    pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    uv = [python, "-m", "uv", "pip", "install", "--quiet", "--python", python, "--editable", target]
    if any(subprocess.run(command, check=False, stdout=sys.stderr).returncode for command in ([*pip, "uv"], uv)):
        print("Once more, by pip ...", file=sys.stderr, flush=True)
        subprocess.run([*pip, "--no-compile", "--editable", target], check=True, stdout=sys.stderr)


def compile_changed() -> None:
    """Compile the package where a source of it is newer than the last time."""
    package, mark = ROOT / "cmm_uq", ENVIRONMENT / "compiled"
    newest = max(path.stat().st_mtime_ns for path in package.rglob("*.py"))
    if not mark.is_file() or mark.stat().st_mtime_ns < newest:
        compile_sources(package)
        with contextlib.suppress(OSError):  # of one who may not write here, and could not compile either
            mark.touch()


def compile_sources(folder: Path) -> None:
    """Write the bytecode of all in a folder but tests of other packages, where it is missing or older than its source."""
    options = ["-qq", "-j", "0", "-x", r"site-packages[\\/].*[\\/]tests[\\/]"]
    subprocess.run([str(SCRIPTS / "python"), "-m", "compileall", *options, str(folder)], check=False)


def test(arguments: list[str]) -> int:
    """Types beside lint and tests; all run even when one fails. Tests run on all cores, each with one thread.

    Without arguments the tests that take long are left out; with ``--all`` none is; others go to pytest, which then runs all.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each command that tests start compiles the package again
    usual = TESTS if arguments else (*TESTS, "--quick")
    with subprocess.Popen(  # told when the tests are done, or its lines would stand among theirs
        [str(SCRIPTS / "mypy")], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as types:
        results = [run("ruff", "check"), run("ruff", "format", "--check")]
        results += [run("pytest", *(arguments if arguments not in ([], ["--all"]) else usual))]
        print(types.communicate()[0], end="")
    return max(*results, types.returncode)


def docs() -> int:
    """The site, from all pages anew."""
    return run("sphinx-build", *SITE, "--fresh-env", ".", "build/site")


def run(command: str, *arguments: str) -> int:
    """Run a command of the environment where the user stands; tests run in the project's folder."""
    where = None if command == "cmm-uq" else ROOT
    return subprocess.run([str(SCRIPTS / command), *arguments], cwd=where, check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
