import numpy as np
import pytest

from spindle_fem.definition.exchange_tables import JointGroup
from spindle_fem.errors import OutOfValidityError
from spindle_fem.physics.surroundings.joint_laws.filled_gap import gap_conductance
from spindle_fem.physics.surroundings.joint_laws.mikic_elastic import joint_conductance_mikic_elastic
from spindle_fem.physics.surroundings.joint_laws.tight_seat import mean_plane_separation, seat_conductance
from spindle_fem.physics.surroundings.joint_laws.yovanovich import joint_conductance_yovanovich

GROUND = (43.9, 1e-6, 0.1, 3e9)


def test_yovanovich_by_hand():
    # 1.25·43.9·(0.1/1e-6)·(10/3000)^0.95
    assert float(joint_conductance_yovanovich(10e6, 43.9, 1e-6, 0.1, 3e9)) == pytest.approx(24334.0, rel=1e-3)
    assert float(joint_conductance_yovanovich(0.0, 43.9, 1e-6, 0.1, 3e9)) == 0.0


def test_mikic_by_hand_and_exponent():
    one = joint_conductance_mikic_elastic(10e6, 43.9, 1e-6, 0.1, 113.2e9)
    # 1.55·43.9e5·(1.2493e-3)^0.94
    assert float(one) == pytest.approx(12697.0, rel=1e-3)
    two = joint_conductance_mikic_elastic(20e6, 43.9, 1e-6, 0.1, 113.2e9)
    assert float(two / one) == pytest.approx(2.0**0.94, rel=1e-12)


def test_gap_conducts_as_a_layer_of_gas_with_its_jump():
    assert float(gap_conductance(1e-3)) == pytest.approx(26.0, rel=1e-3)
    assert float(gap_conductance(0.0)) == pytest.approx(0.026 / 0.37e-6)
    assert float(gap_conductance(5e-6, 0.14, 0.0)) == pytest.approx(28000.0)


def test_separation_falls_with_pressure():
    y = mean_plane_separation([1e6, 1e7], 1e-6, 3e9)
    assert y[0] > y[1] > 1e-6
    assert y[0] / y[1] == pytest.approx(10.0**0.097)


def test_seat_conductance_has_no_jump_where_the_ring_comes_loose():
    found = seat_conductance([0.0, 0.0, 0.1], *GROUND, [1e-12, 0.0, 0.0])
    np.testing.assert_allclose(found, found[1], rtol=1e-4)


def test_seat_conductance_grows_with_pressure_and_falls_with_the_gap():
    assert (np.diff(seat_conductance(np.linspace(0.0, 6e6, 31), *GROUND)) > 0.0).all()
    assert (np.diff(seat_conductance(0.0, *GROUND, np.linspace(0.0, 10e-6, 31))) < 0.0).all()


def test_seats_of_the_reference_spindle_are_of_the_assumed_size():
    # Inner rings (10 µm interference, 1.5 MPa) 10 000 W/(m²K) with 30 %, outer rings (5 µm clearance)
    # 4000 with 40 %; ground surfaces, 1 µm rms together.
    assert 6e3 < float(seat_conductance(1.51e6, *GROUND)) < 16e3
    assert 2e3 < float(seat_conductance(0.0, *GROUND, 2.5e-6)) < 8e3


def test_a_definition_takes_a_law_with_units_and_writes_the_value():
    law = {"law": "yovanovich", "pressure": "10 MPa", "conductivity": "43.9 W/m/K"}
    law |= {"roughness": "1 um", "slope": 0.1, "microhardness": "3 GPa", "sigma_rel": 0.3}
    joint = JointGroup.model_validate({"name": "seat", "contacts": ["a|b"], "conductance": law})
    assert joint.conductance.value == pytest.approx(24334.0, rel=1e-3)
    assert joint.conductance.sigma_log == 0.3
    again = JointGroup.model_validate(joint.model_dump(mode="json"))
    assert again.conductance == joint.conductance


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"law": "yovanovic"}, 'Did you mean "yovanovich"'),
        ({"pressure": "100 GPa"}, "treat the joint as perfect"),
        ({"hardness": "3 GPa"}, "hardness: is unknown"),
        ({"slope": None}, 'law = "yovanovich" needs it'),
        ({"pressure": 3.0}, "pressure"),
    ],
)
def test_a_definition_refuses_a_wrong_law(change, message):
    law = {"law": "yovanovich", "pressure": "10 MPa", "conductivity": "43.9 W/m/K"}
    law |= {"roughness": "1 um", "slope": 0.1, "microhardness": "3 GPa"} | change
    law = {key: value for key, value in law.items() if value is not None}
    with pytest.raises(ValueError, match="conductance") as caught:
        JointGroup.model_validate({"name": "seat", "contacts": ["a|b"], "conductance": law})
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: joint_conductance_yovanovich(-1.0, 40.0, 1e-6, 0.1, 3e9), "pressure is -1"),
        (lambda: joint_conductance_yovanovich(1e9, 40.0, 1e-6, 0.1, 3e9), "treat the joint as perfect"),
        (lambda: joint_conductance_yovanovich(1e6, 40.0, 0.0, 0.1, 3e9), "roughness is 0"),
        (lambda: joint_conductance_mikic_elastic(1e6, 40.0, 1e-6, 0.1, -1.0), "contact_modulus is -1"),
        (lambda: mean_plane_separation(0.0, 1e-6, 3e9), "give the clearance as separation"),
        (lambda: gap_conductance(-1e-6), "separation is -1e-06, allowed at least 0"),
        (lambda: gap_conductance(0.0, 0.026, 0.0), "heat_path is 0, allowed above 0"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(OutOfValidityError) as caught:
        call()
    assert message in str(caught.value)
