"""Lines of plots for `assoc live` as people have them: a header, compass bearings, nautical miles, biases taken off."""

import io

import numpy as np
import pandas as pd
import pytest

from assoc import live
from assoc._cli.track.line_form import LineForm
from assoc._cli.track.plot_lines import IdentityError, parse_line, replayed
from assoc._cli.track.radars_file import read_radars
from assoc.errors import InvalidInputError
from assoc.recordings.on_earth import Bias
from assoc.scene import Scene
from assoc.sensors import Radar2D
from tests.programs.test_radars import described, turned

pytest.importorskip("pyarrow")


def lines_of(folder):
    """The plots of both radars as lines with a header, columns in an order of their own."""
    frames = [pd.read_csv(folder / "north.csv"), pd.read_parquet(folder / "south.parquet")]
    both = pd.concat(
        [frame.assign(radar=name) for frame, name in zip(frames, ("north", "south"), strict=True)], ignore_index=True
    )
    both = both.sort_values("time").assign(**{"Range [NM]": both.rho_m / 1852.0, "squawk": ""})
    coded = both.mode3 > 0
    both.loc[coded, "squawk"] = [f"{code:04o}" for code in both.mode3[coded]]
    named = both.rename(columns={"theta": "bearing"})
    return named[["bearing", "radar", "altitude_fl", "time", "squawk", "Range [NM]"]].to_csv(index=False).splitlines()


def form_of(found):
    numbers = found.numbers
    return LineForm(found.scene, [found.places[k] for k in numbers], [found.biases[k] for k in numbers])


def test_lines_in_compass_degrees_and_nautical_miles(tmp_path):
    """They give the measurements that the same plots give as a recording: north and up turned to the scene's plane."""
    found = read_radars(described(tmp_path))
    scene, form = found.scene, form_of(found)
    header, *rows = lines_of(tmp_path)
    assert parse_line(header, scene, form) is None
    plots = [parse_line(row, scene, form) for row in rows]
    names = [sensor.name for sensor in scene.sensors]
    checked = 0
    for s, name in enumerate(names):
        here = np.array([[plot.time, *plot.values] for plot in plots if plot.sensor == name])
        there = [
            np.column_stack([scan.own_times()[s], scan.measurements[s]])
            for scan in (scene.scan(k) for k in range(scene.num_scans))
        ]
        np.testing.assert_allclose(here[:, :2], np.concatenate(there)[:, :2], rtol=1e-9)
        if "no height" not in name:
            # without a height one is assumed, that of other plots here and a usual one there
            np.testing.assert_allclose(here, np.concatenate(there), rtol=1e-9, atol=1e-9)
            checked += len(here)
    assert checked > 100
    # north at the other radar has another direction: by three quarters of a degree
    far = next(plot for plot in plots if plot.sensor == "south")
    row = next(row for row in rows if row.split(",")[1] == "south" and row.split(",")[2])
    naive = np.pi / 2 - np.radians(float(row.split(",")[0]))
    assert 5e-3 < abs(np.angle(np.exp(1j * (naive - far.values[1])))) < 3e-2
    assert {f"{plot.identity[0]:04d}" for plot in plots} == {"0000", "4521", "2000", "7001"}


def test_replayed_plots_of_radars_have_their_codes(tmp_path):
    found = read_radars(described(tmp_path))
    plots = list(replayed(found.scene, 0.0, found.identities))
    header, *rows = lines_of(tmp_path)
    form = form_of(found)
    parse_line(header, found.scene, form)
    told = sorted(parse_line(row, found.scene, form).identity for row in rows)
    assert sorted(plot.identity for plot in plots) == told and len({*told}) == 4


def test_json_by_the_names_of_recordings():
    radar = Radar2D(position=[0, 0, 0], noise=[50, 1e-3], field_of_view=[[0, 1e5], [-np.pi, np.pi]], name="a")
    scene = Scene([radar], [0.0], [[np.zeros((0, 2))]])
    plot = parse_line('{"sensor": "a", "time": 3, "range_km": 20, "bearing": 90, "mode3_oct": "7700"}', scene)
    assert plot.values == pytest.approx([20e3, 0.0], abs=1e-9) and plot.identity == (7700, 0)
    # plain names are what the sensor measures
    plot = parse_line('{"sensor": "a", "time": 3, "range": 20000, "azimuth": 0.5}', scene)
    assert plot.values == [20e3, 0.5]
    # of a single radar a recording's own header does
    form = LineForm(scene)
    assert parse_line("time,range_nmi,bearing_deg,mode3", scene, form) is None
    plot = parse_line("2021-07-12T14:00:00Z,10,180,513", scene, form)
    assert (plot.time, plot.identity) == (1626098400.0, (1001, 0))
    assert plot.values == pytest.approx([18520.0, -np.pi / 2])
    with pytest.raises(IdentityError, match="mode3: expected four octal digits .a header calls them squawk"):
        parse_line("2021-07-12T14:00:00Z,10,180,4521", scene, form)


