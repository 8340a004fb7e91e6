"""Definitions of written networks and manifests of recordings as text, one entry for each thing in them."""


def quantity(value):
    """TOML of a text with its unit, of (text, relative sigma), or of a mapping of texts."""
    if isinstance(value, tuple):
        return f'{{value = "{value[0]}", sigma_rel = {value[1]}}}'
    if isinstance(value, dict):
        return "{" + ", ".join(f'{key} = "{text}"' for key, text in value.items()) + "}"
    return f'"{value}"' if isinstance(value, str) else f"{value}"


def network_text(name, nodes, links, sources, boundaries=None, **settings):
    """A ``[network]`` machine.

    Parameters
    ----------
    nodes : mapping of name to capacity
    links : mapping of "one|other" to conductance
    sources : sequence of (node, input, gain, further keys)
    boundaries : mapping of name to temperature
        Only ``ambient``, read from its input, by default.
    settings
        Keys of the machine itself.
    """
    lines = ['schema = "spindle-fem/machine/1"', f'name = "{name}"']
    lines += [f"{key} = {quantity(value)}" for key, value in settings.items()]
    for node, capacity in nodes.items():
        lines += ["[[network.node]]", f'name = "{node}"', f"capacity = {quantity(capacity)}"]
    for boundary, temperature in (boundaries or {"ambient": "ambient"}).items():
        lines += ["[[network.boundary]]", f'name = "{boundary}"', f"temperature = {quantity(temperature)}"]
    for link, conductance in links.items():
        one, other = link.split("|")
        lines += ["[[network.link]]", f'between = ["{one}", "{other}"]']
        lines += [f"conductance = {quantity(conductance)}"]
    for node, drive, gain, *further in sources:
        lines += ["[[network.source]]", f'node = "{node}"', f'input = "{drive}"', f"gain = {quantity(gain)}"]
        lines += [f"{key} = {quantity(value)}" for more in further for key, value in more.items()]
    return "\n" + "\n".join(lines) + "\n"


# Unit of an input and how it goes on between two stamps.
INPUTS = {
    "speed": ("rpm", "previous"),
    "thrust": ("N", "previous"),
    "power": ("W", "previous"),
    "electrical_power": ("W", "previous"),
    "ambient": ("degC", "linear"),
    "coolant_inlet": ("degC", "linear"),
}
READ = '{column = "%s", role = "temperature", probe = "%s", unit = "degC", sigma = 0.1},'
DRIVEN = '{column = "%s", role = "input", drives = "%s", unit = "%s", hold = "%s"},'


def manifest_text(name, temperatures, inputs, *, data="data.csv", time="time_s"):
    """A manifest: temperatures in °C with noise of 0.1 K, inputs in the units of ``INPUTS``.

    Parameters
    ----------
    temperatures : mapping of column to probe
    inputs : mapping of column to input
    """
    lines = ['schema = "spindle-fem/recording/1"', f'name = "{name}"', f'data = "{data}"']
    lines += [f'time = {{column = "{time}", unit = "s"}}', "channel = ["]
    lines += [READ % item for item in temperatures.items()]
    lines += [DRIVEN % (column, drive, *INPUTS[drive]) for column, drive in inputs.items()]
    return "\n" + "\n".join(lines) + "\n]\n"
