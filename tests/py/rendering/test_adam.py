"""Adam compared with that of PyTorch, and its map."""

import copy
import pickle

import numpy as np
import pytest
import scenes
import torch

import gslts
from gslts.rendering.adam import AdamOptions, AdamState
from gslts.rendering.rasterizer import Gradients

RATES = gslts.AdamRates(
    means=1e-2,
    quats=2e-2,
    log_scales=3e-2,
    logit_opacities=4e-2,
    sh_dc=5e-2,
    sh_rest=6e-2,
    features=7e-2,
)


def random_gradients(gaussian_map: gslts.GaussianMap, rows: list[int], seed: int) -> Gradients:
    rng = np.random.default_rng(seed)

    def like(array: np.ndarray) -> np.ndarray:
        shape = (len(rows), *array.shape[1:])
        return (rng.normal(size=shape) * np.exp(3 * rng.normal(size=shape))).astype(array.dtype)

    return Gradients(
        rows=np.array(rows, np.uint32),
        dL_dmeans=like(gaussian_map.means),
        dL_dquats=like(gaussian_map.quats),
        dL_dlog_scales=like(gaussian_map.log_scales),
        dL_dlogit_opacities=like(gaussian_map.logit_opacities),
        dL_dsh=like(gaussian_map.sh),
        dL_dfeatures=like(gaussian_map.features),
        dL_dtwist=np.zeros(6),
    )


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, 2e-5), (np.float64, 1e-12)])
def test_steps_are_those_of_pytorch(dtype: type, tolerance: float) -> None:
    start = scenes.random_map(7, sh_degree=2, feature_dims=3, dtype=dtype)
    names = ("means", "quats", "log_scales", "logit_opacities", "features")
    parameters = {name: torch.tensor(getattr(start, name)) for name in names}
    parameters["sh_dc"] = torch.tensor(start.sh[:, :1])
    parameters["sh_rest"] = torch.tensor(start.sh[:, 1:])
    expected = torch.optim.Adam(
        [{"params": [value], "lr": getattr(RATES, name)} for name, value in parameters.items()],
        betas=(0.9, 0.999),
        eps=1e-15,
    )
    adam = gslts.Adam(start)
    for seed in range(30):
        gradients = random_gradients(start, list(range(7)), seed)
        adam.step(gradients, RATES)
        for name in names:
            parameters[name].grad = torch.tensor(getattr(gradients, f"dL_d{name}"))
        parameters["sh_dc"].grad = torch.tensor(gradients.dL_dsh[:, :1])
        parameters["sh_rest"].grad = torch.tensor(gradients.dL_dsh[:, 1:])
        expected.step()
    for name in names:
        np.testing.assert_allclose(
            getattr(adam.map, name), parameters[name].numpy(), rtol=0, atol=tolerance, err_msg=name
        )
    sh = np.concatenate([parameters["sh_dc"].numpy(), parameters["sh_rest"].numpy()], axis=1)
    np.testing.assert_allclose(adam.map.sh, sh, rtol=0, atol=tolerance)


def test_the_map_changes_and_its_start_does_not() -> None:
    start = scenes.random_map(5, dtype=np.float32)
    before = start.means.copy()
    adam = gslts.Adam(start)
    live = adam.map
    adam.step(random_gradients(start, [1, 3], 0), RATES)
    assert live is adam.map
    np.testing.assert_array_equal(start.means, before)
    moved = np.any(live.means != before, axis=1)
    assert moved.tolist() == [False, True, False, True, False]
    np.testing.assert_array_equal(live.ids, start.ids)
    with pytest.raises(ValueError, match="read-only"):
        live.means[0] = 0


def test_the_map_outlives_the_optimizer() -> None:
    start = scenes.random_map(2000, dtype=np.float32)
    means = gslts.Adam(start).map.means
    np.testing.assert_array_equal(means, start.means)


def test_continues_from_its_state_exactly() -> None:
    start = scenes.random_map(6, sh_degree=1, dtype=np.float32)
    adam = gslts.Adam(start)
    for seed in range(4):
        adam.step(random_gradients(start, [0, 2, 5], seed), RATES)
    restored = gslts.Adam(adam.map, state=adam.state)
    for seed in range(4, 8):
        gradients = random_gradients(start, [0, 1, 5], seed)
        adam.step(gradients, RATES)
        restored.step(gradients, RATES)
    for name in ("means", "quats", "sh"):
        np.testing.assert_array_equal(getattr(adam.map, name), getattr(restored.map, name))
    np.testing.assert_array_equal(adam.state.second, restored.state.second)
    np.testing.assert_array_equal(adam.state.steps, np.repeat([[8], [4], [4], [0], [0], [8]], 7, 1))


