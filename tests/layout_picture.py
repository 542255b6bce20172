"""The rooms of the package as a picture in docs/images/rooms.svg, drawn from the imports: ``python -m tests.layout_picture``.

Domains are bands, above all that imports them; rooms are boxes as wide as they have lines. At the right an arc for each domain
that another imports, as thick as there are imports; one that ran upwards would be drawn red, at the left.
"""

from __future__ import annotations

from collections import Counter

from tests.conftest import ROOT
from tests.test_layout import DOMAINS, MODULES, domain_of, imports

PICTURE = ROOT / "docs" / "images" / "rooms.svg"
WIDTH, BAND, LEFT, PER_LINE = 980, 64, 120, 0.045
STYLE = (
    "text{font:12px sans-serif;fill:#222}.domain{font-weight:bold;font-size:14px}.room{fill:#dbe7f3;stroke:#4a6f94}"
    ".arc{fill:none;stroke:#7a8896}.up{stroke:#c22}"
)


def room_of(module: str) -> str:
    """The folder within a domain, or the domain itself for files that stand directly in it."""
    _, domain, *inner = module.split(".")
    folder = ROOT / "cmm_uq" / domain / inner[0] if inner else None
    return inner[0] if folder is not None and folder.is_dir() else ""


def drawn() -> str:
    lines: Counter[tuple[str, str]] = Counter()
    arrows: Counter[tuple[str, str]] = Counter()
    for module, path in MODULES.items():
        if (domain := domain_of(module)) in DOMAINS:
            lines[domain, room_of(module)] += len(path.read_text(encoding="utf-8").splitlines())
            arrows.update((domain, domain_of(other)) for other in imports(module) if domain_of(other) in DOMAINS)
    height = BAND * len(DOMAINS) + 20
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">',
        f"<style>{STYLE}</style>",
    ]
    parts.append("<title>The nine domains of the package, their rooms, and which imports from which</title>")
    for place, domain in enumerate(DOMAINS):
        top, left = 10 + BAND * place, float(LEFT)
        parts.append(f'<text class="domain" x="10" y="{top + 30}">{domain}</text>')
        rooms = sorted(
            ((room, count) for (of, room), count in lines.items() if of == domain),
            key=lambda pair: (not pair[0], pair[0]),
        )
        parts.append(f'<text x="10" y="{top + 46}">{sum(count for _, count in rooms) / 1000:.1f} k lines</text>')
        for room, count in rooms:
            width = max(8.0, PER_LINE * count)
            name = room or "files"
            box = f'x="{left:.0f}" y="{top}" width="{width:.0f}" height="46"'
            parts.append(f'<rect class="room" {box}><title>{name}: {count} lines</title></rect>')
            if width > 6.6 * len(name) + 6:
                parts.append(f'<text x="{left + 5:.0f}" y="{top + 27}">{name}</text>')
            left += width + 4
    for (one, other), count in sorted(arrows.items()):
        if one == other:
            continue
        above, below = sorted((DOMAINS.index(one), DOMAINS.index(other)))
        up = DOMAINS.index(other) > DOMAINS.index(one)
        side, bend = (LEFT - 8, -1) if up else (WIDTH - 120, 1)
        start, end = 10 + BAND * below + 18, 10 + BAND * above + 28
        parts.append(
            f'<path class="arc{" up" if up else ""}" stroke-width="{0.4 + count**0.5 / 5:.1f}" d="M{side} {start}'
            f'C{side + bend * 13 * (below - above)} {start} {side + bend * 13 * (below - above)} {end} {side} {end}">'
            f"<title>{one} imports {count} modules of {other}</title></path>"
        )
    return "\n".join([*parts, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
