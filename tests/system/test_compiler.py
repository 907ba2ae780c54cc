"""The log of a run has no lines of torch's compiler."""

import logging

import torch
from torch.utils import cpp_extension

from warp_torchrl.system.compiler import compile_function


def test_it_says_nothing_of_cuda_home_where_there_is_no_gpu(monkeypatch, caplog):
    monkeypatch.setenv("CUDA_HOME", "/usr/local/cuda")
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    monkeypatch.setattr(logging.getLogger("torch.utils.cpp_extension"), "level", logging.NOTSET)
    logging.getLogger("torch.utils.cpp_extension").manager._clear_cache()
    cpp_extension._find_cuda_home()
    assert "CUDA_HOME" in caplog.text, "this is what it says"
    caplog.clear()
    compile_function(torch.sin)
    cpp_extension._find_cuda_home()
    assert not caplog.text
