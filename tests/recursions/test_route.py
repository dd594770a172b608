"""Ways between frames against the poses of the links."""

import casadi
import numpy as np
import pytest
from casadi import SX
from support.random_trees import ALL_KINDS, random_state, random_tree
from symbolic_robots import symbolic_robot

from mbs.recursions.link_motions import base_poses, link_poses
from mbs.recursions.route import (
    OtherRotation,
    PathTranslation,
    RotationAboutZ,
    express,
    join_rotations,
    path_to,
    relative_pose,
    reverse_path,
)
from mbs.spatial import Pose


@pytest.mark.parametrize("seed", range(6))
def test_way_between_any_two_frames_is_the_relative_pose(seed):
    mechanism = random_tree(seed, n=6, kinds=ALL_KINDS, aligned=seed % 2 == 0).mechanism
    system = mechanism.assemble()
    q, tree = SX.sym("q", system.nq), system.tree
    rng = np.random.default_rng(seed)
    names = ["base", *(row.name for row in system.bodies)]
    arrow = SX([0.3, -0.7, 1.1])
    for _ in range(6):
        a, b = (system.frame(names[k]) for k in rng.integers(0, len(names), 2))
        placed = [*base_poses(tree, link_poses(tree, q)), Pose.identity()]
        pose = (placed[a[0]] @ a[1]).inverse() @ (placed[b[0]] @ b[1])
        found = relative_pose(tree, q, a, b)
        other = relative_pose(tree, q, a, b, outwards=True)
        (turned,) = express(tree, q, (a[0], a[1]), (b[0], b[1]), [arrow])
        difference = casadi.vertcat(
            *(casadi.vec(T.matrix - pose.matrix) for T in (found, other)),
            turned - casadi.mtimes(pose.R, arrow),
        )
        values = casadi.Function("f", [q], [difference])(random_state(system, rng)[0])
        np.testing.assert_allclose(np.array(values), 0, rtol=0, atol=1e-12)


def test_there_and_back_is_nowhere():
    system = symbolic_robot("puma560", "none").assemble()
    q = SX.sym("q", system.nq)
    way = path_to(system.tree, q, system.frame(6))
    point = SX([0.1, 0.2, 0.3])
    for step in reversed(join_rotations([*way, *reverse_path(way)], system.tree)):
        match step:
            case PathTranslation(p=p):
                point = point + p
            case OtherRotation(rotation=rotation):
                point = rotation.apply(point)
            case RotationAboutZ():
                pytest.fail("a spin was not made a turn")
    f = casadi.Function("f", [q, system.p], [point])
    end = np.array(f(np.arange(6) * 0.4, system.p_default)).ravel()
    np.testing.assert_allclose(end, [0.1, 0.2, 0.3], rtol=0, atol=1e-14)
