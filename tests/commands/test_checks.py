"""A command's configuration is checked as Hydra composed it, before a folder is made."""

import sys

import pytest
from hydra._internal.config_loader_impl import ConfigLoaderImpl

from warp_torchrl.commands.command import evaluate, train


@pytest.fixture
def composed(monkeypatch):
    """Count what Hydra composes."""
    names, load = [], ConfigLoaderImpl._load_configuration_impl

    def counted(self, config_name, overrides, **options):
        names.append(config_name)
        return load(self, config_name=config_name, overrides=overrides, **options)

    monkeypatch.setattr(ConfigLoaderImpl, "_load_configuration_impl", counted)
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    return names


@pytest.mark.parametrize(
    ("command", "mistake", "told"),
    [
        (train, "n_worlds=0", "n_worlds must be in 1..1048576, got 0"),
        (train, "+no_such_key=1", "no_such_key is not a key of the configuration"),
        (train, "+hydra.jobs.name=x", "hydra.jobs is not a key of the configuration: did you mean hydra.job?"),
        (evaluate, "+debug.x=1", "debug must be true or false, got {'x': 1}"),
        (evaluate, "policy=nobody", "policy must be one of"),
        (evaluate, "overwrite=true", "give either checkpoint=PATH or policy=NAME"),
    ],
)
def test_a_mistake_is_found_in_what_hydra_composed(composed, monkeypatch, tmp_path, capsys, command, mistake, told):
    folder = tmp_path / "run"
    monkeypatch.setattr(sys, "argv", ["command", mistake, f"hydra.run.dir={folder}"])
    with pytest.raises(SystemExit) as ended:
        command()
    assert ended.value.code == 2 and told in capsys.readouterr().err
    assert len(composed) == 2 and not folder.exists()  # Hydra does so twice: first to learn whether this is a sweep
