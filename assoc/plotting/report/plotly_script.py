"""plotly.js for reports: without addresses of servers."""

from __future__ import annotations

import re
from functools import cache

from assoc._system.imports import check_extra, load_extra

# licences are not changed; XML namespaces only look like addresses
_ADDRESS = re.compile(r"(/\*!.{0,3000}?\*/)|\b(?:https?|wss?)://(?!www\.w3\.org/)(?=[\w{])[^\s\"'`<>\\)/]*", re.DOTALL)


def check_report() -> None:
    """Raise MissingExtraError before any work for a report is done."""
    check_extra("plotly", "report")


@cache
def plotly_script() -> str:
    """Return plotly.js from the plotly package, without addresses of servers.

    plotly can send charts to a cloud service, and load maps. The data of a report must stay in the file, so addresses
    are removed from the code; core.js restricts the buttons of a chart, and blocks new windows.
    """
    check_report()
    text: str = load_extra("plotly.offline", "report").get_plotlyjs()
    text = _ADDRESS.sub(lambda found: found.group(1) or "", text)
    # in a script element these change the parser's state, so that the closing tag would be ignored
    return text.replace("</script", "<\\/script").replace("<!--", "<\\!--")
