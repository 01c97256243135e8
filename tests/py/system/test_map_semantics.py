"""Semantic features of a map: updates with changes, and commands."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import change_room
import numpy as np
import pytest
import update_room
from semantic_room import embedded_map, frames, map_semantics, viewpoints
from typer.testing import CliRunner
from update_room import UPDATE

from gslts.change.detector import ChangeDetector
from gslts.cli import app
from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset
from gslts.rendering.rasterizer import render
from gslts.semantics.files import read_semantics
from gslts.semantics.lift import lift_features
from gslts.semantics.queries import SemanticQueries
from gslts.semantics.refine import refine_features
from gslts.semantics.source import Oracle
from gslts.semantics.train_autoencoder import train_autoencoder
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map, read_map, write_map_folder
from gslts.update.integrate import UpdateResult, integrate_changes
from gslts.update.object_events import object_events
from gslts.update.publish import publish
from gslts.update.region import Region
from gslts.update.selection import gaussians_in_regions
from gslts_sim.capture import capture
from gslts_sim.controller import Controller


def updated(
    kind: update_room.Kind, *, labels: bool = True, renamed: dict[str, str] | None = None
) -> UpdateResult:
    gaussian_map, _ = embedded_map()
    cameras = list(change_room.mapped()[1].values())

    class Robot(Controller):
        def observe(self) -> RgbdFrame:
            frame = super().observe()
            if not labels or frame.labels is None:
                return replace(frame, labels=None)
            types = tuple((renamed or {}).get(name, name) for name in frame.labels.types)
            return replace(frame, labels=replace(frame.labels, types=types))

    robot = Robot(update_room.changed_home(kind), **change_room.SIZE)
    robot.go(change_room.VIEWPOINTS[0])
    detector = ChangeDetector(gaussian_map, change_room.CONFIG, cameras=cameras)
    change = update_room.detected(kind)
    return integrate_changes(
        gaussian_map, cameras, [change], robot, UPDATE, detector=detector, semantics=map_semantics()
    )


def new_rows(result: UpdateResult) -> np.ndarray:
    return np.flatnonzero(~np.isin(result.gaussian_map.ids, embedded_map()[0].ids))


def test_names_are_those_of_the_labels() -> None:
    assert embedded_map()[1].names == ("Block", "Box", "Floor", "Wall")


def test_an_added_object_gets_the_features_of_the_frames() -> None:
    result = updated("addition")
    rows = new_rows(result)
    assert len(rows) > 20
    assert map_semantics().name_of(result.gaussian_map, rows) == "Box"


def test_a_relocated_object_keeps_its_features_at_its_new_position() -> None:
    """The blue box was moved from (3.0, 1.95) to (2.6, 1.7), beside the red one."""
    before = SemanticQueries(embedded_map()[0], map_semantics().codec, Oracle()).find("box")
    assert max(instance.high[0] for instance in before) > 3.0
    result = updated("relocation")
    found = SemanticQueries(result.gaussian_map, map_semantics().codec, Oracle()).find("box")
    assert max(instance.high[0] for instance in found) == pytest.approx(2.72, abs=0.05)
    rows = np.intersect1d(np.concatenate([instance.rows for instance in found]), new_rows(result))
    assert len(rows) > 20
    center = result.gaussian_map.means[rows].mean(axis=0)
    np.testing.assert_allclose(center[:2], (2.6, 1.7), atol=0.05)
    known = {row.tobytes() for row in embedded_map()[0].features}
    assert all(row.tobytes() in known for row in result.gaussian_map.features[rows])


def test_what_came_by_another_name_is_not_what_is_gone() -> None:
    result = updated("relocation", renamed={"Box": "Block"})
    assert [change.kind for change in result.changes] == ["removal", "addition"]
    assert result.record.kinds == ("removal", "addition")
    rows = new_rows(result)
    came = rows[result.gaussian_map.means[rows, 0] < 2.8]
    assert map_semantics().name_of(result.gaussian_map, came) == "Block"
    assert [
        event.type for event in object_events(embedded_map()[0], result, [], map_semantics())
    ] == [
        "Box",
        "Block",
    ]


def test_a_shifted_object_and_what_stands_on_it_keep_their_features() -> None:
    before, result = embedded_map()[0], updated("shift", labels=False)
    (rows,) = result.moved
    kept = rows & np.isin(before.ids, result.gaussian_map.ids)
    assert kept.sum() > 500
    after = np.isin(result.gaussian_map.ids, before.ids[kept])
    np.testing.assert_array_equal(result.gaussian_map.features[after], before.features[kept])
    names = {
        map_semantics().name_of(before, np.flatnonzero(kept & (before.means[:, 2] > low_m)))
        for low_m in (0.1, 0.8)
    }
    assert names == {"Block", "Box"}
    queries = SemanticQueries(result.gaussian_map, map_semantics().codec, Oracle())
    boxes = queries.find("box")
    assert max(instance.high[0] for instance in boxes) == pytest.approx(3.22, abs=0.06)


def test_without_labels_new_objects_have_no_features_and_others_keep_theirs() -> None:
    result = updated("addition", labels=False)
    unknown = ~result.gaussian_map.features.any(axis=1)
    inside = gaussians_in_regions(result.gaussian_map, [Region("after", *update_room.ADDED)], 0.01)
    of_object = np.intersect1d(new_rows(result), np.flatnonzero(inside))
    assert len(of_object) > 20
    assert unknown[of_object].all()
    assert map_semantics().name_of(result.gaussian_map, of_object) is None
    before = embedded_map()[0]
    kept = np.isin(before.ids, result.gaussian_map.ids)
    after = np.isin(result.gaussian_map.ids, before.ids)
    np.testing.assert_array_equal(result.gaussian_map.features[after], before.features[kept])


def test_a_removed_object_is_named_by_its_features(tmp_path: Path) -> None:
    result = updated("removal", labels=False)
    gaussian_map, _ = embedded_map()
    write_map_folder(tmp_path / "map", gaussian_map, {}, {})
    with open_map(tmp_path / "map", writable=True) as store:
        publish(store, gaussian_map, [], result, UPDATE, semantics=map_semantics())
        (event,) = store.events()
    assert (event.kind, event.type) == ("removal", "Box")


def test_the_box_of_a_removed_object_is_that_of_its_gaussians(tmp_path: Path) -> None:
    result = updated("removal", labels=False)
    (change,) = result.changes
    low, high = change.boxes[0]
    # A detection that includes the wall behind the object.
    longer = replace(change, boxes=((low - (0, 0.8, 0), high), None))
    gaussian_map, _ = embedded_map()
    write_map_folder(tmp_path / "map", gaussian_map, {}, {})
    with open_map(tmp_path / "map", writable=True) as store:
        publish(store, gaussian_map, [], replace(result, changes=(longer,)), UPDATE)
        (event,) = store.events()
    np.testing.assert_allclose(event.boxes[0], (low, high), atol=0.06)


def test_gradient_steps_lower_the_error() -> None:
    gaussian_map, found = embedded_map()
    views = []
    for frame in frames():
        segments = Oracle().segments(frame)
        codes = found.codec.encode(segments.embeddings)
        views.append((frame.camera, segments.labels[0], codes))

    def error(features: np.ndarray) -> float:
        changed = replace(gaussian_map, features=features)
        return float(
            np.mean(
                [
                    np.abs(render(changed, camera).features - codes[labels])[labels >= 0].mean()
                    for camera, labels, codes in views
                ]
            )
        )

    features = lift_features(gaussian_map, views, 8, threads=1)
    assert refine_features(gaussian_map, features, views, 0) is features
    assert error(refine_features(gaussian_map, features, views, 60, threads=1)) < 0.9 * error(
        features
    )


def run(*arguments: str) -> str:
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


@pytest.mark.smoke
def test_commands_add_semantics_and_answer_queries(tmp_path: Path) -> None:
    map_path, visit, image = tmp_path / "map", tmp_path / "visit", tmp_path / "box.png"
    capture(Controller(change_room.home(), **change_room.SIZE), viewpoints(), visit)
    cameras = {frame.name: frame.read().camera for frame in open_dataset(visit).frames}
    write_map_folder(map_path, change_room.mapped()[0], {}, cameras)
    with pytest.raises(ValueError, match=r"has no semantic features; gslts semantics adds them"):
        run("query", str(map_path), "box")
    printed = run("semantics", str(map_path), str(visit), "--code-dims", "8", "--threads", "1")
    assert "map: added semantic features as version 2, in " in printed
    found = json.loads(run("query", str(map_path), "box", "--json", "--image", str(image)))
    assert len(found) == 2
    assert image.exists()
    drawn = run("query", str(map_path), "box", "--image", str(image))
    assert drawn.splitlines()[-1] == f"wrote {image}"
    for item in found:
        np.testing.assert_allclose(item["high_m"][2], change_room.BLOCK_TOP_M + 0.3, atol=0.04)
    assert run("query", str(map_path), "piano") == "piano: not found\n"
    assert read_semantics(Path(f"{map_path}@1")) is None
    with pytest.raises(ValueError, match="has no semantic features"):
        run("query", f"{map_path}@1", "box")


def test_an_updated_map_is_rejected(tmp_path: Path) -> None:
    map_path, visit = tmp_path / "map", tmp_path / "visit"
    capture(Controller(change_room.home(), **change_room.SIZE), change_room.VIEWPOINTS[:2], visit)
    cameras = {frame.name: frame.read().camera for frame in open_dataset(visit).frames}
    write_map_folder(map_path, change_room.mapped()[0], {}, cameras)
    fewer = read_map(map_path).select(np.arange(100, change_room.mapped()[0].size))
    with open_map(map_path, writable=True) as store:
        store.commit(fewer, UpdateCause())
    with pytest.raises(ValueError, match=r"was updated since .*gslts restore .* 1 returns"):
        run("semantics", str(map_path), str(visit))


def test_a_damaged_autoencoder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "gslts.semantics.train_autoencoder.train_autoencoder",
        partial(train_autoencoder, steps=20),
    )
    map_path, visit = tmp_path / "map", tmp_path / "visit"
    capture(Controller(change_room.home(), **change_room.SIZE), change_room.VIEWPOINTS[:2], visit)
    cameras = {frame.name: frame.read().camera for frame in open_dataset(visit).frames}
    write_map_folder(map_path, change_room.mapped()[0], {}, cameras)
    run("semantics", str(map_path), str(visit), "--code-dims", "8", "--threads", "1")
    assert run("verify", str(map_path)) == "2 versions are intact\n"
    (path,) = (map_path / "semantics").iterdir()
    path.write_bytes(path.read_bytes()[:-1] + b"\0")
    with pytest.raises(ValueError, match=r"the file is damaged; run gslts semantics"):
        run("query", str(map_path), "box")
    for what in ("damaged", "missing"):
        done = CliRunner().invoke(app, ["verify", str(map_path)])
        assert done.stderr.splitlines()[-1] == (
            f"version 2: {path}: the file is {what}; run gslts semantics to compute the semantic "
            "features again"
        )
        path.unlink(missing_ok=True)
