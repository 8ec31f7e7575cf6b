import io
import os
import zipfile

import numpy as np
import pytest

from assoc._files.npz import Field, load_npz, save_npz
from assoc._files.output import write_atomically
from assoc.errors import InvalidInputError

FIELDS = {
    "x": Field("float", 1),
    "n": Field("int", 2, required=False),
    "name": Field("str", 0, required=False),
}


def load(path):
    return load_npz(path, "assoc.test", 1, FIELDS)


def header_only(shape, dtype="<f8"):
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": dtype, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


def write_members(path, members, sizes=None):
    """Write a file of these members; the archive claims the given sizes of some."""
    content = {"format.npy": np.array("assoc.test"), "version.npy": np.array(1)} | members
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, value in content.items():
            if not isinstance(value, bytes):
                buffer = io.BytesIO()
                np.save(buffer, value, allow_pickle=True)
                value = buffer.getvalue()
            archive.writestr(name, value)
        for name, size in (sizes or {}).items():
            archive.getinfo(name).file_size = size


def test_arrays_come_back(tmp_path):
    path = tmp_path / "a.npz"
    n = np.asfortranarray(np.arange(6, dtype=np.int32).reshape(2, 3))
    save_npz(path, "assoc.test", 1, {"x": np.arange(3, dtype=np.float32), "n": n, "name": "ümlaut", "other": [1]})
    arrays = load(path)
    assert set(arrays) == {"x", "n", "name"}
    assert arrays["x"].dtype == np.float64 and arrays["n"].dtype == np.int64
    np.testing.assert_array_equal(arrays["n"], n)
    assert arrays["n"].flags.c_contiguous and str(arrays["name"]) == "ümlaut"


class Bomb:
    def __reduce__(self):
        return (os.mkdir, ("executed",))


@pytest.mark.parametrize(
    ("members", "words"),
    [
        ({}, "field 'x' is missing"),
        (
            {"format.npy": np.array("assoc.scene"), "x.npy": np.zeros(1)},
            "has the format 'assoc.scene', expected",
        ),
        ({"version.npy": np.array(2)}, "has version 2 of 'assoc.test', this program reads up to version 1"),
        ({"x.npy": np.array([Bomb()], dtype=object)}, "'x' holds pickled objects"),
        ({"x.npy": np.array(["a"])}, "'x' has type <U1, expected float"),
        ({"x.npy": np.zeros((2, 2))}, "'x' has 2 dimensions, expected 1"),
        ({"x.npy": b"not an array"}, "'x' is not a plain array"),
        ({"x.npy": header_only((10**12,))}, "'x' claims 8000000000000 bytes of data, the file holds"),
        ({"x.npy": header_only((-5,))}, "'x' has a negative shape"),
        ({"name.npy": header_only((), "<U0"), "x.npy": np.zeros(1)}, "room for a character"),
        ({"x.npy": np.zeros(1), "n.npy": np.full((1, 1), 2**63, np.uint64)}, "beyond 64 bits"),
    ],
)
def test_bad_members_are_refused_in_one_line(tmp_path, monkeypatch, members, words):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "bad.npz"
    write_members(path, members)
    with pytest.raises(InvalidInputError, match=words) as caught:
        load(path)
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    assert not (tmp_path / "executed").exists()


def test_files_that_are_no_npz(tmp_path):
    text, empty = tmp_path / "text.npz", tmp_path / "empty.npz"
    text.write_text("time,x,y\n1,2,3\n")
    empty.touch()
    np.save(tmp_path / "single.npy", np.zeros(3))
    foreign = tmp_path / "foreign.npz"
    np.savez(foreign, x=np.zeros(3))
    cut = tmp_path / "cut.npz"
    save_npz(cut, "assoc.test", 1, {"x": np.random.default_rng(0).random(1000)})
    cut.write_bytes(cut.read_bytes()[:-500])
    for path, words in [
        (tmp_path / "missing.npz", "no such file"),
        (tmp_path, "is a folder"),
        (empty, "is empty"),
        (text, "not a readable npz"),
        (tmp_path / "single.npy", "not a readable npz"),
        (foreign, "no field 'format'"),
        (cut, "not a readable npz"),
    ]:
        with pytest.raises(InvalidInputError, match=words) as caught:
            load(path)
        assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)


def test_writing_is_all_or_nothing(tmp_path):
    path = tmp_path / "a.bin"
    path.write_bytes(b"old")

    def fail(file):
        file.write(b"half of the new")
        raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        write_atomically(path, fail)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.bin"]
    write_atomically(path, lambda file: file.write(b"new"))
    assert path.read_bytes() == b"new"
    assert os.listdir(tmp_path) == ["a.bin"]
