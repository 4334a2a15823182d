"""The printed sheet and photographs of it: rendered, found, refused with what to do; the command line too."""

import json
import struct
import warnings
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from handscope.app.cli import main
from handscope.app.language import languages
from handscope.app.photograph.printing import marker_cells, print_sheet
from handscope.estimators.errors import InputError
from handscope.estimators.hand.geometry import sized
from handscope.estimators.photograph.sheet import IDS, MARKER, Sheet

cv2 = pytest.importorskip("cv2")

from handscope.app.photograph.pictures import measure_hand, open_photograph, without_description  # noqa: E402
from handscope.validation.studies.rendered_photographs import Rendered, render  # noqa: E402


@pytest.fixture(scope="module")
def taken() -> Rendered:
    return render(np.random.default_rng(8), "left", "a4", np.radians(15))


def test_the_photograph_tells_lengths_and_angles(taken: Rendered) -> None:
    photograph = open_photograph(taken.jpeg, "left")
    assert photograph.sheet == Sheet("a4", "left") and photograph.markers >= 4
    assert np.degrees(photograph.camera.tilt) == pytest.approx(15, abs=2)
    figures = measure_hand([(photograph, taken.marks)])
    off = [1e3 * (v - taken.geometry.lengths[k]) for k, v in figures.lengths.items()]
    # No further off than the worst picture of docs/validation/photograph.md
    assert np.sqrt(np.mean(np.square(off))) < 2.35
    turned = [np.degrees(v - taken.deviation[k]) for k, v in figures.deviation.items()]
    assert np.sqrt(np.mean(np.square(turned))) < 1.73


def test_landmarks_are_proposed_near_where_they_are(taken: Rendered) -> None:
    photograph = open_photograph(taken.jpeg, "left")
    proposed = photograph.proposed(taken.geometry)
    off = [np.linalg.norm(proposed[k] - taken.marks[k]) for k in taken.marks]
    assert np.median(off) < 100  # pixels, some 15 mm


def test_markers_are_those_of_the_family_and_lie_where_they_should() -> None:
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    for number in range(3 * IDS + 10):
        cells = cv2.aruco.generateImageMarker(family, number, 8)[1:-1, 1:-1] > 0
        assert marker_cells(number) == ["".join("01"[int(c)] for c in row) for row in cells]
    sheet, ppi = Sheet("letter", "right"), 127.0
    png = print_sheet(sheet, sized("right"), languages()["de"], "png", ppi)
    grey = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_GRAYSCALE)
    corners, numbers, _ = cv2.aruco.ArucoDetector(family).detectMarkers(grey)
    drawn = sheet.free_markers(sized("right"))
    assert sorted(numbers.ravel()) == sorted(drawn)
    for k, found in zip(numbers.ravel(), corners):
        mm = found[0].mean(axis=0) * 25.4 / ppi
        x, y = drawn[int(k)].mean(axis=0)[:2] + [0.2159 / 2, 0]
        np.testing.assert_allclose(mm, [1e3 * x, 1e3 * (0.2794 / 2 - y)], atol=0.3)
    assert np.ptp(next(iter(drawn.values()))[:, 0]) == pytest.approx(MARKER)


