"""What has become twice as slow is noticed, one bad measurement is not."""

import pytest

from experiments import bench_quick


@pytest.mark.parametrize(("measured", "found"), [((1.9,), {}), ((5.0, 1.0), {}), ((5.0, 2.2), {"work": 2.2})])
def test_a_doubling_is_noticed_when_it_stays(measured, found, capsys):
    figures = iter(measured)
    assert bench_quick.slower({"work": 0.5}, lambda name: 0.5 * next(figures)) == pytest.approx(found)
    assert ("TOO SLOW" in capsys.readouterr().out) == bool(found)
    assert next(figures, None) is None


def test_a_ratio_is_of_processor_times(monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(bench_quick.time, "process_time", lambda: clock[0])

    def takes(seconds):
        return lambda: clock.__setitem__(0, clock[0] + seconds)

    assert bench_quick.ratio(takes(0.3), takes(0.02)) == pytest.approx(15.0)
