"""Drives at the actuators of a MuJoCo model."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from pneudrive._core import ControlSensors, close_step
from pneudrive.arrays import Array, Columns, Keyed, NamedNumbers, Plain
from pneudrive.control.setup import Setup, SetupOrFile, read_setup
from pneudrive.describe.system import DRIVE_NAMES, PISTON, System
from pneudrive.errors import CommandError, SimulationError, nearest, warn
from pneudrive.simulation.command import Commands, inputs
from pneudrive.simulation.session import Session
from pneudrive.simulation.simulate import number_of, positive
from pneudrive.simulation.start import DriveOrCircuit
from pneudrive.views import ShownValue, View, Viewed

#: Relative tolerance of the chambers.
RTOL = 1e-6


# --- A MuJoCo model under forces at some of its actuators: one step, repeated with other forces.

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
        MuJoCo is not installed, or an actuator does not exist or is not a force of gain 1.
    """

    def __init__(self, model: Any, names: Sequence[str], data: Any = None) -> None:  # noqa: ANN401 - of an extra
        if mujoco is None:
            raise CommandError("MuJoCo is not installed", remedy='pip install "pneudrive[mujoco]"')
        self.model, self.data = model, mujoco.MjData(model) if data is None else data
        self.ids = np.array([_actuator(model, name) for name in names])
        for name, i in zip(names, self.ids, strict=True):
            _check(model, name, int(i))
        if model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4:
            warn("the model selects the integrator RK4, but mj_step1 and mj_step2 use semi-implicit Euler")
        self._gear = model.actuator_gear[self.ids, 0].copy()
        self._places = _places(model, self.ids)
        self._other = mujoco.MjData(model)  # for lengths at the end of a step
        self._spec = mujoco.mjtState.mjSTATE_INTEGRATION
        self._state = np.empty(mujoco.mj_stateSize(model, self._spec))
        self._is_new = True

    @property
    def lengths(self) -> Array:
        """Lengths of the actuators in m at the last evaluated positions."""
        return self.data.actuator_length[self.ids]

    def begin(self) -> None:
        """Evaluate the model at its present state. `step` may then be called several times, with different forces."""
        mujoco.mj_step1(self.model, self.data)
        mujoco.mj_getState(self.model, self.data, self._state, self._spec)
        self._is_new = True

    def step(self, forces: Array) -> Array:
        """Step from the present state under these forces in N. Return the lengths in m at the end of the step."""
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
        """Return the accelerations of the lengths per actuator force, with closed loops (1/kg, shape (n, n)).

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
            rows = np.zeros((data.nefc, model.nv))
            if mujoco.mj_isSparse(model):
                mujoco.mju_sparse2dense(rows, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
            else:
                rows[:] = data.efc_J.reshape(rows.shape)
            rows = np.ascontiguousarray(rows[: data.ne])
            closed = np.zeros_like(rows)
            mujoco.mj_solveM(model, data, closed, rows)
            across = rows @ solved.T
            mobility -= across.T @ np.linalg.solve(rows @ closed.T + np.diag(data.efc_R[: data.ne]), across)
        return mobility

    def gap(self) -> float:
        """Return the largest residual in m of an equality constraint at the last evaluated positions."""
        return np.abs(self.data.efc_pos[: self.data.ne]).max(initial=0.0)


def _places(model: Any, ids: Array) -> Array | None:  # noqa: ANN401
    """Return the indices of the coordinates that equal the lengths of the actuators, if all are slides or hinges."""
    if np.any(model.actuator_trntype[ids] != mujoco.mjtTrn.mjTRN_JOINT):
        return None
    joints = model.actuator_trnid[ids, 0]
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    return model.jnt_qposadr[joints] if np.all(np.isin(model.jnt_type[joints], single)) else None


def _actuator(model: Any, name: str) -> int:  # noqa: ANN401
    """Return the index of the actuator with this name, or of the actuator at the joint or tendon with this name."""
    objects, kinds = mujoco.mjtObj, mujoco.mjtTrn
    named = {"actuator": objects.mjOBJ_ACTUATOR, "joint": objects.mjOBJ_JOINT, "tendon": objects.mjOBJ_TENDON}
    ids = {word: mujoco.mj_name2id(model, of, name) for word, of in named.items()}
    word = next((word for word, found in ids.items() if found >= 0), "")
    if word == "actuator":
        return ids[word]
    if not word:
        counts = ((model.actuator, model.nu), (model.joint, model.njnt), (model.tendon, model.ntendon))
        known = [get(i).name for get, count in counts for i in range(count)]
        raise CommandError(f"the model has no actuator, joint or tendon {name!r}", remedy=nearest(name, known))
    kind = kinds.mjTRN_JOINT if word == "joint" else kinds.mjTRN_TENDON
    at = (model.actuator_trntype == kind) & (model.actuator_trnid[:, 0] == ids[word])
    if np.count_nonzero(at) != 1:
        remedy = f'Add <motor {word}="{name}"/> to <actuator>, or name the actuator.'
        raise CommandError(f"the {word} {name!r} has {np.count_nonzero(at)} actuators, not one", remedy=remedy)
    return int(np.argmax(at))


def _check(model: Any, name: str, i: int) -> None:  # noqa: ANN401
    """Check that an actuator is a plain force of gain 1, and that its joint has no friction."""
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
        remedy = "Set both to 0, because the drive already has friction."
        raise CommandError(f"the {word} of {name!r} has frictionloss or damping", remedy=remedy)


# --- Drives at the actuators of a MuJoCo model.

#: Accepted difference between the motion of MuJoCo and that of the chambers: in m; as a fraction of the motion; in m,
#: from the attempt `RENEW_FROM` on. Positions do not drift apart, because each step begins at the positions of MuJoCo.
#: Exact agreement is impossible, because the mean force has small jumps when the solver of the chambers changes its
#: steps.
CLOSED, SHARE, ENOUGH = 1e-13, 1e-8, 1e-9
#: Largest number of attempts of a step (usually two are needed), and attempt from which the slopes of the forces are
#: computed by dual numbers.
MOST_ATTEMPTS, RENEW_FROM = 20, 4
#: Steps after which the mobility of the mechanism is computed again (assumed: it changes slowly).
RENEW_AFTER = 20
#: Distance outside the stroke that counts as rounding, m.
ROUNDING_M = 1e-9
#: Residual of the loops above which a run warns, m (assumed).
WIDE_GAP = 1e-5
#: Names of the component that moves the axis of a drive, and of the coupling before the axis.
AXIS, COUPLING = "mujoco_axis", "mujoco_coupling"
#: Ratio of damping to stiffness of a coupling, s (assumed: a steel joint).
DAMPING_TIME_S = 1e-4
SIGNALS = ("position_m", "velocity_m_s", "pressure_a_pa", "pressure_b_pa")


@dataclass(frozen=True, repr=False)
class StepReport(Viewed):
    """Quality of the steps since the last reset.

    Attributes
    ----------
    steps : int
    timestep_s : float
        Time step of the model. The error is of first order in the step.
    loop_gap_m : float
        Largest residual of an equality constraint, because MuJoCo closes loops by springs.
    position_gap_m : float
        Largest difference between a length of MuJoCo and the position of its cylinder at the end of a step.
    work_j : float
        Sum of the magnitudes of the work of all steps.
    work_gap_j : float
        Work of the cylinders minus the work that MuJoCo received.
    trials : float
        Mean number of trials in a step. A trial is a motion for which the forces of all cylinders are computed.
    """

    steps: int
    timestep_s: float
    loop_gap_m: float
    position_gap_m: float
    work_j: float
    work_gap_j: float
    trials: float

    def view(self) -> View:
        """Return a view of steps, gaps and work."""
        rows = {
            "steps": f"{self.steps} of {1e3 * self.timestep_s:g} ms, {self.trials:.2f} trials each",
            "gap of the loops": f"{1e6 * self.loop_gap_m:.3g} um",
            "gap of the positions": f"{1e6 * self.position_gap_m:.3g} um",
            "work": f"{self.work_j:.6g} J, gap {self.work_gap_j:.2g} J",
        }
        return View("Drives in MuJoCo", tuple(ShownValue(name, name, "value", text) for name, text in rows.items()))


class _Axis:
    """A drive at one actuator: its circuit with an axis at a prescribed velocity, and its sensors."""

    def __init__(
        self,
        name: str,
        described: DriveOrCircuit,
        initial: Any,  # noqa: ANN401
        setup: Setup,
        stiffness_n_m: float | None,
    ) -> None:
        self.name, self.described, self.setup = name, described, setup
        self.form: Plain = json.loads(described.system.json)
        cylinders = [one for one in self.form["components"] if one.get("friction")]
        if len(cylinders) != 1:
            raise CommandError(f"{name}: the circuit has {len(cylinders)} cylinders", rule="one cylinder")
        self.cylinder = cylinders[0]
        own = self.cylinder["name"]
        self.joint = next((one for one in self.form["joints"] if f"{own}.rod" in one), [f"{own}.rod"])
        if self.joint not in self.form["joints"]:
            self.form["joints"].append(self.joint)
        self.is_coupled = stiffness_n_m is not None
        if stiffness_n_m is not None:
            numbers = {"stiffness": stiffness_n_m, "damping": DAMPING_TIME_S * stiffness_n_m}
            self.form["components"].append({"name": COUPLING, "kind": "coupling", "numbers": numbers})
            self.joint.append(f"{COUPLING}.1")
            self.joint = [f"{COUPLING}.2"]
            self.form["joints"].append(self.joint)
        self.joint.append(f"{AXIS}.1")
        self.form["components"].append({"name": AXIS, "kind": "platform/driven", "numbers": {}})
        masses = [one for one in self.form["components"] if f"{one['name']}.1" in self.joint and one["kind"] == "load"]
        if not self.is_coupled:  # otherwise the piston with its load is a mass of its own
            for one in masses:
                one["numbers"]["mass"] = 0.0
            self.cylinder["numbers"]["incline"] = 0.0
        self.prefix = "" if own == PISTON and described.system.names else f"{own}."
        self.given = described.core_initial(initial)
        self.stroke_m = self.cylinder["numbers"]["stroke"]

    def start(self, position_m: float, mass_kg: float, seed: int) -> None:
        """Start at a position. The default end stops are designed for the mass that MuJoCo moves."""
        if not self.is_coupled:
            self.cylinder["numbers"]["moving_mass"] = mass_kg
        core = System(json.dumps(self.form, sort_keys=True), self.described.system.names).compiled()
        movers = [self.prefix, f"{AXIS}.1."] if self.is_coupled else [self.prefix]
        own = {f"{of}{key}": at for of in movers for key, at in (("position_m", position_m), ("velocity_m_s", 0.0))}
        self.core = core.start({**self.given, **own}, RTOL)
        self.session = Session(self.core)
        self.sensors = ControlSensors(json.dumps(self.setup.core(seed, self.form["ambient"]["pressure_pa"])))
        self.samples, self.sampled_s = 0, 0.0

    def column(self, name: str) -> str:
        """Return the name of a variable in the circuit from its name in a drive."""
        return name if not self.prefix else self.prefix + DRIVE_NAMES[name].removeprefix(f"{PISTON}.")


class Actuators:
    """Pneumatic drives at the actuators of a MuJoCo model.

    MuJoCo models all masses and weights; masses and inclines of the drives are not used. In each step, the force of a
    cylinder is constant. It is the mean force along the resulting motion. All cylinders are solved at once. The
    chambers then advance along this motion. An actuator is a plain force: ``<motor joint="slide"/>``. Its length is the
    position of the cylinder plus `zero`.

    Parameters
    ----------
    model : mujoco.MjModel
    drives : mapping
        Actuator, or joint or tendon with one actuator -> `Drive`, or `Circuit` with one cylinder. Friction laws with a
        stick mode need `couplings`.
    data : mujoco.MjData, optional
    zero : mapping of str to str or float, optional
        Length of an actuator at the cylinder position 0: ``"350 mm"``, or a number in m. Default 0.
    initial : mapping, optional
        Start state of each drive, as for `pneudrive.simulate`. The position comes from MuJoCo.
    couplings : mapping of str to str or float, optional
        Stiffness of the joint between rod and model: ``"1e7 N/m"``, or a number in N/m. Required for friction laws with
        a stick mode. Moving mass and load of the drive are then between friction and coupling, in addition to MuJoCo's
        masses.
    setup : Setup, str or path-like
        Sensors of `sense`: ``"ideal"``, ``"real"``, ``"cheap"`` or a file.

    Raises
    ------
    CommandError, DescriptionError
        MuJoCo is not installed, or a drive does not fit the model.
    """

    def __init__(
        self,
        model: Any,  # noqa: ANN401 - types of an extra
        drives: Mapping[str, DriveOrCircuit],
        data: Any = None,  # noqa: ANN401
        *,
        zero: Mapping[str, str | float] | None = None,
        initial: Keyed | None = None,
        couplings: Mapping[str, str | float] | None = None,
        setup: SetupOrFile = "real",
    ) -> None:
        for given in (zero, initial, couplings):
            for name in given or {}:
                if name not in drives:
                    raise CommandError(f"there is no drive at {name!r}", remedy=nearest(name, drives))
        self.model, self.names = model, tuple(drives)
        self._response = Response(model, self.names, data)
        self.data = self._response.data
        self._zero = np.array([number_of((zero or {}).get(name, 0.0), "m", f"zero of {name}") for name in self.names])
        stiff = {name: number_of(own, "N/m", f"coupling of {name}") for name, own in (couplings or {}).items()}
        known = read_setup(setup)[0]
        self._axes = [
            _Axis(name, own, (initial or {}).get(name), known, stiff.get(name)) for name, own in drives.items()
        ]
        self.reset(keep=data is not None)

    def reset(self, *, keep: bool = False) -> None:
        """Reset the model to its default state, and the drives to their start states.

        Parameters
        ----------
        keep : bool
            Whether to keep the present positions and velocities of the model.

        Raises
        ------
        CommandError
            A length is outside the stroke of its cylinder.
        """
        if not keep:
            mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_forward(self.model, self.data)
        x = self._response.lengths - self._zero
        mobility = self._response.mobility()
        self._mobility = mobility.ravel().tolist()
        for i, (axis, position) in enumerate(zip(self._axes, x.tolist(), strict=True)):
            if not -ROUNDING_M <= position <= axis.stroke_m + ROUNDING_M:
                what = f"{axis.name} starts at {1e3 * position:.6g} mm"
                remedy = f"Move the model there, or set zero={{{axis.name!r}: ...}}."
                raise CommandError(what, rule=f"within the stroke, 0 to {1e3 * axis.stroke_m:g} mm", remedy=remedy)
            axis.start(min(max(position, 0.0), axis.stroke_m), 1.0 / mobility[i, i], seed=i)
        self.time = 0.0
        self._x = self._length = x
        self._cores = [axis.core for axis in self._axes]
        h = self.model.opt.timestep
        v = self.data.actuator_velocity[self._response.ids]
        forces = [core.try_velocity(own, h) for core, own in zip(self._cores, v.tolist(), strict=True)]
        self._past = (np.concatenate([v, forces]),) * 3
        self._slopes = self._slopes_at(v, h)
        self._steps = self._trials = 0
        self._gaps = (0.0, 0.0)
        self._work = np.zeros(len(x))
        self._missed = np.zeros(len(x))

    def set(self, name: str, value: float, input: str = "command") -> None:  # noqa: A002 - as Session has it
        """Set an input of a drive from the present time on.

        Parameters
        ----------
        name : str
            Actuator, joint or tendon.
        value : float
        input : str
            As in `pneudrive.simulation.session.Session.set`; for a circuit with its component: ``"valve.command"``.
        """
        self._axis(name).session.set(input, value)

    def read(self, name: str, variable: str) -> float:
        """Return the true value of an output or input of a drive, such as ``"pressure_a_pa"``.

        `sense` returns readings of sensors instead.
        """
        axis = self._axis(name)
        return axis.session.read(axis.column(variable) if variable in SIGNALS else variable)

    def sense(self, name: str) -> NamedNumbers:
        """Return the present sensor readings of a drive: position_m, and pressures if measured.

        Call it once at each sample of a controller, because lag and noise advance with each call.
        """
        axis = self._axis(name)
        period = max(self.time - axis.sampled_s, self.model.opt.timestep)
        truth = [axis.session.read(axis.column(signal)) for signal in SIGNALS]
        position, pressures = axis.sensors.sample(axis.samples, period, truth)
        axis.samples, axis.sampled_s = axis.samples + 1, self.time
        return dict(zip((SIGNALS[0], *SIGNALS[2:]), (position, *(pressures or ())), strict=False))

    def _axis(self, name: str) -> _Axis:
        if name not in self.names:
            raise CommandError(f"there is no drive at {name!r}", remedy=nearest(name, self.names))
        return self._axes[self.names.index(name)]

    def _slopes_at(self, v: Array, until: float) -> list[float]:
        """Return the derivatives in N s/m of the mean forces with respect to the velocities."""
        return [core.velocity_slope(own, until)[1] for core, own in zip(self._cores, v.tolist(), strict=True)]

    def step(self) -> None:
        """Advance model and drives by one step of the model. Set `data.ctrl` of other actuators before.

        Raises
        ------
        SimulationError
            The simulation of a drive failed, or the step does not converge.
        """
        h = self.model.opt.timestep
        n = len(self._axes)
        response = self._response
        until = self.time + h
        response.begin()
        gap = response.gap()
        if self._steps % RENEW_AFTER == 0:
            self._mobility = response.mobility().ravel().tolist()
        last, before, first = self._past
        guess = 3.0 * (last - before) + first  # a parabola through the last three steps
        v, forces, known = guess[:n], guess[n:], []
        most, begin = np.inf, self._x.tolist()
        for attempt in range(MOST_ATTEMPTS):
            lengths = response.step(forces) - self._zero
            if attempt:
                moved = h * v
                most = np.abs(lengths - self._x - moved).max()
                if most < CLOSED or most < SHARE * np.abs(moved).max() or (attempt >= RENEW_FROM and most < ENOUGH):
                    break
            if attempt >= RENEW_FROM:
                self._slopes = self._slopes_at(v, until)
            mechanics = [begin, lengths.tolist(), forces.tolist(), self._mobility]
            try:
                closed = close_step(self._cores, until, mechanics, v.tolist(), self._slopes, known)
            except RuntimeError as error:
                raise SimulationError(f"the simulation of a drive failed at t = {self.time:.6g} s: {error}") from None
            speeds, known, self._slopes, trials = closed
            v, forces = np.array(speeds), np.array(known)
            self._trials += trials
        else:
            what = f"the step at t = {self.time:.6g} s does not converge: the residual is {most:.2g} m"
            raise SimulationError(what, remedy="Use a shorter timestep, or softer contacts.")
        for core in self._cores:
            core.accept()
        self._steps += 1
        self._gaps = (max(self._gaps[0], gap), max(self._gaps[1], most))
        self._work += np.abs(forces * moved)
        self._missed += forces * (moved - lengths + self._length)
        self._x, self._length = self._x + moved, lengths
        self._past = (np.concatenate([v, forces]), last, before)
        self.time = until

    @property
    def report(self) -> StepReport:
        """Quality of the steps since the last reset."""
        steps = max(self._steps, 1)
        step = self.model.opt.timestep
        work, missed = float(self._work.sum()), float(self._missed.sum())
        return StepReport(self._steps, step, *self._gaps, work, missed, self._trials / steps)

    def simulate(
        self,
        commands: Mapping[str, Commands],
        duration: str | float,
        signals: Sequence[str] = SIGNALS,
    ) -> Columns:
        """Run the model under commands of the drives. Warn about large gaps in closed loops.

        Parameters
        ----------
        commands : mapping
            Actuator or joint -> command of its drive, as for `pneudrive.simulate`. Times start at the present time.
        duration : str or float
            ``"0.5 s"``, or a number in s.
        signals : sequence of str
            Outputs or inputs of each drive.

        Returns
        -------
        dict
            ``time_s``, ``slide.position_m`` and so on: arrays with a value at the start and after each step.
        """
        for name, plan in commands.items():
            axis = self._axis(name)
            for of, (times, values) in inputs(plan, axis.described.commandable):
                axis.session.schedule(of, [(self.time + t, value) for t, value in zip(times, values, strict=True)])
        seconds = positive(duration, "s", "duration")
        rows = [self._row(signals)]
        for _ in range(round(seconds / self.model.opt.timestep)):
            self.step()
            rows.append(self._row(signals))
        if self._gaps[0] > WIDE_GAP:
            warn(
                f"the loops of the model open by {1e6 * self._gaps[0]:.3g} um. "
                'Use a stiffer solref, such as "0.004 1", for the equality constraints'
            )
        names = ["time_s", *(f"{name}.{signal}" for name in self.names for signal in signals)]
        return dict(zip(names, np.array(rows).T, strict=True))

    def _row(self, signals: Sequence[str]) -> list[float]:
        return [self.time, *(self.read(name, signal) for name in self.names for signal in signals)]
