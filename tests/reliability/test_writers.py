"""Every writer: on a full disk, on a read-only one, and where the path is a link, a pipe or a device."""

import json
import os
import signal
import stat
import subprocess
import sys
import threading

import pytest

from assoc._files.output import write_text, written_gradually
from assoc.errors import InvalidInputError
from assoc.sweeps import load
from tests.reliability.writers import outcome, writers
from tests.running import printed

NAMES = (
    "scene", "problem", "tracker", "association", "tracks", "plots of a radar", "truth", "picture", "report",
    "report of tracks",
)  # fmt: skip


@pytest.fixture(scope="module")
def every():
    found = writers()
    assert tuple(found) == NAMES
    return found


def mount(*words):
    return subprocess.run(["mount", *map(str, words)], capture_output=True, check=False).returncode == 0


@pytest.fixture
def disk(tmp_path):
    """A disk of its own, of 200 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if os.geteuid() != 0 or not mount("-t", "tmpfs", "-o", "size=200k", "tmpfs", folder):
        pytest.skip("a disk can only be mounted by the superuser; files of limited size stand in for it")
    try:
        yield folder
    finally:
        mount("-o", "remount,rw", folder)
        subprocess.run(["umount", "-l", folder], check=True)


def fill(folder):
    (folder / "out").write_text("old")
    with open(folder / "filler", "wb", buffering=0) as file, pytest.raises(OSError, match="No space"):
        while True:
            file.write(bytes(4096))


@pytest.mark.slow
def test_files_that_may_not_grow(tmp_path):
    """The limit of a process does what a full disk does, for everyone and not only the superuser."""
    found = json.loads(printed("-m", "tests.reliability.writers", tmp_path))
    assert [*found] == [name for name in NAMES if "report" not in name]
    for name, (said, names, content) in found.items():
        assert "File too large" in said and "unchanged" in said and "\n" not in said, (name, said)
        assert (names, content) == (["out"], "old"), name


def test_a_full_disk_and_then_room_again(every, disk):
    small = [name for name in NAMES if "report" not in name]
    fill(disk)
    for name in small:
        said, names, content = outcome(every[name], disk / "out")
        assert "No space left on device" in said and "unchanged" in said, (name, said)
        assert (names, content) == (["filler", "out"], "old"), name
    (disk / "filler").unlink()
    for name in small:
        assert outcome(every[name], disk / "out") == ("", ["out"], "new"), name


@pytest.mark.slow
def test_a_read_only_disk(every, disk):
    (disk / "out").write_text("old")
    assert mount("-o", "remount,ro", disk)
    for name, writer in every.items():
        with pytest.raises(InvalidInputError, match="read-only"):
            writer(disk / "out")
        with pytest.raises(InvalidInputError, match="read-only"):
            writer(disk / f"new-{name}")
    assert os.listdir(disk) == ["out"] and (disk / "out").read_text() == "old"


def test_links_pipes_and_modes(every, tmp_path):
    """A name that leads elsewhere stays; a pipe is written into, and not replaced by a file."""
    (tmp_path / "private").write_text("old")
    (tmp_path / "private").chmod(0o600)
    (tmp_path / "link").symlink_to("private")
    os.mkfifo(tmp_path / "pipe")
    for name, writer in every.items():
        writer(tmp_path / "link")
        assert (tmp_path / "link").is_symlink()
        written = (tmp_path / "private").read_bytes()
        assert written != b"old" and stat.S_IMODE((tmp_path / "private").stat().st_mode) == 0o600, name
        got = []
        reader = threading.Thread(target=lambda got=got: got.append((tmp_path / "pipe").read_bytes()))
        reader.start()
        writer(tmp_path / "pipe")
        reader.join(100)
        assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode), name
        assert len(got[0]) == len(written), name
    assert sorted(os.listdir(tmp_path)) == ["link", "pipe", "private"]


def test_devices_folders_and_places_that_are_none(tmp_path):
    write_text("/dev/null", "x")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "nowhere").symlink_to("missing/file")
    (tmp_path / "file").write_text("")
    for path, said in [
        (tmp_path, "is a folder"),
        (tmp_path / "loop", "cannot be written"),
        (tmp_path / "nowhere", "missing does not exist"),
        (tmp_path / "file" / "below", "does not exist"),
        (tmp_path / ("x" * 300), "File name too long"),
        ("a\0b", "null"),
        ("/dev/full", "No space left"),
        # takes no new files from anyone, the superuser included
        ("/proc/assoc-test", "cannot be written"),
    ]:
        with pytest.raises(InvalidInputError, match=said) as raised:
            write_text(path, "x")
        assert "\n" not in str(raised.value)
    # as long as names may be, with characters of several bytes
    write_text(tmp_path / ("\N{SNOWMAN}" * 83 + ".json"), "x")
    write_text(tmp_path / os.fsdecode(b"\xff\xfe"), "\udcff")
    assert (tmp_path / os.fsdecode(b"\xff\xfe")).read_text() == "\\udcff"


PARTS = """
import resource
from assoc._files.output import written_gradually
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
with written_gradually("-") as file:
    file.write(bytes(1500))
