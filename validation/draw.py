"""Draw concealed effects of the machine: kind, place, strength, and the answers that count as right."""

from collections.abc import Callable

import numpy as np

from . import laws, machine
from .concealed_effect import Concealed, Scene
from .draw_sensor_errors import SENSOR_EFFECTS

_SET_NAMES = {"F": ["F1", "F2", "F3", "front_bearings"], "R": ["R1", "R2", "rear_bearings"]}
_PRIMARY = {"F": "front_bearings", "R": "rear_bearings"}


def _bearings(scene: Scene, *, single: bool = False) -> tuple[str, str, list[str]]:
    where = str(scene.rng.choice(["F", "F", "R"]))
    if single and scene.rng.random() < 0.4:
        where = str(scene.rng.choice(machine.BEARINGS))
        return where, where, [where, _PRIMARY[where[0]]]
    return where, _PRIMARY[where], list(_SET_NAMES[where])


def _heat_scale(s: Scene) -> Concealed:
    where, component, fine = _bearings(s, single=True)
    factor = s.factor(0.15, 0.32)
    return Concealed(
        "heat_scale",
        component,
        fine,
        factor,
        laws.HeatScale(where, factor),
        parameters={"factor": (factor, "")},
    )


def _heat_split(s: Scene) -> Concealed:
    where, component, fine = _bearings(s)
    change = s.sign() * s.rng.uniform(0.12, 0.3) * s.strength
    return Concealed(
        "heat_split",
        component,
        fine,
        change,
        laws.HeatSplit(where, change),
        parameters={"inner_share_change": (change, "")},
    )


def _joint(s: Scene) -> Concealed:
    where = str(s.rng.choice(["F1", "F2", "F3", "R1", "R2", "F", "R", "flange"]))
    factor = float(np.exp((-1 if s.rng.random() < 0.7 else 1) * s.log(0.8, 2.2) * s.strength))
    if where == "flange":
        names, component, fine = ("flange_back",), "flange", ["flange"]
    else:
        names = laws.outer_seats(s.model, where)
        component = _PRIMARY.get(where, where)
        fine = list(_SET_NAMES.get(where, [where, _PRIMARY[where[0]]]))
    return Concealed(
        "joint_conductance",
        component,
        fine,
        factor,
        laws.GroupFactor(names, factor),
        parameters={"factor": (factor, "")},
    )


def _thermal_preload(s: Scene) -> Concealed:
    where, component, fine = _bearings(s)
    amplitude = s.log(0.02, 0.1) * s.strength
    form = {
        "width": s.rng.uniform(0.8, 2.0),
        "exponent": s.rng.uniform(1.0, 1.6),
        "delay": s.rng.uniform(120, 700),
    }
    law = laws.ThermalPreload(where, amplitude, **form)
    return Concealed("thermal_preload", component, fine, amplitude, law, form=form)


def _viscosity(s: Scene) -> Concealed:
    where, component, fine = _bearings(s)
    amplitude = s.log(0.01, 0.03) * s.strength
    form = {
        "reference": s.rng.uniform(20, 32),
        "curvature": s.rng.uniform(0, 0.008),
        "floor": s.rng.uniform(0, 0.3),
    }
    return Concealed(
        "viscosity_heat", component, fine, amplitude, laws.ViscosityHeat(where, amplitude, **form), form=form
    )


def _churning(s: Scene) -> Concealed:
    where, component, fine = _bearings(s)
    amplitude = s.log(0.35, 1.0) * s.strength
    form = {
        "decay": s.log(900, 4500),
        "stretch": s.rng.uniform(0.75, 1.3),
        "recovery": float(s.rng.choice([0.0, 0.0, 9000.0])),
    }
    return Concealed(
        "grease_churning", component, fine, amplitude, laws.Churning(where, amplitude, **form), form=form
    )


def _starvation(s: Scene) -> Concealed:
    where, component, fine = _bearings(s)
    amplitude = s.log(0.2, 0.6) * s.strength * (1.0 if s.rng.random() < 0.8 else -0.7)
    visited = np.unique(s.plan.drive.speed[s.plan.drive.speed > 0])
    onset = float(s.rng.uniform(1400, 3800))
    if visited.size > 2:
        low, high = np.quantile(visited, [0.25, 0.8])
        onset = float(s.rng.uniform(low, high))
    form = {"width": s.rng.uniform(40, 200), "delay": s.rng.uniform(0, 500), "growth": s.rng.uniform(0, 0.4)}
    return Concealed(
        "starvation",
        component,
        fine,
        amplitude,
        laws.Starvation(where, amplitude, onset, **form),
        parameters={"onset_speed": (onset, "rpm")},
        form=form,
    )


