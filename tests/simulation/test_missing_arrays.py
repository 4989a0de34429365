"""Arrays that a run did not record: false in a condition, and an error in each other use."""

import copy
import pickle

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

PLAIN = pn.simulate(pn.load("four_bar"), 0.01, record=())
RECORDS = {"a": "a", "tau": "tau", "F_ideal": "forces", "F_nonideal": "forces", "lam": "forces"}
RECORDS |= {"lam_ideal": "forces", "limits": "laws"}
USES = {
    "item": lambda x: x[-1],
    "column": lambda x: x[:, 0],
    "length": len,
    "shape": lambda x: x.shape,
    "sum": lambda x: 2.0 * x + 1.0,
    "negative": lambda x: -x,
    "product": lambda x: np.eye(2) @ x,
    "comparison": lambda x: x > 0.0,
    "loop": list,
    "array": np.asarray,
    "norm": np.linalg.norm,
    "zip": lambda x: list(zip(x, [0.0], strict=True)),
}


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("field", RECORDS)
def test_each_use_of_an_array_names_its_record(field: str, use: str) -> None:
    array = getattr(PLAIN, field)
    assert not array
    with pytest.raises(
        pn.InputError, match=rf'^run\.{field} was not recorded; pass record=.*"{RECORDS[field]}"'
    ):
        USES[use](array)


@pytest.mark.parametrize("field", RECORDS)
def test_the_named_record_gives_the_array(field: str) -> None:
    run = pn.simulate(pn.load("four_bar"), 0.01, record=RECORDS[field])
    assert run.recorded(field)
    assert not PLAIN.recorded(field)
    assert len(getattr(run, field)) == len(run)


def test_copies_files_and_samples_keep_what_is_missing(tmp_path: object) -> None:
    for run in (
        copy.deepcopy(PLAIN),
        pickle.loads(pickle.dumps(PLAIN)),
        PLAIN.first(1),
        pn.Trajectory.load(PLAIN.save(f"{tmp_path}/run.npz")),
    ):
        assert not run.recorded("a")
        assert repr(run.a) == '<run.a was not recorded; pass record="a" to simulate>'
    dense = pn.simulate(pn.load("four_bar"), 0.01, record="dense")
    with pytest.raises(pn.InputError, match=r"run\.tau was not recorded"):
        dense.at(0.005).tau.sum()


def test_runs_without_elements_record_empty_limits() -> None:
    run = pn.simulate(pn.Scene(pin.buildSampleModelManipulator()), 0.01, record="laws")
    assert run.limits.shape == (len(run), 0)


def test_records_of_joints_and_laws_name_their_records() -> None:
    with pytest.raises(
        pn.InputError, match=r'^run.joint\("crank_joint"\).tau was not recorded; pass record="tau"'
    ):
        PLAIN.joint("crank_joint").tau.max()
    law = PLAIN.law(PLAIN.law_names[0])
    with pytest.raises(pn.InputError, match=r'\.force was not recorded; pass record="laws" to simulate$'):
        abs(law.force)
    with pytest.raises(pn.InputError, match=r'\.limit was not recorded; pass record="laws" or "forces"'):
        law.limit[0]


def test_a_field_that_does_not_exist_is_named() -> None:
    with pytest.raises(pn.UnknownNameError, match='no field "lamb" of a run; nearest: "lam"'):
        PLAIN.recorded("lamb")
