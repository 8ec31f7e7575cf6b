"""The report of a study: the figures are those of the runs, and it works in a browser."""

import pytest

from assoc.plotting.report import write_sweep_report
from assoc.simulation import simulate
from assoc.sweeps import Study, grid, load, summarize
from assoc.sweeps.sources import StudySource
from experiments.common.browser import DESKTOP, PHONE, complaints, press, screenshot, show
from tests.plotting.test_association_report import EVIL, data_of, parsed
from tests.running import here


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "study"
    settings = grid("aco", {"mode": ["paper"], "alpha": [1, 2, 3], "rho": [0.3, 0.9]})
    Study([StudySource(simulate("three-radar", 2, scans=4), EVIL)], settings, 3).run(path)
    return path


@pytest.fixture(scope="module")
def page(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "sweep.html"
    write_sweep_report(path, folder, words=["x.npz", "--solver", "aco"])
    return path


def test_maps_and_table_are_those_of_the_runs(page, folder):
    frame, data = load(folder), data_of(page)
    (only,) = data["maps"]
    assert (only["across"], only["up"], only["xs"], only["ys"]) == ("alpha", "rho", ["1", "2", "3"], ["0.3", "0.9"])
    expected = frame.pivot_table(index="rho", columns="alpha", values="iterations").to_numpy()
    middle, low, high = only["measures"]["iterations"]
    for i, j in ((0, 0), (1, 2)):
        assert middle[i][j] == pytest.approx(expected[i, j]) and low[i][j] <= middle[i][j] <= high[i][j]
    means = {one["title"]: one["means"]["iterations"] for one in data["settings"]}
    for row in summarize(frame).to_dict("records"):
        title = f"alpha {row['alpha']:.4g}, rho {row['rho']:.4g}"
        assert means[title] == [row["iterations"], row["iterations_low"], row["iterations_high"]]
    gaps = [one["means"]["gap"][0] for one in data["settings"]]
    assert gaps == sorted(gaps)


def test_curves_end_at_the_mean_excess(page, folder):
    frame, data = load(folder), data_of(page)
    best = frame.groupby(["scene", "scan"])["cost"].transform("min")
    excess = (frame["cost"] - best).groupby([frame["alpha"], frame["rho"]]).mean()
    for one, curve in zip(data["settings"], data["curves"], strict=True):
        at, values = curve["iteration"]
        assert at == sorted(at) and all(a >= b - 1e-9 for a, b in zip(values, values[1:], strict=False))
        assert values[-1] == pytest.approx(excess[one["values"]["alpha"], one["values"]["rho"]], abs=1e-6)


def test_what_made_it_is_said_and_text_is_text(page):
    reader = parsed(page)
    text = " ".join(reader.text)
    assert "python -m assoc.sweep x.npz --solver aco" in text and EVIL in text and "paper" in text
    assert sum(tag == "script" for tag, _ in reader.tags) == 3


def test_studies_without_maps_and_without_runs(tmp_path):
    settings = grid("greedy", {})
    study = Study([StudySource(simulate("three-radar", 2, scans=2), "s")], settings, 1)
    study.run(tmp_path / "study")
    write_sweep_report(tmp_path / "one.html", tmp_path / "study")
    assert data_of(tmp_path / "one.html")["maps"] == []
    empty = load(tmp_path / "study").iloc[:0]
    write_sweep_report(tmp_path / "none.html", tmp_path / "study", empty)
    assert "no runs yet" in " ".join(parsed(tmp_path / "none.html").text)


@pytest.mark.slow
def test_the_program_writes_it(folder, tmp_path):
    done = here("assoc.sweep", "--summary", folder, "--report", "s.html", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert len(data_of(tmp_path / "s.html")["settings"]) == 6
    done = here("assoc.sweep", "--summary", folder, "--report", tmp_path / "none" / "s.html")
    assert (done.returncode, done.stdout) == (2, "") and "does not exist" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_it_works_in_a_browser(browser, page, pictures, size):
    show(browser, page, size)
    assert browser.execute_script("return document.documentElement.dataset.ready") == "yes"
    assert browser.execute_script("return document.documentElement.scrollWidth") == size[0]
    assert browser.execute_script("return document.getElementById('map-plot').data[0].type") == "heatmap"
    row = browser.find_elements("css selector", "#setting-table tbody tr")[2]
    press(browser, row)
    assert row.get_attribute("aria-current") == "true"
    widest = "return Math.max(...document.getElementById('curves-plot').data.map((one) => one.line.width))"
    assert browser.execute_script(widest) == 3
    browser.execute_script(
        "const s = document.getElementById('parameters'); s.value = 'one 0'; s.dispatchEvent(new Event('change'))"
    )
    assert browser.execute_script("return document.getElementById('map-plot').data[0].type") == "scatter"
    screenshot(browser, pictures / f"sweep-{size[0]}.png")
    assert complaints(browser) == []
