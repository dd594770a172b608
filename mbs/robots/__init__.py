"""Catalogue of published and textbook mechanisms, and `load` for mechanisms of all sources."""

from mbs.robots._akr3000 import akr3000
from mbs.robots._andrews_squeezer import andrews_squeezer
from mbs.robots._bricard import bricard
from mbs.robots._cart_pole import cart_pole
from mbs.robots._crx10 import crx10
from mbs.robots._delta import delta
from mbs.robots._differential_wrist import differential_wrist
from mbs.robots._five_bar import five_bar
from mbs.robots._flyball_governor import flyball_governor
from mbs.robots._four_bar import four_bar
from mbs.robots._gantry import gantry
from mbs.robots._irb120 import irb120
from mbs.robots._kr6 import kr6
from mbs.robots._manseur_doty import manseur_doty
from mbs.robots._modelica_four_bar import modelica_four_bar
from mbs.robots._modelica_rod_four_bar import modelica_rod_four_bar
from mbs.robots._n_four_bar import n_four_bar
from mbs.robots._panda import panda
from mbs.robots._planar_2r import planar_2r
from mbs.robots._puma560 import puma560
from mbs.robots._rx90 import rx90
from mbs.robots._scara import scara
from mbs.robots._simple_pendulum import simple_pendulum
from mbs.robots._single_cylinder_engine import single_cylinder_engine
from mbs.robots._slider_crank import slider_crank
from mbs.robots._sr400 import sr400
from mbs.robots._stanford import stanford
from mbs.robots._stewart_platform import stewart_platform
from mbs.robots._two_branch_tree import two_branch_tree
from mbs.robots._tx90 import tx90
from mbs.robots._ur5 import ur5
from mbs.robots._whipple_bicycle import whipple_bicycle
from mbs.robots._youbot import youbot
from mbs.robots.loading import catalogue, load

__all__ = [
    "akr3000",
    "andrews_squeezer",
    "bricard",
    "cart_pole",
    "catalogue",
    "crx10",
    "delta",
    "differential_wrist",
    "five_bar",
    "flyball_governor",
    "four_bar",
    "gantry",
    "irb120",
    "kr6",
    "load",
    "manseur_doty",
    "modelica_four_bar",
    "modelica_rod_four_bar",
    "n_four_bar",
    "panda",
    "planar_2r",
    "puma560",
    "rx90",
    "scara",
    "simple_pendulum",
    "single_cylinder_engine",
    "slider_crank",
    "sr400",
    "stanford",
    "stewart_platform",
    "two_branch_tree",
    "tx90",
    "ur5",
    "whipple_bicycle",
    "youbot",
]
