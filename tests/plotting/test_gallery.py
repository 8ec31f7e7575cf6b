"""The pictures of the documentation: each is committed, small, and drawn by a command that works."""

import numpy as np
import pytest
from PIL import Image

from docs import gallery


def test_committed_pictures_are_those_of_the_gallery():
    committed = {path.stem: path for path in gallery.FOLDER.glob("*.png")}
    assert {*gallery.PICTURES, "report"} == {*committed}
    assert max(path.stat().st_size for path in committed.values()) <= gallery.LARGEST


def test_every_picture_is_on_a_page_and_sharp():
    root = gallery.FOLDER.parents[1]
    pages = "".join(path.read_text(encoding="utf-8") for path in [root / "README.md", *(root / "docs").rglob("*.md")])
    for path in gallery.FOLDER.iterdir():
        assert f"images/{path.name})" in pages, path.name
        if path.suffix == ".png":
            with Image.open(path) as image:
                assert image.width >= 1_250, path.name


@pytest.mark.slow
def test_a_picture_is_drawn_anew(tmp_path, capsys):
    assert gallery.main(["scene", "-o", str(tmp_path)]) == 0
    drawn, known = Image.open(tmp_path / "scene.png"), Image.open(gallery.FOLDER / "scene.png")
    # fonts differ between versions of matplotlib, and with them sizes by a pixel or two; what is drawn does not
    assert np.abs(np.subtract(drawn.size, known.size)).max() <= 3
    one, other = (np.asarray(image.convert("L").resize(known.size), dtype=float) for image in (drawn, known))
    assert np.abs(one - other).mean() < 8.0
    assert capsys.readouterr().out.startswith("scene")
    with pytest.raises(SystemExit):
        gallery.main(["no-such-picture", "-o", str(tmp_path)])
