"""Pictures of mechanisms: scenes for any viewer, picture files, notebooks, connection graphs."""

from mbs.assembly.diagram import Diagram
from mbs.view.page import SCRIPTS as SCRIPTS
from mbs.view.page import assets_folder
from mbs.view.picture import Picture, animate, show
from mbs.view.scene import Scene, scene

__all__ = ["Diagram", "Picture", "Scene", "animate", "assets_folder", "scene", "show"]
