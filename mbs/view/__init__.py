"""Pictures of mechanisms: scenes for any viewer, picture files, notebooks, connection graphs."""

from mbs.assembly.diagram import Diagram
from mbs.view._scene import Scene, scene
from mbs.view.page import SCRIPTS as SCRIPTS
from mbs.view.page import assets_folder
from mbs.view.picture import Picture, animate, show

__all__ = ["Diagram", "Picture", "Scene", "animate", "assets_folder", "scene", "show"]
