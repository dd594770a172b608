"""Published and textbook mechanisms, and the one way to load any mechanism."""

from mbs.robots.cart_pole import cart_pole
from mbs.robots.five_bar import five_bar
from mbs.robots.four_bar import four_bar
from mbs.robots.loading import catalogue, load
from mbs.robots.planar_2r import planar_2r
from mbs.robots.puma560 import puma560
from mbs.robots.rx90 import rx90
from mbs.robots.scara import scara
from mbs.robots.sr400 import sr400
from mbs.robots.stanford import stanford
from mbs.robots.two_branch_tree import two_branch_tree

__all__ = [
    "cart_pole",
    "catalogue",
    "five_bar",
    "four_bar",
    "load",
    "planar_2r",
    "puma560",
    "rx90",
    "scara",
    "sr400",
    "stanford",
    "two_branch_tree",
]
