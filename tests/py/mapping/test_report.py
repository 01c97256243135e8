"""Report of a mapping run: content, self-containedness and size of the page."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scenes
from PIL import Image

from gslts.core.frame import RgbdFrame
from gslts.io.images import error_image
from gslts.mapping.observation import Observation
from gslts.mapping.report.images import shrink
from gslts.mapping.report.page import MAX_VIEWS, CurvePoint, ReportData, View, write_report
from gslts.mapping.report.summary import MIN_TRAINING_PSNR_DB, _views, warning_of

VOID = {"meta", "img", "br", "link", "input", "hr"}
EVIL = "<script>alert('x')</script>&\"><img src=http://a.example/b>"


class Page(HTMLParser):
    """Independent reader of a page: texts, images, and whether all elements are closed."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.texts: list[str] = []
        self.sources: list[str] = []
        self.rows: list[list[str]] = []
        self.feed(path.read_text(encoding="utf-8"))
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        for name, value in attrs:
            if name == "src":
                self.sources.append(value)
            else:
                assert name != "href"
                assert not name.startswith("on")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data

    def images(self) -> list[Image.Image]:
        found = [re.match(r"data:image/(jpeg|png);base64,(.*)", source) for source in self.sources]
        return [Image.open(io.BytesIO(base64.b64decode(m[2]))) for m in found if m]


def view(name: str = "00008", width: int = 64, height: int = 48, **changes: object) -> View:
    green = np.linspace(0, 255, width).astype(np.uint8)
    depth = np.linspace(1, 3, width * height, dtype=np.float32).reshape(height, width)
    arrays = {
        "photo": np.full((height, width, 3), (200, 100, 50), np.uint8),
        "render": np.tile(np.outer(green, (0, 1, 0)).astype(np.uint8), (height, 1, 1)),
        "measured_depth": np.where(depth < 1.5, 0, depth),
        "rendered_depth": depth,
    }
    return View(name=name, psnr_db=23.456, **(arrays | changes))


REPORT = ReportData(
    title="kitchen",
    summary="All is well",
    metrics={
        "given poses": {"PSNR, dB": 27.541, "LPIPS": float("nan")},
        "poses refined": {"PSNR, dB": 29.1, "SSIM": 0.8},
    },
    variants=[("half", 50_000, 26.5), ("chosen", 100_000, 27.5)],
    curve=[CurvePoint(s, 4 * s, 0, 20 + 0.1 * s, 19.0 if s else None, 1000 * s) for s in range(9)],
    views=[view()],
    findings={"intrinsics": "fx 320 px"},
    pose_shifts_m=[0.01, 0.02, 0.06],
    pose_turns_rad=[np.deg2rad(1.0), np.deg2rad(2.0), np.deg2rad(2.5)],
    skipped=["00007: it is torn"],
    config={"iterations": 1200, "seed": 0},
)


def written(tmp_path: Path, report: ReportData) -> Page:
    write_report(tmp_path / "report.html", report)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    return Page(tmp_path / "report.html")


def test_the_page_holds_all_parts(tmp_path: Path) -> None:
    page = written(tmp_path, REPORT)
    text = " ".join(page.texts)
    for part in ("kitchen", "All is well", "00008", "23.46 dB", "00007: it is torn"):
        assert part in text
    assert ["", "PSNR, dB", "LPIPS", "SSIM"] in page.rows
    assert ["given poses", "27.54", "-", "-"] in page.rows
    assert ["poses refined", "29.1", "-", "0.8"] in page.rows
    assert ["half", "50,000", "26.5"] in page.rows
    assert ["shift, cm", "2", "6"] in page.rows
    assert ["rotation, degrees", "2", "2.5"] in page.rows
    assert ["intrinsics", "fx 320 px"] in page.rows
    assert ["iterations", "1200"] in page.rows
    assert sum(source.startswith("data:image/svg+xml;base64,") for source in page.sources) == 4
    assert all(source.startswith("data:image/") for source in page.sources), "nothing from outside"
    assert "script" not in page.tags
    assert "link" not in page.tags
    assert "url(" not in (tmp_path / "report.html").read_text()


def test_images_are_those_of_the_view(tmp_path: Path) -> None:
    shown = written(tmp_path, REPORT).images()[2:]  # After two legends.
    photo, render, error, measured, rendered = (np.asarray(image.convert("RGB")) for image in shown)
    assert photo.shape == (48, 64, 3)
    assert np.abs(photo.astype(int) - (200, 100, 50)).max() < 4
    assert np.abs(render.astype(int) - REPORT.views[0].render).mean() < 4
    assert error.mean() > 60
    assert (np.abs(measured[:8].astype(int) - 40) < 12).all(), "grey where nothing was measured"
    assert rendered[:8, :, 0].mean() > rendered[:8, :, 2].mean() + 50, "near is red"
    assert rendered[-8:, :, 0].mean() < rendered[-8:, :, 2].mean()
    both = np.abs(measured[30:].astype(int) - rendered[30:]).mean()
    assert both < 4, "both depths have the same scale"


def test_pixels_outside_the_mask_are_no_errors(tmp_path: Path) -> None:
    seen = np.ones((48, 64), np.bool_)
    seen[:, 32:] = False
    report = replace(REPORT, views=[view(mask=seen)])
    error = np.asarray(written(tmp_path, report).images()[4].convert("RGB"))
    assert error[:, :28].mean() > 60
    assert error[:, 40:].max() < 16
    bad = view("odd", mask=seen[1:])
    with pytest.raises(ValueError, match="the images of view 'odd' differ in size"):
        write_report(tmp_path / "report.html", replace(REPORT, views=[bad]))


