"""Every format is read back by another program's library: fingertips within 0.1 mm of ours, angles, names and units as they were."""

import io
import json
from pathlib import Path

import numpy as np
import pytest

from handscope.app.exports import formats
from handscope.app.results.export_content import Content
from handscope.estimators.hand.anatomy import FINGERS, JOINT
from handscope.estimators.numerics import quaternions as quat
from handscope.estimators.numerics.typing import Array
from tests.simulated import DEG

NEAR = 1e-4  # m


def made(content: Content, name: str) -> bytes:
    data = formats.written(content, name)
    assert isinstance(data, bytes)
    return data


def test_opensim_finds_the_fingertips_where_we_do(
    content: Content, rows: Array, tmp_path: Path
) -> None:
    opensim = pytest.importorskip("opensim")
    formats.save(content, "opensim", tmp_path)
    model = opensim.Model(str(tmp_path / "hand.osim"))
    state = model.initSystem()
    motion = opensim.TimeSeriesTable(str(tmp_path / "motion.mot"))
    assert motion.getTableMetaDataString("inDegrees") == "yes"
    labels = list(motion.getColumnLabels())
    angles = motion.getMatrix().to_numpy()
    coordinates = model.getCoordinateSet()
    markers = model.getMarkerSet()
    assert {coordinates.get(k).getName() for k in range(coordinates.getSize())} == set(labels)
    for row in rows:
        for name, value in zip(labels, angles[row]):
            coordinates.get(name).setValue(state, float(value) * DEG, False)
        model.realizePosition(state)
        for f, finger in enumerate(FINGERS):
            place = markers.get(f"{finger}_tip").getLocationInGround(state)
            found = np.array([place.get(k) for k in range(3)])
            assert np.linalg.norm(found - content.moved.tips[row, f]) < NEAR
    q = opensim.TimeSeriesTableQuaternion(str(tmp_path / "orientations.sto"))
    assert "index_distal" in q.getColumnLabels() and q.getNumRows() == len(content.moved)


def test_bvh_has_the_fingertips_where_they_are(
    content: Content, rows: Array, tmp_path: Path
) -> None:
    bvhio = pytest.importorskip("bvhio")
    path = tmp_path / "hand.bvh"
    formats.save(content, "bvh", path)
    ends = {joint.Name: joint.EndSite for joint, _, _ in bvhio.readAsBvh(str(path)).Root.layout()}
    root = bvhio.readAsHierarchy(str(path))
    joints = {joint.Name: joint for joint, _, _ in root.layout()}
    for row in rows[::10]:
        root.loadPose(int(row), recursive=True)
        upright = root.RotationWorld
        back = np.array([upright.w, -upright.x, -upright.y, -upright.z])
        for f, finger in enumerate(FINGERS):
            place = joints[f"{finger}_distal"].pointToWorld(ends[f"{finger}_distal"])
            found = quat.rotate(back, np.array(list(place), dtype=float))
            assert np.linalg.norm(found - content.moved.tips[row, f]) < NEAR


def test_glb_has_the_fingertips_where_they_are(content: Content) -> None:
    pygltflib = pytest.importorskip("pygltflib")
    gltf = pygltflib.GLTF2.load_from_bytes(made(content, "glb"))
    values = _accessors(gltf)
    animation = gltf.animations[0]
    times = values[animation.samplers[0].input]
    rows = np.searchsorted(content.moved.t - content.moved.t[0], times.ravel() - 1e-4)
    parents = {child: k for k, node in enumerate(gltf.nodes) for child in node.children or []}
    turned = {
        c.target.node: values[animation.samplers[c.sampler].output]
        for c in animation.channels
        if c.target.path == "rotation"
    }
    for frame in np.linspace(0, len(times) - 1, 20).astype(int):
        if not np.isfinite(content.moved.tips[rows[frame]]).all():
            continue
        for f, finger in enumerate(FINGERS):
            (node,) = [k for k, n in enumerate(gltf.nodes) if n.name == f"{finger}_tip"]
            place = np.zeros(3)
            while gltf.nodes[node].name != "forearm":
                if node in turned:
                    place = quat.rotate(turned[node][frame][[3, 0, 1, 2]], place)
                place = place + np.array(gltf.nodes[node].translation or [0, 0, 0])
                node = parents[node]
            assert np.linalg.norm(place - content.moved.tips[rows[frame], f]) < NEAR


def _accessors(gltf: object) -> list[Array]:
    """Values (n, ...) of every accessor."""
    widths = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}
    kinds = {5126: "<f4", 5123: "<u2", 5125: "<u4"}
    blob, found = gltf.binary_blob(), []  # type: ignore[attr-defined]
    for a in gltf.accessors:  # type: ignore[attr-defined]
        view = gltf.bufferViews[a.bufferView]  # type: ignore[attr-defined]
        data = np.frombuffer(
            blob, kinds[a.componentType], a.count * widths[a.type], view.byteOffset
        )
        found.append(data.reshape(a.count, widths[a.type]).astype(float))
    return found


def test_the_skin_of_the_glb_hangs_together(content: Content) -> None:
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.load(io.BytesIO(made(content, "glb")), file_type="glb")
    size = scene.extents  # a hand and a piece of forearm, in m
    assert 0.15 < max(size) < 0.40 and min(size) > 0.02
    gltf = pytest.importorskip("pygltflib").GLTF2.load_from_bytes(made(content, "glb"))
    values = _accessors(gltf)
    for mesh in gltf.meshes:
        weights = values[mesh.primitives[0].attributes.WEIGHTS_0]
        np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-6)
        assert values[mesh.primitives[0].attributes.JOINTS_0].max() < len(gltf.skins[0].joints)


