"""Systems and simulators on the workers of a cluster."""

import numpy as np
import pytest

import mbs

distributed = pytest.importorskip("distributed")
OPTIONS = {"step": 0.05, "quiet": True}


def last_row(simulator, speed):
    return simulator(0.5, v0={"q1": speed}, **OPTIONS).values[-1]


def equations_kept(simulator):
    """How many state equations the system of a worker has."""
    return len(simulator.system._cache["recent", "state equations"])


def test_a_cluster_simulates_as_this_process_does():
    system = mbs.robots.planar_2r().assemble()
    simulator = mbs.simulate.Simulator(system)
    speeds = [0.1, 0.5, 1.0]
    cluster = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, silence_logs=50
    )
    with cluster, distributed.Client(cluster) as client:
        sent = client.scatter(simulator)
        rows = client.gather([client.submit(last_row, sent, w, pure=False) for w in speeds])
        assert client.submit(equations_kept, sent).result() == 1
        grid = {"q1.v": speeds}
        executor = client.get_executor()
        study = mbs.simulate.sweep(system, grid, 0.5, executor=executor, **OPTIONS)
        idm = client.submit(mbs.models.inverse_dynamics(system), *np.ones((3, 2))).result()
    assert not study.failures
    for k, speed in enumerate(speeds):
        here = simulator(0.5, v0={"q1": speed}, **OPTIONS).values
        np.testing.assert_array_equal(rows[k], here[-1])
        np.testing.assert_array_equal(study[k].values, here)
    np.testing.assert_array_equal(idm, mbs.models.inverse_dynamics(system)(*np.ones((3, 2))))
