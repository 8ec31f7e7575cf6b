"""`python -m assoc.live` as a program: lines from stdin, a UDP port, a scene; what is wrong is one line."""

import io
import json
import re
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

from assoc import live, track
from assoc._cli.track import plot_lines
from assoc._cli.track.plot_lines import LONGEST, IdentityError, Lines, parse_line, replayed
from assoc.errors import InvalidInputError
from assoc.scene import Scene
from assoc.simulation import simulate


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("live") / "radars.npz"
    simulate("rotating-radars", 5, aircraft=3, duration=20.0, false_alarms=1.0).save(path)
    return path


def words(scene_file, *more):
    own = ["-W", "error", "-m", "assoc.live", scene_file, "--turns", "4,5,5.5", *more]
    return [sys.executable, *map(str, own)]


def as_lines(scene, style):
    for k, plot in enumerate(replayed(scene, 0.0)):
        if style == "csv" or k % 2:
            yield ",".join([plot.sensor, repr(plot.time), *map(repr, plot.values)])
        elif k % 4:
            yield json.dumps({"sensor": int(plot.sensor), "time": plot.time, "values": plot.values})
        else:
            parts = zip(("range", "azimuth", "elevation"), plot.values, strict=True)
            yield json.dumps({"sensor": scene.sensors[int(plot.sensor) - 1].name, "time": plot.time, **dict(parts)})


def check(text):
    """A table of three aircraft; its rows by track."""
    table = pd.read_csv(io.StringIO(text))
    assert list(table.columns[:9]) == ["track_id", "time", "x", "y", "z", "vx", "vy", "vz", "event"]
    long = [own for _, own in table.groupby("track_id") if len(own) > 4]
    assert len(long) == 3
    for own in long:
        assert own.event.tolist()[0] == "new" and set(own.event.tolist()[1:]) <= {"update"}
        assert own.time.is_monotonic_increasing
    return table


