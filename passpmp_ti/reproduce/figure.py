"""Figures as files: the comparison's drawings and style, made to stand alone, and light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from passpmp_ti.compare.axes import Axes, Axis, legend
from passpmp_ti.compare.style import STYLE
from passpmp_ti.compare.svg import Drawing
from passpmp_ti.viz import palette

WIDTH, HEIGHT = 560.0, 320.0
LEFT, RIGHT, TOP, BOTTOM = 60.0, 20.0, 36.0, 74.0
GAP = 10.0
"""Between the drawings of a strip [px]."""
FONT = '"system-ui", -apple-system, "Segoe UI", "DejaVu Sans", sans-serif'


def _colour(colour: palette.Colour) -> str:
    return "#" + "".join(f"{part:02x}" for part in colour)


_FILLED = {
    "ics": palette.ICS, "stays": palette.STATIC, "mover": palette.MOVER, "robot": palette.ROBOT,
    "floor": palette.FLOOR,
}  # fmt: skip
_DRAWN = {
    "wall": (palette.STATIC, 1.5), "trail": (palette.TRAIL, 2), "unsafe": (palette.UNSAFE, 0.6),
    "safe": (palette.SAFE, 0.6), "braking": (palette.BRAKING, 1), "particle": (palette.PARTICLE, 1),
    "choice": (palette.CHOICE, 2.2), "driven": (palette.EXECUTED, 1.8),
    "refused": (palette.CONTACT, 1), "frame": (palette.RULE, 1), "front": (palette.FLOOR, 1.5),
}  # fmt: skip


def _style() -> str:
    """The variables of the light page, its rules about drawings, and those of scenes."""
    light = [rule for rule in STYLE.partition("@media")[0].splitlines() if rule.startswith("  --")]
    marks = [rule for rule in STYLE.splitlines() if rule.startswith("svg .")]
    filled = [f".{name} {{ fill: {_colour(c)}; stroke: none; }}" for name, c in _FILLED.items()]
    drawn = [
        f".{name} {{ fill: none; stroke: {_colour(c)}; stroke-width: {wide}; }}"
        for name, (c, wide) in _DRAWN.items()
    ]
    return "\n".join(
        [
            ":root {", *light, f"  font-family: {FONT}; background: var(--sheet);", "}",
            "polyline { fill: none; stroke-linejoin: round; }",
            ".ics { shape-rendering: crispEdges; }",
            "text { fill: var(--ink); font-size: 13px; }", *marks, *filled, *drawn,
        ]
    )  # fmt: skip


def document(drawing: Drawing) -> str:
    """A drawing as a file of its own."""
    return _whole(drawing.size, drawing.svg())


def strip(title: str, drawings: Sequence[Drawing], columns: int) -> str:
    """Drawings of one size side by side, row after row; each is cut at its edges."""
    wide, high = drawings[0].size
    rows = -(-len(drawings) // columns)
    size = (columns * (wide + GAP) - GAP, rows * (high + GAP) - GAP)
    placed = []
    for n, drawing in enumerate(drawings):
        x, y = n % columns * (wide + GAP), n // columns * (high + GAP)
        at = f'<svg x="{x:g}" y="{y:g}" width="{wide:g}" height="{high:g}" '
        placed.append(at + drawing.svg().removeprefix("<svg "))
    told = Drawing(size, title).svg().removesuffix("</svg>")
    return _whole(size, told + "".join(placed) + "</svg>")


def _whole(size: tuple[float, float], svg: str) -> str:
    head, rest = svg.split(">", 1)
    head = head.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1)
    head += f' width="{size[0]:g}" height="{size[1]:g}"'
    return f"{head}><style>\n{_style()}\n</style>{rest}\n"


def curves(
    title: str, lines: Mapping[str, Sequence[tuple[float, float]]], x: Axis, y: Axis
) -> Drawing:
    """Lines with marks, one a name."""
    drawing = Drawing((WIDTH, HEIGHT), title)
    axes = Axes(x, y, (LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM))
    axes.draw(drawing)
    for n, (name, points) in enumerate(lines.items()):
        drawing.line([axes.at(*p) for p in points], f"curve v{n % 6}")
        for p in points:
            drawing.mark(axes.at(*p), n, f"mark v{n % 6}", f"{name}: {p[1]:.3g}")
    legend(drawing, (LEFT, HEIGHT - 4), list(lines), WIDTH)
    return drawing
