"""Terms of effects made up for tests: each uses one more thing that a term may do."""

import numpy as np

from spindle_fem.effects.framework.term import Term, TermParameter


class Feedback(Term):
    """Heat that grows with a ring's own excess over its neighbour."""

    name = "feedback"
    parameters = (TermParameter("gain", 3.0, 0.5, "W/K"), TermParameter("shift", 1.0, 1.0, "K", False))
    heat_places = ("F1.inner_raceway", "fluid.coolant_inlet", "fluid.housing.flange_back")
    reads = ("F1.inner_ring", "F1.outer_ring")

    def heat(self, context):
        excess = context.temperatures[0] - context.temperatures[1] + context.parameters["shift"]
        own = context.parameters["gain"] * excess * context.inputs["speed"] / 300.0
        return np.array([own, 0.02 * own, 0.1 * own])


class Closure(Term):
    """Contacts and outside film that improve with temperature."""

    name = "closure"
    parameters = (TermParameter("slope", 0.05, 0.5, "1/K"),)
    coefficients = ("joint.F1.outer_ring|housing", "film.housing.outside")
    reads = ("F1.outer_ring", "housing")

    def factor(self, context):
        slope = context.parameters["slope"]
        ring, housing = context.temperatures
        return np.array(
            [1.0 + slope * (ring - housing) ** 2, 1.0 + slope * (housing - context.inputs["ambient"])]
        )


class Fading(Term):
    """Heat that fades while the machine turns, remembered in a state."""

    name = "fading"
    parameters = (TermParameter("heat", 30.0, 0.5, "W"), TermParameter("time", 1500.0, 0.5, "s"))
    heat_places = ("R1.balls",)
    reads = ("housing",)
    n_states = 1

    def initial_state(self, parameters):
        return np.ones(1)

    def heat(self, context):
        return (context.parameters["heat"] * context.state[0])[None]

    def advance(self, context, step):
        rate = (context.inputs["speed"] / 300.0) * (context.temperatures / 300.0) / context.parameters["time"]
        return context.state * np.exp(-step * rate)


class Steady(Term):
    """Bypass, extra mass and an extra path to the air."""

    name = "steady"
    parameters = (
        TermParameter("bypass", 0.1, 0.5),
        TermParameter("mass", 800.0, 0.5, "J/K"),
        TermParameter("path", 1.5, 0.5, "W/K"),
    )

    def operating_factor(self, point, parameters):
        return {"coolant.flow": 1.0 - parameters["bypass"]}

    def place_capacity(self, parameters):
        return {"cover": parameters["mass"]}

    def place_conductance(self, parameters):
        return {"shaft": parameters["path"]}


class Friction(Term):
    """Friction that grows with what the rings differ by, after a while."""

    name = "friction"
    parameters = (
        TermParameter("gain", 0.03, 0.02, logarithmic=False),
        TermParameter("time", 600.0, 0.5, "s"),
    )
    bearings = ("F1", "R2")
    reads = ("F1.inner_raceway", "F1.outer_raceway")
    n_states = 1

    def friction(self, context):
        factor = 1.0 + context.parameters["gain"] * context.state[0] ** 2
        return np.vstack((factor, 0.5 + 0.5 * factor))

    def advance(self, context, step):
        difference = context.temperatures[0] - context.temperatures[1]
        kept = np.exp(-step / context.parameters["time"])
        return kept * context.state + (1.0 - kept) * difference


class Room(Term):
    """Air beside the housing that follows nothing but time and its own memory."""

    name = "room"
    parameters = (TermParameter("change", 3.0, 1.0, "K", False), TermParameter("time", 1200.0, 0.5, "s"))
    heat_places = ("fluid.housing.outside",)
    n_states = 1

    def heat(self, context):
        swing = 1.0 + 0.3 * np.sin(context.time / 700.0)
        return (context.parameters["change"] * swing * context.state[0])[None]

    def advance(self, context, step):
        kept = np.exp(-step / context.parameters["time"])
        return kept * context.state + (1.0 - kept)


class Plume(Term):
    """The same air, warmed by the housing itself with a lag."""

    name = "plume"
    parameters = (TermParameter("share", 0.2, 0.1), TermParameter("time", 800.0, 0.5, "s"))
    heat_places = ("fluid.housing.outside",)
    reads = ("housing",)
    n_states = 1

    def heat(self, context):
        excess = context.temperatures[0] - context.inputs["ambient"]
        return (context.parameters["share"] * (context.state[0] + 0.5 * excess))[None]

    def advance(self, context, step):
        excess = context.temperatures - context.inputs["ambient"]
        kept = np.exp(-step / context.parameters["time"])
        return kept * context.state + (1.0 - kept) * excess


class RunningIn(Term):
    """Friction that fades with time, whatever the temperatures are."""

    parameters = (TermParameter("extra", 0.4, 0.2), TermParameter("time", 2000.0, 0.5, "s"))
    bearings = ("F1", "F2")

    def __init__(self, name):
        self.name = name

    def friction(self, context):
        factor = 1.0 + context.parameters["extra"] * np.exp(-context.time / context.parameters["time"])
        return np.vstack((factor, factor))


class LaterFriction(Friction):
    """The same bearings once more."""

    name = "later"


TERMS = (Feedback(), Closure(), Fading(), Steady(), Friction())
# Several that scale the friction of one bearing, with and without a look at temperatures.
FRICTIONS = (Friction(), RunningIn("first"), LaterFriction(), RunningIn("second"))
# Two that shift the fluid of a film, one known before the march and one not, and one that scales the film.
SHIFTED = (Closure(), Room(), Plume())
