"""What is set over a composition that is kept is what Hydra would compose."""

import pytest
from omegaconf import OmegaConf

from warp_torchrl.runs.config import compose
from warp_torchrl.runs.config.compose import ConfigError, compose_config, conf_folder


@pytest.mark.parametrize(
    "overrides",
    [
        ["team.n_agents=2", "scenario=ring", "wind.speed=3.5"],
        ["algorithm=dqn", "algorithm.gamma=0.9", "algorithm.gamma=0.8", "start_from='a b'"],
        ["experiment=generalist", "mixture.kinds={ring:{share:2}}", "imitation.teacher=null"],
        ["curriculum=success", "curriculum.over={ignition:{count:[1,2]}}", "total_frames=1_000", "seed=1e3"],
        ["landscape=raster", "landscape.path='$HOME/ä'", "+landscape.more=1", "~imitation.until", "hydra.job.name=x"],
        ["team={n_agents:3}", "observation.channels=[age,ash]", "evaluation.mode="],
    ],
)
def test_it_equals_what_hydra_composes(overrides: list[str]) -> None:
    config = compose._composed(conf_folder(), 0, "train", tuple(overrides))
    assert OmegaConf.to_yaml(config) == OmegaConf.to_yaml(compose._composed_by_hydra(conf_folder(), "train", overrides))
    assert OmegaConf.is_struct(config)


def test_options_are_composed_once_whatever_values_are_set(monkeypatch: pytest.MonkeyPatch) -> None:
    compose._composed.cache_clear()
    by_hydra, asked = compose._composed_by_hydra, []
    monkeypatch.setattr(compose, "_composed_by_hydra", lambda *given: asked.append(given[2]) or by_hydra(*given))
    sizes = [
        compose_config("train", ["scenario=large", f"landscape.size={size}"]).landscape.size for size in (16, 24, 32)
    ]
    assert sizes == [16, 24, 32] and asked == [("scenario=large",)]
    assert compose_config("train", ["scenario=large"]).landscape.size == 64, "what is kept stays as it was"


@pytest.mark.parametrize("overrides", [["team.n_agent=2"], ["wind.speed=1,2"], ["wind.speed.x=1"], ["seed=3", "x@y=2"]])
def test_a_mistake_is_told_as_hydra_finds_it(overrides: list[str]) -> None:
    with pytest.raises(ConfigError) as quick:
        compose_config("train", overrides)
    with pytest.raises(compose.HYDRA_ERRORS) as slow:
        compose._composed_by_hydra(conf_folder(), "train", overrides)
    assert str(quick.value) == str(compose.explain(slow.value, "train", overrides))
