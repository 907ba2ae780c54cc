"""Names that an entry of an observation can have."""

import pytest

from warp_torchrl.env.specs import check_names


@pytest.mark.parametrize("name", ["self", "shape", "device", "batch_size", "lambda", "two words", "2nd", "a.b"])
def test_an_entry_that_torchrl_cannot_pass_as_a_keyword_is_refused(name):
    with pytest.raises(ValueError, match=rf"observation entries must be named by identifiers, .*, got '{name}'"):
        check_names(["view", name])
    check_names(["", "view", "status", "picture", "near", "bearing"])
