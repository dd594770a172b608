"""The licences of what an FMU contains beside its equations."""

from __future__ import annotations

MBS = """\
MIT License

Copyright (c) 2026 mbs contributors

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all
copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
SOFTWARE.
"""
"""Of the C files of this package."""

_START, _END = "Copyright (C)", "*/"

_OVERVIEW = """\
The equations in model.c and model.h, the description and the documentation of this FMU belong to
its author. The other files of the folder sources are compiled into its libraries too:

mbs.txt            the C files of the package mbs
fmi-standard.txt   the headers fmi*.h of the FMI standard
{own}"""
_OWN = "                   {name}: see there, it came with the model\n"


def licence_files(standard_header: str, own: list[str]) -> dict[str, str]:
    """The files of the folder of licences: name to text.

    Args:
        standard_header: text of a header of the FMI standard, which carries its licence.
        own: names of the C files that came with the model.
    """
    start = standard_header.index(_START)
    lines = standard_header[start : standard_header.index(_END, start)].rstrip()
    overview = _OVERVIEW.format(own="".join(_OWN.format(name=name) for name in own))
    return {"license.txt": overview, "mbs.txt": MBS, "fmi-standard.txt": lines + "\n"}