def test_views_of_a_result_have_the_mask() -> None:
    camera = scenes.orbit_camera(64, 48)
    seen = np.ones((48, 64), np.bool_)
    seen[:20] = False
    for mask in (seen, None):
        frame = RgbdFrame(
            np.zeros((48, 64, 3), np.uint8), np.ones((48, 64), np.float32), camera, mask=mask
        )
        result = SimpleNamespace(
            held_out={"00": Observation.of(frame)},
            test=("00",),
            gaussian_map=scenes.random_map(50, dtype=np.float32),
        )
        (shown,) = _views(result, 1)
        assert shown.mask is mask


def test_errors_are_bright_and_equal_images_black() -> None:
    image = np.full((4, 4, 3), 100, np.uint8)
    black = error_image(image, image, 0.2)
    assert black.max() < 8
    other = image.copy()
    other[0, 0], other[1, 1] = 151, 110  # 0.2 of the range, and less.
    shown = error_image(other, image, 0.2).astype(int).sum(axis=2)
    assert shown[0, 0] > 600
    assert shown[3, 3] < shown[1, 1] < shown[0, 0]
    np.testing.assert_array_equal(error_image(other, image, 0.2), error_image(image, other, 0.2))


def test_foreign_names_are_escaped(tmp_path: Path) -> None:
    report = ReportData(
        title=EVIL,
        summary=EVIL,
        metrics={EVIL: {EVIL: 1.0}},
        variants=[(EVIL, 1, 1.0)],
        views=[view(EVIL)],
        findings={EVIL: EVIL},
        skipped=[EVIL, "\udcff"],
        config={EVIL: EVIL},
    )
    page = written(tmp_path, report)
    assert "script" not in page.tags
    assert not any("example" in source for source in page.sources)
    assert page.tags.count("img") == 7
    assert "".join(page.texts).count(EVIL) == 12


def test_an_empty_report_has_no_empty_sections(tmp_path: Path) -> None:
    page = written(tmp_path, ReportData("a", "b"))
    assert "h2" not in page.tags
    assert page.sources == []


def test_the_size_of_the_page_is_bounded(tmp_path: Path) -> None:
    """Large noisy images are shrunk, and some of many views are shown."""
    rng = np.random.default_rng(0)
    tiles = rng.integers(60, 200, (30, 40, 3)).repeat(16, 0).repeat(16, 1)
    noisy = (tiles + rng.normal(0, 15, tiles.shape)).clip(0, 255).astype(np.uint8)
    depth = (1 + tiles[..., 0] / 99 + rng.normal(0, 0.02, tiles.shape[:2])).astype(np.float32)
    shape = {
        "photo": noisy,
        "render": noisy[::-1],
        "measured_depth": depth,
        "rendered_depth": depth,
    }
    views = [view(f"view {k}", **shape) for k in range(2 * MAX_VIEWS + 1)]
    page = written(tmp_path, replace(REPORT, views=views))
    text = " ".join(page.texts)
    assert "25 of 51 are shown" in text
    assert "view 0" in text
    assert "view 50" in text
    shown = page.images()[2:]
    assert len(shown) == 5 * MAX_VIEWS
    assert {image.size for image in shown} == {(320, 240)}


def test_shrunk_depths_are_measured_depths() -> None:
    depth = np.zeros((10, 960), np.float32)
    depth[:, 480:] = 2
    small = shrink(depth)
    assert small.shape == (3, 320)
    assert set(np.unique(small)) == {0, 2}
    assert (small[:, 160:] == 2).all()
    assert (small[:, :160] == 0).all()
    colors = np.zeros((3, 640, 3), np.uint8)
    colors[:, 1::2] = 200
    assert np.abs(shrink(colors).astype(int) - 100).max() <= 1, "colours are averaged"
    assert shrink(colors[:, :320]).shape == (3, 320, 3)


def test_views_of_unequal_images_are_rejected(tmp_path: Path) -> None:
    bad = view("odd", rendered_depth=np.zeros((48, 63), np.float32))
    with pytest.raises(ValueError, match="the images of view 'odd' differ in size"):
        write_report(tmp_path / "report.html", replace(REPORT, views=[bad]))
    assert list(tmp_path.iterdir()) == []


def test_the_same_report_is_the_same_page(tmp_path: Path) -> None:
    pages = []
    for name in ("a", "b"):
        write_report(tmp_path / name, REPORT)
        pages.append((tmp_path / name).read_bytes())
    assert pages[0] == pages[1]


@pytest.mark.parametrize(("poor", "warns"), [(0, False), (1, False), (2, True), (10, True)])
def test_a_map_that_does_not_show_its_training_frames_gives_a_warning(
    poor: int, warns: bool
) -> None:
    good_db, poor_db = MIN_TRAINING_PSNR_DB + 5, MIN_TRAINING_PSNR_DB - 3
    psnrs_db = {f"{k:03}": poor_db if k < poor else good_db for k in range(10)}
    warning = warning_of(SimpleNamespace(training_psnrs_db=psnrs_db))
    assert (warning is not None) == warns
    if warning is not None:
        assert f"{poor} of 10 training frames" in warning
        assert "000, 001" in warning
        assert "\n" not in warning
        assert warning.count("00") < 8, "many frames are not all named"
