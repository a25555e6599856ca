"""A laboratory's own bench as a rig: pneudrive campaign run quick-look --rig own_rig.py:make_rig --out DIR.

`Bench` is the binding; `Axis`, `Regulator` and `Daq` stand for the drivers that come with the hardware.
"""

import time
from collections.abc import Iterator, Sequence

import numpy as np

from pneudrive.errors import RigError
from pneudrive.rig import Envelope, Hold, Identity, Move, RigState, Samples, Sampling
from pneudrive.rig.interface import Step

RATE_HZ = 2000.0  # of the DAQ; a bench that cannot change its rate samples as it can
ROOM_K = 293.0  # there is no thermometer
NEWTON_PER_VOLT, PASCAL_PER_VOLT = 20.0, 4e4  # from the calibration sheets


IDENTITY = Identity(
    name="Bench 3",
    area_a_m2=np.pi / 4 * 0.025**2,
    area_b_m2=np.pi / 4 * 0.025**2,
    ambient_pressure_pa=101300.0,
    mass_beyond_sensor_kg=0.8,
    chambers="common",
    accuracy={"position_m": 1e-6, "force_n": 0.1, "pressure_a_pa": 400.0, "pressure_b_pa": 400.0, "bore_m": 1e-5},
    limits={"force_n": (-200.0, 200.0)},
    labels={"seal": "NBR, no. 7"},
    synthetic=True,  # a real bench leaves this out
)
LIMITS = Envelope(
    position_m=(0.005, 0.295),
    speed_m_s=0.5,
    acceleration_m_s2=5.0,
    jerk_m_s3=200.0,
    force_n=150.0,
    pressure_pa=(101300.0, 251300.0),
    separate_pressures=False,
    temperature_k=(288.0, 303.0),
    expected_friction_n=20.0,
    home_m=0.005,
)


class Bench:
    """Our bench: Binding of the hardware: SI for the rig, millimetres and volts for the drivers."""

    def __init__(self) -> None:
        self.axis, self.regulator, self.stopped = Axis(), Regulator(), False
        self.daq = Daq(self.axis, self.regulator)

    def identity(self) -> Identity:
        return IDENTITY

    def limits(self) -> Envelope:
        return LIMITS

    def state(self) -> RigState:
        _, position_mm, force, pressure_a, pressure_b = self.daq.now()
        pressures = (PASCAL_PER_VOLT * pressure_a, PASCAL_PER_VOLT * pressure_b)
        moving = self.axis.is_moving()
        return RigState(1e-3 * position_mm, NEWTON_PER_VOLT * force, *pressures, 7e5, ROOM_K, now_s(), moving)

    def home(self) -> None:
        self.move(LIMITS.home_m, 0.05)

    def set_pressure(self, a_pa: float, b_pa: float) -> None:
        if abs(a_pa - b_pa) > 100.0:
            raise RigError("there is one regulator for both chambers", value=f"{a_pa:g} Pa and {b_pa:g} Pa")
        self.regulator.set_bar(1e-5 * (a_pa - IDENTITY.ambient_pressure_pa))
        while not self.regulator.is_settled():
            time.sleep(0.001)

    def move(self, to_m: float, speed_m_s: float) -> None:
        for _ in self._run(Move(to_m, speed_m_s)):
            time.sleep(0.001)

    def hold(self, duration_s: float, released: bool = False) -> None:
        for _ in self._run(Hold(duration_s, released)):
            time.sleep(0.001)

    def acquire(self, steps: Sequence[Step], sampling: Sampling) -> Iterator[Samples]:
        self.daq.start(RATE_HZ)
        try:
            for number, step in enumerate(steps):
                for _ in self._run(step):
                    yield self._read(number)
            yield self._read(len(steps) - 1)
        finally:  # also where nobody wants the rest: come to rest
            self.axis.stop()
            self.daq.stop()

    def stop(self) -> None:  # comes from another thread while a verb runs
        self.stopped = True
        self.axis.stop()
        self.regulator.set_bar(0.0)

    def _run(self, step: Step) -> Iterator[None]:
        """Run one step, and poll until it is done."""
        self.stopped = False
        if isinstance(step, Move):
            self.axis.start(1e3 * step.to_m, 1e3 * step.speed_m_s)
        elif step.released:
            self.axis.release()
        end = now_s() + (step.duration_s if isinstance(step, Hold) else 0.0)
        while self.axis.is_moving() or now_s() < end:
            yield
            if self.stopped:
                raise RigError("the axis was stopped")

    def _read(self, step: int) -> Samples:
        """Wait for a buffer of the DAQ and bring it to SI."""
        time_s, position_mm, force, pressure_a, pressure_b = self.daq.read()
        return Samples(
            time_s=time_s,
            position_m=1e-3 * position_mm,
            force_n=NEWTON_PER_VOLT * force,
            pressure_a_pa=PASCAL_PER_VOLT * pressure_a,
            pressure_b_pa=PASCAL_PER_VOLT * pressure_b,
            temperature_k=np.full(time_s.size, ROOM_K),
            step=np.full(time_s.size, step),
        )


