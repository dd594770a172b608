"""The exudyn model of a mechanism: absolute coordinates, every joint a constraint of position.

Planar mechanisms are made of its bodies and revolute joints in the plane, the others of rigid
bodies with Euler parameters and joints with masks. Generalised-alpha, index 3, of the build without
range checks.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from plain_mechanism import Array, PlainJoint, PlainMechanism

sys.exudynFast = True  # type: ignore[attr-defined]  # read by exudyn when it is imported first
_DENSE_UP_TO = 12
"""Coordinates up to which the dense solver of exudyn is the faster one."""


class ExudynTwin:
    """A model that can be run again and again."""

    def __init__(self, mechanism: PlainMechanism) -> None:
        """Build and assemble it.

        Raises:
            SystemExit: exudyn is not installed.
        """
        try:
            import exudyn
        except ImportError:
            raise SystemExit("exudyn is not installed: pip install exudyn") from None
        self._exudyn = exudyn
        self._container = exudyn.SystemContainer()
        self._model: Any = self._container.AddSystem()
        self._planar = mechanism.planar
        self._ground = self._model.CreateGround()
        body = self._planar_body if self._planar else self._body
        self._bodies = [body(part, mechanism.gravity) for part in mechanism.bodies]
        self._coms = [part.com for part in mechanism.bodies]
        for joint in (*mechanism.joints, *mechanism.cuts):
            self._joint(joint, last=bool(mechanism.cuts) and joint is mechanism.cuts[-1])
        self._forces(mechanism)
        number, at = mechanism.tracked
        from exudyn.itemInterface import SensorBody

        sensor = SensorBody(
            bodyNumber=self._bodies[number],
            localPosition=list(at - self._coms[number]),
            storeInternal=True,
            writeToFile=False,
            outputVariableType=exudyn.OutputVariableType.Position,
        )
        self._sensor = self._model.AddSensor(sensor)
        self._model.Assemble()
        self.size = len(self._bodies) * (3 if self._planar else 7)

    def run(self, step: float, duration: float, rows: int) -> Array:
        """Time and position of the tracked point, (rows + 1, 4), every duration / rows."""
        exu, settings = self._exudyn, self._exudyn.SimulationSettings()
        steps = round(duration / step)
        if steps % rows:
            raise ValueError(f"{steps} steps do not fall on {rows} rows")
        time = settings.timeIntegration
        time.numberOfSteps, time.endTime, time.verboseMode = steps, duration, 0
        time.generalizedAlpha.spectralRadius = 0.95
        time.newton.useModifiedNewton = True
        settings.solution.file.write = False
        settings.solution.sensors.writePeriod = duration / rows
        settings.show.computationTime = False
        if self.size > _DENSE_UP_TO:
            settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
        self._model.SolveDynamic(settings)
        stored = np.array(self._model.GetSensorStoredData(self._sensor))
        if len(stored) != rows + 1:
            raise ValueError(f"{len(stored)} rows were stored where {rows + 1} were asked for")
        return stored

    def places(self, table: Array) -> Array:
        """(rows + 1, 3) positions of the tracked point in what `run` gave."""
        return table[:, 1:4]

    def _planar_body(self, part: Any, gravity: Array) -> int:
        from exudyn.itemInterface import Force, MarkerBodyPosition, NodeRigidBody2D
        from exudyn.itemInterface import ObjectRigidBody2D as Rigid

        node = NodeRigidBody2D(
            referenceCoordinates=[*part.com[:2], 0],
            initialVelocities=[*part.velocity[:2], part.spin[2]],
        )
        number = self._model.AddNode(node)
        body = self._model.AddObject(
            Rigid(mass=part.mass, inertia=part.inertia[2, 2], nodeNumber=number)
        )
        marker = self._model.AddMarker(MarkerBodyPosition(bodyNumber=body))
        self._model.AddLoad(Force(markerNumber=marker, loadVector=list(part.mass * gravity)))
        return int(body)

    def _body(self, part: Any, gravity: Array) -> int:
        from exudyn.utilities import RigidBodyInertia

        return int(
            self._model.CreateRigidBody(
                inertia=RigidBodyInertia(part.mass, part.inertia),
                referencePosition=list(part.com),
                initialVelocity=list(part.velocity),
                initialAngularVelocity=list(part.spin),
                gravity=list(gravity),
            )
        )

    def _point(self, body: int, at: Array) -> int:
        """A marker of a point, given in the base at the start."""
        from exudyn.itemInterface import MarkerBodyPosition

        number, local = self._local(body, at)
        return int(
            self._model.AddMarker(MarkerBodyPosition(bodyNumber=number, localPosition=local))
        )

    def _frame(self, body: int, at: Array, turn: Array) -> int:
        """A marker of a frame, given in the base at the start."""
        from exudyn.itemInterface import MarkerBodyRigid

        number, local = self._local(body, at)
        pose = self._exudyn.HT(rotation=turn, translation=local)
        return int(self._model.AddMarker(MarkerBodyRigid(bodyNumber=number, localHT=pose)))

    def _local(self, body: int, at: Array) -> tuple[int, list[float]]:
        if body < 0:
            return self._ground, at.tolist()
        return self._bodies[body], (at - self._coms[body]).tolist()

    def _joint(self, joint: PlainJoint, *, last: bool) -> None:
        """A joint; the last of a spatial loop leaves out one turn, which the others hold."""
        from exudyn.itemInterface import GenericJoint, RevoluteJoint2D

        ends = (joint.a, joint.b)
        if self._planar:
            markers = [self._point(body, joint.at) for body in ends]
            self._model.AddObject(RevoluteJoint2D(markerNumbers=markers))
            return
        turn = _axis_last(joint.axis)
        mask = [1, 1, 1, 1, 1, 0] if joint.kind == "revolute" else [1, 1, 0, 1, 1, 1]
        if last:
            mask[4] = 0
        markers = [self._frame(body, joint.at, turn) for body in ends]
        self._model.AddObject(GenericJoint(markerNumbers=markers, constrainedAxes=mask))

    def _forces(self, mechanism: PlainMechanism) -> None:
        from exudyn.itemInterface import SpringDamper, Torque

        for spring in mechanism.springs:
            ends = ((spring.a, spring.at_a), (spring.b, spring.at_b))
            self._model.AddObject(
                SpringDamper(
                    markerNumbers=[self._point(body, at) for body, at in ends],
                    referenceLength=spring.length,
                    stiffness=spring.stiffness,
                    damping=spring.damping,
                )
            )
        for joint in mechanism.joints:
            if joint.effort:
                marker = self._frame(joint.b, joint.at, np.eye(3))
                load = list(joint.effort * joint.axis)
                self._model.AddLoad(Torque(markerNumber=marker, loadVector=load))


def _axis_last(axis: Array) -> Array:
    """(3, 3) a rotation whose third column is the axis."""
    first = np.eye(3)[np.argmin(np.abs(axis))]
    y = np.cross(axis, first)
    y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, axis), y, axis])