@pytest.mark.slow
def test_lines_from_stdin_become_tracks_on_stdout(scene_file):
    scene = Scene.load(scene_file)
    bad = ["what is this", "nobody,3.0,1,2,3", '{"sensor": "radar 1", "time": 4.0}', "radar 1,4.0,1", "x" * 20_000]
    text = "\n".join(
        ["sensor,time,range,azimuth,elevation", "# a comment", "", *bad, *as_lines(scene, "both"), "\x00\xff"]
    )
    done = subprocess.run(words(scene_file), input=text, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    check(done.stdout)
    told = done.stderr.strip().splitlines()
    assert all(line.startswith("assoc.live: ") for line in told)
    assert sum("line left out" in line for line in told) == 1
    assert sum("the unknown sensor" in line for line in told) == 1
    assert re.search(r"\d+ plots in \d+ steps; a step takes .* ms, p99 .* ms; .*lines not understood", told[-1])
    # the same from the scene itself, into a file
    out = scene_file.parent / "tracks.csv"
    again = subprocess.run(words(scene_file, "--replay", 0, "-o", out), capture_output=True, text=True, timeout=600)
    assert again.returncode == 0 and again.stdout == ""
    assert out.read_text() == done.stdout


@pytest.mark.slow
def test_datagrams_on_loopback_until_a_signal(scene_file):
    scene = Scene.load(scene_file)
    program = subprocess.Popen(words(scene_file, "--udp", 0), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        port = int(re.search(r"udp 127\.0\.0\.1:(\d+)", program.stderr.readline()).group(1))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            lines = list(as_lines(scene, "csv"))
            for k in range(0, len(lines), 20):
                out.sendto("\n".join(lines[k : k + 20]).encode(), ("127.0.0.1", port))
        # the first rows come while the program runs
        assert program.stdout.readline().startswith("track_id,time")
        assert ",new," in program.stdout.readline()
        program.send_signal(signal.SIGINT)
        rest, told = program.communicate(timeout=600)
    finally:
        program.kill()
    assert program.returncode == 130
    assert "p99" in told and "interrupted" in told and "Traceback" not in told
    assert rest == "" or rest.endswith("\n")


def test_long_lines_are_cut_while_they_are_read():
    """A line of any length takes no more memory than the longest that there may be, and what follows it is read."""
    read = []

    class Stream(io.BytesIO):
        def readline(self, most=-1):
            read.append(most)
            return super().readline(most)

    lines = object.__new__(Lines)
    lines._waiting = plot_lines._Waiting(0)
    lines._take_lines(Stream(b"a\n" + b"b" * 10**6 + b"\n" + b"c" * LONGEST + b"\nd"))
    assert [len(one) for one in lines._waiting.queue] == [2, LONGEST + 1, LONGEST + 1, 1]
    assert set(read) == {LONGEST + 1}


def test_bad_options(scene_file, tmp_path, capsys):
    for main, more, line in [
        (live.main, ["--udp", "99999"], "--udp: port 99999 cannot be used"),
        (live.main, ["--turns", "4,5"], "turns: expected one for each of 3 sensors"),
        (live.main, ["--turns", "4,x,6"], "--turns: expected a number, got 'x'"),
        (live.main, ["--udp", "0", "--replay", "1"], "--udp and --replay: expected one of them"),
        (live.main, ["--replay", "-1"], "--replay: expected a number >= 0"),
        *(
            (live.main, option, f"{option[0]} belongs to assoc track")
            for option in (["--window", "ctw"], ["--map", tmp_path / "x.geojson"], ["--all"], ["--cutoff", "500"])
        ),
        (live.main, ["--alpha", "2"], "--alpha belongs to aco"),
        (live.main, ["-o", tmp_path / "x.parquet"], "x.parquet: expected a name that ends in .csv"),
        (track.main, ["--page", "0", "-o", tmp_path / "x.csv"], "--page belongs to assoc live"),
        (track.main, [], "the following arguments are required: -o/--output"),
    ]:
        try:
            code = main([*map(str, [scene_file, *more])])
        except SystemExit as end:
            code = end.code
        said = capsys.readouterr().err
        assert code == 2 and line in said and len(said.strip().splitlines()) == 1, said
    assert not any(tmp_path.glob("x.*"))


@pytest.mark.parametrize(
    "line",
    [
        "radar 1", "a,b,c", "1,2,3,x", "{", "[1]", '{"sensor": 1}', '{"sensor": 1, "time": "x", "values": []}',
        "{" * 9_000, '{"sensor": 1, "time": 1, "values": 3}', '{"sensor": 1, "time": 1, "values": ["a"]}',
        f'{{"sensor": 1, "time": 1{"0" * 400}, "values": []}}', f'{{"sensor": 1, "time": 1, "values": [1{"0" * 400}]}}',
    ],
)  # fmt: skip
def test_lines_that_are_none_are_refused_in_one_line(scene_file, line):
    scene = Scene.load(scene_file)
    with pytest.raises(InvalidInputError) as caught:
        parse_line(line, scene)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 300


def test_lines_with_identities(scene_file):
    scene = Scene.load(scene_file)
    assert parse_line("1,2.5,1000,0.5,0.1,1234,a0b1C2", scene).identity == (1234, 0xA0B1C2)
    assert parse_line("1,2.5,1000,0.5,0.1,1234", scene) == ("1", 2.5, [1000.0, 0.5, 0.1], (1234, 0))
    assert parse_line("1,2.5,1000,0.5,0.1,,a0b1c2", scene).identity == (0, 0xA0B1C2)
    for line in ("1,2.5,1000,0.5,0.1,,", "1,2.5,1000,0.5,0.1"):
        assert parse_line(line, scene).identity == (0, 0)
    plain = {"sensor": 1, "time": 2.5, "values": [1000.0, 0.5, 0.1]}
    for more, expected in [
        ({"mode3": 1234, "address": "A0B1C2"}, (1234, 0xA0B1C2)),
        ({"mode3": "0457", "address": 5}, (457, 5)),
        ({"address": 211234567}, (0, 211234567)),
        ({"address": "211234567"}, (0, 211234567)),
        ({"mode3": None, "address": ""}, (0, 0)),
        ({}, (0, 0)),
    ]:
        assert parse_line(json.dumps(plain | more), scene) == ("1", 2.5, plain["values"], expected)
    for bad in ("8000", "-1", "12.5", "x", "1_0", "0,1000000", "0,zz", "0,1,2", "0,12345678", "0,21123456x"):
        with pytest.raises(InvalidInputError, match="mode3|address|values") as caught:
            parse_line(f"1,2.5,1000,0.5,0.1,{bad}", scene)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 300
        # the plot is sound
        if bad != "0,1,2":
            assert isinstance(caught.value, IdentityError) and caught.value.plot == ("1", 2.5, plain["values"], (0, 0))
    for more in ({"mode3": 1.5}, {"mode3": True}, {"address": [1]}, {"address": 10**9}):
        with pytest.raises(InvalidInputError, match="expected sensor, time and values"):
            parse_line(json.dumps(plain | more), scene)


@pytest.mark.slow
def test_a_killed_run_goes_on(scene_file, tmp_path):
    """SIGKILL; the source repeats its last seconds, and the tracks are those of a run that was never killed."""
    scene = Scene.load(scene_file)
    lines = [*as_lines(scene, "csv")]
    whole = subprocess.run(words(scene_file), input="\n".join(lines), capture_output=True, text=True, timeout=600)
    more = ["-o", tmp_path / "tracks.csv", "--state", tmp_path / "live.npz"]
    # saved after each plot, so that the test need not wait
    own = [*words(scene_file, *more)]
    own[3:5] = ["-c", "from assoc import live; live._EVERY = 0.0; raise SystemExit(live.start())"]
    half = len(lines) * 2 // 3
    program = subprocess.Popen(own, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    program.stdin.write("\n".join(lines[:half]) + "\n")
    program.stdin.flush()
    ended = float(lines[half - 1].split(",")[1]) - 1.0
    deadline = time.monotonic() + 300
    while time.monotonic() < deadline:
        text = (tmp_path / "tracks.csv").read_text() if (tmp_path / "tracks.csv").exists() else ""
        if text.count("\n") > 1 and pd.read_csv(io.StringIO(text[: text.rfind("\n")])).time.max() >= np.floor(ended):
            break
        time.sleep(0.1)
    program.kill()
    program.communicate()
    with open(tmp_path / "tracks.csv", "a") as file:
        file.write("7,12.5,40")  # the line that it was writing
    rest = lines[half - 10 :]
    again = subprocess.run(own, input="\n".join(rest), capture_output=True, text=True, timeout=600)
    assert again.returncode == 0, again.stderr
    assert "goes on from" in again.stderr and " repeated" in again.stderr
    check(whole.stdout)
    expected, found = (pd.read_csv(io.StringIO(text)) for text in (whole.stdout, (tmp_path / "tracks.csv").read_text()))
    # what came after the last state was saved may be there twice; ids of tracks that begin later differ
    found = found.drop_duplicates()
    early = expected[expected.track_id.isin(expected[expected.time < ended].track_id)]
    pd.testing.assert_frame_equal(
        found[found.track_id.isin(early.track_id)].sort_values(["time", "track_id"]).reset_index(drop=True),
        early.sort_values(["time", "track_id"]).reset_index(drop=True),
    )
    assert len(found) == len(expected)


def test_a_state_that_is_refused_leaves_the_tracks_as_they_were(scene_file, tmp_path, capsys):
    from assoc._cli.track.plot_lines import header_of

    tracks, state = tmp_path / "tracks.csv", tmp_path / "live.npz"
    tracks.write_text(header_of(Scene.load(scene_file).origin) + "\n7,1.5,")
    state.write_bytes(b"junk")
    words = [str(scene_file), "--turns", "4,5,5.5", "--replay", "0", "-q", "-o", str(tracks), "--state", str(state)]
    assert live.main(words) == 2
    assert "live.npz: is not a readable npz file" in capsys.readouterr().err and tracks.read_text().endswith("7,1.5,")
