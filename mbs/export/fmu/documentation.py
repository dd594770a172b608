"""documentation/index.html of an FMU."""

import html

from mbs.export.fmu.description import FmuModel

_PAGE = """\
<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title>
<style>p {{ white-space: pre-wrap }}</style></head>
<body>
<h1>{title}</h1>
{paragraphs}
<table>
<tr><th>variable</th><th>unit</th><th>what it is</th></tr>
{rows}
</table>
</body>
</html>
"""


def documentation(model: FmuModel) -> str:
    """The page: the text of the model, then its variables.

    Args:
        model: what the FMU is.

    Returns:
        HTML.
    """
    text = model.documentation or model.description or model.name
    paragraphs = "\n".join(f"<p>{html.escape(part)}</p>" for part in text.split("\n\n"))
    rows = "\n".join(
        f"<tr><td>{html.escape(v.name)}</td><td>{html.escape(v.unit)}</td>"
        f"<td>{html.escape(v.description)}</td></tr>"
        for v in (entry.variable for entry in model.entries)
    )
    return _PAGE.format(title=html.escape(model.name), paragraphs=paragraphs, rows=rows)
