"""`python -m assoc.simulate` as a program."""

import assoc
from assoc.recordings import read_plots
from tests.sizes import sample


@sample("scenario", ["three-radar", "crowd", "bearing-only", "arrival-times"], every=3)
def test_same_seed_same_bytes(run, tmp_path, scenario):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        done = run("assoc.simulate", scenario, "-o", tmp_path / f"{name}.npz", "--seed", seed, "--scans", 2)
        assert (done.returncode, done.stderr) == (0, "")
        assert scenario in done.stdout
    a, b, c = ((tmp_path / f"{name}.npz").read_bytes() for name in "abc")
    assert a == b
    assert a != c
    assert assoc.Scene.load(tmp_path / "a.npz").num_scans == 2


def test_every_scenario_is_one_of_the_program(run):
    from assoc.simulation import names

    listed = run("assoc.simulate", "--help").stdout
    assert all(f"\n  {name} " in listed for name in names())


def test_from_tracks(run, tmp_path):
    path = tmp_path / "tracks.csv"
    path.write_text("time,id,lat,lon,altitude\n0,a,50,1,9000\n20,a,50.05,1,9000\n")
    done = run("assoc.simulate", "from-tracks", path, "-o", tmp_path / "s.npz", "--interval", 5)
    assert (done.returncode, done.stderr) == (0, "")
    assert assoc.Scene.load(tmp_path / "s.npz").num_scans == 5
    done = run("assoc.simulate", "from-tracks", tmp_path / "none.csv", "-o", tmp_path / "t.npz")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "none.csv: no such file" in done.stderr


def test_rotating_radar(run, tmp_path):
    paths = [tmp_path / "plots.csv", tmp_path / "truth.csv"]
    words = ["--traffic", "crossing", "--duration", 200]
    done = run("assoc.simulate", "rotating-radar", "-o", paths[0], "--truth", paths[1], *words)
    assert (done.returncode, done.stderr) == (0, "")
    assert "traffic crossing" in done.stdout
    recording = read_plots(paths[0])
    assert set(recording.sources.tolist()) <= {-1, 0, 1}
    truth = paths[1].read_text().splitlines()
    assert truth[0] == "track_id,time,x,y,z,vx,vy,vz"
    assert len(truth) >= (recording.sources >= 0).sum()
    done = run("assoc.simulate", "rotating-radar", "-o", tmp_path / "plots.npz", *words)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1 and "expected a name that ends in .csv" in done.stderr
