"""The operator's screen: on a terminal one that stands still, with a line to type in; elsewhere lines, each once."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from cmm_uq.app.cli.terminal import on_terminal, say, say_now
from cmm_uq.base.output.interruption import speaking

if TYPE_CHECKING:
    from rich.console import RenderableType

    from cmm_uq.base.messages import Text
    from cmm_uq.laboratory.live.running import Acquisition
    from cmm_uq.laboratory.live.screen import SessionView as View

PROMPT = "> "
_LINES = 12  # of what happened, that stay on the screen
_ERASE = ("\x7f", "\b")


def operated(acquisition: Acquisition, *, plain: bool, quiet: bool) -> None:
    """Run a session before its operator; ``plain``: lines, although there is a terminal; ``quiet``: nothing but errors."""
    from cmm_uq.laboratory.live.running import OperatorLine as Line

    def typed(text: str | None) -> None:
        acquisition.items.put(Line(text))

    if plain or quiet or not (on_terminal(sys.stdin) and on_terminal(sys.stdout)) or not _keys_can_be_read():
        screen = Plain(quiet=quiet)
        threading.Thread(target=_lines, args=(typed,), daemon=True).start()
        acquisition.run(screen)
    else:
        with Whole.shown(typed) as whole:
            acquisition.run(whole)
    if not quiet:
        _ended(acquisition)


class Plain:
    """Says each thing once, and what comes next whenever that changes."""

    def __init__(self, *, quiet: bool) -> None:
        self._quiet, self._last = quiet, ""

    def tell(self, text: Text) -> None:
        if not self._quiet:
            say_now(str(text))

    def show(self, view: View) -> None:
        now = f"{view.head}; next: {view.next}"
        if now != self._last and not self._quiet:
            self._last = now
            say_now(now)


class Whole:
    """A screen of rich that stands still."""

    def __init__(self, live: Any) -> None:
        self._live, self._typed = live, ""
        self._view: View | None = None

    @classmethod
    @contextlib.contextmanager
    def shown(cls, typed: Callable[[str | None], None]) -> Iterator[Whole]:
        """While it lasts, keys go to ``typed``, a line at a time; afterwards the terminal is as it was, whatever happens."""
        from rich.console import Console
        from rich.live import Live

        with _every_key() as restore:
            live = Live(console=Console(highlight=False), auto_refresh=False, screen=True)
            whole = cls(live)
            threading.Thread(target=whole._keys, args=(typed,), daemon=True).start()

            def hush() -> None:
                restore()
                with contextlib.suppress(OSError):
                    os.write(sys.stdout.fileno(), b"\x1b[?1049l\x1b[?25h")

            with speaking(hush), live:
                yield whole

    def tell(self, text: Text) -> None:
        """See :class:`~cmm_uq.laboratory.live.running.Screen`: it stands on the screen."""

    def show(self, view: View) -> None:
        self._view = view
        self._live.update(_page(view, self._typed, self._live.console.size.height), refresh=True)

    def _keys(self, typed: Callable[[str | None], None]) -> None:
        while True:
            try:
                chunk = os.read(sys.stdin.fileno(), 1024).decode(errors="replace")
            except OSError:
                chunk = ""
            if not chunk:
                typed(None)
                return
            for key in chunk:
                self._key(key, typed)

    def _key(self, key: str, typed: Callable[[str | None], None]) -> None:
        if key in "\r\n":
            line, self._typed = self._typed, ""
            typed(line)
        elif key in _ERASE:
            self._typed = self._typed[:-1]
        elif key == "\x15":
            self._typed = ""
        elif key == "\x04":
            typed(None)
        elif key.isprintable():
            self._typed += key


def _page(view: View, typed: str, height: int) -> RenderableType:
    from rich.console import Group
    from rich.text import Text as Styled

    rows = [Styled(str(view.head), style="bold red" if view.head.startswith("NOTHING") else "bold"),
            Styled(f"next: {view.next}", style="bold cyan")]  # fmt: skip
    rows += [Styled(line, no_wrap=True) for line in view.picture]
    rows += [Styled(str(text), style="bold") for text in view.shown]
    rows += [Styled(str(view.again), style="bold yellow")] if view.again else []
    rows += [Styled(str(text), style="red" if "NOT within" in text else "") for text in view.temperatures]
    rows += [Styled(str(text), style="dim") for text in view.instruments]
    room = max(1, min(_LINES, height - len(rows) - 3))
    rows += [Styled(str(text), style="yellow" * text.startswith(("WARNING", "REPEAT"))) for text in view.said[-room:]]
    keys = "Enter takes the point · x y z · undo REASON · repeat · skip · go N · note · clear · pause · help · quit"
    return Group(*rows, Styled(f"{PROMPT}{typed}▏", style="reverse"), Styled(keys, style="dim"))


def _lines(typed: Callable[[str | None], None]) -> None:
    """Lines of standard input, to its end."""
    with contextlib.suppress(OSError, ValueError):
        while sys.stdin is not None and (line := sys.stdin.readline()):
            typed(line.rstrip("\r\n"))
    typed(None)


def _keys_can_be_read() -> bool:
    try:
        import termios  # noqa: F401
    except ImportError:  # Windows: lines
        return False
    return True


@contextlib.contextmanager
def _every_key() -> Iterator[Callable[[], None]]:
    """Keys come one by one and are not echoed; gives what puts the terminal back."""
    import termios
    import tty

    file = sys.stdin.fileno()
    before = termios.tcgetattr(file)

    def restore() -> None:
        with contextlib.suppress(termios.error):
            termios.tcsetattr(file, termios.TCSADRAIN, before)

    try:
        tty.setcbreak(file)
        yield restore
    finally:
        restore()


def _ended(acquisition: Acquisition) -> None:
    """How it stands at the end."""
    view, story = acquisition.conductor.view(), acquisition.conductor.story
    say(f"{view.head}; {len(story.points)} points are kept in {acquisition.journals.folder}")
    say(f"cmm-uq report {acquisition.folder}" if acquisition.conductor.reportable else "no set-up is complete yet")
