"""Draw the diagrams of build-a-glove.md: `python docs/images/glove_diagrams.py` writes three SVG files beside itself."""

from pathlib import Path

HERE = Path(__file__).parent
FONT = 'font-family="sans-serif" font-size="13"'
INK, WIRE, FILL = "#222", "#1f5f99", "#eef3f8"
FINGERS = {  # x of the finger's axis, then y of its three sensors
    "little": (110, (190, 140, 100)),
    "ring": (165, (160, 100, 55)),
    "middle": (220, (150, 85, 40)),
    "index": (275, (165, 110, 68)),
}
THUMB = ((330, 285), (370, 235), (400, 195))


def text(x: float, y: float, words: str, anchor: str = "start", colour: str = INK) -> str:
    return f'<text x="{x}" y="{y}" {FONT} fill="{colour}" text-anchor="{anchor}">{words}</text>'


def box(x: float, y: float, w: float, h: float, *lines: str) -> str:
    """A rectangle with lines of text in its middle."""
    first = y + h / 2 + 5 - 8 * (len(lines) - 1)
    words = "".join(text(x + w / 2, first + 16 * k, line, "middle") for k, line in enumerate(lines))
    return (
        f'<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="4" fill="{FILL}" stroke="{INK}"/>'
        + words
    )


def line(*points: tuple[float, float]) -> str:
    path = " ".join(f"{x},{y}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="{WIRE}" stroke-width="1.6"/>'


def dot(x: float, y: float) -> str:
    return f'<circle cx="{x}" cy="{y}" r="3" fill="{WIRE}"/>'


def save(name: str, width: int, height: int, title: str, parts: list[str]) -> None:
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" aria-label="{title}">'
    ground = f'<rect width="{width}" height="{height}" fill="white"/>'
    (HERE / name).write_text(
        "\n".join([head, f"<title>{title}</title>", ground, *parts, "</svg>", ""])
    )


def draw_hand() -> None:
    """The back of a left hand with 17 sensors; an arrow is the chip's y axis."""
    parts = [
        '<path d="M95 470 L95 250 Q90 225 130 215 L290 200 Q320 200 322 240 L320 470 Z" fill="#f6e7dc" stroke="#b89"/>',
        *(
            f'<line x1="{x}" y1="235" x2="{x}" y2="{ys[2] - 25}" stroke="#f6e7dc" stroke-width="44" stroke-linecap="round"/>'
            for x, ys in FINGERS.values()
        ),
        '<polyline points="300,330 340,270 415,175" fill="none" stroke="#f6e7dc" stroke-width="44" stroke-linecap="round"/>',
    ]
    marks = [("hand", 200, 270), ("forearm", 205, 430)]
    marks += [
        (name if k == 2 else "", x, y)
        for name, (x, ys) in FINGERS.items()
        for k, y in enumerate(ys)
    ]
    marks += [("thumb" if k == 2 else "", x, y) for k, (x, y) in enumerate(THUMB)]
    for name, x, y in marks:
        turn = 38 if (x, y) in THUMB else 0
        parts.append(f'<g transform="rotate({turn} {x} {y})">')
        parts.append(
            f'<rect x="{x - 9}" y="{y - 11}" width="18" height="22" rx="2" fill="{WIRE}"/>'
        )
        parts.append(
            f'<path d="M{x} {y + 6} L{x} {y - 6} M{x - 4} {y - 2} L{x} {y - 6} L{x + 4} {y - 2}" stroke="white" fill="none"/>'
        )
        parts.append("</g>")
        if name in ("hand", "forearm"):
            parts.append(text(x + 18, y + 5, name))
        elif name:
            parts.append(text(x, y - 40 if name != "thumb" else y - 32, name, "middle"))
    parts.append(text(440, 300, "arrow: y axis of the chip, to the fingertip"))
    parts.append(text(440, 322, "z axis: off the skin, towards you"))
    parts.append(text(440, 350, "3 sensors a finger, in the middle of"))
    parts.append(text(440, 370, "each phalanx; thumb: metacarpal,"))
    parts.append(text(440, 390, "proximal and distal phalanx"))
    parts = ['<g transform="translate(-60 30)">', *parts, "</g>"]
    save(
        "glove-sensors.svg", 720, 520, "Where the 17 sensors sit on the back of a left hand", parts
    )


def draw_strip() -> None:
    """A strip: eight wires, a decoder, three sensors, a memory chip."""
    wires = ("3V3", "GND", "SCK", "MOSI", "MISO", "A0", "A1", "EN")
    parts = [box(20, 60, 70, 280, "J1", "JST GH", "8 pins")]
    ends = {
        "3V3": 700,
        "GND": 715,
        "SCK": 730,
        "MOSI": 745,
        "MISO": 760,
        "A0": 200,
        "A1": 200,
        "EN": 200,
    }
    for k, name in enumerate(wires):
        y = 80 + 34 * k
        parts += [line((90, y), (ends[name] if k > 4 else 640, y)), text(98, y - 4, name)]
    parts.append(box(200, 235, 130, 100, "U4", "74LVC139", "2-to-4 decoder", "(one half)"))
    chips = ("U1 proximal", "U2 middle", "U3 distal", "U5 memory")
    for k, name in enumerate(chips):
        x = 370 + 105 * k
        kind = ("25LC640A",) if k == 3 else ("ICM-42688-P",)
        parts.append(box(x, 380, 95, 60, name, *kind))
        parts.append(line((330, 250 + 22 * k), (x + 80 - 0, 250 + 22 * k), (x + 80, 380)))
        parts.append(text(x + 76, 372, f"CS{k}", "end"))
        for j in range(5):
            parts += [
                line((x + 8 + 12 * j, 80 + 34 * j), (x + 8 + 12 * j, 380)),
                dot(x + 8 + 12 * j, 80 + 34 * j),
            ]
    for j in range(5):
        parts.append(line((640, 80 + 34 * j), (693 + 12 * j, 80 + 34 * j)))
    parts.append(text(20, 375, "100 nF from 3V3 to GND at every chip, 2.2 uF at J1"))
    parts.append(text(20, 397, "100 kOhm from EN to 3V3: nobody"))
    parts.append(text(20, 417, "is selected while the strip is unplugged"))
    parts.append(
        text(
            20,
            465,
            "Outputs Y0, Y1, Y2 of the decoder are CS of the sensors, Y3 is CS of the memory chip.",
        )
    )
    parts.append(
        text(
            20,
            485,
            "Sensors: SDI is MOSI, SDO is MISO, VDD and VDDIO on 3V3. Memory chip: WP and HOLD on 3V3.",
        )
    )
    save("glove-strip.svg", 960, 500, "Wiring of a strip of three sensors", parts)


def draw_base() -> None:
    """The base unit: one SPI bus and two address lines to all connectors, an enable line each."""
    names = ("hand", "thumb", "index", "middle", "ring", "little", "forearm")
    parts = [box(40, 60, 170, 350, "base unit", "Teensy 4.0")]
    shared = ("SCK 13", "MOSI 11", "MISO 12", "A0 2", "A1 3")
    for k, name in enumerate(shared):
        y = 85 + 26 * k
        parts += [line((210, y), (910, y)), text(216, y - 4, name)]
        if name != "MISO 12":
            parts.append(box(262, y - 7, 26, 14))
        for j in range(7):
            parts += [
                line((345 + 85 * j + 8 * k, y), (345 + 85 * j + 8 * k, 440)),
                dot(345 + 85 * j + 8 * k, y),
            ]
    for j, name in enumerate(names):
        x, y = 335 + 85 * j, 245 + 22 * j
        parts += [
            box(x, 440, 75, 50, f"slot {j}", name),
            line((210, y), (x + 62, y), (x + 62, 440)),
            text(216, y - 4, f"EN{j} {4 + j}"),
        ]
    parts.append(text(40, 440, "small boxes: 47 Ohm in series"))
    parts.append(text(40, 462, "10 kOhm from MISO to GND"))
    parts.append(text(40, 484, "3V3 and GND to every connector"))
    parts.append(
        text(
            40,
            40,
            "USB to the computer (through an isolator, see Safety); button: pin 14 to GND; lamp: pin 15, 1 kOhm, GND",
        )
    )
    save("glove-base.svg", 960, 510, "Wiring of the base unit", parts)


if __name__ == "__main__":
    draw_hand()
    draw_strip()
    draw_base()