def test_a_header_between_semicolons_or_tabs():
    radar = Radar2D(position=[0, 0, 0], noise=[50, 1e-3], field_of_view=[[0, 1e5], [-np.pi, np.pi]], name="a")
    scene = Scene([radar], [0.0], [[np.zeros((0, 2))]])
    for mark in ";\t":
        form = LineForm(scene)
        assert parse_line(mark.join(["time", "range_km", "bearing", "squawk"]), scene, form) is None
        plot = parse_line(mark.join(["3,5", "20", "90,0", "7700"]), scene, form)
        assert plot.time == 3.5 and plot.values == pytest.approx([20e3, 0.0], abs=1e-9) and plot.identity == (7700, 0)


def test_flight_levels_in_letters_and_words_for_nothing(tmp_path):
    found = read_radars(described(tmp_path))
    form = form_of(found)
    assert parse_line("radar,time,range_nmi,bearing,altitude_m,squawk", found.scene, form) is None
    level = parse_line("north,3,20,90,FL298,7700", found.scene, form)
    assert level == parse_line("north,3,20,90,9083.04,7700", found.scene, form)
    # as no cell at all, and the rest of the line is used
    none = parse_line("north,3,20,90,N/A,NaN", found.scene, form)
    assert none == parse_line("north,3,20,90,,", found.scene, form) and none.values != level.values


def test_a_plain_header_in_any_order():
    scene = Scene(
        [
            Radar2D(position=[0, 0, 0], noise=[50, 1e-3], field_of_view=[[0, 1e5], [-np.pi, np.pi]], name=n)
            for n in "ab"
        ],
        [0.0],
        [[np.zeros((0, 2))] * 2],
    )
    form = LineForm(scene, biases=[Bias(range=100.0, bearing=2.0, time=0.5), Bias()])
    assert parse_line("time,azimuth,range,address,sensor", scene, form) is None
    plot = parse_line("1.5,0.25,9000,3c6444,b", scene, form)
    assert plot == ("b", 1.5, [9000.0, 0.25], (0, 0x3C6444))
    plot = parse_line("1.5,0.25,9000,,a", scene, form)
    assert plot.time == 1.0 and plot.values == pytest.approx([8900.0, 0.25 + np.radians(2.0)])
    # lines without a header are as ever
    assert parse_line("b,1.5,9000,0.25,4521", scene).values == [9000.0, 0.25]
    with pytest.raises(InvalidInputError, match="the header has no column sensor or radar"):
        parse_line("time,range_nmi,bearing", scene, form)
    with pytest.raises(InvalidInputError, match="no column sensor"):
        parse_line("3,4,5", scene, form)


@pytest.mark.slow
def test_live_takes_biases_off(tmp_path, capsys, monkeypatch):
    """Of radars.toml, and of its plots at the start: tracks are where they are without the bias."""
    described(tmp_path)
    turned(tmp_path / "north.csv", 0.5, 0.0)
    text = "\n".join(lines_of(tmp_path)) + "\n"
    found = {}
    for name, bias, words in (("none", "", []), ("file", "bias = { bearing = 0.5 }\n", []),
                              ("first", "", ["--registration", "first"])):  # fmt: skip
        described_text = (tmp_path / "radars.toml").read_text()
        own = tmp_path / f"{name}.toml"
        own.write_text(described_text.replace("[[radar]]\n", f"[[radar]]\n{bias}", 1))
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        assert live.main([str(own), "-o", str(tmp_path / f"{name}.csv"), *words]) == 0
        found[name] = pd.read_csv(tmp_path / f"{name}.csv").track_id.nunique()
    # with half a degree between the radars an aircraft has two tracks
    assert found["none"] > 3 and found["file"] == found["first"] == 3
    assert "north: bearings are" in capsys.readouterr().err
    assert live.main(["scene.npz", "--registration", "first"]) == 2
