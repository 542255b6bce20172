"""What a notebook shows: of what was found a line, tables and pictures as on its certificate; of an export how it was read."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property, partial
from html import escape
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from cmm_uq.base.errors import CmmUqError
from cmm_uq.base.messages import NOTHING, Text, html_table
from cmm_uq.base.units import printed_unit
from cmm_uq.base.values import dataclass
from cmm_uq.certificate.document import Document, Table
from cmm_uq.certificate.plots.style import as_svg, figures_kept
from cmm_uq.jobs.columns import WHOLE
from cmm_uq.jobs.importing.recording import ImportedTable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


def figures_of(compose: Callable[[], object]) -> dict[str, Figure]:
    """What is drawn where something is composed, by name; of several of one name the second is ``name 2``."""
    found: dict[str, Figure] = {}
    with figures_kept() as kept:
        compose()
    for name, figure in kept:
        same = sum(other.split(" ")[0] == name for other in found)
        figure.set_facecolor("white")
        figure._repr_svg_ = partial(as_svg, figure)  # type: ignore[attr-defined]  # a notebook asks for it
        found[f"{name} {same + 1}" if same else name] = figure
    return found


def chosen(pictures: Mapping[str, Figure], name: str | None, first: Iterable[str], of: str) -> Figure:
    """A picture by its name; without one the first that there is, of ``first`` or of all."""
    names = (*first, *pictures) if name is None else (name,)
    found = next((pictures[one] for one in names if one in pictures), None)
    if found is None:
        fix = f"It has {', '.join(pictures)}" if pictures else "Use its figures"
        raise CmmUqError(f"{of} has no picture {name!r}" if name else f"{of} has no picture", fix=fix)
    return found


def frames_of(document: Document) -> dict[str, pd.DataFrame]:
    """Tables of a document by their captions, every cell as it is printed, units in the headings."""
    import pandas as pd

    found: dict[str, pd.DataFrame] = {}
    for table in (block for section in document.sections for block in section.blocks if isinstance(block, Table)):
        heads = [_plain(one.heading, one.unit) for one in table.columns]
        name, same = str.__str__(table.caption), sum(one.startswith(table.caption) for one in found)
        rows = [[str.__str__(cell) for cell in row] for row in table.rows]
        found[f"{name} ({same + 1})" if name in found else name] = pd.DataFrame(rows, columns=heads)
    return found


def _plain(heading: Text, unit: Text = NOTHING) -> str:
    return " / ".join(str.__str__(text) for text in (heading, unit) if text)


class NotebookView(Protocol):
    """A line, tables, pictures and warnings."""

    first: ClassVar[tuple[str, ...]] = ()  # names of the picture that ``plot`` gives of itself, the first that there is

    @property
    def warnings(self) -> tuple[str, ...]:
        """What must be known before a figure is used."""

    def compose(self) -> Document:
        """The certificate or page, composed anew."""

    def _tables(self) -> list[str]:
        """Tables of HTML."""

    def _repr_html_(self) -> str:
        warned = "".join(f"<li>{escape(text)}</li>" for text in self.warnings)
        return f"<p>{escape(repr(self))}</p>{''.join(self._tables())}" + (f"<ul>{warned}</ul>" if warned else "")

    @cached_property
    def pictures(self) -> Mapping[str, Figure]:
        """Every picture of the certificate or page by its name, as matplotlib figures."""
        return figures_of(self.compose)

    @cached_property
    def tables(self) -> Mapping[str, pd.DataFrame]:
        """Every table of the certificate or page by its caption: cells as printed, so rounded by their uncertainty."""
        return frames_of(self.compose())

    def plot(self, name: str | None = None) -> Figure:
        """A picture as a matplotlib figure, which a notebook shows and ``savefig`` writes.

        Parameters
        ----------
        name : one of ``pictures``; without one the picture that says most.

        Raises
        ------
        CmmUqError : there is no such picture; it names those that there are.
        """
        return chosen(self.pictures, name, self.first, repr(self)[1:-1].partition(":")[0])


@dataclass(frozen=True, eq=False, repr=False)
class Export:
    """An export of another program as it was read."""

    found: ImportedTable

    @cached_property
    def points(self) -> pd.DataFrame:
        """A row a point, with the columns of a recording, by the line of the file: what :func:`cmm_uq.job` takes."""
        import pandas as pd

        frame = pd.DataFrame(self.found.columns, index=pd.Index(self.found.lines, name="line"))
        return frame.astype({name: int for name in frame.columns if name in WHOLE})

    @cached_property
    def columns(self) -> pd.DataFrame:
        """What each column of the recording was taken from: the file's heading, and the unit that it is in now."""
        import pandas as pd

        taken = {name: (heading, printed_unit(name)) for name, heading in self.found.recognised.columns.items()}
        return pd.DataFrame.from_dict(taken, orient="index", columns=["heading", "unit"])

    @property
    def reading(self) -> Mapping[str, str]:
        """How the file was read, in words: its format, units and decimal sign, what was filled in, what is not used."""
        return {str.__str__(what): str.__str__(value) for what, value in self.found.recognised.rows}

    def __repr__(self) -> str:
        read = self.found.recognised
        return f"<Export {read.file}: {read.title}, {read.points} points>"

    def _repr_html_(self) -> str:
        return html_table(repr(self)[1:-1], (), self.reading.items()) + str(self.points.head(10).to_html())


class DiagnosisResults(dict[str, Any]):
    """What the model of a job leaves out, as in results.json; ``plot`` draws it."""

    def __init__(self, found: Mapping[str, Any], draw: Callable[[str | None], Figure]) -> None:
        super().__init__(found)
        self._draw = draw

    def plot(self, name: str | None = None) -> Figure:
        """A picture of the diagnosis, ``field`` where none is named: the residuals as vectors in the volume."""
        return self._draw(name)
