"""The coverage table of the thesis on the clustering time window."""

import re

from experiments.common.results import Results, number
from experiments.pages.verdicts import ABSENT, HOLDS, NOT, filled, interval, near, verdict


def clustering_time_window() -> str:
    """The thesis on the clustering time window."""
    r = Results("papers.clustering_time_window")
    t = Results("papers.clustering_time_window.tables")
    groups = [t[f"table 4.{n}: plots of our window {n} in it"] for n in (1, 2, 3)]
    twice = [t[f"table 4.{n}: aircraft that are in the group twice"] for n in range(1, 9)]
    turn = t["table 2.1: rotation time estimated"]
    heading, grid = t.starting("headings")[0], t.starting("positions of tables")[0]
    places = t["aircraft 2428: places in its track without the window"]
    better = t["aircraft of the five whose plots the window's track holds more of"]
    noise = t.starting("table 4.24")[0]
    gain = r["CT gained by the window with constant step, Reid's MHT"]
    o = Results("papers.clustering_time_window.own_tracker")
    falls, fell = r.starting("MT of the last three rows")[0], o["recordings in which MT falls by 20 points or more"]
    judged, most = o["recordings judged"], o.starting("largest fall of MT")[0]
    at_10 = t["table 2.1: aircraft twice in one of our windows of 10 s"]
    reid = {misses: f"Reid's MHT, constant step, {misses} misses" for misses in (3, 5, 8)}
    oriented = "track-oriented MHT, time stamps"

    def together(what: str, tracker: str = "") -> str:
        suffix = f", times chosen by us, {tracker}" if tracker else ""
        return f"{t[f'five aircraft: {what}{suffix}'].ours:.0f}"

    def by_misses(what: str) -> str:
        return ", ".join(together(what, name) for name in reid.values())

    anew = "times that our track ends and another begins"

    rates = {key: [r[f"{rate}, Reid's MHT, {key}"] for rate in ("CT", "MT", "IT")]
             for key in ("irregular groups", "CTW")}  # fmt: skip
    ours = {key: ", ".join(number(claim.ours) for claim in claims) for key, claims in rates.items()}
    paper = {key: ", ".join(number(claim.paper or 0.0) for claim in claims) for key, claims in rates.items()}
    pairs = {name: r.starting(f"{name}: pairs without an identity switch, MHT")[0]
             for name in ("crossing", "parallel", "head-on")}  # fmt: skip
    loss = r.starting("false start, at the same place: lost by it, first")[0]
    alone = {}
    for name in pairs:
        three, five, swapped = (
            o[f"{name}: pairs {what}, {reid[misses]}"]
            for what, misses in (("without a switch", 3), ("without a switch", 5), ("with a swap", 3))
        )
        alone[name] = (
            f"{HOLDS if five.ours == 100 else NOT} with the thesis's own tracker (Reid, constant step) if tracks end "
            f"after 5 misses (the thesis gives no number): no switch in {number(five.ours, 2)} % of our pairs "
            f"({interval(five)}); after 3 in {number(three.ours, 2)} % ({interval(three)}), "
            f"{number(swapped.ours, 2)} % swapped, the rest begun anew"
        )
    beside = {"parallel": " (1694 and 3673), which begin 25 nmi apart (table 4.1), ours fly 5 nmi apart"}
    m = Results("papers.clustering_time_window.spanning_tree")
    place = "false start, at the same place: "
    own_first = next(c for c in o.starting(f"{place}tracks that begin") if reid[3] in c.quantity)
    own_right = next(c for c in o.starting(f"{place}tracks whose identity is right") if reid[3] in c.quantity)
    own_loss = next(c for c in o.starting(f"{place}lost by it, first") if reid[3] in c.quantity)
    straight = o.starting("straightness: mean change of direction from position to position, smoothed")

    by_angle = "whole seconds, windows by the antenna's angle, 10 s"

    def bends(name: str) -> str:
        return number(o[f"straightness: mean change of direction from position to position, {name}"].ours, 2)

    def clock(name: str) -> str:
        twice = o[f"{name}: plots of aircraft that the window has already"]
        ct = o[f"{name}: CT, Reid's MHT, constant step"]
        return f"{number(twice.ours, 2)} % second plots of an aircraft in a window, CT {number(ct.ours)} %"

    lost = r.starting("false start, at the same place: tracks whose identity is right")
    weak = min(lost, key=lambda claim: claim.ours)
    first = " and ".join(number(c.ours, 2) for c in r.starting("false start, at the same place: tracks that begin"))

    def held(name: str, identity: int, what: str = "plots of") -> str:
        return f"{next(c for c in t.starting(f'aircraft {identity}: {what}') if name in c.quantity).ours:.0f}"

    aircraft = (902, 2467, 903, 958, 2428)
    known = [t.starting(f"aircraft {a}: plots of its")[0].quantity for a in aircraft]
    every = ", ".join(re.findall(r"of its (\d+)", text)[0] for text in known)
    return filled("clustering-time-window", [
        f"{NOT} (6 rpm are called radians, too) for an antenna that turns in 9.5 s (the plots of table 2.1 give "
        f"{number(turn.ours)} s): "
        f"{clock('exact times, windows of 10 s')}, with a window of 9.5 s {clock('exact times, windows of 9.5 s')} "
        f"(Reid, constant step). Times in whole seconds: {clock('whole seconds, windows of 9.5 s')}. Windows by the "
        f"antenna's angle bear both: {clock(by_angle)}",
        f"{NOT}: {number(grid.ours)} % of the positions are x = 5/7 r sin b, y = -5/7 r cos b, in pixels",
        f"{verdict(heading)}: {number(heading.ours, 2)} % of the printed headings, which turn by 5 deg from row "
        "to row, or by less, nearly throughout: the text does not say why",
        f"{verdict(*groups)} with a window of 9.5 s: plot by plot, as far as table 2.1 goes; at the thesis's 10 s "
        f"{at_10.ours:.0f} aircraft stand twice in the second",
        f"{verdict(*twice)}. But the groups without the window are not stretches of time: table 4.5 has plots of "
        "0:13:16 and 0:13:20 and leaves others of 0:13:16 to table 4.6, those of 1332 at 47 nmi and of 1694 at 161 are "
        "in none, and each group has a row of zeros. Our irregular groups are stretches of time",
        f"{ABSENT} as a result of ours, without the recording; read again, the tracks hold "
        f"{', '.join(held('track without the', a) for a in aircraft)} of the five aircraft's {every} plots, with "
        f"{', '.join(held('track without the', a, 'other plots or repeats') for a in aircraft)} of others or "
        f"repeats; those of 2428 are in {places.ours:.0f} places, which the text counts. Our trackers on the same "
        f"plots, times chosen by us: Reid's at a constant step holds {by_misses('plots in our tracks')} of "
        f"{together('plots')} if tracks end after {', '.join(map(str, reid))} misses (times that a track ends and "
        f"another begins: {by_misses(anew)}; swaps: {by_misses('swaps of our tracks')}), the track-oriented one with "
        f"time stamps {together('plots in our tracks', oriented)} ({together(anew, oriented)}; "
        f"{together('swaps of our tracks', oriented)}); the thesis "
        f"{together('plots in the tracks with the window')} with the window, "
        f"{together('plots in the tracks without the window')} without",
        f"{ABSENT} likewise; the tracks hold {', '.join(held('track with the', a) for a in aircraft)}, with "
        f"{', '.join(held('track with the', a, 'other plots or repeats') for a in aircraft)} of others or repeats. "
        "The text says all of 902's, and nearly all of 2467's, 903's and 2428's",
        f"{verdict(better)}: the window's track holds more in {better.ours:.0f} of the five. In the fifth, 958, the "
        f"other's {held('track without the', 958)} stand in a track with "
        f"{held('track without the', 958, 'other plots or repeats')} of others or repeats",
        f"{verdict(noise)} for the table: both plots are in one place. In table 2.1 they are a turn apart, and 958 "
        "takes two turns for a mile: the first may be its own, not decoded. That the whole track is wrong then is the "
        f"fault of its identity: {first} % of the nearest neighbour's and of our tracks (track-oriented, time stamps) "
        f"begin with the aircraft's plot, yet {number(weak.ours)} % have the right identity by majority. Of the "
        f"thesis's own (Reid, constant step, 3 misses) {number(own_first.ours, 2)} and "
        f"{number(own_right.ours, 3)} %",
        f"{near(*rates['irregular groups'])} within 10 %, chosen by us: CT, MT, IT {ours['irregular groups']} against "
        f"{paper['irregular groups']}, on other recordings. The text calls its IT low below figure 4.16 and large "
        "below table 4.27, and CT there below 50 %, which it is in 3 of the 10 rows meant",
        f"{near(*rates['CTW'])} within 10 %, chosen by us: CT, MT, IT {ours['CTW']} against {paper['CTW']}, on other "
        "recordings",
        f"{verdict(gain)} as a gain of 20 points and more, chosen by us: {number(gain.ours)} ({interval(gain)}) "
        f"against {number(gain.paper or 0.0)} points",
        f"{verdict(falls)} on average: {number(falls.ours, 2)} points ({interval(falls)}) against "
        f"{number(falls.paper or 0.0, 3)}; it falls by 20 or more in {fell.ours:.0f} of {judged.ours:.0f} recordings, "
        f"by {number(most.ours, 2)} at the most",
        *(f"{alone[name]}. With the track-oriented tracker and time stamps {number(pairs[name].ours, 2)} % have no "
          f"switch ({interval(pairs[name])}). The thesis has pictures of one pair{beside.get(name, '')}"
          for name in pairs),
        f"{verdict(loss, own_loss)} as at most 5 points lost, chosen by us: of the aircraft's first plots the "
        f"track-oriented tracker loses {number(loss.ours, 2)} points by it ({interval(loss)}), the thesis's own (Reid, "
        f"constant step, 3 misses) {number(own_loss.ours, 2)} ({interval(own_loss)})",
        f"{verdict(*straight)} with `assoc track --smooth`, which takes plots with their own times: the mean change of "
        f"direction from position to position is {bends('plots')} deg for the plots, as the thesis's tables have them, "
        f"{bends('filtered')} filtered and {bends('smoothed')} smoothed; the aircraft's is "
        f"{bends('the aircraft itself')}",
        f"{ABSENT} in the thesis, which cites it; here, with the whole recording before it, CT, MT and IT are "
        f"{', '.join(number(m[f'{rate}, spanning tree, CTW'].ours) for rate in ('CT', 'MT', 'IT'))}; of the crossing, "
        "parallel and head-on pairs "
        f"{', '.join(number(m[f'{name}: pairs whose plots share no track, spanning tree'].ours, 2) for name in pairs)}"
        " % share no track, the two aircraft's plots in one cluster otherwise",
    ])  # fmt: skip
