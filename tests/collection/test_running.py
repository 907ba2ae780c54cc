"""Collections: how a worker has ended, and what goes on after a checkpoint."""

from types import SimpleNamespace

import torch
from tensordict import TensorDict

from warp_torchrl.collection.running import MultiProcessCollection, _reason


def test_workers_that_have_ended_are_named_with_their_signal_or_code():
    procs = [SimpleNamespace(exitcode=code) for code in (-9, None, 0, 3)]
    found = _reason(SimpleNamespace(procs=procs), RuntimeError("a pipe"))
    assert found == "worker 0 by signal 9, worker 3 by exit code 3"
    assert _reason(SimpleNamespace(), RuntimeError("a pipe\nis broken")) == "a pipe"
    assert _reason(None, RuntimeError()) == "RuntimeError"


def test_workers_begin_with_episodes_that_were_not_played_before():
    begun = []

    def start(first_episode):
        begun.append(first_episode)
        batch = TensorDict({"collector": torch.zeros(2, 3, 4), "state": torch.arange(24).view(2, 3, 4)}, [2, 3, 4])
        return iter([batch, batch])

    collection = MultiProcessCollection(start, steps=4, device=torch.device("cpu"))
    first, _ = list(collection)
    assert begun == [0] and collection.state_dict() == {"played": 8}
    assert first.batch_size == (6, 4) and "collector" not in first.keys()
    assert torch.equal(first["state"], torch.arange(24).view(6, 4)), "worker after worker"
    resumed = MultiProcessCollection(start, steps=4, device=torch.device("cpu"))
    resumed.load_state_dict({"played": 8})
    next(iter(resumed))
    resumed.start_anew(20)
    next(iter(resumed))
    assert begun == [0, 8, 20] and resumed.state_dict() == {"played": 24}