def _seal(s: Scene) -> Concealed:
    place = str(s.rng.choice(["nose", "drive_end"]))
    heat = s.log(10, 35) * s.strength
    places = (("nose", 0.7), ("nose_cover", 0.3)) if place == "nose" else (("drive_lip", 1.0),)
    form = {"exponent": s.rng.uniform(0.85, 1.15), "wear": float(s.rng.choice([0.0, 4000.0]))}
    return Concealed(
        "seal_friction",
        place,
        [place, *(["shaft"] if place == "drive_end" else [])],
        heat,
        laws.SpeedHeat(places, heat, 1000.0, **form),
        parameters={"heat_per_1000rpm": (heat, "W")},
        form=form,
    )


def _windage(s: Scene) -> Concealed:
    heat = s.log(60, 250) * s.strength
    form = {"exponent": s.rng.uniform(2.6, 3.1), "delay": s.rng.uniform(0, 60)}
    shared = s.rng.uniform(0.0, 0.3)
    law = laws.SpeedHeat((("shaft_gap", 1.0 - shared), ("housing_bore", shared)), heat, 4500.0, **form)
    return Concealed(
        "windage",
        "shaft",
        ["shaft"],
        heat,
        law,
        parameters={"heat_at_4500rpm": (heat, "W")},
        form=form | {"housing_share": shared},
    )


def _drive(s: Scene) -> Concealed:
    heat = s.log(30, 130) * s.strength
    form = {
        "exponent": s.rng.uniform(0.9, 1.5),
        "delay": s.rng.uniform(100, 900),
        "load_share": s.rng.uniform(0, 0.15),
    }
    return Concealed(
        "drive_heat",
        "drive_end",
        ["drive_end"],
        heat,
        laws.SpeedHeat((("drive_end", 1.0),), heat, 3000.0, **form),
        parameters={"heat_at_3000rpm": (heat, "W")},
        form=form,
    )


def _gap_closure(s: Scene) -> Concealed:
    where, component, fine = _bearings(s)
    excess = s.reading("mean:F2.outer" if where == "F" else "mean:R1.outer") - s.reading("mean:housing")
    low, high = np.quantile(excess, [0.35, 0.9])
    onset, width = float(s.rng.uniform(low, high)), float(max(0.4, s.rng.uniform(0.1, 0.35) * (high - low)))
    open_share = float(np.exp(-s.rng.uniform(1.2, 3.2) * s.strength))
    form = {"onset": onset, "width": width, "delay": s.rng.uniform(0, 600)}
    law = laws.GapClosure(where, open_share, **form)
    return Concealed("gap_closure", component, fine, open_share, law, form=form | {"low": open_share})


def _mount(s: Scene) -> Concealed:
    difference = s.sign() * s.rng.uniform(4, 14) * s.strength
    form = {"build_up": s.rng.uniform(2000, 9000), "constant": s.rng.uniform(0.6, 1.0)}
    return Concealed(
        "mount_sink",
        "flange",
        ["flange"],
        difference,
        laws.MountSink(difference, **form),
        parameters={"temperature_above_ambient": (difference, "K")},
        form=form,
    )


def _shaft_convection(s: Scene) -> Concealed:
    amplitude = s.log(1.2, 4.0) * s.strength
    exponent = s.rng.uniform(0.7, 1.4)
    law = laws.ShaftConvection(amplitude, exponent)
    return Concealed(
        "shaft_convection",
        "shaft",
        ["shaft", "nose", "drive_end"],
        amplitude,
        law,
        form={"exponent": exponent},
    )


def _radiation(s: Scene) -> Concealed:
    amplitude = s.rng.uniform(0.8, 2.0) * s.strength
    return Concealed("radiation", "housing", ["housing"], amplitude, laws.OutsideFilm(amplitude, "radiation"))


def _natural(s: Scene) -> Concealed:
    amplitude = s.rng.uniform(3.0, 9.0) * s.strength
    exponent = s.rng.uniform(0.25, 0.4)
    law = laws.OutsideFilm(amplitude, "natural", exponent)
    return Concealed(
        "natural_convection", "housing", ["housing"], amplitude, law, form={"exponent": exponent}
    )