def make_rig() -> Bench:
    """Return the rig. The command line names this function."""
    return Bench()


# --- what comes with the hardware, or pretends to -------------------------------------------------

HASTE = 40.0  # the pretended hardware lives so many times as fast, so that the example ends


def now_s() -> float:
    return HASTE * time.monotonic()


class Axis:
    """Driver of the axis, in millimetres; calls return at once."""

    def __init__(self) -> None:
        self.legs = [(0.0, 5.0, 5.0, 0.0)]  # begin, from, to, speed

    def start(self, to_mm: float, speed_mm_s: float) -> None:
        self.legs.append((now_s(), float(self.at(now_s())[0]), to_mm, speed_mm_s))

    def stop(self) -> None:
        at = float(self.at(now_s())[0])
        self.legs.append((now_s(), at, at, 0.0))

    release = stop

    def is_moving(self) -> bool:
        return bool(self.at(now_s())[1])

    def at(self, times: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity at some times."""
        begin, start, to, speed = (np.array(column) for column in zip(*self.legs, strict=True))
        leg = np.searchsorted(begin, times, side="right") - 1
        way, done = to[leg] - start[leg], (times - begin[leg]) * speed[leg]
        there = done >= np.abs(way)
        return start[leg] + np.sign(way) * np.minimum(done, np.abs(way)), np.where(
            there, 0.0, np.sign(way) * speed[leg]
        )


class Regulator:
    bar, set_at = 0.0, 0.0

    def set_bar(self, bar: float) -> None:
        self.bar, self.set_at = bar, now_s()

    def is_settled(self) -> bool:
        return now_s() > self.set_at + 0.5


class Daq:
    """Driver of the data acquisition, in volts, with simulated friction."""

    def __init__(self, axis: Axis, regulator: Regulator) -> None:
        self.axis, self.regulator, self.noise = axis, regulator, np.random.default_rng(1)

    def start(self, rate_hz: float) -> None:
        self.began, self.rate, self.taken = now_s(), rate_hz, 0

    def stop(self) -> None:
        self.taken = 0

    def read(self) -> tuple[np.ndarray, ...]:
        count = 0
        while count <= self.taken:
            time.sleep(0.002)
            count = int((now_s() - self.began) * self.rate)
        times, self.taken = np.arange(self.taken, count) / self.rate, count
        return times, *self._volts(self.began + times)

    def now(self) -> tuple[float, ...]:
        return now_s(), *(float(values[0]) for values in self._volts(np.array([now_s()])))

    def _volts(self, times: np.ndarray) -> tuple[np.ndarray, ...]:
        position, velocity = self.axis.at(times)
        friction = np.sign(velocity) * (9.0 + 4.0 * np.exp(-np.abs(velocity) / 20.0) + 2.0 * self.regulator.bar)
        force = friction + self.noise.normal(0.0, 0.1, times.size)
        pressure_pa = IDENTITY.ambient_pressure_pa + 1e5 * self.regulator.bar
        pressure = np.full(times.size, pressure_pa / PASCAL_PER_VOLT)
        return position, force / NEWTON_PER_VOLT, pressure, pressure


if __name__ == "__main__":
    from pneudrive.campaign.planning.protocol import parse_protocol
    from pneudrive.campaign.run import run_campaign

    protocol = parse_protocol("""
        name = "First strokes"
        [speed]
        list = ["20 mm/s", "100 mm/s", "300 mm/s"]
        settled_time = "0 s"
        [pressure]
        both = ["0 bar gauge", "1 bar gauge"]
        """)
    result = run_campaign(protocol, make_rig(), "first-strokes")
    print(f"{result.finished} of {result.planned} cycles in {result.campaign.path}")
    for file in result.campaign.cycles():
        samples, cycle = file.samples(), file.head.cycle
        out, back = (samples.force_n[samples.step == step].mean() for step in (0, len(cycle.steps) - 1))
        print(f"{cycle.key:32} {len(samples):6} samples, friction about {(out - back) / 2:.1f} N")
