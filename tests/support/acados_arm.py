"""Run by tests/bridges/test_acados_ocp.py: an arm's optimal control problem, solved by acados.

acados reads where its libraries are when Python starts, so it gets a process of its own. Prints
status, iterations, defect of the dynamics, distance of the efforts from least effort, and cost.
"""

import json
import sys

import acados
import casadi
import numpy as np
from acados.acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver
from support.catalogue_systems import catalogue_system

import mbs
from mbs.bridges import acados_fields, step

STAGES, DURATION, LIMIT = 30, 1.0, 60.0


def problem(dae, goal):
    """From the start to the goal with the least effort, bounded, by Gauss and Newton's method."""
    nx, nu, nz = (x.numel() for x in (dae.x, dae.u, dae.z))
    model, ocp = AcadosModel(), AcadosOcp()
    for name, value in acados_fields(dae, "arm").items():
        setattr(model, name, value)
    ocp.model, ocp.dims.N, ocp.parameter_values = model, STAGES, dae.p0
    ocp.acados_include_path, ocp.acados_lib_path = acados.INCLUDE_DIR, acados.LIB_DIR
    cost, limits, options = ocp.cost, ocp.constraints, ocp.solver_options
    cost.cost_type = cost.cost_type_e = "LINEAR_LS"
    cost.W, cost.Vx, cost.Vu = 2 * np.eye(nu), np.zeros((nu, nx)), np.eye(nu)
    cost.Vz, cost.yref = np.zeros((nu, nz)), np.zeros(nu)
    cost.W_e, cost.Vx_e, cost.yref_e = np.zeros((0, 0)), np.zeros((0, nx)), np.zeros(0)
    limits.x0 = dae.x0
    limits.idxbx_e, limits.lbx_e, limits.ubx_e = np.arange(nx), goal, goal
    limits.idxbu, limits.ubu = np.arange(nu), np.full(nu, LIMIT)
    limits.lbu = -limits.ubu
    options.tf, options.nlp_solver_type, options.hessian_approx = DURATION, "SQP", "GAUSS_NEWTON"
    options.integrator_type = "IRK" if nz else "ERK"
    options.qp_solver = "PARTIAL_CONDENSING_HPIPM"
    return ocp


def slack(advance, dae, x, u):
    """Efforts beside the space of d(end)/d(efforts): zero where no bound acts at the least effort.

    Returns:
        relative to the efforts.
    """
    state, every = casadi.DM(x[0]), casadi.MX.sym("u", u.shape[1], STAGES)
    end = casadi.MX(state)
    for k in range(STAGES):
        end = advance(end, every[:, k], dae.p0, DURATION / STAGES)
    slope = casadi.Function("slope", [every], [casadi.jacobian(end, casadi.vec(every))])
    rows, efforts = np.array(slope(u.T)), u.ravel()
    rest = efforts - np.linalg.pinv(rows) @ (rows @ efforts)
    return float(np.linalg.norm(rest) / np.linalg.norm(efforts))


def main(robot, form):
    """Solve it and print what came out."""
    dae = mbs.models.dae(catalogue_system(robot), form)
    goal, motors = dae.x0.copy(), dae.u.numel()
    goal[:motors] += np.linspace(1.0, -0.5, motors)
    solver = AcadosOcpSolver(problem(dae, goal), json_file="arm.json")
    between = np.linspace(dae.x0, goal, STAGES + 1)
    between[1:-1, motors:] = (goal - dae.x0)[:motors] / DURATION
    for k, state in enumerate(between):
        solver.set(k, "x", state)
    status = solver.solve()
    x = np.array([solver.get(k, "x") for k in range(STAGES + 1)])
    u = np.array([solver.get(k, "u") for k in range(STAGES)])
    advance = step(mbs.models.dae(catalogue_system(robot)))
    ends = [advance(x[k], u[k], dae.p0, DURATION / STAGES) for k in range(STAGES)]
    found = {
        "status": int(status),
        "iterations": int(solver.get_stats("sqp_iter")[0]),
        "defect": float(np.abs(np.array(ends)[:, :, 0] - x[1:]).max()),
        "miss": float(np.abs(x[-1] - goal).max()),
        "largest": float(np.abs(u).max()),
        "slack": slack(advance, dae, x, u),
        "cost": DURATION / STAGES * float(np.sum(u**2)),
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main(*sys.argv[1:])