def _coolant_film(s: Scene) -> Concealed:
    if s.plan.oil != "constant" and s.rng.random() < 0.5:
        from .oil import channel_film

        span = channel_film(np.array([s.plan.drive.coolant_in.min(), s.plan.drive.coolant_in.max()]))[2]
        form = {
            "reynolds": float(np.interp(s.rng.uniform(0.3, 0.8), [0, 1], span)),
            "width": s.rng.uniform(25, 90),
        }
        amplitude = s.log(0.8, 3.0) * s.strength
        return Concealed(
            "coolant_film",
            "channel",
            ["channel"],
            amplitude,
            laws.FilmTransition(amplitude, **form),
            form=form | {"form": "transition"},
        )
    factor = float(np.exp(-s.rng.uniform(0.4, 1.1) * s.strength))
    growth = s.rng.uniform(0.0, 0.1)
    return Concealed(
        "coolant_film",
        "channel",
        ["channel"],
        factor,
        laws.Fouling(factor, growth),
        parameters={"factor": (factor, "")},
        form={"form": "fouling", "growth": growth},
    )


def _bypass(s: Scene) -> Concealed:
    fraction = s.rng.uniform(0.4, 0.8) * min(1.0, s.strength * 1.2)
    return Concealed(
        "coolant_bypass",
        "channel",
        ["channel"],
        fraction,
        laws.Bypass(fraction),
        parameters={"fraction": (fraction, "")},
    )


def _chiller(s: Scene) -> Concealed:
    amplitude, period = s.rng.uniform(0.6, 2.0) * s.strength, s.log(420, 2400)
    form = {
        "phase": s.rng.uniform(),
        "skew": s.rng.uniform(0.35, 0.65),
        "wander": tuple(s.rng.normal(0, 0.05, 8)),
    }
    return Concealed(
        "chiller_cycling",
        "channel",
        ["channel"],
        amplitude,
        laws.Wave(amplitude, period, **form),
        parameters={"period": (period, "s"), "amplitude": (amplitude, "K")},
        form=form | {"wander": list(form["wander"])},
    )


def _room(s: Scene) -> Concealed:
    amplitude = s.sign() * s.rng.uniform(4, 9) * s.strength
    form = {
        "shape": str(s.rng.choice(["ramp", "jump", "hump"])),
        "at": s.rng.uniform(0.3, 0.6),
        "total": float(s.plan.drive.time[-1]),
    }
    law = laws.RoomDrift(amplitude, **form)
    return Concealed("ambient_drift", "ambient", ["ambient", "flange", "housing"], amplitude, law, form=form)


def _capacity(s: Scene) -> Concealed:
    place, component = [
        ("flange", "flange"),
        ("housing_rear_top", "housing"),
        ("nose", "nose"),
        ("drive_end", "drive_end"),
        ("housing_front_top", "housing"),
    ][s.rng.integers(5)]
    capacity = s.log(5000, 20000) * s.strength
    form = {"conductance": s.log(8, 30)}
    return Concealed(
        "heat_capacity",
        component,
        [component, *(["shaft"] if place in ("nose", "drive_end") else [])],
        capacity,
        laws.ExtraMass(place, capacity, **form),
        parameters={"capacity": (capacity, "J/K")},
        form=form | {"place": place},
    )


_PLACES = {
    "housing_middle_top": ("housing", ["SP04", "housing"]),
    "housing_front_top": ("housing", ["housing", "front_bearings"]),
    "housing_rear_top": ("housing", ["housing", "SP05", "rear_bearings"]),
    "flange_rim": ("flange", ["flange"]),
    "nose": ("nose", ["nose", "shaft"]),
    "drive_end": ("drive_end", ["drive_end", "shaft"]),
    "shaft_middle": ("shaft", ["shaft"]),
    "housing_middle_bottom": ("housing", ["housing"]),
    "housing_bore": ("housing", ["SP04", "housing"]),
    "F2.outer": ("F2", ["F1", "F2", "F3", "front_bearings"]),
}


