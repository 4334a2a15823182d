"""Draw the diagrams of explanation/architecture.md and conventions.md: `python docs/images/architecture_diagrams.py`."""

from glove_diagrams import FILL, INK, WIRE, box, line, save, text


def arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    return (
        f'<line x1="{x1}" y1="{y1}" x2="{x2}" y2="{y2}" stroke="{WIRE}" stroke-width="1.6" '
        'marker-end="url(#tip)"/>'
    )


TIP = (
    '<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" orient="auto">'
    f'<path d="M0 0L10 5L0 10z" fill="{WIRE}"/></marker></defs>'
)


def draw_rooms() -> None:
    """The rooms and who imports whom."""
    rooms = [
        (20, 20, "static", "pages: plain JavaScript"),
        (20, 110, "app", "server, live stations, commands, reports"),
        (20, 200, "sessions", "what is stored: files, database, wire"),
        (20, 290, "estimators", "numerics: no files, no clock, no network"),
        (500, 110, "validation", "papers, studies, benchmarks"),
        (500, 20, "firmware", "a glove's own program, C99"),
    ]
    parts = [TIP]
    for x, y, name, what in rooms:
        parts.append(box(x, y, 400 if x == 20 else 280, 56, name, what))
    parts += [arrow(220, 110, 220, 78), arrow(220, 166, 220, 198), arrow(220, 256, 220, 288)]
    parts += [arrow(500, 138, 422, 138), arrow(560, 166, 422, 305)]
    parts += [text(232, 98, "serves"), text(232, 188, "imports"), text(232, 278, "imports")]
    save("architecture-rooms.svg", 800, 366, "The rooms of Handscope and their imports", parts)


def chain(stages: list[tuple[str, str]]) -> list[str]:
    """Boxes from left to right with arrows between them."""
    parts = [TIP]
    for k, (name, what) in enumerate(stages):
        x = 10 + 172 * k
        parts.append(box(x, 30, 148, 60, name, what))
        if k:
            parts.append(arrow(x - 24, 60, x - 1, 60))
    return parts


def draw_sample() -> None:
    """One sample from the glove to the browser."""
    parts = chain(
        [
            ("glove", "COBS frame, CRC-32"),
            ("recording process", "bytes to disk first"),
            ("assembly", "blocks per stream"),
            ("method.step", "fusion, joints, tips"),
            ("station", "checks, tasks, trial"),
            ("browser", "scene and figures"),
        ]
    )
    parts += [
        box(182, 150, 148, 60, "recording.mcap", "append-only, on disk"),
        arrow(256, 90, 256, 149),
    ]
    save(
        "architecture-sample.svg",
        1040,
        230,
        "One sample's way from the glove to the browser",
        parts,
    )


def draw_file() -> None:
    """One recording from its file to the report."""
    parts = chain(
        [
            ("recording", "MCAP, BIDS, table"),
            ("reader", "streams and events"),
            ("process", "calibrate, run, check"),
            ("measures", "per task, with sd"),
            ("result", "stored, frozen"),
            ("report, exports", "PDF, BIDS, FHIR ..."),
        ]
    )
    save("architecture-file.svg", 1040, 120, "One file's way from a recording to a report", parts)


def draw_frames() -> None:
    """Segment frames of the middle finger, both hands, seen from above: palm down, fingers up the page."""
    parts = [TIP]
    for left, (ox, name) in enumerate([(560, "right"), (180, "left")]):
        parts.append(text(ox, 30, f"{name} hand, palm down", "middle"))
        parts.append(
            f'<rect x="{ox - 60}" y="240" width="120" height="110" rx="18" fill="{FILL}" stroke="{INK}"/>'
        )
        for k, (y, h) in enumerate([(170, 66), (116, 50), (72, 40)]):
            parts.append(
                f'<rect x="{ox - 16}" y="{y}" width="32" height="{h}" rx="12" fill="{FILL}" stroke="{INK}"/>'
            )
            parts.append(text(ox + 24, y + h / 2 + 4, ("proximal", "middle", "distal")[k]))
        # y distal on the left hand, proximal on the right; z to the subject's left on both
        parts += [arrow(ox, 300, ox, 256 if left else 344), text(ox + 6, 270 if left else 340, "y")]
        parts += [arrow(ox, 300, ox - 48, 300), text(ox - 46, 292, "z")]
        parts.append(f'<circle cx="{ox}" cy="300" r="7" fill="white" stroke="{WIRE}"/>')
        parts.append(
            f'<circle cx="{ox}" cy="300" r="2.5" fill="{WIRE}"/>'
            if left
            else line((ox - 4, 296), (ox + 4, 304)) + line((ox - 4, 304), (ox + 4, 296))
        )
        parts.append(text(ox + 12, 318, "x up" if left else "x down"))
        parts.append(text(ox + (78 if left else -78), 230, "thumb", "middle"))
    save("hand-frames.svg", 740, 370, "Segment frames of both hands, palm down", parts)


if __name__ == "__main__":
    draw_rooms()
    draw_sample()
    draw_file()
    draw_frames()