"""


def test_a_stream_that_takes_a_part_is_an_error(tmp_path):
    with open(tmp_path / "out", "wb") as file:
        done = subprocess.run([sys.executable, "-c", PARTS], stdout=file, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1 and "InvalidInputError: -: cannot be written (File too large)" in done.stderr
    with pytest.raises(InvalidInputError, match="No space left"), written_gradually("/dev/full") as file:
        file.write(b"x")
    os.mkfifo(tmp_path / "pipe")
    reader = threading.Thread(target=lambda: os.close(os.open(tmp_path / "pipe", os.O_RDONLY)))
    reader.start()
    with (
        pytest.raises(InvalidInputError, match="pipe: cannot be written .its reader has gone"),
        written_gradually(tmp_path / "pipe") as file,
    ):
        reader.join(100)
        file.write(b"x")


INTERRUPTED = """
import sys, time
from assoc._files.output import write_atomically
from assoc._cli.signals import EarlyEnd
EarlyEnd("assoc.test").on_signals()
def writer(file):
    file.write(b"half of the new")
    file.flush()
    print("half", flush=True)
    time.sleep(600)
write_atomically(sys.argv[1], writer)
"""


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [("SIGINT", 130, "assoc.test: interrupted\n"), ("SIGTERM", 143, "assoc.test: terminated\n"), ("SIGKILL", -9, "")],
)
def test_ended_in_the_middle_of_writing(tmp_path, name, code, said):
    (tmp_path / "out").write_text("old")
    with subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path / "out")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        assert process.stdout.readline() == "half\n"
        assert len(os.listdir(tmp_path)) == 2
        process.send_signal(getattr(signal, name))
        _, complaint = process.communicate(timeout=600)
    assert (process.returncode, complaint) == (code, said)
    assert (tmp_path / "out").read_text() == "old"
    assert os.listdir(tmp_path) == ["out"] or name == "SIGKILL"
    # the same again is not held up by what a killed one left
    write_text(tmp_path / "out", "new")
    assert (tmp_path / "out").read_text() == "new"


def test_a_study_goes_on_when_the_disk_has_room_again(disk):
    from assoc.simulation import simulate
    from assoc.sweeps import Study, grid
    from assoc.sweeps.sources import StudySource

    scene = StudySource(simulate("three-radar", 2, scans=5), "scene")
    study = Study([scene], grid("greedy"), 60)
    (disk / "filler").write_bytes(bytes(200 * 1024 - 16 * 4096))
    with pytest.raises(InvalidInputError, match="disk is full.*the same command goes on from there"):
        study.run(disk / "s", batch_seconds=0.02)
    kept = len(load(disk / "s"))
    (disk / "filler").unlink()
    assert mount("-o", "remount,size=4m", disk)
    counts = study.run(disk / "s")
    assert 0 < kept == counts.before < study.size == counts.done
    study.run(disk.parent / "expected")
    one, other = (load(folder).drop(columns="time") for folder in (disk / "s", disk.parent / "expected"))
    assert one.equals(other)
