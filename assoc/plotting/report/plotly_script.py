"""plotly.js as reports use it: without the addresses of servers."""

from __future__ import annotations

import re
from functools import cache

from assoc._system.extras import check_extra, load_extra

# licences stay whole; names of XML's vocabularies are addresses in form only
_ADDRESS = re.compile(r"(/\*!.{0,3000}?\*/)|\b(?:https?|wss?)://(?!www\.w3\.org/)(?=[\w{])[^\s\"'`<>\\)/]*", re.DOTALL)


def check_report() -> None:
    """Raise the MissingExtraError of a report before any work is done for it."""
    check_extra("plotly", "report")


@cache
def plotly_script() -> str:
    """Return plotly.js as the plotly package ships it, but for the servers that it knows.

    plotly can send a chart to a cloud service, and load maps. The data of a report must stay where they are, so the
    addresses are taken out of the code; core.js names the buttons that a chart has, and lets no window open.

    Raises
    ------
    MissingExtraError
        The package is not installed.
    """
    check_report()
    text: str = load_extra("plotly.offline", "report").get_plotlyjs()
    text = _ADDRESS.sub(lambda found: found.group(1) or "", text)
    # in a script element these would open a state in which the closing tag no longer closes
    return text.replace("</script", "<\\/script").replace("<!--", "<\\!--")