def test_one_number_of_steps_counts_for_all_groups() -> None:
    start = scenes.random_map(3, dtype=np.float32)
    adam = gslts.Adam(start)
    for seed in range(3):
        adam.step(random_gradients(start, [0, 2], seed), RATES)
    state = adam.state
    short = AdamState(state.first, state.second, np.array([3, 0, 3], np.uint32))
    restored = gslts.Adam(adam.map, state=short)
    np.testing.assert_array_equal(restored.state.steps, state.steps)


def test_groups_count_their_own_steps() -> None:
    start = scenes.random_map(1, dtype=np.float32)
    adam = gslts.Adam(start)
    adam.step(random_gradients(start, [0], 0), gslts.AdamRates(sh_dc=0.1))
    adam.step(random_gradients(start, [0], 1), gslts.AdamRates(means=0.1, sh_dc=0.1))
    assert adam.state.steps.tolist() == [[1, 0, 0, 0, 2, 0, 0]]
    assert not adam.state.first[0, 3:11].any()


def test_an_edit_keeps_moments() -> None:
    start = scenes.random_map(4, dtype=np.float32)
    adam = gslts.Adam(start)
    adam.step(random_gradients(start, [0, 1, 2], 0), RATES)
    edited = adam.edit(scenes.random_map(3, dtype=np.float32), np.array([2, -1, 0]))
    assert edited.map.size == 3
    assert edited.state.steps.tolist() == [[1] * 7, [0] * 7, [1] * 7]
    np.testing.assert_array_equal(edited.state.first[[0, 2]], adam.state.first[[2, 0]])
    assert not edited.state.second[1].any()


def test_errors_name_the_argument() -> None:
    start = scenes.random_map(3, dtype=np.float32)
    adam = gslts.Adam(start)
    with pytest.raises(ValueError, match=r"rows\[1\] is 3"):
        adam.step(random_gradients(start, [0, 3], 0), RATES)
    other = scenes.random_map(3, sh_degree=1, dtype=np.float32)
    with pytest.raises(ValueError, match=r"dL_dsh: expected .*float32.*\(2, 1, 3\)"):
        adam.step(random_gradients(other, [0, 1], 0), RATES)
    with pytest.raises(ValueError, match="rates must not be negative"):
        adam.step(random_gradients(start, [0], 0), gslts.AdamRates(means=-1))
    with pytest.raises(ValueError, match="beta1 and beta2"):
        gslts.Adam(start, AdamOptions(beta1=1))
    with pytest.raises(ValueError, match=r"first: expected .*\(4, \*\), got float32 \(3, 14\)"):
        gslts.Adam(scenes.random_map(4, dtype=np.float32), state=adam.state)
    with pytest.raises(ValueError, match=r"rows\[0\] is 3"):
        adam.edit(start.select(np.array([0])), np.array([3]))
    assert not adam.state.steps.any()
    state = adam.state
    wrong = (("first", np.nan), ("second", np.nan), ("second", -1), ("steps", 2**32 - 1))
    for name, value in wrong:
        getattr(state, name)[1, 2] = value
        with pytest.raises(ValueError, match=f"Adam: {name} "):
            gslts.Adam(start, state=state)
        getattr(state, name)[1, 2] = 0
    with pytest.raises(ValueError, match=r"steps: expected .*\(3, 7\), got uint32 \(2, 7\)"):
        gslts.Adam(start, state=AdamState(state.first, state.second, state.steps[:2]))


@pytest.mark.parametrize("values", [AdamOptions(beta1=0.5, beta2=0.75, eps=0.1), RATES])
def test_options_survive_copies(values: AdamOptions | gslts.AdamRates) -> None:
    names = [name for name in dir(values) if not name.startswith("_")]
    for copied in (pickle.loads(pickle.dumps(values)), copy.deepcopy(values)):
        assert type(copied) is type(values)
        for name in names:
            assert getattr(copied, name) == getattr(values, name) != 0
