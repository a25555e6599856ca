"""A MuJoCo model under forces at some of its actuators: one step, repeated with other forces."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError, nearest, warn

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

#: The library, or None: the package can be imported without the extra.
mujoco: Any = import_module("mujoco") if find_spec("mujoco") else None


class Response:
    """Motion of a MuJoCo model in one step, as a function of the forces of some of its actuators.

    Parameters
    ----------
    model : mujoco.MjModel
    names : sequence of str
        Names of actuators, or of joints or tendons with one actuator.
    data : mujoco.MjData, optional

    Raises
    ------
    CommandError
        MuJoCo is not installed, an actuator does not exist, or it is not a force of gain 1.
    """

    def __init__(self, model: Any, names: Sequence[str], data: Any = None) -> None:  # noqa: ANN401 - of an extra
        if mujoco is None:
            raise CommandError("MuJoCo is not installed", remedy='pip install "pneudrive[mujoco]"')
        self.model, self.data = model, mujoco.MjData(model) if data is None else data
        self.ids = np.array([_actuator(model, name) for name in names])
        for name, i in zip(names, self.ids, strict=True):
            _check(model, name, int(i))
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            warn("the model asks for the integrator RK4: mj_step1 and mj_step2 use semi-implicit Euler instead")
        self._gear = model.actuator_gear[self.ids, 0].copy()
        self._places = _places(model, self.ids)
        self._other = mujoco.MjData(model)  # for lengths at the end of a step
        self._spec = mujoco.mjtState.mjSTATE_INTEGRATION
        self._state = np.empty(mujoco.mj_stateSize(model, self._spec))
        self._is_new = True

    @property
    def lengths(self) -> Array:
        """Lengths of the actuators at the last evaluated positions, m."""
        return self.data.actuator_length[self.ids]

    def begin(self) -> None:
        """Evaluate the model at its present state. Steps with several forces may follow."""
        mujoco.mj_step1(self.model, self.data)
        mujoco.mj_getState(self.model, self.data, self._state, self._spec)
        self._is_new = True

    def step(self, forces: Array) -> Array:
        """Make the step from the present state under these forces, N. Return the lengths at its end, m."""
        model, data = self.model, self.data
        if not self._is_new:
            mujoco.mj_setState(model, data, self._state, self._spec)
        self._is_new = False
        data.ctrl[self.ids] = forces
        mujoco.mj_step2(model, data)
        if self._places is not None:
            return self._gear * data.qpos[self._places]
        other = self._other
        other.qpos[:] = data.qpos
        mujoco.mj_kinematics(model, other)
        mujoco.mj_comPos(model, other)
        mujoco.mj_tendon(model, other)
        mujoco.mj_transmission(model, other)
        return other.actuator_length[self.ids]

    def mobility(self) -> Array:
        """Return the accelerations of the lengths by the forces, 1/kg, shape (n, n), with closed loops.

        W = J_a (M^-1 - M^-1 J_e^T (J_e M^-1 J_e^T + R_e)^-1 J_e M^-1) J_a^T, where J_e and R_e are the rows of the
        equality constraints. Contacts and limits are left out.
        """
        model, data = self.model, self.data
        own = np.zeros((model.nu, model.nv))
        mujoco.mju_sparse2dense(own, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind)
        own = np.ascontiguousarray(own[self.ids])
        solved = np.zeros_like(own)
        mujoco.mj_solveM(model, data, solved, own)
        mobility = own @ solved.T
        if data.ne:
            rows = self._equalities()
            closed = np.zeros_like(rows)
            mujoco.mj_solveM(model, data, closed, rows)
            across = rows @ solved.T
            mobility -= across.T @ np.linalg.solve(rows @ closed.T + np.diag(data.efc_R[: data.ne]), across)
        return mobility

    def _equalities(self) -> Array:
        model, data = self.model, self.data
        rows = np.zeros((data.nefc, model.nv))
        if mujoco.mj_isSparse(model):
            mujoco.mju_sparse2dense(rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
        else:
            rows[:] = data.efc_J.reshape(rows.shape)
        return np.ascontiguousarray(rows[: data.ne])

    def gap(self) -> float:
        """Return the largest residual of an equality constraint at the last evaluated positions, m."""
        ne = self.data.ne
        return float(np.abs(self.data.efc_pos[:ne]).max()) if ne else 0.0


def _places(model: Any, ids: Array) -> Array | None:  # noqa: ANN401
    """Return the places of the coordinates that are the lengths of the actuators, if all are slides or hinges."""
    if np.any(model.actuator_trntype[ids] != mujoco.mjtTrn.mjTRN_JOINT):
        return None
    joints = model.actuator_trnid[ids, 0]
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    return model.jnt_qposadr[joints] if np.all(np.isin(model.jnt_type[joints], single)) else None


def _actuator(model: Any, name: str) -> int:  # noqa: ANN401
    """Return the index of an actuator of this name, or of the one at the joint or tendon of this name."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, name)
    if found >= 0:
        return found
    objects, transmissions = mujoco.mjtObj, mujoco.mjtTrn
    kinds = (("joint", objects.mjOBJ_JOINT, transmissions.mjTRN_JOINT),)
    kinds += (("tendon", objects.mjOBJ_TENDON, transmissions.mjTRN_TENDON),)
    of_name = [(word, kind, mujoco.mj_name2id(model, of, name)) for word, of, kind in kinds]
    word, kind, found = next((one for one in of_name if one[2] >= 0), ("", None, -1))
    if found < 0:
        counts = ((model.actuator, model.nu), (model.joint, model.njnt), (model.tendon, model.ntendon))
        known = [get(i).name for get, count in counts for i in range(count)]
        raise CommandError(f"the model has no actuator, joint or tendon {name!r}", remedy=nearest(name, known))
    at = (model.actuator_trntype == kind) & (model.actuator_trnid[:, 0] == found)
    if np.count_nonzero(at) != 1:
        remedy = f'Add <motor {word}="{name}"/> to <actuator>, or name the actuator.'
        raise CommandError(f"the {word} {name!r} has {np.count_nonzero(at)} actuators", rule="one", remedy=remedy)
    return int(np.argmax(at))


def _check(model: Any, name: str, i: int) -> None:  # noqa: ANN401
    """Check that an actuator is a plain force of gain 1. Check that its joint has no friction."""
    plain = (
        model.actuator_gaintype[i] == mujoco.mjtGain.mjGAIN_FIXED
        and model.actuator_gainprm[i, 0] == 1.0
        and model.actuator_biastype[i] == mujoco.mjtBias.mjBIAS_NONE
        and model.actuator_dyntype[i] == mujoco.mjtDyn.mjDYN_NONE
        and not model.actuator_ctrllimited[i]
        and not model.actuator_forcelimited[i]
    )
    if not plain:
        rule = "a force of gain 1 without bias, activation and limits"
        raise CommandError(f"the actuator {name!r} is not a plain force", rule=rule, remedy="Use <motor .../>.")
    word, losses, at = "joint", (), model.actuator_trnid[i, 0]
    if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT:
        dof = model.jnt_dofadr[at]
        losses = (model.dof_frictionloss[dof], model.dof_damping[dof])
    elif model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_TENDON:
        word, losses = "tendon", (model.tendon_frictionloss[at], model.tendon_damping[at])
    if any(map(np.any, losses)):
        remedy = "Set both to 0: the drive brings its own friction."
        raise CommandError(f"the {word} of {name!r} has frictionloss or damping", remedy=remedy)
