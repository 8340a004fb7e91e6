"""Draw sensor errors: which channel lies, in what way and how much."""

from collections.abc import Callable

from . import machine
from .concealed_effect import Concealed, Scene
from .sensor_errors import Sensor


def _sensor(kind: str) -> Callable[[Scene], Concealed]:
    def draw(s: Scene) -> Concealed:
        channel = int(s.rng.integers(0, 5 if kind in ("sensor_detached", "sensor_lag", "clock_shift") else 6))
        onset, shape = 0.0, 1.0
        if kind == "sensor_offset":
            size, names = s.sign() * s.log(0.8, 3.0) * s.strength, ("offset", "K")
        elif kind == "sensor_gain":
            size, names = 1.0 + s.sign() * s.rng.uniform(0.08, 0.22) * s.strength, ("gain", "")
        elif kind == "sensor_lag":
            size, names = s.log(240, 900) * s.strength, ("time_constant", "s")
        elif kind == "sensor_drift":
            size, names = s.sign() * s.log(0.2, 0.7) * s.strength, ("rate", "K/h")
            shape = s.rng.uniform(0.85, 1.25)
        elif kind == "sensor_detached":
            size, names = s.rng.uniform(0.15, 0.5) * s.strength, None
            onset = float(s.rng.choice([0.0, s.rng.uniform(0.2, 0.6) * s.plan.drive.time[-1]]))
            shape = float(s.rng.uniform(1.0, 3.0))
        else:
            size, names = s.sign() * s.log(120, 600) * s.strength, ("shift", "s")
        name = machine.CHANNELS[channel]
        return Concealed(
            kind,
            name,
            [name],
            size,
            sensor=Sensor(kind, channel, size, onset, shape),
            parameters={names[0]: (size, names[1])} if names else {},
            form={"onset": onset, "shape": shape},
        )

    return draw


SENSOR_EFFECTS: dict[str, Callable[[Scene], Concealed]] = {
    name: _sensor(name)
    for name in (
        "sensor_offset",
        "sensor_gain",
        "sensor_lag",
        "sensor_drift",
        "sensor_detached",
        "clock_shift",
    )
}