def changed(taken: Rendered, *, hide: float = 0.0, size: int = 0) -> bytes:
    """The picture with a share of its right side hidden, or made small."""
    picture = cv2.imdecode(np.frombuffer(taken.jpeg, np.uint8), cv2.IMREAD_COLOR)
    if hide:
        picture[:, round((1 - hide) * picture.shape[1]) :] = 90
    if size:
        picture = cv2.resize(picture, (size, size * 3 // 4), interpolation=cv2.INTER_AREA)
    return bytes(cv2.imencode(".jpg", picture)[1])


def test_pictures_that_will_not_do_are_refused_with_what_to_do(taken: Rendered) -> None:
    with pytest.raises(InputError, match="for the left hand"):
        open_photograph(taken.jpeg, "right")
    with pytest.raises(InputError, match="whole sheet in it"):
        open_photograph(changed(taken, hide=0.7), "left")
    with pytest.raises(InputError, match="take one of"):
        open_photograph(changed(taken, size=400), "left")
    with pytest.raises(InputError, match="no JPEG"):
        open_photograph(b"GIF89a", "left")
    with pytest.raises(InputError, match="ruler 40 mm"):
        open_photograph(taken.jpeg, "left", 0.040)
    oblique = render(np.random.default_rng(1), "left", "a4", np.radians(45))
    with pytest.raises(InputError, match="over the middle of the sheet"):
        open_photograph(oblique.jpeg, "left")


def test_a_print_that_was_scaled_is_measured_by_its_ruler(taken: Rendered) -> None:
    marks = taken.marks
    true, large = (
        measure_hand([(open_photograph(taken.jpeg, "left", ruler), marks)]).lengths["hand"]
        for ruler in (None, 0.105)
    )
    assert large / true == pytest.approx(1.05, abs=0.01)


def test_the_command_line_proposes_and_measures(
    taken: Rendered, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, marks, found = (tmp_path / n for n in ("hand.jpg", "marks.json", "found.json"))
    picture.write_bytes(taken.jpeg)
    words = ["photograph", str(picture), "--hand", "left"]
    assert main([*words, "--propose", str(marks)]) == 0
    assert main([*words, "--marks", str(marks), "--json", str(found)]) == 0
    assert "index mcp deviation" in capsys.readouterr().out
    told = json.loads(found.read_text())
    assert told["geometry"]["palm_length"] == pytest.approx(0.083, abs=0.02)
    assert told["initial_pose"]["index_mcp_deviation_sd_deg"] > 0
    both = ["photograph", str(picture), str(picture), "--hand", "left"]
    assert main([*both, "--marks", str(marks), str(marks)]) == 0
    assert main([*words, "--marks", str(marks), str(marks)]) == 2
    assert "files of landmarks" in capsys.readouterr().err
    marks.write_text("[]")
    assert main([*words, "--marks", str(marks)]) == 2
    assert main(["photograph", str(tmp_path / "none.jpg"), "--hand", "left", "--propose", "x"]) == 2


def test_the_sheet_is_a_pdf_of_the_papers_size(tmp_path: Path) -> None:
    pypdf = pytest.importorskip("pypdf")
    out = tmp_path / "sheet.pdf"
    assert main(["pose-sheet", "--hand", "right", "--paper", "letter", "--out", str(out)]) == 0
    page = pypdf.PdfReader(BytesIO(out.read_bytes())).pages[0]
    size = float(page.mediabox.width), float(page.mediabox.height)
    np.testing.assert_allclose(size, [612, 792], atol=0.5)
    assert "right hand" in page.extract_text()
    assert main(["pose-sheet", "--hand", "left", "--out", str(tmp_path / "sheet.png")]) == 2
    long = tmp_path / "long.json"
    long.write_text('{"hand_length": 0.29}')
    assert main(["pose-sheet", "--hand", "left", "--geometry", str(long), "--out", str(out)]) == 2


def test_a_damaged_description_is_ignored() -> None:
    """Its exposure time is said to stand beyond the file."""
    entry = struct.pack(">HHIIH", 0x829A, 5, 1, 0xFFFF, 0)
    described = b"Exif\0\0MM\0*\0\0\0\x08" + struct.pack(">H", 1)
    described += struct.pack(">HHIII", 0x8769, 4, 1, 26, 0) + struct.pack(">H", 1) + entry
    out = BytesIO()
    Image.new("RGB", (1000, 700), "white").save(out, "JPEG", exif=described)
    with (
        warnings.catch_warnings(record=True, action="always") as seen,
        pytest.raises(InputError, match="marker"),
    ):
        open_photograph(out.getvalue(), "left")
    assert seen == []
    assert without_description(out.getvalue()).startswith(b"\xff\xd8")