def _intervals(s: Scene) -> tuple[tuple[float, float, float], ...]:
    total = float(s.plan.drive.time[-1])
    count = int(s.rng.choice([1, 1, 2, 3]))
    cuts = np.sort(s.rng.uniform(0.08, 0.95, 2 * count)) * total
    spans = []
    for start, end in cuts.reshape(-1, 2):
        end = min(total, max(end, start + 0.12 * total))
        if spans and start < spans[-1][1] + 900.0:
            continue
        spans.append(
            (round(start / 60) * 60.0, round(end / 60) * 60.0, float(np.exp(0.12 * s.rng.standard_normal())))
        )
    return tuple(spans)


def _source(s: Scene) -> Concealed:
    place = str(s.rng.choice(list(_PLACES)))
    component, fine = _PLACES[place]
    watts = s.log(30, 120) * s.strength * (1.5 if component in ("nose", "flange", "shaft") else 1.0)
    spans = _intervals(s)
    form = {"delay": s.rng.uniform(30, 500)}
    mean = watts * sum(v * (b - a) for a, b, v in spans) / sum(b - a for a, b, _ in spans)
    return Concealed(
        "unrecorded_heat_source",
        component,
        list(fine),
        watts,
        laws.Intervals(place, watts, spans, **form),
        parameters={"heat": (mean, "W")},
        intervals=[[a, b] for a, b, _ in spans],
        form=form | {"place": place},
    )


def _cooling(s: Scene) -> Concealed:
    place = str(
        s.rng.choice(
            [
                "housing_middle_top",
                "housing_rear_top",
                "housing_all",
                "housing_rear_all",
                "flange_rim",
                "drive_end",
            ]
        )
    )
    component, fine = _PLACES.get(place, ("housing", ["housing"]))
    conductance = s.log(4, 12) * s.strength
    spans = _intervals(s)
    form = {"delay": s.rng.uniform(30, 500)}
    return Concealed(
        "unrecorded_cooling",
        component,
        list(fine),
        conductance,
        laws.Intervals(place, 0.0, spans, conductance=conductance, **form),
        parameters={"conductance": (conductance, "W/K")},
        intervals=[[a, b] for a, b, _ in spans],
        form=form | {"place": place},
    )


def _thrust_heat(s: Scene) -> Concealed:
    place = str(s.rng.choice(["shaft_front", "housing_behind_front", "housing_bore", "flange_rim"]))
    component = {"shaft_front": "shaft", "flange_rim": "flange"}.get(place, "housing")
    watts = s.log(40, 120) * s.strength
    exponent = s.rng.uniform(0.8, 1.4)
    return Concealed(
        "unrecorded_heat_source",
        component,
        [component, "front_bearings", "shaft", "housing"],
        watts,
        laws.LoadHeat(place, watts, exponent),
        follows="thrust",
        outside_catalogue=True,
        form={"place": place, "exponent": exponent, "law": "heat follows the thrust"},
    )


def _brake_heat(s: Scene) -> Concealed:
    watts = s.log(1500, 5000) / 60.0 * s.strength
    return Concealed(
        "unrecorded_heat_source",
        "drive_end",
        ["drive_end", "shaft"],
        watts,
        laws.BrakeHeat("drive_end", watts),
        follows="change of speed",
        outside_catalogue=True,
        form={"law": "heat from every change of speed"},
    )


MACHINE_EFFECTS: dict[str, Callable[[Scene], Concealed]] = {
    "heat_scale": _heat_scale,
    "heat_split": _heat_split,
    "joint_conductance": _joint,
    "thermal_preload": _thermal_preload,
    "viscosity_heat": _viscosity,
    "grease_churning": _churning,
    "starvation": _starvation,
    "seal_friction": _seal,
    "windage": _windage,
    "drive_heat": _drive,
    "gap_closure": _gap_closure,
    "mount_sink": _mount,
    "shaft_convection": _shaft_convection,
    "radiation": _radiation,
    "natural_convection": _natural,
    "coolant_film": _coolant_film,
    "coolant_bypass": _bypass,
    "chiller_cycling": _chiller,
    "ambient_drift": _room,
    "heat_capacity": _capacity,
    "unrecorded_heat_source": _source,
    "unrecorded_cooling": _cooling,
}
FOREIGN_EFFECTS: dict[str, Callable[[Scene], Concealed]] = {
    "thrust_heat": _thrust_heat,
    "brake_heat": _brake_heat,
}
EVERY_EFFECT = MACHINE_EFFECTS | SENSOR_EFFECTS | FOREIGN_EFFECTS