def test_c3d_is_read_by_our_reader_and_by_another(
    content: Content, rows: Array, tmp_path: Path
) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    from handscope.sessions.formats import c3d

    path = tmp_path / "hand.c3d"
    formats.save(content, "c3d", path)
    file = ezc3d.c3d(str(path))
    point = file["parameters"]["POINT"]
    labels = point["LABELS"]["value"]
    assert point["UNITS"]["value"] == ["mm"] and "index_pip_flexion" in point["ANGLES"]["value"]
    places = file["data"]["points"][:3]
    for f, finger in enumerate(FINGERS):
        found = places[:, labels.index(f"{finger}_tip"), rows].T * 1e-3
        np.testing.assert_allclose(found, content.moved.tips[rows, f], atol=NEAR)
    pip = places[0, labels.index("index_pip_flexion"), rows] * DEG
    np.testing.assert_allclose(pip, content.moved.angles[rows, JOINT["index_pip"], 0], atol=1e-5)
    assert "tapping" in file["parameters"]["EVENT"]["LABELS"]["value"]
    ours = c3d.read_markers(path)
    assert "little_tip" in ours.names


def test_arrays_come_back_with_names_and_units(content: Content, tmp_path: Path) -> None:
    from scipy.io import loadmat

    parquet = pytest.importorskip("pyarrow.parquet")
    angle = content.moved.angles[:, JOINT["index_pip"], 0]
    (tmp_path / "a.mat").write_bytes(made(content, "mat"))
    mat = loadmat(tmp_path / "a.mat", simplify_cells=True)
    np.testing.assert_array_equal(mat["data"]["index_pip_flexion"], angle)
    assert (mat["units"]["index_pip_flexion"], mat["about"]["simulated"]) == ("rad", "yes")
    table = parquet.read_table(io.BytesIO(made(content, "parquet")))
    np.testing.assert_array_equal(table["index_pip_flexion"].to_numpy(), angle)
    assert table.schema.field("index_tip_x").metadata == {b"unit": b"m"}
    assert table.schema.metadata[b"recording_sha256"].decode() == content.recording.checksum
    head, *lines = made(content, "jsonl").splitlines()
    assert json.loads(head)["units"]["time"] == "s" and len(lines) == len(content.moved)
    assert json.loads(lines[700])["index_pip_flexion"] == pytest.approx(angle[700], nan_ok=True)


def test_ros_2_messages_are_read_back(content: Content) -> None:
    reader = pytest.importorskip("mcap_ros2.reader")
    messages = list(reader.read_ros2_messages(io.BytesIO(made(content, "mcap-ros2"))))
    states = [m.ros_msg for m in messages if m.channel.topic == "/joint_states"]
    assert len(states) == len(content.moved)
    k = list(states[0].name).index("index_pip_flexion")
    angle = content.moved.angles[700, JOINT["index_pip"], 0]
    assert states[700].position[k] == pytest.approx(angle)
    tips = [m.ros_msg for m in messages if m.channel.topic == "/fingertips"]
    assert tips[700].poses[1].position.y == pytest.approx(content.moved.tips[700, 1, 1])
    (transform,) = [
        t
        for m in messages
        if m.channel.topic == "/tf" and m.log_time_ns == messages[0].log_time_ns
        for t in m.ros_msg.transforms
        if t.child_frame_id == "hand"
    ]
    assert transform.header.frame_id == "global"


def test_fhir_is_valid_and_tells_no_person(content: Content) -> None:
    fhir = pytest.importorskip("fhir.resources.R4B.bundle")
    text = made(content, "fhir")
    bundle = fhir.Bundle.model_validate_json(text)
    kinds = [entry.resource.get_resource_type() for entry in bundle.entry]
    assert bundle.type == "transaction" and set(kinds) == {
        "Device",
        "Observation",
        "DiagnosticReport",
        "Provenance",
    }
    tree = json.loads(text)["entry"]
    observations = [e["resource"] for e in tree if e["resource"]["resourceType"] == "Observation"]
    rate = next(o for o in observations if o["code"]["coding"][0]["code"] == "tapping_rate")
    assert rate["valueQuantity"]["code"] == "Hz" and 2 < rate["valueQuantity"]["value"] < 3
    assert {c["code"]["text"] for c in rate["component"]} == {"standard deviation", "grade"}
    (report,) = [e["resource"] for e in tree if e["resource"]["resourceType"] == "DiagnosticReport"]
    assert report["presentedForm"][0]["data"].startswith("JVBERi")  # %PDF
    assert content.recording.checksum in text.decode() and "subject" not in text.decode()


def test_redcap_gets_what_its_dictionary_names(content: Content) -> None:
    import csv

    files = formats.written(content, "redcap")
    assert not isinstance(files, bytes)
    dictionary = list(csv.DictReader(io.StringIO(files["data_dictionary.csv"].decode())))
    fields = [row["Variable / Field Name"] for row in dictionary]
    assert len(dictionary[0]) == 18 and fields[0] == "record_id" and len(set(fields)) == len(fields)
    assert all(f.islower() and f.replace("_", "").isalnum() and len(f) <= 26 for f in fields)
    data = list(csv.DictReader(io.StringIO(files["data.csv"].decode())))
    assert set(data[0]) - set(fields) == {"redcap_repeat_instrument", "redcap_repeat_instance"}
    choices = {
        row["Variable / Field Name"]: [
            c.split(",")[0].strip()
            for c in row["Choices, Calculations, OR Slider Labels"].split("|")
        ]
        for row in dictionary
        if row["Field Type"] == "radio"
    }
    assert all(row[f] in allowed for row in data for f, allowed in choices.items())
    (rate,) = [row for row in data if row["hs_figure"] == "tapping_rate"]
    assert 2 < float(rate["hs_value"]) < 3
