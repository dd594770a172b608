"""Published and textbook mechanisms, and the one way to load any mechanism."""

from mbs.robots.akr3000 import akr3000
from mbs.robots.andrews_squeezer import andrews_squeezer
from mbs.robots.bricard import bricard
from mbs.robots.cart_pole import cart_pole
from mbs.robots.crx10 import crx10
from mbs.robots.delta import delta
from mbs.robots.differential_wrist import differential_wrist
from mbs.robots.five_bar import five_bar
from mbs.robots.flyball_governor import flyball_governor
from mbs.robots.four_bar import four_bar
from mbs.robots.gantry import gantry
from mbs.robots.irb120 import irb120
from mbs.robots.kr6 import kr6
from mbs.robots.loading import catalogue, load
from mbs.robots.manseur_doty import manseur_doty
from mbs.robots.modelica_four_bar import modelica_four_bar
from mbs.robots.modelica_rod_four_bar import modelica_rod_four_bar
from mbs.robots.n_four_bar import n_four_bar
from mbs.robots.panda import panda
from mbs.robots.planar_2r import planar_2r
from mbs.robots.puma560 import puma560
from mbs.robots.rx90 import rx90
from mbs.robots.scara import scara
from mbs.robots.simple_pendulum import simple_pendulum
from mbs.robots.single_cylinder_engine import single_cylinder_engine
from mbs.robots.slider_crank import slider_crank
from mbs.robots.sr400 import sr400
from mbs.robots.stanford import stanford
from mbs.robots.stewart_platform import stewart_platform
from mbs.robots.two_branch_tree import two_branch_tree
from mbs.robots.tx90 import tx90
from mbs.robots.ur5 import ur5
from mbs.robots.whipple_bicycle import whipple_bicycle
from mbs.robots.youbot import youbot

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
