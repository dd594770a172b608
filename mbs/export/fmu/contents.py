"""The files of an FMU that no compiler reads: descriptions, documentation, icon, licences."""

from __future__ import annotations

from collections.abc import Sequence

from mbs.export.fmu import fmi2_xml, fmi3_xml
from mbs.export.fmu.description import FmuModel
from mbs.export.fmu.documentation import documentation
from mbs.export.fmu.faces import FACES
from mbs.export.fmu.licences import licence_files
from mbs.export.fmu.terminals import terminals_and_icons
from mbs.view.drawing_files import icon, standalone


def description(model: FmuModel, fmi: str, identity: str, compiled: Sequence[str]) -> str:
    """The file modelDescription.xml.

    Args:
        model: what the FMU is.
        fmi: version of the standard.
        identity: what its library asks for.
        compiled: C files to compile.
    """
    if fmi == "2.0":
        return fmi2_xml.model_description(model, identity, compiled)
    return fmi3_xml.model_description(model, identity)


def plain_files(
    model: FmuModel, fmi: str, standard_header: str, compiled: Sequence[str]
) -> dict[str, bytes]:
    """All other files beside sources and libraries: name in the FMU to content.

    Args:
        model: what the FMU is.
        fmi: version of the standard.
        standard_header: text of a header of the standard.
        compiled: C files to compile.
    """
    files = {"documentation/index.html": documentation(model).encode()}
    own = [name for name, _ in model.sources]
    for name, text in licence_files(standard_header, own).items():
        files[f"documentation/licenses/{name}"] = text.encode()
    drawn = model.about.drawing if model.about else None
    if fmi == "2.0":
        return files | ({"model.png": icon(drawn)} if drawn else {})
    build = fmi3_xml.build_description(model, compiled)
    files["sources/buildDescription.xml"] = build.encode()
    if drawn or model.terminals:
        files["terminalsAndIcons/terminalsAndIcons.xml"] = terminals_and_icons(model).encode()
    if drawn:
        files["terminalsAndIcons/icon.png"] = icon(drawn)
        files["terminalsAndIcons/icon.svg"] = standalone(drawn, model.name).encode()
    return files


def standard_header(fmi: str) -> str:
    """Name of the header of the standard that declares its functions."""
    return FACES[fmi].standard[0]
